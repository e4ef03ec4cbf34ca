"""ask, optimize, tune: the long work."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated

import typer

from vqa_state import models
from vqa_state.cli.looking import cost_record, cost_words, look_first
from vqa_state.cli.options import (
    Folder,
    Incomplete,
    Json,
    MaxTokens,
    Seed,
    app,
    found_results,
    show,
    tell,
)
from vqa_state.cli.terminal import (
    asked_sentence,
    interruptible,
    say,
    show_asking,
    show_assessing,
    show_search,
)
from vqa_state.errors import NothingToSearchError
from vqa_state.images.augmentation import MAX_COPIES, Augmentation, AugmentationKind
from vqa_state.models.address import Source
from vqa_state.models.length_limit import with_max_tokens
from vqa_state.project.project import Project
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import ObjectiveWeights
from vqa_state.study.answer_tables import read_tables, require_answers
from vqa_state.study.assess import assess
from vqa_state.study.collect import AskProgress, ask, plan
from vqa_state.study.latency import estimate, keep_pace
from vqa_state.study.optimize import optimize


@app.command("ask")
def ask_command(
    folder: Folder,
    model: Annotated[str | None, typer.Option(help="Name or address of the model; kept.")] = None,
    max_tokens: MaxTokens = None,
    copies: Annotated[
        int | None, typer.Option(min=1, max=MAX_COPIES, help="Shifted copies of each image; kept.")
    ] = None,
    augmentation: Annotated[
        AugmentationKind | None, typer.Option(help="Kind of copy; kept.")
    ] = None,
    amount: Annotated[
        float | None, typer.Option(min=0.001, max=1.0, help="Share of full scale; kept.")
    ] = None,
    cost: Annotated[bool, typer.Option("--cost", help="Only say what it would cost.")] = False,
    as_json: Json = False,
) -> None:
    """Ask the model every question about every copy of every labelled image.

    An answer is stored before it is counted; stop or kill it, run it again, and it goes on.
    """
    project = Project.open(folder)
    old = project.augmentation
    project.augmentation = Augmentation(
        augmentation or old.kind, amount or old.amount, copies or old.n_copies
    )
    project.model = _chosen(project, model, max_tokens)
    if cost:
        what = estimate(project, models.create(project.model).fingerprint)
        tell(as_json, cost_record(what), cost_words(what, project.model))
        return
    with interruptible() as stop:
        progress = _ask(project, stop)
    tell(as_json, _asked(progress), asked_sentence(progress, project.model))
    _exit_unless(not progress.stopped and not progress.n_failed)


@app.command("optimize")
def optimize_command(
    folder: Folder,
    seed: Seed = None,
    engine: Annotated[
        Engine | None,
        typer.Option(help="paper: its one genetic search; default: longer, with proof; kept."),
    ] = None,
    population: Annotated[int | None, typer.Option(min=2, help="Individuals; kept.")] = None,
    generations: Annotated[int | None, typer.Option(min=0, help="Generations; kept.")] = None,
    crossover: Annotated[float | None, typer.Option(min=0, max=1, help="Rate; kept.")] = None,
    mutation: Annotated[float | None, typer.Option(min=0, max=1, help="Rate; kept.")] = None,
    bit_flip: Annotated[float | None, typer.Option(min=0, max=1, help="Rate; kept.")] = None,
    tournament: Annotated[int | None, typer.Option(min=1, help="Size; kept.")] = None,
    alpha: Annotated[float | None, typer.Option(min=0, help="Weight of R_img; kept.")] = None,
    beta: Annotated[float | None, typer.Option(min=0, help="Weight of R_q; kept.")] = None,
    incomplete: Incomplete = False,
    as_json: Json = False,
) -> None:
    """Choose questions for the four objectives s+, s'+, s-, s'- on the training images.

    Where answers about one are missing, it begins only with --incomplete.
    """
    project = Project.open(folder)
    given = {
        "population": population,
        "generations": generations,
        "crossover": crossover,
        "mutation": mutation,
        "bit_flip": bit_flip,
        "tournament": tournament,
    }
    project.engine = engine or project.engine
    project.search = _settings(project, given)
    project.weights = _weights(project, alpha, beta)
    project.search_seed = project.search_seed if seed is None else seed
    project.save()
    with interruptible() as stop:
        finished = _optimize(project, stop, incomplete=incomplete)
    show(folder, as_json)
    _exit_unless(finished)


@app.command()
def tune(
    folder: Folder,
    model: Annotated[str | None, typer.Option(help="Name or address of the model; kept.")] = None,
    max_tokens: MaxTokens = None,
    seed: Seed = None,
    engine: Annotated[
        Engine | None, typer.Option(help="How to search: default or paper; kept.")
    ] = None,
    incomplete: Incomplete = False,
    as_json: Json = False,
) -> None:
    """All of it for one project: ask, optimize, assess, report, write the recognizers.

    Where the model did not give all answers, it ends after asking, unless --incomplete is given;
    run it again, and only what is missing is asked.
    """
    project = Project.open(folder)
    project.model = _chosen(project, model, max_tokens)
    with project.changing():
        project.assign_splits()
    project.search_seed = project.search_seed if seed is None else seed
    project.engine = engine or project.engine
    with interruptible() as stop:  # one for all stages: a stop between two of them counts
        complete = _stages(project, stop, incomplete=incomplete)
    show(folder, as_json)
    _exit_unless(complete)


def _stages(project: Project, stop: Callable[[], bool], *, incomplete: bool) -> bool:
    """Ask, optimize, assess; whether all came to their end.

    Raises:
        Exit: if the stop came before there was a search to show.
        MissingAnswersError: if answers are missing, and are not to be done without.
    """
    progress = _ask(project, stop)
    say(asked_sentence(progress, project.model))
    if stop():
        if not progress.stopped:
            say("stopped by you before the search; the answers are kept")
        _say_what_is_missing(project)
        raise typer.Exit(3)
    project = Project.open(project.folder)
    if not incomplete:
        require_answers(project, progress.last_failure, _to_go_on(project))
    finished = _optimize(project, stop, incomplete=incomplete)
    if stop():
        if finished:
            say("stopped by you before assessing; the recognizers are kept")
        return False
    return _assess(Project.open(project.folder), stop) and finished and not progress.n_failed


def _say_what_is_missing(project: Project) -> None:
    lacks = read_tables(project).answers.lacks
    if lacks:
        say(f"{lacks}. {_to_go_on(project)}")


def _to_go_on(project: Project) -> str:
    """What to do after asking ended too early."""
    server = project.model.startswith(f"{Source.SERVER.value}:")
    again = f"To go on, {'start the server and ' if server else ''}run the same command again"
    answers = read_tables(project).answers
    if not answers.part_is_searchable and not answers.train.whole:
        return again
    return (
        f"{again}; or search on the {answers.train.n_complete} complete training images with "
        "--incomplete, which never opens the test"
    )


@app.command("assess")
def assess_command(folder: Folder, as_json: Json = False) -> None:
    """How good is it on new images, what does it cost, and what else could one take?

    Kinds of vote, an out-of-bag estimate, a trained image classifier as a rival, the frontier of
    accuracy against calls, accuracy against coverage. Made of training images; kept until answers
    or labels change.
    """
    project = Project.open(folder)
    found_results(project)
    with interruptible() as stop:
        finished = _assess(project, stop)
    show(folder, as_json)
    _exit_unless(finished)


def _assess(project: Project, stop: Callable[[], bool]) -> bool:
    """Whether the assessment came to its end; too few images for one are told, and no failure."""
    try:
        found = show_assessing(assess(project, stop))
    except NothingToSearchError as error:
        say(f"not assessed: {error}")
        return True
    if found is None or not found.finished:
        say("stopped by you while assessing; what came is kept")
    return found is not None and found.finished


def _chosen(project: Project, model: str | None, max_tokens: int | None) -> str:
    """The name of the model to ask: as given now, and else as the project has it."""
    name = models.choose(model) if model else project.model
    return name if max_tokens is None else with_max_tokens(name, max_tokens)


def _ask(project: Project, stop: Callable[[], bool]) -> AskProgress:
    vqa_model = models.create(project.model)
    project.fingerprint = vqa_model.fingerprint
    project.save()
    if plan(project, vqa_model.fingerprint).n_to_ask:
        look_first(vqa_model, stop)
    last = show_asking(ask(project, vqa_model, stop))
    if not last.stopped and not last.n_failed:
        keep_pace(project, vqa_model, stop)
    return last


def _optimize(project: Project, stop: Callable[[], bool], *, incomplete: bool) -> bool:
    """Whether every search came to its end."""
    last = show_search(optimize(project, stop, incomplete=incomplete))
    if not last.searched:
        say(f"stopped by you at generation {last.generation} of {last.total}; the best is kept")
    elif last.stopped:
        say("stopped by you while proving; the best and its bound are kept")
    return not last.stopped


def _settings(project: Project, given: dict[str, float | None]) -> SearchSettings:
    changed = {key: value for key, value in given.items() if value is not None}
    try:
        return SearchSettings(**(asdict(project.search) | changed))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def _weights(project: Project, alpha: float | None, beta: float | None) -> ObjectiveWeights:
    old = project.weights
    try:
        return ObjectiveWeights(
            old.alpha if alpha is None else alpha, old.beta if beta is None else beta
        )
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def _asked(progress: AskProgress) -> dict[str, object]:
    return {
        "n_calls": progress.n_calls,
        "n_asked": progress.n_asked,
        "n_stored": progress.n_stored,
        "n_failed": progress.n_failed,
        "n_cut_off": progress.n_cut_off,
        "seconds": progress.seconds,
        "stopped": progress.stopped,
    }


def _exit_unless(complete: bool) -> None:
    if not complete:
        raise typer.Exit(3)
