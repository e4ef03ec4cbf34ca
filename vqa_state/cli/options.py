"""What several commands share: the app itself, common options, and showing results."""

from pathlib import Path
from typing import Annotated

import typer

from vqa_state import report
from vqa_state.cli.terminal import print_json, print_table
from vqa_state.errors import NothingToSearchError
from vqa_state.project import Project
from vqa_state.tuning import Results, recognizer_path, refresh

__all__ = ["Folder", "Json", "Seed", "app", "found_results", "show", "tell"]

app = typer.Typer(
    help="Find the questions that let a vision-language model recognize a state. "
    "The road: new → add → label → grid → ask → optimize → report → export → recognize; "
    "tune walks it from the questions to the recognizer in one go.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Folder = Annotated[Path, typer.Argument(metavar="PROJECT", help="The project's folder.")]
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


def show(project: Project, found: Results, as_json: bool) -> None:
    """The table of all subsets; this is a look at the test images, so it is counted."""
    project.test_looks += 1  # the test images were looked at once more
    project.save()
    path = recognizer_path(project, project.chosen)
    sentences = report.comparison_sentences(found.evaluation)
    if as_json:
        rows = report.score_frame(found.evaluation).to_dict("records")
        print_json({"subsets": rows, "says": sentences, "recognizer": str(path)})
        return
    print_table(report.comparison_frame(found.evaluation), project.name)
    for sentence in sentences:
        print(sentence)
    evaluation = found.evaluation
    left_out = evaluation.n_left_out_train + evaluation.n_left_out_test
    if left_out:
        print(f"{left_out} images are left out because answers are missing; ask again for them.")
    looks = "once" if project.test_looks == 1 else f"{project.test_looks} times"
    print(f"The test results were looked at {looks}.")
    print(f"Recognizer ({project.chosen.value}): {path}")
