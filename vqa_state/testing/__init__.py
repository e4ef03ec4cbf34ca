"""What tests of models need: the rules that a model must keep, and a model without a network.

Ships with the package for tests of your own models; the app never offers it.
"""

from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.testing.model_contract import DETERMINISTIC_RULES, RULES, check_model

__all__ = ["DETERMINISTIC_RULES", "RULES", "ScriptedModel", "check_model"]
