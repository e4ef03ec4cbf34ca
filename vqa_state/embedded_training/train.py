"""`python -m vqa_state.embedded_training.train --out DIR`: render, train, write the weights.

Everything costly is kept in DIR: pictures, what the frozen blocks make of them, the weights after
each of the two stages. The same command goes on after the last scene, block of features or stage
that is finished; a stage that was stopped halfway begins anew. What is kept is known by the bytes
of its pictures and by the settings, so it is never used for others. The code is not among them:
after changing it, give another DIR.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import torch
from rich.progress import track
from torch import Tensor

from vqa_state.embedded_training.batches import BatchSampler
from vqa_state.embedded_training.cache import digest_tensors
from vqa_state.embedded_training.calibration import fit_temperature
from vqa_state.embedded_training.dataset import (
    Example,
    digest_examples,
    load_examples,
    render_split,
)
from vqa_state.embedded_training.features import embed_examples, n_chunks
from vqa_state.embedded_training.imagenet import load_imagenet
from vqa_state.embedded_training.photos import load_photos
from vqa_state.embedded_training.scenes import SceneSplit
from vqa_state.embedded_training.simulators import load_tasks, render_tasks, simulator_tasks
from vqa_state.embedded_training.training import (
    StepReport,
    logit_differences,
    train_reader,
    tune_trunk,
)
from vqa_state.embedded_training.training_log import TrainingLog
from vqa_state.models.embedded.network import VQANetwork
from vqa_state.models.embedded.weights import SECONDS, load_stage, read_header, save_network

__all__ = ["describe", "main"]

#: Photos are few, so each is seen in this many variations.
_PHOTO_VARIATIONS = 10

_N_QUESTIONS = 900

#: One scene in this many does not train; the probabilities are calibrated on it.
_HOLD_OUT = 12


def main(arguments: Sequence[str] | None = None) -> None:
    """Render what is missing, train in two stages, calibrate, write the weights."""
    chosen = _parser().parse_args(arguments)
    log = TrainingLog(chosen.out / "log.jsonl")
    folder = chosen.out / SceneSplit.TRAIN.value
    with log.timed("scenes"):
        render_split(folder, SceneSplit.TRAIN, chosen.scenes, chosen.views, chosen.processes)
        foreign = _render_simulators(chosen)
    torch.set_num_threads(chosen.threads)
    with torch.random.fork_rng():
        _train(chosen, load_examples(folder, chosen.scenes) + foreign, log)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded_training.train", description=__doc__
    )
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
    folder, names = chosen.out / "simulators", list(simulator_tasks(train=True))
    render_tasks(folder, names, chosen.simulator_scenes, chosen.views, chosen.processes)
    return load_tasks(folder, names, chosen.simulator_scenes)


def _train(chosen: argparse.Namespace, rendered: list[Example], log: TrainingLog) -> None:
    torch.manual_seed(chosen.seed)
    network = VQANetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    load_imagenet(network.trunk)
    with log.timed("features"):
        examples, maps = _materials(chosen, network, rendered)
    held_out = torch.tensor([_is_held_out(example) for example in examples])
    training = [example for example in examples if not _is_held_out(example)]
    batches = BatchSampler(training, _N_QUESTIONS, chosen.seed)
    about = describe(chosen, training, batches.questions, digest_tensors(network.trunk))
    log.write({**about})
    seconds = _learn(chosen, network, maps[~held_out], batches, about, log)
    if held_out.any():
        kept = BatchSampler(
            [each for each in examples if _is_held_out(each)], _N_QUESTIONS, chosen.seed
        )
        network.temperature.fill_(
            fit_temperature(*logit_differences(network, maps[held_out], kept))
        )
    times = {
        SECONDS: f"{seconds:.0f}",
        f"{SECONDS}_before": f"{log.seconds('scenes') + log.seconds('features'):.0f}",
    }
    save_network(network, chosen.out / "weights.safetensors", {**about, **times})


def _learn(
    chosen: argparse.Namespace,
    network: VQANetwork,
    maps: Tensor,
    batches: BatchSampler,
    about: dict[str, str],
    log: TrainingLog,
) -> float:
    """Both stages, or what earlier runs left of them; the seconds that they took."""
    seconds = 0.0
    stages = ((train_reader, chosen.epochs), (tune_trunk, chosen.tuning_epochs))
    for number, (stage, n_epochs) in enumerate(stages):
        saved = chosen.out / f"stage{number}.safetensors"
        if not load_stage(network, saved, about):
            torch.manual_seed(chosen.seed + number)
            batches.restart(number)
            start = time.perf_counter()
            if n_epochs > 0:
                with log.timed(f"stage {number}"):
                    _follow(stage(network, maps, batches, n_epochs), log)
            took = {SECONDS: f"{time.perf_counter() - start:.0f}"}
            save_network(network, saved, {**about, **took}, torch.float32)
        seconds += float(read_header(saved)[SECONDS])
    return seconds


def describe(
    chosen: argparse.Namespace, training: Sequence[Example], questions: str, trunk: str
) -> dict[str, str]:
    """What made the weights: written into their header, and what a stage must match to be used.

    Args:
        chosen: the command's settings.
        training: what it learns from; pictures are known by their bytes.
        questions: digest of the questions that may be drawn.
        trunk: digest of the image network before training.
    """
    sources = [example.scene.partition("/")[0] for example in training]
    n_photos, n_foreign = sources.count("photo"), sources.count("simulator")
    return {
        "seed": str(chosen.seed),
        "scenes": str(len(training) - n_photos - n_foreign),
        "simulators": str(n_foreign),
        "photos": str(n_photos),
        "epochs": f"{chosen.epochs} + {chosen.tuning_epochs}",
        "views": str(chosen.views),
        "examples": digest_examples(training),
        "questions": questions,
        "trunk": trunk,
    }


def _is_held_out(example: Example) -> bool:
    source, _, number = example.scene.rpartition("/")
    return source != "photo" and int(number) % _HOLD_OUT == _HOLD_OUT - 1


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


def _follow(reports: Iterable[StepReport], log: TrainingLog) -> None:
    """Draw the bar and write every twentieth step to the log."""
    for report in track(reports, description="training", total=None):
        if report.step % 20 == 0 or report.step == report.n_steps:
            log.write(asdict(report))


if __name__ == "__main__":
    main()
