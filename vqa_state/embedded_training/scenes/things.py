"""The things that are rendered, each with the function that builds one scene of it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from vqa_state.embedded_training.scenes.builder import SceneBuilder
from vqa_state.embedded_training.scenes.containers import (
    build_box_lid,
    build_drawer,
    build_laptop,
    build_oven,
)
from vqa_state.embedded_training.scenes.doorways import (
    build_door,
    build_elevator,
    build_transparent_door,
)
from vqa_state.embedded_training.scenes.furniture import (
    build_cabinet,
    build_microwave,
    build_refrigerator,
)
from vqa_state.embedded_training.scenes.household import build_display, build_handbag, build_light
from vqa_state.embedded_training.scenes.openings import build_curtain, build_gate, build_window
from vqa_state.embedded_training.scenes.simulation import Blueprint
from vqa_state.embedded_training.scenes.sink import build_water

__all__ = ["BUILDERS", "PAPER_THINGS", "THINGS"]

#: The ten things of the paper (section III), in its order, then seven that it does not have.
BUILDERS: Mapping[str, Callable[[SceneBuilder], Blueprint]] = MappingProxyType(
    {
        "door": build_door,
        "elevator": build_elevator,
        "cabinet": build_cabinet,
        "refrigerator": build_refrigerator,
        "microwave": build_microwave,
        "transparent_door": build_transparent_door,
        "light": build_light,
        "display": build_display,
        "handbag": build_handbag,
        "water": build_water,
        "drawer": build_drawer,
        "window": build_window,
        "curtain": build_curtain,
        "laptop": build_laptop,
        "box_lid": build_box_lid,
        "gate": build_gate,
        "oven": build_oven,
    }
)

THINGS = tuple(BUILDERS)
PAPER_THINGS = THINGS[:10]
