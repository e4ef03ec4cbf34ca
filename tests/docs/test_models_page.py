"""The worked example of docs/models.md is a model: it passes what every model must pass."""

import importlib.util
import re
from pathlib import Path

import pytest
from models import test_contract as contract
from PIL import Image

from vqa_state import models
from vqa_state.models import Failure

PAGE = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")
(CODE,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)

RULES = (
    contract.test_every_pair_is_replied_to_exactly_once,
    contract.test_empty_lists_yield_nothing,
    contract.test_one_question,
    contract.test_three_hundred_questions,
    contract.test_a_large_image_is_answered,
    contract.test_threads_may_share_a_model,
    contract.test_an_answer_may_be_left_alone_in_the_middle,
    contract.test_a_model_says_who_it_is,
)


@pytest.fixture
def example(tmp_path, monkeypatch):
    """The page's code as a module, and no trace of it afterwards."""
    monkeypatch.setattr(models, "_factories", dict(models._factories))
    (tmp_path / "example.py").write_text(CODE, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("example", tmp_path / "example.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_has_at_most_forty_lines():
    assert len([line for line in CODE.splitlines() if line.strip()]) <= 40


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_it_keeps_the_rule(example, rule):
    rule(models.create("brightness"))


@pytest.mark.parametrize("mode", ["L", "P", "1", "RGBA"])
def test_it_takes_grey_and_palette_images(example, mode):
    contract.test_grey_and_palette_images_are_answered(models.create("brightness"), mode)


@pytest.mark.parametrize("size", [(1, 1), (8000, 12)])
def test_it_takes_strange_sizes(example, size):
    contract.test_strange_sizes_are_answered_or_fail_with_a_sentence(
        models.create("brightness"), size
    )


def test_it_answers_by_what_it_sees(example):
    images = [Image.new("RGB", (9, 9), (grey,) * 3) for grey in (20, 230)]
    found = contract.outcomes(
        models.create("brightness"), images, ["Is the light on?", "Is it off?", ""]
    )
    texts = [[found[i, q].text for q in (0, 1)] for i in (0, 1)]
    assert texts == [["no", "yes"], ["yes", "no"]]
    assert isinstance(found[0, 2], Failure)
    assert example.BrightnessModel(50).fingerprint != example.BrightnessModel().fingerprint
