"""The paper's E'+: Invalid answers count as wrong, many questions are welcome."""

from vqa_state.search.objectives._base import ObjectiveKind

__all__ = ["OBJECTIVE"]

OBJECTIVE = ObjectiveKind(
    name="s'+",
    hint="invalid counts as wrong, many questions",
    primed=True,
    beta_sign=1,
)
