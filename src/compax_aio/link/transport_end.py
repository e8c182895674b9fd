"""One transport's hold on a link: what it says after its end, or after another one was taken, is not heard."""

from __future__ import annotations

import asyncio
from typing import cast

__all__ = ["TransportEnd"]


class TransportEnd(asyncio.Protocol):
    """
    Passes on what one transport says, until it has said that it has ended, or is let go of.

    Args:
        link: Is told.
    """

    def __init__(self, link: asyncio.Protocol) -> None:
        self._link: asyncio.Protocol | None = link

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Pass it on; one that comes when nobody wants it any more is hung up."""
        if self._link is not None:
            self._link.connection_made(transport)
        else:
            cast("asyncio.Transport", transport).abort()

    def data_received(self, data: bytes) -> None:
        """Pass it on."""
        if self._link is not None:
            self._link.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        """Pass it on, as the last."""
        link, self._link = self._link, None
        if link is not None:
            link.connection_lost(exc)

    def let_go(self) -> None:
        """Pass on nothing any more."""
        self._link = None
