"""The line at the bottom: what moves, how the line is, where the axis was a moment ago."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from prompt_toolkit.formatted_text import StyleAndTextTuples

from ...compax.codecs import DriveStatus
from ...compax.facts.device_errors import DeviceError
from .words import STOP_KEY

__all__ = ["Standing", "toolbar"]

_BAD = "fg:ansired bold"
_MOVING = "fg:ansiyellow bold"


@dataclass(slots=True, kw_only=True)
class Standing:
    """What is known of a drive now; nothing in it is older than the last reading."""

    is_open: bool = True
    """Whether the line is there."""
    position: str | None = None
    """With its unit; None: not read, or the last reading has failed."""
    status: DriveStatus | None = None
    error: DeviceError | None = None
    """The last fault that was told; it counts while the status shows a fault."""
    underway: str = ""
    """What may be moving the axis because of this shell."""
    is_stopping: bool = False
    waiting_for: str | None = None
    """The line whose answer has not come."""
    lines_behind: int = 0
    """How many lines wait for their turn."""


def toolbar(standing: Standing) -> StyleAndTextTuples:
    """Return what the line at the bottom shows, what matters most first."""
    fragments: StyleAndTextTuples = []
    for style, text in _parts(standing):
        fragments += [("", " " if not fragments else " · "), (style, text)]
    return fragments


def _parts(standing: Standing) -> Iterator[tuple[str, str]]:
    status = standing.status
    if standing.is_stopping:
        yield _MOVING, "STOP is under way"
    elif standing.underway:
        yield _MOVING, standing.underway
    if not standing.is_open:
        yield _BAD, "LINE LOST, it is tried again"
    if status is not None and not status.no_fault:
        yield _BAD, f"FAULT E{standing.error.code}" if standing.error else "FAULT"
    if standing.position is not None:
        yield "", standing.position
    if status is not None:
        yield "", _motion(status)
    if standing.waiting_for is not None:
        behind = f", {standing.lines_behind} more wait" if standing.lines_behind else ""
        yield "", f"waiting for {standing.waiting_for}{behind}"
    yield "", f"{STOP_KEY} STOP"
    yield "", "help"


def _motion(status: DriveStatus) -> str:
    if status.command_active:
        return "moving"
    return "program runs" if status.program_running else "stands"
