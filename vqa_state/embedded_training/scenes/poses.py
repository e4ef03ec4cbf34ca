"""Poses that several things share: one part opens, or at least one of several leaves swings."""

from collections.abc import Callable, Sequence

from vqa_state.embedded_training.scenes.simulation import Facts, Pose, Simulation

__all__ = ["open_part", "opening_facts", "swing_leaves"]


def opening_facts(
    degree: float,
    *,
    turns: bool | None = None,
    visible_from: float = 0.12,
    passable_from: float | None = None,
) -> dict[str, float]:
    """What is to be seen of something that stands open by `degree`, in [0, 1]; 0 is closed.

    Args:
        degree: how far it is open.
        turns: whether it opens by turning, so that a leaf stands at an angle; None if it is no
            leaf.
        visible_from: the inside is visible above this degree.
        passable_from: one can pass above this degree; None if it is no passage.
    """
    facts = {
        "degree": degree,
        "inside_visible": float(degree > visible_from),
        "flush": float(degree == 0),
    }
    if turns is not None:
        facts["leaf_at_angle"] = float(turns and degree > 0)
    if passable_from is not None:
        facts["way_free"] = float(degree > passable_from)
    return facts


def open_part(
    joint: str,
    position: Callable[[Simulation, float], float],
    *,
    turns: bool | None = None,
    visible_from: float = 0.12,
    passable_from: float | None = None,
) -> Pose:
    """A pose that moves one joint to `position(simulation, degree)`; see `opening_facts`."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree = sim.degree(is_open)
        sim.move(joint, position(sim, degree))
        return opening_facts(
            degree, turns=turns, visible_from=visible_from, passable_from=passable_from
        )

    return pose


def swing_leaves(
    sides: Sequence[float],
    farthest: float,
    *,
    play: float = 0.02,
    together: float = 0.55,
    passable_from: float | None = None,
) -> Pose:
    """A pose that opens at least one of the joints leaf0, leaf1 ..., or closes all of them.

    Args:
        sides: of each leaf the sign of its opening angle.
        farthest: the largest angle in radians.
        play: closed leaves may stand open by this angle.
        together: how often all leaves may open.
        passable_from: see `opening_facts`.
    """

    def pose(sim: Simulation, is_open: bool) -> Facts:
        chosen, all_open = sim.count(0, len(sides) - 1), sim.chance(together)
        degrees = []
        for number, side in enumerate(sides):
            degree = sim.degree(is_open and (all_open or number == chosen))
            sim.move(f"leaf{number}", side * (farthest * degree + sim.uniform(0, play)))
            degrees.append(degree)
        return opening_facts(max(degrees), turns=True, passable_from=passable_from)

    return pose
