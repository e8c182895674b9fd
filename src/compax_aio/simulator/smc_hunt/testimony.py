"""What was seen of a party line: every byte, what each caller was told, how each axis stood then."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from compax_aio.motion.events import DriveEvent
from compax_aio.simulator.smc import SimulatedAxis, SimulatedPartyLine

from ..hunt.testimony import Call, Standing, WireEntry
from .scenario import PartyScenario

__all__ = ["WHOLE_LINE", "AxisCall", "SeenLine"]

WHOLE_LINE = ""
"""The axis of a call that is about all of them."""


@dataclass(slots=True, eq=False)
class AxisCall(Call):
    """Something that a user has asked of an axis, or of the line."""

    ended_index: int = 0
    """How much had happened on the line when it was told how it ended."""
    origin_then: float = 0.0
    """The place from which the axis counted when the caller was told."""
    joins_stop: bool = False
    """A stop of that axis was under way when it was asked."""
    is_open_then: bool = True
    """Whether the line was there when it was asked."""
    cancelled_at: float | None = None
    """When the move was cancelled by its holder."""

    def ended(self, at: float, outcome: Any, far: Standing) -> None:
        """Take note of how it ended, of how the axis stands, and of what it counts from."""
        Call.ended(self, at, outcome, far)
        if isinstance(far, SimulatedAxis):
            self.origin_then = far.place - far.position


@dataclass(slots=True, eq=False)
class SeenLine:
    """All that was seen of one simulation."""

    scenario: PartyScenario
    far: SimulatedPartyLine
    wire: list[WireEntry] = field(default_factory=list)
    calls: list[AxisCall] = field(default_factory=list)
    events: list[DriveEvent] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    """What asyncio had to complain about."""
    left: list[str] = field(default_factory=list)
    """Tasks that were left at the end."""
    left_at: float = 0.0
    """When all users were done, and the block was left."""
    closed_at: float | None = None
    """When the line was closed for the first time."""
    moving_at_end: tuple[str, ...] = ()
    """Axes that moved a minute after the block was left."""
    moving_when_closed: tuple[str, ...] = ()
    """Axes that moved when it had been left."""
    origins: dict[str, float] = field(default_factory=dict)
    """What each axis counted from when the line was open for the first time."""
    weight: int = 0
    """Bytes of memory that the client kept at the end; 0 if it was not weighed."""
    lasted_s: float = 0.0
    excused: Counter[str] = field(default_factory=Counter)
    """What looked like a broken promise and is not, by why; filled in by those who look."""
