"""The stage of a simulation: a line with axes as users hold it, and a note of everything that is asked and told."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from compax_aio.errors import CompaxError
from compax_aio.smc.axis import SmcAxis
from compax_aio.smc.moves import AxisMove
from compax_aio.smc.party_line import PartyLine

from ..hunt.notes import Notes
from ..hunt.scenario import Action
from ..hunt.testimony import Standing
from .testimony import WHOLE_LINE, AxisCall, SeenLine

__all__ = ["PartyStage"]


class _Nowhere:
    """How a whole line stands: not at all."""

    position = 0.0
    moving = False


class PartyStage(Notes[AxisCall]):
    """
    What users act on.

    Args:
        testimony: Where everything is noted.

    Attributes:
        line: As the client holds it; None until it is open.
    """

    def __init__(self, testimony: SeenLine) -> None:
        super().__init__()
        self.testimony = testimony
        self.line: PartyLine | None = None
        self._followers: set[asyncio.Task[None]] = set()

    def far(self, axis: str) -> Standing:
        """Return the axis at the far end."""
        return _Nowhere() if axis == WHOLE_LINE else self.testimony.far.axes[axis]

    def motion_text(self, move: Any) -> str:
        """Return what starts a move."""
        text: str = move.plan.text
        return text

    def axis(self, letter: str) -> SmcAxis:
        """Return an axis as users hold it."""
        assert self.line is not None
        return self.line.axis(letter if self.line.mode.has_names else "")

    def note(self, item: int, axis: str, what: str, detail: Any = None) -> AxisCall:
        """Note that something is asked now."""
        call = AxisCall(item, axis, what, self.now(), detail, asked_index=len(self.testimony.wire))
        if self.line is not None:
            call.is_open_then = self.line.is_open
            if axis != WHOLE_LINE:
                call.joins_stop = self.axis(axis)._motion._stopping is not None  # noqa: SLF001  # nobody tells
        self.testimony.calls.append(call)
        return call

    def ended(self, call: AxisCall, outcome: Any) -> None:
        """Note what a caller was told just now."""
        Notes.ended(self, call, outcome)
        call.ended_index = len(self.testimony.wire)

    async def ask(
        self, action: Action, what: str, work: Callable[[SmcAxis], Awaitable[Any]], detail: Any = None
    ) -> Any:
        """Do one thing with the only axis of *action*."""
        (axis,) = action.axes
        call = self.note(action.number, axis, what, detail)
        return await self.tell(call, work(self.axis(axis)))

    async def ask_line(self, action: Action, what: str, work: Callable[[PartyLine], Awaitable[Any]]) -> Any:
        """Do one thing with the whole line."""
        assert self.line is not None
        return await self.tell(self.note(action.number, WHOLE_LINE, what), work(self.line))

    def begin(
        self, action: Action, what: str, start: Callable[[SmcAxis], AxisMove]
    ) -> tuple[AxisCall, AxisMove | None]:
        """Begin a move, and note what becomes of it; no move if it is refused at once."""
        (axis,) = action.axes
        call = self.note(action.number, axis, what, action.arguments)
        try:
            move = start(self.axis(axis))
        except CompaxError as error:
            self.ended(call, error)
            return call, None
        self.follow(call, move)
        return call, move

    def follow_events(self) -> None:
        """Note all events of the line until it is closed."""
        assert self.line is not None
        stream = self.line.events()

        async def follow() -> None:
            async for event in stream:
                self.testimony.events.append(event)

        self._followers.add(task := asyncio.ensure_future(follow()))
        task.add_done_callback(self._followers.discard)
