"""The screen of the monitor: all axes, what happened on them, and the keys; it shows and asks, and knows no drive."""

from __future__ import annotations

import asyncio
import sys
from dataclasses import dataclass
from typing import ClassVar

from rich.text import Text
from textual import _time, events  # whose clock dates them
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import RichLog

from ..outlets import is_held_up
from .axis import MonitoredAxis
from .cell import Cell
from .dialogs import Help, Leaving, Question
from .diary import Entry
from .drawing import COLOURS, between
from .levels import Level
from .panel import AxisPanel, Drawn
from .state import Phase
from .steps import LARGE, next_step

__all__ = ["Monitor"]

_REFRESH_S = 0.2
_WIDTH_OF_LARGE = 100
_ROWS_OF_PANEL = 8
_ROWS_BESIDE_PANELS = 12
_STOP_SHOWN_S = 30.0
"""How long it is shown that all axes stand after a stop; that one may not stand is shown until the next stop."""

_MOVING_KEYS = frozenset({"left", "right", "shift+left", "shift+right", "h", "y"})
_LATE_S = 0.5
"""A key that repeats itself faster than a busy computer takes it would go on for longer, after it is let go."""

_LOOKING = "looking only: m lets this keyboard move axes"


@dataclass(frozen=True, slots=True)
class _Asked:
    """A question before something is done."""

    title: str
    text: str


class Monitor(App[bool]):
    """
    The screen; it returns whether it was interrupted by Ctrl-C.

    Args:
        cell: The axes; they are opened when the screen is there.
        step: Of a jog, in the unit of the axis.
        asks_before_motion: Ask before this keyboard may move axes.
    """

    TITLE = "compax monitor"
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { background: #0d1117; layout: vertical; }
    ModalScreen { background: #000000 60%; }
    #head { dock: top; height: 1; background: #34465c; color: #f2f6fa; }
    #head.motion { background: #e8b130; color: #0d1117; }
    #axes { height: auto; max-height: 1fr; background: #0d1117; scrollbar-size-vertical: 1;
        scrollbar-color: #34465c; scrollbar-background: #0d1117; }
    #stops { height: auto; max-height: 40%; background: #161d27; display: none; padding: 0 1; }
    #stops.shown { display: block; }
    #log { height: 1fr; min-height: 3; background: #0d1117; padding: 0 1; scrollbar-size-vertical: 1;
        scrollbar-color: #34465c; scrollbar-background: #0d1117; }
    #keys { dock: bottom; height: auto; background: #222c39; padding: 0 1; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        # With priority: also while a dialog is open.
        Binding("space", "stop_all", priority=True),
        Binding("ctrl+c,ctrl+q", "leave_at_once", priority=True),
        ("s", "stop"),
        ("down,j", "choose(1)"),
        ("up,k", "choose(-1)"),
        ("m", "motion"),
        ("right", "jog(1)"),
        ("left", "jog(-1)"),
        ("shift+right", f"jog({LARGE})"),
        ("shift+left", f"jog(-{LARGE})"),
        ("plus,equals_sign", "step(1)"),
        ("minus", "step(-1)"),
        ("h", "home"),
        ("a", "acknowledge"),
        ("r", "reconcile"),
        ("c", "try_again"),
        ("question_mark,f1", "help"),
        ("pageup", "scroll_log(-1)"),
        ("pagedown", "scroll_log(1)"),
        ("q", "leave"),
    ]

    def __init__(self, cell: Cell, *, step: float = 1.0, asks_before_motion: bool = True) -> None:
        super().__init__()
        self.cell = cell
        self.step = step
        self.is_motion_on = False
        self.chosen = 0
        self.defect: Exception | None = None
        self._asks_before_motion = asks_before_motion
        self._panels = [
            AxisPanel(axis.state, lambda number=number: self._choose(number))  # type: ignore[misc]
            for number, axis in enumerate(cell.axes)
        ]
        self._is_small = True
        self._told = 0
        self._log_width = 0
        self._leaving: asyncio.Task[None] | None = None

    # What is seen ---------------------------------------------------------------------------------------------------

    def compose(self) -> ComposeResult:
        """Lay out the screen."""
        yield Drawn(id="head")
        with VerticalScroll(id="axes", can_focus=False):
            yield from self._panels
        yield Drawn(id="stops", is_as_high_as_its_text=True)
        log = RichLog(id="log", max_lines=1000, wrap=True, markup=False, highlight=False)
        log.can_focus = False
        yield log
        yield Drawn(id="keys", is_as_high_as_its_text=True)

    def on_mount(self) -> None:
        """Begin to watch; nothing is sent that could move an axis."""
        # Textual would let tasks begin before whoever makes them goes on; drives are made for asyncio's own order.
        asyncio.get_running_loop().set_task_factory(None)
        self.cell.start()
        self.set_interval(_REFRESH_S, self.show)

    def on_resize(self, event: events.Resize) -> None:
        """Take the form that has room."""
        height = min(len(self._panels), 3) * _ROWS_OF_PANEL + _ROWS_BESIDE_PANELS
        self._is_small = event.size.width < _WIDTH_OF_LARGE or event.size.height < height
        self.call_after_refresh(self.show)

    def show(self) -> None:
        """Show everything as it is known now."""
        if not self.is_running or not self.screen_stack or is_held_up(sys.__stderr__):
            return
        now = asyncio.get_running_loop().time()
        for number, (axis, panel) in enumerate(zip(self.cell.axes, self._panels, strict=True)):
            axis.look()
            panel.show(now, is_selected=number == self.chosen, is_small=self._is_small)
        base = self.screen_stack[0]
        self._show_head(base.query_one("#head", Drawn))
        self._show_stops(base.query_one("#stops", Drawn), now)
        base.query_one("#keys", Drawn).show(self._keys())
        self._show_diary(base.query_one("#log", RichLog))

    def _show_head(self, head: Drawn) -> None:
        head.set_class(self.is_motion_on, "motion")
        unit = self._axis.state.unit
        motion = f"MOTION ON: ← → jog {self.step:g} {unit}, h homes; m off" if self.is_motion_on else _LOOKING
        number = len(self._panels)
        left = Text.assemble((" compax monitor ", "bold"), f" {number} {'axis' if number == 1 else 'axes'}")
        head.show(between(left, Text(f"{motion} ", "bold" if self.is_motion_on else ""), head.size.width))

    def _show_stops(self, place: Drawn, now: float) -> None:
        stops = self.cell.stops
        shown = any(stop.level is not Level.QUIET or now - stop.at < _STOP_SHOWN_S for stop in stops.values())
        place.set_class(shown, "shown")
        if shown:
            lines = [
                Text.assemble(
                    ("STOP ", f"bold {COLOURS[stop.level]}"),
                    (f"{name}  ", "bold"),
                    (f"{stop.level.sign} {stop.text}", COLOURS[stop.level]),
                )
                for name, stop in stops.items()
                if stop.level is not Level.QUIET or now - stop.at < _STOP_SHOWN_S
            ]
            place.show(Text("\n").join(lines))

    def _show_diary(self, log: RichLog) -> None:
        width = log.scrollable_content_region.width
        if width != self._log_width:
            log.clear()
            self._told, self._log_width = 0, width
        if width > 0:  # it has been laid out
            for entry in self.cell.diary.since(self._told):
                log.write(_line(entry), width=width)
            self._told = self.cell.diary.written

    def _keys(self) -> Text:
        keys = [("s", "stop"), ("↑↓", "axis"), ("m", "motion off" if self.is_motion_on else "motion on")]
        if self.is_motion_on:
            keys += [("←→", "jog"), ("+-", "step"), ("h", "home")]
        keys += [(key, meaning) for key, meaning, is_wanted in self._keys_for_trouble() if is_wanted]
        keys += [("?", "help"), ("q", "quit")]
        line = Text.assemble((" space STOP ALL ", f"bold #0d1117 on {COLOURS[Level.ALARM]}"))
        for key, meaning in keys:
            line.append("  ").append(key, "bold #f2f6fa").append(f"\u00a0{meaning}", "#9fb1c1")
        return line

    def _keys_for_trouble(self) -> tuple[tuple[str, str, bool], ...]:
        """Return the keys that do something only in trouble, and whether the chosen axis is in it."""
        state = self._axis.state
        status = state.status(asyncio.get_running_loop().time())
        has_error = status is not None and not (status.no_fault and status.no_warning)
        is_tried_by_key = state.phase in {Phase.UNREACHABLE, Phase.ENDED}
        return (
            ("a", "acknowledge", has_error),
            ("r", "reconcile", state.doubt is not None),
            ("c", "connect", is_tried_by_key),
        )

    # Choosing -------------------------------------------------------------------------------------------------------

    @property
    def _axis(self) -> MonitoredAxis:
        return self.cell.axes[self.chosen]

    def _choose(self, number: int) -> None:
        self.chosen = number
        self._panels[number].scroll_visible(animate=False)
        self.show()

    def action_choose(self, by: int) -> None:
        """Choose the next axis, or the one before."""
        self._choose(min(max(self.chosen + by, 0), len(self._panels) - 1))

    def action_scroll_log(self, pages: int) -> None:
        """Look back in the log, or forward."""
        log = self.query_one("#log", RichLog)
        log.auto_scroll = False
        log.scroll_relative(y=pages * max(log.size.height - 1, 1), animate=False)
        log.auto_scroll = pages > 0 and log.scroll_offset.y >= log.max_scroll_y - log.size.height

    def action_help(self) -> None:
        """Say what the keys do."""
        self.push_screen(Help())

    # Stopping -------------------------------------------------------------------------------------------------------

    def action_stop_all(self) -> None:
        """Stop all axes at once; whatever was asked is not done, and motion is off until it is switched on again."""
        self.cell.stop_all()
        self.is_motion_on = False
        while len(self.screen_stack) > 1 and isinstance(self.screen, Question | Help):
            self.pop_screen()
        self.show()

    def action_stop(self) -> None:
        """Stop the axis that is chosen."""
        self.cell.diary.add(self._axis.name, "stop", Level.ACTIVE)
        self._axis.orders.stop()
        self.show()

    # Moving ---------------------------------------------------------------------------------------------------------

    def action_motion(self) -> None:
        """Let this keyboard move axes, or no more; asks first, unless that was said at the start."""
        if self.is_motion_on:
            self._set_motion(on=False)
        elif self._asks_before_motion:
            text = (
                "From now on, arrow keys and h move axes at once.\n\nIs nobody within reach of the machine, and the "
                "emergency stop within yours?"
            )
            self._ask(_Asked("motion", text), lambda: self._set_motion(on=True))
        else:
            self._set_motion(on=True)

    def _set_motion(self, *, on: bool) -> None:
        self.is_motion_on = on
        self.cell.diary.add("", f"motion from this keyboard is {'on' if on else 'off'}", Level.ACTIVE)
        self.show()

    async def on_event(self, event: events.Event) -> None:
        """Take what comes, but no key that moves and was pressed long ago: its finger may have been lifted since."""
        if isinstance(event, events.Key) and event.key in _MOVING_KEYS and _time.get_time() - event.time > _LATE_S:
            self.cell.diary.add(self._axis.name, f"{event.key}: not heeded, it came too late", Level.ATTENTION)
            return
        await super().on_event(event)

    def _may_move(self, what: str) -> bool:
        if not self.is_motion_on:
            self.cell.diary.add(self._axis.name, f"{what}: nothing was sent, motion is off (m)", Level.ATTENTION)
            self.show()
        return self.is_motion_on

    def action_jog(self, steps: int) -> None:
        """Move the chosen axis by so many steps."""
        if self._may_move("jog"):
            self._axis.orders.jog(steps * self.step)
            self.show()

    def action_step(self, direction: int) -> None:
        """Make the step of a jog larger or smaller."""
        self.step = next_step(self.step, direction, decimals=self._axis.state.decimals)
        self.show()

    def action_home(self) -> None:
        """Find machine zero of the chosen axis; asks first."""
        axis = self._axis
        if self._may_move("search for machine zero"):
            text = f"Let {axis.name} find machine zero? It moves until it has found it."
            self._ask(_Asked(f"home {axis.name}", text), axis.orders.home)

    # What else is asked of a drive ----------------------------------------------------------------------------------

    def action_acknowledge(self) -> None:
        """Acknowledge the error of the chosen axis."""
        self._axis.orders.acknowledge()
        self.show()

    def action_reconcile(self) -> None:
        """Let a drive in doubt take motion again; asks first whether somebody has looked."""
        axis = self._axis
        if axis.state.doubt is None:
            self.cell.diary.add(axis.name, "it is not in doubt, there is nothing to reconcile")
            self.show()
            return
        text = f"{axis.name} is in doubt: {axis.state.doubt}.\n\nHave you looked at the machine, and does it stand?"
        self._ask(_Asked(f"reconcile {axis.name}", text), axis.orders.reconcile)

    def action_try_again(self) -> None:
        """Try the line of the chosen axis at once."""
        self._axis.try_again()
        self.show()

    def _ask(self, asked: _Asked, do: object) -> None:
        def answered(answer: bool | None) -> None:
            if answer and callable(do):
                do()
                self.show()

        if not isinstance(self.screen, ModalScreen):
            self.push_screen(Question(asked.title, asked.text), answered)

    # Leaving --------------------------------------------------------------------------------------------------------

    def action_leave(self) -> None:
        """Leave; asks first if something moves that was started here."""
        moving = ", ".join(axis.name for axis in self.cell.moved_from_here)
        if not moving:
            self._leave(interrupted=False)
            return
        text = f"{moving} may be moving, started here. Leaving stops it first. Leave?"
        self._ask(_Asked("leave", text), lambda: self._leave(interrupted=False))

    def action_leave_at_once(self) -> None:
        """Leave without asking, as Ctrl-C does: what was started here is stopped first."""
        self._leave(interrupted=True)

    def _leave(self, *, interrupted: bool) -> None:
        if self._leaving is None:
            self.is_motion_on = False
            moving = ", ".join(axis.name for axis in self.cell.moved_from_here)
            self.push_screen(Leaving(moving))
            self._leaving = asyncio.create_task(self._until_left(interrupted=interrupted))

    async def _until_left(self, *, interrupted: bool) -> None:
        try:
            await self.cell.close()
        finally:
            self.exit(interrupted)

    def _handle_exception(self, error: Exception) -> None:
        """End the screen after a defect; whoever runs it tells the defect, when the axes are stopped."""
        self.defect = error
        super()._handle_exception(error)
        self._exit_renderables.clear()


def _line(entry: Entry) -> Text:
    colour = COLOURS[entry.level]
    return Text.assemble(
        (f"{entry.when:%H:%M:%S} ", "#66727f"),
        (f"{entry.level.sign} ", colour),
        (f"{entry.axis}  " if entry.axis else "", "bold #dbe4ee"),
        (entry.text, colour if entry.level in {Level.ALARM, Level.ATTENTION} else "#b9c5d1"),
    )
