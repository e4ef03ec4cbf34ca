"""The page: header and tabs, built first and connected after."""

from pathlib import Path

import gradio as gr

from vqa_state.web import header
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.tabs import ask, images, optimize, questions, recognizer, results

__all__ = ["SCRIPT", "STYLE", "build", "theme"]

STYLE = Path(__file__).parent / "assets" / "page.css"
SCRIPT = STYLE.with_suffix(".js")
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
    """Fonts of the system, plain labels, and grey text and borders that can be seen."""
    return gr.themes.Soft(
        primary_hue="teal",
        secondary_hue="teal",
        neutral_hue="slate",
        font=["system-ui", "sans-serif"],
        font_mono=["ui-monospace", "monospace"],
    ).set(
        body_text_color_subdued="*neutral_600",
        body_text_color_subdued_dark="*neutral_400",
        block_info_text_color="*neutral_600",
        block_info_text_color_dark="*neutral_400",
        block_title_background_fill="transparent",
        block_title_background_fill_dark="transparent",
        block_title_text_color="*body_text_color",
        block_title_text_color_dark="*body_text_color",
        block_title_padding="0",
        border_color_primary="*neutral_300",
        border_color_primary_dark="*neutral_600",
        input_border_width="1px",
        input_border_width_dark="1px",
        input_border_color="*neutral_300",
        input_border_color_dark="*neutral_600",
        color_accent="*primary_700",
        color_accent_soft_dark="*neutral_800",
        checkbox_label_background_fill_selected="*primary_700",
        checkbox_label_background_fill_selected_dark="*primary_700",
        checkbox_label_text_color_selected="white",
        checkbox_border_color="*neutral_400",
        checkbox_border_color_dark="*neutral_500",
        button_primary_background_fill="*primary_700",
        button_primary_background_fill_hover="*primary_800",
        button_primary_background_fill_dark="*primary_700",
        button_primary_background_fill_hover_dark="*primary_600",
        slider_color="*primary_700",
        slider_color_dark="*primary_500",
        link_text_color="*primary_700",
        link_text_color_dark="*primary_300",
    )


def build(desk: Desk) -> gr.Blocks:
    """The whole page."""
    demo: gr.Blocks
    with gr.Blocks(title="VQA State", analytics_enabled=False, delete_cache=(HOUR, HOUR)) as demo:
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
