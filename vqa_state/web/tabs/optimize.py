"""Fourth stretch: let the genetic algorithm choose questions, for four objectives at once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.answers.completeness import Completeness
from vqa_state.answers.rates import count
from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.searches import Results
from vqa_state.recognizer.schema import ProofRecord
from vqa_state.search.engines import Engine
from vqa_state.search.fitness import Fitness, Terms
from vqa_state.search.genetic import PAPER_SETTINGS, SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.search.proof import badge_sentence
from vqa_state.study.optimize import OptimizeProgress, is_optimized, optimize, results
from vqa_state.web import arguments, job_watcher, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.tabs import partly
from vqa_state.web.view_data import note

__all__ = ["HINTS", "Parts", "build", "wire"]

KIND = "optimizing"
HINTS = {objective: objective.kind.hint for objective in Objective}
PROVING = "Proving how good the best can be. It ends by itself; a stop keeps the best so far."
MAX_POINTS = 240

Points = list[tuple[int, float, float]]


@dataclass(frozen=True)
class Parts:
    """Components of the tab; the numbers are in the order of `settle`."""

    tab: gr.Tab
    engine: gr.Radio
    numbers: tuple[gr.Number, ...]
    start: gr.Button
    part: partly.Parts
    stop: gr.Button
    note: gr.HTML
    chart: gr.HTML


@dataclass(frozen=True)
class Searching:
    """What the job reports: the latest generation, and all before it.

    The job only appends to `points`; a reader takes those up to the latest generation.
    """

    progress: OptimizeProgress
    points: Mapping[Objective, Points]


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    gr.Markdown(
        "Four searches run side by side. Each looks for the set of questions that is best by its "
        "own objective, on the training images only."
    )
    engine = gr.Radio(
        [(one.kind.hint, one.value) for one in Engine], label="Engine", elem_id="engine"
    )
    with gr.Accordion("Advanced: settings of the search", open=False):
        numbers = _numbers()
    with gr.Row():
        start = gr.Button(
            "Optimize", variant="primary", elem_id="optimize-start", scale=0, min_width=170
        )
        part = partly.build()
        stop = gr.Button("Stop", interactive=False, elem_id="optimize-stop", scale=0, min_width=170)
    said = widgets.note("optimize-note")
    chart = widgets.search_chart("chart")
    return Parts(tab, engine, numbers, start, part, stop, said, chart)


def _numbers() -> tuple[gr.Number, ...]:
    paper = PAPER_SETTINGS
    with gr.Row(equal_height=True):
        population = gr.Number(paper.population, label="Population", precision=0)
        generations = gr.Number(
            paper.generations, label="Generations", precision=0, elem_id="generations"
        )
        tournament = gr.Number(paper.tournament, label="Tournament size", precision=0)
    with gr.Row(equal_height=True):
        crossover = gr.Number(paper.crossover, label="Crossover probability", step=0.05)
        mutation = gr.Number(paper.mutation, label="Mutation probability", step=0.05)
        bit_flip = gr.Number(paper.bit_flip, label="Flip probability of a bit", step=0.01)
    with gr.Row(equal_height=True):
        alpha = gr.Number(label="α, weight of recognized images")
        beta = gr.Number(label="β, weight of the number of questions", step=0.05)
        seed = gr.Number(label="Seed of the search", precision=0)
    return (
        population, generations, crossover, mutation, bit_flip, tournament, alpha, beta, seed,
    )  # fmt: skip


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [parts.note, parts.chart, parts.start, parts.stop]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    page.fill(show, parts.numbers)
    page.fill(show_engine, [parts.engine])
    page.on(parts.engine.input, choose_engine, [parts.engine], [])
    offer = [parts.part.start, parts.part.offered]
    for trigger in (page.arrived.then, parts.tab.select):
        page.on(trigger, partly.show, (), offer, queue=False)
    follow(parts.tab.select)
    started = page.on(parts.start.click, start, parts.numbers, [])
    agreed = page.on(
        parts.part.start.click, start_on_part, [parts.part.offered, *parts.numbers], []
    )
    for trigger in (started.success, agreed.success, page.arrived.then):
        page.then_road(page.on(follow(trigger).then, partly.show, (), offer))


def show(desk: Desk, pid: str) -> Any:
    """The settings."""
    with desk.reading(pid) as project:
        one, weights = project.search, project.weights
        seed = project.search_seed
    return (
        one.population, one.generations, one.crossover, one.mutation, one.bit_flip,
        one.tournament, weights.alpha, weights.beta, seed,
    )  # fmt: skip


def show_engine(desk: Desk, pid: str) -> Any:
    """How the project searches."""
    with desk.reading(pid) as project:
        return project.engine.value


def choose_engine(desk: Desk, pid: str, engine: Any) -> None:
    """Keep how the project searches."""
    chosen = arguments.choice(engine, Engine, "the engine")
    with desk.changing(pid) as project:
        project.engine = chosen


def start(desk: Desk, pid: str, *numbers: Any) -> None:
    """Keep the settings and begin to search, or attach to what is running.

    Raises:
        MissingAnswersError: if training images lack answers.
    """
    if desk.jobs.alive(pid) is None:
        partly.require_whole(desk.snapshot(pid))
        settle(desk, pid, *numbers)
    desk.jobs.start(pid, KIND, searching(desk, pid))


def start_on_part(desk: Desk, pid: str, offered: Any, *numbers: Any) -> None:
    """Like `start`, on the complete training images, which the page offered as `offered`.

    Raises:
        MissingAnswersError: if they are others by now.
    """
    if desk.jobs.alive(pid) is None:
        partly.require_agreed(desk.snapshot(pid), offered)
        settle(desk, pid, *numbers)
    desk.jobs.start(pid, KIND, searching(desk, pid, incomplete=True))


def settle(desk: Desk, pid: str, *numbers: Any) -> None:
    """Check and keep the settings of the search."""
    population, generations, crossover, mutation, bit_flip, tournament, alpha, beta, seed = numbers
    settings = arguments.stated(
        lambda: SearchSettings(
            population=arguments.integer(population, "the population"),
            generations=arguments.integer(generations, "the generations"),
            crossover=arguments.number(crossover, "the crossover probability"),
            mutation=arguments.number(mutation, "the mutation probability"),
            bit_flip=arguments.number(bit_flip, "the flip probability"),
            tournament=arguments.integer(tournament, "the tournament size"),
        )
    )
    weights = arguments.stated(
        lambda: ObjectiveWeights(arguments.number(alpha, "α"), arguments.number(beta, "β"))
    )
    with desk.changing(pid) as project:
        project.search, project.weights = settings, weights
        project.search_seed = arguments.integer(seed, "the seed of the search")


def searching(desk: Desk, pid: str, *, incomplete: bool = False) -> Work:
    """The work: search, and keep every generation for the chart."""

    def work(stop: StopFlag) -> Iterator[Searching]:
        points: dict[Objective, Points] = {objective: [] for objective in Objective}
        for progress in optimize(desk.snapshot(pid), stop, incomplete=incomplete):
            for objective, report in progress.reports.items() if not progress.proving else ():
                point = (report.generation, report.best_fitness, report.mean_fitness)
                points[objective].append(point)
            yield Searching(progress, points)

    return work


def view(desk: Desk, pid: str, snapshot: Snapshot | None) -> tuple[Any, ...]:
    """Note, chart, start and stop."""
    buttons = job_watcher.buttons(snapshot)
    if snapshot is None or snapshot.report is None or _is_outdated(desk, pid, snapshot):
        said, chart = _saved(desk, pid)
        if snapshot is not None and snapshot.report is None:
            said = job_watcher.before_reports(snapshot, "Reading the answers…")
        return said, chart, *buttons
    said = _said(snapshot)
    if snapshot.state in (JobState.DONE, JobState.STOPPED):
        said = _limited(said, partly.answers_of(desk.snapshot(pid)))
    return said, _live_chart(snapshot.report), *buttons


def _limited(said: Any, answers: Completeness | None) -> Any:
    """What was found, with what the search did not see."""
    limits = () if answers is None else answers.limits
    return said if not limits else note("\n".join([said["text"], *limits]), "warn")


def _is_outdated(desk: Desk, pid: str, snapshot: Snapshot) -> bool:
    """Whether what a job found is of other answers or labels than the present ones."""
    is_kept = snapshot.state in (JobState.DONE, JobState.STOPPED)
    return is_kept and not is_optimized(desk.snapshot(pid))


def _said(snapshot: Snapshot) -> Any:
    progress: OptimizeProgress = snapshot.report.progress
    at = f"generation {progress.generation:,} of {progress.total:,}"
    share = progress.generation / max(progress.total, 1)
    match snapshot.state:
        case JobState.FAILED:
            return note(f"Failed at {at}: {snapshot.failure}", "bad")
        case JobState.STOPPED:
            return note(f"Stopped at {at}. The best so far is kept, and marked so.", "warn")
        case JobState.DONE:
            return note("Done. The recognizers are written; see Results.", "good")
        case JobState.STOPPING:
            return note(f"Stopping at {at}…", share=share)
        case _ if progress.proving:
            lines = [f"{one.value}: {p.sentence}" for one, p in progress.proofs.items()]
            return note("\n".join([PROVING, *lines]))
    return note(f"Searching: {at}{job_watcher.left(progress.seconds_left)}", share=share)


def _live_chart(report: Searching) -> Any:
    n_seen = report.progress.generation + 1
    return {
        "searches": [
            _panel(
                objective, report.progress.total, report.points[objective][:n_seen],
                _live_terms(report.progress, objective),
            )
            for objective in Objective
        ]
    }  # fmt: skip


def _live_terms(progress: OptimizeProgress, objective: Objective) -> list[list[str]]:
    """Of the search; once there is news of a proof, of the proof, whose bound falls."""
    proof = progress.proofs.get(objective)
    if proof is None:
        return _terms(progress.reports[objective].terms)
    found = _terms(proof.terms)
    if not proof.finished:
        return [*found, ["proving: E is at most", f"{proof.bound:.3f}"]]
    return [*found, *_proved(proof.sentence, proof.bound)]


def _proved(sentence: str, bound: float) -> list[list[str]]:
    return [["proof", sentence], ["no E is above", f"{bound:.3f}"]]


def _saved(desk: Desk, pid: str) -> tuple[Any, Any]:
    """What an earlier run found, if answers and labels are still the same."""
    project = desk.snapshot(pid)
    try:
        found = results(project)
    except (NothingToSearchError, ProjectError) as error:
        return note(f"Nothing to search yet: {error}."), {"searches": _empty()}
    if found is None:
        said = "Not optimized yet, or images, labels or questions changed since."
        todo = partly.advice(partly.answers_of(project))
        tone = "warn" if todo else "plain"
        return note("\n".join(filter(None, (said, todo))), tone), {"searches": _empty()}
    shown = note("Optimized. See Results.", "good")
    return _limited(shown, found.answers), {"searches": _kept(found)}


def proved(proof: ProofRecord) -> list[list[str]]:
    """What a kept proof says, as whole as while proving."""
    sentence = badge_sentence(proof.badge, proof.bound - proof.value, proof.n_bound)
    return _proved(sentence, proof.bound)


def _empty() -> list[Any]:
    return [_panel(objective, 0, [], []) for objective in Objective]


def _kept(found: Results) -> list[Any]:
    counts, panels = count(found.train), []
    for objective, saved in found.searches.items():
        points = [(generation, *pair) for generation, pair in enumerate(saved.curve)]
        terms = _terms(Fitness(counts, objective, saved.weights).terms(saved.subset))
        if saved.proof is not None:
            terms += proved(saved.proof)
        panels.append(_panel(objective, len(saved.curve) - 1, points, terms))
    return panels


def _panel(objective: Objective, total: int, points: Sequence[Any], terms: list[list[str]]) -> Any:
    step = max(1, len(points) // MAX_POINTS)
    thinned = [*points[:-1:step], *points[-1:]]
    return {
        "name": objective.name,
        "title": objective.value,
        "hint": HINTS[objective],
        "total": total,
        "points": thinned,
        "terms": terms,
    }


def _terms(terms: Terms) -> list[list[str]]:
    return [
        ["recognized (training)", f"{terms.n_recognized} of {terms.n_images}"],
        ["mean correct rate", f"{terms.R_ave:.3f}"],
        ["questions", f"{terms.n_used} of {terms.n_questions}"],
    ]
