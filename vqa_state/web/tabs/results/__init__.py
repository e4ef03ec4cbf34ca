"""The tab results: `tab` builds and wires it; the other modules are its parts."""

from vqa_state.web.tabs.results.tab import build, wire

__all__ = ["build", "wire"]
