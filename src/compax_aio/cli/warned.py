"""Warnings of the library while a display is kept up to date: told by it, for what is printed past it spoils it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["warnings_told_by"]


class _Teller(logging.Handler):
    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self._tell(record.getMessage())


@contextmanager
def warnings_told_by(tell: Callable[[str], None]) -> Iterator[None]:
    """Have *tell* say the warnings of the library during a block, in place of whoever does otherwise."""
    logger = logging.getLogger("compax_aio")
    before, logger.handlers = logger.handlers, [_Teller(tell)]
    try:
        yield
    finally:
        logger.handlers = before
