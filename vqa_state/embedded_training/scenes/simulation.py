"""What a scene is before it is drawn, and how its state is changed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vqa_state.embedded_training.scenes.random_draws import RandomDraws

__all__ = ["Blueprint", "CameraRange", "Facts", "Pose", "Range", "Simulation"]

#: What is to be seen in one picture by the scene's own parameters, each in [0, 1], e.g. {"degree":
#: 0.4, "flush": 0.0}. Facts differ in what must be looked at, so they can be asked as questions of
#: their own. "degree" is how far something is open, or how strongly it shines or flows; 0 is the
#: negative state.
Facts = Mapping[str, float]

#: Puts a simulation into the positive (True) or the negative state; returns what is to be seen.
Pose = Callable[["Simulation", bool], Facts]

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class CameraRange:
    """Where the camera may stand. Angles in degrees, azimuth 90 looks along +y; metres."""

    target: tuple[float, float, float]
    azimuth: Range
    elevation: Range
    distance: Range


@dataclass(frozen=True, slots=True)
class Blueprint:
    """A built scene that can be put into both states, again and again."""

    pose: Pose
    camera: CameraRange


class Simulation(RandomDraws):
    """A compiled MuJoCo model whose joints, materials and lamps can be set by name."""

    def __init__(self, model: Any, data: Any, rng: np.random.Generator) -> None:
        super().__init__(rng)
        self.model = model
        self.data = data

    def degree(self, is_positive: bool) -> float:
        """How far the positive state goes, in [0, 1]: one in six is only a little open."""
        if not is_positive:
            return 0.0
        return self.uniform(0.12, 0.3) if self.chance(1 / 6) else self.uniform(0.3, 1)

    def move(self, joint: str, value: float) -> None:
        """Set a hinge (radians) or a slide (metres)."""
        self.data.qpos[self.model.jnt_qposadr[self.model.joint(joint).id]] = value

    def paint(self, material: str, colour: tuple[float, float, float], emission: float) -> None:
        """Give a material an RGB colour and a glow, both in [0, 1]."""
        self.model.mat_rgba[self.model.material(material).id, :3] = colour
        self.glow(material, emission)

    def glow(self, material: str, emission: float) -> None:
        """Give a material a glow in [0, 1] and leave its colour or picture."""
        self.model.mat_emission[self.model.material(material).id] = emission

    def light(self, name: str, colour: tuple[float, float, float]) -> None:
        """Set the diffuse RGB of one lamp; black is off."""
        self.model.light_diffuse[self.model.light(name).id] = colour

    def dim(self, factor: float) -> None:
        """Scale every lamp of the scene."""
        self.model.light_diffuse[:] *= factor

    def ambient(self, level: float, headlight: float) -> None:
        """Set the light that comes from everywhere and the one that comes from the camera."""
        self.model.vis.headlight.ambient[:] = level
        self.model.vis.headlight.diffuse[:] = headlight
