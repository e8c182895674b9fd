"""A real terminal in which one command of ``compax`` runs, while the event loop of a test serves its device."""

from __future__ import annotations

import asyncio
import os
import re
import sys

import pexpect

__all__ = ["LIMIT_S", "Terminal"]

LIMIT_S = 60.0

_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """A terminal in which one command runs, while this event loop serves its device."""

    def __init__(self, *words: str) -> None:
        environment = {**os.environ, "TERM": "xterm", "NO_COLOR": "1"}
        environment.pop("COMPAX_SETTINGS", None)
        self.child = pexpect.spawn(
            sys.executable,
            ["-m", "compax_aio.cli", *words],
            env=environment,
            encoding="utf-8",
            dimensions=(30, 200),
            timeout=LIMIT_S,
        )

    async def sees(self, text: str) -> None:
        """Wait until the command has written *text*."""
        await asyncio.to_thread(self.child.expect_exact, text)

    def types(self, text: str) -> None:
        """Press keys."""
        self.child.send(text)

    async def ends(self) -> tuple[int, str]:
        """Wait for the end; returns the exit code, and what was written since what was seen last."""
        await asyncio.to_thread(self.child.expect, pexpect.EOF)
        await asyncio.to_thread(self.child.wait)
        self.child.close()
        assert self.child.exitstatus is not None, f"ended by signal {self.child.signalstatus}"
        return self.child.exitstatus, " ".join(_CONTROL.sub("", str(self.child.before)).split())

    def is_shut(self) -> None:
        """Be gone, as a window that somebody closes."""
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, self.child.child_fd)
        os.close(nowhere)
