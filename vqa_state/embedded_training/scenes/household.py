"""Things that are on or off, or hold something: light, display, handbag."""

import math

import numpy as np

from vqa_state.embedded_training.scenes.builder import SceneBuilder, Vector, hinge, slide
from vqa_state.embedded_training.scenes.parts import add_clutter, add_room
from vqa_state.embedded_training.scenes.poses import opening_facts
from vqa_state.embedded_training.scenes.simulation import (
    Blueprint,
    CameraRange,
    Facts,
    Pose,
    Simulation,
)

__all__ = ["build_display", "build_handbag", "build_light"]


def build_light(scene: SceneBuilder) -> Blueprint:
    """A ceiling, pendant or standing lamp in a room, in daylight or at night."""
    height, back = scene.uniform(2.3, 2.8), scene.uniform(1.5, 3)
    _add_closed_room(scene, height, back)
    add_clutter(scene, scene.count(1, 5), (-1.5, 1.5), (0.2, back - 0.3), 0, 0.9)
    x, y = scene.uniform(-0.5, 0.5), scene.uniform(-0.2, back * 0.6)
    shade = scene.material("white")
    z = _add_lamp(scene, shade, x, y, height)
    daylight = scene.chance(0.5)
    if daylight:
        window = scene.material("white", glow=scene.uniform(0.3, 0.8))
        size = (scene.uniform(0.5, 1), 0.03, scene.uniform(0.6, 1))
        scene.box((scene.uniform(-1, 1), back - 0.06, 1.4), size, window)
    scene.lamp("lamp", (x, y, z - 0.12))
    target = (x * 0.7, y * 0.8, z - scene.uniform(0.1, 0.7))
    camera = CameraRange(target, (65, 115), (-8, 30), (1.2, 2.4))
    return Blueprint(_switch_light(shade, daylight), camera)


def build_display(scene: SceneBuilder) -> Blueprint:
    """A monitor on a desk or a television on a wall."""
    width = scene.uniform(0.4, 1.2)
    height, wall = width * scene.uniform(0.54, 0.68), scene.uniform(0.25, 0.8)
    add_room(scene, wall)
    if scene.chance(0.4):
        bottom, y = scene.uniform(0.9, 1.4), wall - 0.05
    else:
        bottom, y = 0.75 + scene.uniform(0.08, 0.2), 0.1
        _add_desk(scene, bottom, width)
    case = scene.material("dark" if scene.chance(0.75) else "any")
    edge = scene.uniform(0.01, 0.035)
    middle = bottom + height / 2
    scene.box((0, y, middle), (width + 2 * edge, 0.04, height + 2 * edge), case)
    # The picture lies on the geom's own x-y plane, so the lit panel is made flat and put up.
    flat = (width / 2, height / 2, 0.002)
    upright = (math.pi / 2, 0.0, 0.0)
    panel = scene.screen()
    scene.geom("box", flat, panel, at=(0, y - 0.021, middle), turn=upright)
    with scene.body((0, y - 0.024, middle), slide("cover", "0 0 1")):
        scene.box((0, 0, 0), (width, 0.003, height), scene.material("dark"))
    distance = (width * 1.1 + 0.1, width * 2.2 + 0.2)
    camera = CameraRange((0, y, middle), (55, 125), (-25, 8), distance)
    return Blueprint(_switch_display(panel), camera)


def build_handbag(scene: SceneBuilder) -> Blueprint:
    """A bag on a table, seen from above; closed by a flap, or by its zip."""
    width, height = scene.uniforms((0.25, 0.42), (0.18, 0.32))
    depth, table = scene.uniforms((0.11, 0.19), (0.4, 0.9))
    add_room(scene, scene.uniform(0.3, 1.5))
    scene.table(table, y=0.2)
    add_clutter(scene, scene.count(0, 3), (-0.9, -width), (-0.2, 0.4), table, 0.25)
    add_clutter(scene, scene.count(0, 2), (width, 0.9), (-0.2, 0.4), table, 0.25)
    cloth = scene.material("cloth")
    has_flap = scene.chance(0.5)
    _add_bag(scene, (width, depth, height), table, cloth, has_flap)
    camera = CameraRange((0, 0, table + height * 0.6), (50, 130), (-58, -28), (0.6, 1.1))
    return Blueprint(_open_bag(depth, height, has_flap), camera)


def _add_closed_room(scene: SceneBuilder, height: float, back: float) -> None:
    wall = scene.material("wall")
    scene.box((0, 0, -0.05), (8, 8, 0.1), scene.material("floor"))
    scene.box((0, 0, height + 0.05), (8, 8, 0.1), scene.material("white"))
    scene.box((0, back, height / 2), (8, 0.1, height), wall)
    for side in (-1, 1):
        scene.box((side * scene.uniform(1.4, 2.6), 0, height / 2), (0.1, 8, height), wall)


def _add_lamp(scene: SceneBuilder, shade: str, x: float, y: float, ceiling: float) -> float:
    """Add a disc, a tube, a pendant or a standing lamp; return the height of its light."""
    kind = scene.count(0, 3)
    if kind == 0:
        z = ceiling - 0.04
        scene.geom("cylinder", (scene.uniform(0.15, 0.3), 0.04), shade, at=(x, y, z))
    elif kind == 1:
        z = ceiling - 0.05
        scene.box((x, y, z), (scene.uniform(0.5, 1.2), scene.uniform(0.1, 0.3), 0.06), shade)
    elif kind == 2:
        z = ceiling - scene.uniform(0.3, 0.8)
        scene.geom("ellipsoid", (0.15, 0.15, 0.12), shade, at=(x, y, z))
        scene.rod((x, y, z), (x, y, ceiling), 0.008, scene.material("dark"))
    else:
        z = scene.uniform(1.2, 1.5)
        scene.geom("cylinder", (scene.uniform(0.1, 0.2), 0.12), shade, at=(x, y, z))
        scene.geom("cylinder", (0.015, z / 2), scene.material("metal"), at=(x, y, z / 2))
    return z


def _switch_light(shade: str, daylight: bool) -> Pose:
    """A pose that makes the shade glow and the lamp shine, in front of daylight or none."""

    def pose(sim: Simulation, is_on: bool) -> Facts:
        strength = 0.0
        warm = (1.0, sim.uniform(0.85, 1), sim.uniform(0.65, 1))
        level = sim.uniform(0.2, 0.4) if daylight else sim.uniform(0.04, 0.18)
        sim.dim(sim.uniform(0.3, 0.7) if daylight else sim.uniform(0, 0.3))
        if is_on:
            strength = sim.uniform(0.35, 1)
            sim.paint(shade, warm, 0.4 + 0.6 * strength)
            sim.light("lamp", (strength, warm[1] * strength, warm[2] * strength))
            sim.ambient(level + sim.uniform(0.1, 0.3), sim.uniform(0, 0.2))
        else:
            sim.paint(shade, (sim.uniform(0.5, 0.85),) * 3, 0.0)
            sim.ambient(level, sim.uniform(0, 0.2))
        return {
            "degree": strength,
            "room_bright": float(strength > 0.6 or daylight),
            "daylight": float(daylight),
        }

    return pose


def _add_desk(scene: SceneBuilder, bottom: float, width: float) -> None:
    """A desk, the monitor's foot and things in front of it."""
    wood = scene.material("wood" if scene.chance(0.6) else "any")
    scene.box((0, 0.1, 0.72), (3, scene.uniform(0.8, 1.1), 0.05), wood)
    dark = scene.material("dark")
    scene.geom("cylinder", (width * 0.2, 0.01), dark, at=(0, 0.15, 0.76))
    scene.box((0, 0.15, (0.75 + bottom) / 2 + 0.05), (0.06, 0.03, bottom - 0.63), dark)
    add_clutter(scene, scene.count(0, 4), (-1, 1), (-0.3, 0), 0.75, 0.12)


def _switch_display(panel: str) -> Pose:
    """A pose that hides the lit panel behind a dark one, or takes the dark one far away."""

    def pose(sim: Simulation, is_on: bool) -> Facts:
        glow = sim.uniform(0.25, 1) if is_on else 0.0
        sim.move("cover", 100.0 if is_on else 0.0)
        sim.glow(panel, glow)
        return {"degree": glow, "picture_shown": float(is_on)}

    return pose


def _add_bag(scene: SceneBuilder, size: Vector, table: float, cloth: str, has_flap: bool) -> None:
    """Two walls that lean in or out, gussets between them, handles, things inside."""
    width, depth, height = size
    lining = scene.material("dark" if scene.chance(0.6) else "cloth")
    grips = cloth if scene.chance(0.5) else scene.material()
    scene.box((0, 0, table + 0.012), (width, depth, 0.024), cloth)
    for side, joint in ((-1.0, "front"), (1.0, "back")):
        with scene.body((0, side * depth / 2, table + 0.012), hinge(joint, "1 0 0")):
            scene.box((0, 0, height / 2), (width, 0.012, height), cloth)
            inner = (0.0, -side * 0.0075, height / 2)
            scene.box(inner, (width - 0.01, 0.002, height - 0.005), lining)
            if side < 0 and scene.chance(0.5):
                pocket = cloth if scene.chance(0.5) else scene.material("cloth")
                size = (width * scene.uniform(0.4, 0.8), 0.01, height * 0.4)
                scene.box((0, -0.008, height * 0.35), size, pocket)
            if not (has_flap and side < 0):
                _add_grip(scene, width, height, side, grips)
    gusset = (0.012, depth * 0.8, height * 0.8)
    scene.pair((0, 0, table + height * 0.4), width / 2, gusset, cloth)
    for _ in range(scene.count(1, 5)):
        x, y = scene.uniform(-width * 0.35, width * 0.35), scene.uniform(-depth * 0.2, depth * 0.2)
        wide, deep, share = scene.uniforms((0.03, 0.1), (0.02, 0.05), (0.3, 0.7))
        extent = (wide, deep, height * share)
        scene.box((x, y, table + height * 0.45), extent, scene.material())
    if has_flap:
        _add_flap(scene, size=(width, depth, height), table=table, cloth=cloth)
    else:
        _add_zip(scene, width, table + height)


def _add_grip(scene: SceneBuilder, width: float, height: float, side: float, finish: str) -> None:
    radius, arch = width * scene.uniform(0.22, 0.3), scene.uniform(0.6, 1.3)
    points = [
        (radius * math.cos(a), side * 0.004, height - 0.01 + radius * arch * math.sin(a))
        for a in np.linspace(0, math.pi, 8)
    ]
    scene.tube(points, 0.007, finish)


def _add_flap(scene: SceneBuilder, size: Vector, table: float, cloth: str) -> None:
    """A lid hinged at the back wall whose front end hangs over the front wall."""
    width, depth, height = size
    finish = cloth if scene.chance(0.5) else scene.material("cloth")
    hang = height * scene.uniform(0.3, 0.7)
    with scene.body((0, depth / 2, table + height + 0.017), hinge("lid", "1 0 0")):
        scene.box((0, -depth / 2, 0), (width * 1.01, depth + 0.03, 0.012), finish)
        with scene.body((0, -depth - 0.012, 0), hinge("tongue", "1 0 0")):
            scene.box((0, 0, -hang / 2), (width * 1.01, 0.012, hang), finish)
            scene.geom("sphere", (0.013,), scene.material("metal"), at=(0, -0.01, -hang * 0.8))


def _add_zip(scene: SceneBuilder, width: float, z: float) -> None:
    """A zip along the closed mouth; an open bag carries it away."""
    with scene.body((0, 0, z), slide("zip", "0 0 1")):
        metal = scene.material("metal" if scene.chance(0.6) else "dark")
        scene.box((0, 0, 0.002), (width * 0.98, 0.012, 0.008), metal)
        scene.rod((width * 0.4, -0.004, 0.0), (width * 0.4, -0.03, -0.02), 0.004, metal)


def _open_bag(depth: float, height: float, has_flap: bool) -> Pose:
    """A pose that throws the flap back, or leans the walls apart; closed walls meet above."""
    lean = math.asin(min(0.95, (depth / 2 - 0.004) / height))

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree = sim.degree(is_open)
        if has_flap:
            sim.move("front", sim.uniform(0, 0.2) if is_open else 0.0)
            sim.move("back", -sim.uniform(0, 0.1) if is_open else 0.0)
            sim.move("lid", -(0.7 + 2.3 * degree) if is_open else 0.0)
            sim.move("tongue", sim.uniform(0.6, 1.5) if is_open else 0.0)
        else:
            apart = 0.3 * degree - 0.06
            sim.move("front", apart if is_open else -lean * 0.98)
            sim.move("back", -apart if is_open else lean * 0.98)
            sim.move("zip", 100.0 if is_open else 0.0)
        facts = opening_facts(degree, visible_from=0.2)
        return {**facts, "flap_up": float(has_flap and is_open)}

    return pose
