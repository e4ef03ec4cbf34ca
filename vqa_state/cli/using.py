"""report, export, recognize: what comes out."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vqa_state import models
from vqa_state.cli.looking import look_first
from vqa_state.cli.options import (
    Folder,
    Json,
    MaxTokens,
    app,
    count_look,
    found_results,
    show,
    tell,
)
from vqa_state.cli.picking import given_path
from vqa_state.cli.terminal import (
    interruptible,
    print_json,
    print_table,
    say,
    show_asking,
    verdict_record,
)
from vqa_state.errors import ImageError, ModelError
from vqa_state.models import VQAModel
from vqa_state.models.length_limit import cut_off_words, with_max_tokens
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import Recognizer, recognize_all
from vqa_state.recognizer.verdict import Verdict
from vqa_state.report import frames
from vqa_state.report.page import report_page
from vqa_state.search.objectives import Objective
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.study.assess import assessment
from vqa_state.study.build_recognizer import unchosen_recognizer
from vqa_state.study.collect import AskProgress
from vqa_state.study.export import recognizer_with
from vqa_state.study.latency import read_pace
from vqa_state.study.leaderboard import standings
from vqa_state.study.transfer import Rechecked, recheck
from vqa_state.votes.rules import VoteKind
from vqa_state.votes.state import State


@app.command("report")
def report_command(
    folder: Folder,
    csv: Annotated[
        Path | None,
        typer.Option(
            parser=given_path, help="Also write questions.csv and scores.csv into this folder."
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(parser=given_path, help="Also write a page with pictures that opens offline."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the questions on the training images, and the tables of subsets and recognizers."""
    project = Project.open(folder)
    found = found_results(project)
    questions = frames.question_frame(found.train)
    if csv is not None:
        scores = frames.score_frame(found.evaluation)
        for name, frame in (("questions", questions), ("scores", scores)):
            write_atomically(csv / f"{name}.csv", frame.to_csv(index=False).encode())
    if html is not None:
        assessed = assessment(project, found)
        table = standings(project.chosen, found, assessed, read_pace(project))
        write_atomically(html, report_page(project, found, assessed, table).encode())
    if not as_json:
        shown = questions.sort_values(["accuracy", "question"], ascending=[False, True])
        cut_off = ["cut_off"] if shown["cut_off"].any() else []
        shown = shown[["question", "accuracy", "invalid", *cut_off]].round(3)
        print_table(shown, "Questions, on the training images")
    show(folder, as_json)


@app.command()
def export(
    folder: Folder,
    out: Annotated[
        Path, typer.Argument(parser=given_path, help="Where to write the recognizer's JSON.")
    ],
    objective: Annotated[
        Objective | None, typer.Option(help="s+ for accuracy, s- for speed; kept as your choice.")
    ] = None,
    vote: Annotated[
        VoteKind | None,
        typer.Option(help="How answers are counted; all but paper need `assess` first; kept."),
    ] = None,
    coverage: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=1, help="Abstain, so that about this share gets a verdict (1: all); kept."
        ),
    ] = None,
    all_questions: Annotated[
        bool | None,
        typer.Option(
            "--all-questions/--chosen-questions",
            help="Ask all, by the paper's vote, where `assess` says that choosing loses; kept "
            "until --objective, another --vote or a --coverage is named.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write one recognizer file. The project's choice is s+ with the paper's vote at first."""
    # The paper's vote and a verdict for every image are what all questions have, too.
    names_a_choice = (
        objective is not None or vote not in (None, VoteKind.PAPER) or coverage not in (None, 1)
    )
    if all_questions and names_a_choice:
        raise typer.BadParameter(
            "--all-questions takes all by the paper's vote; leave out --objective, --vote and "
            "--coverage"
        )
    project = Project.open(folder)
    found = found_results(project)
    project.chosen = objective or project.chosen
    project.vote = vote or project.vote
    if coverage is not None:
        project.coverage = None if coverage == 1 else coverage
    had_all = project.all_questions
    if names_a_choice or all_questions is not None:
        project.all_questions = bool(all_questions)
    recognizer = _exported(project, found)
    with project.changing():  # a choice that is refused writes no file
        recognizer.save(out)
    taken = "without a choice" if project.all_questions else project.chosen.value
    words = f"{out}: {taken}, {len(recognizer.questions)} questions"
    if recognizer.vote is not VoteKind.PAPER:
        words += f", vote {recognizer.vote.value}"
    if recognizer.abstain.coverage is not None:
        words += f", unknown below a sureness of {recognizer.abstain.min_sureness:.2f}"
    words += "; no longer all questions" if had_all and not project.all_questions else ""
    words = "\n".join([words, *found.answers.limits])
    record = {
        "path": str(out),
        "objective": None if project.all_questions else project.chosen.value,
        "vote": recognizer.vote.value,
        "min_sureness": recognizer.abstain.min_sureness,
        "limits": found.answers.limits,
    }
    tell(as_json, record, words)


def _exported(project: Project, found: Results) -> Recognizer:
    if project.all_questions:
        return unchosen_recognizer(project, found)
    plain = project.vote is VoteKind.PAPER and project.coverage is None
    assessed = None if plain else assessment(project, found)
    return recognizer_with(project, found, assessed, project.vote, project.coverage)


@app.command()
def recognize(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recognizer's JSON.")],
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="Pictures.")],
    also: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Another recognizer of the same model; costs little."),
    ] = None,
    stop_early: Annotated[
        bool, typer.Option("--stop-early", help="Ask only until the rest cannot change it.")
    ] = False,
    model: Annotated[
        str | None,
        typer.Option(
            help="Name or address of the recognizers' model, if it goes by another one here."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Say the state of each image, with the votes.

    An image that cannot be read, or about which a call failed, is named, and the others go on. Exit
    code 1 if there was one, 3 if a verdict is unknown.
    """
    recognizers = [Recognizer.load(path) for path in (file, *(also or []))]
    _say_cautions(recognizers)
    loaded = _loaded(recognizers, model)
    records: list[dict[str, object]] = []
    states = set()
    for image in images:
        try:
            verdicts = _verdicts(image, recognizers, loaded, stop_early=stop_early)
        except (ImageError, ModelError) as error:
            records.append({"image": str(image), "error": str(error)})
            say(f"error: {image}: {error}")
            continue
        for recognizer, verdict in zip(recognizers, verdicts, strict=True):
            states.add(verdict.state)
            record = {"image": str(image), "recognizer": recognizer.name}
            records.append(record | verdict_record(verdict))
            if not as_json:
                print(_sentence(str(image), recognizer, verdict))
    if as_json:
        print_json(records)
    if any("error" in record for record in records):
        raise typer.Exit(1)
    if State.UNKNOWN in states:
        raise typer.Exit(3)


def _say_cautions(recognizers: Sequence[Recognizer]) -> None:
    for recognizer in recognizers:
        if recognizer.caution:
            say(recognizer.caution)


def _loaded(recognizers: Sequence[Recognizer], model: str | None) -> dict[str, VQAModel]:
    """The models by the names in the files, each loaded once, before the first image."""
    names = dict.fromkeys(one.model.name for one in recognizers)
    if model is not None:
        return dict.fromkeys(names, models.create(models.choose(model)))
    return {name: models.create(name) for name in names}


def _verdicts(
    image: Path,
    recognizers: Sequence[Recognizer],
    loaded: Mapping[str, VQAModel],
    *,
    stop_early: bool,
) -> list[Verdict]:
    if stop_early:
        return [
            one.recognize(image, loaded[one.model.name], stop_early=True) for one in recognizers
        ]
    found: dict[int, Verdict] = {}
    for name, vqa_model in loaded.items():
        places = [at for at, one in enumerate(recognizers) if one.model.name == name]
        verdicts = recognize_all(image, [recognizers[at] for at in places], vqa_model)
        found |= dict(zip(places, verdicts, strict=True))
    return [found[at] for at in range(len(recognizers))]


@app.command("recheck")
def recheck_command(
    folder: Folder,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recognizer's JSON.")],
    model: Annotated[str, typer.Option(help="Name or address of the other model.")],
    max_tokens: MaxTokens = None,
    as_json: Json = False,
) -> None:
    """Ask a recognizer's questions on another model about this project's images: what is lost?

    The answers are kept, and so is your look at the test images. To optimize again for the other
    model: tune PROJECT --model MODEL.
    """
    project, recognizer = Project.open(folder), Recognizer.load(file)
    _say_cautions([recognizer])
    name = models.choose(model)
    name = name if max_tokens is None else with_max_tokens(name, max_tokens)
    other = models.create(name)
    with interruptible() as stop:
        look_first(other, stop)
        found = _rechecked(recheck(recognizer, project, other, stop))
    if found is None:
        say("stopped by you; what was answered is kept")
        raise typer.Exit(3)
    if any(side.split is Split.TEST and side.n_images for side in found.sides):
        count_look(folder)
    lines = [side.sentence for side in found.sides] + ([found.says] if found.says else [])
    lines.append(f"To optimize again for it: python -m vqa_state tune {folder} --model '{name}'")
    tell(as_json, asdict(found), "\n".join(lines))


def _rechecked(steps: Iterator[AskProgress | Rechecked]) -> Rechecked | None:
    """Draw the asking; what came after it, if it was not stopped."""
    found: list[Rechecked] = []

    def asking() -> Iterator[AskProgress]:
        for step in steps:
            if isinstance(step, Rechecked):
                found.append(step)
            else:
                yield step

    show_asking(asking())
    return found[0] if found else None


def _cut_off(verdict: Verdict, recognizer: Recognizer) -> str:
    if not verdict.n_cut_off:
        return ""
    return f"; {cut_off_words(verdict.n_cut_off, recognizer.model.name)}"


def _sentence(image: str, recognizer: Recognizer, verdict: Verdict) -> str:
    return (
        f"{image}: {verdict.state_name} ({verdict.reason}; {verdict.n_positive} for "
        f"{recognizer.states.positive}, {verdict.n_negative} for {recognizer.states.negative}, "
        f"{verdict.n_invalid} invalid{_cut_off(verdict, recognizer)}; {verdict.n_calls} calls"
        f"{f' ({verdict.n_skipped} saved)' if verdict.n_skipped else ''}, "
        f"{verdict.milliseconds:.0f} ms)"
    )
