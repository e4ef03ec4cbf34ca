"""64 questions about one image: a plain program asks one by one, ours reads the image once.

Both run in one process, in turn, on random weights of real size, so that the times are real and the
answers mean nothing: half of the plain calls, ours, the other half. OFA has no packaged reference;
its plain way is our own port, asked one question a call.

Each family has a process and one thread of its own, two families run at a time, and times are the
process's seconds of work: what else the machine does hardly changes them.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from PIL.Image import Image

from benchmarks.model_folders import build_blip, build_idefics3, build_vilt
from benchmarks.ofa_folder import build_ofa
from benchmarks.plain_ways import Ask, Asked, plain_blip, plain_chat, plain_vilt
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.models import Failure
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.vision_check import PROBES

__all__ = ["Row", "compare", "main", "measure", "table"]

_CPU = Runtime(Device.CPU, Precision.FLOAT32)

#: Fewer different answers would prove nothing.
_MIN_ANSWERS = 8
_MAX_DIFFERENCE = 1e-4

#: Questions to tiny models; the others get all 64.
_N_QUICK = 16

#: Of an answer of OFA.
_OFA_TOKENS = 4

#: Around the table of a page.
_BEGIN, _END = "<!-- times: begin -->", "<!-- times: end -->"

#: All questions about one image.
AskAll = Callable[[Image, Sequence[str]], list[Asked]]


@dataclass(frozen=True, slots=True)
class Row:
    """One family.

    Attributes:
        family: blip, chat, vilt or ofa.
        size: of what public model it has the size.
        n_questions: asked about the image.
        plain_seconds, our_seconds: of work of one core, for all of them.
        ratio: the first by the second.
        goal: the ratio that it should reach.
        n_answers: different ones of the plain way.
        n_unequal: answers that are not those of the plain way.
        difference: the largest between logits of the first step.
        identical: no answer is unequal, enough differ, logits are within 1e-4.
    """

    family: str
    size: str
    n_questions: int
    plain_seconds: float
    our_seconds: float
    ratio: float
    goal: float
    n_answers: int
    n_unequal: int
    difference: float
    identical: bool


@dataclass(frozen=True, slots=True)
class _Family:
    name: str
    size: str
    goal: float
    build: Callable[..., Path]
    ways: Callable[[Path], tuple[Ask, AskAll]]


def _blip(folder: Path) -> tuple[Ask, AskAll]:
    from vqa_state.models.local.blip import BlipModel

    return plain_blip(folder), _said(BlipModel(folder, "blip", _CPU))


def _vilt(folder: Path) -> tuple[Ask, AskAll]:
    from vqa_state.models.local.vilt import ViltModel

    return plain_vilt(folder), _said(ViltModel(folder, "vilt", _CPU))


def _chat(folder: Path) -> tuple[Ask, AskAll]:
    from vqa_state.models.chat.model import ChatModel

    return plain_chat(folder), _said(ChatModel(folder, "chat", _CPU))


def _ofa(folder: Path) -> tuple[Ask, AskAll]:
    from vqa_state.models.local.ofa.model import OfaModel

    model = OfaModel(folder, "ofa", _CPU)
    # Trained, it ends after a word or two; random weights would run on to the limit of both ways.
    model._search = replace(model._search, max_length=_OFA_TOKENS)

    def ask_all(image: Image, questions: Sequence[str]) -> list[Asked]:
        with _first_logits() as found:
            replies = {one.question: one.outcome for one in model.answer([image], questions)}
        # Its decoder reads start and question, by which logits are known again.
        read: Any = model._read
        keys = [read(question)[:-1] for question in questions]
        texts = [_text(replies[number]) for number in range(len(questions))]
        return [Asked(text, found[key]) for text, key in zip(texts, keys, strict=True)]

    return (lambda image, question: ask_all(image, [question])[0]), ask_all


_FAMILIES = (
    _Family("ofa", "OFA-base", 1.3, build_ofa, _ofa),  # these two take longest: first
    _Family("chat", "SmolVLM-256M", 20, build_idefics3, _chat),
    _Family("blip", "BLIP-base", 20, build_blip, _blip),
    _Family("vilt", "ViLT-B/32", 1.15, build_vilt, _vilt),
)


def _said(model: Any) -> AskAll:
    def ask_all(image: Image, questions: Sequence[str]) -> list[Asked]:
        found = {number: one for _, number, one in model.generations([image], questions)}
        return [_asked(found[number]) for number in range(len(questions))]

    return ask_all


def _asked(said: Any) -> Asked:
    if isinstance(said, Failure):
        raise SystemExit(f"a question got no answer: {said.reason}")
    return Asked(said.tokens, said.logits)


def _text(outcome: Any) -> str:
    if isinstance(outcome, Failure):
        raise SystemExit(f"a question got no answer: {outcome.reason}")
    return str(outcome.text)


@contextmanager
def _first_logits() -> Iterator[dict[tuple[int, ...], Any]]:
    """What OFA's decoder gives for the first word, by what it has read."""
    from vqa_state.models.local.ofa import decoding

    found: dict[tuple[int, ...], Any] = {}
    original = decoding.start

    def start(decoder: Any, encoded: Any, prompts: Any) -> Any:
        said, logits = original(decoder, encoded, prompts)
        keys = map(tuple, prompts.tolist())
        found.update(zip(keys, logits.float(), strict=True))
        return said, logits

    with patch.object(decoding, "start", start):
        yield found


def compare(family: str, folder: Path, image: Image, questions: Sequence[str]) -> Row:
    """Ask both ways about an image, with the family's model in `folder`."""
    found = next(one for one in _FAMILIES if one.name == family)
    ask, ask_all = found.ways(folder)
    ask(image, questions[0])  # the first call is slower
    ask_all(image, questions[:1])
    half = len(questions) // 2
    began = time.process_time()
    plain = [ask(image, question) for question in questions[:half]]
    paused = time.process_time()
    ours = ask_all(image, questions)
    resumed = time.process_time()
    plain += [ask(image, question) for question in questions[half:]]
    plain_seconds = time.process_time() - began - (resumed - paused)
    return _row(found, plain, ours, plain_seconds, resumed - paused)


def _row(
    family: _Family,
    plain: Sequence[Asked],
    ours: Sequence[Asked],
    plain_seconds: float,
    our_seconds: float,
) -> Row:
    pairs = list(zip(plain, ours, strict=True))
    n_unequal = sum(one.answer != other.answer for one, other in pairs)
    difference = max(float((one.logits - other.logits).abs().max()) for one, other in pairs)
    n_answers = len({one.answer for one in plain})
    return Row(
        family.name,
        family.size,
        len(plain),
        round(plain_seconds, 4),  # tiny models take hundredths
        round(our_seconds, 4),
        round(plain_seconds / our_seconds, 2),
        family.goal,
        n_answers,
        n_unequal,
        difference,
        n_unequal == 0 and n_answers >= _MIN_ANSWERS and difference <= _MAX_DIFFERENCE,
    )


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as a page shows them, in Markdown."""
    head = ("size of", "one by one", "ours", "times faster", "same answers", "logits within")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        same = f"{row['n_questions'] - row['n_unequal']} of {row['n_questions']}"
        cells = (
            row["size"],
            f"{row['plain_seconds']:.1f} s",
            f"{row['our_seconds']:.1f} s",
            f"{row['ratio']:.1f}" if row["ratio"] >= 10 else f"{row['ratio']:.2f}",
            f"{same}, {row['n_answers']} different",
            f"{row['difference']:.0e}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def measure(family: str, real: bool) -> Row:
    """The row of a family, on one thread, in a folder that is gone afterwards."""
    import torch
    from transformers.utils import logging

    bars: Any = logging
    build = next(one.build for one in _FAMILIES if one.name == family)
    image = PROBES[1].pictures()[0]
    questions = [question.text for question in questions_about("cabinet")]
    questions = questions if real else questions[:: len(questions) // _N_QUICK]
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    bars.disable_progress_bar()
    try:
        with TemporaryDirectory() as home:
            return compare(family, build(Path(home) / family, real=real), image, questions)
    finally:
        bars.enable_progress_bar()
        torch.set_num_threads(before)


def _measured(families: Sequence[str], real: bool, n_jobs: int) -> Iterator[Row]:
    """Rows as they are ready."""
    if n_jobs == 1:
        yield from (measure(family, real) for family in families)
        return
    with ProcessPoolExecutor(n_jobs, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(measure, family, real) for family in families]
        for done in as_completed(waiting):
            yield done.result()


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line a family; with --json write the rows, too."""
    names = [one.name for one in _FAMILIES]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vqa_models", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="tiny models: no times to learn from")
    parser.add_argument("--only", action="append", choices=names, help="this family alone")
    parser.add_argument("--page", type=Path, metavar="FILE", help="renew the table of this page")
    parser.add_argument("--jobs", type=int, default=2, help="families at a time")
    chosen = parser.parse_args(arguments)
    rows = []
    for row in _measured(chosen.only or names, not chosen.quick, chosen.jobs):
        rows.append(row)
        print(_line(row), flush=True)
    rows.sort(key=lambda row: names.index(row.family))
    if chosen.json is not None:
        libraries = {name: version(name) for name in ("torch", "transformers")}
        found = {"quick": chosen.quick, **libraries, "rows": [asdict(row) for row in rows]}
        chosen.json.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
    if chosen.page is not None:
        _renew(chosen.page, table([asdict(row) for row in rows]))


def _renew(page: Path, new: str) -> None:
    """Put the table between the page's two marks."""
    before, begin, rest = page.read_text("utf-8").partition(_BEGIN)
    _, end, after = rest.partition(_END)
    if not end:
        raise SystemExit(f"{page} has no place for the table: {_BEGIN} … {_END}")
    page.write_text(f"{before}{begin}\n{new}{end}{after}", "utf-8")


def _line(row: Row) -> str:
    return (
        f"{row.family:5} {row.n_questions} questions: one by one {row.plain_seconds:7.2f} s, ours "
        f"{row.our_seconds:6.2f} s: {row.ratio:6.2f} times faster (goal {row.goal:g}); identical "
        f"{row.identical}: {row.n_unequal} unequal, {row.n_answers} different answers, logits "
        f"within {row.difference:.1e}"
    )


if __name__ == "__main__":
    main()
