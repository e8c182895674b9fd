"""What the machine says while a job is under way: whether it is paused, whether it still takes data, its errors."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Final, TypeVar

from ..errors import AnswerTimeoutError, ConnectionLostError, UnexpectedAnswerError
from ..link.contract import Lane
from ..motion.events import DriveEvent
from .cut import CutAccount, CutState
from .events import CutterError, CutterPaused, CutterResumed
from .facts.reports import IO_ERRORS
from .line import CutterLine, meaning_of
from .replies import CutterStatus
from .reports import CutReports

__all__ = ["MachineWatch"]

_T = TypeVar("_T")

_LOOK_WHEN_FULL_S: Final = 0.25
"""A cutter with a full buffer is asked so often whether it is paused …"""
_LOOK_WHEN_UNKNOWN_S: Final = 1.0
"""… one that does not say how full it is, so often; a nearly empty buffer shows that it is not."""
_PAUSED_POLL_S: Final = 0.01
"""So soon a paused machine is asked again: what happens at its end is told by the first look after it."""
_AGAIN_S: Final = 0.1


class MachineWatch:
    """
    Looks after the machine for one job.

    Args:
        line: Of the cutter.
        reports: Write the errors.
        account: Says what is known of the job.
        publish: Is told what happens.
        set_state: Is told what the job does.
        check: Raises if the job shall not go on.

    Attributes:
        reports, account, set_state, check: As above.
        capacity_bytes: Of the buffer.
        wake: Set it to have whoever waits look whether the job shall go on.
        warnings: What was told that ruins nothing.
    """

    def __init__(
        self,
        line: CutterLine,
        reports: CutReports,
        *,
        account: Callable[[], CutAccount],
        publish: Callable[[DriveEvent], None],
        set_state: Callable[[CutState], None],
        check: Callable[[], None],
    ) -> None:
        self.capacity_bytes = 0
        self.wake = asyncio.Event()
        self.warnings: list[str] = []
        self._line = line
        self._settings = line.settings
        self.reports = reports
        self.account = account
        self._publish = publish
        self.set_state = set_state
        self.check = check
        self._loop = asyncio.get_running_loop()
        self._seen: object = None
        self._was_held = False
        self._changed_at = self._looked_at = self._loop.time()
        self._poll_s = self._settings.poll_first_s

    # Time -----------------------------------------------------------------------------------------------------------

    async def pause(self, seconds: float) -> None:
        """Wait, but not when the job shall not go on."""
        self.wake.clear()
        self.check()
        try:
            async with asyncio.timeout(seconds):
                await self.wake.wait()
        except TimeoutError:
            pass
        self.check()

    def note(self, seen: object) -> None:
        """Take note of what changes as long as the cutter takes data."""
        if seen != self._seen:
            self._seen = seen
            self.restart()

    def restart(self) -> None:
        """Count anew for how long the cutter takes nothing."""
        self._changed_at = self._loop.time()
        self._poll_s = self._settings.poll_first_s

    @property
    def flat_s(self) -> float:
        """For how long nothing has changed."""
        return self._loop.time() - self._changed_at

    # Asking ---------------------------------------------------------------------------------------------------------

    async def ask(self, question: Callable[[], Awaitable[_T]]) -> _T:
        """
        Ask until it is answered, as long as a stalled cutter is waited for.

        Raises:
            MoveInDoubtError: The line is lost, or the cutter says nothing any more.
        """
        asked_at = self._loop.time()
        give_up_at = asked_at + self._settings.stall_timeout_s
        while True:
            try:
                answer = await question()
            except (AnswerTimeoutError, UnexpectedAnswerError) as error:
                self.check()
                if self._loop.time() >= give_up_at:
                    raise self.reports.lost(error, self.account()) from error
            except ConnectionLostError as error:
                self.check()
                raise self.reports.lost(error, self.account()) from error
            else:
                self.check()
                self._changed_at += self._loop.time() - asked_at  # meanwhile nobody could see whether anything changes
                return answer
            await self.pause(_AGAIN_S)

    async def status(self) -> CutterStatus:
        """Read the status."""
        return await self.ask(lambda: self._line.status(Lane.CONTROL))

    async def free_space(self) -> int:
        """Read the free space."""
        return await self.ask(lambda: self._line.free_space(Lane.CONTROL))

    # Waiting for the machine ----------------------------------------------------------------------------------------

    async def wait_for_room(self) -> None:
        """
        Wait a while, the longer the longer nothing has changed; find out why if that is long.

        Raises:
            MoveTimeoutError: For too long.
            MoveStoppedError: The operator has ended the job.
        """
        await self.pause(self._poll_s)
        self._poll_s = min(2 * self._poll_s, self._settings.poll_slowest_s)
        await self._look_if_due(_LOOK_WHEN_FULL_S)

    async def look(self, free_bytes: int | None) -> None:
        """
        Look whether the machine is paused, as often as its buffer, by the free space it has told last, gives cause to.

        Raises:
            MoveTimeoutError, MoveStoppedError: As :meth:`wait_for_room`.
        """
        if free_bytes is None:
            await self._look_if_due(_LOOK_WHEN_UNKNOWN_S)
        elif free_bytes < self.capacity_bytes * 3 // 4:
            await self._look_if_due(_LOOK_WHEN_FULL_S)

    async def _look_if_due(self, due_s: float) -> None:
        if self._loop.time() - self._looked_at < due_s:
            return
        status = await self._look()
        if _is_held(status):
            await self._until_resumed(status)
        elif self.flat_s >= self._settings.stall_timeout_s:
            raise self.reports.stalled(self.flat_s, self.account(), is_held=False)

    async def until_empty(self) -> None:
        """
        Wait until the buffer is empty and nobody holds the machine.

        Raises:
            MoveTimeoutError: It takes nothing for too long.
            MoveStoppedError: The operator has ended the job.
        """
        self.restart()
        while True:
            status = await self._look()
            if _is_held(status):
                await self._until_resumed(status)
                continue
            if status.buffer_is_empty:
                return
            self.note(await self.free_space())
            if self.flat_s >= self._settings.stall_timeout_s:
                raise self.reports.stalled(self.flat_s, self.account(), is_held=False)
            await self.pause(self._poll_s)
            self._poll_s = min(2 * self._poll_s, self._settings.poll_slowest_s)

    async def until_not_held(self) -> CutterStatus:
        """Wait until nobody holds the machine, before a job is begun."""
        while _is_held(status := await self.status()):
            await self._until_resumed(status)
        return status

    async def _look(self) -> CutterStatus:
        """
        Read the status.

        Raises:
            MoveInDoubtError: It was paused while nobody could follow it, and is not any more.
        """
        status = await self.status()
        self._looked_at = self._loop.time()
        was_held, self._was_held = self._was_held, False
        if was_held and not _is_held(status):
            raise self.reports.perhaps_cancelled(self.account())
        return status

    def note_status(self, status: CutterStatus) -> None:
        """Take note of a status that nobody here has asked for: it may be paused, unseen by others."""
        self._was_held = self._was_held or _is_held(status)

    async def _until_resumed(self, status: CutterStatus) -> None:
        """
        Wait as long as the operator wants, and see what he does.

        A paused machine takes nothing. If it has become empty all the same, its data was deleted: so PAUSE and SETUP
        end a job (PNC-900 p. 10). If it is empty the moment it goes on, that may be, too.
        """
        self.set_state("operator pause")
        self._publish(CutterPaused(self._line.name, self._loop.time()))
        was_empty = status.buffer_is_empty
        while _is_held(status):
            await self.pause(_PAUSED_POLL_S)
            status = await self.status()
            if status.buffer_is_empty and not was_empty:
                if _is_held(status):
                    raise self.reports.cancelled_at_machine(self.account())
                raise self.reports.perhaps_cancelled(self.account())
            was_empty = status.buffer_is_empty
        self._was_held = False
        self._publish(CutterResumed(self._line.name, self._loop.time()))
        self.restart()

    # Errors ---------------------------------------------------------------------------------------------------------

    async def look_for_errors(self) -> None:
        """
        Read the errors of the line (``.E``).

        Raises:
            DriveFaultError: One of them ruins the job.
        """
        for code in await self.ask(lambda: self._line.errors(Lane.CONTROL)):
            error = IO_ERRORS.get(code)
            self._publish(CutterError(self._line.name, self._loop.time(), code, meaning_of(code), "ESC.E"))
            if error is None or error.ruins_job:
                raise self.reports.faulty(code, self.account())
            self.warnings.append(f"the cutter has told {meaning_of(code)}")


def _is_held(status: CutterStatus) -> bool:
    return status.is_paused or bool(status.is_suspended)
