"""Any anyio byte stream as a transport: the conformance suite over TCP, and streams that behave badly."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import anyio
import pytest
from anyio.abc import ByteStream
from tests.conformance.far_ends import FarEnd, listening_on_tcp
from tests.conformance.transport import TransportConformance, Witness

from compax_aio.errors import ConnectionLostError
from compax_aio.transports import ProtocolFactory, TransportURL
from compax_aio.transports.bytestream import wrap_byte_stream


class TestByteStream(TransportConformance):
    test_an_unknown_option_is_refused_by_name = None  # type: ignore[assignment]  # it has no URL

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with listening_on_tcp() as (port, far):
            yield f"tcp://127.0.0.1:{port}", far

    async def open(self, url: str, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        where = TransportURL.parse(url)
        assert where.port is not None
        return wrap_byte_stream(await anyio.connect_tcp(where.host, where.port), protocol_factory)


class BadStream(ByteStream):
    """A stream whose methods each do what they are told, or never return."""

    def __init__(self, **answers: Exception | bytes | None) -> None:
        self._answers = answers
        self.sent = b""

    async def _answer(self, method: str) -> Any:
        if method not in self._answers:
            await asyncio.get_running_loop().create_future()
        answer = self._answers[method]
        if isinstance(answer, Exception):
            raise answer
        return answer

    async def receive(self, max_bytes: int = 65536) -> bytes:
        data: bytes = await self._answer("receive")
        return data

    async def send(self, item: bytes) -> None:
        await self._answer("send")
        self.sent += item

    async def send_eof(self) -> None:
        raise NotImplementedError

    async def aclose(self) -> None:
        await self._answer("aclose")


@asynccontextmanager
async def wrapped(stream: ByteStream) -> AsyncIterator[tuple[asyncio.Transport, Witness]]:
    async with asyncio.timeout(1000):
        witness = Witness()
        transport = wrap_byte_stream(stream, lambda: witness)
        try:
            yield transport, witness
        finally:
            transport.abort()
            await witness.is_lost()


@pytest.fixture
def reports() -> list[dict[str, Any]]:
    return []


@pytest.fixture(autouse=True)
async def reporting(reports: list[dict[str, Any]]) -> None:
    asyncio.get_running_loop().set_exception_handler(lambda _, report: reports.append(report))


async def test_abort_loses_a_line_within_a_second_although_nothing_of_the_stream_ever_returns() -> None:
    async with wrapped(BadStream()) as (transport, witness):
        transport.write(b"never sent")
        await asyncio.sleep(1)
        began = asyncio.get_running_loop().time()
        transport.abort()
        await witness.is_lost()
        assert asyncio.get_running_loop().time() - began <= 1
        assert witness.losses == [None]


async def test_abort_loses_a_line_within_a_second_although_closing_cannot_be_cancelled() -> None:
    class Stubborn(BadStream):
        async def aclose(self) -> None:
            with anyio.CancelScope(shield=True):
                await asyncio.sleep(100)

    async with wrapped(Stubborn()) as (transport, witness):
        transport.abort()
        await witness.is_lost()
        assert asyncio.get_running_loop().time() <= 1
        await asyncio.sleep(200)
        assert witness.losses == [None]


@pytest.mark.parametrize(
    "error", [OSError(5, "input/output error"), anyio.BrokenResourceError(), anyio.ClosedResourceError()]
)
@pytest.mark.parametrize("method", ["receive", "send"])
async def test_a_stream_that_breaks_loses_the_line_with_the_cause(method: str, error: Exception) -> None:
    async with wrapped(BadStream(**{method: error, "aclose": None})) as (transport, witness):
        transport.write(b"anything")
        await witness.is_lost()
    [lost] = witness.losses
    assert isinstance(lost, ConnectionLostError)
    assert lost.__cause__ is error
    assert str(lost) == f"the line broke: {str(error) or type(error).__name__}"


@pytest.mark.parametrize("method", ["receive", "send"])
async def test_a_stream_that_raises_anything_else_loses_the_line_and_is_reported(
    method: str, reports: list[dict[str, Any]]
) -> None:
    defect = ZeroDivisionError()
    async with wrapped(BadStream(**{method: defect, "aclose": None})) as (transport, witness):
        transport.write(b"anything")
        await witness.is_lost()
    assert witness.losses == [defect]
    assert [report["exception"] for report in reports] == [defect]


async def test_a_stream_that_cannot_be_closed_is_reported_and_the_line_is_lost_all_the_same(
    reports: list[dict[str, Any]],
) -> None:
    defect = ZeroDivisionError()
    async with wrapped(BadStream(aclose=defect)) as (transport, witness):
        transport.close()
        await witness.is_lost()
    assert witness.losses == [None]
    assert [report["exception"] for report in reports] == [defect]


async def test_a_protocol_that_fails_to_connect_leaves_the_stream_closed() -> None:
    left, right = await socket_pair()

    class Failing(Witness):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            raise ZeroDivisionError

    failing = Failing()
    with pytest.raises(ZeroDivisionError):
        wrap_byte_stream(left, lambda: failing)
    with pytest.raises(anyio.EndOfStream):
        await right.receive()
    await failing.is_lost()
    await right.aclose()


async def test_what_arrives_while_reading_is_paused_is_not_received_once_the_line_is_closed() -> None:
    async with wrapped(BadStream(receive=b"late", aclose=None)) as (transport, witness):
        transport.pause_reading()
        await asyncio.sleep(1)
        transport.close()
        transport.resume_reading()
        await witness.is_lost()
        assert not witness.data


async def test_the_stream_and_the_water_marks_can_be_asked_for() -> None:
    stream = BadStream(aclose=None)
    async with wrapped(stream) as (transport, _):
        assert transport.get_extra_info("stream") is stream
        transport.set_write_buffer_limits(low=10)
        assert transport.get_write_buffer_limits() == (10, 40)
        assert not transport.can_write_eof()


async def socket_pair() -> tuple[ByteStream, ByteStream]:
    accepted: asyncio.Future[ByteStream] = asyncio.get_running_loop().create_future()
    listener = await anyio.create_tcp_listener(local_host="127.0.0.1")

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(listener.serve, keep(accepted))
        near = await anyio.connect_tcp("127.0.0.1", listener.extra(anyio.abc.SocketAttribute.local_port))
        far = await accepted
        tasks.cancel_scope.cancel()
    await listener.aclose()
    return near, far


def keep(accepted: asyncio.Future[ByteStream]) -> Callable[[ByteStream], Any]:
    async def handle(stream: ByteStream) -> None:
        accepted.set_result(stream)

    return handle
