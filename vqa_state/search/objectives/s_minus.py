"""The paper's E-: Invalid answers are left out of the rates, few questions are welcome."""

from vqa_state.search.objectives._base import ObjectiveKind

__all__ = ["OBJECTIVE"]

OBJECTIVE = ObjectiveKind(
    name="s-",
    hint="few questions, fast",
    primed=False,
    beta_sign=-1,
)
