"""What one look at the status says about a pending move; plain values in, a verdict out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .codecs import DriveStatus
from .vocabulary import MovePlan

__all__ = ["Look", "Verdict", "judge"]


class Verdict(Enum):
    """How a pending move stands."""

    MOVING = "the command is active"
    REACHED = "the drive stands at its target"
    STOPPED = "the drive stands, stopped on the way"
    FAULT = "the drive reports a fault"
    UNCLEAR = "the drive stands, and does not say why"


@dataclass(frozen=True, slots=True)
class Look:
    """The status and actual position of a drive, read one after the other."""

    status: DriveStatus
    position: float | None
    """S1, or None where it cannot be read."""


def judge(look: Look, plan: MovePlan, target: float | None, tolerance: float) -> Verdict:
    """
    Say how a move stands that the drive has accepted.

    "Position reached" alone proves nothing: it may be that of an earlier move, when this one was lost on a drive that
    keeps quiet about errors. So the position must agree, within *tolerance*.
    """
    status = look.status
    if not status.no_fault:
        return Verdict.FAULT
    if status.command_active:
        return Verdict.MOVING
    if plan.finds_machine_zero:
        arrived = status.machine_zero_approached and not status.idle_after_stop
    else:
        arrived = look.position is not None and target is not None and abs(look.position - target) <= tolerance
    if arrived and (status.position_reached or plan.finds_machine_zero):
        return Verdict.REACHED
    if status.idle_after_stop or status.stopped_by_input:
        return Verdict.STOPPED
    return Verdict.UNCLEAR
