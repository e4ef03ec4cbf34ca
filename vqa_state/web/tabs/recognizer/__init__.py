"""The tab recognizer: `tab` builds and wires it; the other modules are its parts."""

from vqa_state.web.tabs.recognizer.tab import build, wire

__all__ = ["build", "wire"]
