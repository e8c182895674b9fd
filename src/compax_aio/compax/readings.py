"""What a drive can be asked: position, speed, status bits, errors, and every status value by its number."""

from __future__ import annotations

from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..link.contract import Lane
from .codecs import (
    DriveStatus,
    HistoryEntry,
    MonitorValue,
    StatusValue,
    decode_error,
    decode_history,
    decode_monitor_value,
    decode_status_value,
)
from .facts.device_errors import DeviceError
from .facts.quantities import SELECTORS
from .line import DriveLine
from .observer import Observer
from .plain_line import as_index

__all__ = ["MAX_STATUS", "Readings"]

MAX_STATUS: Final = 250

_FAULT_STATUS: Final = 16
"""Its first digit is 0 while there is a fault (UG p. 209)."""


class Readings:
    """
    The readings of one drive; :class:`~compax_aio.compax.drive.Drive` has them.

    Args:
        line: The drive's line.
        observer: Of the same drive.
    """

    def __init__(self, line: DriveLine, observer: Observer) -> None:
        self._line = line
        self._observer = observer

    @property
    def unit(self) -> str:
        """The name of the axis's unit, from the settings."""
        return self._line.settings.unit

    async def position(self) -> float:
        """Read the actual position (S1, UG p. 104) in :attr:`unit`."""
        return await self._line.position()

    async def target(self) -> float:
        """Read the target position (S2, IBS p. 12) in :attr:`unit`."""
        return await self._line.number(2)

    async def following_error(self) -> float:
        """Read set minus actual position (S3, IBS p. 38) in :attr:`unit`."""
        return await self._line.number(3)

    async def speed(self) -> float:
        """Read the traverse speed (S4, IBS p. 70), by inference in % of nominal speed."""
        return await self._line.number(4)

    async def torque(self) -> float:
        """Read the motor torque (S5, IBS p. 70), by inference in % of nominal torque."""
        return await self._line.number(5)

    async def status(self) -> DriveStatus:
        """Read S16 and S17, every bit by its name (UG p. 209)."""
        return await self._observer.read_status(Lane.READ)

    async def error(self) -> DeviceError | None:
        """Read the error that is present (S30, IBS p. 12); None if there is none."""
        error = await self._line.read("S30", decode_error)
        self._observer.note_error(error)
        return error

    async def error_history(self) -> tuple[HistoryEntry, ...]:
        """Read the error history (S18, UG p. 209), newest first."""
        return await self._line.read("S18", decode_history)

    async def read_status(self, number: int) -> StatusValue:
        """
        Read the status value ``S<number>``, decoded as far as its form is documented.

        Raises:
            InvalidCommandError: *number* is not a whole number from 1 to 250.
        """
        index = as_index(number)
        if index is None or not 1 <= index <= MAX_STATUS:
            raise InvalidCommandError(f"a status has a whole number from 1 to {MAX_STATUS}, not {shown(number)}")
        number = index
        status = await self._line.read(f"S{number}", lambda answer: decode_status_value(number, answer, self.unit))
        if number == _FAULT_STATUS:
            await self._observer.note(no_fault=str(status.value).startswith("1"))
        return status

    async def read_monitor(self, number: int) -> MonitorValue:
        """
        Read S13, S14 or S15 with what it shows: first the parameter that chooses it, then the value (UG p. 211).

        A parameter that was written and waits for VP may tell the quantity that is shown only from then on.

        Raises:
            InvalidCommandError: *number* is not 13, 14 or 15.
        """
        if type(number) is not int or number not in SELECTORS:
            raise InvalidCommandError(
                f"the quantity of a status can be chosen for S13, S14 and S15, not {shown(number)}"
            )
        chosen = await self._line.query(f"P{SELECTORS[number]}")
        return await self._line.read(
            f"S{number}", lambda answer: decode_monitor_value(number, chosen, answer, self.unit)
        )
