"""Traces for tests: a program recorded with simulated devices, written by hand, and read back."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any

import compax_aio
from compax_aio import DriveSettings
from compax_aio.link.taps import Fact
from compax_aio.recording import Conversation, conversations, read_trace, record_trace
from compax_aio.recording.trace_entries import SessionBegun, encoded

__all__ = ["BEGUN", "conversation", "facts", "lines_of", "record_move", "rewritten", "write"]

BEGUN = SessionBegun("2026-11-30T09:55:54.481724+00:00", "compax-aio 0.1.0")


def write(path: Path, entries: Iterable[tuple[float, str, Fact]]) -> Path:
    """Write a trace of one session by hand."""
    told = [(0.0, "", BEGUN), *entries]
    path.write_text("".join(f"{text}\n" for entry in told for text in encoded(*entry)))
    return path


def lines_of(path: Path) -> list[dict[str, Any]]:
    """Read the file as the JSON that it is."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def facts(path: Path, kind: type[Fact] | None = None) -> list[Fact]:
    """Read what happened, of one kind or of all."""
    return [entry.fact for entry in read_trace(path) if kind is None or isinstance(entry.fact, kind)]


def conversation(path: Path, line: str = "x") -> Conversation:
    """Read the conversation with one line, the last there is."""
    return [each for each in conversations(path) if each.line == line][-1]


async def record_move(
    path: Path,
    url: str = "sim://compax",
    *,
    program: Callable[[compax_aio.Drive], Awaitable[Any]] | None = None,
    settings: DriveSettings | None = None,
) -> Any:
    """Record a program with one drive, which moves it to 12.5 if nothing else is said."""
    async with record_trace(path), compax_aio.connect(url, name="x", settings=settings) as drive:
        if program is not None:
            return await program(drive)
        await drive.move_to(12.5)
        return await drive.position()


def rewritten(path: Path, change: Callable[[list[dict[str, Any]]], None]) -> Path:
    """Change the entries of a trace, and write it again."""
    entries = lines_of(path)
    change(entries)
    path.write_text("".join(f"{json.dumps(entry)}\n" for entry in entries))
    return path
