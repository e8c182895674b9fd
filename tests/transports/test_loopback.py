"""The in-memory line: the conformance suite, and what is its own."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from tests.conformance.far_ends import FarEnd, StreamFarEnd
from tests.conformance.transport import TransportConformance, Witness

from compax_aio.errors import TransportError
from compax_aio.transports import open_transport
from compax_aio.transports.loopback import create_pair, listen

names = iter(range(1_000_000))


class TestLoopback(TransportConformance):
    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        far = StreamFarEnd()
        with await listen(f"Line-{next(names)}", far.protocol) as listener:
            yield listener.url, far
            await far.close()


class Answering(Witness):
    """Answers each piece while it is received, through the transport that is given later."""

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        assert self.transport is not None
        self.transport.write(data.upper())


def pair(protocol_a: Witness, protocol_b: Witness) -> tuple[asyncio.Transport, asyncio.Transport]:
    return create_pair(protocol_a, protocol_b, asyncio.get_running_loop(), name="pair")


async def test_writing_never_calls_the_far_end_before_it_returns() -> None:
    near, far = Witness(), Answering()
    a, b = pair(near, far)
    a.write(b"question")
    assert not far.data
    assert await near.receives(8) == b"QUESTION"
    assert a.get_extra_info("name") == b.get_extra_info("name") == "pair"


async def test_two_ends_in_endless_conversation_let_everybody_else_run() -> None:
    left, right = Answering(), Answering()
    a, _ = pair(left, right)
    a.write(b"x")
    for _ in range(10):
        await asyncio.sleep(0)
    a.abort()
    await asyncio.gather(left.is_lost(), right.is_lost())
    assert 0 < len(left.data) < 20


async def test_what_is_written_while_it_is_delivered_waits_for_the_next_turn() -> None:
    class Rewriting(Witness):
        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if len(self.data) < 10:
                a.write(b"x")

    right = Rewriting()
    a, _ = pair(Witness(), right)
    a.write(b"x")
    await asyncio.sleep(0)
    assert len(right.data) == 1
    assert await right.receives(10) == b"x" * 10


async def test_the_far_end_gets_everything_before_it_learns_that_we_closed() -> None:
    left, right = Witness(), Witness()
    a, b = pair(left, right)
    b.pause_reading()
    a.write(b"last words")
    a.close()
    await asyncio.sleep(1)
    assert not left.losses
    assert not right.losses
    b.resume_reading()
    assert await right.receives(10) == b"last words"
    await asyncio.gather(left.is_lost(), right.is_lost())
    assert left.losses == right.losses == [None]


async def test_two_ends_that_both_close_do_not_wait_for_each_other() -> None:
    left, right = Witness(), Witness()
    a, b = pair(left, right)
    a.pause_reading()
    b.pause_reading()
    a.write(b"unread")
    b.write(b"unread")
    a.close()
    b.close()
    async with asyncio.timeout(1):
        await asyncio.gather(left.is_lost(), right.is_lost())


async def test_an_abort_reaches_the_far_end_as_a_reset() -> None:
    left, right = Witness(), Witness()
    a, b = pair(left, right)
    b.set_write_buffer_limits(high=0)
    b.write(b"never delivered")
    a.abort()
    await asyncio.gather(left.is_lost(), right.is_lost())
    assert left.losses == [None]
    assert isinstance(right.losses[0], ConnectionResetError)
    assert right.flow == ["pause"]
    assert not left.data


async def test_delivery_stops_as_soon_as_the_far_end_pauses() -> None:
    class PausingAfterOne(Witness):
        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            b.pause_reading()

    right = PausingAfterOne()
    a, b = pair(Witness(), right)
    a.writelines([b"one", b"two"])
    a.write(b"three")
    await asyncio.sleep(1)
    assert right.data == b"onetwo"
    assert a.get_write_buffer_size() == 5
    assert a.get_write_buffer_limits() == (16 * 1024, 64 * 1024)
    assert not a.can_write_eof()


async def test_a_protocol_that_fails_to_pause_is_reported_and_loses_no_byte() -> None:
    reports: list[dict[str, object]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, report: reports.append(report))

    class Failing(Witness):
        def pause_writing(self) -> None:
            raise ZeroDivisionError

    right = Witness()
    a, _ = pair(Failing(), right)
    a.set_write_buffer_limits(high=0)
    a.write(b"all of it")
    assert await right.receives(9) == b"all of it"
    assert isinstance(reports[0]["exception"], ZeroDivisionError)


async def test_a_protocol_that_fails_to_connect_leaves_no_half_a_line() -> None:
    class Failing(Witness):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            raise ZeroDivisionError

    right = Witness()
    with pytest.raises(ZeroDivisionError):
        pair(Failing(), right)
    await right.is_lost()


async def test_a_name_that_nobody_listens_to_lists_those_that_do() -> None:
    with pytest.raises(TransportError, match=r"nobody listens on loop://x in this event loop; .*: none"):
        await open_transport("loop://x", Witness)
    with (
        await listen("z", Witness),
        await listen("y", Witness),
        pytest.raises(TransportError, match="names that listen: y, z"),
    ):
        await open_transport("loop://x", Witness)


async def test_a_name_is_taken_until_its_listener_is_closed() -> None:
    listener = await listen("axis", Witness)
    with pytest.raises(TransportError, match="loop://axis is taken"):
        await listen("axis", Witness)
    listener.close()
    with await listen("axis", Witness):
        listener.close()  # a second time, and not in the name of the new one
        transport = await open_transport("loop://axis", Witness)
    transport.abort()


def test_names_belong_to_one_event_loop() -> None:
    async def first() -> None:
        await listen("axis", Witness)

    async def second() -> None:
        with pytest.raises(TransportError, match="names that listen: none"):
            await open_transport("loop://axis", Witness)

    with asyncio.Runner() as one, asyncio.Runner() as another:
        one.run(first())
        another.run(second())
