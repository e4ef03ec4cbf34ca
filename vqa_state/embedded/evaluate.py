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

from vqa_state.embedded.card import with_tables
from vqa_state.embedded.dataset import Example, load_examples
from vqa_state.embedded.experiments import questions_about
from vqa_state.embedded.measuring import ask, measure_photos, measure_scenes
from vqa_state.embedded.photos import load_photos
from vqa_state.embedded.predictor import MAX_IMAGES, Predictor
from vqa_state.embedded.render import render_split
from vqa_state.embedded.scenes import THINGS, Split
from vqa_state.embedded.weights import (
    WEIGHTS,
    count_parameters,
    load_network,
    read_header,
    weights_digest,
)

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure on held-out scenes and photos; write the numbers and the card's tables."""
    chosen = _parser().parse_args(arguments)
    render_split(
        chosen.out / Split.MEASURE.value, Split.MEASURE, chosen.scenes, 1, chosen.processes
    )
    torch.set_num_threads(chosen.threads)
    numbers = _measure(chosen)
    if chosen.json is not None:
        chosen.json.write_text(json.dumps(numbers, indent=2) + "\n", "utf-8")
    if chosen.card is not None:
        chosen.card.write_text(with_tables(chosen.card.read_text("utf-8"), numbers), "utf-8")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded.evaluate", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="for the scenes")
    parser.add_argument("--weights", type=Path, default=WEIGHTS)
    parser.add_argument("--scenes", type=int, default=120, help="of each thing; 20 choose s+")
    parser.add_argument("--photos", type=Path, metavar="DIR", help="labelled photos, half are used")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where the numbers go")
    parser.add_argument(
        "--card", type=Path, metavar="FILE", help="the model card to bring up to date"
    )
    parser.add_argument("--processes", type=int, default=2, help="for rendering")
    parser.add_argument("--threads", type=int, default=2, help="for the network")
    return parser


def _measure(chosen: argparse.Namespace) -> dict[str, Any]:
    predictor = Predictor(chosen.weights)
    pictures = _one_a_scene(load_examples(chosen.out / Split.MEASURE.value, chosen.scenes))
    photos = load_photos(chosen.photos, training=False) if chosen.photos is not None else []
    scene_rows, photo_rows = [], []
    for thing in track(THINGS, description="measuring"):
        table = ask(predictor, [example for example in pictures if example.thing == thing])
        numbers, s_plus = measure_scenes(thing, table)
        scene_rows.append(asdict(numbers))
        print(json.dumps(scene_rows[-1]), flush=True)
        own_photos = [example for example in photos if example.thing == thing]
        if own_photos:
            result = measure_photos(thing, ask(predictor, own_photos), s_plus)
            photo_rows.append(asdict(result))
            print(json.dumps(photo_rows[-1]), flush=True)
    return {
        "file": _file_facts(chosen.weights, predictor, chosen.threads),
        "scenes": scene_rows,
        "photos": photo_rows,
    }


def _one_a_scene(examples: Sequence[Example]) -> list[Example]:
    """One picture of each scene, the states in turn, so that no two pictures share anything."""
    return [
        example
        for example in examples
        if example.is_positive == (int(example.scene.rpartition("/")[2]) % 2 == 0)
    ]


def _file_facts(path: Path, predictor: Predictor, threads: int) -> dict[str, Any]:
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
    slots = predictor.read(questions)
    for first in range(0, len(images), MAX_IMAGES):
        predictor.answer(images[first : first + MAX_IMAGES], slots)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
