"""A drive on a test bench: a client at one end, a simulated or scripted drive and its testimony at the other."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import compax_aio
from compax_aio import Drive, DriveSettings
from compax_aio.errors import CompaxError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.simulator.server import drive_named
from compax_aio.transports.loopback import listen

__all__ = [
    "PROMPT",
    "ScriptedDrive",
    "bench",
    "ending",
    "is_moving",
    "lines",
    "motions",
    "now",
    "received",
    "scripted",
    "served_through",
    "stands",
    "strangers_order",
    "until",
    "watch_what_is_left_behind",
]

PROMPT = b"\r\n>"
_TICK_S = 0.0005
_LONGEST_TEST_S = 1000.0


@asynccontextmanager
async def bench(
    name: str = "x", *, settings: DriveSettings | None = None, **knobs: Any
) -> AsyncIterator[tuple[Drive, SimulatedDrive]]:
    """Connect to the simulated drive *name*; without knobs also to one that is there already."""
    far = drive_named(name, Knobs(**knobs) if knobs else None)
    async with compax_aio.connect(f"sim://compax?name={name}", name=name, settings=settings) as drive:
        yield drive, far


def now() -> float:
    """Return the time of the event loop."""
    return asyncio.get_running_loop().time()


def lines(far: SimulatedDrive) -> list[str]:
    """List the lines that the far end has received."""
    return far.log.texts(LogKind.LINE)


def is_moving(far: SimulatedDrive) -> bool:
    """Say whether the axis moves now; a function, so that nobody takes it for a fact that stays."""
    return far.moving


def motions(far: SimulatedDrive) -> list[str]:
    """List the positionings that the far end has begun."""
    return far.log.texts(LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED)


async def until(condition: Callable[[], bool], at_most_s: float = 100.0, *, to_the_tick: bool = False) -> None:
    """Wait until *condition* holds, and be back half a millisecond later; after a second of it not so exactly."""
    begun_at = now()
    async with asyncio.timeout(at_most_s):
        while not condition():  # noqa: ASYNC110  # a drive's log has no event to wait for
            await asyncio.sleep(_TICK_S if to_the_tick or now() - begun_at < 1 else 20 * _TICK_S)


async def received(far: SimulatedDrive, line: str) -> None:
    """Wait until the far end is at work on *line*; it has not answered yet."""
    await until(lambda: lines(far)[-1:] == [line], to_the_tick=True)


async def stands(far: SimulatedDrive) -> None:
    """Wait until the axis stands, whoever sees to it, at most a second."""
    await until(lambda: not far.moving, 1.0)


async def ending(awaitable: Awaitable[Any]) -> CompaxError:
    """Return the error that *awaitable* must end with."""
    try:
        result = await awaitable
    except CompaxError as error:
        return error
    raise AssertionError(f"it ended well: {result!r}")


def strangers_order(far: SimulatedDrive, line: str) -> None:
    """Let somebody else tell the drive something: what it answers comes to our client, who asked for nothing."""
    far.receive(line.encode() + b"\r", now())
    assert far.served_by is not None
    far.served_by.changed()


@asynccontextmanager
async def served_through(far: SimulatedDrive, name: str, to_drive: Callable[[bytes], bytes]) -> AsyncIterator[str]:
    """Serve a drive on ``loop://name`` through a line that does *to_drive* to what the client writes."""

    class BadLine(Connection):
        def data_received(self, data: bytes) -> None:
            super().data_received(to_drive(data))

    connections: set[Connection] = set()
    line = DeviceLine.of(far)
    with await listen(name, lambda: BadLine(line, connections)) as listener:
        yield listener.url
        for connection in tuple(connections):
            connection.abort()


class ScriptedDrive(asyncio.Protocol):
    """
    A far end that says what it is told to say, for what a well-behaved drive never does.

    *answers* maps a line to the text before the prompt; None keeps silent. Every other command gets a bare prompt.
    """

    def __init__(self, answers: Mapping[str, str | None] | None = None) -> None:
        self.answers: dict[str, str | None] = {
            "S1": "S001: 0.00",
            "S2": "S002: 0.00",
            "S16": "S016: 11010000",
            "S17": "S017: 00000010",
            "S30": "S030: 0 0",
            "P20": "P020: 0",
            "S18": "S018: 00 00 00 00 00 00 00 00",
            **{f"S{number}": f"S{number:03}: SCRIPTED" for number in range(31, 40)},
            **(answers or {}),
        }
        self.lines: list[str] = []
        self.on_line: Callable[[str], None] = lambda _: None
        self.transport: asyncio.Transport
        self._entry = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        *complete, self._entry = (self._entry + data).split(b"\r")
        for raw in complete:
            line = raw.decode()
            self.lines.append(line)
            self.on_line(line)
            if (answer := self.answers.get(line, "")) is not None:
                self.transport.write(answer.encode() + PROMPT)


@asynccontextmanager
async def scripted(
    answers: Mapping[str, str | None] | None = None, *, settings: DriveSettings | None = None
) -> AsyncIterator[tuple[Drive, ScriptedDrive]]:
    """Connect to a scripted drive."""
    far = ScriptedDrive(answers)
    with await listen("scripted", lambda: far) as listener:
        async with compax_aio.connect(listener.url, name="x", settings=settings) as drive:
            yield drive, far


@asynccontextmanager
async def watch_what_is_left_behind() -> AsyncIterator[None]:
    """Fail if a task is left, asyncio has something to complain about, or there is no end to it."""
    loop = asyncio.get_running_loop()
    complaints: list[str] = []
    loop.set_exception_handler(lambda _, context: complaints.append(str(context)))

    def give_up() -> None:
        complaints.append(f"no end after {_LONGEST_TEST_S:g} s")
        for task in asyncio.all_tasks():
            task.cancel()

    giving_up = loop.call_later(_LONGEST_TEST_S, give_up)
    yield
    giving_up.cancel()
    # What a far end does after it was hung up takes a turn of the loop.
    await asyncio.sleep(_TICK_S)
    left = [repr(task) for task in asyncio.all_tasks() if task is not asyncio.current_task()]
    gc.collect(1)
    assert not left
    assert not complaints
