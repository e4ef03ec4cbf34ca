"""The paper's E+: Invalid answers are left out of the rates, many questions are welcome."""

from vqa_state.search.objectives._base import ObjectiveKind

__all__ = ["OBJECTIVE"]

OBJECTIVE = ObjectiveKind(
    name="s+",
    hint="most accurate, many questions",
    primed=False,
    beta_sign=1,
)
