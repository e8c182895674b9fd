"""Attempts to open one line: each opens a transport, gets in step and greets who is there, or tells why not."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from ..transports.registry import open_transport
from ..transports.url import TransportURL
from .reconnecting import Reconnecting
from .stats import LinkStats
from .taps import Opening, Refused
from .telling import Telling
from .transport_end import TransportEnd
from .turns import Turns

__all__ = ["Attempts"]


class Attempts:
    """
    Opens a line, once and again.

    Args:
        link: Is told what the transport says; of several the one that was opened last.
        turns: Get in step on it.
        stats: Attempts are counted there.
        telling: Tells of them.
        reconnecting: Says how long one to get a lost line back may take.
        greet: See :class:`~compax_aio.link.link.Link`.
    """

    def __init__(
        self,
        link: asyncio.Protocol,
        *,
        turns: Turns,
        stats: LinkStats,
        telling: Telling,
        reconnecting: Reconnecting | None,
        greet: Callable[[], Awaitable[None]] | None,
    ) -> None:
        self.count = 0
        """How often the line was opened, or tried to."""
        self._link = link
        self._turns = turns
        self._stats = stats
        self._telling = telling
        self._reconnecting = reconnecting
        self._greet = greet
        self._end: TransportEnd | None = None

    async def make(self, url: str, ensure_there: Callable[[], None]) -> None:
        """
        Open the line, once; what is not more urgent than the greeting waits until it is admitted.

        Args:
            url: Of the line.
            ensure_there: Raises the error to be told if the line was lost in one breath with the last answer.

        Raises:
            CompaxError: See :meth:`Link.open() <compax_aio.link.link.Link.open>`; the port may be open still.
        """
        parsed = TransportURL.parse(url)
        self._turns.queue.is_admitted = False
        self.count += 1
        self._telling.tell(Opening(str(parsed)))
        try:
            await self._open(parsed)
            if self._greet is not None:
                await self._greet()
            ensure_there()
        except BaseException as error:
            self._telling.tell(Refused(str(error) or type(error).__name__))
            raise

    async def _open(self, url: TransportURL) -> None:
        self._stats.openings += 1
        in_step = self._turns.until_in_step()
        in_step.add_done_callback(lambda each: each.cancelled() or each.exception())  # if the opener fails, nobody asks
        try:
            async with asyncio.timeout(self._longest_s):
                await open_transport(url, self.take_end)
        except BaseException:
            in_step.cancel()
            raise
        await in_step

    @property
    def _longest_s(self) -> float | None:
        """How long an opener may take to get a lost line back; the first time it is the caller who waits."""
        return self._reconnecting.patience_s if self._reconnecting is not None and self.count > 1 else None

    def take_end(self) -> TransportEnd:
        """Return what a new transport talks to; the one before is not heard any more."""
        if self._end is not None:
            self._end.let_go()
        self._end = TransportEnd(self._link)
        return self._end
