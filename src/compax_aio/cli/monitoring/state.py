"""All that is known of one axis, with the time when it was said; no screen, no line, time is an input."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from compax_aio.compax.codecs import DriveStatus
from compax_aio.compax.facts.device_errors import DeviceError
from compax_aio.compax.watch import Reading
from compax_aio.errors import CommandRejectedError

from .levels import Level
from .trend import Trend

__all__ = ["DETAILS", "ESSENTIALS", "AxisState", "Dated", "Phase", "StopReport"]

ESSENTIALS: Final = ("position", "status")
"""Read as often as was asked for."""
DETAILS: Final = ("target", "following_error", "speed", "torque")
"""Read half as often."""

_LEAST_FRESH_S: Final = 2.0
_RATE_OVER_S: Final = 5.0
_MAX_TIMES: Final = 1000


class Phase(Enum):
    """How the line of an axis stands."""

    OPENING = "being opened"
    UNREACHABLE = "could not be opened"
    OPEN = "open"
    LOST = "lost, and tried again"
    ENDED = "not tried any more"


@dataclass(frozen=True, slots=True)
class Dated:
    """A value that the drive has sent, and when."""

    value: Any
    at: float


@dataclass(frozen=True, slots=True)
class StopReport:
    """What came of a stop, so far."""

    at: float
    level: Level
    """WAITING, QUIET (acknowledged, and the axis stands) or ALARM."""
    text: str


@dataclass
class AxisState:
    """
    What is known of one axis.

    Attributes:
        name: Of the axis.
        url: Of its line.
        interval_s: Seconds from one reading to the next, as asked for.
        phase: How its line stands.
        since: Loop time when *phase* began.
        trouble: Why the line is not there.
        attempts: How often the line was tried in vain, in this phase.
        next_attempt_at: When it is tried again; None where it is not known.
        unit: Of positions.
        decimals: Of positions.
        travel: Lowest and highest position; None where they are not known.
        values: By quantity: what the drive said last, however old.
        refused: By quantity: what the drive answered in place of a value.
        error: The error or warning that is present, where the drive says which.
        doubt: Why the drive takes no motion from here; None if it does.
        own_motion: What was started here and is not over, in words.
        own_ended_at: Loop time when that was last known to be over.
        stop: What came of the last stop from here.
    """

    name: str
    url: str
    interval_s: float
    phase: Phase = Phase.OPENING
    since: float = 0.0
    trouble: str = ""
    attempts: int = 0
    next_attempt_at: float | None = None
    unit: str = ""
    decimals: int = 2
    travel: tuple[float, float] | None = None
    values: dict[str, Dated] = field(default_factory=dict)
    refused: dict[str, CommandRejectedError] = field(default_factory=dict)
    error: DeviceError | None = None
    doubt: str | None = None
    own_motion: str | None = None
    own_ended_at: float = float("-inf")
    stop: StopReport | None = None
    answer_time_s: float | None = None
    position_trend: Trend = field(default_factory=Trend)
    error_trend: Trend = field(default_factory=Trend)
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=_MAX_TIMES))

    def enter(self, phase: Phase, now: float, trouble: str = "") -> None:
        """Take note of how the line stands from now on."""
        if phase is not self.phase:
            self.phase, self.since = phase, now
        self.trouble = trouble
        self.next_attempt_at = None

    def take(self, reading: Reading) -> None:
        """Take what the drive said; what it did not say this time stays, and grows old."""
        for quantity, value in reading.values.items():
            self.values[quantity] = Dated(value, reading.at)
            self.refused.pop(quantity, None)
        for quantity, error in reading.errors.items():
            if isinstance(error, CommandRejectedError):
                self.refused[quantity] = error
        if "position" in reading:
            self._times.append(reading.at)
            self.position_trend.add(reading.at, reading["position"])
        if "following_error" in reading:
            self.error_trend.add(reading.at, reading["following_error"])
        if (status := reading.values.get("status")) and status.no_fault and status.no_warning:
            self.error = None

    @property
    def fresh_for_s(self) -> float:
        """A value that is older is shown as old."""
        return max(4 * self.interval_s, _LEAST_FRESH_S)

    def is_current(self, quantity: str, now: float) -> bool:
        """Whether the drive said it just now, on a line that is there."""
        dated = self.values.get(quantity)
        return dated is not None and self.phase is Phase.OPEN and now - dated.at <= self.fresh_for_s

    def age_s(self, quantity: str, now: float) -> float | None:
        """Return how long ago the drive said it; None if it never did."""
        dated = self.values.get(quantity)
        return None if dated is None else max(0.0, now - dated.at)

    def status(self, now: float) -> DriveStatus | None:
        """Return S16 and S17 if they are current."""
        return self.values["status"].value if self.is_current("status", now) else None

    def is_seen_moving(self, now: float) -> bool:
        """Whether the drive says that a positioning or a program runs."""
        status = self.status(now)
        return status is not None and (status.command_active or status.program_running)

    def readings_per_s(self, now: float) -> float:
        """Return how often the position was read in the last seconds."""
        return sum(at > now - _RATE_OVER_S for at in self._times) / _RATE_OVER_S
