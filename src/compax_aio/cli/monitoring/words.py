"""What a person is told of an axis: one state in words, what to do about it, and its status flags as lamps."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from compax_aio.compax.codecs import DriveStatus

from .levels import Level
from .state import AxisState, Phase

__all__ = ["Lamp", "LampLight", "Said", "by_keys", "duration", "lamps", "say"]


@dataclass(frozen=True, slots=True)
class Said:
    """The state of an axis."""

    level: Level
    state: str
    """A word or two."""
    detail: str = ""
    """Why, and what to do."""


class LampLight(Enum):
    """How a lamp is shown."""

    DARK = "○"
    LIT = "●"
    WARNING = "▲"
    UNKNOWN = "·"


@dataclass(frozen=True, slots=True)
class Lamp:
    """One status flag."""

    label: str
    light: LampLight


@dataclass(frozen=True, slots=True)
class _Flag:
    label: str
    bit: str
    warns: bool = False
    is_inverted: bool = False


_FLAGS: Final = (
    _Flag("fault", "no_fault", warns=True, is_inverted=True),
    _Flag("warning", "no_warning", warns=True, is_inverted=True),
    _Flag("power", "running"),
    _Flag("homed", "machine_zero_approached"),
    _Flag("ready", "ready_for_start"),
    _Flag("active", "command_active"),
    _Flag("reached", "position_reached"),
    _Flag("stopped", "idle_after_stop", warns=True),
    _Flag("I6", "stopped_by_input", warns=True),
    _Flag("program", "program_running"),
)


def lamps(status: DriveStatus | None) -> tuple[Lamp, ...]:
    """Return the named bits of S16 and S17 (UG p. 209) that tell how an axis stands; None: nothing is known."""
    return tuple(Lamp(flag.label, _light(flag, status)) for flag in _FLAGS)


def _light(flag: _Flag, status: DriveStatus | None) -> LampLight:
    if status is None:
        return LampLight.UNKNOWN
    if getattr(status, flag.bit) is flag.is_inverted:
        return LampLight.DARK
    return LampLight.WARNING if flag.warns else LampLight.LIT


_KEY_FOR: Final = {"call reconcile()": "press r", "reconcile()": "r", "quit()": "a to acknowledge it"}


def by_keys(text: str) -> str:
    """Word the advice of the library for somebody who has the keys of the monitor, and no program."""
    for call, key in _KEY_FOR.items():
        text = text.replace(call, key)
    return text


def duration(seconds: float) -> str:
    """Write a time for people: ``12 s``, ``3 min``, ``2 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"


def say(axis: AxisState, now: float) -> Said:
    """Say how *axis* stands: what matters most goes first."""
    if axis.phase is not Phase.OPEN:
        return _say_line(axis, now)
    if axis.stop is not None and axis.stop.level is Level.WAITING:
        return Said(Level.WAITING, "STOPPING", axis.stop.text)
    status = axis.status(now)
    if status is None:
        return _say_silence(axis, now)
    if axis.doubt is not None:
        seen = "its command is active" if status.command_active else "no command is active"
        return Said(Level.ALARM, "IN DOUBT", f"{seen}; look at the machine, then r: {axis.doubt}")
    if not status.no_fault:
        return _say_fault(axis)
    return _say_motion(axis, status)


def _say_line(axis: AxisState, now: float) -> Said:
    since = duration(max(0.0, now - axis.since))
    tried = f"tried {axis.attempts} time{'s' * (axis.attempts != 1)}"
    if axis.phase is Phase.OPENING:
        again = f"{tried} in vain: {axis.trouble}" if axis.attempts else ""
        return Said(Level.WAITING, "CONNECTING", again)
    if axis.phase is Phase.LOST:
        return Said(Level.ALARM, f"LINE LOST {since}", f"{tried}; it may move; {axis.trouble}")
    if axis.phase is Phase.ENDED:
        return Said(Level.ALARM, f"LINE LOST {since}", f"not tried any more (c connects anew); {axis.trouble}")
    soon = 0.0 if axis.next_attempt_at is None else max(0.0, axis.next_attempt_at - now)
    return Said(Level.ALARM, "NOT REACHABLE", f"{tried}, again in {soon:.0f} s (c: now): {axis.trouble}")


def _say_silence(axis: AxisState, now: float) -> Said:
    if now - axis.since <= axis.fresh_for_s and "status" not in axis.refused:
        return Said(Level.WAITING, "CONNECTED", "waiting for the first reading")
    age = axis.age_s("status", now)
    if age is not None:
        return Said(Level.ALARM, "NO ANSWER", f"it has not said how it stands for {duration(age)}; it may move")
    if "status" in axis.refused:
        return Said(Level.ATTENTION, "NO STATUS", f"it refuses to say how it stands: {axis.refused['status'].what}")
    return Said(Level.ALARM, "NO ANSWER", "it has not said how it stands since it was connected")


def _say_fault(axis: AxisState) -> Said:
    if axis.error is None:
        return Said(Level.ALARM, "FAULT", "the drive does not say which; mend the cause, then a acknowledges it")
    return Said(Level.ALARM, f"FAULT E{axis.error.code}", by_keys(f"{axis.error.meaning}: {axis.error.remedy}"))


def _say_motion(axis: AxisState, status: DriveStatus) -> Said:
    if status.command_active:
        was_own = axis.values["status"].at <= axis.own_ended_at  # it has ended since
        return Said(Level.ACTIVE, "MOVING", axis.own_motion or ("" if was_own else "not started here"))
    if axis.own_motion is not None:
        return Said(Level.ACTIVE, "BEGINS", axis.own_motion)
    if status.program_running:
        return Said(Level.ACTIVE, "PROGRAM RUNS", "not started here")
    return _say_standstill(axis, status)


def _say_standstill(axis: AxisState, status: DriveStatus) -> Said:
    warning = "" if status.no_warning else f"warning {axis.error}" if axis.error else "a warning is present"
    if not status.running:
        return Said(Level.ATTENTION, "POWER OFF", warning)
    if not status.machine_zero_approached:
        return Said(Level.ATTENTION, "NOT HOMED", warning or "standing; h finds machine zero")
    if warning:
        return Said(Level.ATTENTION, "STANDING", warning)
    if status.shows_stop:
        return Said(Level.QUIET, "STANDING", "stopped by input I6" if status.stopped_by_input else "after a stop")
    return Said(Level.QUIET, "STANDING")
