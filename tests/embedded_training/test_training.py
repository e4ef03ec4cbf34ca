"""Training learns, repeats itself, and goes on from a stage that is on disk."""

from pathlib import Path

import numpy as np
import pytest
import torch

from vqa_state.embedded_training.batches import BatchSampler
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.training import logit_differences, train_reader, tune_trunk
from vqa_state.models.embedded.network import VQANetwork
from vqa_state.models.embedded.weights import load_stage, save_network

N = 24


@pytest.fixture(scope="module")
def examples():
    return [
        Example(Path(f"{n}.jpg"), "door", n % 2 == 0, {"degree": float(n % 2 == 0)}, f"door/{n}")
        for n in range(N)
    ]


@pytest.fixture(scope="module")
def maps():
    """What the frozen blocks might give; one channel tells the states apart."""
    drawn = torch.rand(N, 80, 14, 14, generator=torch.Generator().manual_seed(0))
    drawn[::2, 0] += 6
    return drawn.half()


def trained(examples, maps, stage, n_epochs):
    torch.manual_seed(0)
    network, batches = VQANetwork(), BatchSampler(examples, 60, seed=0)
    batches.restart(0)
    reports = list(stage(network, maps, batches, n_epochs, 12))
    return network, reports


@pytest.fixture
def threads():
    """Sets how many threads torch uses, for one test."""
    before = torch.get_num_threads()
    yield torch.set_num_threads
    torch.set_num_threads(before)


@pytest.mark.parametrize("n_threads", [1, 2])
@pytest.mark.parametrize("stage", [train_reader, tune_trunk])
def test_the_same_seed_takes_the_same_steps_to_the_last_digit(
    examples, maps, stage, n_threads, threads
):
    threads(n_threads)
    first, again = (trained(examples, maps, stage, 1.0) for _ in range(2))
    assert first[1] == again[1]
    assert [report.step for report in first[1]] == [1, 2]
    assert {report.n_steps for report in first[1]} == {2}
    weights = again[0].state_dict()
    assert all(torch.equal(value, weights[name]) for name, value in first[0].state_dict().items())


def test_the_reader_leaves_the_trunk_alone_and_tuning_its_first_blocks(examples, maps):
    torch.manual_seed(0)
    fresh = {name: value.clone() for name, value in VQANetwork().state_dict().items()}
    reader = trained(examples, maps, train_reader, 1.0)[0].state_dict()
    tuned = trained(examples, maps, tune_trunk, 1.0)[0].state_dict()
    assert all(torch.equal(reader[name], fresh[name]) for name in fresh if "trunk" in name)
    assert torch.equal(
        tuned["trunk.blocks.7.project.weight"], fresh["trunk.blocks.7.project.weight"]
    )
    assert not torch.equal(
        tuned["trunk.blocks.8.project.weight"], fresh["trunk.blocks.8.project.weight"]
    )


def test_batches_follow_the_label(examples):
    batch = BatchSampler(examples, 60, seed=0).draw(16, 12)
    assert batch.asked.shape == batch.targets.shape == (16, 12)
    assert set(batch.states.tolist()) <= {0.0, 1.0}
    assert all(
        batch.states[row] == float(examples[index].is_positive)
        for row, index in enumerate(batch.rows)
    )


def test_grading_asks_for_yes_and_no_only(examples, maps):
    network = trained(examples, maps, train_reader, 0.5)[0]
    differences, truths = logit_differences(
        network, maps, BatchSampler(examples, 60, seed=1), n_batches=2
    )
    assert differences.shape == truths.shape
    assert np.isfinite(differences).all()
    assert 0 < truths.mean() < 1


def test_a_stage_is_used_only_for_what_made_it(tmp_path):
    file, made_by = tmp_path / "stage.safetensors", {"seed": "0"}
    torch.manual_seed(1)
    saved = VQANetwork()
    save_network(saved, file, made_by, torch.float32)
    other = VQANetwork()
    assert not load_stage(other, tmp_path / "none.safetensors", made_by)
    assert not load_stage(other, file, {"seed": "1"})
    assert load_stage(other, file, made_by)
    assert all(
        torch.equal(value, other.state_dict()[name]) for name, value in saved.state_dict().items()
    )
