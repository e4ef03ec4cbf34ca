"""report, export, recognize: what comes out."""

from pathlib import Path
from typing import Annotated

import typer

from vqa_state import models, report
from vqa_state.cli.options import Folder, Json, app, found_results, show, tell
from vqa_state.cli.terminal import print_json, print_table, verdict_record
from vqa_state.project import Project
from vqa_state.recognizer import Recognizer
from vqa_state.scores import Objective
from vqa_state.tuning import recognizer_path
from vqa_state.verdict import State


@app.command("report")
def report_command(
    folder: Folder,
    csv: Annotated[
        Path | None, typer.Option(help="Also write questions.csv and scores.csv into this folder.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the questions on the training images and the table of all subsets."""
    project = Project.open(folder)
    found = found_results(project)
    questions = report.question_frame(found.train)
    if csv is not None:
        csv.mkdir(parents=True, exist_ok=True)
        questions.to_csv(csv / "questions.csv", index=False)
        report.score_frame(found.evaluation).to_csv(csv / "scores.csv", index=False)
    if not as_json:
        shown = questions.sort_values(["accuracy", "question"], ascending=[False, True])
        shown = shown[["question", "accuracy", "invalid"]].round(3)
        print_table(shown, "Questions, on the training images")
    show(project, found, as_json)


@app.command()
def export(
    folder: Folder,
    out: Annotated[Path, typer.Argument(help="Where to write the recognizer's JSON.")],
    objective: Annotated[
        Objective | None, typer.Option(help="s+ for accuracy, s- for speed; kept as your choice.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write one recognizer file. The project's choice is s+ until you pick another."""
    project = Project.open(folder)
    found_results(project)
    if objective is not None:
        project.chosen = objective
        project.save()
    recognizer = Recognizer.load(recognizer_path(project, project.chosen))
    recognizer.save(out)
    words = f"{out}: {project.chosen.value}, {len(recognizer.questions)} questions"
    tell(as_json, {"path": str(out), "objective": project.chosen.value}, words)


@app.command()
def recognize(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recognizer's JSON.")],
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="Pictures.")],
    as_json: Json = False,
) -> None:
    """Say the state of each image, with the votes. Exit code 3 if one is unknown."""
    recognizer = Recognizer.load(file)
    model = models.create(recognizer.model.name)
    unknown = False
    records = []
    for image in images:
        verdict = recognizer.recognize(image, model)
        unknown |= verdict.state is State.UNKNOWN
        records.append({"image": str(image)} | verdict_record(verdict))
        words = (
            f"{image}: {verdict.state_name} ({verdict.reason}; {verdict.n_positive} for "
            f"{recognizer.states.positive}, {verdict.n_negative} for {recognizer.states.negative}, "
            f"{verdict.n_invalid} invalid; {verdict.n_calls} calls, {verdict.milliseconds:.0f} ms)"
        )
        if not as_json:
            print(words)
    if as_json:
        print_json(records)
    if unknown:
        raise typer.Exit(3)
