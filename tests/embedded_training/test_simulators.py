"""Other people's simulators: repeatable, both states, and what measures never trains."""

import numpy as np
import pytest

from vqa_state.embedded_training import simulators
from vqa_state.embedded_training.simulators import (
    SimulatorRenderer,
    load_tasks,
    render_tasks,
    simulator_tasks,
)
from vqa_state.errors import MissingPackageError

MEASURING_TASKS, TRAINING_TASKS = simulator_tasks(train=False), simulator_tasks(train=True)

#: The kitchen takes seconds to load, so it is looked at once; the others are quick.
QUICK = ["adroit_door", *TRAINING_TASKS]


@pytest.mark.parametrize("name", QUICK)
def test_same_seed_same_pictures_and_states_differ(name):
    with SimulatorRenderer(name) as renderer:
        open_one, closed_one = renderer.render(3)
        again = renderer.render(3)
    assert np.array_equal(np.asarray(open_one.image), np.asarray(again[0].image))
    assert (open_one.is_positive, closed_one.is_positive) == (True, False)
    assert closed_one.facts["degree"] == 0
    assert 0 < open_one.facts["degree"] <= 1
    difference = np.asarray(open_one.image, float) - np.asarray(closed_one.image, float)
    assert np.abs(difference).mean() > 1


def test_the_kitchen_has_three_things():
    kitchen = [task for task in MEASURING_TASKS.values() if "kitchen" in task.file]
    assert len({task.joint for task in kitchen}) == 3
    assert all(task.joint not in task.others for task in kitchen)


def test_no_package_both_trains_and_measures():
    measuring = {task.package for task in MEASURING_TASKS.values()}
    training = {task.package for task in TRAINING_TASKS.values()}
    assert measuring == {"gymnasium_robotics"}
    assert not measuring & training
    assert all(task.trains for task in TRAINING_TASKS.values())
    assert not any(task.trains for task in MEASURING_TASKS.values())


def test_pictures_are_written_once_and_read_back(tmp_path):
    render_tasks(tmp_path, ["metaworld_door"], 2, 1, 1)
    times = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")}
    render_tasks(tmp_path, ["metaworld_door"], 2, 1, 1)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")} == times
    examples = load_tasks(tmp_path, ["metaworld_door"], 2)
    assert [example.is_positive for example in examples] == [True, False] * 2
    assert {example.thing for example in examples} == {"door"}
    assert examples[0].scene == "simulator/metaworld_door/00000"


def test_a_missing_package_says_what_to_install(monkeypatch):
    monkeypatch.setattr(simulators.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(MissingPackageError, match="requirements-simulators"):
        SimulatorRenderer("adroit_door")
