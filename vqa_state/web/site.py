"""The page: header and tabs, built first and connected after."""

from pathlib import Path

import gradio as gr

from vqa_state.web import header
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.tabs import ask, images, optimize, questions, recognizer, results

__all__ = ["STYLE", "build", "theme"]

STYLE = Path(__file__).parent / "assets" / "page.css"
HOUR = 3600
TABS = {
    "Images": images,
    "Questions": questions,
    "Ask": ask,
    "Optimize": optimize,
    "Results": results,
    "Recognizer": recognizer,
}
KEEP_TAB_JS = """() => {
  const name = document.querySelector('#tabs [role=tab][aria-selected=true]')?.textContent.trim();
  const address = new URL(window.location.href);
  if (name) address.searchParams.set('tab', name.toLowerCase());
  window.history.replaceState(null, '', address);
}"""


def theme() -> gr.themes.Base:
    """Fonts of the system, and grey text that can be read."""
    return gr.themes.Soft(
        font=["system-ui", "sans-serif"], font_mono=["ui-monospace", "monospace"]
    ).set(
        body_text_color_subdued="*neutral_600",
        body_text_color_subdued_dark="*neutral_400",
        block_info_text_color="*neutral_600",
        block_info_text_color_dark="*neutral_400",
    )


def build(desk: Desk) -> gr.Blocks:
    """The whole page."""
    demo: gr.Blocks
    with gr.Blocks(
        title="Visual states by questions", analytics_enabled=False, delete_cache=(HOUR, HOUR)
    ) as demo:
        top = header.build()
        parts = {}
        with gr.Tabs(elem_id="tabs") as tabs:
            for name, module in TABS.items():
                with gr.Tab(name, id=name.lower()) as tab:
                    parts[name] = module.build(tab)
        arrived = header.wire(top, desk, demo, tabs)
        page = Page(desk, top.pid, top.road, arrived)
        page.then_road(arrived)
        for name, module in TABS.items():
            module.wire(parts[name], page)
        tabs.select(None, None, None, js=KEEP_TAB_JS)
    return demo
