"""Models of other packages: found by name, loaded late, and named when they are broken."""

import sys
from importlib.metadata import entry_points

import pytest

from vqa_state import load_model, models
from vqa_state.errors import ModelError, UnknownModelError
from vqa_state.models import plugins
from vqa_state.testing import check_model

MODEL = """
from vqa_state.answers.answer import Answer
from vqa_state.testing import ScriptedModel

def make():
    return ScriptedModel(lambda image, question: Answer("no", 0.1), name="{name}")
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package: its name, its modules' code, and its entry points."""
    monkeypatch.syspath_prepend(str(tmp_path))
    plugins._entry_points.cache_clear()

    def installed(package, code, **points):
        (tmp_path / f"{package}_code.py").write_text(code)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"{name} = {package}_code:{what}" for name, what in points.items()]
        (info / "entry_points.txt").write_text("\n".join([f"[{plugins.GROUP}]", *lines]))
        plugins._entry_points.cache_clear()

    yield installed
    plugins._entry_points.cache_clear()
    for name in [name for name in sys.modules if name.endswith("_code")]:
        del sys.modules[name]


def test_an_installed_model_is_listed_and_loaded_only_when_it_is_made(install):
    install("acme", MODEL.format(name="acme-vqa"), **{"acme-vqa": "make"})
    assert models.names() == ["embedded", "acme-vqa"]
    assert "acme_code" not in sys.modules
    check_model(load_model("acme-vqa"))
    assert "acme_code" in sys.modules


def test_the_command_line_lists_it(install, run):
    install("acme", MODEL.format(name="acme-vqa"), **{"acme-vqa": "make"})
    code, out, _ = run("models", "list")
    assert code == 0
    assert "acme-vqa" in out


@pytest.mark.parametrize(
    ("code", "what", "why"),
    [
        ("import surely_not_installed", "make", "ModuleNotFoundError"),
        ("", "make", "AttributeError"),
        ("make = 3", "make", "TypeError"),
        ("def make():\n    raise OSError('no weights')", "make", "OSError: no weights"),
        ("def make():\n    return object()", "make", "without name, fingerprint, notes, answer"),
        ("syntax error", "make", "SyntaxError"),
    ],
)
def test_a_broken_package_is_named_with_its_error(install, code, what, why):
    install("acme", code, broken=what)
    with pytest.raises(ModelError, match="'acme'") as caught:
        load_model("broken")
    assert why in str(caught.value)
    assert "update that package" in str(caught.value)


def test_an_error_with_a_sentence_of_its_own_comes_through(install):
    install(
        "acme",
        "from vqa_state.errors import ModelError\ndef make():\n    raise ModelError('get weights')",
        acme="make",
    )
    with pytest.raises(ModelError, match=r"^get weights$"):
        load_model("acme")


def test_two_packages_with_one_name_are_refused(install):
    install("acme", MODEL.format(name="same"), same="make")
    install("bolt", MODEL.format(name="same"), same="make")
    assert models.names() == ["embedded", "same"]
    with pytest.raises(ModelError, match="offered by acme and by bolt"):
        load_model("same")


def test_a_package_cannot_take_the_name_of_another_model(install, registry, scripted):
    install("acme", MODEL.format(name="embedded"), embedded="make")
    with pytest.raises(ModelError, match=r"'embedded' is offered by acme.*pip uninstall acme"):
        load_model("embedded")
    install("bolt", MODEL.format(name="bolt"), bolt="make")
    with pytest.raises(ValueError, match="already registered as 'bolt'"):
        models.register("bolt", lambda: scripted)


def test_a_name_with_a_colon_would_be_an_address(install):
    install("acme", MODEL.format(name="x"), **{"hub:a/b": "make"})
    assert models.names() == ["embedded"]


def test_an_unknown_name_lists_the_installed_ones(install):
    install("acme", MODEL.format(name="acme-vqa"), **{"acme-vqa": "make"})
    with pytest.raises(UnknownModelError, match="acme-vqa, embedded"):
        load_model("acme")


def test_nothing_is_installed_by_the_tests_themselves():
    assert not list(entry_points(group=plugins.GROUP))


def test_a_model_from_outside_needs_a_yes(data_home):
    with pytest.raises(ModelError, match="models approve"):
        load_model("folder:/nowhere")
    with pytest.raises(ModelError, match="there is no folder"):
        load_model("folder:/nowhere", approve=True)
