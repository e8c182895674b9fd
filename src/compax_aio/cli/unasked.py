"""Text that comes unasked: told now and then, with how much more there was, so that a line that floods hides none."""

from __future__ import annotations

import asyncio
from typing import Final

__all__ = ["UnaskedText"]

_PAUSE_S: Final = 5.0


class UnaskedText:
    """What one line says unasked."""

    def __init__(self) -> None:
        self._untold = 0
        self._told_at = float("-inf")

    def take(self, text: str) -> str | None:
        """Take *text*; returns what is to be told of it now, None if that is nothing."""
        now = asyncio.get_running_loop().time()
        if now - self._told_at < _PAUSE_S:
            self._untold += 1
            return None
        before, self._untold, self._told_at = self._untold, 0, now
        return f"{text} ({before} more before it)" if before else text
