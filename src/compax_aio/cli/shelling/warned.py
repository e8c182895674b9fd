"""What the library warns of while somebody types: told where everything else is told, and not twice."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.text import Text

__all__ = ["Warnings"]

_A_MOMENT_S = 0.05
"""In which an event that says the same comes."""
_REMEMBERED = 8


class Warnings(logging.Handler):
    """
    Takes what is logged as a warning, or worse.

    Args:
        tell: Called with what is to be printed, in the event loop.
    """

    def __init__(self, tell: Callable[[Text], None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._told: deque[str] = deque(maxlen=_REMEMBERED)

    def note_told(self, text: str) -> None:
        """Take note of what an event has said, so that a warning that begins it is not told as well."""
        self._told.append(text)

    def emit(self, record: logging.LogRecord) -> None:
        """Tell *record* in a moment; called in any thread."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._loop.call_later, _A_MOMENT_S, self._tell_if_new, record.getMessage())

    def _tell_if_new(self, message: str) -> None:
        if not any(each.startswith(message) for each in self._told):
            self._tell(Text.assemble(("warning  ", "yellow"), message))

    @contextmanager
    def instead_of_others(self) -> Iterator[None]:
        """Let warnings of the library come here alone in this block."""
        logger = logging.getLogger("compax_aio")
        others = logger.handlers[:]
        logger.handlers = [self]
        try:
            yield
        finally:
            logger.handlers = others
