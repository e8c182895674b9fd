"""Open ``replay://`` lines: a recorded conversation plays the drive's side, so that a field problem is a test case."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from ..errors import TransportError, UnexpectedAnswerError
from ..link.taps import Refused
from ..transports.loopback import create_pair
from ..transports.registry import ProtocolFactory
from ..transports.url import TransportURL
from .replay_far_ends import Answers, LenientFarEnd, StrictFarEnd
from .replay_script import Attempt, Script, read_script

__all__ = ["open_replay"]

_FORM: Final = "replay:///path/to/trace.jsonl?line=x&mode=strict"
_OPTIONS: Final = ("line", "mode", "session", "speed")
_FASTEST: Final = 1e6


class _Replay:
    """
    A conversation that is being played, over all the times that its line is opened.

    Args:
        script: What is played.
        make: Makes the far end of an attempt.
        speed: How many times as fast as it went; 0: at once.
        is_strict: Whether the line is opened no more often than it was.
    """

    def __init__(self, script: Script, speed: float, *, is_strict: bool) -> None:
        self._script = script
        self._speed = speed
        self._answers = None if is_strict else Answers(script)
        self._opened = 0
        self._deviation: str | None = None

    async def open(self, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        if self._deviation is not None:
            raise UnexpectedAnswerError(self._deviation, hint="compare the trace with what was sent this time")
        attempts = self._script.attempts
        attempt = attempts[self._opened] if self._opened < len(attempts) else None
        if attempt is None and self._answers is None:
            raise TransportError(
                f"{self._script.path} has no more of this line: it was opened {len(attempts)} times",
                hint="the conversation is over",
            )
        self._opened += 1
        if attempt is not None:
            await self._wait(attempt)
        near, _ = create_pair(
            protocol_factory(), self._far_end(attempt), asyncio.get_running_loop(), name=self._script.conversation.line
        )
        return near

    async def _wait(self, attempt: Attempt) -> None:
        """Take as long as it took; raises TransportError if it was refused."""
        refused = attempt.refused
        until = attempt.opened_at if refused is None else refused.at
        if until is not None and self._speed:
            await asyncio.sleep((until - attempt.begun.at) / self._speed)
        if until is None:
            raise TransportError(f"{self._script.place(attempt.begun)}: the trace does not tell how the opening ended")
        if refused is not None and isinstance(refused.fact, Refused):
            raise TransportError(f"as in {self._script.place(refused)}: {refused.fact.why}")

    def _far_end(self, attempt: Attempt | None) -> asyncio.Protocol:
        if self._answers is not None:
            return LenientFarEnd(self._answers, attempt, self._speed)
        assert attempt is not None
        return StrictFarEnd(self._script, attempt, self._speed, self._note_deviation)

    def _note_deviation(self, what: str) -> None:
        self._deviation = what


_replays: WeakKeyDictionary[Any, tuple[str, _Replay]] = WeakKeyDictionary()
"""By who opens it: a line that is lost and opened again goes on with what came next."""


async def open_replay(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``replay:///path/to/trace.jsonl``, and play the drive's side of what was recorded there.

    Options: ``line``, the name of the line, where there are several; ``session``, counted from 1, else the last that
    has the line; ``mode``, which is ``strict`` (what is sent must be what was sent then, byte for byte, or the line is
    lost) or ``lenient`` (each line is answered by what came the next time it was said); ``speed``, how many times as
    fast as it went, 0 for at once.

    Raises:
        TransportError: There is no such trace or line, or it was refused at this time then, too.
        UnexpectedAnswerError: The line was lost because something else was sent than then.
    """
    url.expect(_FORM, host=True, path=True, query=_OPTIONS)
    owner = getattr(protocol_factory, "__self__", None)  # a class or a function is anybody's, and outlives them
    known = _known(owner)
    if known is None or known[0] != url.text:
        known = (url.text, await _read(url))
        _remember(owner, known)
    return await known[1].open(protocol_factory)


async def _read(url: TransportURL) -> _Replay:
    path = url.host + url.path
    if not path:
        raise TransportError(f"the URL {str(url)!r} names no trace", hint=f"write it as {_FORM}")
    is_strict = url.choice("mode", True, {"strict": True, "lenient": False})
    speed = _speed(url)
    session = url.integer("session", 0, minimum=1, maximum=10**9) or None
    return await asyncio.to_thread(_load, Path(path), url.query.get("line"), session, speed, is_strict)


def _load(path: Path, line: str | None, session: int | None, speed: float, is_strict: bool) -> _Replay:
    try:
        return _Replay(read_script(path, line, session), speed, is_strict=is_strict)
    except ValueError as error:
        raise TransportError(f"it cannot be replayed: {error}") from error


def _speed(url: TransportURL) -> float:
    """Return the speed; 0 stands for at once, and so does inf."""
    text = url.query.get("speed")
    if text in {"0", "inf"}:
        return 0.0
    return url.number("speed", 1.0, above=0.0, maximum=_FASTEST)


def _known(owner: Any) -> tuple[str, _Replay] | None:
    try:
        return _replays.get(owner)
    except TypeError:  # nobody can be remembered who cannot be referred to weakly
        return None


def _remember(owner: Any, known: tuple[str, _Replay]) -> None:
    try:
        _replays[owner] = known
    except TypeError:
        return
