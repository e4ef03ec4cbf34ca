"""The worked example of docs/models.md is a model: it passes what every model must pass."""

import importlib.util
import re
from pathlib import Path

import pytest
from PIL import Image

from vqa_state import models
from vqa_state.models import Failure
from vqa_state.testing import RULES
from vqa_state.testing.model_contract import outcomes

PAGE = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")
CODE, CHECK = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


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


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_it_keeps_the_rule(example, rule):
    rule(models.create("brightness"))


def test_it_passes_the_check_that_the_page_names(example):
    exec(CHECK, {})


def test_it_answers_by_what_it_sees(example):
    images = [Image.new("RGB", (9, 9), (grey,) * 3) for grey in (20, 230)]
    found = outcomes(models.create("brightness"), images, ["Is the light on?", "Is it off?", ""])
    texts = [[found[i, q].text for q in (0, 1)] for i in (0, 1)]
    assert texts == [["no", "yes"], ["yes", "no"]]
    assert isinstance(found[0, 2], Failure)
    assert example.BrightnessModel(50).fingerprint != example.BrightnessModel().fingerprint
