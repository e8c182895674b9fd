"""How far work has come that reads or writes many things one by one: a bar at a terminal, else nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .printing import Printing, notes_console

__all__ = ["counting"]


@contextmanager
def counting(title: str, printing: Printing) -> Iterator[Callable[[int, int], None]]:
    """Show a bar during a block; gives what is to be called with how many are done, and how many there are."""
    if printing.json or not sys.stderr.isatty():
        yield lambda done, total: None  # noqa: ARG005
        return
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=notes_console(),
        transient=True,
        auto_refresh=False,
    )
    with bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total, refresh=True)
