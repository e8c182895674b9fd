"""Opening a drive's line: an awaitable that is an asynchronous context manager as well."""

from __future__ import annotations

from collections.abc import Generator
from types import TracebackType
from typing import Any

from ..escaping import escaped
from ..transports.url import TransportURL
from .drive import Drive
from .settings import DriveSettings

__all__ = ["Connecting", "connect"]


def connect(url: str, *, name: str | None = None, settings: DriveSettings | None = None) -> Connecting:
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
    if name is None:
        shown = str(TransportURL.parse(url))
        name = shown if "://?" in shown else shown.partition("?")[0]
    name = escaped(name)
    return Connecting(url, name, settings or DriveSettings())


class Connecting:
    """A connection about to be made: awaitable, and an asynchronous context manager."""

    def __init__(self, url: str, name: str, settings: DriveSettings) -> None:
        self._url = url
        self._name = name
        self._settings = settings
        self._drive: Drive | None = None

    def __await__(self) -> Generator[Any, None, Drive]:
        return self._open().__await__()

    async def __aenter__(self) -> Drive:
        self._drive = await self._open()
        return self._drive

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        assert self._drive is not None
        await self._drive.close()

    async def _open(self) -> Drive:
        drive = Drive(self._name, self._settings)
        await drive._open(self._url)  # noqa: SLF001 - the two halves of one class
        return drive
