"""The paper's E'-: Invalid answers count as wrong, few questions are welcome."""

from vqa_state.search.objectives._base import ObjectiveKind

__all__ = ["OBJECTIVE"]

OBJECTIVE = ObjectiveKind(
    name="s'-",
    hint="invalid counts as wrong, few questions",
    primed=True,
    beta_sign=-1,
)
