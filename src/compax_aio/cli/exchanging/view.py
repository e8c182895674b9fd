"""What is seen of a transfer: a bar with figures at a terminal, else a line for each thing that happens to it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Final

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from compax_aio.haas.transfer import TransferPhase, TransferProgress

from ..live_picture import TICK_S, LivePicture
from ..printing import Printing

__all__ = ["TransferView", "written_time"]

_PHASES: Final[Mapping[TransferPhase, str]] = {
    "starting": "being checked",
    "waiting for operator": "waits for you",
    "under way": "on its way",
    "held": "the control holds the line",
    "ending": "all of it is over; waiting for the end",
    "verifying": "once more, to be compared",
    "over": "over",
}
_TOLD: Final = frozenset({"under way", "ending", "verifying"})
"""Without a terminal; others come and go many times."""
_BAR_WIDTH: Final = 24
_RATE_OVER_S: Final = 4.0


class TransferView(LivePicture):
    """
    Shows how a transfer gets on.

    Args:
        title: What goes over the line.
        printing: How it is said.

    Attributes:
        took_s: How long bytes have gone over the line, without the wait for somebody, and for the end.
    """

    def __init__(self, title: str, printing: Printing) -> None:
        super().__init__(printing)
        self._title = title
        self._asks = ""
        self.took_s = 0.0
        self._first_at: float | None = None
        self._is_again = False
        """A second look is under way, whose time is not counted."""
        self._told: tuple[str | None, TransferPhase | None] = (None, None)
        self._progress: TransferProgress | None = None
        self._got_at = 0.0
        self._past: deque[tuple[float, int]] = deque()

    def ask(self, text: str) -> None:
        """Ask *text* here, behind what has to be done at the control; empty: nothing."""
        self._asks = text
        self._draw()

    def show(self, progress: TransferProgress) -> None:
        """Show how the transfer stands now."""
        is_news = self._progress is None or (progress.phase, progress.operator) != (
            self._progress.phase,
            self._progress.operator,
        )
        self._progress, self._got_at = progress, self._now()
        self._note_bytes(progress.bytes)
        self._tell(progress)
        self._draw(is_news=is_news)

    def _note_bytes(self, count: int) -> None:
        before = self._past[-1][1] if self._past else 0
        if count < before:
            self._past.clear()
            self._is_again = True
        elif count > before and not self._is_again:
            self._first_at = self._got_at if self._first_at is None else self._first_at
            self.took_s = self._got_at - self._first_at
        self._past.append((self._got_at, count))

    def _tell(self, progress: TransferProgress) -> None:
        """Say in lines what is news, where there is no picture; programs are told what somebody has to do."""
        operator, phase = self._told
        if progress.operator is not None and progress.operator != operator:
            self._told = (progress.operator, None)
            if self._printing.json:
                self._printing.show({"transfer": self._title, "operator": progress.operator})
            elif self._live is None:
                self._printing.note(f"{self._title}: {progress.operator}")
        elif self._live is None and progress.phase in _TOLD and progress.phase != phase:
            self._told = (operator, progress.phase)
            self._printing.note(f"{self._title}: {_PHASES[progress.phase]}")

    def _picture(self) -> Group | None:
        if (progress := self._progress) is None:
            return None
        if progress.operator is not None:
            elapsed_s = progress.elapsed_s + self._now() - self._got_at
            ask = f"{progress.operator}{self._asks}"
            waits = Text(f"  waiting, {written_time(elapsed_s)}; Ctrl-C gives up", style="dim")
            return Group(Text.assemble((f"{self._title}: ", ""), (ask, "bold yellow")), waits)
        grid = Table.grid(padding=(0, 1))
        grid.add_row(
            Text(self._title, no_wrap=True, overflow="ellipsis"),
            *self._bar(progress),
            Text(_PHASES[progress.phase], style="bold yellow" if progress.phase == "held" else "bold"),
            written_time(0.0 if self._first_at is None else self._now() - self._first_at),
        )
        figures = Text("  " + ", ".join(self._figures(progress)), style="dim", no_wrap=True, overflow="ellipsis")
        return Group(grid, figures)

    @staticmethod
    def _bar(progress: TransferProgress) -> tuple[RenderableType, ...]:
        total = progress.total_bytes
        if not total:
            return ()
        return (
            ProgressBar(total=total, completed=progress.bytes, width=_BAR_WIDTH),
            f"{100 * progress.bytes / total:3.0f} %",
        )

    def _figures(self, progress: TransferProgress) -> Iterator[str]:
        of = "" if progress.total_bytes is None else f" of {progress.total_bytes:,}"
        yield f"{progress.bytes:,}{of} bytes, {progress.lines:,} lines"
        if progress.blocks:
            yield f"{progress.blocks:,} blocks"
        if progress.bytes and (rate := self._rate()) is not None:
            yield f"{rate:,.0f} bytes/s"
        if progress.held_s:
            yield f"held for {written_time(progress.held_s)} in all"

    def _rate(self) -> float | None:
        """Return how fast it goes now; None: that is not known yet."""
        now = self._now()
        while len(self._past) > 1 and now - self._past[1][0] > _RATE_OVER_S:
            self._past.popleft()
        if not self._past or now - self._past[0][0] < TICK_S:
            return None
        began_at, bytes_before = self._past[0]
        return (self._past[-1][1] - bytes_before) / (now - began_at)


def written_time(seconds: float) -> str:
    """Write how long something takes: ``4.2 s``, ``3:07 min``."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d} min"
