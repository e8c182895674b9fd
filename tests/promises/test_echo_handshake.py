"""A controller with room for one character loses nothing by us, and the line is used as well as it can be."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from tests.smc.bench import now

from compax_aio.simulator.server import line_named
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine
from compax_aio.smc.connecting import connect
from compax_aio.transports.registry import open_transport

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

AXES = "ABC"
QUESTIONS = [f"{axis}{question}" for axis in AXES for question in ("Z", "^")]
FOR_S = 20.0
SHARE = 0.95


class WholeStrings(asyncio.Protocol):
    """Writes a command in one piece, and waits for the answer's end, as most programs do."""

    def __init__(self) -> None:
        self.answers: asyncio.Queue[bytes] = asyncio.Queue()
        self._received = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.write(b"\n")

    def data_received(self, data: bytes) -> None:
        *lines, self._received = (self._received + data).split(b"\n")
        for line in lines:
            self.answers.put_nowait(line)

    async def ask(self, text: str, timeout_s: float = 0.5) -> bytes:
        self.transport.write(text.encode() + b"\n")
        try:
            async with asyncio.timeout(timeout_s):
                return await self.answers.get()
        except TimeoutError:
            return b""


class BareHandshake(asyncio.Protocol):
    """Does nothing but the echo handshake: writes the next character as soon as the one before is there."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self._line, self._place = b"", 0
        self._answer = b""
        self._waiter: asyncio.Future[bytes] | None = None
        transport.write(b"\n")

    def ask(self, text: str) -> asyncio.Future[bytes]:
        self._line, self._place, self._answer = text.encode() + b"\n", 0, b""
        self._waiter = asyncio.get_running_loop().create_future()
        self.transport.write(self._line[:1])
        return self._waiter

    def data_received(self, data: bytes) -> None:
        for byte in data:
            if self._place < len(self._line) - 1:
                assert byte == self._line[self._place]
                self._place += 1
                self.transport.write(self._line[self._place : self._place + 1])
            elif byte == 0x0A:
                assert self._waiter is not None
                self._waiter.set_result(self._answer)
            else:
                self._answer += bytes([byte])


def knobs(**others: Any) -> Knobs:
    """Give three axes at 9600 baud, with the times that are taken for likely."""
    return Knobs(axes=AXES, baudrate=9600, slew_speed=3000, **others)


def overruns(far: SimulatedPartyLine) -> int:
    far.advance()
    return len(far.log.texts(LogKind.OVERRUN))


COMMANDS = [f"{axis}{text}" for text in ("V1500", "Z", "R2000", "^") for axis in AXES]


async def test_a_writer_of_whole_strings_loses_characters_and_motions() -> None:
    """AMS p. 25: what works by chance while the axes stand fails when they step."""
    far = line_named("strings", knobs())
    writer = WholeStrings()
    transport = await open_transport("sim://smc?name=strings", lambda: writer)
    await asyncio.sleep(0.1)
    answers = [await writer.ask(text) for text in COMMANDS]
    await asyncio.sleep(2)
    assert overruns(far) > 0
    assert any(not answer.startswith(text.encode()) for text, answer in zip(COMMANDS, answers, strict=True))
    transport.abort()
    await asyncio.sleep(0)


async def test_the_same_commands_with_the_same_knobs_are_all_heard_from_here() -> None:
    far = line_named("ours", knobs())
    async with connect("sim://smc?name=ours", axes=AXES, name="ours") as line:
        for text in COMMANDS:
            await line.axis(text[0]).raw(text[1:])
        await asyncio.gather(*(line.axis(name).position() for name in AXES for _ in range(10)))
        await asyncio.sleep(3)
        assert [axis.position for axis in far.axes.values()] == [2000.0] * 3
        assert [axis.parameters.slew_speed for axis in far.axes.values()] == [1500] * 3
        assert line.stats.timeouts == line.stats.lost_turns == 0
    assert overruns(far) == 0


async def bare_rate(name: str, *, stepping: bool) -> float:
    """Count the answers a second that a line gives to one who does nothing but the handshake."""
    line_named(name, knobs())
    bare = BareHandshake()
    transport = await open_transport(f"sim://smc?name={name}", lambda: bare)
    await asyncio.sleep(0.1)
    if stepping:
        for axis in AXES:
            await bare.ask(f"{axis}M2000")
        await asyncio.sleep(1)
    begun_at, count = now(), 0
    while now() - begun_at < FOR_S:
        await bare.ask(QUESTIONS[count % len(QUESTIONS)])
        count += 1
    rate = count / (now() - begun_at)
    transport.abort()
    await asyncio.sleep(0)
    return rate


async def our_rate(name: str, *, stepping: bool) -> float:
    """Count the same for three callers of ours, one for each axis."""
    far = line_named(name, knobs())
    async with connect(f"sim://smc?name={name}", axes=AXES, name="ours") as line:
        if stepping:
            for axis in AXES:
                await line.axis(axis).raw("M2000")
            await asyncio.sleep(1)
        begun_at, before = now(), line.stats.exchanges

        async def poll(name: str) -> None:
            axis = line.axis(name)
            while now() - begun_at < FOR_S:
                await axis.position()
                await axis.status()

        await asyncio.gather(*map(poll, AXES))
        rate = (line.stats.exchanges - before) / (now() - begun_at)
        assert line.stats.timeouts == line.stats.lost_turns == 0
        assert overruns(far) == 0
    return rate


@pytest.mark.parametrize("stepping", [False, True], ids=["standing", "stepping"])
async def test_three_axes_are_polled_as_fast_as_by_the_bare_handshake(stepping: bool) -> None:
    bare, ours = await bare_rate("bare", stepping=stepping), await our_rate("polled", stepping=stepping)
    assert ours >= SHARE * bare, f"{ours:.2f} answers a second instead of {bare:.2f}"
