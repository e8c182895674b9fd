"""Who goes on waiting for a line that is lost, and for how long."""

from __future__ import annotations

import asyncio

from .attempts import Attempts
from .exchanges import Exchange
from .reconnecting import Reconnecting

__all__ = ["Patience"]


class Patience:
    """
    Knows what waits for a lost line.

    Args:
        reconnecting: How it is opened again; None: it is not, and nobody waits.
        attempts: To open it.
    """

    def __init__(self, reconnecting: Reconnecting | None, attempts: Attempts) -> None:
        self._reconnecting = reconnecting
        self._attempts = attempts
        self._loop = asyncio.get_running_loop()

    def has(self, exchange: Exchange) -> bool:
        """Whether it goes on waiting: for so long as anybody waits; after that, for the attempt that comes next."""
        reconnecting = self._reconnecting
        if not exchange.survives_loss or reconnecting is None:
            return False
        if not reconnecting.is_patient:
            return self.is_new(exchange)
        return self._loop.time() - exchange.queued_at < reconnecting.patience_s

    def is_new(self, exchange: Exchange) -> bool:
        """Whether it was asked since the last attempt began: the next one is its first."""
        return exchange.attempt == self._attempts.count
