"""The settings of one axis: written, kept in a copy on this side, stored in the axis."""

from __future__ import annotations

from ..errors import InvalidCommandError
from . import setting_lines
from .observer import Observer
from .own_copy import AxisSettings, SettingsCopy
from .setting_lines import SettingLine
from .vocabulary import store

__all__ = ["SettingsOfAxis"]


class SettingsOfAxis:
    """
    Speeds, ramps, currents and the like of one axis.

    On a party line they cannot be read back (panther): what is known of them is what was written from here and
    taken. A value that the axis does not like it may ignore, or cut to what it has, without a word.

    Args:
        observer: Of the axis.
        copy: What is known.
    """

    def __init__(self, observer: Observer, copy: SettingsCopy) -> None:
        self._observer = observer
        self._copy = copy

    @property
    def known(self) -> AxisSettings:
        """What the axis was told from here, and took; None where that is nothing, or a reset has taken it back."""
        return self._copy.settings

    @property
    def known_after_reset(self) -> AxisSettings:
        """What of it was stored, and comes back after a reset."""
        return self._copy.stored_settings

    async def write(
        self,
        *,
        initial_speed_steps_s: int | None = None,
        slew_speed_steps_s: int | None = None,
        acceleration_slope: int | None = None,
        deceleration_slope: int | None = None,
        hold_current_percent: int | None = None,
        run_current_percent: int | None = None,
        resolution: int | None = None,
        variable_resolution: bool | None = None,
        settling_delay: int | None = None,
        limit_active_high: bool | None = None,
    ) -> AxisSettings:
        """
        Write settings, and return what is known then; all are checked before the first is sent.

        Args:
            initial_speed_steps_s: Where a ramp begins and ends (``I``), in the range of the profile.
            slew_speed_steps_s: At which moves travel (``V``), likewise.
            acceleration_slope: In the axis's own measure, 0 to 255 (``K``); one slope that is not given is as it was.
            deceleration_slope: Likewise.
            hold_current_percent: At standstill, 0 to 100 (``Y``); one current that is not given is as it was.
            run_current_percent: In motion, likewise.
            resolution: 0 to 8 (``D``).
            variable_resolution: Or fixed (``H``).
            settling_delay: In a unit that no source names (``E``), where the profile has a range.
            limit_active_high: The level of the limit inputs (``l``).

        Raises:
            InvalidCommandError: A value cannot be told to this axis, or the other one of a pair is not known; nothing
                was sent.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: One was not taken;
                those before it were, in the order above, and :attr:`known` says so.
        """
        profile, known = self._observer.line.settings.profile, self.known
        lines: list[SettingLine] = []
        if initial_speed_steps_s is not None:
            lines.append(setting_lines.initial_speed(initial_speed_steps_s, profile))
        if slew_speed_steps_s is not None:
            lines.append(setting_lines.slew_speed(slew_speed_steps_s, profile))
        if acceleration_slope is not None or deceleration_slope is not None:
            first = _both("acceleration_slope", acceleration_slope, known.acceleration_slope)
            second = _both("deceleration_slope", deceleration_slope, known.deceleration_slope)
            lines.append(setting_lines.ramp_slopes(first, second, profile))
        if hold_current_percent is not None or run_current_percent is not None:
            hold = _both("hold_current_percent", hold_current_percent, known.hold_current_percent)
            run = _both("run_current_percent", run_current_percent, known.run_current_percent)
            lines.append(setting_lines.currents(hold, run, profile))
        if resolution is not None:
            lines.append(setting_lines.resolution(resolution, profile))
        if variable_resolution is not None:
            lines.append(setting_lines.variable_resolution(variable_resolution, profile))
        if settling_delay is not None:
            lines.append(setting_lines.settling_delay(settling_delay, profile))
        if limit_active_high is not None:
            lines.append(setting_lines.limit_polarity(limit_active_high, profile))
        for line in lines:
            await self._write(line)
        return self.known

    async def _write(self, line: SettingLine) -> None:
        for name in line.values:
            self._copy.note_in_doubt(name)  # whatever becomes of it, it is not surely the old one any more
        await self._observer.line.tell(self._observer.axis, line.text)
        for name, value in line.values.items():
            self._copy.note_written(name, value)

    async def store(self) -> None:
        """
        Let the axis keep its settings, and its name, without power (``S``, DCB p. 23). Its memory wears out by it.

        Raises:
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: Whether it has is
                unknown.
        """
        text = store(self._observer.line.settings.profile)
        self._copy.note_store_in_doubt()  # until it is known that it has
        await self._observer.line.tell(self._observer.axis, text)
        self._copy.note_stored()


def _both(name: str, given: int | None, known: int | None) -> int:
    """Return what one half of a pair shall be."""
    value = known if given is None else given
    if value is None:
        raise InvalidCommandError(
            f"{name} is not known, and the other one cannot be set without it", hint="give both of them"
        )
    return value
