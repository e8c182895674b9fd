"""A picture of something under way, at the terminal where a command runs: drawn anew when that changes, and by time."""

from __future__ import annotations

import asyncio
import sys
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from typing import Final, Self

from rich.console import RenderableType
from rich.live import Live
from rich.text import Text

from compax_aio.escaping import escaped

from .outlets import is_held_up
from .printing import Printing, notes_console
from .warned import warnings_told_by

__all__ = ["TICK_S", "LivePicture"]

TICK_S: Final = 0.5
_LEAST_PAUSE_S: Final = 0.05
"""Between two pictures: nobody sees more, and lines are slow."""


class LivePicture(ABC):
    """
    Is there during its block, if somebody looks; nothing is left of it afterwards.

    Args:
        printing: How things are said otherwise.
    """

    def __init__(self, printing: Printing) -> None:
        self._printing = printing
        self._live: Live | None = None
        self._warnings = ExitStack()
        self._drawn_at = float("-inf")

    @abstractmethod
    def _picture(self) -> RenderableType | None:
        """Make it as things are now; None: there is nothing to see yet."""

    def __enter__(self) -> Self:
        if not self._printing.json and sys.stderr.isatty():
            console = notes_console()
            console.soft_wrap = False
            self._live = Live(console=console, auto_refresh=False, transient=True)
            self._live.start()
            self._warnings.enter_context(warnings_told_by(self._warn))
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()

    def clear(self) -> None:
        """Show nothing any more, and leave the terminal as it was before."""
        live, self._live = self._live, None
        if live is not None:
            live.stop()
            self._warnings.close()

    def _warn(self, text: str) -> None:
        if self._live is not None:
            self._live.console.print(Text.assemble(("warning: ", "yellow"), escaped(text)))

    @asynccontextmanager
    async def ticking(self) -> AsyncIterator[None]:
        """Let the time go on during a block, also where nothing else happens."""
        ticker = asyncio.ensure_future(self._tick())
        try:
            yield
        finally:
            ticker.cancel()

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK_S)
            self._draw()

    def _draw(self, *, is_news: bool = True) -> None:
        """Draw it, at once if it has news, else unless it was drawn just now."""
        if self._live is None or not (is_news or self._now() - self._drawn_at >= _LEAST_PAUSE_S):
            return
        picture = self._picture()
        if picture is not None and not is_held_up(self._live.console.file):
            self._drawn_at = self._now()
            self._live.update(picture, refresh=True)

    @staticmethod
    def _now() -> float:
        return asyncio.get_running_loop().time()
