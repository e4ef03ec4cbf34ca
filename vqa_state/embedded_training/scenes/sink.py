"""A sink with a faucet: water runs, or does not."""

import math

import numpy as np

from vqa_state.embedded_training.scenes.builder import SceneBuilder, Vector, slide
from vqa_state.embedded_training.scenes.parts import add_clutter_beside, add_room
from vqa_state.embedded_training.scenes.simulation import (
    Blueprint,
    CameraRange,
    Facts,
    Pose,
    Simulation,
)

__all__ = ["build_water"]


def build_water(scene: SceneBuilder) -> Blueprint:
    """A sink in a counter, a faucet over it and a stream that can be taken away."""
    counter = scene.uniform(0.8, 1)
    width, depth, bowl = scene.uniforms((0.4, 0.7), (0.3, 0.45), (0.1, 0.18))
    add_room(scene, depth / 2 + scene.uniform(0.1, 0.3))
    _add_sink(scene, width, depth, bowl, counter)
    add_clutter_beside(scene, width / 2 + 0.08, (-0.1, 0.2), counter, 0.2)
    outlet = _add_faucet(scene, depth, counter)
    floor = counter - bowl + 0.01
    # Water that stands in the sink says nothing about the faucet, so it is there in both states.
    level = floor + (scene.uniform(0.005, 0.05) if scene.chance(0.4) else 0.0)
    if level > floor:
        water = scene.material("white", alpha=0.4)
        scene.box((0, 0, level), (width - 0.01, depth - 0.01, 0.004), water)
    with scene.body((0, 0, 0), slide("stream", "0 0 1")):
        strength = _add_stream(scene, outlet, level)
    target = (outlet[0], outlet[1], (counter + outlet[2] - bowl) / 2)
    return Blueprint(_turn_tap(strength), CameraRange(target, (55, 125), (-35, -8), (0.45, 0.9)))


def _turn_tap(strength: float) -> Pose:
    """A pose that leaves the stream where it is, or takes it far away."""

    def pose(sim: Simulation, runs: bool) -> Facts:
        sim.move("stream", 0.0 if runs else -50.0)
        return {"degree": strength if runs else 0.0, "splash": float(runs)}

    return pose


def _add_sink(scene: SceneBuilder, width: float, depth: float, bowl: float, counter: float) -> None:
    finish = scene.material(scene.pick(("white", "metal")))
    top = scene.material()
    scene.box((0, 0, counter - bowl), (width, depth, 0.01), finish)
    for side in (-1, 1):
        wall = counter - bowl / 2
        scene.box((side * width / 2, 0, wall), (0.012, depth, bowl), finish)
        scene.box((0, side * depth / 2, wall), (width, 0.012, bowl), finish)
        place = (side * (width / 2 + 0.6), 0.0, counter - 0.01)
        scene.box(place, (1.2, depth + 0.5, 0.03), top)
        scene.box((0, side * (depth / 2 + 0.12), counter - 0.01), (width, 0.24, 0.03), top)
    scene.box((0, -depth / 2 - 0.24, counter / 2 - 0.05), (3, 0.05, counter), scene.material())
    drain = (0, 0, counter - bowl + 0.006)
    scene.geom("cylinder", (0.025, 0.002), scene.material("dark"), at=drain)


def _add_faucet(scene: SceneBuilder, depth: float, counter: float) -> Vector:
    """A bow or an angle of pipe, with one lever or two knobs; returns where water leaves it."""
    metal = scene.material("metal" if scene.chance(0.8) else "dark")
    rise, reach = scene.uniform(0.14, 0.32), scene.uniform(0.14, 0.24)
    radius, x, y = scene.uniform(0.011, 0.02), scene.uniform(-0.06, 0.06), depth / 2 + 0.05
    top = counter + rise
    scene.rod((x, y, counter), (x, y, top), radius, metal)
    end = y - reach
    if scene.chance(0.5):
        bend = np.linspace(0, math.pi, 9)
        half = reach / 2
        points = [(x, end + half + half * math.cos(a), top + half * math.sin(a)) for a in bend]
        outlet = top - scene.uniform(0.01, 0.06)
        scene.tube([*points, (x, end, outlet)], radius, metal)
    else:
        elbow = top + scene.uniform(-0.02, 0.05)
        outlet = elbow - scene.uniform(0.02, 0.04)
        scene.tube([(x, y, top), (x, end, elbow), (x, end, outlet)], radius, metal)
    if scene.chance(0.6):
        lever = (x + scene.uniform(-0.06, 0.06), y + 0.01, top + 0.08)
        scene.rod((x, y, top), lever, radius * 0.7, metal)
    else:
        for side in (-1, 1):
            foot = (x + side * 0.1, y, counter)
            scene.rod(foot, (foot[0], foot[1], counter + 0.05), radius, metal)
    return x, end, outlet


def _add_stream(scene: SceneBuilder, outlet: Vector, level: float) -> float:
    """A column that wavers and narrows, rings where it lands, drops; returns its strength."""
    water = scene.material("white", alpha=scene.uniform(0.5, 0.9), glow=scene.uniform(0.05, 0.4))
    strength, n_parts = scene.uniform(0.2, 1), 6
    radius = 0.005 + 0.011 * strength
    x, y, top = outlet
    last = outlet
    for part in range(1, n_parts + 1):
        place = (x + scene.uniform(-0.002, 0.002), y, top - (top - level) * part / n_parts)
        scene.rod(last, place, radius * scene.uniform(0.85, 1.15) * (1 - 0.04 * part), water)
        last = place
    for _ in range(4):
        place = (x + scene.uniform(-0.03, 0.03), y + scene.uniform(-0.03, 0.03), level + 0.003)
        ring = scene.uniforms((0.02, 0.09), (0.02, 0.08), (0.003, 0.012))
        scene.geom("ellipsoid", ring, water, at=place)
    for _ in range(8):
        dx, dy, dz = scene.uniforms((-0.06, 0.06), (-0.06, 0.06), (0.005, 0.05))
        place = (x + dx, y + dy, level + dz)
        scene.geom("sphere", (scene.uniform(0.002, 0.006),), water, at=place)
    return strength
