"""Opening a device's line: an awaitable that is an asynchronous context manager as well."""

from __future__ import annotations

from collections.abc import Callable, Generator
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from ..escaping import escaped
from ..transports.url import TransportURL

__all__ = ["Connecting", "Openable", "name_of"]


class Openable(Protocol):
    """What can be connected to: a drive, or a line with several axes."""

    async def _open(self, url: str) -> None:
        """Open the line, and look who is there."""

    async def close(self) -> None:
        """Stop what was started, and close the line."""


_Device = TypeVar("_Device", bound=Openable)


class Connecting(Generic[_Device]):
    """
    A connection about to be made: awaitable, and an asynchronous context manager.

    Args:
        url: Of the line.
        make: Makes the device, not yet open; called when this is awaited or entered, and so in a running event loop.
    """

    def __init__(self, url: str, make: Callable[[], _Device]) -> None:
        self._url = url
        self._make = make
        self._device: _Device | None = None

    def __await__(self) -> Generator[Any, None, _Device]:
        return self._open().__await__()

    async def __aenter__(self) -> _Device:
        self._device = await self._open()
        return self._device

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        assert self._device is not None
        await self._device.close()

    async def _open(self) -> _Device:
        device = self._make()
        await device._open(self._url)  # noqa: SLF001 - callers get it open, and are not shown how
        return device


def name_of(url: str, name: str | None) -> str:
    """
    Return *name*, or the URL without its query unless that alone names the line; fit for errors and logs.

    Raises:
        TransportError: There is no name, and *url* is no URL.
    """
    if name is None:
        shown = str(TransportURL.parse(url))
        name = shown if "://?" in shown else shown.partition("?")[0]
    return escaped(name)
