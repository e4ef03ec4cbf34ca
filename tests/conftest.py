"""Fixtures for all tests: small pictures, projects on disk, a model without a network."""

import signal

import pytest
from hypothesis import settings
from pictures import picture
from stub_server import Stub

from vqa_state import cli, models
from vqa_state.answers.answer import Answer
from vqa_state.images.augmentation import Augmentation
from vqa_state.project.project import Project, StateNames
from vqa_state.project.split import Split
from vqa_state.questions.grid import QuestionGrid, Wording, phrases_for
from vqa_state.testing.fake_model import ScriptedModel

settings.register_profile("house", deadline=None)  # a busy machine is no failure
settings.load_profile("house")

# A shell that starts the tests in the background has Ctrl-C ignored; what tests start would, too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--thorough", action="store_true", help="also run what takes long")


def pytest_collection_modifyitems(config, items):
    if config.getoption("--thorough"):
        return
    left_out = [item for item in items if item.get_closest_marker("thorough")]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]


def say_yes(image, question):
    """A script: yes to everything, with full certainty."""
    return Answer("Yes", 1.0)


@pytest.fixture(scope="session", autouse=True)
def _nobodys_home(tmp_path_factory):
    """No test reads or changes what the person at this machine has allowed or looked at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VQA_STATE_HOME", str(tmp_path_factory.mktemp("nobody's home")))
        yield


@pytest.fixture(autouse=True)
def _home_of_its_own(monkeypatch, tmp_path_factory):
    """Nor what another test found out about a model of the same fingerprint."""
    monkeypatch.setenv("VQA_STATE_HOME", str(tmp_path_factory.mktemp("home")))


@pytest.fixture(autouse=True)
def bare_environment(monkeypatch):
    """No test sends a key that its machine has."""
    for name in ("VQA_STATE_KEYS", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def stub():
    """A server on this machine that does as its test says."""
    with Stub() as server:
        yield server


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command; give back exit code, stdout and stderr."""

    def call(*arguments):
        monkeypatch.setattr("sys.argv", ["vqa_state", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        shown = capsys.readouterr()
        return ended.value.code or 0, shown.out, shown.err

    return call


@pytest.fixture
def make_project(tmp_path):
    """Factory: a saved project "door" with open and closed pictures on both sides.

    The pictures are `picture(0)`, `picture(1)`, … in the order train open, train closed, test open,
    test closed; the sizes are as small as a test can use.
    """

    def make(
        folder="project", *, n_train=2, n_test=1, n_copies=2, wordings=("door",), seed=0
    ) -> Project:
        project = Project.create(tmp_path / folder, "door", StateNames("open", "closed"))
        project.grid = QuestionGrid(
            tuple(Wording.parse(line) for line in wordings), phrases_for("open", "closed")
        )
        project.augmentation = Augmentation(n_copies=n_copies)
        project.seed = seed
        number = 0
        for split, count in ((Split.TRAIN, n_train), (Split.TEST, n_test)):
            for label in (1, -1):
                for _ in range(count):
                    image = project.add(picture(number), f"{number}.png", label).image
                    project.set_splits([image.id], split)
                    number += 1
        project.save()
        return project

    return make


@pytest.fixture
def project(make_project) -> Project:
    """Two pictures of each state to train, one of each to test; 2 copies; 16 questions."""
    return make_project()


@pytest.fixture
def scripted() -> ScriptedModel:
    """A model that says yes to everything and remembers what it was asked."""
    return ScriptedModel(say_yes)


@pytest.fixture
def registry(monkeypatch):
    """A copy of the registry of models that is thrown away after the test."""
    copy = dict(models._factories)
    monkeypatch.setattr(models, "_factories", copy)
    return copy


@pytest.fixture
def data_home(monkeypatch, tmp_path):
    """A place of its own for what belongs to no project; it is made when something is kept."""
    home = tmp_path / "data home"
    monkeypatch.setenv("VQA_STATE_HOME", str(home))
    return home
