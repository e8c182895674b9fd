"""What is seen of a cut: a bar with figures at a terminal, else a line for each thing that happens to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from rich.console import Group
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from compax_aio.camm1.cut import CutProgress, CutState

from ..live_picture import LivePicture
from ..printing import Printing
from .outline import written_time

__all__ = ["CutView"]

_STATES: Final[Mapping[CutState, str]] = {
    "starting": "setting up the handshake",
    "cutting": "cutting",
    "buffer full": "cutting, the buffer is full",
    "line held": "the cutter holds the line",
    "paused": "paused from here",
    "operator pause": "paused at the panel",
    "finishing": "all is sent; waiting until it is cut",
    "aborting": "being aborted",
    "over": "over",
}
_TOLD: Final = frozenset({"cutting", "paused", "operator pause", "finishing", "aborting"})
"""Without a terminal; others come and go many times."""
_BAR_WIDTH: Final = 24


class CutView(LivePicture):
    """
    Shows how a cut gets on.

    Args:
        title: What is cut.
        mm_per_step: Of the machine.
        printing: How it is said.

    Attributes:
        has_keys: Whether ``p`` pauses, which is told then.
    """

    def __init__(self, title: str, mm_per_step: float, printing: Printing) -> None:
        super().__init__(printing)
        self._title = title
        self._mm = mm_per_step
        self.has_keys = False
        self._state: CutState | None = None
        self._told: CutState | None = None
        self._progress: CutProgress | None = None
        self._got_at = 0.0
        self._most_free = 0

    def show(self, progress: CutProgress) -> None:
        """Show how the cut stands now."""
        self._progress, self._got_at = progress, self._now()
        self._most_free = max(self._most_free, progress.free_bytes or 0)
        is_news = progress.state != self._state
        self._state = progress.state
        if self._live is None and progress.state in _TOLD and progress.state != self._told:
            self._told = progress.state
            self._printing.note(f"{self._title}: {_STATES[progress.state]}")
        self._draw(is_news=is_news)

    def _picture(self) -> Group | None:
        if (progress := self._progress) is None:
            return None
        grid = Table.grid(padding=(0, 1))
        total = progress.bytes_total
        share = f"{100 * progress.bytes_sent / total:3.0f} %" if total else ""
        elapsed_s = progress.elapsed_s + self._now() - self._got_at
        grid.add_row(
            Text(self._title, no_wrap=True, overflow="ellipsis"),
            ProgressBar(total=total, completed=progress.bytes_sent, width=_BAR_WIDTH),
            share,
            Text(_STATES[progress.state], style="bold"),
            written_time(elapsed_s),
            Text("p pauses" if self.has_keys else "", style="dim"),
        )
        figures = Text("  " + ", ".join(self._figures(progress)), style="dim", no_wrap=True, overflow="ellipsis")
        return Group(grid, figures)

    def _figures(self, progress: CutProgress) -> Iterator[str]:
        yield _of(progress.bytes_sent, progress.bytes_total, "bytes")
        yield _of(progress.instructions_sent, progress.instructions_total, "instructions")
        x, y = progress.position_steps
        yield f"to ({x * self._mm:.2f}, {y * self._mm:.2f}) mm"
        if progress.free_bytes is not None:
            yield f"buffer {100 - 100 * progress.free_bytes // max(self._most_free, 1)} % full"


def _of(done: int, total: int | None, what: str) -> str:
    return f"{done:,} {what}" if total is None else f"{done:,} of {total:,} {what}"
