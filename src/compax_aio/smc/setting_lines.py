"""Settings into texts: one line each, with what it leaves behind in the axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

from ..checked_numbers import check_whole
from ..errors import InvalidCommandError
from ..escaping import shown
from .profile import Profile
from .vocabulary import check_command

__all__ = [
    "SettingLine",
    "SettingValue",
    "currents",
    "initial_speed",
    "limit_polarity",
    "ramp_slopes",
    "resolution",
    "settling_delay",
    "slew_speed",
    "variable_resolution",
]

SettingValue: TypeAlias = int | bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingLine:
    """One line that sets something, and what the axis has once it is taken."""

    text: str
    """Without name and terminator."""
    values: Mapping[str, SettingValue] = field(hash=False)
    """By field of ``AxisSettings``: what is to be noted in the own copy."""

    def __post_init__(self) -> None:
        """Keep the values as they are now."""
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))


def initial_speed(steps_s: int, profile: Profile) -> SettingLine:
    """
    Word the speed at which a ramp begins and ends (``I``, gem-controld), in whole steps/s.

    Raises:
        InvalidCommandError: Here and below: it is no whole number in range, or the profile does not know the command.
    """
    number = check_whole("the initial speed in steps/s", steps_s, *profile.speeds_steps_s)
    return _line(f"I{number}", profile, initial_speed_steps_s=number)


def slew_speed(steps_s: int, profile: Profile) -> SettingLine:
    """Word the speed at which moves travel (``V``, DCB p. 27; gem-controld), in whole steps/s."""
    number = check_whole("the slew speed in steps/s", steps_s, *profile.speeds_steps_s)
    return _line(f"V{number}", profile, slew_speed_steps_s=number)


def ramp_slopes(acceleration: int, deceleration: int, profile: Profile) -> SettingLine:
    """Word both ramps (``K``, gem-controld), in the axis's own measure; one cannot be set without the other."""
    first = check_whole("the slope of acceleration", acceleration, *profile.ramp_slopes)
    second = check_whole("the slope of deceleration", deceleration, *profile.ramp_slopes)
    return _line(f"K{first}{profile.separator}{second}", profile, acceleration_slope=first, deceleration_slope=second)


def currents(hold_percent: int, run_percent: int, profile: Profile) -> SettingLine:
    """Word the currents at standstill and in motion (``Y``, gem-controld); one cannot be set without the other."""
    hold = check_whole("the hold current in percent", hold_percent, *profile.current_percents)
    run = check_whole("the run current in percent", run_percent, *profile.current_percents)
    return _line(f"Y{hold}{profile.separator}{run}", profile, hold_current_percent=hold, run_current_percent=run)


def resolution(divider: int, profile: Profile) -> SettingLine:
    """Word the resolution (``D``, gem-controld); it waits until the motion before it is over (DCB p. 27)."""
    number = check_whole("the resolution", divider, *profile.resolutions)
    return _line(f"D{number}", profile, resolution=number)


def variable_resolution(is_variable: bool, profile: Profile) -> SettingLine:
    """Word whether the resolution is variable, or fixed (``H``, gem-controld)."""
    flag = _flag("variable_resolution", is_variable)
    return _line(f"H{flag:d}", profile, variable_resolution=flag)


def settling_delay(delay: int, profile: Profile) -> SettingLine:
    """Word the settling delay in the axis's own measure, whose unit is not known (``E``, panther)."""
    if profile.settling_delays is None:
        raise InvalidCommandError(
            f"which settling delays {profile.name} takes is not known",
            hint="raw() sends one all the same; a profile with settling_delays does so from here on",
        )
    number = check_whole("the settling delay", delay, *profile.settling_delays)
    return _line(f"E{number}", profile, settling_delay=number)


def limit_polarity(active_high: bool, profile: Profile) -> SettingLine:
    """Word whether the limit inputs are active when high (``l``, motorIms)."""
    flag = _flag("limit_active_high", active_high)
    return _line(f"l{flag:d}", profile, limit_active_high=flag)


def _line(text: str, profile: Profile, **values: SettingValue) -> SettingLine:
    return SettingLine(text=check_command(text, profile), values=values)


def _flag(what: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise InvalidCommandError(f"{what} is True or False, not {shown(value)}")
    return value
