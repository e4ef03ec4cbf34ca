"""`python -m vqa_state.embedded_training.evaluate --out DIR`: measure the shipped weights.

Pictures, answers and each task's numbers are cached in DIR. The same command goes on behind the
last task that is finished.
"""

import argparse
import datetime
import json
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from rich.progress import track

from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training.calibration import calibration_error, reliability
from vqa_state.embedded_training.card import with_tables
from vqa_state.embedded_training.dataset import Example, load_examples, render_split
from vqa_state.embedded_training.experiments import cues_about, questions_about
from vqa_state.embedded_training.gains import summarise_gains, summarise_groups
from vqa_state.embedded_training.measurement_cache import AnswerCache, measure_once
from vqa_state.embedded_training.measuring import TaskNumbers
from vqa_state.embedded_training.out_of_distribution import measure_nouns, measure_premises
from vqa_state.embedded_training.photos import load_photos
from vqa_state.embedded_training.scenes import PAPER_THINGS, SceneSplit
from vqa_state.embedded_training.simulators import load_tasks, render_tasks, simulator_tasks
from vqa_state.models.embedded.predictor import MAX_IMAGES, Predictor
from vqa_state.models.embedded.weights import (
    WEIGHTS,
    count_parameters,
    load_network,
    read_header,
    weights_digest,
)

__all__ = ["as_json", "former_speed", "main"]

#: A list that holds no list and no table.
_FLAT_LIST = re.compile(r"\[[^\[\]{}]*\]")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure on held-out scenes, foreign simulators and photos; write the numbers and the card."""
    chosen = _parser().parse_args(arguments)
    folder = chosen.out / SceneSplit.MEASURE.value
    render_split(folder, SceneSplit.MEASURE, chosen.scenes, 1, chosen.processes, PAPER_THINGS)
    foreign = chosen.out / "foreign"
    render_tasks(foreign, list(simulator_tasks(train=False)), chosen.scenes, 1, chosen.processes)
    torch.set_num_threads(chosen.threads)
    numbers = _measure(chosen)
    if chosen.json is not None:
        chosen.json.write_text(as_json(numbers), "utf-8")
    if chosen.card is not None:
        chosen.card.write_text(with_tables(chosen.card.read_text("utf-8"), numbers), "utf-8")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded_training.evaluate", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="for the scenes")
    parser.add_argument("--weights", type=Path, default=WEIGHTS)
    parser.add_argument("--scenes", type=int, default=120, help="of each task; 20 choose s+")
    parser.add_argument("--photos", type=Path, metavar="DIR", help="labelled photos, half are used")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where the numbers go")
    parser.add_argument(
        "--card", type=Path, metavar="FILE", help="the model card to bring up to date"
    )
    parser.add_argument(
        "--time", action="store_true", help="take the time anew; the machine must be idle"
    )
    parser.add_argument("--processes", type=int, default=2, help="for rendering")
    parser.add_argument("--threads", type=int, default=2, help="for the network")
    return parser


def _tasks(chosen: argparse.Namespace) -> list[tuple[str, str, list[Example]]]:
    """(name, group, pictures) of every task."""
    scenes = _one_a_scene(load_examples(chosen.out / SceneSplit.MEASURE.value, chosen.scenes))
    tasks = [
        (thing, "scenes", [each for each in scenes if each.thing == thing])
        for thing in PAPER_THINGS
    ]
    for name in simulator_tasks(train=False):
        pictures = _one_a_scene(load_tasks(chosen.out / "foreign", [name], chosen.scenes))
        tasks.append((name, "foreign", pictures))
    photos = load_photos(chosen.photos, training=False) if chosen.photos is not None else []
    shown = sorted({photo.thing for photo in photos})
    return tasks + [(thing, "photos", [p for p in photos if p.thing == thing]) for thing in shown]


def _measure(chosen: argparse.Namespace) -> dict[str, Any]:
    predictor = Predictor(chosen.weights)
    answers = AnswerCache(predictor, weights_digest(chosen.weights), chosen.out / "answers")
    tasks = _tasks(chosen)
    scenes = {name: pictures for name, group, pictures in tasks if group == "scenes"}
    rows: list[TaskNumbers] = []
    stated: dict[str, list[AnswerTable]] = {}
    for name, group, pictures in track(tasks, description="measuring"):
        thing = pictures[0].thing
        grid = questions_about(thing)
        known = {question.text for question in grid}
        cues = tuple(cue for cue in cues_about(thing) if cue.text not in known)
        table = answers.ask(pictures, (*grid, *cues))
        rows.append(measure_once(chosen.out / "tasks", name, group, table, len(grid)))
        print(json.dumps({k: v for k, v in asdict(rows[-1]).items() if k != "tally"}), flush=True)
        stated.setdefault(group, []).append(table)
    return {
        "file": _file_facts(chosen.weights),
        "speed": _speed(chosen, predictor),
        "tasks": [asdict(row) for row in rows],
        "groups": summarise_groups(rows),
        "gains": summarise_gains(rows),
        "calibration": {group: _calibration(tables) for group, tables in stated.items()},
        "nouns": [
            row for thing, shown in scenes.items() for row in measure_nouns(answers, thing, shown)
        ],
        "premises": [
            measure_premises(answers, thing, shown, tuple(scenes))
            for thing, shown in scenes.items()
        ],
    }


def as_json(numbers: Mapping[str, Any]) -> str:
    """JSON with a list of plain values on one line, so that a person can read the rest."""
    text = json.dumps(numbers, indent=1)
    return _FLAT_LIST.sub(lambda found: f"[{' '.join(found.group()[1:-1].split())}]", text) + "\n"


def _calibration(tables: Sequence[AnswerTable]) -> dict[str, Any]:
    """How often the state with the stated probability was the right one."""
    stated = np.concatenate([table.p_positive.ravel() for table in tables]).astype(np.float64)
    right = np.concatenate(
        [np.broadcast_to(t.labels[:, None, None] == 1, t.verdicts.shape).ravel() for t in tables]
    )
    bins = reliability(stated, right)
    return {
        "error": round(calibration_error(bins), 4),
        "bins": [[each.n, round(each.mean_p, 3), round(each.share_yes, 3)] for each in bins],
    }


def _one_a_scene(examples: Sequence[Example]) -> list[Example]:
    """One picture of each scene, the states in turn, so that no two pictures share anything."""
    return [
        example
        for example in examples
        if example.is_positive == (int(example.scene.rpartition("/")[2]) % 2 == 0)
    ]


def _file_facts(path: Path) -> dict[str, Any]:
    return {
        "digest": weights_digest(path),
        "megabytes": round(path.stat().st_size / 1e6, 2),
        "training": dict(sorted(read_header(path).items())),
        "parameters": count_parameters(load_network(path)),
    }


def _speed(chosen: argparse.Namespace, predictor: Predictor) -> dict[str, Any] | None:
    """The time taken now, if the user says that the machine is idle, else the one in `--json`."""
    if not chosen.time:
        return former_speed(chosen.json, weights_digest(chosen.weights))
    _time(predictor)  # the first run takes memory, which the next ones have
    return {
        "seconds_120x64": round(_time(predictor), 1),
        "threads": chosen.threads,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def former_speed(file: Path | None, weights: str) -> dict[str, Any] | None:
    """The time that an earlier run on an idle machine wrote about the same weights, or None."""
    if file is None or not file.exists():
        return None
    former = json.loads(file.read_text("utf-8"))
    speed: dict[str, Any] | None = former.get("speed")
    return speed if former["file"]["digest"] == weights else None


def _time(predictor: Predictor) -> float:
    """Seconds for 120 pictures with 64 questions each, questions new to the predictor's cache."""
    rng = np.random.default_rng(0)
    images = [Image.fromarray(rng.integers(0, 256, (256, 256, 3), np.uint8)) for _ in range(120)]
    questions = [f"{question.text} Really?" for question in questions_about("cabinet")]
    start = time.perf_counter()
    read = predictor.read(questions)
    for first in range(0, len(images), MAX_IMAGES):
        predictor.answer(images[first : first + MAX_IMAGES], read)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
