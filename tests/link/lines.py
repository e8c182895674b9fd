"""Lines for the tests of the link: a Link that speaks COMPAX, and the far end of its line."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable
from typing import TypeVar

from tests.fakes.scripted import ScriptedFarEnd

from compax_aio.compax.protocol import Acknowledged, Answered, CompaxProtocol, MessageForm
from compax_aio.errors import ConnectionLostError
from compax_aio.link.contract import DeviceProtocol, Event, Lane, TurnOver
from compax_aio.link.link import Link
from compax_aio.transports.loopback import create_pair

__all__ = ["Line", "connected", "elapsed", "unique_name"]

_T = TypeVar("_T")
_numbers = itertools.count()


def unique_name() -> str:
    return f"link-{next(_numbers)}"


class Line:
    """A link, its far end, and what the link has told about itself."""

    def __init__(self, far: ScriptedFarEnd, protocol: DeviceProtocol | None = None) -> None:
        self.far = far
        self.events: list[Event] = []
        self.losses: list[ConnectionLostError] = []
        self.protocol = protocol or CompaxProtocol(MessageForm.PROMPT_FIRST)
        self.link = Link(
            self.protocol,
            name="x",
            answer_timeout_s=1.0,
            resync_attempts=3,
            on_event=self.events.append,
            on_lost=self.losses.append,
        )

    def connect(self) -> None:
        create_pair(self.link, self.far, asyncio.get_running_loop())

    def ask(self, text: str, lane: Lane = Lane.READ) -> asyncio.Future[TurnOver]:
        return self.link.exchange(text, lane)

    async def answer(self, text: str, lane: Lane = Lane.READ) -> str:
        """Ask and return the text of the answer."""
        outcome = await self.link.exchange(text, lane)
        assert isinstance(outcome, Answered | Acknowledged)
        return outcome.text if isinstance(outcome, Answered) else ""


async def connected(far: ScriptedFarEnd | None = None) -> Line:
    """Give a line that is in step; the far end has forgotten the marker."""
    line = Line(far or ScriptedFarEnd())
    line.connect()
    await line.answer("S99")
    line.far.lines.clear()
    line.far.times.clear()
    line.far.writes.clear()
    return line


async def elapsed(awaited: Awaitable[_T]) -> tuple[_T | BaseException, float]:
    """Return the outcome, an exception included, and how many seconds it took."""
    loop = asyncio.get_running_loop()
    before = loop.time()
    (outcome,) = await asyncio.gather(awaited, return_exceptions=True)
    return outcome, loop.time() - before
