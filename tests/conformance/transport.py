"""What every transport must do, as one class of tests: whoever writes one subclasses it and says how to make a line."""

from __future__ import annotations

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from pathlib import Path

import pytest

from compax_aio.errors import TransportError
from compax_aio.transports import ProtocolFactory, open_transport

from .far_ends import FarEnd

__all__ = ["TransportConformance", "Witness"]

ALL_BYTES = bytes(range(256))
LONG_S = 20.0


class Witness(asyncio.Protocol):
    """A protocol that writes down what its transport tells it."""

    def __init__(self, *, pauses_at_once: bool = False) -> None:
        self.transport: asyncio.Transport | None = None
        self.data = bytearray()
        self.losses: list[Exception | None] = []
        self.flow: list[str] = []
        self._pauses_at_once = pauses_at_once
        self._news = asyncio.Event()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        assert self.transport is None, "connection_made was called twice"
        self.transport = transport
        if self._pauses_at_once:
            transport.pause_reading()

    def data_received(self, data: bytes) -> None:
        assert not self.losses, "data_received was called after connection_lost"
        self.data += data
        self._news.set()

    def pause_writing(self) -> None:
        self.flow.append("pause")
        self._news.set()

    def resume_writing(self) -> None:
        self.flow.append("resume")
        self._news.set()

    def connection_lost(self, exc: Exception | None) -> None:
        self.losses.append(exc)
        self._news.set()

    async def sees(self, condition: Callable[[], bool]) -> None:
        """Return when *condition*, which depends on what is written down here, is true."""
        while not condition():
            self._news.clear()
            await self._news.wait()

    async def receives(self, count: int) -> bytes:
        """Return the next *count* bytes."""
        await self.sees(lambda: len(self.data) >= count)
        data = bytes(self.data[:count])
        del self.data[:count]
        return data

    async def is_lost(self) -> None:
        """Return when ``connection_lost`` has been called."""
        await self.sees(lambda: bool(self.losses))


Opened = tuple[asyncio.Transport, Witness, FarEnd]


class TransportConformance(ABC):
    """
    Subclass it as ``TestMyTransport`` and implement :meth:`line`; pytest does the rest.

    The tests are coroutines, for pytest-asyncio. They take the clock of their event loop, virtual or real.
    """

    bulk_bytes = 1_000_000

    @abstractmethod
    def line(self) -> AbstractAsyncContextManager[tuple[str, FarEnd]]:
        """Make a new line that nobody has opened: its URL and its far end."""

    async def open(self, url: str, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        """Open *url*; for transports that no scheme leads to, override it."""
        return await open_transport(url, protocol_factory)

    @asynccontextmanager
    async def opened(self, *, pauses_at_once: bool = False) -> AsyncIterator[Opened]:
        """Give an open line, its protocol and its far end; closed at the end, all within bounded time."""
        async with asyncio.timeout(LONG_S), self.line() as (url, far):
            witness = Witness(pauses_at_once=pauses_at_once)
            transport = await self.open(url, lambda: witness)
            try:
                yield transport, witness, far
            finally:
                if not witness.losses:
                    transport.abort()
                await witness.is_lost()

    def bulk(self) -> bytes:
        """Return bytes that are not the same when some are lost, doubled or out of order."""
        return b"".join(b"%07d\n" % number for number in range(self.bulk_bytes // 8))

    async def fill(self, transport: asyncio.Transport) -> int:
        """Write until neither the line nor the far end takes more; return how much that was."""
        written = 0
        while True:
            transport.write(bytes(1_000_000))
            written += 1_000_000
            await asyncio.sleep(0.02)
            if transport.get_write_buffer_size():
                return written

    # --- opening

    async def test_connection_made_has_run_when_the_opener_returns(self) -> None:
        async with asyncio.timeout(LONG_S), self.line() as (url, _):
            witness = Witness()
            transport = await self.open(url, lambda: witness)
            connected_to = witness.transport
            transport.abort()
            await witness.is_lost()
        assert connected_to is transport

    async def test_an_unknown_option_is_refused_by_name(self) -> None:
        async with asyncio.timeout(LONG_S), self.line() as (url, _):
            with pytest.raises(TransportError, match=r"no option 'no_such_option'.*known options"):
                await self.open(f"{url}{'&' if '?' in url else '?'}no_such_option=1", Witness)

    @pytest.mark.parametrize("turns", range(6))
    async def test_an_opening_that_is_cancelled_leaks_no_descriptor(self, turns: int) -> None:
        async with self.opened():
            pass  # what is opened once and kept is open from here on
        before = descriptors()
        witness = Witness()
        async with asyncio.timeout(LONG_S), self.line() as (url, _):
            opening = asyncio.create_task(self.open(url, lambda: witness))
            for _ in range(turns):
                await asyncio.sleep(0)
            opening.cancel()
            with suppress(asyncio.CancelledError):
                (await opening).abort()
            await asyncio.sleep(0.05)  # a far end that accepts meanwhile is a far end to be closed
        for _ in range(200):
            if descriptors() <= before:
                break
            await asyncio.sleep(0.01)
        assert descriptors() <= before
        assert witness.transport is None or witness.losses, "a transport was left open"

    # --- bytes

    async def test_all_256_values_go_both_ways_unchanged(self) -> None:
        async with self.opened() as (transport, witness, far):
            transport.write(ALL_BYTES)
            assert await far.read(256) == ALL_BYTES
            await far.write(ALL_BYTES)
            assert await witness.receives(256) == ALL_BYTES

    async def test_pieces_arrive_in_the_order_of_writing(self) -> None:
        async with self.opened() as (transport, _, far):
            transport.write(b"one ")
            transport.writelines([b"two ", bytearray(b"three "), memoryview(b"four ")])
            transport.write(b"")
            transport.write(bytearray(b"five"))
            assert await far.read(23) == b"one two three four five"

    async def test_much_data_goes_both_ways_at_once(self) -> None:
        async with self.opened() as (transport, witness, far):
            bulk = self.bulk()
            transport.write(bulk)
            there, back, _ = await asyncio.gather(far.read(len(bulk)), witness.receives(len(bulk)), far.write(bulk))
            assert there == bulk
            assert back == bulk

    # --- flow control

    async def test_nothing_is_received_while_reading_is_paused(self) -> None:
        async with self.opened() as (transport, witness, far):
            await far.write(b"before")
            assert await witness.receives(6) == b"before"
            transport.pause_reading()
            assert not transport.is_reading()
            await far.write(b"meanwhile")
            await asyncio.sleep(0.05)
            assert not witness.data
            transport.resume_reading()
            assert transport.is_reading()
            assert await witness.receives(9) == b"meanwhile"

    async def test_reading_that_is_paused_by_connection_made_stays_paused(self) -> None:
        async with self.opened(pauses_at_once=True) as (transport, witness, far):
            await far.write(b"early")
            await asyncio.sleep(0.05)
            assert not witness.data
            transport.resume_reading()
            assert await witness.receives(5) == b"early"

    async def test_writing_pauses_above_the_high_mark_and_resumes_at_the_low_one(self) -> None:
        async with self.opened() as (transport, witness, far):
            transport.set_write_buffer_limits(high=1000, low=100)
            written = await self.fill(transport)
            assert transport.get_write_buffer_size() > 1000
            assert witness.flow[-1] == "pause"
            await far.read(written)
            await witness.sees(lambda: witness.flow[-1] == "resume")
            assert transport.get_write_buffer_size() <= 100
            assert witness.flow == ["pause", "resume"] * (len(witness.flow) // 2)

    async def test_a_low_mark_above_the_high_one_is_refused(self) -> None:
        async with self.opened() as (transport, _, _):
            with pytest.raises(ValueError, match="high"):
                transport.set_write_buffer_limits(high=1, low=2)

    # --- the end

    async def test_what_was_written_before_close_arrives(self) -> None:
        async with self.opened() as (transport, witness, far):
            bulk = self.bulk()
            transport.write(bulk)
            transport.close()
            assert transport.is_closing()
            assert await far.read(len(bulk)) == bulk
            await witness.is_lost()
            assert witness.losses == [None]

    async def test_what_is_written_after_close_is_ignored(self) -> None:
        async with self.opened() as (transport, witness, far):
            transport.write(b"first")
            transport.close()
            transport.write(b"late")
            assert await far.read(5) == b"first"
            await witness.is_lost()
            transport.write(b"too late")
            with pytest.raises((TimeoutError, EOFError)):
                async with asyncio.timeout(0.1):
                    await far.read(1)

    async def test_nothing_is_received_after_close(self) -> None:
        async with self.opened() as (transport, witness, far):
            transport.close()
            assert not transport.is_reading()
            with_luck = asyncio.create_task(far.write(b"late"))
            await witness.is_lost()
            await asyncio.wait([with_luck])
            with_luck.exception()
            assert not witness.data

    async def test_abort_loses_the_connection_within_a_second_while_another_line_answers(self) -> None:
        async with self.opened() as (transport, witness, _), self.opened() as other:
            await self.fill(transport)
            await self.abort_is_bounded(transport, witness, other)

    async def abort_is_bounded(self, transport: asyncio.Transport, witness: Witness, other: Opened) -> None:
        """Abort *transport*, whose far end takes nothing, and watch *other* while that lasts."""
        began, began_on_the_wall = asyncio.get_running_loop().time(), time.perf_counter()
        transport.abort()
        _, longest_s = await asyncio.gather(witness.is_lost(), exchanges(other, 10))
        assert asyncio.get_running_loop().time() - began <= 1
        assert time.perf_counter() - began_on_the_wall <= 1
        assert longest_s < 0.5, "the other line had to wait"
        assert transport.is_closing()
        await exchanges(other, 1)
        assert witness.losses == [None]

    async def test_connection_lost_is_called_once_whatever_ends_the_line(self) -> None:
        async with self.opened() as (transport, witness, far):
            transport.write(b"bye")
            transport.close()
            transport.close()
            transport.abort()
            await far.hang_up()
            await witness.is_lost()
            transport.close()
            await asyncio.sleep(0.7)
            assert len(witness.losses) == 1

    async def test_closing_twice_does_no_harm(self) -> None:
        async with self.opened() as (transport, witness, _):
            assert not transport.is_closing()
            transport.close()
            transport.close()
            assert transport.is_closing()
            await witness.is_lost()
            transport.close()
            assert witness.losses == [None]

    async def test_a_far_end_that_hangs_up_ends_the_line(self) -> None:
        async with self.opened() as (transport, witness, far):
            await far.write(b"bye")
            assert await witness.receives(3) == b"bye"
            await far.hang_up()
            await witness.is_lost()
            assert transport.is_closing()
            assert len(witness.losses) == 1

    async def test_a_far_end_that_hangs_up_ends_the_line_at_once_when_bytes_are_unsent(self) -> None:
        async with self.opened() as (transport, witness, far):
            await self.fill(transport)
            await far.hang_up()
            async with asyncio.timeout(1):
                await witness.is_lost()

    async def test_a_protocol_that_fails_loses_its_line_and_is_reported(self) -> None:
        reports: list[dict[str, object]] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, report: reports.append(report))

        class Failing(Witness):
            def data_received(self, data: bytes) -> None:
                raise ZeroDivisionError

        async with asyncio.timeout(LONG_S), self.line() as (url, far):
            failing = Failing()
            await self.open(url, lambda: failing)
            await far.write(b"anything")
            await failing.is_lost()
        assert isinstance(failing.losses[0], ZeroDivisionError)
        assert any(isinstance(report.get("exception"), ZeroDivisionError) for report in reports)

    # --- the protocol behind it

    async def test_another_protocol_can_take_over(self) -> None:
        async with self.opened() as (transport, witness, far):
            heir = Witness()
            transport.set_protocol(heir)
            assert transport.get_protocol() is heir
            await far.write(b"for the heir")
            assert await heir.receives(12) == b"for the heir"
            transport.set_protocol(witness)

    async def test_what_the_transport_does_not_know_about_itself_is_the_default(self) -> None:
        async with self.opened() as (transport, _, _):
            assert transport.get_extra_info("no such information", "default") == "default"
            assert repr(transport)


async def exchanges(line: Opened, count: int) -> float:
    """Send there and back *count* times; return how many real seconds the longest one took."""
    transport, witness, far = line
    longest_s = 0.0
    for _ in range(count):
        began = time.perf_counter()
        transport.write(b"ping")
        assert await far.read(4) == b"ping"
        await far.write(b"pong")
        assert await witness.receives(4) == b"pong"
        longest_s = max(longest_s, time.perf_counter() - began)
    return longest_s


def descriptors() -> int:
    """Return how many file descriptors this process has open."""
    return sum(1 for _ in Path("/dev/fd").iterdir())
