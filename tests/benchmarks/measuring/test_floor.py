"""The floor and the least that a client does are what they say: the same exchange, with nothing left out of it."""

from __future__ import annotations

import asyncio

import pytest
from benchmarks.measuring.exchanges import CPU_US, WALL_US, a_round, a_round_async
from benchmarks.measuring.floor import LINE, Bare, Least


class FakeTransport(asyncio.Transport):
    """Keeps what is written."""

    def __init__(self) -> None:
        super().__init__()
        self.written: list[bytes] = []

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written.append(bytes(data))


def _connected(protocol: Bare | Least) -> FakeTransport:
    transport = FakeTransport()
    protocol.connection_made(transport)
    return transport


async def test_the_floor_writes_finds_the_prompt_and_sets_a_future() -> None:
    protocol = Bare()
    transport = _connected(protocol)
    answer = protocol.ask()
    assert transport.written == [LINE]
    protocol.data_received(b"S001: 1")
    assert not answer.done()
    protocol.data_received(b".5\r\n>")
    assert await answer == b"S001: 1.5\r\n>"


async def test_the_least_sends_one_line_at_a_time_and_returns_numbers() -> None:
    protocol = Least()
    transport = _connected(protocol)
    asked = [asyncio.ensure_future(protocol.position()) for _ in range(2)]
    await asyncio.sleep(0)
    assert transport.written == [LINE]
    protocol.data_received(b"S016: 11010000\r\n>")
    protocol.data_received(b"S001: 1.5\r\n>")
    assert transport.written == [LINE, LINE]
    protocol.data_received(b"S001: -2\r\n>")
    assert await asyncio.gather(*asked) == [1.5, -2.0]
    protocol.connection_lost(None)


async def test_the_least_does_not_wait_for_ever() -> None:
    protocol = Least()
    _connected(protocol)
    with pytest.raises(TimeoutError):
        await protocol.position()
    protocol.connection_lost(None)


async def test_the_time_of_the_least_counts_from_the_last_line() -> None:
    protocol = Least()
    transport = _connected(protocol)
    loop = asyncio.get_running_loop()
    for _ in range(3):
        begun_at, asked = loop.time(), asyncio.ensure_future(protocol.position())
        await asyncio.sleep(0.7)
        protocol.data_received(b"S001: 0\r\n>")
        assert await asked == 0.0
        assert loop.time() - begun_at == pytest.approx(0.7)
    await asyncio.sleep(5)
    assert len(transport.written) == 3


@pytest.mark.real_time
async def test_a_round_lasts_as_long_as_it_is_told_and_counts_every_exchange() -> None:
    count = 0

    def ask() -> None:
        nonlocal count
        count += 1

    async def ask_and_wait() -> None:
        ask()

    measured = a_round(ask, 0.01)
    awaited = await a_round_async(ask_and_wait, 0.01)
    for each in (measured, awaited):
        assert each[CPU_US] > 0
        assert each[WALL_US] > 0
    assert count * min(measured[WALL_US], awaited[WALL_US]) / 1e6 <= 10
    assert count % 25 == 0
