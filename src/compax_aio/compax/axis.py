"""What the axis is and what is switched on it: unit and travel, outputs, power stage, real zero."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

from ..errors import InvalidCommandError, UnexpectedAnswerError
from ..link.contract import Lane
from .codecs import DriveStatus, decode_number
from .line import DriveLine
from .motion import Motion
from .observer import Observer
from .vocabulary import setting_of_outputs

__all__ = ["Axis", "AxisCommands", "PowerState"]

PowerState = Literal["on", "off", "off_brake_open"]

_OUTPUT_0: Final = re.compile(r"O0=([012])")
_S16_BITS_7_AND_8: Final = {"0": "00", "1": "10", "2": "01"}
"""By what OUTPUT O0 was set to (UG p. 209)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """What the drive's parameters say about its axis."""

    unit_code: float
    """P90 as read."""
    unit: str
    """From ``DriveSettings.units``, or the one of the settings, where they do not say what *unit_code* means."""
    decimals: int
    """Of positions and distances: 2 or 3 (UG p. 100)."""
    travel: tuple[float, float] | None
    """Lowest and highest position, from P11 and P12 (UG p. 100); None where these are the same."""


class AxisCommands:
    """What can be read of one axis and switched on it; :class:`~compax_aio.compax.drive.Drive` has these methods."""

    _line: DriveLine
    _observer: Observer
    _motion: Motion

    async def output(self, first: int, *levels: bool | int) -> None:
        """
        Set outputs (``OUTPUT``, UG p. 95, CAN p. 59): ``output(7, 1)`` sets O7, ``output(7, 1, 0)`` also clears O8.

        Args:
            first: 1 to 16.
            levels: 0 or 1 for each of 1 to 8 outputs in a row.

        Raises:
            InvalidCommandError: There is no such output or level; nothing was sent.
        """
        await self._line.command(setting_of_outputs(first, levels))

    async def power(self, state: PowerState) -> DriveStatus:
        """
        Switch the power stage (``OUTPUT O0``, UG p. 162), and look at S16 whether it was done.

        Args:
            state: ``"on"``: energised. ``"off"``: no current, brake closed. ``"off_brake_open"``: no current and brake
                open, so that a hanging load falls. Which number of O0 does what is inferred, and part of the dialect.

        Raises:
            InvalidCommandError: There is no such state; nothing was sent.
            MoveActiveError: A move runs; stop it first.
            UnexpectedAnswerError: The drive acknowledged it, and its status does not show it.
        """
        if state not in get_args(PowerState):
            raise InvalidCommandError(f"power is one of {', '.join(get_args(PowerState))}, not {state!r}")
        dialect = self._line.settings.dialect
        word = {"on": dialect.power_on, "off": dialect.power_off, "off_brake_open": dialect.power_off_brake_open}[state]
        self._motion.refuse_second(f"power({state!r})")
        await self._line.command(word)
        status = await self._observer.read_status()
        number = _OUTPUT_0.search(word)
        if number is not None and status.s16[6:8] != _S16_BITS_7_AND_8[number[1]]:
            raise UnexpectedAnswerError(
                f"the drive acknowledged power({state!r}), and its status does not show it",
                device=self._line.name,
                sent=word,
                received=status.as_sent,
                hint="do not touch the axis; find out whether it has power",
                exchanges=self._line.link.recent(),
            )
        return status

    async def set_real_zero(self) -> None:
        """
        Take the actual position as real zero (CAN p. 32); its word is part of the dialect.

        Raises:
            InvalidCommandError: The settings have no word for it.
            MoveActiveError: A move runs.
        """
        word = self._line.settings.dialect.real_zero
        if word is None:
            raise InvalidCommandError(
                "the RS-232 word for taking the position as real zero stands on no page that was available",
                hint="give it as DriveSettings(dialect=Dialect(real_zero=...)) if your manual has it",
            )
        self._motion.refuse_second("set_real_zero()")
        await self._line.command(word)

    async def read_axis(self) -> Axis:
        """
        Read the unit (P90) and the limits of the travel (P11, P12; UG p. 100), and keep to them from now on.

        Targets outside are refused before they are sent. What a value of P90 means is looked up in
        ``DriveSettings.units``; a value that is not there changes nothing. Read again after you changed one of them.
        """
        settings = self._line.settings
        code = await self._line.read("P90", decode_number, Lane.CONTROL)
        limits = sorted([await self._line.read(f"P{number}", decode_number, Lane.CONTROL) for number in (11, 12)])
        known = settings.units.get(int(code)) if code == int(code) else None
        axis = Axis(
            unit_code=code,
            unit=known.name if known else settings.unit,
            decimals=known.decimals if known else settings.decimals,
            travel=(limits[0], limits[1]) if limits[0] < limits[1] else None,
        )
        self._line.settings = replace(settings, unit=axis.unit, decimals=axis.decimals, travel=axis.travel)
        return axis
