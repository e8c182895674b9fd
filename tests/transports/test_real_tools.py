"""The conformance suite through real programs between the two ends: socat joins two ptys, ser2net serves one on TCP."""

from __future__ import annotations

import asyncio
import errno
import os
import re
import shutil
import socket
import subprocess
import tempfile
import termios
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import ClassVar

import pytest
from tests.conformance.far_ends import DescriptorFarEnd, FarEnd
from tests.conformance.transport import TransportConformance, Witness

from compax_aio.errors import TransportError
from compax_aio.transports import ProtocolFactory, open_transport

pytestmark = pytest.mark.real_time

INPUT_FLAGS, CONTROL_FLAGS, OUTPUT_SPEED = 0, 2, 5  # their places in what termios.tcgetattr returns
SER2NET = shutil.which("ser2net", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


class FarEndOfRelay(DescriptorFarEnd):
    """The other side of a program that passes bytes on; it hangs up like a box that loses its power."""

    def __init__(self, descriptor: int, relay: subprocess.Popen[str]) -> None:
        super().__init__(descriptor)
        self._relay = relay

    async def hang_up(self) -> None:
        self._relay.kill()
        self.close()


@contextmanager
def held_open(path: str) -> Iterator[None]:
    """Hold *path* open, so that a pty which its last user closes keeps what is in it."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        yield
    finally:
        os.close(descriptor)


@pytest.mark.skipif(shutil.which("socat") is None, reason="socat is not installed")
class TestSerialThroughSocat(TransportConformance):
    bulk_bytes = 64 * 1024

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        end = "pty,raw,echo=0"
        with running("socat", "-d", "-d", end, end) as socat:
            near, distant = await asyncio.to_thread(names_of_ptys, socat)
            with held_open(near):
                far = FarEndOfRelay(os.open(distant, os.O_RDWR | os.O_NOCTTY), socat)
                try:
                    yield f"serial://{near}", far
                finally:
                    far.close()


def names_of_ptys(socat: subprocess.Popen[str]) -> tuple[str, str]:
    assert socat.stderr is not None
    names: list[str] = []
    for report in socat.stderr:
        names += re.findall(r"PTY is (\S+)", report)
        if "starting data transfer loop" in report:
            break
    near, distant = names
    return near, distant


@pytest.mark.skipif(SER2NET is None, reason="ser2net is not installed")
class TestTcpThroughSer2net(TransportConformance):
    bulk_bytes = 64 * 1024
    slaves: ClassVar[dict[str, int]] = {}

    # When its client has closed, ser2net flushes the port: on a pty, that is what the far end has not read yet.
    test_what_was_written_before_close_arrives = None  # type: ignore[assignment]
    test_what_is_written_after_close_is_ignored = None  # type: ignore[assignment]

    async def open(self, url: str, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        transport = await super().open(url, protocol_factory)
        # ser2net accepts first and sets its port up afterwards; until then the pty echoes.
        try:
            await becomes_true(lambda: termios.tcgetattr(self.slaves[url])[OUTPUT_SPEED] == termios.B9600)
        except BaseException:
            transport.abort()
            raise
        return transport

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        master, slave = os.openpty()
        port = free_port()
        with served_by_ser2net(os.ttyname(slave), port) as ser2net:
            far = FarEndOfRelay(master, ser2net)
            await becomes_true(lambda: is_listened_on(port))
            url = f"tcp://127.0.0.1:{port}"
            self.slaves[url] = slave
            try:
                yield url, far
            finally:
                far.close()
                os.close(slave)


@asynccontextmanager
async def rfc2217_through_ser2net() -> AsyncIterator[tuple[int, int, FarEndOfRelay]]:
    """Give port number, descriptor of the serial port's own side, and far end."""
    master, slave = os.openpty()
    port = free_port()
    with served_by_ser2net(os.ttyname(slave), port, "telnet(rfc2217),") as ser2net:
        far = FarEndOfRelay(master, ser2net)
        await becomes_true(lambda: is_listened_on(port))
        try:
            yield port, slave, far
        finally:
            far.close()
            os.close(slave)


@pytest.mark.skipif(SER2NET is None, reason="ser2net is not installed")
class TestRfc2217ThroughSer2net(TransportConformance):
    bulk_bytes = 64 * 1024

    # As above: ser2net flushes the port when its client has closed.
    test_what_was_written_before_close_arrives = None  # type: ignore[assignment]
    test_what_is_written_after_close_is_ignored = None  # type: ignore[assignment]

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with rfc2217_through_ser2net() as (port, _, far):
            yield f"rfc2217://127.0.0.1:{port}", far


@pytest.mark.skipif(SER2NET is None, reason="ser2net is not installed")
@pytest.mark.parametrize(
    ("options", "speed", "control_flags", "input_flags"),
    [
        ("", termios.B9600, 0, 0),
        ("?baudrate=4800&stopbits=2&xonxoff=1", termios.B4800, termios.CSTOPB, termios.IXON | termios.IXOFF),
        ("?baudrate=19200&rtscts=1", termios.B19200, termios.CRTSCTS, 0),
    ],
)
async def test_the_settings_of_a_url_arrive_at_the_port_that_ser2net_serves(
    options: str, speed: int, control_flags: int, input_flags: int
) -> None:
    """All but the size of a character and its parity, which the kernel does not keep for a pty."""
    async with rfc2217_through_ser2net() as (port, slave, _):
        witness = Witness()
        transport = await open_transport(f"rfc2217://127.0.0.1:{port}{options}", lambda: witness)
        attributes = termios.tcgetattr(slave)
        transport.abort()
        await witness.is_lost()
    assert attributes[OUTPUT_SPEED] == speed
    assert attributes[CONTROL_FLAGS] & (termios.CSTOPB | termios.CRTSCTS) == control_flags
    assert attributes[INPUT_FLAGS] & (termios.IXON | termios.IXOFF) == input_flags


@pytest.mark.skipif(SER2NET is None, reason="ser2net is not installed")
async def test_a_port_that_ser2net_serves_to_somebody_else_says_so() -> None:
    async with rfc2217_through_ser2net() as (port, _, _):
        witness = Witness()
        transport = await open_transport(f"rfc2217://127.0.0.1:{port}", lambda: witness)
        with pytest.raises(TransportError, match="saying 'Port already in use'"):
            await open_transport(f"rfc2217://127.0.0.1:{port}", Witness)
        transport.abort()
        await witness.is_lost()


@contextmanager
def served_by_ser2net(serial_port: str, port: int, layer: str = "") -> Iterator[subprocess.Popen[str]]:
    with tempfile.TemporaryDirectory() as directory:
        configuration = Path(directory, "ser2net.yaml")
        configuration.write_text(
            "connection: &drive\n"
            f"  accepter: {layer}tcp,127.0.0.1,{port}\n"
            f"  connector: serialdev,{serial_port},9600n81,local\n"
        )
        with running(str(SER2NET), "-n", "-u", "-c", str(configuration), "-P", f"{directory}/pid") as process:
            yield process


async def becomes_true(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not condition():  # noqa: ASYNC110  # another process has no event to set
            await asyncio.sleep(0.002)


def free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def is_listened_on(port: int) -> bool:
    # By trying to bind it: a connection would be one for ser2net, which serves one at a time.
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind(("127.0.0.1", port))
        except OSError as exc:
            if exc.errno != errno.EADDRINUSE:
                raise
            return True
    return False
