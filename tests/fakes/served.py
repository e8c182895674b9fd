"""`compax sim` in a process of its own, played by a test as a person plays it: words typed, and what is seen read."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["FarEnd", "Served"]

LIMIT_S = 60.0
"""Generous: a busy machine takes its time."""


class Served:
    """
    Devices that are served until :meth:`close`.

    Args:
        words: Of `compax sim`.
        environment: Of the process; None: ours.

    Attributes:
        urls: Where programs find them, by name.
    """

    def __init__(self, *words: str, environment: Mapping[str, str] | None = None) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "compax_aio.cli", "sim", *words, "--json"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self.urls: dict[str, str] = json.loads(self._stdout.readline())["urls"]
        self._seen: list[dict[str, Any]] = []
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        for line in self._stdout:
            with self._news:
                self._seen.append(json.loads(line))
                self._news.notify_all()

    def types(self, text: str) -> None:
        """Type a line."""
        with self._news:
            self._stdin.write(f"{text}\n")
            self._stdin.flush()

    def now(self) -> int:
        """Return what to hand to :meth:`sees`, for what comes from now on."""
        return len(self._seen)

    def sees(self, what: Callable[[dict[str, Any]], Any], since: int) -> Any:
        """Wait until something is printed of which *what* is true; returns that."""
        at = since
        end = time.monotonic() + LIMIT_S
        with self._news:
            while True:
                while at < len(self._seen):
                    if found := what(self._seen[at]):
                        return found
                    at += 1
                assert self._news.wait(end - time.monotonic()), f"only this was seen: {self._seen[since:]}"

    def printed(self, since: int) -> list[dict[str, Any]]:
        """Return all that has been printed since then."""
        return self._seen[since:]

    def close(self) -> int:
        """End service; returns the exit code."""
        self._stdin.write("quit\n")
        self._stdin.close()
        code = self._process.wait(LIMIT_S)
        self._reader.join(LIMIT_S)
        self._stdout.close()
        return code


class FarEnd:
    """One device of those that are served."""

    def __init__(self, served: Served, name: str) -> None:
        self._served = served
        self.name = name
        self.url = served.urls[name]
        self._since = served.now()

    def begins(self) -> None:
        """Look, from now on, only at what happens from now on."""
        self._since = self._served.now()

    def does(self, words: str, until: str) -> None:
        """Type *words* for this device, and wait until it says that *until* has befallen it."""
        since = self._served.now()
        self._served.types(f"{self.name} {words}")
        self._served.sees(
            lambda each: each.get("device") == self.name and until in str(each.get("text", each.get("kind"))), since
        )

    def sees(self, *kinds: str) -> None:
        """Wait until it has logged something of these kinds, one after the other."""
        waits_for = list(kinds)

        def is_last(each: dict[str, Any]) -> bool:
            if each.get("device") == self.name and each["kind"] == waits_for[0]:
                del waits_for[0]
            return not waits_for

        self._served.sees(is_last, self._since)

    def seen(self, *kinds: str) -> list[str]:
        """Return the texts of what it has logged of these kinds."""
        return [
            each.get("text", "")
            for each in self._served.printed(self._since)
            if each.get("device") == self.name and each["kind"] in kinds
        ]

    def where(self) -> str:
        """Ask how it stands."""
        since = self._served.now()
        self._served.types(f"{self.name} where")
        return str(
            self._served.sees(
                lambda each: each.get("said") if each.get("said", "").startswith(f"{self.name}:") else None, since
            )
        )

    @property
    def moves(self) -> bool:
        """Whether it, or any axis of it, is moving."""
        return "moving" in self.where()

    def heals(self) -> None:
        """End all trouble, and have it stand."""
        self.does("heal", "healed")
        if self.moves:
            self.does("power 10ms", "the power is back")
        assert not self.moves
