"""A simulated line on a test bench: a client at one end, a cable in between, the far end's testimony at the other."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

from compax_aio.errors import CompaxError
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine
from compax_aio.smc.connecting import connect
from compax_aio.smc.party_line import PartyLine
from compax_aio.smc.settings import SmcSettings
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = ["Cable", "bench", "commands", "ending", "motions", "now", "outcome", "received", "until"]

_SOON_S = 200.0
"""Longer than anything may take that is awaited, with the settings' defaults."""
_TICK_S = 0.0005
_QUESTIONS = {"^", "Z", "Z0", "]", "]0", "]1", "A129"}

_numbers = itertools.count()


class _End(Connection):
    """The far end of one connection."""

    def __init__(self, line: DeviceLine, connections: set[Connection], cable: Cable) -> None:
        super().__init__(line, connections)
        self._cable = cable

    def data_received(self, data: bytes) -> None:
        for byte in data:
            self._cable.carry(byte)
            super().data_received(bytes([byte]))

    def _send(self, data: bytes) -> None:
        super()._send(data)


class Cable:
    """
    Serves a simulated line as ``loop://…`` while it is plugged in, and knows what is typed.

    Attributes:
        typed: All that the client has written.
        writes: How many characters each of its writes had.
        on_entry: Called with what was written since the last line feed, before the last character of it arrives.
    """

    def __init__(self, far: SimulatedPartyLine) -> None:
        self.url = ""
        self.far = far
        self.typed = bytearray()
        self.on_entry: Callable[[bytes], None] = lambda _: None
        self._entry = bytearray()
        self._listener: LoopbackListener | None = None
        self._connections: set[Connection] = set()
        self._name = f"smc-{next(_numbers)}"

    def carry(self, byte: int) -> None:
        """Take note of a character on its way to the far end."""
        self.typed.append(byte)
        self._entry.append(byte)
        self.on_entry(bytes(self._entry))
        if byte == 0x0A:
            self._entry.clear()

    def at(self, entry: str, action: Callable[[], object], *, times: int = 1) -> None:
        """Do something when the client has typed just that since the last line feed, the first *times*."""
        wanted, left, before = entry.encode("latin-1"), [times], self.on_entry

        def watch(typed: bytes) -> None:
            before(typed)
            if typed == wanted and left[0]:
                left[0] -= 1
                action()

        self.on_entry = watch

    async def plug(self) -> None:
        """Lead to the far end from now on."""
        line = DeviceLine.of(self.far)
        self._listener = await listen(self._name, lambda: _End(line, self._connections, self))
        self.url = self._listener.url

    def pull(self) -> None:
        """Lose the line, and let nobody connect."""
        if self._listener is not None:
            with self._listener:
                pass
            self._listener = None
        for connection in tuple(self._connections):
            connection.abort()
        self._entry.clear()

    def pull_and_plug(self, after_s: float = 0.2) -> None:
        """Lose the line, and have it back soon."""
        loop = asyncio.get_running_loop()
        self.pull()
        loop.call_later(after_s, lambda: loop.create_task(self.plug()))


@asynccontextmanager
async def bench(
    settings: SmcSettings | None = None,
    *,
    connects: str | None = None,
    fails_to_close: bool = False,
    axis_knobs: dict[str, Knobs] | None = None,
    **knobs: Any,
) -> AsyncIterator[tuple[PartyLine, SimulatedPartyLine, Cable]]:
    """Connect to a simulated line; *connects* says to which axes, if not to those of the knobs."""
    far = SimulatedPartyLine(Knobs(**knobs), axis_knobs=axis_knobs)
    cable = Cable(far)
    await cable.plug()
    mode = far.knobs.mode
    axes = connects if connects is not None else "" if mode == "single" else far.knobs.axes
    line = await connect(cable.url, mode=mode, axes=axes, name="bus", settings=settings)
    try:
        yield line, far, cable
    finally:
        try:
            await line.close()
        except CompaxError:
            if not fails_to_close:
                raise
        cable.pull()
        await asyncio.sleep(_TICK_S)


def now() -> float:
    """Return the time of the event loop."""
    return asyncio.get_running_loop().time()


def commands(far: SimulatedPartyLine, axis: str | None = None) -> list[str]:
    """List what the axes have executed, but for questions and stops."""
    far.advance()
    return [text for text in far.log.texts(LogKind.COMMAND, axis=axis) if text not in _QUESTIONS | {"@"}]


def motions(far: SimulatedPartyLine, axis: str | None = None) -> list[str]:
    """List the motions that the axes have begun."""
    far.advance()
    return far.log.texts(LogKind.MOTION_STARTED, axis=axis)


async def until(condition: Callable[[], bool], at_most_s: float = 100.0) -> None:
    """Wait until *condition* holds."""
    async with asyncio.timeout(at_most_s):
        while not condition():  # noqa: ASYNC110  # a log has no event to wait for
            await asyncio.sleep(_TICK_S)


async def received(far: SimulatedPartyLine, command: str) -> None:
    """Wait until an axis has executed *command*."""
    await until(lambda: command in far.log.texts(LogKind.COMMAND))


async def outcome(awaitable: Awaitable[Any]) -> Any:
    """Return the result, or the error that it ends with."""
    try:
        async with asyncio.timeout(_SOON_S):
            return await awaitable
    except CompaxError as error:
        return error


async def ending(awaitable: Awaitable[Any]) -> CompaxError:
    """Return the error that *awaitable* must end with."""
    result = await outcome(awaitable)
    assert isinstance(result, CompaxError), f"it ended well: {result!r}"
    return result
