"""Boxes with hinged fronts: cabinets, refrigerators, microwaves."""

from collections.abc import Sequence

from vqa_state.embedded_training.scenes.builder import SceneBuilder
from vqa_state.embedded_training.scenes.parts import (
    Leaf,
    add_carcass,
    add_clutter,
    add_handle,
    add_items,
    add_leaf,
    add_room,
    swing_leaves,
)
from vqa_state.embedded_training.scenes.sliding import add_sliding_fronts
from vqa_state.embedded_training.scenes.stage import Blueprint, CameraRange, Facts, Pose, Stage

__all__ = ["build_cabinet", "build_microwave", "build_refrigerator"]


def build_cabinet(scene: SceneBuilder) -> Blueprint:
    """A cupboard with one or two leaves or sliding fronts, on the floor or on the wall."""
    width, height, depth = scene.uniform(0.4, 1), scene.uniform(0.4, 1.1), scene.uniform(0.3, 0.5)
    bottom = scene.pick((0.05, 0.9, 1.4))
    add_room(scene, depth + 0.02)
    outside = scene.material(scene.pick(("wood", "wood", "white", "any")))
    inside = outside if scene.chance(0.4) else scene.material(scene.pick(("wood", "white", "any")))
    add_carcass(scene, (width, depth, height), bottom, outside, inside)
    _add_shelves(scene, (width, depth, height), bottom, inside)
    fronts = outside if scene.chance(0.6) else scene.material()
    if scene.chance(0.25):
        pose = add_sliding_fronts(scene, width, height, bottom, fronts)
    else:
        pose = _add_cabinet_leaves(scene, width, height, bottom, fronts)
    _add_neighbours(scene, (width, depth, height), bottom, fronts)
    camera = CameraRange(
        (0, 0, bottom + height / 2), (50, 130), (-25, 12), (height * 1.3 + 0.3, height * 2.6 + 0.4)
    )
    return Blueprint(pose, camera)


def build_refrigerator(scene: SceneBuilder) -> Blueprint:
    """One door, a door and a freezer, or two doors side by side, with food on the shelves."""
    width, height, depth = (
        scene.uniform(0.55, 0.9),
        scene.uniform(1.3, 1.9),
        scene.uniform(0.55, 0.7),
    )
    bottom = 0.03
    add_room(scene, depth + 0.05)
    outside = scene.material(scene.pick(("white", "metal", "any", "dark")))
    inside = scene.material("white", glow=scene.uniform(0, 0.5))
    add_carcass(scene, (width, depth, height), bottom, outside, inside, board=0.05)
    rows = scene.count(3, 5)
    for row in range(rows):
        z = bottom + max(0.04, height * row / rows)
        scene.box((0, depth / 2, z), (width - 0.08, depth - 0.06, 0.012), scene.material("white"))
        add_items(scene, width * 0.9, depth, z, scene.count(1, 5), height / rows * 0.7)
    leaves = _refrigerator_leaves(scene, width, height, bottom)
    if len({leaf.centre_z for leaf in leaves}) > 1:
        split = bottom + leaves[0].height
        scene.box((0, depth / 2, split), (width, depth, 0.04), inside)
    for leaf in leaves:
        add_leaf(scene, leaf, outside, bar=scene.chance(0.8))
    _add_kitchen(scene, width, depth)
    camera = CameraRange((0, 0, height * 0.5), (52, 128), (-18, 8), (1.7, 3.2))
    return Blueprint(_swing(leaves, 2.1), camera)


def build_microwave(scene: SceneBuilder) -> Blueprint:
    """A microwave oven on a counter, its door hinged on the left."""
    width, height, depth = (
        scene.uniform(0.42, 0.56),
        scene.uniform(0.25, 0.34),
        scene.uniform(0.3, 0.4),
    )
    bottom = scene.uniform(0.8, 1.3)
    add_room(scene, depth + scene.uniform(0.02, 0.3))
    counter = (3.0, depth + 0.35, 0.07)
    scene.box((0, depth / 2 - 0.05, bottom - 0.045), counter, scene.material())
    outside = scene.material(scene.pick(("white", "metal", "dark", "any")))
    inside = scene.material(scene.pick(("white", "white", "metal")), glow=scene.uniform(0, 0.4))
    add_carcass(scene, (width, depth, height), bottom, outside, inside, board=0.015)
    panel = width * scene.uniform(0.18, 0.28)
    _add_control_panel(scene, (width, depth, height), bottom, panel, outside)
    plate = (min(width, depth) * 0.3, 0.005)
    scene.geom("cylinder", plate, scene.material("white"), at=(0, depth * 0.45, bottom + 0.03))
    if scene.chance(0.5):
        add_items(scene, width * 0.3, depth, bottom + 0.035, 1, height * 0.4)
    leaf = Leaf("leaf0", -1, -width / 2, bottom + height / 2, width - panel, height, 0.025)
    front = outside if scene.chance(0.7) else scene.material("dark")
    style = "window" if scene.chance(0.85) else "flat"
    add_leaf(scene, leaf, front, front=style, bar=scene.chance(0.6), handle_z=0.0)
    add_clutter(scene, scene.count(0, 3), (-1, -width / 2 - 0.15), (-0.1, depth), bottom, 0.25)
    add_clutter(scene, scene.count(0, 3), (width / 2 + 0.15, 1), (-0.1, depth), bottom, 0.25)
    camera = CameraRange((0, 0, bottom + height / 2), (52, 128), (-35, 2), (0.65, 1.3))
    return Blueprint(_swing([leaf], 2.1), camera)


def _swing(leaves: Sequence[Leaf], farthest: float) -> Pose:
    def pose(stage: Stage, is_open: bool) -> Facts:
        return swing_leaves(stage, leaves, is_open, farthest)

    return pose


def _add_shelves(
    scene: SceneBuilder, size: tuple[float, float, float], bottom: float, finish: str
) -> None:
    width, depth, height = size
    for row in range(scene.count(0, 2)):
        z = bottom + height * (row + 1) / 3
        scene.box((0, depth / 2, z), (width - 0.03, depth - 0.03, 0.015), finish)
        add_items(scene, width, depth, z, scene.count(0, 3), height * 0.25)
    add_items(scene, width, depth, bottom + 0.02, scene.count(0, 3), height * 0.28)


def _add_cabinet_leaves(
    scene: SceneBuilder, width: float, height: float, bottom: float, finish: str
) -> Pose:
    leaves = _cabinet_leaves(scene, width, height, bottom)
    style = "panel" if scene.chance(0.5) else "flat"
    for leaf in leaves:
        add_leaf(scene, leaf, finish, front=style)
    return _swing(leaves, 2.2)


def _cabinet_leaves(scene: SceneBuilder, width: float, height: float, bottom: float) -> list[Leaf]:
    middle = bottom + height / 2
    if scene.chance(0.6):
        sides = (-1.0, 1.0)
        return [
            Leaf(f"leaf{number}", side, side * width / 2, middle, width / 2, height)
            for number, side in enumerate(sides)
        ]
    side = scene.side()
    return [Leaf("leaf0", side, side * width / 2, middle, width, height)]


def _refrigerator_leaves(
    scene: SceneBuilder, width: float, height: float, bottom: float
) -> list[Leaf]:
    """Full height, freezer above, freezer below, or side by side: equally often."""
    kind, side = scene.count(0, 3), scene.side()
    if kind == 0:
        return [Leaf("leaf0", side, side * width / 2, bottom + height / 2, width, height, 0.06)]
    if kind == 1:
        return [
            Leaf(f"leaf{n}", own, own * width / 2, bottom + height / 2, width / 2, height, 0.06)
            for n, own in enumerate((-1.0, 1.0))
        ]
    low = height * (scene.uniform(0.6, 0.72) if kind == 2 else scene.uniform(0.3, 0.4))
    high = height - low
    x = side * width / 2
    return [
        Leaf("leaf0", side, x, bottom + low / 2, width, low - 0.005, 0.06),
        Leaf("leaf1", side, x, bottom + low + high / 2, width, high - 0.005, 0.06),
    ]


def _add_neighbours(
    scene: SceneBuilder, size: tuple[float, float, float], bottom: float, fronts: str
) -> None:
    """More cupboards beside it, a worktop above or below it."""
    width, depth, height = size
    for side in (-1, 1):
        if scene.chance(0.4):
            place = (side * (width + 0.02), depth / 2 - 0.01, bottom + height / 2)
            scene.box(place, (width, depth + 0.02, height), fronts)
            add_handle(scene, side * width * 0.6, -0.02, bottom + height / 2, upright=True)
    if bottom < 0.5 and scene.chance(0.6):
        top = bottom + height + 0.04
        scene.box((0, depth / 2 - 0.03, top), (6, depth + 0.08, 0.05), scene.material())
        add_clutter(scene, 2, (-0.8, 0.8), (0.05, depth), top + 0.025, 0.25)
    elif bottom > 0.5 and scene.chance(0.7):
        top = min(0.85, bottom - 0.03)
        scene.box((0, depth / 2 - 0.1, top), (6, depth + 0.3, 0.05), scene.material())
        if bottom > 1:
            add_clutter(scene, 3, (-0.8, 0.8), (-0.1, depth), top + 0.025, 0.25)


def _add_kitchen(scene: SceneBuilder, width: float, depth: float) -> None:
    """A counter beside the refrigerator and notes on its door."""
    if scene.chance(0.5):
        side = scene.side()
        x = side * (width / 2 + 0.45)
        scene.box((x, depth / 2, 0.45), (0.8, depth, 0.9), scene.material())
        add_clutter(scene, 2, (x - 0.2, x + 0.2), (0.1, depth), 0.9, 0.3)


def _add_control_panel(
    scene: SceneBuilder,
    size: tuple[float, float, float],
    bottom: float,
    panel: float,
    finish: str,
) -> None:
    width, depth, height = size
    x = width / 2 - panel / 2
    scene.box((x, depth / 2, bottom + height / 2), (panel, depth - 0.002, height - 0.004), finish)
    clock = scene.material("dark", glow=0.1)
    scene.box((x, -0.004, bottom + height * 0.8), (panel * 0.7, 0.01, height * 0.12), clock)
    buttons = scene.material()
    for row in range(4):
        for column in (-1, 0, 1):
            place = (x + column * panel * 0.25, -0.004, bottom + height * (0.15 + 0.13 * row))
            scene.box(place, (panel * 0.16, 0.008, height * 0.08), buttons)
