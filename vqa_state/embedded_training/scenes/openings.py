"""Openings in walls and fences: windows, curtains, gates."""

import math

from vqa_state.embedded_training.scenes.builder import SceneBuilder, Vector, hinge, slide
from vqa_state.embedded_training.scenes.parts import add_clutter, add_handle
from vqa_state.embedded_training.scenes.poses import open_part, opening_facts, swing_leaves
from vqa_state.embedded_training.scenes.simulation import (
    Blueprint,
    CameraRange,
    Facts,
    Pose,
    Simulation,
)

__all__ = ["build_curtain", "build_gate", "build_window"]


def build_window(scene: SceneBuilder) -> Blueprint:
    """A window in a wall that swings into the room or slides, daylight behind it."""
    width, height, sill = scene.uniforms((0.6, 1.4), (0.7, 1.4), (0.7, 1))
    _add_window_wall(scene, width, height, sill)
    two, slides = scene.chance(0.5), scene.chance(0.35)
    middle, leaf_width = sill + height / 2, width / 2 if two or slides else width
    if slides:
        _add_sash(scene, (-width / 4, 0.0, middle), leaf_width, height)
        with scene.body((width / 4, -0.04, middle), slide("leaf0")):
            _add_sash(scene, (0, 0, 0), leaf_width, height)
        pose = open_part("leaf0", lambda _, degree: -degree * leaf_width, turns=False)
    else:
        sides = (-1.0, 1.0) if two else (scene.side(),)
        for number, side in enumerate(sides):
            with scene.body((side * width / 2, -0.03, middle), hinge(f"leaf{number}")):
                _add_sash(scene, (-side * leaf_width / 2, 0, 0), leaf_width, height)
                grip = (-side * (leaf_width - 0.04), -0.025, 0.0)
                add_handle(scene, *grip, upright=True, length=0.1)
        pose = swing_leaves(sides, 1.9, play=0.01, together=0.6)
    camera = CameraRange((0, 0, middle), (52, 128), (-15, 10), (1.3, 2.8))
    return Blueprint(pose, camera)


def build_curtain(scene: SceneBuilder) -> Blueprint:
    """Curtains before a window: two that part, or one that is drawn aside."""
    width, height, sill = scene.uniforms((0.9, 1.8), (0.9, 1.5), (0.5, 0.9))
    _add_window_wall(scene, width, height, sill)
    _add_sash(scene, (0, 0, sill + height / 2), width, height)
    drop = height + scene.uniform(0.15, 0.6)
    top, two = sill + height + 0.12, scene.chance(0.7)
    bottom = max(0.05, top - drop)
    rail = scene.material("metal" if scene.chance(0.6) else "wood")
    scene.rod((-width * 0.75, -0.13, top), (width * 0.75, -0.13, top), 0.014, rail)
    cloth = scene.material("cloth")
    sides = (-1.0, 1.0) if two else (scene.side(),)
    folds = scene.count(7, 12)
    reach = width * (0.62 if two else 1.2)
    for number in range(len(sides)):
        for fold in range(folds):
            with scene.body((0, -0.13, 0), slide(f"fold{number}_{fold}")):
                _add_fold(scene, cloth, bottom, top, reach / folds)
    camera = CameraRange((0, 0, (top + bottom) / 2), (60, 120), (-12, 8), (1.7, 3.2))
    return Blueprint(_draw_apart(sides, folds, reach, width), camera)


def build_gate(scene: SceneBuilder) -> Blueprint:
    """A gate of planks or bars in a garden fence."""
    width, height = scene.uniform(0.9, 1.6), scene.uniform(0.8, 1.5)
    scene.box((0, 0, -0.05), (40, 40, 0.1), scene.material("floor"))
    path = (width, 30, 0.01)
    scene.box((0, 0, 0.004), path, scene.material("floor"))
    wood = scene.material("wood" if scene.chance(0.6) else "metal")
    for side in (-1.0, 1.0):
        post = (side * (width / 2 + 0.06), 0.0, height * 0.55)
        scene.box(post, (0.1, 0.1, height * 1.1), wood)
        _add_planks(scene, (side * (width / 2 + 1.6), 0, 0), 3, height, wood)
    add_clutter(scene, scene.count(1, 4), (-2.5, 2.5), (1, 4), 0, 1.3)
    two = scene.chance(0.35)
    leaf_width = width / 2 if two else width
    sides = (-1.0, 1.0) if two else (scene.side(),)
    finish = wood if scene.chance(0.5) else scene.material()
    for number, side in enumerate(sides):
        with scene.body((side * width / 2, 0, 0), hinge(f"leaf{number}")):
            centre = -side * leaf_width / 2
            _add_planks(scene, (centre, 0, 0.05), leaf_width - 0.02, height - 0.1, finish)
            add_handle(scene, -side * (leaf_width - 0.08), -0.04, height * 0.6, upright=False)
    camera = CameraRange((0, 0, height * 0.5), (52, 128), (-25, 0), (2.0, 4.0))
    direction = scene.side()
    pose = swing_leaves(
        [direction * side for side in sides],
        math.radians(105),
        play=0.01,
        together=0.7,
        passable_from=0.4,
    )
    return Blueprint(pose, camera)


def _add_window_wall(scene: SceneBuilder, width: float, height: float, sill: float) -> None:
    """A wall with a hole, a frame, a floor and a bright view outside."""
    wall, top = scene.material("wall"), sill + height
    scene.pair((0, 0.03, 1.5), width / 2 + 3, (6, 0.12, 3), wall)
    scene.box((0, 0.03, sill / 2), (width, 0.12, sill), wall)
    scene.box((0, 0.03, (top + 3) / 2), (width, 0.12, max(0.1, 3 - top)), wall)
    scene.box((0, -4, -0.05), (14, 8.2, 0.1), scene.material("floor"))
    frame, bar = scene.material(scene.pick(("white", "wood"))), scene.uniform(0.03, 0.07)
    for side in (-1, 1):
        place = (side * (width / 2 + bar / 2), -0.01, sill + height / 2)
        scene.box(place, (bar, 0.16, height + 2 * bar), frame)
        edge = (0.0, -0.01, sill - bar / 2 if side < 0 else top + bar / 2)
        scene.box(edge, (width, 0.16, bar), frame)
    for distance in (8.0, 5.0):
        if scene.chance(0.7):
            view = scene.material("any", glow=scene.uniform(0.2, 0.7))
            high = scene.uniform(0.5, 2.2)
            scene.box((scene.uniform(-2, 2), distance, high / 2), (distance, 0.1, high), view)
    add_clutter(scene, scene.count(0, 2), (-1.5, 1.5), (-0.9, -0.4), 0, 0.5)


def _add_sash(scene: SceneBuilder, at: Vector, width: float, height: float) -> None:
    """A pane with bars around it, at times a cross."""
    x, y, z = at
    frame, bar = scene.material(scene.pick(("white", "wood"))), scene.uniform(0.03, 0.06)
    pane = scene.material("white", alpha=scene.uniform(0.12, 0.3))
    scene.box((x, y, z), (width - bar, 0.006, height - bar), pane)
    for side in (-1, 1):
        scene.box((x + side * (width - bar) / 2, y, z), (bar, 0.035, height), frame)
        scene.box((x, y, z + side * (height - bar) / 2), (width, 0.035, bar), frame)
    if scene.chance(0.4):
        scene.box((x, y, z), (width, 0.025, 0.025), frame)


def _add_fold(scene: SceneBuilder, cloth: str, bottom: float, top: float, pitch: float) -> None:
    """One fold: a flat upright ellipsoid."""
    extent = (pitch * 0.62, scene.uniform(0.025, 0.045), (top - bottom) / 2)
    scene.geom("cylinder", (pitch * 0.45, extent[2]), cloth, at=(0, 0, (top + bottom) / 2))
    scene.box((pitch / 2, 0.01, (top + bottom) / 2), (pitch, 0.012, top - bottom), cloth)


def _add_planks(scene: SceneBuilder, at: Vector, width: float, height: float, finish: str) -> None:
    """Upright planks or bars on two rails."""
    x, y, z = at
    pitch = scene.uniform(0.09, 0.16)
    share = scene.uniform(0.25, 0.92)
    n_planks = max(3, round(width / pitch))
    for number in range(n_planks):
        place = (x + width * ((number + 0.5) / n_planks - 0.5), y, z + height / 2)
        scene.box(place, (width / n_planks * share, 0.02, height), finish)
    for level in (0.2, 0.8):
        scene.box((x, y + 0.02, z + height * level), (width, 0.03, 0.07), finish)


def _draw_apart(sides: tuple[float, ...], folds: int, reach: float, width: float) -> Pose:
    """A pose that pushes all folds to their own sides, or spreads them over the window."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree = sim.degree(is_open)
        for number, side in enumerate(sides):
            outer = side * (width * 0.6 + 0.02)
            room = reach * (1 - 0.82 * degree)
            for fold in range(folds):
                x = outer - side * room * (fold + 0.5) / folds
                sim.move(f"fold{number}_{fold}", x)
        facts = opening_facts(degree, turns=False)
        return {**facts, "daylight": float(degree > 0.25)}

    return pose
