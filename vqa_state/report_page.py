"""The report as one HTML page with pictures: it opens offline and prints."""

import base64
from collections.abc import Sequence
from html import escape

import pandas as pd

from vqa_state import report
from vqa_state.assessing import Assessment
from vqa_state.coverage import CoveragePoint
from vqa_state.errors import ImageError, ProjectError
from vqa_state.evaluation import Candidate, MissedImage
from vqa_state.frontier import FrontierPoint
from vqa_state.project import Project
from vqa_state.standings import Standings, standings_frame
from vqa_state.tuning import Results

__all__ = ["report_page"]

_STYLE = """
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif; }
body { max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
td, th { border: 1px solid #8888; padding: .2rem .5rem; text-align: right; }
td:first-child, th:first-child { text-align: left; }
ul.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(9rem, 1fr));
  gap: .5rem; list-style: none; padding: 0; font-size: .8rem; }
ul.pictures img { width: 100%; border-radius: .3rem; display: block; }
svg { max-width: 40rem; width: 100%; height: auto; }
svg text { fill: currentColor; font-size: 12px; }
@media print { body { margin: 0; max-width: none; } li, table, svg { break-inside: avoid; } }
"""

_WIDTH, _HEIGHT, _EDGE = 640, 260, 40


def report_page(
    project: Project, found: Results, assessed: Assessment | None, table: Standings
) -> str:
    """The whole page. It shows test scores, so it is a look at the test images.

    Args:
        project: its names, pictures and look-alikes are shown; every text is escaped.
        found: its present results.
        assessed: of the chosen objective, or None.
        table: all recognizers, from `vqa_state.standings.standings`.
    """
    questions = report.question_frame(found.train)
    parts = [
        f"<h1>{escape(project.name)}: {escape(project.states.positive)} or "
        f"{escape(project.states.negative)}?</h1>",
        "<h2>What the numbers say</h2>",
        _list([one for one in (table.recommendation, *table.warnings) if one]),
        _table(standings_frame(table)),
        "<p>Intervals are exact, 95 %. Training scores carry none, because training images chose "
        "the questions. ★ marks the recommended kind of vote.</p>",
        _list(table.sentences),
        "<h2>What is proved about the subsets</h2>",
        _list([*table.badges, *report.term_sentences(found)]),
    ]
    if assessed is not None:
        parts += _assessed(assessed)
    parts += [
        "<h2>The questions on the training images</h2>",
        _heatmap(questions),
        f"<h2>Images that {escape(project.chosen.value)} does not recognize</h2>",
        _pictures(project, found),
        "<h2>Provenance</h2>",
        _list(_provenance(project, found)),
    ]
    title = escape(project.name)
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{_STYLE}</style>{''.join(parts)}</html>\n"
    )


def _assessed(assessed: Assessment) -> list[str]:
    curve = assessed.curves.get(assessed.recommendation.kind, ())
    return [
        "<h2>What each further question buys</h2>",
        "<p>Recognized training images against calls a decision, the best subset found of each "
        "size.</p>",
        _frontier(assessed.frontier),
        "<h2>Accuracy against coverage</h2>",
        "<p>Out of bag, of the recommended vote: the fewer images get a verdict, the more of the "
        "verdicts are right.</p>",
        _coverage(curve),
    ]


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _table(frame: pd.DataFrame) -> str:
    head = "".join(f"<th>{escape(str(column))}</th>" for column in frame.columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in line)}</tr>"
        for line in frame.itertuples(index=False)
    )
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def _heatmap(questions: pd.DataFrame) -> str:
    """Shares in %, on a ground from red over white to green; "–" without a valid answer."""
    columns = ["accuracy", "accuracy_positive", "accuracy_negative", "invalid"]
    head = "".join(f"<th>{escape(one.replace('_', ', '))}</th>" for one in columns)
    rows = []
    for record in questions.sort_values("accuracy", ascending=False).to_dict("records"):
        cells = "".join(_cell(float(record[one]), good=one != "invalid") for one in columns)
        rows.append(f"<tr><td>{escape(str(record['question']))}</td>{cells}</tr>")
    return f'<div class="wide"><table><tr><th>question</th>{head}</tr>{"".join(rows)}</table></div>'


def _cell(share: float, *, good: bool) -> str:
    if share != share:
        return "<td>–</td>"
    hue = 120 * (share if good else 1 - share)
    return f'<td style="background: hsl({hue:.0f} 70% 50% / 35%)">{100 * share:.0f}</td>'


def _pictures(project: Project, found: Results) -> str:
    row = next(r for r in found.evaluation.rows if r.name == Candidate(project.chosen.value))
    sides = [("train", one) for one in row.train_missed] + [("test", o) for o in row.test_missed]
    worst = sorted(sides, key=lambda side: side[1].n_for - side[1].n_against)
    if not worst:
        return "<p>None.</p>"
    items = "".join(_picture(project, side, missed) for side, missed in worst)
    return f'<ul class="pictures">{items}</ul>'


def _picture(project: Project, side: str, missed: MissedImage) -> str:
    """One picture with its votes; without the picture if its file is gone."""
    state = escape(project.states.of(missed.label))
    words = (
        f"{escape(project.images[missed.image_id].name)}: {state} ({side}; {missed.n_for} for, "
        f"{missed.n_against} against, {missed.n_invalid} invalid)"
    )
    try:
        data = base64.b64encode(project.thumbnail(missed.image_id)).decode()
    except (ImageError, ProjectError):
        return f"<li>{words}</li>"
    return f'<li><img alt="{state}" src="data:image/webp;base64,{data}">{words}</li>'


def _frontier(points: Sequence[FrontierPoint]) -> str:
    if not points:
        return "<p>Not known: the assessment was stopped.</p>"
    most_calls, n_images = points[-1].n_calls, points[0].n_images
    marks = [
        (
            point.n_calls / most_calls,
            point.n_recognized / n_images,
            f"{point.n_questions} questions, {point.n_calls} calls: {point.n_recognized} of "
            f"{point.n_images}, R_ave {point.R_ave:.3f}",
        )
        for point in points
    ]
    return _plot(marks, f"calls a decision, up to {most_calls}", f"recognized of {n_images}")


def _coverage(curve: Sequence[CoveragePoint]) -> str:
    marks = [
        (
            point.coverage,
            point.accuracy,
            f"{point.n_covered} of {point.n_images} get a verdict, {point.n_correct} are right "
            f"(95 % interval {point.interval.low:.0%} to {point.interval.high:.0%}) from sureness "
            f"{point.min_sureness:.2f}",
        )
        for point in curve
        if point.n_covered
    ]
    if not marks:
        return "<p>Not known: no training image was ever out of bag.</p>"
    return _plot(marks, "share of images with a verdict", "share of verdicts that are right")


def _plot(marks: Sequence[tuple[float, float, str]], below: str, beside: str) -> str:
    """Points in the unit square with a title each, joined by a line."""

    def at(x: float, y: float) -> tuple[float, float]:
        across, up = _WIDTH - 2 * _EDGE, _HEIGHT - 2 * _EDGE
        return _EDGE + x * across, _HEIGHT - _EDGE - y * up

    places = [at(x, y) for x, y, _ in marks]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    (left, bottom), (right, top) = at(0, 0), at(1, 1)
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#27c">'
        f"<title>{escape(said)}</title></circle>"
        for (x, y), (_, _, said) in zip(places, marks, strict=True)
    )
    items = "".join(f"<li>{escape(said)}</li>" for _, _, said in marks)
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(beside)}">'
        f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="#888"/>'
        f'<text x="{left}" y="{top - 8}">{escape(beside)} (0 to 100 %)</text>'
        f'<text x="{right}" y="{bottom + 20}" text-anchor="end">{escape(below)}</text>'
        f'<polyline points="{line}" fill="none" stroke="#27c"/>{dots}</svg>'
        f"<details><summary>The points in words</summary><ul>{items}</ul></details>"
    )


def _provenance(project: Project, found: Results) -> list[str]:
    shifts, evaluation = project.augmentation, found.evaluation
    saved = found.searches[project.chosen]
    sizes = saved.settings
    return [
        f"Model: {project.model}; fingerprint: {project.fingerprint}",
        f"{found.train.n_images} training images, "
        f"{found.test.n_images if found.test else 0} test images, {found.train.n_questions} "
        f"questions; {shifts.n_copies} copies of each image ({shifts.kind.value}, "
        f"{shifts.amount:g}, seed {project.seed})",
        f"Left out because answers are missing: {evaluation.n_left_out_train} training and "
        f"{evaluation.n_left_out_test} test images",
        f"Search: {saved.engine.value}, {sizes.population} individuals, {sizes.generations} "
        f"generations, seed {saved.seed}, α {saved.weights.alpha:g}, β {saved.weights.beta:g}, "
        f"{'finished' if saved.finished else 'stopped by the user'}",
        f"The test results were looked at {project.test_looks + 1} times, this one included",
        *report.look_alike_sentences(project),
        "Method: K. Kawaharazuka et al., ICRA 2023, arXiv 2303.05052",
    ]
