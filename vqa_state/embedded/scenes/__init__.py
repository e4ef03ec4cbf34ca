"""Rendered pictures of ten household things in two states each (development only)."""

from vqa_state.embedded.scenes.rendering import Picture, SceneRenderer, render_scene
from vqa_state.embedded.scenes.seeds import THINGS, Split

__all__ = ["THINGS", "Picture", "SceneRenderer", "Split", "render_scene"]
