"""Draws scenes with MuJoCo, in software where there is no screen."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL.Image import Image

from vqa_state.embedded_training.scenes.builder import SceneBuilder
from vqa_state.embedded_training.scenes.photography import photograph
from vqa_state.embedded_training.scenes.random_draws import SceneSplit, scene_generator
from vqa_state.embedded_training.scenes.simulation import Blueprint, CameraRange, Facts, Simulation
from vqa_state.embedded_training.scenes.surroundings import add_surroundings
from vqa_state.embedded_training.scenes.things import BUILDERS
from vqa_state.errors import MissingPackageError

__all__ = ["RenderedPicture", "SceneRenderer", "draw", "drawing", "import_mujoco"]

#: The largest picture, in pixels a side: the size of the off-screen buffer in the scene's XML.
_MAX_SIZE = 320


@dataclass(frozen=True, slots=True)
class RenderedPicture:
    """One rendered picture and what is to be seen in it."""

    image: Image
    thing: str
    is_positive: bool
    facts: Facts


class SceneRenderer:
    """Renders scenes one after another in a single drawing context.

    Use it in a `with` block and keep only one alive in a process: with two software contexts
    MuJoCo draws into the wrong one.

    Raises:
        MissingPackageError: on entering, if mujoco is not installed.
    """

    def __init__(self, size: int = 256) -> None:
        if not 16 <= size <= _MAX_SIZE:
            raise ValueError(f"size must be from 16 to {_MAX_SIZE} pixels, got {size}")
        self.size = size
        self._mujoco: Any = None
        self._context: Any = None

    def __enter__(self) -> Self:
        self._mujoco = import_mujoco()
        self._context = self._mujoco.GLContext(_MAX_SIZE, _MAX_SIZE)
        self._context.make_current()
        return self

    def __exit__(self, *_: object) -> None:
        self._context.free()

    def render(
        self, thing: str, split: SceneSplit, seed: int, n_views: int = 1
    ) -> list[RenderedPicture]:
        """Build one scene and take `n_views` pictures of each of its two states.

        Returns:
            2 x `n_views` RGB pictures; positive and negative ones alternate. The same arguments
            give the same pictures.
        """
        rng = scene_generator(thing, split, seed)
        scene = SceneBuilder(rng)
        blueprint = BUILDERS[thing](scene)
        add_surroundings(scene, blueprint.camera)
        model = self._mujoco.MjModel.from_xml_string(scene.xml(), scene.textures)
        with drawing(self._mujoco, model) as resources:
            return [
                picture
                for _ in range(n_views)
                for picture in self._pair(thing, blueprint, model, resources, rng)
            ]

    def _pair(
        self, thing: str, blueprint: Blueprint, model: Any, resources: Any, rng: np.random.Generator
    ) -> list[RenderedPicture]:
        """Both states from one camera; in two cases of five the camera moves between them."""
        sim = Simulation(model, self._mujoco.MjData(model), rng)
        lights = model.light_diffuse.copy()
        camera = self._camera(blueprint.camera, rng)
        pictures = []
        for is_positive in (True, False):
            model.light_diffuse[:] = lights
            facts = blueprint.pose(sim, is_positive)
            pixels = draw(self._mujoco, model, sim.data, camera, resources, self.size)
            pictures.append(RenderedPicture(photograph(pixels, rng), thing, is_positive, facts))
            if rng.random() < 0.4:
                camera = self._camera(blueprint.camera, rng)
        model.light_diffuse[:] = lights
        return pictures

    def _camera(self, where: CameraRange, rng: np.random.Generator) -> Any:
        camera = self._mujoco.MjvCamera()
        camera.type = self._mujoco.mjtCamera.mjCAMERA_FREE
        camera.distance = rng.uniform(*where.distance)
        camera.azimuth = rng.uniform(*where.azimuth)
        camera.elevation = rng.uniform(*where.elevation)
        camera.lookat[:] = np.array(where.target) + rng.normal(0, 0.04, 3) * where.distance[0]
        return camera


@contextmanager
def drawing(mujoco: Any, model: Any) -> Iterator[Any]:
    """Load a model's meshes and textures for drawing into the current context's hidden buffer."""
    resources = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
    try:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, resources)
        yield resources
    finally:
        resources.free()


def draw(
    mujoco: Any, model: Any, data: Any, camera: Any, resources: Any, size: int, options: Any = None
) -> NDArray[np.uint8]:
    """What the camera sees: RGB of shape (size, size, 3). `options` says what is visible."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    scene = mujoco.MjvScene(model, maxgeom=2000)
    visible = mujoco.MjvOption() if options is None else options
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, visible, mujoco.MjvPerturb(), camera, everything, scene)
    view = mujoco.MjrRect(0, 0, size, size)
    pixels = np.empty((size, size, 3), np.uint8)
    mujoco.mjr_render(view, scene, resources)
    mujoco.mjr_readPixels(pixels, None, view, resources)
    # OpenGL counts rows from below.
    return pixels[::-1]


def import_mujoco() -> Any:
    """Import mujoco, with software drawing on a Linux machine that has no screen.

    MuJoCo reads the choice from the environment when it is imported, and at no other time.
    """
    if sys.platform == "linux" and "DISPLAY" not in os.environ:
        os.environ.setdefault("MUJOCO_GL", "osmesa")
    try:
        import mujoco
    except ImportError as error:
        raise MissingPackageError("embedded (training)", "mujoco") from error
    return mujoco
