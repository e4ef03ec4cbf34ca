"""Parts that several things are made of: rooms, boxes with an open front, leaves, handles."""

from dataclasses import dataclass

from vqa_state.embedded_training.scenes.builder import SceneBuilder, Vector, hinge
from vqa_state.embedded_training.scenes.simulation import Range

__all__ = [
    "Leaf",
    "add_carcass",
    "add_clutter",
    "add_clutter_beside",
    "add_handle",
    "add_items",
    "add_leaf",
    "add_room",
    "add_wall_with_opening",
]

#: Rooms reach this far to either side, beyond what any camera sees.
_FAR = 14.0


@dataclass(frozen=True, slots=True)
class Leaf:
    """A hinged front. `side` is where its hinge is: -1 left, +1 right."""

    joint: str
    side: float
    hinge_x: float
    centre_z: float
    width: float
    height: float
    thickness: float = 0.03


def add_clutter(
    scene: SceneBuilder, n_things: int, x: Range, y: Range, z: float, scale: float
) -> None:
    """Stand boxes, cylinders and bowls on a surface at height `z`; the largest is `scale` high."""
    for _ in range(n_things):
        at_x, at_y = scene.uniform(*x), scene.uniform(*y)
        height, finish = scene.uniform(0.3, 1) * scale, scene.material()
        kind = scene.count(0, 2)
        if kind == 0:
            width, depth = height * scene.uniform(0.4, 1.2), height * scene.uniform(0.4, 1.2)
            place = (at_x, at_y, z + height / 2)
            scene.box(place, (width, depth, height), finish, turn=scene.uniform(0.01, 3))
        elif kind == 1:
            radius = height * scene.uniform(0.15, 0.4)
            scene.geom("cylinder", (radius, height / 2), finish, at=(at_x, at_y, z + height / 2))
        else:
            extent = (height * 0.4, height * 0.4, height / 3)
            scene.geom("ellipsoid", extent, finish, at=(at_x, at_y, z + height / 3))


def add_clutter_beside(
    scene: SceneBuilder, gap: float, y: Range, z: float, scale: float, reach: float = 0.9
) -> None:
    """Stand up to three things to the left of -`gap`, and up to three to the right of `gap`."""
    for x in ((-reach, -gap), (gap, reach)):
        add_clutter(scene, scene.count(0, 3), x, y, z, scale)


def add_items(
    scene: SceneBuilder, width: float, depth: float, z: float, n: int, top: float
) -> None:
    """Put food, cups and boxes on a shelf at height `z`, none higher than `top`."""
    for _ in range(n):
        x, y = scene.uniform(-width * 0.42, width * 0.42), scene.uniform(0.05, depth * 0.8)
        height, finish = scene.uniform(0.3, 0.9) * top, scene.material()
        kind = scene.count(0, 2)
        if kind == 0:
            size = (scene.uniform(0.04, 0.14), scene.uniform(0.04, 0.1), height)
            scene.box((x, y, z + height / 2), size, finish)
        elif kind == 1:
            extent = (scene.uniform(0.02, 0.06), height / 2)
            scene.geom("cylinder", extent, finish, at=(x, y, z + height / 2))
        else:
            scene.geom("sphere", (min(0.05, height / 2),), finish, at=(x, y, z + 0.05))


def add_room(scene: SceneBuilder, wall_y: float) -> None:
    """Floor, a back wall with things on it, and sometimes a side wall."""
    scene.box((0, 0, -0.05), (_FAR, _FAR, 0.1), scene.material("floor"))
    scene.box((0, wall_y + 0.05, 2.0), (_FAR, 0.1, 6), scene.material("wall"))
    if scene.chance(0.4):
        x = scene.side() * scene.uniform(1.5, 3.5)
        scene.box((x, 0, 2), (0.1, _FAR, 6), scene.material("wall"))
    for _ in range(scene.count(0, 3)):
        place = (scene.uniform(-2, 2), wall_y - 0.01, scene.uniform(0.9, 2.2))
        size = (scene.uniform(0.1, 0.8), 0.03, scene.uniform(0.1, 0.7))
        scene.box(place, size, scene.material(glow=scene.pick((0.0, 0.0, 0.5))))


def add_wall_with_opening(scene: SceneBuilder, width: float, height: float, depth: float) -> None:
    """A wall at y = 0 with a doorway, mostly framed, and a room in front of it."""
    wall = scene.material("wall")
    scene.pair((0, 0, 1.5), width / 2 + 3, (6, depth, 3), wall)
    scene.box((0, 0, (height + 3) / 2), (width, depth, 3 - height), wall)
    scene.box((0, 0, -0.05), (_FAR, 16, 0.1), scene.material("floor"))
    if scene.chance(0.85):
        _add_frame(scene, width, height, depth)
    if scene.chance(0.5):
        place = (scene.side() * scene.uniform(1, 1.6), -depth / 2 - 0.02, scene.uniform(1, 1.7))
        scene.box(place, (scene.uniform(0.1, 0.6), 0.03, scene.uniform(0.1, 0.6)), scene.material())
    if scene.chance(0.5):
        place = (scene.side() * (width / 2 + 0.22), -depth / 2 - 0.01, 1.1)
        scene.box(place, (0.08, 0.015, 0.1), scene.material("white"))


def _add_frame(scene: SceneBuilder, width: float, height: float, depth: float) -> None:
    finish, bar = scene.material(scene.pick(("white", "wood", "any"))), scene.uniform(0.04, 0.13)
    post = (bar, depth + 0.04, height + bar)
    scene.pair((0, 0, height / 2), width / 2 + bar / 2 - 0.01, post, finish)
    scene.box((0, 0, height + bar / 2), (width + 2 * bar, depth + 0.04, bar), finish)


def add_handle(
    scene: SceneBuilder, x: float, y: float, z: float, *, upright: bool, length: float = 0.12
) -> None:
    """A knob, a bar, a block or a lever on the face at `y`, standing out away from y = 0."""
    finish = scene.material("metal" if scene.chance(0.7) else "any")
    out = -1.0 if y < 0 else 1.0
    kind = scene.count(0, 3)
    if kind == 0:
        scene.geom("sphere", (0.028,), finish, at=(x, y + out * 0.03, z))
    elif kind == 1:
        reach = (0.0, length / 1.5) if upright else (length * 0.6, 0.0)
        start = (x - reach[0], y + out * 0.035, z - reach[1])
        end = (x + reach[0] + 1e-3, y + out * 0.035, z + reach[1])
        scene.rod(start, end, 0.009, finish)
    elif kind == 2:
        size = (0.025, 0.04, length * 1.3) if upright else (length, 0.04, 0.025)
        scene.box((x, y + out * 0.02, z), size, finish)
    else:
        inwards = -1.0 if x > 0 else 1.0
        scene.rod((x, y, z), (x, y + out * 0.05, z), 0.012, finish)
        scene.rod((x, y + out * 0.05, z), (x + inwards * length, y + out * 0.05, z), 0.01, finish)


def add_carcass(
    scene: SceneBuilder, size: Vector, bottom: float, outside: str, inside: str, board: float = 0.02
) -> None:
    """A box of (width, depth, height) without a front, its opening at y = 0."""
    width, depth, height = size
    middle = bottom + height / 2
    scene.box((0, depth, middle), (width, board, height), inside)
    for side in (-1, 1):
        scene.box((side * width / 2, depth / 2, middle), (board, depth, height), outside)
        lining = (board / 2, depth - 0.01, height - 0.01)
        scene.box((side * (width / 2 - board), depth / 2, middle), lining, inside)
    for z in (bottom, bottom + height):
        scene.box((0, depth / 2, z), (width, depth, board), outside)
    scene.box((0, depth / 2, bottom + board), (width - board, depth - 0.01, board / 2), inside)


def add_leaf(
    scene: SceneBuilder,
    leaf: Leaf,
    finish: str,
    *,
    front: str = "flat",
    bar: bool = False,
    handle_z: float | None = None,
) -> None:
    """A hinged front that closes flush with y = 0. `front` is flat, panel or window."""
    thick, width, height = leaf.thickness, leaf.width, leaf.height
    centre_x = -leaf.side * width / 2
    handle_x = -leaf.side * (width - min(0.05, width * 0.1))
    z = handle_z if handle_z is not None else scene.uniform(-0.2, 0.2) * height
    with scene.body((leaf.hinge_x, -thick / 2, leaf.centre_z), hinge(leaf.joint)):
        scene.box((centre_x, 0, 0), (width - 0.004, thick, height - 0.004), finish)
        if front == "panel":
            inset = finish if scene.chance(0.5) else scene.material()
            scene.box((centre_x, -thick / 2, 0), (width * 0.7, 0.012, height * 0.75), inset)
        elif front == "window":
            for face in (-1, 1):
                place = (centre_x, face * (thick / 2 + 0.002), 0.0)
                scene.box(place, (width * 0.72, 0.004, height * 0.6), scene.material("dark"))
        if bar:
            _add_bar(scene, handle_x, -thick / 2 - 0.04, z, height)
        else:
            grip = min(0.12, height * 0.3)
            add_handle(scene, handle_x, -thick / 2, z, upright=scene.chance(0.6), length=grip)


def _add_bar(scene: SceneBuilder, x: float, y: float, z: float, height: float) -> None:
    finish = scene.material("metal" if scene.chance(0.6) else "any")
    low, high = z - height * scene.uniform(0.1, 0.4), z + height * scene.uniform(0.1, 0.35)
    scene.rod((x, y, low), (x, y, high), 0.011, finish)
