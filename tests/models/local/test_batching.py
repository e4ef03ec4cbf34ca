"""The batch grows while it pays, and a processor never has one."""

import pytest

from vqa_state.models.address import Device, Precision
from vqa_state.models.local.batching import BatchSize
from vqa_state.models.local.runtime import Runtime

GPU = Runtime(Device.CUDA, Precision.BFLOAT16)


def settled(seconds_for, runtime=GPU):
    """The size after many calls that take `seconds_for(size)`."""
    batch = BatchSize(runtime)
    for _ in range(20):
        batch.record(batch.size, seconds_for(batch.size))
    return batch.size


@pytest.mark.parametrize(
    ("seconds_for", "size"),
    [
        (lambda n: 1.0, 16),  # as fast for many as for one
        (lambda n: float(n), 1),  # no gain
        (lambda n: max(1.0, n / 4), 4),  # full at four
    ],
)
def test_it_stays_at_the_size_that_makes_an_image_cheapest(seconds_for, size):
    assert settled(seconds_for) == size


def test_a_processor_takes_one_image_at_a_time():
    assert settled(lambda n: 1.0, Runtime(Device.CPU, Precision.FLOAT32)) == 1


def test_the_first_call_and_small_calls_are_not_counted():
    batch = BatchSize(GPU)
    batch.record(1, 60.0)
    assert batch.size == 1
    batch.record(1, 1.0)
    assert batch.size == 2
    batch.record(1, 1.0)
    assert batch.size == 2


def test_without_memory_it_goes_back_for_good():
    batch = BatchSize(GPU)
    for _ in range(4):
        batch.record(batch.size, 1.0)
    assert batch.size == 8
    batch.too_large()
    batch.record(4, 0.1)
    assert batch.size == 4
