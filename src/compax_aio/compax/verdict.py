"""What one look at the drive says about a pending move; plain values in, a verdict out."""

from __future__ import annotations

from enum import Enum

from .codecs import DriveStatus

__all__ = ["Verdict", "judge"]


class Verdict(Enum):
    """How a pending move stands."""

    MOVING = "the command is active"
    REACHED = "the drive stands at its target"
    STOPPED = "the drive stands, stopped on the way"
    FAULT = "the drive reports a fault"
    UNCLEAR = "the drive stands, and does not say why"


def judge(status: DriveStatus, *, is_at_target: bool, finds_machine_zero: bool) -> Verdict:
    """
    Say how a move stands that the drive has accepted.

    "Position reached" alone proves nothing: it may be that of an earlier move, when this one was lost on a drive that
    keeps quiet about errors. So the position read must agree; for the search for machine zero, S16 bit 3.
    """
    if not status.no_fault:
        return Verdict.FAULT
    if status.command_active:
        return Verdict.MOVING
    if finds_machine_zero:
        reached = status.machine_zero_approached and not status.idle_after_stop
    else:
        reached = status.position_reached and is_at_target
    if reached:
        return Verdict.REACHED
    if status.shows_stop:
        return Verdict.STOPPED
    return Verdict.UNCLEAR
