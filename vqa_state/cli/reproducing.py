"""`reproduce`: the paper's eleven experiments in one command."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from vqa_state import models
from vqa_state.cli.options import app
from vqa_state.cli.picking import given_path
from vqa_state.cli.terminal import interruptible, print_table, say
from vqa_state.errors import ProjectError
from vqa_state.reproduction.page import write_report
from vqa_state.reproduction.paper import EXPERIMENTS
from vqa_state.reproduction.running import Finished, Step, copy_projects, run
from vqa_state.reproduction.tables import shown, total_frame
from vqa_state.study.collect import AskProgress

__all__ = ["reproduce"]

#: The sample projects, beside the package in a clone; an installed package comes without them.
_SAMPLES = Path(__file__).parents[2] / "projects"


@app.command()
def reproduce(
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", parser=given_path, help="Where copies and tables are written."),
    ],
    model: Annotated[str, typer.Option(help="Name or address of the model.")] = "embedded",
    projects: Annotated[
        Path,
        typer.Option(metavar="DIR", parser=given_path, help="Folder of the eleven projects."),
    ] = _SAMPLES,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Of the searches.")] = 0,
) -> None:
    """Run the paper's eleven experiments and write its tables with ours beside them.

    The projects are copied to DIR first. Run it again, and it goes on where it was.
    """
    if projects == _SAMPLES and not projects.is_dir():
        raise ProjectError(
            "the eleven sample projects are not part of an installed package; clone the "
            "repository, and name its folder of samples with --projects DIR"
        )
    folders = copy_projects(projects, out, EXPERIMENTS)
    vqa_model = models.create(models.choose(model))
    finished = []
    with interruptible() as stop, _bar() as bar:
        task = bar.add_task("", total=len(folders))
        for step in run(folders, vqa_model, seed, stop):
            bar.update(task, completed=_completed(step), description=_doing(step))
            if isinstance(step.progress, Finished):
                finished.append(step.progress)
    if len(finished) < len(folders):
        say(f"stopped by you after {len(finished)} of {len(folders)}; run it again, and it goes on")
        raise typer.Exit(3)
    for path in write_report(out, vqa_model.fingerprint, finished):
        say(f"written: {path}")
    found = {one.project.folder.name: one.results for one in finished}
    print_table(shown(total_frame(found)), "Recognized test images, all experiments together")
    say(
        "distinct, low, high and what follows count each picture once: without various doors, "
        "whose pictures are those of the four door experiments"
    )
    say("the paper's numbers are of another model on other images; see index.html")


def _bar() -> Progress:
    """Experiments done, with the time that the others may take."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )


def _completed(step: Step) -> float:
    """Experiments done; asking is most of one."""
    before, progress = step.number - 1, step.progress
    if isinstance(progress, Finished):
        return step.number
    if isinstance(progress, AskProgress):
        return before + 0.7 * (1 - progress.n_left / max(1, progress.n_calls))
    return before + 0.7 + 0.3 * progress.generation / max(1, progress.total)


def _doing(step: Step) -> str:
    kind = "asking" if isinstance(step.progress, AskProgress) else "searching"
    return f"{step.number} of {step.total}: {step.experiment.replace('_', ' ')}, {kind}"
