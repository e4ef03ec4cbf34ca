"""Writes the tables as CSV, Markdown and one page of HTML with pictures."""

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import pandas as pd

from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.reproduction.running import Finished
from vqa_state.reproduction.tables import (
    Remark,
    experiment_frame,
    identity_holds,
    remarks,
    shown,
    total_frame,
)
from vqa_state.storage.atomic_write import write_atomically

__all__ = ["write_report"]

#: What must be read before the numbers.
_CAUTION = (
    "The paper's numbers are those of another model (OFA) on the authors' photos; ours are those "
    "of the model named above on rendered pictures. They stand side by side to show the same "
    "method at work, not to say which is better. Intervals are exact, 95 %, of our test images. "
    "The pictures of various doors are those of the four door experiments: they count twice in "
    "`recognized` of `images`, as in the paper's total, and once in `distinct` of "
    "`distinct_images`, of which the total's intervals and p-values are."
)

_STYLE = """
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif; }
body { max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
td, th { border: 1px solid #8888; padding: .2rem .5rem; text-align: right; }
ul.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(8rem, 1fr));
  gap: .5rem; list-style: none; padding: 0; font-size: .8rem; }
ul.pictures img { width: 100%; border-radius: .3rem; display: block; }
ul.pictures li.missed img { outline: 3px solid #d33; }
"""


def write_report(out: Path, model: str, finished: Sequence[Finished]) -> list[Path]:
    """Write tables.csv, tables.md and index.html below `out`; return their paths.

    Raises:
        ProjectError: if they cannot be written.
    """
    found = {one.project.folder.name: one.results for one in finished}
    frames = {name: experiment_frame(name, one) for name, one in found.items()}
    identity = [name for name, one in found.items() if not identity_holds(one)]
    facts = _Facts(model, frames, total_frame(found), remarks(found), identity)
    contents = {
        "tables.csv": pd.concat(frames.values()).to_csv(index=False),
        "tables.md": _markdown(facts),
        "index.html": _html(facts, finished),
    }
    for name, text in contents.items():
        write_atomically(out / name, text.encode())
    return [out / name for name in contents]


class _Facts:
    """All that both documents say."""

    def __init__(
        self,
        model: str,
        frames: Mapping[str, pd.DataFrame],
        total: pd.DataFrame,
        remarks: Sequence[Remark],
        broken_identity: Sequence[str],
    ) -> None:
        self.model = model
        self.frames = frames
        self.total = total
        self.remarks = [remark.sentence for remark in remarks]
        self.identity = (
            "R_invalid(all) differs from the mean of both forms in: " + ", ".join(broken_identity)
            if broken_identity
            else "R_invalid(all) is the mean of R_invalid(is) and R_invalid(does) in every table."
        )


def _markdown(facts: _Facts) -> str:
    parts = [
        "# The paper's experiments",
        f"Model: `{facts.model}`",
        _CAUTION,
        "## All experiments together",
        _as_markdown(facts.total),
        "## What the paper saw in its model",
        "\n".join(f"- {sentence}" for sentence in (*facts.remarks, facts.identity)),
    ]
    for name, frame in facts.frames.items():
        parts += [f"## {name.replace('_', ' ')}", _as_markdown(frame.drop(columns="experiment"))]
    return "\n\n".join(parts) + "\n"


def _as_markdown(frame: pd.DataFrame) -> str:
    lines = [list(frame.columns), ["---"] * len(frame.columns), *_cells(frame)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cells(frame: pd.DataFrame) -> list[list[str]]:
    return [list(record) for record in shown(frame).itertuples(index=False)]


def _html(facts: _Facts, finished: Sequence[Finished]) -> str:
    parts = [
        "<h1>The paper's experiments</h1>",
        f"<p>Model: <code>{escape(facts.model)}</code></p><p>{_said(_CAUTION)}</p>",
        "<h2>All experiments together</h2>",
        _as_html(facts.total),
        "<h2>What the paper saw in its model</h2><ul>",
        *(f"<li>{_said(sentence)}</li>" for sentence in (*facts.remarks, facts.identity)),
        "</ul>",
    ]
    for one, (name, frame) in zip(finished, facts.frames.items(), strict=True):
        parts += [
            f"<h2>{escape(one.project.name)}</h2>",
            _as_html(frame.drop(columns="experiment")),
            _pictures(one, name),
        ]
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>The paper's experiments</title><style>{_STYLE}</style>{''.join(parts)}</html>\n"
    )


def _said(sentence: str) -> str:
    """Words between backticks as code."""
    parts = [escape(part) for part in sentence.split("`")]
    return "".join(f"<code>{part}</code>" if n % 2 else part for n, part in enumerate(parts))


def _as_html(frame: pd.DataFrame) -> str:
    head = "".join(f"<th>{escape(str(column))}</th>" for column in frame.columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in line)}</tr>" for line in _cells(frame)
    )
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def _pictures(one: Finished, name: str) -> str:
    """The test pictures with their state and the rows that miss them."""
    missed: dict[str, list[str]] = {}
    for row in one.results.evaluation.rows:
        for picture in row.test_missed:
            missed.setdefault(picture.image_id, []).append(row.name.value)
    items = [
        _picture(one.project, image.id, image.label or 0, missed.get(image.id, []))
        for image in one.project.labelled(Split.TEST)
    ]
    title = f"Test pictures of {name.replace('_', ' ')}; outlined: not recognized by s+"
    return (
        f"<details><summary>{escape(title)}</summary>"
        f'<ul class="pictures">{"".join(items)}</ul></details>'
    )


def _picture(project: Project, image_id: str, label: int, missed: Sequence[str]) -> str:
    data = base64.b64encode(project.thumbnail(image_id)).decode()
    state = escape(project.states.of(label))
    words = f"{state}; missed by {escape(', '.join(missed))}" if missed else state
    kind = ' class="missed"' if "s+" in missed else ""
    return f'<li{kind}><img alt="{state}" src="data:image/webp;base64,{data}">{words}</li>'
