"""`python -m vqa_state.embedded.train --out DIR`: render, train, write weights.safetensors."""

import argparse
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import torch
from rich.progress import track
from torch import Tensor

from vqa_state.embedded.dataset import Example, load_examples
from vqa_state.embedded.features import embed_examples, n_chunks
from vqa_state.embedded.imagenet import load_imagenet
from vqa_state.embedded.lessons import Lessons
from vqa_state.embedded.network import VQANetwork
from vqa_state.embedded.photos import load_photos
from vqa_state.embedded.render import render_split
from vqa_state.embedded.scenes import Split
from vqa_state.embedded.training import StepReport, train_reader, tune_trunk
from vqa_state.embedded.weights import save_network

__all__ = ["main"]

#: Photos are few, so each is seen in this many variations.
_PHOTO_VARIATIONS = 6

_N_DRILLS = 700


def main(arguments: Sequence[str] | None = None) -> None:
    """Render what is missing, train in two stages, write the weights after each."""
    chosen = _parser().parse_args(arguments)
    folder = chosen.out / Split.TRAIN.value
    render_split(folder, Split.TRAIN, chosen.scenes, chosen.views, chosen.processes)
    torch.set_num_threads(chosen.threads)
    with torch.random.fork_rng():
        torch.manual_seed(chosen.seed)
        _train(chosen, load_examples(folder, chosen.scenes))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m vqa_state.embedded.train", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=184, help="scenes of each thing")
    parser.add_argument("--views", type=int, default=3, help="cameras for each scene")
    parser.add_argument("--photos", type=Path, metavar="DIR", help="labelled photos, half are used")
    parser.add_argument("--epochs", type=float, default=4.5, help="of the reader alone")
    parser.add_argument("--tuning-epochs", type=float, default=0.7, help="of the last trunk blocks")
    parser.add_argument("--processes", type=int, default=2, help="for rendering")
    parser.add_argument("--threads", type=int, default=2, help="for training")
    return parser


def _train(chosen: argparse.Namespace, scenes: list[Example]) -> None:
    network = VQANetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    load_imagenet(network.trunk)
    examples, maps = _materials(chosen, network, scenes)
    lessons = Lessons(examples, _N_DRILLS, chosen.seed)
    about = {
        "seed": str(chosen.seed),
        "scenes": str(len(scenes)),
        "photos": str(len(examples) - len(scenes)),
        "epochs": f"{chosen.epochs} + {chosen.tuning_epochs}",
    }
    log = chosen.out / "log.jsonl"
    log.write_text(json.dumps(about) + "\n", "utf-8")
    for stage, n_epochs in ((train_reader, chosen.epochs), (tune_trunk, chosen.tuning_epochs)):
        if n_epochs > 0:
            _follow(stage(network, maps, lessons, n_epochs), log)
            save_network(network, chosen.out / "weights.safetensors", about)


def _materials(
    chosen: argparse.Namespace, network: VQANetwork, scenes: list[Example]
) -> tuple[list[Example], Tensor]:
    """All examples and what the frozen blocks make of them, photos in several variations."""
    sets = [(scenes, chosen.seed)]
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
