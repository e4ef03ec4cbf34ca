"""One suite over all models: what `VQAModel` promises holds for every family."""

import warnings

import pytest
from model_zoo import zoo

from vqa_state.testing import DETERMINISTIC_RULES, RULES

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

FAMILIES = (
    "embedded", "fake", "blip", "vilt", "ofa", "server", "idefics3", "gemma3", "llava",
    "paligemma", "smolvlm", "qwen2_5_vl", "qwen3_vl", "internvl",
)  # fmt: skip


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return zoo(tmp_path_factory.mktemp("zoo"))


@pytest.fixture(scope="module", params=FAMILIES)
def kind(kinds, request):
    found = kinds[request.param]
    if found.lacks:
        pytest.skip(f"{found.name} is not run: it needs pip install {' '.join(found.lacks)}")
    return found


@pytest.fixture(scope="module")
def model(kind):
    with warnings.catch_warnings():  # a mark does not reach a fixture of the module
        warnings.filterwarnings("ignore", "__array__ implementation", DeprecationWarning)
        return kind.make()


def test_the_suite_knows_every_kind(kinds):
    assert set(FAMILIES) == set(kinds)


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_every_model_keeps_the_rule(model, rule):
    rule(model)


@pytest.mark.parametrize("rule", DETERMINISTIC_RULES.values(), ids=DETERMINISTIC_RULES)
def test_a_model_on_this_machine_keeps_the_rule(kind, model, rule):
    if not kind.is_local:
        pytest.skip("a server promises nothing of the kind")
    rule(model)
