"""RFC 2217 lines against pyserial's PortManager: the conformance suite, settings that arrive, and odd servers."""

from __future__ import annotations

import asyncio
import os
import termios
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any, ClassVar, cast

import pytest
import serial
import serial.rfc2217
from tests.conformance.far_ends import FarEnd, StreamFarEnd, listening_on_tcp
from tests.conformance.transport import TransportConformance, Witness, descriptors
from tests.transports.test_rfc2217_codec import ACKNOWLEDGED

from compax_aio.errors import TransportError
from compax_aio.transports import open_transport


class Port:
    """What PortManager manages: the settings of a port, at first other ones than anybody asks for."""

    def __init__(self) -> None:
        self.baudrate, self.bytesize, self.parity, self.stopbits = 1200, 6, "S", 2
        self.rtscts = self.xonxoff = self.cts = self.dsr = self.ri = self.cd = False
        self.dtr = self.rts = self.break_condition = False


class PortManagerFarEnd(StreamFarEnd):
    """A server that puts pyserial's PortManager between the network and :attr:`port`."""

    def __init__(self, port: Any) -> None:
        super().__init__()
        self.port = port
        self._manager: Any = None
        self._data = bytearray()
        self._greeting: asyncio.Task[None] | None = None

    def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        super().accept(reader, writer)
        if self._manager is None:
            self._manager = serial.rfc2217.PortManager(self.port, cast(Any, writer))
            self._greeting = asyncio.ensure_future(self._greet(reader))

    async def _greet(self, reader: asyncio.StreamReader) -> None:
        while self._manager.modemstate_mask and (data := await reader.read(4096)):
            self._take(data)

    def _take(self, data: bytes) -> None:
        for byte in self._manager.filter(data):
            self._data += byte

    async def read(self, count: int) -> bytes:
        reader, _ = await asyncio.shield(self._connected)
        assert self._greeting is not None
        await self._greeting
        while len(self._data) < count:
            data = await reader.read(4096)
            if not data:
                raise EOFError
            self._take(data)
        data = bytes(self._data[:count])
        del self._data[:count]
        return data

    async def write(self, data: bytes) -> None:
        await super().write(b"".join(self._manager.escape(data)))

    async def close(self) -> None:
        if self._greeting is not None:
            self._greeting.cancel()
        await super().close()


@asynccontextmanager
async def port_manager(there: Any = None) -> AsyncIterator[tuple[int, PortManagerFarEnd]]:
    far = PortManagerFarEnd(Port() if there is None else there)
    server = await asyncio.start_server(far.accept, "127.0.0.1", 0, limit=far.LIMIT_BYTES)
    try:
        yield server.sockets[0].getsockname()[1], far
    finally:
        server.close()
        await far.close()


class TestRfc2217(TransportConformance):
    bulk_bytes = 200_000

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with port_manager() as (port, far):
            yield f"rfc2217://127.0.0.1:{port}?baudrate=4800", far


# --- settings


@asynccontextmanager
async def opened(url: str) -> AsyncIterator[tuple[asyncio.Transport, Witness]]:
    async with asyncio.timeout(20):
        witness = Witness()
        transport = await open_transport(url, lambda: witness)
        try:
            yield transport, witness
        finally:
            transport.abort()
            await witness.is_lost()


async def test_a_line_opens_with_9600_baud_8n1_without_handshake() -> None:
    async with port_manager() as (port, far), opened(f"rfc2217://127.0.0.1:{port}"):
        there = far.port
    assert (there.baudrate, there.bytesize, there.parity, there.stopbits) == (9600, 8, "N", 1)
    assert (there.rtscts, there.xonxoff) == (False, False)


@pytest.mark.parametrize("handshake", ["rtscts", "xonxoff"])
async def test_every_option_reaches_the_port(handshake: str) -> None:
    options = f"baudrate=4800&bytesize=7&parity=O&stopbits=1.5&{handshake}=1"
    async with port_manager() as (port, far), opened(f"rfc2217://127.0.0.1:{port}?{options}"):
        there = far.port
    assert (there.baudrate, there.bytesize, there.parity, there.stopbits) == (4800, 7, "O", 1.5)
    assert (there.rtscts, there.xonxoff) == (handshake == "rtscts", handshake == "xonxoff")


async def test_every_option_reaches_a_real_port() -> None:
    """On a pty, whose settings the kernel tells, all but the size of a character and its parity: it keeps neither."""

    class PtyPort(serial.Serial):
        cts = dsr = ri = cd = False  # a pty has no modem lines

    master, slave = os.openpty()
    try:
        with PtyPort(os.ttyname(slave), baudrate=300) as there:
            options = "baudrate=19200&stopbits=2&rtscts=1"
            async with port_manager(there) as (port, _), opened(f"rfc2217://127.0.0.1:{port}?{options}"):
                assert (there.baudrate, there.stopbits, there.rtscts) == (19200, 2, True)
            _, _, cflag, _, in_speed, out_speed, _ = termios.tcgetattr(slave)
            assert in_speed == out_speed == termios.B19200
            assert cflag & termios.CSTOPB
            assert cflag & termios.CRTSCTS
    finally:
        os.close(master)
        os.close(slave)


async def test_two_handshakes_at_once_are_refused() -> None:
    with pytest.raises(TransportError, match="asks for two handshakes; RFC 2217 knows one"):
        await open_transport("rfc2217://127.0.0.1:1?rtscts=1&xonxoff=1", Witness)


@pytest.mark.parametrize(
    ("option", "what"),
    [
        ("baudrate=115200", "asked for baudrate=115200, and has baudrate=9600"),
        ("stopbits=2", "asked for stopbits=2, and has stopbits=1"),
        ("parity=M", "asked for parity=M, and has parity=N"),
        ("bytesize=5", "asked for bytesize=5, and has bytesize=8"),
    ],
)
async def test_a_setting_that_the_port_cannot_do_is_refused(option: str, what: str) -> None:
    async with port_manager(PortOfOneKind()) as (port, _):
        with pytest.raises(TransportError, match=f"{what}; ask for what its port can do"):
            await open_transport(f"rfc2217://127.0.0.1:{port}?{option}", Witness)


class PortOfOneKind(Port):
    """A port that is at 9600 baud, 8N1, and refuses to be anything else."""

    _FIXED: ClassVar[dict[str, object]] = {"baudrate": 9600, "bytesize": 8, "parity": "N", "stopbits": 1}

    def __init__(self) -> None:
        super().__init__()
        self.__dict__.update(self._FIXED)
        self.is_fixed = True

    def __setattr__(self, name: str, value: object) -> None:
        if "is_fixed" in self.__dict__ and self._FIXED.get(name, value) != value:
            raise ValueError("not me")
        super().__setattr__(name, value)


# --- other servers


@asynccontextmanager
async def a_server_that(answers: Callable[[bytes], bytes | None]) -> AsyncIterator[tuple[int, StreamFarEnd]]:
    """Answer each piece that arrives; None hangs up."""
    async with listening_on_tcp() as (port, far):

        async def serve() -> None:
            reader, writer = await asyncio.shield(far._connected)
            while data := await reader.read(4096):
                reply = answers(data)
                if reply is None:
                    writer.close()
                    return
                writer.write(reply)

        serving = asyncio.create_task(serve())
        try:
            yield port, far
        finally:
            serving.cancel()
            with suppress(asyncio.CancelledError, OSError):
                await serving


IAC_DO_COM_PORT = b"\xff\xfd\x2c"


async def test_a_server_that_acknowledges_nothing_is_used_and_told_of(caplog: pytest.LogCaptureFixture) -> None:
    async with (
        a_server_that(lambda data: IAC_DO_COM_PORT if b"\xff\xfb\x2c" in data else b"") as (port, far),
        opened(f"rfc2217://127.0.0.1:{port}?connect_timeout_s=4") as (transport, witness),
    ):
        assert asyncio.get_running_loop().time() == pytest.approx(2, abs=0.1)
        assert "has not acknowledged baudrate=9600, bytesize=8" in caplog.text
        await far.write(b">")
        assert await witness.receives(1) == b">"
        transport.write(b"S1\r")


async def test_a_raw_port_says_that_it_is_one() -> None:
    async with a_server_that(lambda _: b"\r\n>") as (port, _):
        with pytest.raises(TransportError, match=r"said nothing of RFC 2217 within 2 s; .*use tcp://"):
            await open_transport(f"rfc2217://127.0.0.1:{port}?connect_timeout_s=2", Witness)
    assert asyncio.get_running_loop().time() == pytest.approx(2, abs=0.1)


async def test_a_telnet_server_without_rfc_2217_says_so() -> None:
    async with a_server_that(lambda _: b"\xff\xfb\x01") as (port, _):
        with pytest.raises(TransportError, match="speaks telnet, but did not agree to RFC 2217 within 2 s"):
            await open_transport(f"rfc2217://127.0.0.1:{port}?connect_timeout_s=2", Witness)


async def test_a_server_that_is_busy_is_quoted() -> None:
    replies = iter([b"\xff\xfb\x01Port already in use\r\n"])
    async with a_server_that(lambda _: next(replies, None)) as (port, far):
        opening = asyncio.create_task(open_transport(f"rfc2217://127.0.0.1:{port}", Witness))
        await asyncio.sleep(0.1)
        await far.hang_up()
        with pytest.raises(TransportError, match="hung up during the greetings, saying 'Port already in use'"):
            await opening


async def test_an_opening_that_is_cancelled_during_the_greetings_leaves_nothing_open() -> None:
    async with a_server_that(lambda _: b"") as (port, _):
        before = descriptors()
        opening = asyncio.create_task(open_transport(f"rfc2217://127.0.0.1:{port}", Witness))
        await asyncio.sleep(1)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        await asyncio.sleep(0.01)
        assert descriptors() <= before + 1  # the server's end of it


async def test_a_server_that_suspends_the_line_pauses_the_protocol_and_resumes_it() -> None:
    async with port_manager() as (port, far), opened(f"rfc2217://127.0.0.1:{port}") as (transport, witness):
        transport.set_write_buffer_limits(high=10, low=5)
        _, writer = await far._connected
        writer.write(b"\xff\xfa\x2c\x6c\xff\xf0")
        await asyncio.sleep(0.01)
        transport.write(b"held back by it")
        assert witness.flow == ["pause"]
        assert transport.get_write_buffer_size() == 15
        writer.write(b"\xff\xfa\x2c\x6d\xff\xf0")
        assert await far.read(15) == b"held back by it"
        assert witness.flow == ["pause", "resume"]


async def test_what_arrives_with_the_last_acknowledgement_waits_for_the_protocol() -> None:
    replies = iter([IAC_DO_COM_PORT, ACKNOWLEDGED + b"early"])
    async with a_server_that(lambda _: next(replies, b"")) as (port, far):
        witness = Witness(pauses_at_once=True)
        transport = await open_transport(f"rfc2217://127.0.0.1:{port}", lambda: witness)
        await far.write(b" and late")
        await asyncio.sleep(0.05)
        assert not witness.data
        transport.resume_reading()
        assert await witness.receives(14) == b"early and late"
        transport.abort()
        await witness.is_lost()
