"""What a user is told of a model before it is asked: what to know of it, if it sees, the cost."""

from collections.abc import Callable

from vqa_state.cli.terminal import plan_record, say, show_check
from vqa_state.models import VQAModel
from vqa_state.study.latency import Estimate
from vqa_state.study.vision_check import first_look

__all__ = ["cost_record", "cost_words", "look_first"]


def look_first(model: VQAModel, stop: Callable[[], bool]) -> None:
    """Say the model's notes, and warn of one that does not see; it is looked at once."""
    for sentence in model.notes:
        say(sentence)
    found = show_check(first_look(model, stop))
    if found is not None and found.warns:
        say(found.sentence)


def cost_words(cost: Estimate, model: str) -> str:
    """What asking will cost, in a line each."""
    what = cost.plan
    lines = [
        f"{what.n_images} images × {what.n_copies} copies × {what.n_questions} questions = "
        f"{what.n_calls:,} calls, {what.n_stored:,} in the store, {what.n_to_ask:,} to ask"
    ]
    if cost.n_look:
        lines.append(f"before them up to {cost.n_look} calls, once, to see if the model sees")
    if cost.seconds is None and what.n_to_ask:
        lines.append(
            "how long that takes is not known here yet; to measure it: "
            f"python -m vqa_state models check {model!r}"
        )
    elif cost.seconds is not None and what.n_to_ask:
        lines.append(f"about {cost.seconds / 60:.1f} minutes, by the pace measured here")
    lines += [f"a process with the model in it takes {cost.memory}"] if cost.memory else []
    return "\n".join(lines)


def cost_record(cost: Estimate) -> dict[str, object]:
    """The same as JSON; null where it is not known here."""
    return plan_record(cost.plan) | {
        "n_look": cost.n_look,
        "seconds": cost.seconds,
        "megabytes": cost.memory.process if cost.memory else None,
        "gpu_megabytes": cost.memory.gpu if cost.memory else None,
    }
