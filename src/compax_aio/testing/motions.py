"""What an axis has done, motion by motion, as read from the log of its simulated drive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal

from compax_aio.simulator.compax.log import LogEntry, LogKind

__all__ = ["Ending", "Motion", "motions_in"]

Ending = Literal["reached", "stopped", "fault"]

_ENDINGS: Final[dict[LogKind, Ending]] = {
    LogKind.MOTION_REACHED: "reached",
    LogKind.MOTION_STOPPED: "stopped",
    LogKind.MOTION_FAULT: "fault",
}


@dataclass(frozen=True, slots=True)
class Motion:
    """One motion of an axis. One that was stopped and continued (``START``) counts as two."""

    command: str
    """What it was: ``POSA``, ``POSR``, or ``POSA HOME`` for the search of machine zero."""
    target: float
    """Where it was to end, absolute, also for ``POSR``; for ``POSA HOME`` as counted before machine zero was found."""
    started_at: float
    """When it began, in seconds on the test's clock."""
    ended_by: Ending | None = None
    """``"reached"``, ``"stopped"`` (``STOP``, ``BREAK``), ``"fault"`` (power-off as well); None: it still moves."""
    ended_at: float | None = None
    """When the axis stood."""
    position: float | None = None
    """Where it then stood."""

    @property
    def homing(self) -> bool:
        """Whether it was the search of machine zero."""
        return self.command == "POSA HOME"

    def __str__(self) -> str:
        """Say in one line what it was, when, and how it ended."""
        text = f"{self.started_at:9.3f} s  {self.command} {self.target:g}"
        if self.ended_by is None:
            return f"{text}: still moving"
        return f"{text}: {self.ended_by} at {self.position:g} after {(self.ended_at or 0.0) - self.started_at:.3f} s"


def motions_in(log: Iterable[LogEntry]) -> list[Motion]:
    """List the motions that *log* tells of, oldest first."""
    motions: list[Motion] = []
    for entry in log:
        if entry.kind in {LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED}:
            command, _, target = entry.text.rpartition(" ")
            motions.append(Motion(command, float(target), entry.at))
        elif entry.kind in _ENDINGS and motions:
            motions[-1] = replace(
                motions[-1], ended_by=_ENDINGS[entry.kind], ended_at=entry.at, position=float(entry.text)
            )
    return motions
