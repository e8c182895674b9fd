"""Transports on top of another one: the conformance suite without any greetings, and with greetings of every kind."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from tests.conformance.far_ends import FarEnd, StreamFarEnd, listening_on_tcp
from tests.conformance.transport import TransportConformance, Witness, descriptors

from compax_aio.errors import ConnectionLostError
from compax_aio.transports import ProtocolFactory, TransportURL
from compax_aio.transports.layered import Layer, LayeredTransport, open_layered
from compax_aio.transports.network import NetworkAddress, connected_socket


class Plain(Layer):
    """What passes is said as it is. ``?`` ends the greetings if there are any, ``!`` breaks the line, ``.`` ends it."""

    def __init__(self, greeting: bytes = b"") -> None:
        self.is_ready = not greeting
        self._to_send = greeting

    def receive(self, data: bytes) -> bytes:
        if b"!" in data:
            raise OSError("broken")
        if not self.is_ready:
            _, mark, data = data.partition(b"?")
            self.is_ready = bool(mark)
        data, mark, _ = data.partition(b".")
        self.is_over = self.is_over or bool(mark)
        return data

    def encode(self, data: bytes | bytearray | memoryview) -> bytes:
        return bytes(data)

    def bytes_to_send(self) -> bytes:
        data, self._to_send = self._to_send, b""
        return data


class Transparent(Plain):
    """What passes is said as it is, all of it."""

    def receive(self, data: bytes) -> bytes:
        return data


async def open_plain(port: int, layer: Layer, protocol_factory: ProtocolFactory) -> LayeredTransport:
    async with connected_socket(NetworkAddress("127.0.0.1", port, 5)) as sock:
        return await open_layered(sock, layer, protocol_factory, greetings_s=2)


class TestLayered(TransportConformance):
    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with listening_on_tcp() as (port, far):
            yield f"tcp://127.0.0.1:{port}", far

    async def open(self, url: str, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        address = NetworkAddress.of(TransportURL.parse(url), "tcp://host:1")
        return await open_plain(address.port, Transparent(), protocol_factory)


@asynccontextmanager
async def greeted(answer: bytes, witness: Witness) -> AsyncIterator[tuple[LayeredTransport, StreamFarEnd]]:
    """Open a line to a far end that answers our greeting with *answer*."""
    async with asyncio.timeout(10), listening_on_tcp() as (port, far):

        async def answers() -> None:
            assert await far.read(5) == b"hello"
            await far.write(answer)

        answering = asyncio.create_task(answers())
        transport = await open_plain(port, Plain(b"hello"), lambda: witness)
        await answering
        try:
            yield transport, far
        finally:
            if not witness.losses:
                transport.abort()
                await witness.is_lost()


async def test_what_comes_with_the_end_of_the_greetings_is_handed_over_first() -> None:
    witness = Witness()
    async with greeted(b"welcome?early", witness) as (_, far):
        await far.write(b" late")
        assert await witness.receives(10) == b"early late"


async def test_what_came_early_waits_while_reading_is_paused_and_again() -> None:
    witness = Witness(pauses_at_once=True)
    async with greeted(b"?early", witness) as (transport, far):
        transport.resume_reading()
        transport.pause_reading()
        await far.write(b" late")
        await asyncio.sleep(0.01)
        assert not witness.data
        transport.resume_reading()
        assert await witness.receives(10) == b"early late"


async def test_a_far_end_that_takes_leave_with_its_greeting_is_heard_first() -> None:
    witness = Witness()
    async with greeted(b"?that is all.", witness):
        assert await witness.receives(11) == b"that is all"
        await witness.is_lost()
        assert witness.losses == [None]


async def test_a_far_end_that_takes_leave_ends_the_line() -> None:
    witness = Witness()
    async with greeted(b"?", witness) as (transport, far):
        await far.write(b"that is all.")
        assert await witness.receives(11) == b"that is all"
        await witness.is_lost()
        assert transport.is_closing()


async def test_a_line_that_breaks_says_how_and_can_still_be_asked() -> None:
    witness = Witness()
    async with greeted(b"?", witness) as (transport, far):
        assert transport.get_extra_info("peername")
        assert transport.get_extra_info("layer") is transport.layer
        assert "open" in repr(transport)
        assert transport.get_protocol() is witness
        assert not transport.can_write_eof()
        transport.set_write_buffer_limits(high=400)
        assert transport.get_write_buffer_limits() == (100, 400)
        await far.write(b"!")
        await witness.is_lost()
        assert isinstance(witness.losses[0], ConnectionLostError)
        assert "the line broke: broken" in str(witness.losses[0])
        # After the end, everything may be called, and nothing happens.
        transport.write(b"x")
        transport.pause_reading()
        transport.resume_reading()
        transport.set_write_buffer_limits(high=1)
        transport.close()
        transport.abort()
        assert transport.get_write_buffer_size() == 0
        assert transport.get_extra_info("peername", "gone") == "gone"
        assert "closed" in repr(transport)
        await asyncio.sleep(2)
        assert len(witness.losses) == 1


@pytest.mark.parametrize("answer", [b"!", b""])
async def test_greetings_that_fail_are_told_to_the_opener_and_leave_nothing_open(answer: bytes) -> None:
    before = descriptors()
    async with listening_on_tcp() as (port, far):
        opening = asyncio.create_task(open_plain(port, Plain(b"hello"), Witness))
        await far.read(5)
        await far.write(answer)
        if not answer:
            await far.hang_up()
        with pytest.raises(OSError, match="broken" if answer else "hung up"):
            await opening
    await asyncio.sleep(0.01)
    assert descriptors() <= before


async def test_greetings_that_end_too_late_are_given_up() -> None:
    async with listening_on_tcp() as (port, _):
        with pytest.raises(TimeoutError):
            await open_plain(port, Plain(b"hello"), Witness)
    assert asyncio.get_running_loop().time() == pytest.approx(2, abs=0.1)


async def test_a_line_that_times_out_below_is_told_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    class TimedOut(Plain):
        def receive(self, data: bytes) -> bytes:
            raise TimeoutError(110, "Connection timed out")

    async with listening_on_tcp() as (port, far):
        opening = asyncio.create_task(open_plain(port, TimedOut(b"hello"), Witness))
        await far.read(5)
        await far.write(b"x")
        with pytest.raises(TimeoutError, match="Connection timed out"):
            await opening
    assert asyncio.get_running_loop().time() < 0.5


class FakeBelow(asyncio.Transport):
    """A line below that writes down what it is told."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[object] = []

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.told.append(bytes(data))

    def get_write_buffer_size(self) -> int:
        return 0

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        self.told.append((low, high))

    def pause_reading(self) -> None:
        self.told.append("pause")


async def test_nothing_more_is_read_between_the_greetings_and_the_protocol() -> None:
    transport, below = LayeredTransport(asyncio.get_running_loop(), Plain(b"hello")), FakeBelow()
    transport.made_below(below)
    transport.received_below(b"welcome")
    assert "pause" not in below.told
    transport.received_below(b"?early")
    assert below.told[-1] == "pause"
    assert transport.ready.done()


async def test_the_line_below_says_whenever_it_falls_to_our_low_mark() -> None:
    """Not only if it was above our high one: what the layer holds counts too."""
    transport, below = LayeredTransport(asyncio.get_running_loop(), Transparent()), FakeBelow()
    transport.made_below(below)
    transport.set_write_buffer_limits(high=1000, low=100)
    assert below.told[-1] == (100, 100)


async def test_a_failure_that_nobody_waits_for_any_more_is_not_reported() -> None:
    reports: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, report: reports.append(report))
    transport = LayeredTransport(asyncio.get_running_loop(), Plain(b"hello"))
    transport.lost_below(OSError("gone"))
    del transport
    gc.collect()
    assert not reports


async def test_a_protocol_that_cannot_be_made_or_connected_leaves_no_socket_open() -> None:
    class Failing(Witness):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            raise ZeroDivisionError

    def fail() -> asyncio.Protocol:
        raise ZeroDivisionError

    before = descriptors()
    failing = Failing()
    for factory in (fail, lambda: failing):
        async with listening_on_tcp() as (port, _):
            with pytest.raises(ZeroDivisionError):
                await open_plain(port, Transparent(), factory)
    await failing.is_lost()
    await asyncio.sleep(0.01)
    assert descriptors() <= before
