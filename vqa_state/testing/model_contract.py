"""What every VQA model must keep, as functions that take a model: yours and ours.

    from vqa_state.testing import check_model

    def test_my_model():
        check_model(MyModel())

With pytest, one test a rule:

    from vqa_state.testing import RULES

    @pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
    def test_my_model(rule):
        rule(MyModel())
"""

import tempfile
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType

import numpy as np
from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure, VQAModel

__all__ = ["DETERMINISTIC_RULES", "RULES", "check_model", "outcomes"]

QUESTIONS = ("Is this door open?", "Does this image look like the door is closed?", "Is it on?")
_P_YES_TOLERANCE = 1e-4
"""Of a probability alone and in a batch: padding changes the last bits of a sum."""

Outcomes = dict[tuple[int, int], Answer | Failure]
Rule = Callable[[VQAModel], None]


def check_model(model: VQAModel, *, deterministic: bool = True) -> None:
    """Hold a model to all rules.

    Args:
        model: loaded and ready; it is asked about a thousand questions about random pictures.
        deterministic: whether the same question gets the same answer, alone and among others;
            False for a model behind a server, which promises nothing of the kind.

    Raises:
        AssertionError: if a rule is broken; the message says which and how.
    """
    for name, rule in {**RULES, **(DETERMINISTIC_RULES if deterministic else {})}.items():
        try:
            rule(model)
        except AssertionError as error:
            raise AssertionError(f"{type(model).__name__} breaks {name!r}: {error}") from error


def outcomes(model: VQAModel, images: Sequence[Image.Image], questions: Sequence[str]) -> Outcomes:
    """What a model replies, by (image, question).

    Raises:
        AssertionError: if it replies twice to a pair, or to one that was not asked.
    """
    found: Outcomes = {}
    for reply in model.answer(images, questions):
        pair = reply.image, reply.question
        _require(pair not in found, f"it replied twice to image {pair[0]}, question {pair[1]}")
        _require(
            0 <= pair[0] < len(images) and 0 <= pair[1] < len(questions),
            f"it replied to image {pair[0]}, question {pair[1]}, which was not asked",
        )
        found[pair] = reply.outcome
    return found


def replies_once_to_every_pair(model: VQAModel) -> None:
    """Each (image, question) pair gets exactly one reply, an answer."""
    found = outcomes(model, [_noise(1), _noise(2)], QUESTIONS)
    _require(len(found) == 2 * len(QUESTIONS), f"{len(found)} of {2 * len(QUESTIONS)} replies came")
    for pair in found:
        _answer(found, *pair)


def yields_nothing_for_nothing(model: VQAModel) -> None:
    """No image or no question gives no reply, and no error."""
    for images, questions in (([], QUESTIONS), ([_noise(1)], ()), ([], ())):
        _require(not outcomes(model, images, questions), "it replied although nothing was asked")


def answers_one_question(model: VQAModel) -> None:
    """A single question about a single image is answered."""
    _answer(outcomes(model, [_noise(1)], QUESTIONS[:1]), 0, 0)


def answers_three_hundred_questions(model: VQAModel) -> None:
    """More questions than fit a batch are all replied to."""
    many = [f"Is the door number {number} open?" for number in range(300)]
    found = outcomes(model, [_noise(1)], many)
    _require(len(found) == len(many), f"{len(found)} of {len(many)} replies came")


def answers_grey_and_palette_images(model: VQAModel) -> None:
    """Pillow images of other modes than RGB are answered, too."""
    for mode in ("L", "P", "1", "RGBA"):
        _answer(outcomes(model, [_noise(1).convert(mode)], QUESTIONS[:1]), 0, 0)


def survives_strange_sizes(model: VQAModel) -> None:
    """An image of one pixel, or a very wide one, is answered or fails with a reason, alone."""
    for size in ((1, 1), (8000, 12)):
        found = outcomes(model, [_noise(1, size), _noise(2)], QUESTIONS[:1])
        _answer(found, 1, 0)
        strange = found.get((0, 0))
        _require(
            isinstance(strange, Answer) or (isinstance(strange, Failure) and bool(strange.reason)),
            f"an image of {size[0]} × {size[1]} pixels got {strange!r}",
        )


def answers_a_large_image(model: VQAModel) -> None:
    """Forty-eight million pixels are answered."""
    _answer(outcomes(model, [_noise(3, (8000, 6000))], QUESTIONS[:1]), 0, 0)


def may_be_shared_by_threads(model: VQAModel) -> None:
    """Four threads at once get the answers that each gets alone."""
    images = [_noise(seed) for seed in range(4)]
    alone = [_texts(model, [image], QUESTIONS) for image in images]
    with ThreadPoolExecutor(len(images)) as pool:
        together = list(pool.map(lambda image: _texts(model, [image], QUESTIONS), images))
    _require(alone == together, "four threads at once got other answers than one after another")


def may_be_left_in_the_middle(model: VQAModel) -> None:
    """A caller may stop reading replies, and ask again."""
    replies = iter(model.answer([_noise(1), _noise(2)], QUESTIONS))
    next(replies)
    if isinstance(replies, Generator):
        replies.close()
    found = outcomes(model, [_noise(1)], QUESTIONS)
    _require(len(found) == len(QUESTIONS), "after replies that nobody read it replies no more")


def names_itself(model: VQAModel) -> None:
    """Name, fingerprint and notes are there; no path of temporary files is in the fingerprint."""
    _require(bool(model.name), "its name is empty")
    _require(bool(model.fingerprint), "its fingerprint is empty")
    _require(
        tempfile.gettempdir() not in model.fingerprint,
        f"its fingerprint changes with a folder of temporary files: {model.fingerprint}",
    )
    _require(
        all(isinstance(note, str) and note for note in model.notes), "its notes are not sentences"
    )


def repeats_its_answers(model: VQAModel) -> None:
    """The same question gets the same answer again, and alone as in a batch."""
    images = [_noise(seed) for seed in range(3)]
    many = [*QUESTIONS, *(f"Is the door number {number} open?" for number in range(20))]
    batch = outcomes(model, images, many)
    _require(batch == outcomes(model, images, many), "asked again, it answers otherwise")
    for i, image in enumerate(images):
        for q in (0, 1, 7, 22):
            single = _answer(outcomes(model, [image], [many[q]]), 0, 0)
            _require_same(single, _answer(batch, i, q))


def _require_same(single: Answer, batched: Answer) -> None:
    _require(
        single.text == batched.text,
        f"alone it says {single.text!r}, in a batch {batched.text!r}",
    )
    _require((single.p_yes is None) == (batched.p_yes is None), "p_yes is there only sometimes")
    if single.p_yes is not None and batched.p_yes is not None:
        _require(
            abs(single.p_yes - batched.p_yes) <= _P_YES_TOLERANCE,
            f"alone p_yes is {single.p_yes}, in a batch {batched.p_yes}",
        )


def _answer(found: Outcomes, image: int, question: int) -> Answer:
    outcome = found.get((image, question))
    if not isinstance(outcome, Answer):
        raise AssertionError(f"image {image}, question {question} got no answer but {outcome!r}")
    return outcome


def _texts(
    model: VQAModel, images: Sequence[Image.Image], questions: Sequence[str]
) -> dict[tuple[int, int], str]:
    found = outcomes(model, images, questions)
    return {pair: _answer(found, *pair).text for pair in found}


def _noise(seed: int, size: tuple[int, int] = (48, 36)) -> Image.Image:
    """Random RGB pixels, of width and height `size`."""
    values = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), np.uint8)
    return Image.fromarray(values)


def _require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise AssertionError(otherwise)


def _named(*rules: Rule) -> Mapping[str, Rule]:
    return MappingProxyType({rule.__name__.replace("_", " "): rule for rule in rules})


RULES: Mapping[str, Rule] = _named(
    replies_once_to_every_pair,
    yields_nothing_for_nothing,
    answers_one_question,
    answers_three_hundred_questions,
    answers_grey_and_palette_images,
    survives_strange_sizes,
    answers_a_large_image,
    may_be_shared_by_threads,
    may_be_left_in_the_middle,
    names_itself,
)
"""By name, what holds for every model."""

DETERMINISTIC_RULES: Mapping[str, Rule] = _named(repeats_its_answers)
"""By name, what holds besides for a model that runs on this machine."""
