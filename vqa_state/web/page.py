"""What every tab needs of the page: who is asked for which project, and how errors are shown.

Handlers are plain functions `fn(desk, pid, …)`. The page gives them the desk and the id of the
open project, and turns the errors that the core explains into a message on the page.
"""

import html
import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import VQAStateError
from vqa_state.web import next_step as road
from vqa_state.web.session import Desk

__all__ = ["Page", "message"]

Handler = Callable[..., Any]
OPTIONS: dict[str, Any] = {"show_progress": "hidden", "api_visibility": "private"}


@dataclass(frozen=True)
class Page:
    """The desk, and the components that belong to no tab.

    Attributes:
        pid: id of the open project; empty when none is.
        road: the line that says how far the project is.
        arrived: event after which `pid` is known.
    """

    desk: Desk
    pid: gr.Textbox
    road: gr.HTML
    arrived: Any

    def on(
        self, trigger: Any, fn: Handler, inputs: Sequence[Any], outputs: Sequence[Any], **more: Any
    ) -> Any:
        """Call `fn(desk, pid, *inputs)`."""
        handler = _explained(fn, self.desk)
        return trigger(handler, [self.pid, *inputs], list(outputs), **(OPTIONS | more))

    def change(
        self, trigger: Any, fn: Handler, inputs: Sequence[Any], outputs: Sequence[Any], **more: Any
    ) -> Any:
        """Like `on`, for what takes the project further: the line of the road follows."""
        return self.then_road(self.on(trigger, fn, inputs, outputs, **more))

    def then_road(self, done: Any) -> Any:
        """After an event, say anew how far the project is."""
        return done.then(_explained(road.show, self.desk), [self.pid], [self.road], **OPTIONS)

    def on_data(
        self, trigger: Any, fn: Handler, inputs: Sequence[Any], outputs: Sequence[Any]
    ) -> Any:
        """Call `fn(desk, pid, data, *inputs)` with what the event carries."""
        handler = _with_data(_explained(fn, self.desk))
        every = OPTIONS | {"trigger_mode": "multiple"}  # each tells something new
        return trigger(handler, [self.pid, *inputs], list(outputs), **every)

    def fill(self, fn: Handler, outputs: Sequence[Any]) -> None:
        """Fill fields when the page opens; later that would undo what is being typed."""
        self.on(self.arrived.then, fn, (), outputs, queue=False)

    def refresh(self, tab: gr.Tab, fn: Handler, outputs: Sequence[Any]) -> None:
        """Show what another tab may have changed, whenever this one is chosen."""
        self.on(tab.select, fn, (), outputs, queue=False)

    def follow(self, trigger: Any, fn: Handler, outputs: Sequence[Any]) -> Any:
        """Stream what the generator `fn(desk, pid)` yields; any number of pages may."""
        return self.on(trigger, fn, (), outputs, concurrency_limit=None)


def message(error: VQAStateError) -> gr.Error:
    """An error as a message of the page, which would read it as HTML, names typed by users too."""
    return gr.Error(html.escape(str(error), quote=False), print_exception=False)


def _explained(fn: Handler, desk: Desk) -> Handler:
    """`fn` with its desk, and its known errors as messages. Without a project nothing happens."""

    def handler(pid: Any, *inputs: Any) -> Any:
        if not pid:
            return gr.skip()
        try:
            return fn(desk, pid, *inputs)
        except VQAStateError as error:
            raise message(error) from error

    def stream(pid: Any, *inputs: Any) -> Iterator[Any]:
        if not pid:
            return
        try:
            yield from fn(desk, pid, *inputs)
        except VQAStateError as error:
            raise message(error) from error

    return stream if inspect.isgeneratorfunction(fn) else handler


def _with_data(handler: Handler) -> Handler:
    def receive(pid: Any, event: gr.EventData, *inputs: Any) -> Any:
        return handler(pid, event._data, *inputs)

    return receive
