"""The stage of a simulation: drives as users hold them, and a note of everything that is asked and told."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from compax_aio.compax.drive import Drive
from compax_aio.compax.moves import Move, fetch_error
from compax_aio.errors import CompaxError

from .scenario import Action
from .testimony import Call, Seen, SeenAxis
from .troubled_line import TroubledLine

__all__ = ["Stage"]


class Stage:
    """
    What users act on.

    Args:
        testimony: Where everything is noted.

    Attributes:
        drives: Those that are connected, by axis.
        lines: The line of each axis.
    """

    def __init__(self, testimony: Seen) -> None:
        self.testimony = testimony
        self.drives: dict[str, Drive] = {}
        self.lines: dict[str, TroubledLine] = {}
        self._loop = asyncio.get_running_loop()
        self._followers: set[asyncio.Task[None]] = set()

    def now(self) -> float:
        """Return the time of the event loop."""
        return self._loop.time()

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

    def ended(self, call: Call, outcome: Any) -> None:
        """Note what a caller was told just now."""
        call.ended(self.now(), outcome, self.axis(call.axis).far)

    async def tell(self, call: Call, work: Awaitable[Any]) -> Any:
        """Await *work* on behalf of *call*; returns None if it raises one of our errors."""
        try:
            result = await work
        except CompaxError as error:
            self.ended(call, error)
            return None
        except BaseException as error:
            self.ended(call, error)
            raise
        self.ended(call, result)
        return result

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

    def follow(self, call: Call, move: Move) -> None:
        """Note what becomes of *move*."""
        call.move, call.text, call.on_cancel = move, move.plan.motion, move.on_cancel

        def ended(_: object) -> None:
            self.ended(call, asyncio.CancelledError() if move.cancelled() else move.exception() or move.result())

        move.add_done_callback(fetch_error)
        move.add_done_callback(ended)
