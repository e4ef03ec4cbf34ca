"""What stands about in a picture without being asked for: people, robots, things in the way."""

from vqa_state.embedded_training.scenes.builder import SceneBuilder
from vqa_state.embedded_training.scenes.simulation import CameraRange

__all__ = ["add_surroundings"]


def add_surroundings(scene: SceneBuilder, camera: CameraRange) -> None:
    """Sometimes put a person, a robot or a post near the edge of the view, in both states alike."""
    x, y, z = camera.target
    reach = (camera.distance[0] + camera.distance[1]) / 2
    aside = x + scene.side() * reach * scene.uniform(0.3, 0.5)
    before = y - reach * scene.uniform(0.05, 0.35)
    # Near things are seen at eye level whatever their size, so figures scale with the view.
    scale = max(0.35, reach / 3)
    chance = scene.uniform(0, 1)
    if chance < 0.15:
        _add_person(scene, aside, before, z - 0.9 * scale, scale)
    elif chance < 0.27:
        _add_robot_arm(scene, aside, before, z - 0.5 * scale, scale)
    elif chance < 0.36:
        radius = reach * scene.uniform(0.01, 0.03)
        foot, head = (aside, before, z - reach), (aside, before, z + reach)
        scene.rod(foot, head, radius, scene.material())


def _add_person(scene: SceneBuilder, x: float, y: float, z: float, scale: float) -> None:
    """Legs, trunk, arms and a head of rounded parts; `scale` 1 is 1.8 m high."""
    trousers, shirt, skin = scene.material("cloth"), scene.material("cloth"), scene.material("wood")
    hip, neck = z + 0.85 * scale, z + 1.45 * scale
    for side in (-1, 1):
        foot = (x + side * 0.1 * scale, y, z)
        scene.rod(foot, (x + side * 0.08 * scale, y, hip), 0.075 * scale, trousers)
        hand = (x + side * scene.uniform(0.2, 0.5) * scale, y - 0.1 * scale, hip)
        scene.rod((x + side * 0.2 * scale, y, neck), hand, 0.05 * scale, shirt)
    scene.rod((x, y, hip), (x, y, neck), 0.16 * scale, shirt)
    scene.geom("sphere", (0.12 * scale,), skin, at=(x, y, neck + 0.22 * scale))


def _add_robot_arm(scene: SceneBuilder, x: float, y: float, z: float, scale: float) -> None:
    """Three thick links with round joints and two fingers."""
    shell, joint = scene.material("white"), scene.material("dark")
    points = [(x, y, z - scale)]
    for _ in range(3):
        last = points[-1]
        step = [scene.uniform(-0.25, 0.25), scene.uniform(-0.15, 0.15), scene.uniform(0.2, 0.55)]
        points.append(
            (last[0] + step[0] * scale, last[1] + step[1] * scale, last[2] + step[2] * scale)
        )
    scene.tube(points, 0.06 * scale, shell)
    for point in points[1:]:
        scene.geom("sphere", (0.08 * scale,), joint, at=point)
    x, y, z = points[-1]
    for side in (-1, 1):
        finger = (x + side * 0.05 * scale, y, z + 0.18 * scale)
        scene.rod((x + side * 0.03 * scale, y, z), finger, 0.015 * scale, joint)
