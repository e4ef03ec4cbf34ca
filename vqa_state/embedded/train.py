"""`python -m vqa_state.embedded.train --out DIR`: render, train, write weights.safetensors.

Everything costly is kept in DIR: pictures, what the frozen blocks make of them, the weights after
each stage. The same command goes on where a stopped one was.
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import torch
from rich.progress import track
from torch import Tensor

from vqa_state.embedded.calibration import fit_temperature
from vqa_state.embedded.dataset import Example, load_examples
from vqa_state.embedded.features import embed_examples, n_chunks
from vqa_state.embedded.imagenet import load_imagenet
from vqa_state.embedded.lessons import Lessons
from vqa_state.embedded.network import VQANetwork
from vqa_state.embedded.photos import load_photos
from vqa_state.embedded.render import render_split
from vqa_state.embedded.scenes import Split
from vqa_state.embedded.simulators import TRAINING_TASKS, load_tasks, render_tasks
from vqa_state.embedded.training import StepReport, grade, train_reader, tune_trunk
from vqa_state.embedded.weights import load_stage, save_network

__all__ = ["main"]

#: Photos are few, so each is seen in this many variations.
_PHOTO_VARIATIONS = 10

_N_DRILLS = 900

#: One scene in this many does not train; the probabilities are calibrated on it.
_KEPT_BACK = 12


def main(arguments: Sequence[str] | None = None) -> None:
    """Render what is missing, train in two stages, calibrate, write the weights."""
    chosen = _parser().parse_args(arguments)
    folder = chosen.out / Split.TRAIN.value
    render_split(folder, Split.TRAIN, chosen.scenes, chosen.views, chosen.processes)
    foreign = _render_simulators(chosen)
    torch.set_num_threads(chosen.threads)
    with torch.random.fork_rng():
        _train(chosen, load_examples(folder, chosen.scenes) + foreign)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m vqa_state.embedded.train", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=170, help="scenes of each thing")
    parser.add_argument("--simulator-scenes", type=int, default=130, help="of each foreign task")
    parser.add_argument("--views", type=int, default=3, help="cameras for each scene")
    parser.add_argument("--photos", type=Path, metavar="DIR", help="labelled photos, half are used")
    parser.add_argument("--epochs", type=float, default=4.0, help="of the reader alone")
    parser.add_argument("--tuning-epochs", type=float, default=1.0, help="of the last trunk blocks")
    parser.add_argument("--processes", type=int, default=2, help="for rendering")
    parser.add_argument("--threads", type=int, default=2, help="for training")
    return parser


def _render_simulators(chosen: argparse.Namespace) -> list[Example]:
    if chosen.simulator_scenes == 0:
        return []
    folder, names = chosen.out / "simulators", list(TRAINING_TASKS)
    render_tasks(folder, names, chosen.simulator_scenes, chosen.views, chosen.processes)
    return load_tasks(folder, names, chosen.simulator_scenes)


def _train(chosen: argparse.Namespace, rendered: list[Example]) -> None:
    torch.manual_seed(chosen.seed)
    network = VQANetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    load_imagenet(network.trunk)
    examples, maps = _materials(chosen, network, rendered)
    kept_back = torch.tensor([_is_kept_back(example) for example in examples])
    training = [example for example in examples if not _is_kept_back(example)]
    lessons = Lessons(training, _N_DRILLS, chosen.seed)
    about = _about(chosen, training)
    log = chosen.out / "log.jsonl"
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps(about) + "\n")
    stages = ((train_reader, chosen.epochs), (tune_trunk, chosen.tuning_epochs))
    for number, (stage, n_epochs) in enumerate(stages):
        saved = chosen.out / f"stage{number}.safetensors"
        if load_stage(network, saved, about):
            continue
        torch.manual_seed(chosen.seed + number)
        lessons.restart(number)
        if n_epochs > 0:
            _follow(stage(network, maps[~kept_back], lessons, n_epochs), log)
        save_network(network, saved, about, torch.float32)
    if kept_back.any():
        kept = Lessons([each for each in examples if _is_kept_back(each)], _N_DRILLS, chosen.seed)
        network.temperature.fill_(fit_temperature(*grade(network, maps[kept_back], kept)))
    save_network(network, chosen.out / "weights.safetensors", about)


def _about(chosen: argparse.Namespace, training: Sequence[Example]) -> dict[str, str]:
    """What made the weights: written into their header, and what a stage must match to be used."""
    sources = [example.scene.partition("/")[0] for example in training]
    n_photos, n_foreign = sources.count("photo"), sources.count("simulator")
    return {
        "seed": str(chosen.seed),
        "scenes": str(len(training) - n_photos - n_foreign),
        "simulators": str(n_foreign),
        "photos": str(n_photos),
        "epochs": f"{chosen.epochs} + {chosen.tuning_epochs}",
    }


def _is_kept_back(example: Example) -> bool:
    source, _, number = example.scene.rpartition("/")
    return source != "photo" and int(number) % _KEPT_BACK == _KEPT_BACK - 1


def _materials(
    chosen: argparse.Namespace, network: VQANetwork, rendered: list[Example]
) -> tuple[list[Example], Tensor]:
    """All examples and what the frozen blocks make of them, photos in several variations."""
    sets = [(rendered, chosen.seed)]
    if chosen.photos is not None:
        photos = load_photos(chosen.photos, training=True)
        sets += [(photos, chosen.seed + 1 + number) for number in range(_PHOTO_VARIATIONS)]
    examples: list[Example] = []
    maps: list[Tensor] = []
    for part, seed in sets:
        examples += part
        chunks = embed_examples(network.trunk, part, chosen.out / "features", seed)
        maps += track(chunks, description="features", total=n_chunks(part))
    return examples, torch.cat(maps)


def _follow(reports: Iterable[StepReport], log: Path) -> None:
    """Draw the bar and write every twentieth step to the log."""
    with log.open("a", encoding="utf-8") as file:
        for report in track(reports, description="training", total=None):
            if report.step % 20 == 0 or report.step == report.n_steps:
                file.write(json.dumps(asdict(report)) + "\n")
                file.flush()


if __name__ == "__main__":
    main()
