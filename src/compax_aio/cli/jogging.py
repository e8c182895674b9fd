"""Jogging: what each key does to the axis. At most one step is on its way, and no key that is pressed then waits."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from compax_aio import CompaxError, Drive, Move, MoveInDoubtError

__all__ = ["KEYS", "STEPS", "Jogging"]

STEPS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""In units of the axis; the arrows up and down go from one to the next."""

KEYS: Final = "← → one step · ↑ ↓ another step · space stop · h y machine zero · q stop and leave"


class Jogging:
    """
    Carries out what keys say, one motion at a time.

    A key that asks for a motion while one is on its way is not kept for later: the same direction is ignored, as
    keys repeat themselves while they are held, and the opposite one stops the axis, no more.

    Args:
        drive: What moves.
        step: How far one step is, in the unit of the axis, above 0.
        speed_percent: How fast, in percent of nominal speed.

    Attributes:
        step: How far the next step is.
        message: What happened last, for the person at the keys.
        on_change: Called when message or step has changed.
        left: Set when the person wants to leave.
        is_interrupted: Whether that was by Ctrl-C.
        failure: The error after which there is nothing to jog any more; None: there is none.
    """

    def __init__(self, drive: Drive, step: float, speed_percent: float) -> None:
        self.step = step
        self.message = ""
        self.left = asyncio.Event()
        self.is_interrupted = False
        self.failure: CompaxError | None = None
        self._drive = drive
        self._speed_percent = speed_percent
        self.on_change: Callable[[], None] = lambda: None
        self._move: Move | None = None
        self._direction = 0
        self._task: asyncio.Task[None] | None = None
        self._asks_for_home = False

    @property
    def is_moving(self) -> bool:
        """Whether a motion or a stop is on its way."""
        return self._task is not None and not self._task.done()

    def press(self, key: str) -> None:
        """
        Do what *key* says.

        Args:
            key: ``left``, ``right``, ``up``, ``down``, ``space``, ``s``, ``h``, ``y``, ``q``, ``interrupt``.
        """
        was_asked, self._asks_for_home = self._asks_for_home, False
        if key in {"left", "right"}:
            self._step(-1 if key == "left" else 1)
        elif key in {"up", "down"}:
            self._change_step(1 if key == "up" else -1)
        elif key in {"space", "s"}:
            self._begin(self._stop())
        elif key == "h":
            self._ask_for_home()
        elif key == "y" and was_asked:  # and not h again, which a key that is held says by itself
            self._home()
        elif key in {"q", "interrupt"}:
            self.is_interrupted |= key == "interrupt"
            self.left.set()
        elif was_asked:
            self._say("machine zero is not looked for")

    def _step(self, direction: int) -> None:
        if not self.is_moving:
            distance = direction * self.step
            self._direction = direction
            self._go(lambda: self._drive.move_by(distance, speed_percent=self._speed_percent), f"{distance:+g}")
        elif self._move is not None and direction != self._direction:
            self._begin(self._stop())

    def _ask_for_home(self) -> None:
        if not self.is_moving:
            self._asks_for_home = True
            self._say("look for machine zero? y: the axis moves as far as it must. Any other key: no")

    def _home(self) -> None:
        self._direction = 0
        self._go(self._drive.home, "machine zero")

    def _change_step(self, by: int) -> None:
        larger = [step for step in STEPS if step > self.step * 1.0001]
        smaller = [step for step in STEPS if step < self.step * 0.9999]
        self.step = (larger or [self.step])[0] if by > 0 else (smaller or [self.step])[-1]
        self._say(f"one step is {self.step:g} {self._drive.unit}")

    # Motion ---------------------------------------------------------------------------------------------------------

    def _go(self, start: Callable[[], Move], what: str) -> None:
        try:
            self._move = start()
        except CompaxError as error:
            self._note_failure(error)
            return
        self._say(f"{what} …")
        self._task = asyncio.ensure_future(self._follow(self._move, what))

    async def _follow(self, move: Move, what: str) -> None:
        try:
            await move
        except CompaxError as error:
            self._note_failure(error)
        else:
            self._say(f"{what}: reached")
        finally:
            self._move = None

    def _begin(self, stopping: asyncio.Future[None]) -> None:
        """Let a stop be what is on its way, in place of the motion that it ends."""
        self._move = None
        self._task = asyncio.ensure_future(self._until_stopped(stopping))

    def _stop(self) -> asyncio.Future[None]:
        self._say("stopping …")
        return asyncio.ensure_future(self._drive.stop())

    async def _until_stopped(self, stopping: asyncio.Future[None]) -> None:
        try:
            await stopping
        except CompaxError as error:
            self.failure = error
            self.left.set()
        else:
            self._say("stopped; it stands")

    def _note_failure(self, error: CompaxError) -> None:
        self._say(error.what)
        if isinstance(error, MoveInDoubtError) or not self._drive.is_open:
            self.failure = error
            self.left.set()

    def _say(self, message: str) -> None:
        self.message = message
        self.on_change()

    async def end(self) -> bool:
        """
        Stop what moves, and return when the axis stands: whether there was anything to stop.

        Raises:
            CompaxError: It may be moving; or that is why nothing could be jogged any more.
        """
        was_moving = self.is_moving
        if was_moving:
            await self._drive.stop()
        if self._task is not None:
            await asyncio.wait([self._task])
        if self.failure is not None:
            raise self.failure
        return was_moving
