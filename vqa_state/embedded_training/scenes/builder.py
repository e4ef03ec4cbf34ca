"""Writes one MuJoCo scene: materials, geometry, bodies and light, all from one generator."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

import numpy as np

from vqa_state.embedded_training.scenes.random_draws import RandomDraws
from vqa_state.embedded_training.scenes.textures import (
    Colour,
    encode_png,
    mixed_colour,
    screen_content,
    surface,
    tint,
)

__all__ = ["SceneBuilder", "Vector", "hinge", "slide"]

Vector = tuple[float, float, float]

#: How often a finish gets a texture instead of one flat colour, and which ones suit it.
_TEXTURES: dict[str, tuple[float, tuple[str, ...]]] = {
    "any": (0.35, ("wood", "plaster", "cloth", "speckle", "stripes")),
    "wall": (0.6, ("plaster", "plaster", "tiles", "stripes", "wood")),
    "floor": (0.85, ("wood", "tiles", "speckle", "cloth", "plaster")),
    "wood": (0.9, ("wood",)),
    "cloth": (0.7, ("cloth", "plaster", "stripes")),
    "metal": (0.0, ()),
    "white": (0.0, ()),
    "dark": (0.0, ()),
}


class SceneBuilder(RandomDraws):
    """Collects geometry as XML. Lengths in metres, angles in radians, +z is up, +y is away."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(rng)
        self.textures: dict[str, bytes] = {}
        self._assets: list[str] = []
        self._world: list[str] = []
        self._textured: set[str] = set()
        self._materials = 0

    def material(self, finish: str = "any", *, glow: float = 0.0, alpha: float = 1.0) -> str:
        """Declare a material and return its name.

        `finish` is one of any, wall, floor, wood, cloth, metal, white, dark.
        """
        probability, kinds = _TEXTURES[finish]
        colour = self._colour(finish)
        if alpha == 1.0 and self.chance(probability):
            pixels = surface(self.rng, self.pick(kinds), colour)
            return self._textured_material(encode_png(pixels), self.uniform(0.7, 4), glow)
        return self._declare(f'rgba="{_numbers((*colour, alpha))}"', glow, finish == "metal")

    def screen(self) -> str:
        """A glowing material that shows the content of a screen, once over the whole surface."""
        name = self._texture(encode_png(screen_content(self.rng)))
        return self._declare(f'texture="{name}" rgba="1 1 1 1"', self.uniform(0.6, 1.0), False)

    def geom(
        self,
        kind: str,
        size: Sequence[float],
        material: str,
        *,
        at: Vector | None = None,
        along: tuple[Vector, Vector] | None = None,
        turn: Vector | None = None,
    ) -> None:
        """Add a primitive at a place, or along a segment (capsules, cylinders)."""
        where = f'pos="{_numbers(at)}"' if at is not None else ""
        if along is not None:
            where += f' fromto="{_numbers((*along[0], *along[1]))}"'
        rotation = f'euler="{_numbers(turn)}"' if turn is not None else ""
        extent = _numbers([max(value, 0.0005) for value in size])
        self._world.append(
            f'<geom  type="{kind}" size="{extent}" {where} {rotation} '
            f'material="{material}" contype="0" conaffinity="0"/>'
        )

    def box(self, at: Vector, size: Vector, material: str, *, turn: float = 0.0) -> None:
        """Add a box of full extents `size`, turned about z.

        MuJoCo lays a picture on a geom's own x-y plane, so a textured upright board is made
        lying down and then put up.
        """
        width, depth, height = size
        if material in self._textured and depth <= min(width, height) and turn == 0:
            half, angles = (width / 2, height / 2, depth / 2), (math.pi / 2, 0.0, 0.0)
        elif material in self._textured and width <= min(depth, height) and turn == 0:
            half, angles = (height / 2, depth / 2, width / 2), (0.0, math.pi / 2, 0.0)
        else:
            half, angles = (width / 2, depth / 2, height / 2), (0.0, 0.0, turn)
        self.geom("box", half, material, at=at, turn=angles)

    def pair(self, at: Vector, apart: float, size: Vector, material: str) -> None:
        """Add two equal boxes, `apart` to the left and to the right of a place."""
        for side in (-1, 1):
            self.box((at[0] + side * apart, at[1], at[2]), size, material)

    def rod(self, start: Vector, end: Vector, radius: float, material: str) -> None:
        """Add a round bar."""
        self.geom("capsule", (radius,), material, along=(start, end))

    def tube(self, points: Sequence[Vector], radius: float, material: str) -> None:
        """Add a bent round bar through all points."""
        for start, end in pairwise(points):
            self.rod(start, end, radius, material)

    def table(self, top: float, y: float = 0.1, depth: float = 1.4) -> None:
        """Add a wooden board whose upper side is at height `top`."""
        self.box((0, y, top - 0.03), (3, depth, 0.06), self.material("wood"))

    def lamp(self, name: str, at: Vector) -> None:
        """Add a lamp that is dark until a pose lights it."""
        self._world.append(
            f'<light name="{name}" pos="{_numbers(at)}" dir="0 0 -1" cutoff="180" exponent="0" '
            'castshadow="false" attenuation="1 0.05 0.03" diffuse="0 0 0"/>'
        )

    @contextmanager
    def body(self, at: Vector, joint: str) -> Iterator[None]:
        """Everything added inside moves with the joint."""
        inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        self._world.append(f'<body pos="{_numbers(at)}">{joint}{inertia}')
        yield
        self._world.append("</body>")

    def xml(self) -> str:
        """The whole scene, with room light drawn last."""
        lights = "".join(self._light() for _ in range(self.count(1, 3)))
        ambient, front = self.uniform(0.25, 0.5), self.uniform(0.1, 0.4)
        return (
            '<mujoco><compiler angle="radian"/><visual>'
            f'<headlight ambient="{_numbers([ambient] * 3)}" diffuse="{_numbers([front] * 3)}" '
            f'specular="0.1 0.1 0.1"/><global fovy="{self.uniform(38, 60):.1f}" offwidth="320" '
            'offheight="320"/><map znear="0.01" zfar="60"/><quality shadowsize="512"/></visual>'
            f"<asset>{self._sky()}{''.join(self._assets)}</asset>"
            f"<worldbody>{lights}{''.join(self._world)}</worldbody></mujoco>"
        )

    def _colour(self, finish: str) -> Colour:
        """A colour that suits the finish."""
        if finish == "metal":
            return tint(self.rng, (self.uniform(0.45, 0.9),) * 3)
        if finish == "white":
            return tint(self.rng, (self.uniform(0.82, 1),) * 3, 0.05)
        if finish == "dark":
            return tint(self.rng, (self.uniform(0.02, 0.16),) * 3)
        if finish == "wall" and self.chance(0.7):
            return tint(self.rng, (self.uniform(0.55, 0.95),) * 3, 0.07)
        if finish in ("wood", "floor") and self.chance(0.7):
            light = self.uniform(0.3, 0.95)
            return tint(self.rng, (light, light * self.uniform(0.7, 0.9), light * 0.6), 0.1)
        return mixed_colour(self.rng)

    def _declare(self, look: str, glow: float, shiny: bool) -> str:
        name = f"m{self._materials}"
        self._materials += 1
        specular = self.uniform(0.4, 1) if shiny else self.uniform(0, 0.5)
        self._assets.append(
            f'<material name="{name}" {look} emission="{glow:.2f}" specular="{specular:.2f}" '
            f'shininess="{self.uniform(0.1, 1):.2f}"/>'
        )
        return name

    def _textured_material(self, png: bytes, repeat: float, glow: float) -> str:
        """A textured material; `repeat` counts the texture's copies per metre."""
        look = (
            f'texture="{self._texture(png)}" texuniform="true" rgba="1 1 1 1" '
            f'texrepeat="{repeat:.2f} {repeat:.2f}"'
        )
        name = self._declare(look, glow, False)
        self._textured.add(name)
        return name

    def _texture(self, png: bytes) -> str:
        name = f"t{len(self.textures)}"
        self.textures[f"{name}.png"] = png
        self._assets.append(f'<texture name="{name}" type="2d" file="{name}.png"/>')
        return name

    def _light(self) -> str:
        at = (self.uniform(-3, 3), self.uniform(-4, 1), self.uniform(2.2, 4))
        aim = (self.uniform(-0.5, 0.5), self.uniform(-0.2, 0.8), -1.0)
        level = self.uniform(0.25, 0.7)
        # Lamps at home are white or warm, never pink or green.
        colour = tint(self.rng, (level, level * 0.98, level * self.uniform(0.85, 1)), 0.03)
        far = "true" if self.chance(0.4) else "false"
        shadow = "true" if self.chance(0.7) else "false"
        return (
            f'<light pos="{_numbers(at)}" dir="{_numbers(aim)}" directional="{far}" '
            f'castshadow="{shadow}" diffuse="{_numbers(colour)}" cutoff="90" exponent="1"/>'
        )

    def _sky(self) -> str:
        top, bottom = mixed_colour(self.rng), mixed_colour(self.rng)
        return (
            f'<texture type="skybox" builtin="gradient" rgb1="{_numbers(top)}" '
            f'rgb2="{_numbers(bottom)}" width="32" height="192"/>'
        )


def hinge(name: str, axis: str = "0 0 1") -> str:
    """A joint that turns, about the vertical unless said otherwise."""
    return f'<joint name="{name}" type="hinge" axis="{axis}"/>'


def slide(name: str, axis: str = "1 0 0") -> str:
    """A joint that slides, sideways unless said otherwise."""
    return f'<joint name="{name}" type="slide" axis="{axis}"/>'


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.4f}" for value in values)
