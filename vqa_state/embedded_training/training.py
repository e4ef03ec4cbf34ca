"""The two stages of training: first all but the trunk, then its last blocks too."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from vqa_state.embedded_training.batches import UNKNOWN, BatchSampler, TrainingBatch
from vqa_state.embedded_training.features import N_FROZEN_BLOCKS
from vqa_state.embedded_training.scenes import THINGS
from vqa_state.models.embedded.network import N_VIEWS, ImageMemory, VQANetwork
from vqa_state.models.embedded.vocabulary import NO, YES

__all__ = ["StepReport", "logit_differences", "train_reader", "tune_trunk"]

#: Questions about each picture of a batch, as many for every view.
_N_QUESTIONS = 2 * N_VIEWS
_LABEL_SMOOTHING = 0.05
_LARGEST_GRADIENT = 1.0
_AUXILIARY_WEIGHT = 0.3


@dataclass(frozen=True, slots=True)
class StepReport:
    """One step: its number from 1, how many there are, and loss and accuracy in its batch."""

    stage: str
    step: int
    n_steps: int
    loss: float
    accuracy: float


def train_reader(
    network: VQANetwork, maps: Tensor, batches: BatchSampler, n_epochs: float, batch_size: int = 64
) -> Iterator[StepReport]:
    """Train everything but the trunk, whose tokens are computed once.

    `maps` is (n_examples, 80, 14, 14): the output of the trunk's frozen blocks.
    """
    tokens = _all_tokens(network, maps)
    for parameter in network.trunk.parameters():
        parameter.requires_grad_(False)
    trainer = _StageTrainer(
        network,
        "reader",
        [{"params": [p for p in network.parameters() if p.requires_grad], "lr": 1e-3}],
        math.ceil(n_epochs * len(maps) / batch_size),
    )
    for _ in range(trainer.n_steps):
        batch = batches.draw(batch_size, _N_QUESTIONS)
        yield trainer.step(batch, network.encode_tokens(tokens[batch.rows].float()))


def tune_trunk(
    network: VQANetwork, maps: Tensor, batches: BatchSampler, n_epochs: float, batch_size: int = 32
) -> Iterator[StepReport]:
    """Train everything behind the frozen blocks, at a small learning rate."""
    late = list(network.trunk.blocks[N_FROZEN_BLOCKS:].parameters())
    for parameter in late:
        parameter.requires_grad_(True)
    reader = [
        parameter for name, parameter in network.named_parameters() if not name.startswith("trunk.")
    ]
    groups = [{"params": late, "lr": 1.5e-4}, {"params": reader, "lr": 3e-4}]
    n_steps = math.ceil(n_epochs * len(maps) / batch_size)
    trainer = _StageTrainer(network, "trunk", groups, n_steps)
    for step in range(n_steps):
        batch = batches.draw(batch_size, _N_QUESTIONS)
        part = maps[batch.rows].float()
        # Mirrored maps are a cheap second version of every picture.
        part = part.flip(-1) if step % 2 else part
        part = part.contiguous(memory_format=torch.channels_last)
        tokens = network.trunk.finish(part, N_FROZEN_BLOCKS)
        yield trainer.step(batch, network.encode_tokens(tokens))


@torch.inference_mode()
def logit_differences(
    network: VQANetwork, maps: Tensor, batches: BatchSampler, n_batches: int = 40
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Logit differences (yes minus no) to questions whose answer is yes or no, and which it is."""
    network.eval()
    differences, truths = [], []
    for _ in range(n_batches):
        batch = batches.draw(32, _N_QUESTIONS)
        part = maps[batch.rows].float().contiguous(memory_format=torch.channels_last)
        memory = network.encode_tokens(network.trunk.finish(part, N_FROZEN_BLOCKS))
        slots = network.read(batch.buckets)[batch.asked].unflatten(1, (N_VIEWS, -1))
        logits = network.answer(memory, slots).flatten(0, 2)
        targets = batch.targets.flatten()
        asked = (targets == YES) | (targets == NO)
        differences.append((logits[:, YES] - logits[:, NO])[asked])
        truths.append((targets == YES)[asked])
    return torch.cat(differences).double().numpy(), torch.cat(truths).numpy()


class _StageTrainer:
    """Optimiser, schedule and loss of one stage."""

    def __init__(
        self, network: VQANetwork, stage: str, groups: list[dict[str, object]], n_steps: int
    ) -> None:
        self.network = network.train()
        self._auxiliary = _AuxiliaryHeads(network)
        groups = [*groups, {"params": list(self._auxiliary.parameters()), "lr": 1e-3}]
        self.stage = stage
        self.n_steps = n_steps
        self._step = 0
        self._optimizer = torch.optim.AdamW(groups, weight_decay=0.05)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(
            self._optimizer,
            [group["lr"] for group in self._optimizer.param_groups],
            total_steps=n_steps,
            pct_start=0.15,
        )

    def step(self, batch: TrainingBatch, memory: ImageMemory) -> StepReport:
        """Learn from one batch whose images have been seen."""
        read = self.network.read(batch.buckets)
        asked = read.index_select(0, batch.asked.flatten())  # its gradient is added in one order
        slots = asked.unflatten(0, tuple(batch.asked.shape)).unflatten(1, (N_VIEWS, -1))
        logits = self.network.answer(memory, slots).flatten(0, 2)
        targets = batch.targets.flatten()
        loss = functional.cross_entropy(
            logits, targets, ignore_index=UNKNOWN, label_smoothing=_LABEL_SMOOTHING
        )
        auxiliary = _AUXILIARY_WEIGHT * self._auxiliary(batch, memory, read)
        self._optimizer.zero_grad(set_to_none=True)
        (loss + auxiliary).backward()
        trained = [p for group in self._optimizer.param_groups for p in group["params"]]
        nn.utils.clip_grad_norm_(trained, _LARGEST_GRADIENT)
        self._optimizer.step()
        self._schedule.step()
        self._step += 1
        known = targets != UNKNOWN
        right = (logits.argmax(dim=-1) == targets)[known].float().mean()
        return StepReport(self.stage, self._step, self.n_steps, loss.item(), right.item())


class _AuxiliaryHeads(nn.Module):
    """Two auxiliary classifiers that exist only while training.

    Whether "yes" is right depends on the picture *and* on the question, an exclusive or that takes
    long to learn from the answers alone. So one head predicts the state from the picture's values,
    the other what "yes" would mean from the question's slots.
    """

    def __init__(self, network: VQANetwork) -> None:
        super().__init__()
        n_slots, width = network.read.slots.shape
        self.state = nn.Linear(2 * width, len(THINGS))
        self.meaning = nn.Linear(n_slots * width, 3)

    def forward(self, batch: TrainingBatch, memory: ImageMemory, read: Tensor) -> Tensor:
        """The sum of both heads' losses."""
        values = memory.keys_values[0][1]  # (n_images x n_views, n_heads, 49, head_width)
        pooled = torch.cat([values.mean(dim=2), values.amax(dim=2)], dim=-1).flatten(1)
        things = batch.things.repeat_interleave(N_VIEWS)
        states = self.state(pooled).gather(1, things[:, None])[:, 0]
        seen = functional.binary_cross_entropy_with_logits(
            states, batch.states.repeat_interleave(N_VIEWS)
        )
        meant = functional.cross_entropy(
            self.meaning(read.flatten(1)), batch.meanings, ignore_index=UNKNOWN
        )
        return seen + meant


@torch.inference_mode()
def _all_tokens(network: VQANetwork, maps: Tensor) -> Tensor:
    """Tokens (n_examples, 49, 768) in float16 of all maps."""
    network.eval()
    parts = []
    for part in torch.split(maps, 64):
        ready = part.float().contiguous(memory_format=torch.channels_last)
        parts.append(network.trunk.finish(ready, N_FROZEN_BLOCKS).half())
    return torch.cat(parts)
