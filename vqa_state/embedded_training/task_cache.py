"""What was measured of each task, kept on disk, so that a stopped measuring goes on behind it."""

import json
from dataclasses import asdict
from pathlib import Path

from vqa_state.answers import rates
from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training import intervals, measuring
from vqa_state.embedded_training.digests import digest, digest_file
from vqa_state.embedded_training.intervals import Tally
from vqa_state.embedded_training.measuring import N_DRAWS, TaskNumbers, measure_task
from vqa_state.search import genetic

__all__ = ["measure_once"]

#: Their code decides what is measured.
_CODE = (rates, genetic, measuring, intervals)


def measure_once(
    folder: Path, name: str, group: str, table: AnswerTable, n_grid: int, n_draws: int = N_DRAWS
) -> TaskNumbers:
    """`measure_task`, or what it gave before for the same answers by the same code."""
    made_by = [digest_file(Path(str(module.__file__))) for module in _CODE]
    about = [[question.text, question.yes_means] for question in table.questions]
    answers = [table.verdicts.tolist(), table.labels.tolist(), about]
    file = folder / f"{digest(name, group, n_grid, n_draws, made_by, answers)}.json"
    if not file.exists():
        row = measure_task(name, group, table, n_grid, n_draws)
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = file.with_suffix(".part")
        unfinished.write_text(json.dumps(asdict(row)), "utf-8")
        unfinished.replace(file)
    kept = json.loads(file.read_text("utf-8"))
    return TaskNumbers(**{**kept, "tally": Tally(**kept["tally"])})
