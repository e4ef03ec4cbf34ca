"""Surfaces and screen contents, drawn anew for every scene: no texture is used twice."""

import colorsys
import io
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

__all__ = ["Colour", "encode_png", "mixed_colour", "screen_content", "surface", "tint"]

Colour = tuple[float, float, float]
Range = tuple[float, float]
Pattern = NDArray[np.float64]

_SIZE = 96
_WIDTH, _HEIGHT = 192, 108

#: Families of colours: how often, then the ranges of hue, saturation and value.
_FAMILIES: tuple[tuple[float, Range, Range, Range], ...] = (
    (0.40, (0, 1), (0, 0.08), (0.3, 1)),  # neutral
    (0.32, (0, 1), (0.1, 0.4), (0.4, 0.95)),  # muted
    (0.16, (0.04, 0.12), (0.3, 0.6), (0.3, 0.8)),  # wood and leather
    (0.12, (0, 1), (0.5, 0.85), (0.35, 0.95)),  # vivid
)


def tint(rng: np.random.Generator, colour: Colour, spread: float = 0.06) -> Colour:
    """The colour (each channel in [0, 1]) with a little of everything changed."""
    red, green, blue = np.clip(np.array(colour) * rng.uniform(1 - spread, 1 + spread, 3), 0, 1)
    return float(red), float(green), float(blue)


def mixed_colour(rng: np.random.Generator) -> Colour:
    """A colour as things at home have it: mostly neutral or muted, seldom vivid."""
    family = rng.choice(len(_FAMILIES), p=[share for share, *_ in _FAMILIES])
    hue, saturation, value = (rng.uniform(*ends) for ends in _FAMILIES[family][1:])
    return colorsys.hsv_to_rgb(float(hue), float(saturation), float(value))


def surface(rng: np.random.Generator, kind: str, colour: Colour) -> NDArray[np.uint8]:
    """A (96, 96, 3) picture of a material in the given colour.

    `kind` is one of wood, plaster, tiles, cloth, speckle, stripes.
    """
    strength = _PATTERNS[kind](rng)[..., None]
    contrast = rng.uniform(0.08, 0.5) if kind != "plaster" else rng.uniform(0.03, 0.15)
    second = np.array(tint(rng, colour, 0.3)) * rng.uniform(0.35, 0.9)
    mixed = np.array(colour) * (1 - strength * contrast) + second * strength * contrast
    mixed = mixed + rng.normal(0, rng.uniform(0, 0.02), mixed.shape)
    return (np.clip(mixed, 0, 1) * 255).astype(np.uint8)


def screen_content(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A (108, 192, 3) picture as a monitor or television shows it: windows, text or a landscape."""
    image = Image.fromarray(_landscape(rng) if rng.random() < 0.4 else _desktop(rng))
    draw = ImageDraw.Draw(image)
    for _ in range(int(rng.integers(0, 6))):
        _window(draw, rng)
    return np.asarray(image)


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """PNG bytes with the least effort: MuJoCo reads them back at once."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG", compress_level=1)
    return buffer.getvalue()


def _cells(rng: np.random.Generator, cells: int) -> Pattern:
    """Smooth noise in [0, 1] with about `cells` bumps a side."""
    coarse = Image.fromarray((rng.random((cells, cells)) * 255).astype(np.uint8))
    return np.asarray(coarse.resize((_SIZE, _SIZE), Image.Resampling.BICUBIC)) / 255.0


def _grid() -> tuple[Pattern, Pattern]:
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] / _SIZE
    return y, x


def _wood(rng: np.random.Generator) -> Pattern:
    _, x = _grid()
    warp = x * rng.uniform(4, 14) + _cells(rng, 5) * rng.uniform(0.5, 3)
    return np.asarray(0.6 * (np.sin(warp * 2 * np.pi) * 0.5 + 0.5) + 0.4 * _cells(rng, 24))


def _plaster(rng: np.random.Generator) -> Pattern:
    return np.asarray(0.5 * _cells(rng, 4) + 0.5 * _cells(rng, 30))


def _tiles(rng: np.random.Generator) -> Pattern:
    y, x = _grid()
    rows, columns = rng.integers(2, 7), rng.integers(2, 7)
    shift = 0.5 * (np.floor(y * rows) % 2) if rng.random() < 0.5 else 0.0
    joint = rng.uniform(0.03, 0.09)
    lines = ((x * columns + shift) % 1 < joint) | ((y * rows) % 1 < joint)
    return np.asarray(lines + 0.2 * _cells(rng, 12))


def _cloth(rng: np.random.Generator) -> Pattern:
    y, x = _grid()
    threads = rng.integers(20, 40)
    weave = np.sin(x * threads * 2 * np.pi) * np.sin(y * threads * 2 * np.pi) * 0.5 + 0.5
    return np.asarray(0.6 * weave + 0.4 * _cells(rng, 8))


def _speckle(rng: np.random.Generator) -> Pattern:
    return np.asarray(
        (rng.random((_SIZE, _SIZE)) < rng.uniform(0.1, 0.5)) * 0.7 + 0.3 * _cells(rng, 8)
    )


def _stripes(rng: np.random.Generator) -> Pattern:
    y, x = _grid()
    turned = x * rng.integers(0, 7) + y * rng.integers(0, 7)
    return np.asarray((turned % 1 < rng.uniform(0.2, 0.6)).astype(float))


_PATTERNS: dict[str, Callable[[np.random.Generator], Pattern]] = {
    "wood": _wood,
    "plaster": _plaster,
    "tiles": _tiles,
    "cloth": _cloth,
    "speckle": _speckle,
    "stripes": _stripes,
}


def _desktop(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A two-colour gradient, dark in one case of four as with a dark theme."""
    low, high = (20, 90) if rng.random() < 0.25 else (60, 255)
    y, x = np.mgrid[0:_HEIGHT, 0:_WIDTH]
    blend = (x / _WIDTH * rng.random() + y / _HEIGHT * rng.random())[..., None]
    pixels = rng.uniform(low, high, 3) * (1 - blend) + rng.uniform(low, high, 3) * blend
    return np.asarray(np.clip(pixels, 0, 255).astype(np.uint8))


def _landscape(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Coloured noise at three scales below a bright sky, as in a film or a photo."""
    total = np.zeros((_HEIGHT, _WIDTH, 3))
    for cells in (3, 8, 30):
        coarse = Image.fromarray(rng.integers(0, 256, (cells, cells, 3), dtype=np.uint8))
        layer = np.asarray(coarse.resize((_WIDTH, _HEIGHT), Image.Resampling.BICUBIC), float)
        total += layer * rng.uniform(0.2, 0.5)
    horizon = int(rng.integers(10, 70))
    total[:horizon] = 0.35 * total[:horizon] + 0.65 * rng.uniform(120, 255, 3)
    return np.clip(total, 0, 255).astype(np.uint8)


def _window(draw: ImageDraw.ImageDraw, rng: np.random.Generator) -> None:
    left, top = int(rng.integers(0, _WIDTH - 30)), int(rng.integers(0, _HEIGHT - 20))
    width, height = int(rng.integers(20, 120)), int(rng.integers(12, 80))
    fill = tuple(int(value) for value in rng.uniform(30, 255, 3))
    draw.rectangle([left, top, left + width, top + height], fill=fill)
    ink = (20, 20, 20) if sum(fill) > 350 else (235, 235, 235)
    if rng.random() < 0.6:
        for row in range(4, height - 3, 6):
            end = left + 4 + int(rng.integers(4, max(5, width - 6)))
            draw.line([left + 4, top + row, end, top + row], fill=ink)
