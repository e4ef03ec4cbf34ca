"""Things in other people's simulators, in known states: some may train, the rest only measure.

metaworld's door, drawer, window and laptop may train the network. The four of gymnasium-robotics
only ever measure it; nothing of that package trains. (robosuite's door is left out: it is drawn
from the same original as the Adroit door of gymnasium-robotics.) Only the packages' scene files are
read, none of their code runs. `simulators.toml` says where each thing is.
"""

import importlib.util
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import TypeAdapter

from vqa_state.embedded_training.dataset import Example, read_scene, render_missing
from vqa_state.embedded_training.scenes.photography import photograph
from vqa_state.embedded_training.scenes.random_draws import generator_of
from vqa_state.embedded_training.scenes.rendering import (
    RenderedPicture,
    draw,
    drawing,
    import_mujoco,
)
from vqa_state.embedded_training.scenes.simulation import CameraRange, Range
from vqa_state.errors import MissingPackageError

__all__ = ["SimulatorRenderer", "SimulatorTask", "load_tasks", "render_tasks", "simulator_tasks"]

_SIZE = 256

#: What `_vary` changes and sets back.
_VARIED = ("mat_rgba", "geom_rgba", "geom_matid", "light_diffuse", "light_pos")


@dataclass(frozen=True, slots=True)
class SimulatorTask:
    """One thing in one simulator.

    Attributes:
        package: the package that holds the scene; `file` is its path there.
        thing: in whose words it is asked about.
        joint: the joint that opens it; a body's name where the joint has none.
        closed, opened: where the joint may stand in each state (radians or metres).
        camera: where the camera may stand.
        others: joints that move freely and mean nothing.
    """

    package: str
    file: str
    thing: str
    joint: str
    closed: Range
    opened: Range
    camera: CameraRange
    others: tuple[str, ...] = ()

    @property
    def trains(self) -> bool:
        """Whether its pictures may train the network, or only measure it."""
        return self.package == "metaworld"


@dataclass(frozen=True, slots=True)
class _Simulators:
    """The tasks, and parts of bodies' names that belong to a robot, and those that never do."""

    robot_parts: tuple[str, ...]
    thing_parts: tuple[str, ...]
    tasks: Mapping[str, SimulatorTask]


@cache
def _simulators() -> _Simulators:
    text = files(__package__).joinpath("simulators.toml").read_text("utf-8")
    return TypeAdapter(_Simulators).validate_python(tomllib.loads(text))


def simulator_tasks(*, train: bool) -> dict[str, SimulatorTask]:
    """The tasks that may train the network, or those that only measure it, by their names."""
    return {name: task for name, task in _simulators().tasks.items() if task.trains == train}


class SimulatorRenderer:
    """Renders one task in a drawing context of its own; keep only one alive in a process.

    Raises:
        MissingPackageError: if mujoco or the task's package is not installed.
    """

    def __init__(self, name: str) -> None:
        self._name, self._task = name, _simulators().tasks[name]
        self._mujoco = import_mujoco()
        self.model = self._mujoco.MjModel.from_xml_path(str(_scene_file(self._task)))
        self.model.vis.global_.offwidth = self.model.vis.global_.offheight = _SIZE
        self._data = self._mujoco.MjData(self.model)
        self._options = self._mujoco.MjvOption()
        self._options.geomgroup[:] = (1, 1, 1, 0, 0, 0)
        self._options.sitegroup[:] = 0
        self._robot = _robot_geoms(self.model)
        self._original = {name: getattr(self.model, name).copy() for name in _VARIED}
        self._open = ExitStack()
        self._resources: Any = None

    def __enter__(self) -> Self:
        context = self._mujoco.GLContext(_SIZE, _SIZE)
        self._open.callback(context.free)
        context.make_current()
        self._resources = self._open.enter_context(drawing(self._mujoco, self.model))
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def render(self, seed: int, n_views: int = 1) -> list[RenderedPicture]:
        """`n_views` pictures of each state, positive and negative in turn; a seed, a result."""
        rng = generator_of(f"simulator/{self._name}/{seed}")
        return [self._picture(state, rng) for _ in range(n_views) for state in (True, False)]

    def _picture(self, is_positive: bool, rng: np.random.Generator) -> RenderedPicture:
        degree = self._pose(is_positive, rng)
        self._vary(rng)
        camera = self._camera(rng)
        pixels = draw(
            self._mujoco, self.model, self._data, camera, self._resources, _SIZE, self._options
        )
        # What only measures stays as its simulator draws it.
        if self._task.trains:
            image = photograph(pixels, rng)
        else:
            image = Image.fromarray(np.ascontiguousarray(pixels))
        facts = {"degree": degree, "flush": float(degree == 0)}
        return RenderedPicture(image, self._task.thing, is_positive, facts)

    def _pose(self, is_positive: bool, rng: np.random.Generator) -> float:
        """Move the joints; return how far the thing is open, in [0, 1]."""
        task, model, data = self._task, self.model, self._data
        self._mujoco.mj_resetData(model, data)
        low, high = task.opened if is_positive else task.closed
        value = rng.uniform(min(low, high), max(low, high))
        data.qpos[self._address(task.joint)] = value
        for other in task.others:
            joint = model.joint(other)
            if rng.random() < 0.35:
                data.qpos[model.jnt_qposadr[joint.id]] = rng.uniform(*joint.range)
        closed = sum(task.closed) / 2
        return abs(value - closed) / abs(task.opened[1] - closed) if is_positive else 0.0

    def _address(self, name: str) -> int:
        """Where a joint's value stands, by the joint's name or that of its body."""
        names = [self.model.joint(number).name for number in range(self.model.njnt)]
        joint = names.index(name) if name in names else self.model.body(name).jntadr[0]
        return int(self.model.jnt_qposadr[joint])

    def _vary(self, rng: np.random.Generator) -> None:
        """Other colours, other light; the robot is mostly taken away."""
        model = self.model
        for name, original in self._original.items():
            getattr(model, name)[:] = original
        if rng.random() < 0.85:
            model.geom_matid[self._robot] = -1
            model.geom_rgba[self._robot, 3] = 0
        if rng.random() < 0.7:
            for colours in (model.mat_rgba, model.geom_rgba):
                chosen = rng.random(len(colours)) < 0.5
                tints = rng.uniform(0.45, 1.25, (len(colours), 3)) * colours[:, :3]
                colours[chosen, :3] = np.clip(tints[chosen] + rng.uniform(0, 0.15), 0, 1)
        n_lights = model.nlight
        strength = rng.uniform(0.5, 1.3, (n_lights, 1)) * rng.uniform(0.85, 1.1, (n_lights, 3))
        model.light_diffuse[:] = np.clip(model.light_diffuse * strength, 0, 1.2)
        model.light_pos[:] += rng.normal(0, 0.35, (n_lights, 3))
        front = rng.uniform(0.25, 0.7) * rng.uniform(0.9, 1.1, 3)
        model.vis.headlight.diffuse[:] = np.clip(front, 0, 1)
        model.vis.headlight.ambient[:] = rng.uniform(0.1, 0.35)
        model.vis.global_.fovy = rng.uniform(40, 60)

    def _camera(self, rng: np.random.Generator) -> Any:
        where, camera = self._task.camera, self._mujoco.MjvCamera()
        camera.type = self._mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = np.array(where.target) + rng.normal(0, 0.06, 3)
        camera.azimuth = rng.uniform(*where.azimuth)
        camera.elevation = rng.uniform(*where.elevation)
        camera.distance = rng.uniform(*where.distance)
        return camera


def render_tasks(
    folder: Path, names: Sequence[str], n_scenes: int, n_views: int, n_processes: int
) -> None:
    """Render the missing scenes of some tasks to FOLDER/TASK; see `render_missing`."""
    renderers = {folder / name: partial(_open_renderer, name) for name in names}
    render_missing(renderers, n_scenes, n_views, n_processes, f"simulators ({folder.name})")


@contextmanager
def _open_renderer(name: str) -> Iterator[Callable[[int, int], list[RenderedPicture]]]:
    with SimulatorRenderer(name) as renderer:
        yield renderer.render


def load_tasks(folder: Path, names: Sequence[str], n_scenes: int) -> list[Example]:
    """All pictures of scenes 0 to `n_scenes` - 1 of some tasks, in the order of `names`."""
    tasks = _simulators().tasks
    return [
        example
        for name in names
        for seed in range(n_scenes)
        for example in read_scene(folder / name, seed, tasks[name].thing, f"simulator/{name}")
    ]


def _scene_file(task: SimulatorTask) -> Path:
    """The scene in the installed package; the package itself is not imported."""
    found = importlib.util.find_spec(task.package)
    if found is None or not found.submodule_search_locations:
        raise MissingPackageError("simulators", "--no-deps -r requirements-simulators.txt")
    return Path(found.submodule_search_locations[0]) / task.file


def _robot_geoms(model: Any) -> NDArray[np.intp]:
    """Geoms of all bodies that belong to a robot, by their names and their parents'."""
    parts, robot = _simulators(), set[int]()
    for body in range(1, model.nbody):
        name = model.body(body).name
        named = any(part in name for part in parts.robot_parts)
        named = named and not any(part in name.lower() for part in parts.thing_parts)
        if named or int(model.body_parentid[body]) in robot:
            robot.add(body)
    return np.flatnonzero([int(body) in robot for body in model.geom_bodyid])
