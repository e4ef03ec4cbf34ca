"""Rendered pictures of household things in two states each (development only)."""

from vqa_state.embedded_training.scenes.rendering import Picture, SceneRenderer, render_scene
from vqa_state.embedded_training.scenes.seeds import PAPER_THINGS, THINGS, Split

__all__ = ["PAPER_THINGS", "THINGS", "Picture", "SceneRenderer", "Split", "render_scene"]
