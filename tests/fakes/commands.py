"""Commands of ``compax`` run in this process, on a virtual clock, with drives that a test has made before."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

import pytest

from compax_aio.cli.app import run
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import drive_named

__all__ = ["Commands", "Outcome"]


@dataclass(frozen=True)
class Outcome:
    """What a command has left behind."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """The one line of JSON that it has printed."""
        (line,) = self.out.splitlines()
        return json.loads(line)

    @property
    def documents(self) -> list[Any]:
        """The lines of JSON that it has printed."""
        return [json.loads(line) for line in self.out.splitlines()]

    @property
    def told(self) -> str:
        """All that it has said, with single blanks."""
        return " ".join(f"{self.out} {self.err}".split())


class Commands:
    """Runs one command after the other in one event loop; names of simulated drives are known in all of them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.loop = VirtualClockLoop()
        self._capsys = capsys
        self._at: list[tuple[float, Callable[[], object]]] = []
        monkeypatch.setattr(asyncio, "run", self._run)
        monkeypatch.setenv("COLUMNS", "200")
        monkeypatch.delenv("COMPAX_SETTINGS", raising=False)

    def drive(self, name: str, knobs: Knobs | None = None) -> SimulatedDrive:
        """Make a drive that ``sim://compax?name=<name>`` will open."""

        async def make() -> SimulatedDrive:
            return drive_named(name, knobs)

        return self.loop.run_until_complete(make())

    def after(self, seconds: float, do: Callable[[], object]) -> None:
        """Do something so long after the next command has begun."""
        self._at.append((seconds, do))

    def __call__(self, *words: str) -> Outcome:
        """Carry a command out."""
        self._capsys.readouterr()
        code = run(words)
        told = self._capsys.readouterr()
        return Outcome(code, told.out, told.err)

    def close(self) -> None:
        """Close the event loop, in which nothing is left."""
        self.loop.run_until_complete(self.loop.shutdown_asyncgens())
        self.loop.run_until_complete(self.loop.shutdown_default_executor())
        self.loop.close()

    def _run(self, work: Coroutine[Any, Any, Any]) -> Any:
        """As asyncio.run() does, but for closing the loop."""
        for seconds, do in self._at:
            self.loop.call_later(seconds, do)
        self._at.clear()
        task = self.loop.create_task(work)
        try:
            return self.loop.run_until_complete(task)
        finally:
            left = asyncio.all_tasks(self.loop)
            assert not left, f"left behind: {left}"
