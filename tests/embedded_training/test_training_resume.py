"""What training kept in its folder is used for the same pictures and settings, and no others."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from vqa_state.embedded_training import train
from vqa_state.embedded_training.batches import BatchSampler
from vqa_state.embedded_training.cache import digest, digest_tensors
from vqa_state.embedded_training.dataset import Example, digest_examples, render_split
from vqa_state.embedded_training.features import embed_examples
from vqa_state.embedded_training.scenes import SceneSplit
from vqa_state.embedded_training.simulators import render_tasks
from vqa_state.embedded_training.training_log import TrainingLog
from vqa_state.errors import ProjectError
from vqa_state.models.embedded.network import VQANetwork
from vqa_state.models.embedded.trunk import Trunk
from vqa_state.models.embedded.weights import load_stage, read_header, save_network


def write_picture(path: Path, seed: int) -> Example:
    pixels = np.random.default_rng(seed).integers(0, 256, (32, 32, 3), np.uint8)
    Image.fromarray(pixels).save(path)
    return Example(path, "door", seed % 2 == 0, {"degree": float(seed % 2 == 0)}, f"door/{seed}")


@pytest.fixture
def pictures(tmp_path):
    return [write_picture(tmp_path / f"{seed}.png", seed) for seed in range(2)]


@pytest.fixture(scope="module")
def trunk():
    torch.manual_seed(0)
    return Trunk().eval()


def maps_of(trunk, pictures, folder, seed=0):
    return torch.cat(list(embed_examples(trunk, pictures, folder, seed)))


def test_features_are_kept_for_the_same_pictures(trunk, pictures, tmp_path):
    folder = tmp_path / "features"
    first = maps_of(trunk, pictures, folder)
    assert len(list(folder.iterdir())) == 1
    assert torch.equal(maps_of(trunk, pictures, folder), first)
    assert len(list(folder.iterdir())) == 1


def test_another_picture_under_the_same_name_is_read_anew(trunk, pictures, tmp_path):
    kept = maps_of(trunk, pictures, tmp_path / "features")
    write_picture(pictures[0].path, 7)
    again = maps_of(trunk, pictures, tmp_path / "features")
    assert torch.equal(again, maps_of(trunk, pictures, tmp_path / "fresh"))
    assert not torch.equal(again[0], kept[0])
    assert torch.equal(again[1], kept[1])


@pytest.mark.parametrize("what", ["seed", "trunk", "order"])
def test_features_are_made_anew_for_another(what, trunk, pictures, tmp_path):
    folder = tmp_path / "features"
    maps_of(trunk, pictures, folder)
    torch.manual_seed(1)
    other = Trunk().eval() if what == "trunk" else trunk
    pictures = pictures[::-1] if what == "order" else pictures
    seed = 1 if what == "seed" else 0
    kept = maps_of(other, pictures, folder, seed)
    assert torch.equal(kept, maps_of(other, pictures, tmp_path / "fresh", seed))


@pytest.mark.parametrize(
    "change",
    [
        {"thing": "cabinet"},
        {"is_positive": False},
        {"facts": {"degree": 0.5}},
        {"scene": "door/9"},
    ],
)
def test_what_is_said_about_a_picture_is_part_of_what_was_learned(change, pictures):
    changed = [replace(pictures[0], **change), pictures[1]]
    assert digest_examples(changed) != digest_examples(pictures)
    assert digest_examples(pictures) == digest_examples(list(pictures))


def test_a_copy_elsewhere_is_the_same_picture(pictures, tmp_path):
    other = tmp_path / "elsewhere.png"
    other.write_bytes(pictures[0].path.read_bytes())
    moved = [replace(pictures[0], path=other), pictures[1]]
    assert digest_examples(moved) == digest_examples(pictures)


def test_parts_do_not_run_together():
    assert digest("ab", "c") != digest("a", "bc")
    assert digest(["a"], "b") != digest(["a", "b"])


def about(pictures, batches=None, trunk="t", **settings):
    chosen = {"seed": 0, "views": 3, "epochs": 1.0, "tuning_epochs": 1.0, **settings}
    questions = (batches or BatchSampler(pictures, 20, 0)).questions
    return train.describe(argparse.Namespace(**chosen), pictures, questions, trunk)


@pytest.mark.parametrize(
    "settings", [{"seed": 1}, {"views": 2}, {"epochs": 2.0}, {"tuning_epochs": 0.5}, {"trunk": "u"}]
)
def test_other_settings_are_another_training(settings, pictures):
    assert about(pictures, **settings) != about(pictures)


def test_another_photo_in_the_place_of_one_is_another_training(pictures):
    before = about(pictures)
    write_picture(pictures[0].path, 7)
    assert about(pictures) != before


def test_other_questions_are_another_training(pictures):
    fewer, same = BatchSampler(pictures, 10, 0), BatchSampler(pictures, 20, 0)
    assert about(pictures, fewer) != about(pictures, same) == about(pictures)


def test_a_stage_does_not_ask_how_long_it_took(tmp_path):
    file = tmp_path / "stage.safetensors"
    save_network(VQANetwork(), file, {"seed": "0", "seconds": "12"})
    assert load_stage(VQANetwork(), file, {"seed": "0"})
    assert not load_stage(VQANetwork(), file, {"seed": "1", "seconds": "12"})


def test_other_views_in_an_old_folder_are_refused(tmp_path):
    record = tmp_path / "door" / "00000.json"
    record.parent.mkdir()
    record.write_text(json.dumps([{}] * 6), "utf-8")
    render_split(tmp_path, SceneSplit.TRAIN, 1, 3, 1, ["door"])
    assert [path.name for path in record.parent.iterdir()] == [record.name]
    with pytest.raises(ProjectError, match="rendered with 3 views, not with 2; give --views 3"):
        render_split(tmp_path, SceneSplit.TRAIN, 1, 2, 1, ["door"])


def test_other_views_of_a_simulator_are_refused(tmp_path):
    folder = tmp_path / "metaworld_door"
    folder.mkdir()
    (folder / "00000.json").write_text(json.dumps([{}] * 6), "utf-8")
    with pytest.raises(ProjectError, match="rendered with 3 views, not with 1"):
        render_tasks(tmp_path, ["metaworld_door"], 1, 1, 1)


def test_parts_are_timed_over_all_runs_also_if_they_are_stopped(tmp_path):
    log = TrainingLog(tmp_path / "deep" / "log.jsonl")
    assert log.seconds("scenes") == 0
    with log.timed("scenes"):
        pass
    with pytest.raises(KeyboardInterrupt), log.timed("scenes"):
        raise KeyboardInterrupt
    log.write({"part": "scenes", "seconds": 5.0})
    log.write({"part": "features", "seconds": 100.0})
    log.write({"step": 20})
    assert len(log.path.read_text("utf-8").splitlines()) == 5
    assert 5 <= log.seconds("scenes") < 6


@pytest.fixture
def quick(monkeypatch, tmp_path, pictures):
    """The command with two pictures, nothing rendered and stages that only count."""
    ran = []

    def stage(name):
        def run(*_):
            ran.append(name)
            return iter(())

        return run

    monkeypatch.setattr(train, "render_split", lambda *_: None)
    monkeypatch.setattr(train, "load_examples", lambda *_: list(pictures))
    monkeypatch.setattr(train, "load_imagenet", lambda _: None)
    monkeypatch.setattr(train, "train_reader", stage("reader"))
    monkeypatch.setattr(train, "tune_trunk", stage("trunk"))
    folder = tmp_path / "run"

    def run(*more):
        ran.clear()
        threads = torch.get_num_threads()
        options = ["--simulator-scenes", "0", "--threads", str(threads), *more]
        train.main(["--out", str(folder), *options])
        return list(ran), read_header(folder / "weights.safetensors")

    return run


def test_the_command_goes_on_at_the_last_finished_stage_and_says_its_time(
    quick, pictures, tmp_path
):
    stages, header = quick()
    assert stages == ["reader", "trunk"]
    assert float(header["seconds"]) >= 0
    assert float(header["seconds_before"]) >= 0
    assert quick()[0] == []
    (tmp_path / "run" / "stage1.safetensors").unlink()
    assert quick()[0] == ["trunk"]
    assert quick("--seed", "1")[0] == ["reader", "trunk"]
    write_picture(pictures[0].path, 7)
    assert quick("--seed", "1")[0] == ["reader", "trunk"]
    assert digest_tensors(VQANetwork()) != digest_tensors(VQANetwork())
