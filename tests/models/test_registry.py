"""The registry of models, and the model without a network."""

import subprocess
import sys

import pytest
from pictures import draw

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.errors import MissingPackageError, ModelError, UnknownModelError
from vqa_state.models import Failure, Reply
from vqa_state.testing.fake_model import ScriptedModel


def test_a_registered_model_is_made_by_its_name(registry, scripted):
    models.register("scripted", lambda: scripted)
    assert models.names()[-1] == "scripted"
    assert models.create("scripted") is scripted


def test_a_name_cannot_be_registered_twice(registry, scripted):
    models.register("scripted", lambda: scripted)
    with pytest.raises(ValueError, match="already registered as 'scripted'"):
        models.register("scripted", lambda: scripted)
    with pytest.raises(ValueError, match="already registered as 'embedded'"):
        models.register("embedded", lambda: scripted)


def test_the_registry_of_a_test_is_thrown_away():
    assert "scripted" not in models.names()
    assert "embedded" in models.names()


@pytest.mark.parametrize("name", ["embeded", "", "Embedded", "../embedded", "vqa_state.models"])
def test_an_unknown_name_lists_the_known_ones(name):
    with pytest.raises(UnknownModelError, match=r"unknown model .*; choose one of: .*embedded"):
        models.create(name)
    with pytest.raises(ModelError):
        models.create(name)


def test_a_missing_package_says_what_to_install(registry):
    def needs():
        import surely_not_installed

        return surely_not_installed

    models.register("needy", needs)
    with pytest.raises(MissingPackageError, match=r"'needy' needs .* pip install surely_not"):
        models.create("needy")


def test_our_own_mistake_is_not_called_a_missing_package(registry):
    def broken():
        import vqa_state.no_such_module

        return vqa_state.no_such_module

    models.register("broken", broken)
    with pytest.raises(ModuleNotFoundError):
        models.create("broken")


def test_an_error_of_the_model_comes_through(registry):
    def damaged():
        raise ModelError("the weights are damaged; install the package again")

    models.register("damaged", damaged)
    with pytest.raises(ModelError, match="install the package again"):
        models.create("damaged")


def test_importing_the_registry_loads_no_model():
    code = (
        "import sys, vqa_state.models; "
        "print([n for n in ('torch', 'transformers', 'vqa_state.models.embedded.model') "
        "if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_scripted_model_gives_every_pair_once_and_remembers():
    def script(image, question):
        return Failure("no") if question == "b" else Answer(question)

    model = ScriptedModel(script, name="mine", fingerprint="mine/7")
    images = [draw(1), draw(2, (5, 7))]
    assert list(model.answer(images, ["a", "b"])) == [
        Reply(0, 0, Answer("a")),
        Reply(0, 1, Failure("no")),
        Reply(1, 0, Answer("a")),
        Reply(1, 1, Failure("no")),
    ]
    assert model.asked == [((32, 24), "a"), ((32, 24), "b"), ((5, 7), "a"), ((5, 7), "b")]
    assert (model.name, model.fingerprint) == ("mine", "mine/7")
    assert list(model.answer(images, [])) == list(model.answer([], ["a"])) == []


def test_a_scripted_model_answers_only_when_it_is_read(scripted):
    replies = scripted.answer([draw(1)], ["a", "b"])
    assert scripted.asked == []
    next(replies)
    assert len(scripted.asked) == 1
