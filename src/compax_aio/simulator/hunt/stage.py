"""The stage of a simulation: drives as users hold them, and a note of everything that is asked and told."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from compax_aio.compax.drive import Drive
from compax_aio.compax.moves import Move
from compax_aio.errors import CompaxError

from .notes import Notes
from .scenario import Action
from .testimony import Call, Seen, SeenAxis, Standing
from .troubled_line import TroubledLine

__all__ = ["Stage"]


class Stage(Notes[Call]):
    """
    What users act on.

    Args:
        testimony: Where everything is noted.

    Attributes:
        drives: Those that are connected, by axis.
        lines: The line of each axis.
    """

    def __init__(self, testimony: Seen) -> None:
        super().__init__()
        self.testimony = testimony
        self.drives: dict[str, Drive] = {}
        self.lines: dict[str, TroubledLine] = {}
        self._followers: set[asyncio.Task[None]] = set()

    def axis(self, axis: str) -> SeenAxis:
        """Return what is noted of an axis."""
        return self.testimony.axes[axis]

    def is_closed(self, axis: str) -> bool:
        """Whether somebody has closed the drive of an axis."""
        return any(call.what == "close" for call in self.axis(axis).calls)

    def follow_events(self, axis: str, drive: Drive) -> None:
        """Note all events of *drive* until it is closed."""
        stream, events = drive.events(), self.axis(axis).events

        async def follow() -> None:
            async for event in stream:
                events.append(event)

        self._followers.add(task := self._loop.create_task(follow(), name=f"follows {axis}"))
        task.add_done_callback(self._followers.discard)

    def note(self, item: int, axis: str, what: str, detail: Any = None, *, text: str | None = None) -> Call:
        """Note that something is asked now."""
        call = Call(item, axis, what, self.now(), detail, text, asked_index=len(self.axis(axis).wire))
        self.axis(axis).calls.append(call)
        return call

    async def ask(self, action: Action, what: str, work: Callable[[Drive], Awaitable[Any]], detail: Any = None) -> Any:
        """Do one thing with the only drive of *action*."""
        (axis,) = action.axes
        call = self.note(action.number, axis, what, detail)
        return await self.tell(call, work(self.drives[axis]))

    def begin(self, action: Action, axis: str, what: str, start: Callable[[Drive], Move]) -> Move | None:
        """Begin a move, and note what becomes of it; None if it is refused at once."""
        call = self.note(action.number, axis, what, action.arguments)
        try:
            move = start(self.drives[axis])
        except CompaxError as error:
            self.ended(call, error)
            return None
        self.follow(call, move)
        return move

    def far(self, axis: str) -> Standing:
        """Return the drive at the far end."""
        return self.axis(axis).far

    def motion_text(self, move: Any) -> str:
        """Return the line that starts a move, without signs."""
        text: str = move.plan.motion
        return text
