"""Things one walks through: doors, transparent doors, elevators."""

from vqa_state.embedded_training.scenes.builder import SceneBuilder, hinge, slide
from vqa_state.embedded_training.scenes.parts import add_clutter, add_handle, add_wall_with_opening
from vqa_state.embedded_training.scenes.poses import open_part, opening_facts
from vqa_state.embedded_training.scenes.simulation import (
    Blueprint,
    CameraRange,
    Facts,
    Pose,
    Simulation,
)

__all__ = ["build_door", "build_elevator", "build_transparent_door"]


def build_door(scene: SceneBuilder) -> Blueprint:
    """A hinged room door that opens to either side."""
    width, height = scene.uniforms((0.75, 1.15), (1.9, 2.25))
    _add_rooms(scene, width, height)
    side = scene.side()
    with scene.body((side * width / 2, 0, 0), hinge("leaf")):
        centre = -side * width / 2
        _add_solid_leaf(scene, centre, width, height)
        for face in (-1, 1):
            place = (centre - side * (width / 2 - 0.09), face * 0.025, scene.uniform(0.9, 1.1))
            add_handle(scene, *place, upright=scene.chance(0.3))
    return Blueprint(_swing(scene.side()), _camera(scene, height))


def build_transparent_door(scene: SceneBuilder) -> Blueprint:
    """A glass door that swings or slides; what is behind is seen in both states."""
    width, height = scene.uniforms((0.8, 1.25), (1.9, 2.25))
    _add_rooms(scene, width, height)
    side, slides = scene.side(), scene.chance(0.4)
    # A sliding leaf runs in front of the wall; a swinging one hangs in the opening.
    centre = 0.0 if slides else -side * width / 2
    place = (0.0, -0.08, 0.0) if slides else (side * width / 2, 0.0, 0.0)
    with scene.body(place, slide("leaf") if slides else hinge("leaf")):
        _add_glass_leaf(scene, centre, width, height)
        for face in (-1, 1):
            grip = (centre - side * (width / 2 - 0.09), face * 0.02, scene.uniform(0.95, 1.1))
            add_handle(scene, *grip, upright=True, length=scene.uniform(0.12, 0.35))
    pose = _slide(scene.side(), width) if slides else _swing(scene.side())
    return Blueprint(pose, _camera(scene, height))


def build_elevator(scene: SceneBuilder) -> Blueprint:
    """An elevator with one or two sliding leaves and a lit cabin behind them."""
    width, height = scene.uniforms((0.9, 1.4), (2.0, 2.3))
    add_wall_with_opening(scene, width, height, 0.14)
    _add_cabin(scene, width, height, depth=scene.uniform(1.2, 1.8))
    finish, two_leaves = scene.material("metal" if scene.chance(0.75) else "any"), scene.chance(0.7)
    side = scene.side()
    for number, x in enumerate((-width / 4, width / 4)):
        # One-sided leaves pass in front of each other, so they run on two tracks.
        track = 0.05 if number and not two_leaves else 0.02
        with scene.body((x, track, 0), slide(f"leaf{number}")):
            scene.box((0, 0, height / 2), (width / 2 - 0.008, 0.03, height), finish)
    _add_buttons(scene, width, height)
    camera = CameraRange((0, 0, height * 0.5), (58, 122), (-12, 6), (2.0, 4.2))
    return Blueprint(_part(width, side, two_leaves), camera)


def _camera(scene: SceneBuilder, height: float) -> CameraRange:
    target = (0.0, 0.0, height * scene.uniform(0.42, 0.58))
    return CameraRange(target, (55, 125), (-18, 6), (1.9, 4.0))


def _add_rooms(scene: SceneBuilder, width: float, height: float) -> None:
    """The wall, the room behind it and things in both rooms."""
    add_wall_with_opening(scene, width, height, 0.1)
    scene.box((0, scene.uniform(1.5, 5), 1.5), (14, 0.1, 4), scene.material("wall"))
    add_clutter(scene, scene.count(0, 5), (-2, 2), (0.8, 3), 0, 1.1)
    beside = scene.side()
    reach = sorted((beside * (width / 2 + 0.2), beside * 2))
    add_clutter(scene, scene.count(0, 3), (reach[0], reach[1]), (-1.3, -0.3), 0, 0.7)


def _add_solid_leaf(scene: SceneBuilder, x: float, width: float, height: float) -> None:
    """A leaf with panels and, in one case of four, a small window."""
    finish = scene.material(scene.pick(("wood", "wood", "white", "any")))
    scene.box((x, 0, height / 2), (width - 0.015, 0.045, height - 0.015), finish)
    if scene.chance(0.6):
        rows = scene.count(1, 3)
        inset = finish if scene.chance(0.6) else scene.material()
        share = scene.uniform(0.45, 0.75)
        for row in range(rows):
            size = (width * share, 0.012, height / rows * 0.72)
            for face in (-1, 1):
                scene.box((x, face * 0.024, height * (row + 0.5) / rows), size, inset)
    if scene.chance(0.25):
        size = (width * scene.uniform(0.2, 0.6), 0.055, height * scene.uniform(0.1, 0.3))
        scene.box((x, 0, height * 0.72), size, scene.material(scene.pick(("dark", "white"))))


def _add_glass_leaf(scene: SceneBuilder, x: float, width: float, height: float) -> None:
    """A pane in a thin frame, often with a sticker or a bar across it."""
    pane = scene.material("white", alpha=scene.uniform(0.15, 0.4))
    frame = scene.material(scene.pick(("metal", "metal", "dark", "any")))
    bar = scene.uniform(0.025, 0.08)
    scene.box((x, 0, height / 2), (width - 0.02, 0.015, height - 0.02), pane)
    upright = (bar, 0.04, height - 0.01)
    scene.pair((x, 0, height / 2), width / 2 - bar / 2 - 0.01, upright, frame)
    for z in (height - bar / 2, bar / 2 + 0.01):
        scene.box((x, 0, z), (width, 0.04, bar), frame)
    if scene.chance(0.6):
        size = (scene.uniform(0.1, width * 0.8), 0.022, scene.uniform(0.03, 0.2))
        scene.box((x, 0, scene.uniform(1.1, 1.6)), size, scene.material())


def _add_cabin(scene: SceneBuilder, width: float, height: float, depth: float) -> None:
    back = scene.material("metal" if scene.chance(0.5) else "wall", glow=scene.uniform(0, 0.3))
    sides = scene.material("any", glow=0.1)
    scene.box((0, depth, height / 2), (width * 1.3, 0.05, height), back)
    wall = (0.05, depth - 0.1, height)
    scene.pair((0, depth / 2 + 0.1, height / 2), width * 0.62, wall, sides)
    ceiling = scene.material("white", glow=scene.uniform(0.2, 0.9))
    scene.box((0, depth / 2, height + 0.02), (width * 1.3, depth, 0.04), ceiling)
    floor = (width * 1.2, depth - 0.1, 0.01)
    scene.box((0, depth / 2 + 0.1, 0.005), floor, scene.material("floor"))
    if scene.chance(0.6):
        y = depth - 0.08
        rail = scene.material("metal")
        scene.rod((-width * 0.5, y, 0.95), (width * 0.5, y, 0.95), 0.02, rail)


def _add_buttons(scene: SceneBuilder, width: float, height: float) -> None:
    x = scene.side() * (width / 2 + scene.uniform(0.2, 0.4))
    scene.box((x, -0.08, scene.uniform(1, 1.2)), (0.1, 0.02, 0.25), scene.material("metal"))
    for row in (0, 1):
        place = (x, -0.095, 1.02 + 0.12 * row)
        scene.geom("sphere", (0.02,), scene.material("any", glow=0.8), at=place)
    if scene.chance(0.6):
        scene.box((0, -0.08, height + 0.15), (0.3, 0.02, 0.1), scene.material("dark"))


def _swing(direction: float) -> Pose:
    """A pose that turns the leaf by 9 to 115 degrees, or leaves it shut."""

    def angle(sim: Simulation, degree: float) -> float:
        return direction * (2.0 * degree + sim.uniform(0, 0.02))

    return open_part("leaf", angle, turns=True, visible_from=0.15, passable_from=0.4)


def _slide(direction: float, width: float) -> Pose:
    """A pose that slides the leaf aside by up to its width, or not at all."""

    def place(sim: Simulation, degree: float) -> float:
        return direction * (0.96 * degree + sim.uniform(0, 0.01)) * width

    return open_part("leaf", place, turns=False, visible_from=0.15, passable_from=0.6)


def _part(width: float, side: float, two_leaves: bool) -> Pose:
    """A pose that draws both leaves apart, or both to one side."""

    def pose(sim: Simulation, is_open: bool) -> Facts:
        degree = sim.degree(is_open)
        share = 0.97 * degree + sim.uniform(0, 0.006)
        for number, own_side in enumerate((-1.0, 1.0)):
            # The leaf that is already on that side goes half as far as the other.
            far = 1.0 if own_side != side else 0.5
            way = own_side * width / 2 if two_leaves else side * width * far
            sim.move(f"leaf{number}", share * way)
        return opening_facts(degree, turns=False, visible_from=0.15, passable_from=0.5)

    return pose
