"""Things in other people's simulators, in known states: some may train, the rest only measure.

metaworld's door, drawer, window and laptop may train the network. The four of gymnasium-robotics
only ever measure it; nothing of that package trains. (robosuite's door is left out: it is drawn
from the same original as the Adroit door of gymnasium-robotics.) Only the packages' scene files are
read, none of their code runs.
"""

import hashlib
import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.progress import track

from vqa_state.embedded_training.dataset import Example, is_finished, read_record, write_pictures
from vqa_state.embedded_training.scenes.photography import photograph
from vqa_state.embedded_training.scenes.rendering import Picture, draw, import_mujoco
from vqa_state.errors import MissingPackageError

__all__ = [
    "MEASURING_TASKS",
    "TRAINING_TASKS",
    "SimulatorRenderer",
    "Task",
    "load_tasks",
    "render_tasks",
]

Range = tuple[float, float]

_SIZE = 256
_KITCHEN = "envs/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml"
_SAWYER = "assets/sawyer_xyz"


@dataclass(frozen=True, slots=True)
class Task:
    """One thing in one simulator. Angles of the camera in degrees, lengths in metres.

    Attributes:
        package: the package that holds the scene; `file` is its path there.
        thing: in whose words it is asked about.
        joint: the joint that opens it; a body's name where the joint has none.
        closed, opened: where the joint may stand in each state (radians or metres).
        target: what the camera looks at.
        azimuth, elevation, distance: where the camera may stand.
        others: joints that move freely and mean nothing.
    """

    package: str
    file: str
    thing: str
    joint: str
    closed: Range
    opened: Range
    target: tuple[float, float, float]
    azimuth: Range
    elevation: Range
    distance: Range
    others: tuple[str, ...] = ()

    @property
    def trains(self) -> bool:
        """Whether its pictures may train the network."""
        return self.package == "metaworld"


def _kitchen(thing: str, joint: str, closed: Range, opened: Range, **camera: Any) -> Task:
    joints = ("microwave", "left_hinge_cabinet", "slide_cabinet", "knob_Joint_1", "knob_Joint_2")
    others = tuple(other for other in joints if other != joint)
    return Task(
        "gymnasium_robotics", _KITCHEN, thing, joint, closed, opened, **camera, others=others
    )


#: Only ever measured.
MEASURING_TASKS: Mapping[str, Task] = MappingProxyType(
    {
        "kitchen_microwave": _kitchen(
            "microwave",
            "microwave",
            (-0.03, 0),
            (-0.7, -2.0),
            target=(-0.75, 0.55, 1.8),
            azimuth=(65, 115),
            elevation=(-30, -5),
            distance=(0.9, 1.6),
        ),
        "kitchen_hinge_cabinet": _kitchen(
            "cabinet",
            "left_hinge_cabinet",
            (-0.03, 0),
            (-0.6, -1.55),
            target=(-0.6, 0.75, 2.6),
            azimuth=(60, 120),
            elevation=(-15, 20),
            distance=(0.9, 1.6),
        ),
        "kitchen_slide_cabinet": _kitchen(
            "cabinet",
            "slide_cabinet",
            (0, 0.01),
            (0.22, 0.44),
            target=(0.3, 0.75, 2.6),
            azimuth=(60, 120),
            elevation=(-15, 20),
            distance=(0.9, 1.6),
        ),
        "adroit_door": Task(
            "gymnasium_robotics",
            "envs/assets/adroit_hand/adroit_door.xml",
            "door",
            "door_hinge",
            (0, 0.02),
            (0.5, 1.5),
            (0, 0.04, 0.42),
            (45, 135),
            (-30, 0),
            (0.9, 1.5),
        ),
    }
)

#: May train the network. Openings begin small, as in our own scenes.
TRAINING_TASKS: Mapping[str, Task] = MappingProxyType(
    {
        "metaworld_door": Task(
            "metaworld",
            f"{_SAWYER}/sawyer_door_pull.xml",
            "door",
            "doorjoint",
            (-0.02, 0),
            (-0.2, -1.9),
            (0, 0.85, 0.15),
            (50, 130),
            (-40, -10),
            (0.8, 1.4),
        ),
        "metaworld_drawer": Task(
            "metaworld",
            f"{_SAWYER}/sawyer_drawer.xml",
            "drawer",
            "goal_slidey",
            (-0.004, 0),
            (-0.03, -0.16),
            (0, 0.8, 0.1),
            (45, 135),
            (-50, -15),
            (0.6, 1.1),
        ),
        "metaworld_window": Task(
            "metaworld",
            f"{_SAWYER}/sawyer_window_horizontal.xml",
            "window",
            "window_slide",
            (0, 0.006),
            (0.04, 0.2),
            (0, 0.79, 0.2),
            (45, 135),
            (-35, -5),
            (0.7, 1.2),
        ),
        "metaworld_laptop": Task(
            "metaworld",
            f"{_SAWYER}/sawyer_laptop.xml",
            "laptop",
            "laptoplid_link",
            (1.47, 1.57),
            (1.3, 0),
            (0, 0.85, 0.1),
            (45, 135),
            (-50, -15),
            (0.6, 1.1),
        ),
    }
)

_TASKS = {**MEASURING_TASKS, **TRAINING_TASKS}

#: Parts of bodies' names that belong to a robot, and those that never do.
_ROBOT = (
    *(
        "panda",
        "robot0",
        "gripper",
        "right_",
        "base",
        "controller_box",
        "pedestal",
        "torso",
        "head",
    ),
    *("screen", "claw", "pad", "mocap", "knuckle", "proximal", "middle", "distal", "palm", "wrist"),
    *("forearm", "metacarpal", "thbase", "thhub", "hand", "tracker", "mount", "finger"),
)
_THING = ("door", "drawer", "window", "laptop", "switchbase")

#: What `_vary` changes and sets back.
_VARIED = ("mat_rgba", "geom_rgba", "geom_matid", "light_diffuse", "light_pos")

#: Scenes that one process renders in one drawing context.
_PER_JOB = 10


class SimulatorRenderer:
    """Renders one task in a drawing context of its own; keep only one alive in a process.

    Raises:
        MissingPackageError: if mujoco or the task's package is not installed.
    """

    def __init__(self, name: str) -> None:
        self._name, self._task = name, _TASKS[name]
        self._mujoco = import_mujoco()
        self.model = self._mujoco.MjModel.from_xml_path(str(_scene_file(self._task)))
        self.model.vis.global_.offwidth = self.model.vis.global_.offheight = _SIZE
        self._data = self._mujoco.MjData(self.model)
        self._options = self._mujoco.MjvOption()
        self._options.geomgroup[:] = (1, 1, 1, 0, 0, 0)
        self._options.sitegroup[:] = 0
        self._robot = _robot_geoms(self.model)
        self._kept = {name: getattr(self.model, name).copy() for name in _VARIED}
        self._context: Any = None
        self._resources: Any = None

    def __enter__(self) -> "SimulatorRenderer":
        self._context = self._mujoco.GLContext(_SIZE, _SIZE)
        self._context.make_current()
        scale = self._mujoco.mjtFontScale.mjFONTSCALE_50
        self._resources = self._mujoco.MjrContext(self.model, scale)
        self._mujoco.mjr_setBuffer(self._mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._resources)
        return self

    def __exit__(self, *_: object) -> None:
        self._resources.free()
        self._context.free()

    def render(self, seed: int, n_views: int = 1) -> list[Picture]:
        """`n_views` pictures of each state, positive and negative in turn; a seed, a result."""
        address = f"simulator/{self._name}/{seed}".encode()
        digest = hashlib.sha256(address).digest()[:16]
        rng = np.random.default_rng(int.from_bytes(digest, "big"))
        return [self._picture(state, rng) for _ in range(n_views) for state in (True, False)]

    def _picture(self, is_positive: bool, rng: np.random.Generator) -> Picture:
        degree = self._pose(is_positive, rng)
        self._vary(rng)
        pixels = draw(
            self._mujoco,
            self.model,
            self._data,
            self._camera(rng),
            self._resources,
            _SIZE,
            self._options,
        )
        # What only measures stays as its simulator draws it.
        if self._task.trains:
            image = photograph(pixels, rng)
        else:
            image = Image.fromarray(np.ascontiguousarray(pixels))
        facts = {"degree": degree, "flush": float(degree == 0)}
        return Picture(image, self._task.thing, is_positive, facts)

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
        for name, kept in self._kept.items():
            getattr(model, name)[:] = kept
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
        model.vis.headlight.diffuse[:] = np.clip(
            rng.uniform(0.25, 0.7) * rng.uniform(0.9, 1.1, 3), 0, 1
        )
        model.vis.headlight.ambient[:] = rng.uniform(0.1, 0.35)
        model.vis.global_.fovy = rng.uniform(40, 60)

    def _camera(self, rng: np.random.Generator) -> Any:
        task, camera = self._task, self._mujoco.MjvCamera()
        camera.type = self._mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = np.array(task.target) + rng.normal(0, 0.06, 3)
        camera.azimuth = rng.uniform(*task.azimuth)
        camera.elevation = rng.uniform(*task.elevation)
        camera.distance = rng.uniform(*task.distance)
        return camera


def render_tasks(
    folder: Path, names: Sequence[str], n_scenes: int, n_views: int, n_processes: int
) -> None:
    """Render what is missing to FOLDER/TASK, with a bar; finished scenes are skipped.

    Raises:
        ProjectError: if the folder holds scenes with another number of views.
    """
    jobs = [
        (folder / name, name, tuple(range(start, min(start + _PER_JOB, n_scenes))), n_views)
        for name in names
        for start in range(0, n_scenes, _PER_JOB)
    ]
    pending = [job for job in jobs if not _is_finished(job)]
    with get_context("spawn").Pool(n_processes) as pool:
        done = pool.imap_unordered(_render_job, pending)
        for _ in track(done, total=len(pending), description=f"simulators ({folder.name})"):
            pass


def load_tasks(folder: Path, names: Sequence[str], n_scenes: int) -> list[Example]:
    """All pictures of scenes 0 to `n_scenes` - 1 of some tasks, in the order of `names`."""
    return [
        example
        for name in names
        for seed in range(n_scenes)
        for example in read_record(
            _record(folder / name, seed), _TASKS[name].thing, f"simulator/{name}/{seed:05d}"
        )
    ]


def _render_job(job: tuple[Path, str, tuple[int, ...], int]) -> None:
    folder, name, seeds, n_views = job
    folder.mkdir(parents=True, exist_ok=True)
    with SimulatorRenderer(name) as renderer:
        for seed in seeds:
            write_pictures(_record(folder, seed), renderer.render(seed, n_views))


def _is_finished(job: tuple[Path, str, tuple[int, ...], int]) -> bool:
    folder, _, seeds, n_views = job
    return all(is_finished(_record(folder, seed), n_views) for seed in seeds)


def _record(folder: Path, seed: int) -> Path:
    return folder / f"{seed:05d}.json"


def _scene_file(task: Task) -> Path:
    """The scene in the installed package; the package itself is not imported.

    Raises:
        MissingPackageError: if it is not installed.
    """
    found = importlib.util.find_spec(task.package)
    if found is None or not found.submodule_search_locations:
        raise MissingPackageError("simulators", "--no-deps -r requirements-simulators.txt")
    return Path(found.submodule_search_locations[0]) / task.file


def _robot_geoms(model: Any) -> NDArray[np.intp]:
    """Geoms of all bodies that belong to a robot, by their names and their parents'."""
    robot: set[int] = set()
    for body in range(1, model.nbody):
        name = model.body(body).name
        named = any(part in name for part in _ROBOT)
        named = named and not any(part in name.lower() for part in _THING)
        if named or int(model.body_parentid[body]) in robot:
            robot.add(body)
    return np.flatnonzero([int(body) in robot for body in model.geom_bodyid])
