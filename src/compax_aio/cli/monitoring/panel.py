"""The panel of one axis on the screen: large where there is room, four lines where there is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.widgets import Digits, Static

from . import drawing
from .state import AxisState

__all__ = ["AxisPanel", "Drawn"]


class Drawn(Static):
    """
    A piece of text that is drawn anew only when it says something else.

    Args:
        id: Of the widget, for its style.
        classes: Of the widget, for its style.
        is_as_high_as_its_text: Lay the screen out anew when the text changes; else it has a height of its own.
    """

    def __init__(self, *, id: str | None = None, classes: str = "", is_as_high_as_its_text: bool = False) -> None:  # noqa: A002
        super().__init__(id=id, classes=classes, markup=False)
        self._shown: Text | None = None
        self._lays_out = is_as_high_as_its_text

    def show(self, text: Text) -> None:
        """Let it be *text*."""
        if self._shown is None or text != self._shown or text.spans != self._shown.spans:
            self._shown = text
            self.update(text, layout=self._lays_out)


class AxisPanel(Vertical):
    """
    All that is known of one axis.

    Args:
        axis: What is known.
        choose: Called when it is clicked.
    """

    DEFAULT_CSS: ClassVar[str] = """
    AxisPanel { height: auto; background: #161d27; margin-bottom: 1; }
    AxisPanel.selected { background: #1f2a38; }
    AxisPanel .title { height: 1; background: #222c39; }
    AxisPanel.selected .title { background: #34465c; }
    AxisPanel .numbers { height: 4; }
    AxisPanel .left { width: 33; padding-left: 2; }
    AxisPanel Digits { width: 31; color: #f2f6fa; text-style: bold; }
    AxisPanel .place { height: 1; }
    AxisPanel .old { color: #66727f; }
    AxisPanel .facts { width: 38; height: 4; text-wrap: nowrap; text-overflow: ellipsis; }
    AxisPanel .trends { width: 1fr; height: 4; padding-right: 1; }
    AxisPanel .bar { height: 1; padding: 0 2; }
    AxisPanel .lamps { height: 1; }
    AxisPanel .compact { display: none; height: 2; }
    AxisPanel.small { margin-bottom: 0; }
    AxisPanel.small .numbers, AxisPanel.small .bar { display: none; }
    AxisPanel.small .compact { display: block; }
    """

    can_focus = False

    def __init__(self, axis: AxisState, choose: Callable[[], None]) -> None:
        super().__init__()
        self._axis = axis
        self._choose = choose
        self._title = Drawn(classes="title")
        self._digits = Digits()
        self._place = Drawn(classes="place")
        self._facts = Drawn(classes="facts")
        self._trends = Drawn(classes="trends")
        self._bar = Drawn(classes="bar")
        self._compact = Drawn(classes="compact")
        self._lamps = Drawn(classes="lamps")

    def compose(self) -> ComposeResult:
        """Lay out its parts."""
        yield self._title
        with Horizontal(classes="numbers"):
            with Vertical(classes="left"):
                yield self._digits
                yield self._place
            yield self._facts
            yield self._trends
        yield self._bar
        yield self._compact
        yield self._lamps

    def show(self, now: float, *, is_selected: bool, is_small: bool) -> None:
        """Show the axis as it is known at loop time *now*."""
        axis, width = self._axis, self.size.width
        if width < 1:  # not laid out yet
            return
        self.set_class(is_selected, "selected")
        self.set_class(is_small, "small")
        self._title.show(drawing.draw_title(axis, now, width, is_selected=is_selected))
        self._lamps.show(drawing.draw_lamps(axis, now, width, with_pace=not is_small))
        if is_small:
            self._compact.show(drawing.draw_compact(axis, now, width))
            return
        self._digits.set_class(not axis.is_current("position", now), "old")
        if (text := drawing.position_text(axis)) != self._digits.value:
            self._digits.update(text)
        self._place.show(drawing.draw_place(axis, now))
        self._facts.show(drawing.draw_facts(axis, now))
        self._trends.show(drawing.draw_trends(axis, now, max(self._trends.size.width - 1, 10)))
        self._bar.show(drawing.draw_bar(axis, now, width - 4))

    def on_click(self, event: events.Click) -> None:
        """Choose this axis."""
        event.stop()
        self._choose()
