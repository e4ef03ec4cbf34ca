"""What several commands share: the app itself, common options, and showing results."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vqa_state.cli.picking import given_path
from vqa_state.cli.terminal import print_json, print_table
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.cost_frontier import thinned
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.report import frames
from vqa_state.study.assess import Assessment, assessment
from vqa_state.study.latency import read_pace
from vqa_state.study.leaderboard import standings, standings_frame
from vqa_state.study.leaderboard_words import TABLE_NOTE
from vqa_state.study.optimize import recognizer_path, refresh
from vqa_state.study.suggest import Hints, hints

__all__ = [
    "Folder",
    "Json",
    "Seed",
    "app",
    "count_look",
    "found_results",
    "has_test",
    "show",
    "tell",
]

_SHOWN = 5  # images of each list of hints

app = typer.Typer(
    help="Find the questions that let a vision-language model recognize a state. "
    "The road: new → add → label → grid → ask → optimize → report → export → recognize; "
    "tune walks it from the questions to the recognizer in one go.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Folder = Annotated[
    Path, typer.Argument(metavar="PROJECT", parser=given_path, help="The project's folder.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Seed = Annotated[
    int | None, typer.Option(min=0, max=2**32 - 1, help="Of the search; kept in the project.")
]


def tell(as_json: bool, record: object, words: str) -> None:
    """Print a record or the words for it."""
    if as_json:
        print_json(record)
    else:
        print(words)


def found_results(project: Project) -> Results:
    """The project's results, or what to do to have some.

    Raises:
        NothingToSearchError: if nothing was searched, or answers or labels changed since.
    """
    found = refresh(project)
    if found is None:
        raise NothingToSearchError(
            f"{project.folder} has no search for its present answers and labels; run "
            "`python -m vqa_state optimize` on it"
        )
    return found


def show(folder: Path, as_json: bool) -> None:
    """The table of all subsets. A look at the test images, if there are any, is counted once shown.

    The project is read anew: it may have changed while the work before this took its time.
    """
    project = Project.open(folder)
    found = found_results(project)
    if as_json:
        print_json(_record(project, found))
    else:
        _print(project, found)
    if has_test(found):
        count_look(folder)


def has_test(found: Results) -> bool:
    """Whether the results say anything of test images."""
    return any(row.test is not None for row in found.evaluation.rows)


def count_look(folder: Path) -> None:
    """One more look at the test images; the project is read anew, as it may have changed."""
    project = Project.open(folder)
    project.test_looks += 1
    project.save()


def _record(project: Project, found: Results) -> dict[str, object]:
    evaluation = found.evaluation
    assessed = assessment(project, found)
    table, hinted = (
        standings(project.chosen, found, assessed, read_pace(project)),
        hints(project, found, assessed),
    )
    return {
        "recognizers": [asdict(row) for row in table.rows],
        "comparisons": [asdict(one) for one in table.comparisons],
        "sentences": table.sentences,
        "recommendation": table.recommendation,
        "warnings": table.warnings,
        "badges": table.badges,
        "frontier": [] if assessed is None else [asdict(one) for one in assessed.frontier],
        "coverage": _coverage(assessed),
        "next_labels": [asdict(one) for one in hinted.next],
        "suggested_labels": [asdict(one) for one in hinted.suggestions],
        "doubtful_labels": [asdict(one) for one in hinted.doubtful],
        "n_unasked": hinted.n_unasked,
        "subsets": frames.score_frame(evaluation).to_dict("records"),
        "terms": frames.term_sentences(found),
        "missed": {
            row.name.value: [asdict(one) for one in frames.missed_pictures(project, row)]
            for row in evaluation.rows
        },
        "finished": all(saved.finished for saved in found.searches.values()),
        "n_left_out_train": evaluation.n_left_out_train,
        "n_left_out_test": evaluation.n_left_out_test,
        "look_alikes": frames.look_alike_sentences(project),
        "test_looks": project.test_looks + has_test(found),
        "recognizer": str(recognizer_path(project, project.chosen)),
    }


def _coverage(assessed: Assessment | None) -> dict[str, object]:
    curves = {} if assessed is None else assessed.curves
    return {
        kind.value: [asdict(point) | {"accuracy": point.accuracy} for point in curve]
        for kind, curve in curves.items()
    }


def _print_assessed(project: Project, found: Results) -> None:
    assessed = assessment(project, found)
    table = standings(project.chosen, found, assessed, read_pace(project))
    print_table(standings_frame(table), f"{project.name}: all recognizers")
    print(TABLE_NOTE)
    for sentence in (table.recommendation, *table.warnings, *table.sentences, *table.badges):
        if sentence:
            print(sentence)
    for point in thinned(assessed.frontier) if assessed else ():
        plural = "" if point.n_questions == 1 else "s"
        print(
            f"{point.n_questions} question{plural}, {point.n_calls} calls: at best "
            f"{point.n_recognized} of {point.n_images} training images recognized."
        )
    _print_hints(project, hints(project, found, assessed))


def _print_hints(project: Project, hinted: Hints) -> None:
    states = project.states.positive, project.states.negative
    for one in hinted.next[:_SHOWN]:
        print(f"label next: {project.images[one.image_id].name}: {one.reason(*states)}")
    for doubt in hinted.doubtful[:_SHOWN]:
        print(f"doubtful: {project.images[doubt.image_id].name}: {doubt.reason(*states)}")
    if hinted.n_unasked:
        print(
            f"{hinted.n_unasked} images have no label and no answers yet; `python -m vqa_state "
            f"label {project.folder} --suggest` asks about them"
        )


def _print(project: Project, found: Results) -> None:
    evaluation = found.evaluation
    print_table(frames.comparison_frame(evaluation), project.name)
    _print_assessed(project, found)
    for sentence in frames.term_sentences(found):
        print(sentence)
    row = next(row for row in evaluation.rows if row.name.value == project.chosen.value)
    missed = frames.missed_pictures(project, row)
    images = "1 image" if len(missed) == 1 else f"{len(missed)} images"
    print(f"{project.chosen.value} does not recognize {images}.")
    for one in missed:
        print(f"  {one.sentence()}")
    for sentence in frames.look_alike_sentences(project):
        print(sentence)
    left_out = evaluation.n_left_out_train + evaluation.n_left_out_test
    if left_out:
        print(f"{left_out} images are left out because answers are missing; ask again for them.")
    if has_test(found):
        looks = "once" if not project.test_looks else f"{project.test_looks + 1} times"
        print(f"The test results were looked at {looks}.")
    print(f"Recognizer ({project.chosen.value}): {recognizer_path(project, project.chosen)}")
    if project.all_questions:
        print("`export` writes all questions instead, as you chose.")
