"""The report as one HTML page with pictures: it opens offline and prints."""

from collections.abc import Sequence
from html import escape

import pandas as pd

import vqa_state
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.report import frames, galleries, plots
from vqa_state.study.assess import Assessment
from vqa_state.study.frontier_marks import cheaper_sentence, marked_points
from vqa_state.study.leaderboard import Standings, standings_frame
from vqa_state.study.leaderboard_words import TABLE_NOTE
from vqa_state.study.suggest import hints

__all__ = ["report_page"]

_STYLE = """
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif; }
body { max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
td, th { border: 1px solid #8888; padding: .2rem .5rem; text-align: right; }
td { white-space: nowrap; }
td:first-child, th:first-child { text-align: left; position: sticky; left: 0; background: Canvas; }
table.recognizers { font-size: .85em; }
table.questions td:first-child { white-space: normal; min-width: 9rem; }
@media print {
  body { margin: 0; max-width: none; font-size: 11px; }
  div.wide { overflow: visible; }
  table.recognizers { font-size: 8px; }
  td, th { padding: 1px 3px; }
  td:first-child, th:first-child { position: static; }
  li, tr, svg { break-inside: avoid; }
  h2 { break-after: avoid; }
}
"""


def report_page(
    project: Project, found: Results, assessed: Assessment | None, table: Standings
) -> str:
    """The whole page. It shows test scores, so it is a look at the test images.

    Args:
        project: its names, pictures and look-alikes are shown; every text is escaped.
        found: its present results.
        assessed: of the chosen objective, or None.
        table: all recognizers, from `vqa_state.study.leaderboard.standings`.
    """
    hinted = hints(project, found, assessed)
    parts = [
        f"<h1>{escape(project.name)}: {escape(project.states.positive)} or "
        f"{escape(project.states.negative)}?</h1>",
        "<h2>What the numbers say</h2>",
        _list([one for one in (table.recommendation, *table.warnings) if one]),
        _table(standings_frame(table)),
        f"<p>{escape(TABLE_NOTE)} Milliseconds (ms) were measured on the machine that asked.</p>",
        _list(table.sentences),
        "<h2>What is proved about the subsets</h2>",
        "<p>Proofs are about these training images and questions. They do not say how any subset "
        "does on new images.</p>",
        _list([*table.badges, *frames.term_sentences(found)]),
        *([] if assessed is None else _assessed(found, assessed)),
        "<h2>The questions on the training images</h2>",
        _heatmap(frames.question_frame(found.train)),
        f"<h2>Images that {escape(project.chosen.value)} does not recognize</h2>",
        galleries.missed(project, found),
        "<h2>Label next</h2>",
        galleries.next_labels(project, hinted),
        "<h2>Possibly mislabelled</h2>",
        galleries.doubtful_labels(project, hinted, assessed=assessed is not None),
        "<h2>Provenance</h2>",
        _list(_provenance(project, found, assessed)),
    ]
    title = escape(project.name)
    style = _STYLE + galleries.STYLE + plots.STYLE
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{style}</style>{''.join(parts)}</html>\n"
    )


def _assessed(found: Results, assessed: Assessment) -> list[str]:
    marks, chosen = marked_points(found), assessed.objective.value
    curve = assessed.curves.get(assessed.recommendation.kind, ())
    return [
        "<h2>What each further question buys</h2>",
        "<p>On the training images. The line joins the best subsets found of each size; diamonds "
        "are the subsets that were searched for, all questions, and the best single one. "
        f"{escape(cheaper_sentence(marks, chosen))}</p>",
        plots.frontier_plot(assessed.frontier, marks),
        "<h2>Accuracy against coverage</h2>",
        "<p>Out of bag, of the recommended vote: the fewer images get a verdict, the more of the "
        "verdicts are right. Each point is of single votes, because a new image gets one; its "
        "interval knows that an image has several.</p>",
        plots.coverage_plot(curve),
    ]


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _table(frame: pd.DataFrame) -> str:
    head = "".join(f"<th>{escape(str(column))}</th>" for column in frame.columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in line)}</tr>"
        for line in frame.itertuples(index=False)
    )
    return f'<div class="wide"><table class="recognizers"><tr>{head}</tr>{body}</table></div>'


def _heatmap(questions: pd.DataFrame) -> str:
    """Shares in %, on a ground from red over white to green; "–" without a valid answer."""
    columns = ["accuracy", "accuracy_positive", "accuracy_negative", "invalid"]
    head = "".join(f"<th>{escape(one.replace('_', ', '))}</th>" for one in columns)
    rows = []
    for record in questions.sort_values("accuracy", ascending=False).to_dict("records"):
        cells = "".join(_cell(float(record[one]), good=one != "invalid") for one in columns)
        rows.append(f"<tr><td>{escape(str(record['question']))}</td>{cells}</tr>")
    return (
        f'<div class="wide"><table class="questions"><tr><th>question</th>{head}</tr>'
        f"{''.join(rows)}</table></div>"
    )


def _cell(share: float, *, good: bool) -> str:
    if share != share:
        return "<td>–</td>"
    hue = 120 * (share if good else 1 - share)
    return f'<td style="background: hsl({hue:.0f} 70% 50% / 35%)">{100 * share:.0f}</td>'


def _provenance(project: Project, found: Results, assessed: Assessment | None) -> list[str]:
    shifts, evaluation = project.augmentation, found.evaluation
    saved = found.searches[project.chosen]
    sizes = saved.settings
    return [
        f"Program: VQA State {vqa_state.__version__}",
        f"Model: {project.model}; fingerprint: {project.fingerprint}",
        f"{found.train.n_images} training images, "
        f"{found.test.n_images if found.test else 0} test images, {found.train.n_questions} "
        f"questions; {shifts.n_copies} copies of each image ({shifts.kind.value}, "
        f"{shifts.amount:g}, seed {project.seed})",
        _left_out(evaluation.n_left_out_train, evaluation.n_left_out_test),
        f"Search: {saved.engine.value}, {sizes.population} individuals, {sizes.generations} "
        f"generations, seed {saved.seed}, α {saved.weights.alpha:g}, β {saved.weights.beta:g}, "
        f"{'finished' if saved.finished else 'stopped by the user'}",
        *(["Taken: all questions, by the paper's vote"] if project.all_questions else []),
        *_assessed_how(assessed),
        *_looked(project, found),
        *frames.look_alike_sentences(project),
        "Method: K. Kawaharazuka et al., ICRA 2023, arXiv 2303.05052",
    ]


def _looked(project: Project, found: Results) -> list[str]:
    n = project.test_looks + 1
    times = "once, by this page" if n == 1 else f"{n} times, this one included"
    return [f"The test results were looked at {times}"] if found.test else []


def _assessed_how(assessed: Assessment | None) -> list[str]:
    if assessed is None:
        return ["Assessment: none of these answers and labels"]
    end = "finished" if assessed.finished else "stopped by the user"
    rival = assessed.rival
    return [
        f"Assessment: of {assessed.objective.value}, {assessed.n_resamples} resamples, seed "
        f"{assessed.seed}, {end}",
        f"Rival: none, {assessed.no_rival}"
        if rival is None
        else f"Rival: {rival.n_features} features a picture, strength {rival.strength:g}; image "
        f"network's fingerprint: {rival.fingerprint}",
    ]


def _left_out(n_train: int, n_test: int) -> str:
    if not n_train + n_test:
        return "No image is left out: every answer is there"
    return f"Left out because answers are missing: {n_train} training and {n_test} test images"
