"""Stopping a drive whose line is not open yet: STOP is the first thing that goes over it, before anybody is greeted."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace

from ..errors import CompaxError, TransportError
from ..link.contract import Event, TurnOver
from ..motion.connecting import name_of
from ..motion.moves import fetch_error
from .codecs import DriveStatus
from .facts.device_errors import DeviceError
from .line import DriveLine
from .observer import Observer
from .settings import DriveSettings
from .stopping import Stop

__all__ = ["StoppedDrive", "stop_first"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppedDrive:
    """A drive that has acknowledged STOP, and stands."""

    drive: str
    position: float | None
    """S1 at its standstill, in *unit*; None where it could not be read."""
    unit: str
    status: DriveStatus
    after_s: float
    """Seconds from being asked to the standstill being read, the opening of the line included."""


async def stop_first(url: str, *, name: str | None = None, settings: DriveSettings | None = None) -> StoppedDrive:
    """
    Open a line, stop the drive on it, and return at its standstill; the line is closed again.

    STOP is the first that is written, for it does no harm to a drive that stands, nor to a wrong one that a motion
    would harm. It is repeated in turn with what brings the line in step, and then until it is acknowledged. Who is on
    the line is looked at only as far as its answers tell.

    Args:
        url: Of the line, as for :func:`compax_aio.connect`; nobody else may have it open.
        name: For errors and results.
        settings: Its dialect says the word for STOP.

    Raises:
        TransportError: The line cannot be opened; STOP was not sent.
        AnswerTimeoutError, CommandRejectedError, ConnectionLostError, UnexpectedAnswerError: STOP was sent, and not
            acknowledged: the axis may move.
        MoveTimeoutError: It was acknowledged, but the drive's command is still active.
    """
    began_at = asyncio.get_running_loop().time()
    # What is asked for before there is a line waits for it only where lines that are lost come back.
    line = _line(name_of(url, name), replace(settings or DriveSettings(), reconnect=True))
    stop = _FirstStop(Observer(line, _ignore_fault))
    try:
        try:
            await line.link.open(url)
        except CompaxError as error:
            raise _told(error, line.name, was_sent=line.link.lines_sent > 0) from error.__cause__
        look = await stop.carry_through()
    finally:
        await line.link.close()
    return StoppedDrive(
        drive=line.name,
        position=look.position,
        unit=line.settings.unit,
        status=look.status,
        after_s=asyncio.get_running_loop().time() - began_at,
    )


class _FirstStop(Stop):
    """A stop that is asked for before there is a line."""

    def _send(self) -> asyncio.Future[TurnOver]:
        reply = super()._send()
        reply.add_done_callback(fetch_error)  # if the line cannot be opened, nobody asks
        return reply


def _told(error: CompaxError, device: str, *, was_sent: bool) -> CompaxError:
    """Say of *error*, with which the line could not be used, what it means for the axis."""
    error.device = device
    if isinstance(error, TransportError) and not was_sent:
        error.what = f"STOP was not sent: {error.what}"
        advice = "if the axis moves, use the emergency stop"
    else:
        error.what = f"STOP was sent, and not acknowledged: {error.what}"
        advice = "the axis may be moving: look at it, and use the emergency stop"
    error.hint = f"{advice}; {error.hint}" if error.hint else advice
    return error


def _line(name: str, settings: DriveSettings) -> DriveLine:
    return DriveLine(
        name,
        settings,
        on_event=_ignore_event,
        on_lost=_ignore_loss,
        greet=_greet_nobody,
        on_down=_ignore_loss,
        on_restored=_ignore_loss,
    )


async def _greet_nobody() -> None:
    """Ask nothing: a stop is right whoever is there."""


def _ignore_event(_: Event) -> None:
    """Heed no messages: they end no move from here."""


def _ignore_loss(_: object) -> None:
    """Tell nobody else: whoever awaits the stop is told."""


def _ignore_fault(_: DeviceError | None) -> None:
    """Tell nobody: it stands in the status that is returned."""
