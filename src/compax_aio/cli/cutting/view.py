"""What is seen of a cut: a bar with figures at a terminal, else a line for each thing that happens to it."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from typing import Final

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from compax_aio import camm1

from ..outlets import is_held_up
from ..printing import Printing, notes_console
from .outline import written_time

__all__ = ["CutView"]

_BAR_WIDTH: Final = 30
_LEAST_PAUSE_S: Final = 0.05
"""Between two pictures: nobody sees more, and lines are slow."""


class CutView:
    """
    Shows how a cut gets on.

    Args:
        title: What is cut.
        mm_per_step: Of the machine.
        printing: How it is said.
        has_keys: Whether ``p`` pauses, which is told then.
    """

    def __init__(self, title: str, mm_per_step: float, printing: Printing, *, has_keys: bool) -> None:
        self._title = title
        self._mm = mm_per_step
        self._printing = printing
        self._keys = "   p pauses, Ctrl-C aborts" if has_keys else ""
        self._live: Live | None = None
        self._state = ""
        self._shown_at = float("-inf")
        self._most_free = 0
        self.last: camm1.CutProgress | None = None

    def __enter__(self) -> CutView:
        if not self._printing.json and sys.stderr.isatty():
            console = notes_console()
            console.soft_wrap = False
            self._live = Live(console=console, auto_refresh=False, transient=True)
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, progress: camm1.CutProgress) -> None:
        """Show how the cut stands now."""
        self.last = progress
        self._most_free = max(self._most_free, progress.free_bytes or 0)
        is_news = progress.state != self._state
        self._state = progress.state
        if self._live is None:
            if is_news:
                self._printing.note(f"{self._title}: {progress.state}")
            return
        now = asyncio.get_running_loop().time()
        if (is_news or now - self._shown_at >= _LEAST_PAUSE_S) and not is_held_up(self._live.console.file):
            self._shown_at = now
            self._live.update(self._picture(progress), refresh=True)

    def _picture(self, progress: camm1.CutProgress) -> Group:
        grid = Table.grid(padding=(0, 1))
        total = progress.bytes_total
        share = f"{100 * progress.bytes_sent / total:3.0f} %" if total else ""
        bar = ProgressBar(total=total, completed=progress.bytes_sent, width=_BAR_WIDTH)
        grid.add_row(
            Text(self._title), bar, Text(share), Text(progress.state, style="bold"), written_time(progress.elapsed_s)
        )
        return Group(grid, Text("  " + ", ".join(self._figures(progress)) + self._keys, style="dim"))

    def _figures(self, progress: camm1.CutProgress) -> Iterator[str]:
        yield _of(progress.bytes_sent, progress.bytes_total, "bytes")
        yield _of(progress.instructions_sent, progress.instructions_total, "instructions")
        if progress.position_steps is not None:
            x, y = progress.position_steps
            yield f"sent as far as ({x * self._mm:.2f}, {y * self._mm:.2f}) mm"
        if progress.free_bytes is not None:
            yield f"{progress.free_bytes:,} bytes free of {self._most_free:,}"


def _of(done: int, total: int | None, what: str) -> str:
    return f"{done:,} {what}" if total is None else f"{done:,} of {total:,} {what}"
