"""`python -m vqa_state.embedded.evaluate --out DIR`: measure the shipped weights."""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from rich.progress import track

from vqa_state.answers import AnswerTable
from vqa_state.embedded.calibration import calibration_error, reliability
from vqa_state.embedded.card import with_tables
from vqa_state.embedded.dataset import Example, load_examples
from vqa_state.embedded.experiments import asked_with, cues_about, questions_about
from vqa_state.embedded.gains import summarise_gains
from vqa_state.embedded.lexicon import HELD_OUT_NOUNS
from vqa_state.embedded.measuring import TaskNumbers, ask, balanced, measure_task
from vqa_state.embedded.photos import load_photos
from vqa_state.embedded.predictor import MAX_IMAGES, Predictor
from vqa_state.embedded.render import render_split
from vqa_state.embedded.scenes import PAPER_THINGS, Split
from vqa_state.embedded.simulators import MEASURING_TASKS, load_tasks, render_tasks
from vqa_state.embedded.weights import (
    WEIGHTS,
    count_parameters,
    load_network,
    read_header,
    weights_digest,
)
from vqa_state.scores import count, score

__all__ = ["main"]

#: Asked about things that they do not fit: every "yes" or "no" is a mistake.
_FALSE_PREMISE = {"light": "handbag", "display": "water", "handbag": "display", "water": "light"}
_OTHERWISE = "water"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure on held-out scenes, foreign simulators and photos; write the numbers and the card."""
    chosen = _parser().parse_args(arguments)
    folder = chosen.out / Split.MEASURE.value
    render_split(folder, Split.MEASURE, chosen.scenes, 1, chosen.processes, PAPER_THINGS)
    foreign = chosen.out / "foreign"
    render_tasks(foreign, list(MEASURING_TASKS), chosen.scenes, 1, chosen.processes)
    torch.set_num_threads(chosen.threads)
    numbers = _measure(chosen)
    if chosen.json is not None:
        chosen.json.write_text(json.dumps(numbers, indent=1) + "\n", "utf-8")
    if chosen.card is not None:
        chosen.card.write_text(with_tables(chosen.card.read_text("utf-8"), numbers), "utf-8")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded.evaluate", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="for the scenes")
    parser.add_argument("--weights", type=Path, default=WEIGHTS)
    parser.add_argument("--scenes", type=int, default=120, help="of each task; 20 choose s+")
    parser.add_argument("--photos", type=Path, metavar="DIR", help="labelled photos, half are used")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where the numbers go")
    parser.add_argument(
        "--card", type=Path, metavar="FILE", help="the model card to bring up to date"
    )
    parser.add_argument("--processes", type=int, default=2, help="for rendering")
    parser.add_argument("--threads", type=int, default=2, help="for the network")
    return parser


def _tasks(chosen: argparse.Namespace) -> list[tuple[str, str, list[Example]]]:
    """(name, group, pictures) of every task."""
    scenes = _one_a_scene(load_examples(chosen.out / Split.MEASURE.value, chosen.scenes))
    tasks = [
        (thing, "scenes", [each for each in scenes if each.thing == thing])
        for thing in PAPER_THINGS
    ]
    for name in MEASURING_TASKS:
        pictures = _one_a_scene(load_tasks(chosen.out / "foreign", [name], chosen.scenes))
        tasks.append((name, "foreign", pictures))
    photos = load_photos(chosen.photos, training=False) if chosen.photos is not None else []
    shown = sorted({photo.thing for photo in photos})
    return tasks + [(thing, "photos", [p for p in photos if p.thing == thing]) for thing in shown]


def _measure(chosen: argparse.Namespace) -> dict[str, Any]:
    predictor = Predictor(chosen.weights)
    rows: list[TaskNumbers] = []
    held_out: list[dict[str, Any]] = []
    stated: dict[str, list[AnswerTable]] = {}
    for name, group, pictures in track(_tasks(chosen), description="measuring"):
        thing = pictures[0].thing
        grid = questions_about(thing)
        known = {question.text for question in grid}
        cues = tuple(cue for cue in cues_about(thing) if cue.text not in known)
        table = ask(predictor, pictures, (*grid, *cues))
        rows.append(measure_task(name, group, table, len(grid)))
        print(json.dumps({k: v for k, v in asdict(rows[-1]).items() if k[:4] != "gain"}))
        stated.setdefault(group, []).append(table)
        if group == "scenes":
            held_out.append(_other_words(predictor, thing, pictures[:60]))
    return {
        "file": _file_facts(chosen.weights, predictor, chosen.threads),
        "tasks": [_without_gains(row) for row in rows],
        "gains": summarise_gains(rows),
        "calibration": {group: _calibration(tables) for group, tables in stated.items()},
        "held_out_nouns": held_out,
    }


def _without_gains(row: TaskNumbers) -> dict[str, Any]:
    facts = asdict(row)
    return {name: value for name, value in facts.items() if not name.startswith("gain")}


def _other_words(predictor: Predictor, thing: str, pictures: list[Example]) -> dict[str, Any]:
    """Accuracy with nouns that training never used, and answers to questions that do not fit."""
    unknown = asked_with(thing, HELD_OUT_NOUNS[thing])
    of_unknown = count(ask(predictor, pictures, unknown))
    unfit = ask(predictor, pictures[:20], questions_about(_FALSE_PREMISE.get(thing, _OTHERWISE)))
    result = score(of_unknown, range(len(unknown)))
    return {
        "thing": thing,
        "nouns": list(HELD_OUT_NOUNS[thing]),
        "balanced": round(balanced(result.recognized, of_unknown.labels), 4),
        "refused": round(float((unfit.verdicts == 0).mean()), 4),
    }


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


def _file_facts(path: Path, predictor: Predictor, threads: int) -> dict[str, Any]:
    _time(predictor)  # the first run takes memory, which the next ones have
    return {
        "digest": weights_digest(path),
        "megabytes": round(path.stat().st_size / 1e6, 2),
        "training": read_header(path),
        "parameters": count_parameters(load_network(path)),
        "seconds_120x64": round(_time(predictor), 1),
        "threads": threads,
    }


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
