"""Serial lines on a pty: the conformance suite, held lines, unplugging, settings, and ports that do not open."""

from __future__ import annotations

import asyncio
import errno
import os
import stat
import sys
import termios
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import serial
import serial_asyncio
import serialx
from tests.conformance.far_ends import DescriptorFarEnd, FarEnd
from tests.conformance.transport import TransportConformance, Witness, descriptors

from compax_aio.errors import ConnectionLostError, TransportError
from compax_aio.transports import ProtocolFactory, TransportURL, open_transport, serial_line
from compax_aio.transports import serial as serial_opener
from compax_aio.transports.line_settings import LineSettings
from compax_aio.transports.serial import PortInfo, list_ports
from compax_aio.transports.serial_backends import connect_on_pyserial, connect_on_serialx
from compax_aio.transports.serial_line import SerialLine

# Between the two ends of a pty works a thread of the kernel, which the virtual clock cannot see.
pytestmark = pytest.mark.real_time

XON, XOFF = b"\x11", b"\x13"
BACKENDS = ["pyserial", "serialx"]


@asynccontextmanager
async def pty(options: str = "", *, backend: str = "pyserial") -> AsyncIterator[tuple[str, DescriptorFarEnd]]:
    master, slave = os.openpty()
    far = DescriptorFarEnd(master)
    try:
        yield f"serial://{os.ttyname(slave)}?backend={backend}{options}", far
    finally:
        far.close()
        os.close(slave)


class TestSerialOnPty(TransportConformance):
    bulk_bytes = 64 * 1024
    backend = "pyserial"

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with pty(backend=self.backend) as line:
            yield line


class TestSerialOnPtyBySerialx(TestSerialOnPty):
    backend = "serialx"


class TestSerialHeldByXoff(TransportConformance):
    """Of the whole suite those tests that do not send Xon and Xoff as data, on a line that takes them as handshake."""

    bulk_bytes = 64 * 1024
    backend = "pyserial"
    test_all_256_values_go_both_ways_unchanged = None  # type: ignore[assignment]

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with pty("&xonxoff=1", backend=self.backend) as line:
            yield line

    async def test_a_line_held_by_xoff_is_lost_within_a_second_of_abort_while_another_answers(self) -> None:
        async with self.opened() as (transport, witness, far), self.opened() as other:
            await far.write(XOFF)
            await asyncio.sleep(0.02)
            transport.write(b"held")
            await asyncio.sleep(0.02)
            assert transport.get_write_buffer_size() == 4
            await self.abort_is_bounded(transport, witness, other)

    async def test_a_line_held_by_xoff_is_lost_within_a_second_of_close(self) -> None:
        async with self.opened() as (transport, witness, far):
            await far.write(XOFF)
            await asyncio.sleep(0.02)
            transport.write(b"held")
            transport.close()
            async with asyncio.timeout(1):
                await witness.is_lost()
            assert witness.losses == [None]

    async def test_what_xoff_held_back_is_sent_after_xon_also_while_closing(self) -> None:
        async with self.opened() as (transport, witness, far):
            await far.write(XOFF)
            await asyncio.sleep(0.02)
            transport.write(b"held")
            transport.close()
            await asyncio.sleep(0.02)
            assert not witness.losses
            await far.write(XON)
            assert await far.read(4) == b"held"
            await witness.is_lost()

    async def test_nothing_but_xon_ends_xoff(self) -> None:
        async with self.opened() as (transport, _, far):
            await far.write(XOFF)
            await asyncio.sleep(0.02)
            transport.write(b"held")
            await far.write(b"any other byte")
            await asyncio.sleep(0.02)
            assert transport.get_write_buffer_size() == 4


class TestSerialHeldByXoffBySerialx(TestSerialHeldByXoff):
    backend = "serialx"


@asynccontextmanager
async def opened(
    options: str = "", *, backend: str = "pyserial"
) -> AsyncIterator[tuple[SerialLine, Witness, DescriptorFarEnd]]:
    async with asyncio.timeout(10), pty(options, backend=backend) as (url, far):
        witness = Witness()
        transport = await open_transport(url, lambda: witness)
        assert isinstance(transport, SerialLine)
        try:
            yield transport, witness, far
        finally:
            transport.abort()
            await witness.is_lost()


# --- what is wrong with pyserial-asyncio's own transport


@pytest.mark.parametrize("backend", BACKENDS)
async def test_nothing_that_may_block_is_called_on_the_event_loop(
    monkeypatch: pytest.MonkeyPatch, backend: str
) -> None:
    on_the_loop: list[str] = []

    def watch(owner: Any, name: str) -> None:
        original = getattr(owner, name)

        def watched(*arguments: Any, **options: Any) -> Any:
            # A port of an earlier test that is collected as garbage is closed once more, which does nothing.
            is_garbage = name == "close" and not arguments[0].is_open
            if threading.current_thread() is threading.main_thread() and not is_garbage:
                on_the_loop.append(name)
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, watched)

    for owner, names in (
        (termios, ("tcdrain", "tcflush", "tcsetattr", "tcgetattr")),
        (serial.Serial, ("open", "close", "flush", "read", "write", "_reconfigure_port")),
        (serialx.Serial, ("open", "close", "flush", "read", "write", "_reconfigure_port")),
    ):
        for name in names:
            watch(owner, name)
    async with opened(backend=backend) as (transport, witness, far):
        transport.write(b"anything")
        await far.write(b"anything")
        assert await witness.receives(8)
        transport.close()
        await witness.is_lost()
    assert not on_the_loop


async def test_a_driver_that_does_not_release_the_port_delays_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()
    really_close = serial.Serial.close

    async with opened() as (transport, witness, _):

        def close(port: serial.Serial) -> None:
            if port is transport.serial:
                released.wait(10)
            really_close(port)

        monkeypatch.setattr(serial.Serial, "close", close)
        began = asyncio.get_running_loop().time()
        transport.abort()
        await witness.is_lost()
        assert 0.1 < asyncio.get_running_loop().time() - began < 1
        released.set()
        await asyncio.sleep(0.05)
        assert witness.losses == [None]


async def test_what_the_driver_has_not_sent_yet_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    unsent = [30]
    monkeypatch.setattr(serial_line, "unsent_bytes", lambda _: unsent[0])
    async with opened() as (transport, witness, _):
        transport.close()
        await asyncio.sleep(0.05)
        assert not witness.losses
        unsent[0] = 0
        async with asyncio.timeout(0.2):
            await witness.is_lost()


async def test_what_the_driver_never_sends_is_discarded_after_half_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    discarded: list[int] = []
    monkeypatch.setattr(serial_line, "unsent_bytes", lambda _: 30)
    monkeypatch.setattr(termios, "tcflush", lambda _, queue: discarded.append(queue))
    async with opened() as (transport, witness, _):
        discarded.clear()
        transport.close()
        async with asyncio.timeout(1):
            await witness.is_lost()
        assert discarded == [termios.TCOFLUSH]


async def test_a_line_that_closes_as_the_event_loop_ends_is_released_without_it() -> None:
    async with opened() as (transport, witness, _):
        await asyncio.get_running_loop().shutdown_default_executor()
        transport.abort()
        await witness.is_lost()
        assert not transport.serial.is_open


@pytest.mark.parametrize("backend", BACKENDS)
async def test_unplugging_is_told_as_a_lost_connection(backend: str) -> None:
    async with opened(backend=backend) as (_, witness, far):
        await far.hang_up()
        await witness.is_lost()
    assert isinstance(witness.losses[0], ConnectionLostError)
    assert "went away" in str(witness.losses[0])
    assert "unplugged?" in str(witness.losses[0])


@pytest.mark.parametrize("function", ["read", "write"])
async def test_a_port_that_fails_is_lost_with_the_cause(monkeypatch: pytest.MonkeyPatch, function: str) -> None:
    async with opened() as (transport, witness, far):
        fails(monkeypatch, function, transport, OSError(errno.EIO, "input/output error"))
        transport.write(b"anything")
        await far.write(b"anything")
        await witness.is_lost()
        monkeypatch.undo()
    [lost] = witness.losses
    assert isinstance(lost, ConnectionLostError)
    assert isinstance(lost.__cause__, OSError)
    assert "input/output error" in str(lost)


async def test_a_port_that_fails_while_bytes_are_unsent_is_lost_at_once() -> None:
    async with opened("&xonxoff=1") as (transport, witness, far):
        await far.write(XOFF)
        await asyncio.sleep(0.02)
        transport.write(b"held")
        await far.hang_up()
        async with asyncio.timeout(0.5):
            await witness.is_lost()
        assert isinstance(witness.losses[0], ConnectionLostError)


async def test_a_port_that_goes_away_while_it_is_closed_is_lost_at_once() -> None:
    async with opened("&xonxoff=1") as (transport, witness, far):
        await far.write(XOFF)
        await asyncio.sleep(0.02)
        transport.write(b"held")
        transport.close()
        await far.hang_up()
        async with asyncio.timeout(0.3):
            await witness.is_lost()


async def test_a_port_that_is_gone_when_it_is_closed_is_lost_once() -> None:
    async with opened() as (transport, witness, far):
        transport.pause_reading()
        await far.hang_up()
        transport.close()
        await witness.is_lost()
        assert len(witness.losses) == 1


@pytest.mark.parametrize("function", ["read", "write"])
async def test_a_port_that_is_not_ready_after_all_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    async with opened() as (transport, witness, far):
        fails(monkeypatch, function, transport, BlockingIOError(), times=3)
        transport.write(b"ping")
        assert await far.read(4) == b"ping"
        await far.write(b"pong")
        assert await witness.receives(4) == b"pong"


async def test_a_write_that_fails_later_loses_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    async with opened() as (transport, witness, _):
        fails(monkeypatch, "write", transport, BlockingIOError(), times=1)
        transport.write(b"later")
        fails(monkeypatch, "write", transport, OSError(errno.EIO, "gone"))
        await witness.is_lost()
        assert isinstance(witness.losses[0], ConnectionLostError)


async def test_bytes_are_written_before_write_returns() -> None:
    async with opened() as (transport, _, _):
        transport.write(b"now")
        assert transport.get_write_buffer_size() == 0


async def open_elsewhere(url: str, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """Open *url* as where there is no POSIX."""
    return await serial_opener._open_elsewhere(serial_opener._Request.of(TransportURL.parse(url)), protocol_factory)


async def test_a_protocol_that_fails_to_connect_leaves_the_port_free() -> None:
    class Failing(Witness):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            raise ZeroDivisionError

    def fail() -> asyncio.Protocol:
        raise ZeroDivisionError

    failing = Failing()
    async with pty() as (url, _):
        with pytest.raises(ZeroDivisionError):
            await open_transport(url, lambda: failing)
        await failing.is_lost()
        with pytest.raises(ZeroDivisionError):
            await open_transport(url, fail)
        await opens(url)


async def test_the_port_and_the_state_can_be_asked_for() -> None:
    async with opened() as (transport, witness, _):
        assert isinstance(transport.get_extra_info("serial"), serial.Serial)
        assert repr(transport) == f"<SerialLine {transport.serial.port} open>"
        transport.set_write_buffer_limits(high=400)
        assert transport.get_write_buffer_limits() == (100, 400)
        assert not transport.can_write_eof()
        transport.close()
        assert "closing" in repr(transport)
        await witness.is_lost()
        assert "closed" in repr(transport)


async def test_where_there_is_no_posix_the_base_is_connected_when_the_opener_returns() -> None:
    async with pty() as (url, far):
        witness = Witness()
        port = serial.Serial(TransportURL.parse(url).path, timeout=0)
        transport = await connect_on_pyserial(port, lambda: witness)
        assert type(transport) is serial_asyncio.SerialTransport
        assert witness.transport is transport
        await far.write(b"hello")
        assert await witness.receives(5) == b"hello"
        transport.close()
        await witness.is_lost()


async def test_where_there_is_no_posix_serialx_is_connected_when_the_opener_returns() -> None:
    async with pty() as (url, far):
        witness = Witness()
        path = TransportURL.parse(url).path
        transport = await connect_on_serialx(path, LineSettings(baudrate=4800), lambda: witness, dsrdtr=False)
        assert witness.transport is transport
        assert transport.get_extra_info("serial").baudrate == 4800
        await far.write(b"hello")
        assert await witness.receives(5) == b"hello"
        transport.close()
        await witness.is_lost()


@pytest.mark.parametrize("backend", BACKENDS)
async def test_where_there_is_no_posix_the_same_url_opens_the_same_port(
    monkeypatch: pytest.MonkeyPatch, backend: str
) -> None:
    async with pty(backend=backend) as (url, far):
        witness = Witness()
        transport = await open_elsewhere(url, lambda: witness)
        assert not isinstance(transport, SerialLine)
        await far.write(b"hello")
        assert await witness.receives(5) == b"hello"
        with pytest.raises(TransportError, match="is in use"):
            await open_elsewhere(url, Witness)
        transport.close()
        await witness.is_lost()


async def test_where_there_is_no_posix_a_cancelled_opening_closes_the_port() -> None:
    async with pty() as (url, _):
        witness = Witness()
        port = serial.Serial(TransportURL.parse(url).path, timeout=0)
        opening = asyncio.create_task(connect_on_pyserial(port, lambda: witness))
        await asyncio.sleep(0)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        await witness.is_lost()
        assert not port.is_open


# --- opening


async def opens(url: str) -> serial.Serial:
    """Open *url*, close it, and return the port, whose settings can still be asked for."""
    witness = Witness()
    transport = await open_transport(url, lambda: witness)
    transport.abort()
    await witness.is_lost()
    port: serial.Serial = transport.get_extra_info("serial")
    return port


async def test_a_port_opens_with_9600_baud_8n1_without_handshake() -> None:
    async with pty() as (url, _):
        port = await opens(url)
    assert (port.baudrate, port.bytesize, port.parity, port.stopbits) == (9600, 8, "N", 1)
    assert (port.rtscts, port.xonxoff, port.dsrdtr) == (False, False, False)
    assert port.exclusive


async def test_a_pty_that_keeps_no_frame_is_opened_again_with_the_same_one() -> None:
    async with pty("&baudrate=4800&bytesize=7&parity=E&stopbits=2") as (url, _):
        await opens(url)
        port = await opens(url)  # nothing but what it does not keep would change, and libc calls that invalid
        assert (port.baudrate, port.stopbits) == (4800, 2)


async def test_every_option_reaches_the_port() -> None:
    async with pty("&baudrate=4800&bytesize=7&parity=E&stopbits=2&rtscts=1&xonxoff=1&dsrdtr=1") as (url, _):
        port = await opens(url)
    assert (port.baudrate, port.bytesize, port.parity, port.stopbits) == (4800, 7, "E", 2)
    assert port.rtscts
    assert port.xonxoff
    assert port.dsrdtr


@pytest.mark.parametrize("backend", BACKENDS)
async def test_both_backends_set_a_port_alike(backend: str) -> None:
    options = "&baudrate=4800&stopbits=2&rtscts=1&xonxoff=1"
    async with pty(options, backend=backend) as (url, far):
        witness = Witness()
        transport = await open_transport(url, lambda: witness)
        iflag, _, cflag, lflag, in_speed, out_speed, characters = termios.tcgetattr(transport.get_extra_info("serial"))
        transport.abort()
        await witness.is_lost()
        assert await opens_again(url, far)
    assert in_speed == out_speed == termios.B4800
    assert cflag & (termios.CSTOPB | termios.CRTSCTS) == termios.CSTOPB | termios.CRTSCTS
    assert iflag & (termios.IXON | termios.IXOFF | termios.IXANY) == termios.IXON | termios.IXOFF
    assert not lflag & (termios.ECHO | termios.ICANON)
    assert (characters[termios.VMIN], characters[termios.VTIME]) in {(1, 0), (b"\x01", b"\x00")}


async def opens_again(url: str, far: DescriptorFarEnd) -> bool:
    witness = Witness()
    transport = await open_transport(url, lambda: witness)
    await far.write(b"x")
    await witness.receives(1)
    transport.abort()
    await witness.is_lost()
    return True


# --- serialx


async def test_serialx_opens_the_port_where_it_is_installed() -> None:
    async with pty() as (url, _):
        assert isinstance(await opens(url.partition("?")[0]), serialx.Serial)
        assert isinstance(await opens(url), serial.Serial)


async def test_pyserial_opens_the_port_where_serialx_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    serialx_is_not_installed(monkeypatch)
    async with pty() as (url, _):
        assert isinstance(await opens(url.partition("?")[0]), serial.Serial)


async def test_serialx_that_is_asked_for_and_not_installed_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    serialx_is_not_installed(monkeypatch)
    with pytest.raises(TransportError, match=r"backend=serialx cannot be used: .*pip install 'compax-aio\[serialx\]'"):
        await open_transport("serial:///dev/ttyUSB0?backend=serialx", Witness)


async def test_serialx_that_is_broken_says_so_instead_of_standing_aside(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "serialx.py").write_text("raise ImportError('no such symbol')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "serialx")
    with pytest.raises(TransportError, match=r"cannot be imported: ImportError: no such symbol; .*backend=pyserial"):
        await open_transport("serial:///dev/ttyUSB0", Witness)


async def test_a_backend_that_does_not_exist_says_which_do() -> None:
    with pytest.raises(TransportError, match="backend is one of pyserial, serialx"):
        await open_transport("serial:///dev/ttyUSB0?backend=other", Witness)


async def test_a_setting_that_serialx_refuses_says_so_and_leaves_the_port_free() -> None:
    async with pty(backend="serialx") as (url, _):
        before = descriptors()
        with pytest.raises(TransportError, match=r"refuses 9600 baud or the other settings: 1.5 stop bits"):
            await open_transport(f"{url}&stopbits=1.5", Witness)
        assert descriptors() == before
        await opens(url)


async def test_a_setting_that_the_system_refuses_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise termios.error(errno.EINVAL, "Invalid argument")

    async with pty(backend="serialx") as (url, _):
        before = descriptors()
        monkeypatch.setattr(termios, "tcgetattr", refuse)
        with pytest.raises(TransportError, match="refuses 9600 baud or the other settings"):
            await open_transport(url, Witness)
        assert descriptors() == before


def serialx_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serialx", None)


# --- names that stay


async def test_a_name_by_id_is_followed_anew_at_each_opening(tmp_path: Path) -> None:
    by_id = tmp_path / "usb-FTDI_A50285BI-if00-port0"
    async with pty() as (first, far_of_first), pty() as (second, far_of_second):
        for url, far in ((first, far_of_first), (second, far_of_second)):
            by_id.unlink(missing_ok=True)
            by_id.symlink_to(TransportURL.parse(url).path)
            assert await opens_again(f"serial://{by_id}", far)


async def test_an_adapter_is_found_by_its_serial_number_wherever_it_is_plugged_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with pty() as (first, far_of_first), pty() as (second, far_of_second):
        paths = [TransportURL.parse(url).path for url in (first, second)]
        for mine, other, far in ((paths[0], paths[1], far_of_first), (paths[1], paths[0], far_of_second)):
            plugged_in(monkeypatch, {mine: "A50285BI", other: "FT9XK2A1", "/dev/ttyS0": None})
            assert await opens_again("serial://?serial_number=A50285BI&baudrate=4800", far)


async def test_a_serial_number_that_no_port_has_lists_those_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch, {"/dev/ttyUSB0": "FT9XK2A1", "/dev/ttyS0": None})
    with pytest.raises(
        TransportError,
        match=r"no port has the serial number 'A50285BI'; ports of this computer: "
        r"/dev/ttyS0 \(no serial number\), /dev/ttyUSB0 \(FT9XK2A1\)",
    ):
        await open_transport("serial://?serial_number=A50285BI", Witness)
    plugged_in(monkeypatch, {})
    with pytest.raises(TransportError, match="no port has the serial number 'A'; this computer has no serial port"):
        await open_transport("serial://?serial_number=A", Witness)


async def test_a_serial_number_that_several_ports_have_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch, {"/dev/ttyUSB1": "FT4", "/dev/ttyUSB0": "FT4"})
    with pytest.raises(
        TransportError, match=r"2 ports have the serial number 'FT4': /dev/ttyUSB0, /dev/ttyUSB1; .*/dev/serial/by-id"
    ):
        await open_transport("serial://?serial_number=FT4", Witness)


async def test_ports_are_looked_for_in_a_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    threads: list[threading.Thread] = []

    def comports() -> list[Any]:
        threads.append(threading.current_thread())
        return []

    monkeypatch.setattr("serial.tools.list_ports.comports", comports)
    with pytest.raises(TransportError):
        await open_transport("serial://?serial_number=A50285BI", Witness)
    assert threads
    assert threading.main_thread() not in threads


def plugged_in(monkeypatch: pytest.MonkeyPatch, serial_numbers: dict[str, str | None]) -> None:
    ports = [
        SimpleNamespace(device=device, description=None, manufacturer=None, serial_number=number)
        for device, number in serial_numbers.items()
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)


@pytest.mark.parametrize(
    ("option", "allowed"),
    [
        ("baudrate=fast", "a whole number from 1 to"),
        ("baudrate=0", "a whole number from 1 to"),
        ("bytesize=9", "one of 5, 6, 7, 8"),
        ("parity=even", "one of N, E, O, M, S"),
        ("stopbits=3", "one of 1, 1.5, 2"),
        ("xonxoff=yes", "one of 1, 0"),
    ],
)
async def test_an_option_that_makes_no_sense_says_what_is_allowed(option: str, allowed: str) -> None:
    key, _, value = option.partition("=")
    with pytest.raises(TransportError, match=f"{key}='{value}' is not allowed; {key} is {allowed}"):
        await open_transport(f"serial:///dev/null?{option}", Witness)


@pytest.mark.parametrize("backend", BACKENDS)
async def test_a_missing_port_lists_those_that_exist(monkeypatch: pytest.MonkeyPatch, backend: str) -> None:
    computer_has(monkeypatch, "/dev/ttyUSB1", "/dev/ttyUSB0")
    with pytest.raises(
        TransportError, match="no serial port /dev/ttyUSB7; ports of this computer: /dev/ttyUSB0, /dev/ttyUSB1"
    ):
        await open_transport(f"serial:///dev/ttyUSB7?backend={backend}", Witness)


async def test_a_missing_port_says_so_when_there_is_none_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    computer_has(monkeypatch)
    with pytest.raises(TransportError, match="no serial port COM3; this computer has no serial port"):
        await open_transport("serial://COM3", Witness)


@pytest.mark.parametrize("second", BACKENDS)
@pytest.mark.parametrize("first", BACKENDS)
async def test_a_port_that_is_open_already_is_in_use(first: str, second: str) -> None:
    async with opened(backend=first) as (transport, _, _):
        with pytest.raises(TransportError, match=r"the serial port .* is in use; end the program"):
            await open_transport(f"serial://{transport.serial.port}?backend={second}", Witness)


async def test_a_port_that_was_closed_is_free_as_soon_as_the_connection_is_lost() -> None:
    async with pty() as (url, _):
        for _ in range(3):
            await opens(url)


@pytest.mark.parametrize("backend", BACKENDS)
async def test_a_file_is_no_serial_port(tmp_path: Path, backend: str) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file"):
        with pytest.raises(TransportError, match=f"{path} is not a serial port; give the path of a device"):
            await open_transport(f"serial://{path}?backend={backend}", Witness)


@pytest.mark.parametrize(
    ("group", "mode", "hint"),
    [
        ("dialout", 0o660, r"belongs to the group dialout: run `sudo usermod -aG dialout \$USER`, then log in again"),
        ("dialout", 0o600, "its group dialout gives no access: ask for a udev rule"),
        ("root", 0o660, "its group root gives no access: ask for a udev rule"),
        (None, 0o660, "ask who administers this computer"),
    ],
)
async def test_a_port_without_permission_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, group: str | None, mode: int, hint: str
) -> None:
    def getgrgid(_: int) -> Any:
        if group is None:
            raise KeyError
        return SimpleNamespace(gr_name=group)

    refuses_to_open(monkeypatch, serial.SerialException(errno.EACCES, "Permission denied"))
    monkeypatch.setattr("grp.getgrgid", getgrgid)
    monkeypatch.setattr(Path, "stat", lambda *_, **__: SimpleNamespace(st_gid=1, st_mode=stat.S_IFCHR | mode))
    with pytest.raises(TransportError, match=f"no permission to open the serial port /dev/ttyUSB0; .*{hint}"):
        await open_transport("serial:///dev/ttyUSB0?backend=pyserial", Witness)


@pytest.mark.parametrize(
    "error",
    [
        termios.error(22, "Invalid argument"),
        OSError(errno.EINVAL, "Invalid argument"),
        ValueError("Failed to set custom baud rate (12345)"),
        OverflowError(),
    ],
)
async def test_a_baud_rate_that_the_driver_refuses_says_so(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    refuses_to_open(monkeypatch, error)
    with pytest.raises(TransportError, match=r"/dev/ttyUSB0 refuses 12345 baud or the other settings.*standard baud"):
        await open_transport("serial:///dev/ttyUSB0?baudrate=12345&backend=pyserial", Witness)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (serial.SerialException("could not open port 'COM3': FileNotFoundError(2, …)"), "there is no serial port"),
        (serial.SerialException("could not open port 'COM3': PermissionError(13, …)"), "is in use"),
        (serial.SerialException("strange trouble"), "could not be opened: strange trouble"),
    ],
)
async def test_an_error_without_a_number_is_understood_by_its_text(
    monkeypatch: pytest.MonkeyPatch, error: Exception, message: str
) -> None:
    refuses_to_open(monkeypatch, error)
    with pytest.raises(TransportError, match=message):
        await open_transport("serial://COM3?backend=pyserial", Witness)


@pytest.mark.parametrize(
    ("url", "what"),
    [
        ("serial://", "names no serial port"),
        ("serial://?serial_number=", "names no serial port"),
        ("serial://dev/ttyUSB0", "names two ports"),
        ("serial:///dev/ttyUSB0?serial_number=A", "names two ports"),
    ],
)
async def test_a_path_takes_three_slashes(url: str, what: str) -> None:
    with pytest.raises(TransportError, match=f"{what}; .*with three slashes before a path"):
        await open_transport(url, Witness)


@pytest.mark.parametrize("opens_at_last", [True, False])
async def test_a_port_that_opens_after_we_were_cancelled_is_closed(
    monkeypatch: pytest.MonkeyPatch, opens_at_last: bool
) -> None:
    go_on = threading.Event()
    ports: list[serial.Serial] = []

    class Slow(serial.Serial):
        def open(self) -> None:
            go_on.wait(10)
            if not opens_at_last:
                raise serial.SerialException("strange trouble")
            super().open()
            ports.append(self)

    async with pty() as (url, _):
        before = descriptors()
        monkeypatch.setattr(serial, "Serial", Slow)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.02):
                await open_transport(url, Witness)
        go_on.set()
        # A port says that it is closed a moment after its descriptor is gone, and it is closed in a thread.
        await becomes_true(
            lambda: descriptors() == before and len(ports) == opens_at_last and not any(port.is_open for port in ports)
        )


async def test_a_port_that_opened_just_before_we_were_cancelled_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    has_opened = threading.Event()
    ports: list[serial.Serial] = []

    class Telling(serial.Serial):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            ports.append(self)
            has_opened.set()

    async with pty() as (url, _):
        monkeypatch.setattr(serial, "Serial", Telling)
        opening = asyncio.create_task(open_transport(url, Witness))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        # Hold the loop until the port is open, so that the news of it and of the cancellation arrive together.
        assert has_opened.wait(10)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        await becomes_true(lambda: not ports[0].is_open)


async def becomes_true(condition: Callable[[], bool]) -> None:
    """Return when *condition*, which a thread brings about, is true."""
    async with asyncio.timeout(5):
        while not condition():  # noqa: ASYNC110  # a thread has no event to set
            await asyncio.sleep(0.005)


async def test_ports_are_listed_by_name_with_their_urls(monkeypatch: pytest.MonkeyPatch) -> None:
    computer_has(monkeypatch, "COM3", "/dev/tty USB")
    ports = await list_ports()
    assert [port.url for port in ports] == ["serial:///dev/tty%20USB", "serial://COM3"]
    assert ports[1] == PortInfo(device="COM3", description="n/a", manufacturer="FTDI", serial_number="A1")


async def test_listing_ports_asks_this_computer() -> None:
    assert all(port.device for port in await list_ports())


def computer_has(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    ports = [SimpleNamespace(device=name, description=None, manufacturer="FTDI", serial_number="A1") for name in names]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)


def refuses_to_open(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(serial, "Serial", refuse)


def fails(
    monkeypatch: pytest.MonkeyPatch, function: str, transport: SerialLine, error: OSError, *, times: int = 1000
) -> None:
    """Let os.read or os.write fail *times* times, on the descriptor of *transport* alone."""
    really = getattr(os, function)
    descriptor = transport.serial.fileno()
    left = [times]

    def fail(fd: int, *arguments: Any) -> Any:
        if fd == descriptor and left[0]:
            left[0] -= 1
            raise error
        return really(fd, *arguments)

    monkeypatch.setattr(os, function, fail)
