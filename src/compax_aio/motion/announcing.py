"""A move told to whoever follows the events of its device: that it was taken, and how it ended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Final

from ..errors import (
    CommandRejectedError,
    CompaxError,
    DriveFaultError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from .events import DriveEvent, MoveAccepted, MoveEnded, MoveOutcome
from .moves import MoveFuture

__all__ = ["announce"]

_OUTCOMES: Final[tuple[tuple[type[CompaxError], MoveOutcome], ...]] = (
    (MoveStoppedError, "stopped"),
    (DriveFaultError, "fault"),
    (MoveTimeoutError, "out of time"),
    (MoveInDoubtError, "in doubt"),
    (CommandRejectedError, "refused"),
)


def announce(move: MoveFuture, device: str, publish: Callable[[DriveEvent], None]) -> None:
    """Publish :class:`MoveAccepted` when the device called *device* takes *move*, and :class:`MoveEnded` at its end."""
    move.acceptance.add_done_callback(partial(_tell_accepted, move, device, publish))
    move.add_done_callback(partial(_tell_ended, device, publish))


def _tell_accepted(
    move: MoveFuture, device: str, publish: Callable[[DriveEvent], None], acceptance: asyncio.Future[None]
) -> None:
    if not acceptance.cancelled() and acceptance.exception() is None:
        publish(MoveAccepted(device, move.get_loop().time(), move.description, move.target))


def _tell_ended(device: str, publish: Callable[[DriveEvent], None], move: MoveFuture) -> None:
    at, confirmed_by = move.get_loop().time(), None
    # Its exception is not fetched from here: asyncio shall complain if nobody else does.
    if move.cancelled():
        outcome: MoveOutcome = "cancelled"
    elif move.failure is not None:
        outcome = next((each for kind, each in _OUTCOMES if isinstance(move.failure, kind)), "failed")
    else:
        outcome = "reached"
        at, confirmed_by = move.result().finished_at, move.result().confirmed_by
    publish(MoveEnded(device, at, move.description, move.target, outcome, move.is_on_wire, confirmed_by, move.failure))
