"""A log that tells the same kind of thing once, and at DEBUG as long as it comes again and again."""

from __future__ import annotations

import asyncio
import logging
from math import inf
from typing import Final

__all__ = ["Seldom"]

_QUIET_S: Final = 3600.0


class Seldom:
    """
    Logs what one line repeats.

    Args:
        log: Where it goes.
        name: Of the line; every message begins with it.
    """

    def __init__(self, log: logging.Logger, name: str) -> None:
        self._log = log
        self._name = name
        self._loop = asyncio.get_running_loop()
        self._told_at: dict[str, float] = {}

    def tell(self, level: int, message: str, *args: object) -> None:
        """Log *message*, which tells one kind from another, at *level*, or at DEBUG if it came within the last hour."""
        now = self._loop.time()
        if now - self._told_at.get(message, -inf) < _QUIET_S:
            level = logging.DEBUG
        self._told_at[message] = now
        self._log.log(level, f"%s: {message}", self._name, *args)
