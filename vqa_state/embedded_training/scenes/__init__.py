"""Rendered pictures of household things in two states each."""

from vqa_state.embedded_training.scenes.random_draws import SceneSplit
from vqa_state.embedded_training.scenes.rendering import RenderedPicture, SceneRenderer
from vqa_state.embedded_training.scenes.things import PAPER_THINGS, THINGS

__all__ = ["PAPER_THINGS", "THINGS", "RenderedPicture", "SceneRenderer", "SceneSplit"]
