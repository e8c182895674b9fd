"""What was seen of a simulation: every byte of every line, what each caller was told, and what was left behind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final, NamedTuple, Protocol

from compax_aio.compax.events import DriveEvent
from compax_aio.compax.settings import DriveSettings
from compax_aio.link.wire import readable
from compax_aio.simulator.compax.drive import SimulatedDrive
from compax_aio.simulator.compax.log import LogEntry, LogKind

from .scenario import DrivePlan, Scenario

__all__ = ["Call", "Seen", "SeenAxis", "Standing", "WireEntry", "WireKind", "longest_opening_s"]

_GREETING_S: Final = 5.0
"""Some fifteen queries to the slowest drive that is drawn, one answer of them lost."""


class WireKind(StrEnum):
    """What happened on a line."""

    OPENED = "opened"
    WRITTEN = "→"
    """The client has written it."""
    ARRIVED = "⇒"
    """It has arrived at the drive."""
    READ = "←"
    """It was handed to the client."""
    CLOSED = "closed"
    """The client has closed or aborted its end."""
    LOST = "lost"
    """The client was told that the line is gone."""
    BEFELL = "befell"
    """A trouble began, ended, or did something; which, says the text."""


class WireEntry(NamedTuple):
    """Something that happened on a line."""

    at: float
    kind: WireKind
    data: bytes = b""
    text: str = ""

    def __str__(self) -> str:
        return f"{self.at:9.4f} {self.kind.value} {readable(self.data)}{self.text}"


class Standing(Protocol):
    """An axis at the far end, as it really stands."""

    @property
    def position(self) -> float:
        """Where."""

    @property
    def moving(self) -> bool:
        """Whether it moves."""


@dataclass(slots=True, eq=False)
class Call:
    """Something that a user has asked for, and what came of it."""

    item: int
    axis: str
    what: str
    """The method's name."""
    asked_at: float
    detail: Any = None
    """What it was given, as far as a promise speaks of it."""
    text: str | None = None
    """The line that starts its motion, without signs."""
    move: Any = None
    """The future of its motion, of whatever device."""
    on_cancel: str = "stop"
    asked_index: int = 0
    """How much had happened on the line when it was asked."""
    ended_at: float | None = None
    outcome: Any = None
    """What it returned, or the error it raised."""
    position_then: float = 0.0
    moving_then: bool = False
    """How the drive really stood when the caller was told."""
    fault_then: int | None = None

    def ended(self, at: float, outcome: Any, far: Standing) -> None:
        """Take note of how it ended, and of how the drive stands at this moment."""
        self.ended_at, self.outcome = at, outcome
        self.position_then, self.moving_then = far.position, far.moving
        self.fault_then = getattr(far, "fault", None)

    def __str__(self) -> str:
        ended = "never" if self.ended_at is None else f"{self.ended_at:.4f}"
        given = "" if self.detail is None else f"({self.detail!r})"
        return f"{self.asked_at:9.4f} {self.axis}.{self.what}{given}, item {self.item}, ended {ended}: {self.outcome!r}"


def longest_opening_s(settings: DriveSettings) -> float:
    """Return how long it may take until a line that works, and is lost, is open again."""
    # One attempt may have begun before it worked: its markers, and what it asks in greeting.
    attempt_s = settings.answer_timeout_s * (2 * settings.resync_attempts + 2) + _GREETING_S
    return 2 * (attempt_s + settings.reconnect_slowest_s)


@dataclass(slots=True, eq=False)
class SeenAxis:
    """One drive, its line, and what was asked of it."""

    plan: DrivePlan
    far: SimulatedDrive
    wire: list[WireEntry] = field(default_factory=list)
    calls: list[Call] = field(default_factory=list)
    events: list[DriveEvent] = field(default_factory=list)
    """All that the client's drive told those who follow its events, from the moment it was connected."""
    strangers: list[SimulatedDrive] = field(default_factory=list)
    """Other drives that were on its line."""
    moving_at_end: bool = False
    """The axis moved when the block was left."""
    motions_at_end: int = 0
    """How many motions it had begun then."""
    weight: int = 0
    """Bytes of memory that the client's drive kept at the end; 0 if it was not weighed."""

    @property
    def log(self) -> Iterator[LogEntry]:
        """What the drive says that it did."""
        return iter(self.far.log)

    def written(self, since: float = 0.0, until: float = float("inf")) -> list[WireEntry]:
        """List what the client wrote from *since* to *until*."""
        return [each for each in self.wire if each.kind is WireKind.WRITTEN and since <= each.at <= until]

    @property
    def motions(self) -> list[LogEntry]:
        """List the positionings that the drive has begun."""
        return [each for each in self.log if each.kind in {LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED}]


@dataclass(slots=True, eq=False)
class Seen:
    """All that was seen of one simulation."""

    scenario: Scenario
    axes: dict[str, SeenAxis] = field(default_factory=dict)
    complaints: list[str] = field(default_factory=list)
    """What asyncio had to complain about."""
    left: list[str] = field(default_factory=list)
    """Tasks that were left at the end."""
    left_at: float = 0.0
    """When all users were done, and the blocks were left."""
    lasted_s: float = 0.0

    @property
    def calls(self) -> list[Call]:
        """Everything that was asked, axis by axis."""
        return [call for axis in self.axes.values() for call in axis.calls]
