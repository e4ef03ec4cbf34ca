"""Cupboard fronts that run sideways in front of each other."""

from vqa_state.embedded_training.scenes.builder import SceneBuilder, slide
from vqa_state.embedded_training.scenes.parts import add_handle
from vqa_state.embedded_training.scenes.stage import Facts, Pose, Stage

__all__ = ["add_sliding_fronts"]


def add_sliding_fronts(
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

    def pose(stage: Stage, is_open: bool) -> Facts:
        degree = stage.degree(is_open)
        stage.move("front", -side * degree * width * 0.48)
        return {
            "degree": degree,
            "inside_visible": float(degree > 0.12),
            "leaf_at_angle": 0.0,
            "flush": float(not is_open),
        }

    return pose
