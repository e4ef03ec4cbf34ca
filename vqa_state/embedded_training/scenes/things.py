"""The things that are rendered, each with the function that builds one scene of it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from vqa_state.embedded_training.scenes import (
    containers,
    doorways,
    furniture,
    household,
    openings,
    sink,
)
from vqa_state.embedded_training.scenes.builder import SceneBuilder
from vqa_state.embedded_training.scenes.simulation import Blueprint

__all__ = ["BUILDERS", "PAPER_THINGS", "THINGS"]

#: The ten things of the paper (section III), in its order, then seven that it does not have.
BUILDERS: Mapping[str, Callable[[SceneBuilder], Blueprint]] = MappingProxyType(
    {
        "door": doorways.build_door,
        "elevator": doorways.build_elevator,
        "cabinet": furniture.build_cabinet,
        "refrigerator": furniture.build_refrigerator,
        "microwave": furniture.build_microwave,
        "transparent_door": doorways.build_transparent_door,
        "light": household.build_light,
        "display": household.build_display,
        "handbag": household.build_handbag,
        "water": sink.build_water,
        "drawer": containers.build_drawer,
        "window": openings.build_window,
        "curtain": openings.build_curtain,
        "laptop": containers.build_laptop,
        "box_lid": containers.build_box_lid,
        "gate": openings.build_gate,
        "oven": containers.build_oven,
    }
)

THINGS = tuple(BUILDERS)
PAPER_THINGS = THINGS[:10]
