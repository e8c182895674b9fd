"""Silence on a line that is there: whether it may lead nowhere, so that it is opened anew when it is used next."""

from __future__ import annotations

import asyncio
from typing import Final

from ..errors import AnswerTimeoutError
from .failures import Failures
from .port import Port
from .reconnecting import Reconnecting

__all__ = ["Silence"]

_SILENT_SHARE: Final = 1 / 2
"""Of the time for which a lost line is waited for: so long a silence leaves some for a new attempt."""
_SHORTEST_SILENCE_S: Final = 10.0
"""A device that is busy, or whose only answer comes late, must not cost the connection."""


class Silence:
    """
    What nobody's answering says of a line.

    Args:
        port: Its near end.
        reconnecting: How it would be opened again; None: it is not, and no silence says anything.
        failures: Make its errors.
    """

    __slots__ = ("_failures", "_loop", "_port", "_reconnecting", "error")

    def __init__(self, port: Port, reconnecting: Reconnecting | None, failures: Failures) -> None:
        self._port = port
        self._reconnecting = reconnecting
        self._failures = failures
        self._loop = asyncio.get_running_loop()
        self.error: AnswerTimeoutError | None = None
        """Why the line may lead nowhere; None if it does not seem so."""

    def note(self) -> None:
        """Take note that nobody has answered, several times."""
        if self._reconnecting is None:
            return
        silent_s = self._loop.time() - self._port.heard_at
        is_long = silent_s >= max(self._reconnecting.patience_s * _SILENT_SHARE, _SHORTEST_SILENCE_S)
        self.error = self._failures.silence(None) if self._port.is_stuck or is_long else None

    def forget(self) -> None:
        """Begin anew: the line is another one."""
        self.error = None
