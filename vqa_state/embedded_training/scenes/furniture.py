"""Boxes with hinged fronts: cabinets, refrigerators, microwaves."""

from vqa_state.embedded_training.scenes.builder import SceneBuilder, slide
from vqa_state.embedded_training.scenes.parts import (
    Leaf,
    add_carcass,
    add_clutter,
    add_clutter_beside,
    add_handle,
    add_items,
    add_leaf,
    add_room,
)
from vqa_state.embedded_training.scenes.poses import open_part, swing_leaves
from vqa_state.embedded_training.scenes.simulation import Blueprint, CameraRange, Pose

__all__ = ["build_cabinet", "build_microwave", "build_refrigerator"]


def build_cabinet(scene: SceneBuilder) -> Blueprint:
    """A cupboard with one or two leaves or sliding fronts, on the floor or on the wall."""
    width, height, depth = scene.uniforms((0.4, 1), (0.4, 1.1), (0.3, 0.5))
    bottom = scene.pick((0.05, 0.9, 1.4))
    add_room(scene, depth + 0.02)
    outside = scene.material(scene.pick(("wood", "wood", "white", "any")))
    inside = outside if scene.chance(0.4) else scene.material(scene.pick(("wood", "white", "any")))
    add_carcass(scene, (width, depth, height), bottom, outside, inside)
    _add_shelves(scene, (width, depth, height), bottom, inside)
    fronts = outside if scene.chance(0.6) else scene.material()
    if scene.chance(0.25):
        pose = _add_sliding_fronts(scene, width, height, bottom, fronts)
    else:
        pose = _add_cabinet_leaves(scene, width, height, bottom, fronts)
    _add_neighbours(scene, (width, depth, height), bottom, fronts)
    camera = CameraRange(
        (0, 0, bottom + height / 2), (50, 130), (-25, 12), (height * 1.3 + 0.3, height * 2.6 + 0.4)
    )
    return Blueprint(pose, camera)


def build_refrigerator(scene: SceneBuilder) -> Blueprint:
    """One door, a door and a freezer, or two doors side by side, with food on the shelves."""
    width, height, depth = scene.uniforms((0.55, 0.9), (1.3, 1.9), (0.55, 0.7))
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
    return Blueprint(swing_leaves([leaf.side for leaf in leaves], 2.1), camera)


def build_microwave(scene: SceneBuilder) -> Blueprint:
    """A microwave oven on a counter, its door hinged on the left."""
    width, height, depth = scene.uniforms((0.42, 0.56), (0.25, 0.34), (0.3, 0.4))
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
    add_clutter_beside(scene, width / 2 + 0.15, (-0.1, depth), bottom, 0.25, reach=1)
    camera = CameraRange((0, 0, bottom + height / 2), (52, 128), (-35, 2), (0.65, 1.3))
    return Blueprint(swing_leaves([leaf.side], 2.1), camera)


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
    if scene.chance(0.6):
        leaves = _pair_of_leaves(width, height, bottom)
    else:
        side = scene.side()
        leaves = [Leaf("leaf0", side, side * width / 2, bottom + height / 2, width, height)]
    style = "panel" if scene.chance(0.5) else "flat"
    for leaf in leaves:
        add_leaf(scene, leaf, finish, front=style)
    return swing_leaves([leaf.side for leaf in leaves], 2.2)


def _pair_of_leaves(
    width: float, height: float, bottom: float, thickness: float = 0.03
) -> list[Leaf]:
    """Two leaves that meet in the middle."""
    return [
        Leaf(f"leaf{n}", side, side * width / 2, bottom + height / 2, width / 2, height, thickness)
        for n, side in enumerate((-1.0, 1.0))
    ]


def _add_sliding_fronts(
    scene: SceneBuilder, width: float, height: float, bottom: float, finish: str
) -> Pose:
    """Two fronts on two tracks, of which one moves, or one before half of a fixed wall."""
    middle, side = bottom + height / 2, scene.side()
    panel = (width / 2 + 0.015, 0.018, height - 0.01)
    fixed = finish if scene.chance(0.7) else scene.material()
    scene.box((-side * width / 4, -0.012, middle), panel, fixed)
    with scene.body((side * width / 4, -0.034, middle), slide("front")):
        scene.box((0, 0, 0), panel, finish)
        grip = side * width * scene.pick((0.18, -0.18))
        add_handle(scene, grip, -0.009, 0, upright=True, length=min(0.15, height * 0.3))
    return open_part("front", lambda _, degree: -side * degree * width * 0.48, turns=False)


def _refrigerator_leaves(
    scene: SceneBuilder, width: float, height: float, bottom: float
) -> list[Leaf]:
    """Full height, freezer above, freezer below, or side by side: equally often."""
    kind, side = scene.count(0, 3), scene.side()
    if kind == 0:
        return [Leaf("leaf0", side, side * width / 2, bottom + height / 2, width, height, 0.06)]
    if kind == 1:
        return _pair_of_leaves(width, height, bottom, 0.06)
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
    scene: SceneBuilder, size: tuple[float, float, float], bottom: float, panel: float, finish: str
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
