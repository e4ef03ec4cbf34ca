"""The tab images: `tab` builds and wires it; the other modules are its parts."""

from vqa_state.web.tabs.images.tab import build, wire

__all__ = ["build", "wire"]
