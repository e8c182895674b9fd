"""Opening a drive's line."""

from __future__ import annotations

from functools import partial

from ..motion.connecting import Connecting, name_of
from .drive import Drive
from .settings import DriveSettings

__all__ = ["connect"]


def connect(url: str, *, name: str | None = None, settings: DriveSettings | None = None) -> Connecting[Drive]:
    """
    Connect to one drive.

    Await the result, and close the drive yourself, or use it as ``async with connect(url) as drive``: leaving the
    block, however it ends, stops the moves that it started and closes the line.

    Args:
        url: ``serial:///dev/ttyUSB0?baudrate=9600``, ``tcp://host:4001``, ``unix:///run/drive.sock``,
            ``loop://name``, ``sim://compax``, or a scheme that a plugin adds.
        name: For errors, logs and results; the URL if not given, without its query unless that alone names the line.
        settings: Time-outs and what is known of this drive's ways.

    Raises (when awaited or entered):
        TransportError: The line cannot be opened; the error says why.
        UnexpectedAnswerError: Another device answers, such as a Compax3.
        AnswerTimeoutError: Nothing on it answers as a COMPAX would.
    """
    return Connecting(url, partial(Drive, name_of(url, name), settings or DriveSettings()))
