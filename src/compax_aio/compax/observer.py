"""Looking at a drive: status and position as they are, faults told once, patience with a line in trouble."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeVar

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, UnexpectedAnswerError
from ..link.contract import Lane
from .codecs import DriveStatus, decode_error
from .facts.device_errors import FAULT_CODES, DeviceError
from .line import DriveLine

__all__ = ["Look", "Observer"]

_Value = TypeVar("_Value")


@dataclass(frozen=True, slots=True)
class Look:
    """The status and actual position of a drive, read one after the other."""

    status: DriveStatus
    position: float | None
    """S1, or None where it cannot be read."""

    @property
    def as_sent(self) -> str:
        """The status as the drive sent it, for errors."""
        return self.status.as_sent


class Observer:
    """
    Reads what the library itself wants to know of a drive, ahead of what callers have queued.

    Args:
        line: The drive's line.
        on_fault: Called when a status that was read shows a fault, once for each.
    """

    def __init__(self, line: DriveLine, on_fault: Callable[[DeviceError | None], None]) -> None:
        self.line = line
        self._on_fault = on_fault
        self._faulted = False
        self.is_homed = False
        """Whether machine zero had been approached when the status was read last (S16 bit 3, UG p. 209)."""

    async def read_status(self, lane: Lane = Lane.CONTROL) -> DriveStatus:
        """Read S16 and S17; a fault they show is told to whoever follows the drive's events."""
        status = await self.line.status(lane)
        self.is_homed = status.machine_zero_approached
        await self.note(no_fault=status.no_fault, lane=Lane.CONTROL if lane is Lane.READ else lane)
        return status

    async def note(self, *, no_fault: bool, lane: Lane = Lane.CONTROL) -> None:
        """Take note of S16 bit 1; a fault that is new is told to whoever follows the drive's events."""
        if no_fault:
            self._faulted = False
        elif not self._faulted:
            self._faulted = True
            try:
                error = await self.read_error(lane)
            except BaseException:
                self._faulted = False  # the next look tells it
                raise
            self._on_fault(error)

    def note_error(self, error: DeviceError | None) -> None:
        """Take note of what S30 says; a fault that is new is told likewise."""
        if error is not None and error.code in FAULT_CODES and not self._faulted:
            self._faulted = True
            self._on_fault(error)

    async def read_error(self, lane: Lane = Lane.CONTROL) -> DeviceError | None:
        """Read S30; None also where the drive does not say, or cannot be heard: the fault itself is known already."""
        try:
            return await self.line.read("S30", decode_error, lane)
        except (AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError):
            return None

    async def look(self, lane: Lane = Lane.CONTROL) -> Look:
        """Read status, then position."""
        status = await self.read_status(lane)
        try:
            position: float | None = await self.line.position(lane)
        except (CommandRejectedError, UnexpectedAnswerError):
            position = None
        return Look(status, position)

    async def patiently(self, read: Callable[[], Awaitable[_Value]]) -> _Value:
        """Read, again and again if need be; raise the last error when it has failed for ``in_doubt_after_s``."""
        loop = asyncio.get_running_loop()
        give_up_at = loop.time() + self.line.settings.in_doubt_after_s
        while True:
            try:
                return await read()
            except CompaxError:
                if self.line.link.is_over or loop.time() >= give_up_at:
                    raise
            await asyncio.sleep(self.line.settings.poll_first_s)

    async def commanded_position(self, lane: Lane = Lane.CONTROL) -> float:
        """Read S2, the target position (IBS p. 12), or S1 from a drive that has none to give."""
        try:
            return await self.line.number(2, lane)
        except (CommandRejectedError, UnexpectedAnswerError):
            return await self.line.position(lane)

    async def standing_position(self, lane: Lane = Lane.CONTROL) -> float:
        """Read where a relative move begins: S2, unless the axis stands elsewhere, as after a stop; then S1."""
        commanded = await self.commanded_position(lane)
        actual = await self.line.position(lane)
        return commanded if self.is_near(commanded, actual) else actual

    def is_near(self, position: float | None, target: float | None) -> bool:
        """Whether two positions are the same but for a few of the last decimals."""
        tolerance = 5 * 10.0**-self.line.settings.decimals
        return position is not None and target is not None and abs(position - target) <= tolerance

    def written(self, position: float | None) -> str:
        """Write a position for an error."""
        if position is None:
            return "an unknown position"
        settings = self.line.settings
        return f"{position:.{settings.decimals}f} {settings.unit}"
