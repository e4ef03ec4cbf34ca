"""Things that hold something: drawers, laptops, boxes and pots with lids, ovens."""

import math

from vqa_state.embedded_training.scenes.builder import SceneBuilder, hinge, slide
from vqa_state.embedded_training.scenes.parts import (
    add_carcass,
    add_clutter,
    add_clutter_beside,
    add_handle,
    add_items,
    add_room,
)
from vqa_state.embedded_training.scenes.poses import open_part, opening_facts
from vqa_state.embedded_training.scenes.simulation import (
    Blueprint,
    CameraRange,
    Facts,
    Pose,
    Simulation,
)

__all__ = ["build_box_lid", "build_drawer", "build_laptop", "build_oven"]


def build_drawer(scene: SceneBuilder) -> Blueprint:
    """A chest or a kitchen unit of one to five drawers."""
    width, depth = scene.uniforms((0.35, 0.9), (0.35, 0.5))
    rows, row_height = scene.count(1, 5), scene.uniform(0.12, 0.22)
    height, bottom = rows * row_height, scene.pick((0.05, 0.3, 0.7))
    add_room(scene, depth + scene.uniform(0.02, 0.4))
    outside = scene.material(scene.pick(("wood", "wood", "white", "any")))
    add_carcass(scene, (width, depth, height), bottom, outside, scene.material("dark"))
    fronts = outside if scene.chance(0.6) else scene.material()
    for row in range(rows):
        z = bottom + (row + 0.5) * row_height
        _add_drawer(scene, f"drawer{row}", (width, depth, row_height), z, fronts)
    top = bottom + height + 0.01
    add_clutter(scene, scene.count(0, 3), (-width / 2, width / 2), (0.1, depth), top, 0.25)
    middle = bottom + height / 2
    camera = CameraRange(
        (0, -0.1, middle), (50, 130), (-45, -8), (height + width + 0.4, 2 * height + width + 0.7)
    )
    return Blueprint(_pull(rows, depth), camera)


def build_laptop(scene: SceneBuilder) -> Blueprint:
    """A laptop on a desk, its screen lit or dark."""
    width, depth, desk = scene.uniforms((0.28, 0.4), (0.2, 0.28), (0.6, 0.9))
    add_room(scene, scene.uniform(0.5, 1.5))
    scene.table(desk, depth=scene.uniform(0.9, 1.4))
    case = scene.material(scene.pick(("metal", "dark", "white", "any")))
    scene.box((0, 0, desk + 0.009), (width, depth, 0.018), case)
    keys = scene.material("dark")
    scene.box((0, 0.02, desk + 0.019), (width * 0.88, depth * 0.45, 0.003), keys)
    scene.box((0, -depth * 0.33, desk + 0.019), (width * 0.3, depth * 0.22, 0.002), keys)
    screen = scene.screen()
    with scene.body((0, depth / 2, desk + 0.02), hinge("lid", "1 0 0")):
        # Made shut: the screen looks down at the keys.
        scene.box((0, -depth / 2, 0.006), (width, depth, 0.01), case)
        flat = (width * 0.46, depth * 0.43, 0.001)
        scene.geom("box", flat, screen, at=(0, -depth / 2, -0.0005))
        with scene.body((0, -depth / 2, -0.003), slide("cover", "1 0 0")):
            scene.box((0, 0, 0), (width * 0.93, depth * 0.87, 0.001), scene.material("dark"))
    add_clutter_beside(scene, width / 2 + 0.1, (-0.2, 0.4), desk, 0.18)
    camera = CameraRange((0, 0.05, desk + 0.08), (52, 128), (-50, -14), (0.6, 1.2))
    return Blueprint(_lift_screen(screen), camera)


def build_box_lid(scene: SceneBuilder) -> Blueprint:
    """A box with a hinged lid, or a pot whose lid lies on it or is held beside it."""
    table = scene.uniform(0.4, 0.9)
    add_room(scene, scene.uniform(0.5, 1.5))
    scene.table(table)
    add_clutter_beside(scene, 0.4, (-0.2, 0.5), table, 0.25)
    pose, height = _add_pot(scene, table) if scene.chance(0.4) else _add_box(scene, table)
    camera = CameraRange((0, 0, table + height * 0.7), (50, 130), (-55, -18), (0.6, 1.2))
    return Blueprint(pose, camera)


def build_oven(scene: SceneBuilder) -> Blueprint:
    """A kitchen oven whose front, mostly with a window, folds down by up to 92 degrees."""
    width, height, depth = 0.6, scene.uniform(0.45, 0.6), scene.uniform(0.5, 0.6)
    bottom = scene.pick((0.12, 0.12, 0.6))
    add_room(scene, depth + 0.03)
    outside = scene.material(scene.pick(("white", "metal", "dark", "any")))
    inside = scene.material("dark", glow=scene.uniform(0, 0.3))
    add_carcass(scene, (width, depth, height), bottom, outside, inside, board=0.03)
    for row in range(scene.count(1, 3)):
        shelf = (width - 0.06, depth - 0.05, 0.008)
        z = bottom + height * (0.25 + 0.25 * row)
        scene.box((0, depth / 2, z), shelf, scene.material("metal"))
    _add_row(scene, width, depth, bottom + height)
    front = outside if scene.chance(0.6) else scene.material("dark")
    with scene.body((0, -0.02, bottom), hinge("front", "1 0 0")):
        scene.box((0, 0, height / 2), (width - 0.01, 0.03, height - 0.01), front)
        if scene.chance(0.85):
            pane = (width * 0.7, 0.004, height * 0.5)
            for face in (-1, 1):
                scene.box((0, face * 0.017, height * 0.48), pane, scene.material("dark"))
        add_handle(scene, 0, -0.015, height * 0.9, upright=False, length=width * 0.6)
    camera = CameraRange((0, -0.1, bottom + height * 0.5), (52, 128), (-35, -6), (1.1, 2.2))
    return Blueprint(open_part("front", lambda _, degree: 1.6 * degree, turns=True), camera)


def _add_drawer(
    scene: SceneBuilder, joint: str, size: tuple[float, float, float], z: float, finish: str
) -> None:
    """A front and, behind it, an open tray with things in it."""
    width, depth, height = size
    with scene.body((0, 0, z), slide(joint, "0 -1 0")):
        scene.box((0, -0.012, 0), (width - 0.006, 0.024, height - 0.008), finish)
        add_handle(scene, 0, -0.024, 0, upright=False, length=min(0.14, width * 0.3))
        tray, floor = scene.material("wood"), -height * 0.38
        scene.box((0, depth / 2, floor), (width - 0.06, depth - 0.04, 0.01), tray)
        scene.box((0, depth - 0.03, floor / 2), (width - 0.06, 0.01, height * 0.6), tray)
        wall = (0.01, depth - 0.04, height * 0.6)
        scene.pair((0, depth / 2, floor / 2), width / 2 - 0.03, wall, tray)
        add_items(scene, width * 0.8, depth, floor, scene.count(0, 4), height * 0.5)


def _pull(rows: int, depth: float) -> Pose:
    """A pose that pulls one drawer or two out."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degrees = [sim.uniform(0, 0.006)] * rows
        if is_open:
            for _ in range(1 if sim.chance(0.7) else 2):
                degrees[sim.count(0, rows - 1)] = sim.degree(is_open)
        for row, degree in enumerate(degrees):
            sim.move(f"drawer{row}", degree * depth * 0.85)
        return opening_facts(max(degrees) if is_open else 0.0)

    return pose


def _lift_screen(screen: str) -> Pose:
    """A pose that lifts the lid by up to 130 degrees and lights the screen or not."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree, lit = sim.degree(is_open), sim.chance(0.6)
        sim.move("lid", -2.27 * degree)
        sim.move("cover", 0.0 if is_open and not lit else 100.0)
        sim.glow(screen, sim.uniform(0.4, 1) if lit and is_open else 0.0)
        facts = opening_facts(degree, turns=True)
        return {**facts, "screen_lit": float(lit)} if degree > 0.3 else facts

    return pose


def _add_pot(scene: SceneBuilder, table: float) -> tuple[Pose, float]:
    """A pot or jar with a lid of its own."""
    radius, height = scene.uniforms((0.08, 0.17), (0.08, 0.24))
    finish = scene.material(scene.pick(("metal", "any", "white")))
    n_sides = 20
    for number in range(n_sides):
        angle = 2 * math.pi * number / n_sides
        place = (radius * math.cos(angle), radius * math.sin(angle), table + height / 2)
        half = (radius * 3.3 / n_sides, 0.004, height / 2)
        scene.geom("box", half, finish, at=place, turn=(0, 0, angle + math.pi / 2))
    filling = table + height * scene.uniform(0.1, 0.75)
    scene.geom("cylinder", (radius * 0.98, 0.004), scene.material(), at=(0, 0, filling))
    for side in (-1, 1):
        scene.geom("sphere", (0.02,), finish, at=(side * (radius + 0.015), 0, table + height * 0.8))
    lid = finish if scene.chance(0.6) else scene.material()
    with scene.body(
        (0, 0, table + height + 0.006), slide("lid_x", "1 0 0") + slide("lid_z", "0 0 1")
    ):
        scene.geom("cylinder", (radius * 1.04, 0.006), lid, at=(0, 0, 0))
        scene.geom("sphere", (0.018,), scene.material("dark"), at=(0, 0, 0.025))
    return _take_off(radius, height, scene.side()), height


def _take_off(radius: float, height: float, side: float) -> Pose:
    """A pose that pushes the lid aside, or lays it down beside the pot."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree = sim.degree(is_open)
        beside = degree > 0.6
        sim.move("lid_x", side * (2.2 * radius if beside else 1.7 * radius * degree))
        sim.move("lid_z", -height if beside else 0.002 * degree)
        return opening_facts(degree)

    return pose


def _add_box(scene: SceneBuilder, table: float) -> tuple[Pose, float]:
    """A box of boards or card, its lid hinged at the back."""
    width, depth, height = scene.uniforms((0.2, 0.45), (0.15, 0.32), (0.08, 0.28))
    outside = scene.material(scene.pick(("wood", "cloth", "any", "white")))
    inside = outside if scene.chance(0.4) else scene.material()
    scene.box((0, 0, table + 0.006), (width, depth, 0.012), inside)
    for side in (-1, 1):
        place = (side * width / 2, 0.0, table + height / 2)
        scene.box(place, (0.012, depth, height), outside)
        scene.box((0, side * depth / 2, table + height / 2), (width, 0.012, height), outside)
    for _ in range(scene.count(0, 4)):
        x, y = scene.uniform(-width * 0.35, width * 0.35), scene.uniform(-depth * 0.3, depth * 0.3)
        size = (scene.uniform(0.03, 0.1), scene.uniform(0.03, 0.08), height * 0.6)
        scene.box((x, y, table + height * 0.35), size, scene.material())
    with scene.body((0, depth / 2, table + height + 0.006), hinge("lid", "1 0 0")):
        lid = outside if scene.chance(0.7) else scene.material()
        scene.box((0, -depth / 2, 0), (width + 0.02, depth + 0.02, 0.012), lid)
        if scene.chance(0.5):
            scene.box((0, -depth - 0.012, -0.015), (0.05, 0.008, 0.04), scene.material("metal"))
    return open_part("lid", lambda _, degree: -2.1 * degree, turns=True), height


def _add_row(scene: SceneBuilder, width: float, depth: float, top: float) -> None:
    """Knobs above the oven and cupboards beside it."""
    panel = scene.material(scene.pick(("metal", "dark", "white")))
    scene.box((0, depth / 2, top + 0.05), (width, depth, 0.1), panel)
    for number in range(scene.count(2, 6)):
        place = (-width * 0.4 + number * 0.1, -0.015, top + 0.05)
        scene.geom("sphere", (0.018,), scene.material("dark"), at=place)
    unit = scene.material()
    for side in (-1, 1):
        if scene.chance(0.8):
            x = side * (width + 0.02)
            scene.box((x, depth / 2, (top + 0.1) / 2), (width, depth, top + 0.1), unit)
            add_handle(scene, x, 0, top - 0.05, upright=False)
    if top < 1:
        counter = (2.2, depth + 0.03, 0.04)
        scene.box((0, depth / 2, top + 0.12), counter, scene.material())
        add_clutter(scene, scene.count(0, 4), (-0.9, 0.9), (0.1, depth), top + 0.14, 0.25)
