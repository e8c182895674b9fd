"""
The far end in a process of its own: started, asked, and ended when its standard input is.

The far end's module calls :func:`stay` with where its lines are; who measures opens :func:`far_end` of that module.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

__all__ = ["FarEnd", "far_end", "stay"]

_CPU_S: Final = "cpu_s"
_GRACE_S: Final = 5.0


class FarEnd:
    """
    A far end that runs.

    Attributes:
        where: What it said at its start: where its lines are.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.where: Any = self._read()

    @property
    def pid(self) -> int:
        """Of its process."""
        return self._process.pid

    def _read(self) -> Any:
        assert self._process.stdout is not None
        if not (line := self._process.stdout.readline()):
            raise RuntimeError(f"the far end {self._process.args!r} ended at once, see above for why")
        return json.loads(line)

    def ask(self, question: str) -> Any:
        """Ask it something, on one line, outside of the lines that are measured; blocks until it has answered."""
        assert self._process.stdin is not None
        print(question, file=self._process.stdin, flush=True)
        return self._read()

    @property
    def cpu_s(self) -> float:
        """The CPU time that its process has used until now, in seconds."""
        return float(self.ask(_CPU_S))


@contextmanager
def far_end(module: str, *arguments: str) -> Iterator[FarEnd]:
    """
    Run ``python -m module arguments…`` until the block is left.

    Raises:
        RuntimeError: It ended before it said where its lines are.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for who measures, who ends this one
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield FarEnd(process)
    finally:
        process.stdin.close()
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()


async def stay(where: object, answers: Mapping[str, Callable[[str], object]] | None = None) -> None:
    """
    Say where the lines are, and answer questions until nobody can ask any more.

    Args:
        where: Anything that JSON can say.
        answers: By the first word of a question, what is called with the rest of it; what it returns is the answer.
            ``cpu_s`` is always answered.
    """
    known = {_CPU_S: lambda _: time.process_time(), **(answers or {})}
    print(json.dumps(where), flush=True)
    while line := await asyncio.to_thread(sys.stdin.readline):
        word, _, rest = line.strip().partition(" ")
        print(json.dumps(known[word](rest)), flush=True)
