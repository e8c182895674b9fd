"""A pty of a simulated drive: its baud rate, its link, and its end."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path

import pytest

import compax_aio
from compax_aio import DriveSettings
from compax_aio.errors import AnswerTimeoutError, TransportError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.line import DeviceLine
from compax_aio.simulator.pseudo_terminal import PseudoTerminal
from compax_aio.simulator.rates import heard, set_rate
from compax_aio.simulator.server import serve_pty
from compax_aio.simulator.smc import Knobs as SmcKnobs
from compax_aio.simulator.smc import SimulatedPartyLine
from compax_aio.transports.registry import open_transport

QUICK = DriveSettings(answer_timeout_s=0.3)


async def exchanged(
    url: str, sent: bytes, *, baudrate: int, answer_bytes: int, once_open: Callable[[], None] = lambda: None
) -> bytes:
    """Send bytes to a port at a rate, and return what comes back at that rate."""
    received = bytearray()
    enough = asyncio.Event()

    class Terminal(asyncio.Protocol):
        def data_received(self, data: bytes) -> None:
            received.extend(data)
            if len(received) >= answer_bytes:
                enough.set()

    port = f"{url.partition('?')[0]}?baudrate={baudrate}"
    transport = await open_transport(port, Terminal)
    once_open()
    transport.write(sent)
    async with asyncio.timeout(30):
        await enough.wait()
    transport.abort()
    return bytes(received)


@pytest.mark.real_time
@pytest.mark.parametrize(("drive_at", "host_at"), [(9600, 4800), (9600, 19200), (4800, 9600)])
async def test_at_the_wrong_rate_a_drive_hears_and_says_garbage(drive_at: int, host_at: int) -> None:
    drive = SimulatedDrive(Knobs(baudrate=drive_at))  # type: ignore[arg-type]
    says = heard(b"12345\r\n", drive_at, host_at)
    async with serve_pty(drive) as url:
        assert says == await exchanged(
            url, b"S1\r", baudrate=host_at, answer_bytes=len(says), once_open=lambda: drive.inject(b"12345\r\n")
        )
    assert "S1" not in drive.log.texts(LogKind.LINE)


@pytest.mark.real_time
async def test_a_client_at_the_wrong_rate_gets_no_answer_and_one_at_the_right_rate_does() -> None:
    async with serve_pty(SimulatedDrive(Knobs(baudrate=4800, position=7))) as url:
        assert url.endswith("?baudrate=4800")
        with pytest.raises(AnswerTimeoutError):
            async with compax_aio.connect(url.replace("4800", "9600"), settings=QUICK) as drive:
                await drive.position()
        async with compax_aio.connect(url) as drive:
            assert await drive.position() == 7


async def test_a_program_that_sets_no_rate_talks_at_the_drives() -> None:
    async with serve_pty(SimulatedDrive(Knobs(baudrate=4800))) as url:
        port = os.open(url.removeprefix("serial://").partition("?")[0], os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(port, b"S1\r")
            await asyncio.sleep(1)
            assert os.read(port, 100) == b"S001: 0.00\r\n>"
        finally:
            os.close(port)


@pytest.mark.real_time
@pytest.mark.parametrize("baudrate", [1200, 38400])
async def test_a_drive_without_a_rate_takes_any(baudrate: int) -> None:
    async with serve_pty(SimulatedDrive()) as url:
        assert await exchanged(url, b"S1\r", baudrate=baudrate, answer_bytes=13) == b"S001: 0.00\r\n>"


@pytest.mark.real_time
async def test_steppers_have_a_rate_too() -> None:
    line = SimulatedPartyLine(SmcKnobs(mode="single", baudrate=9600))
    async with serve_pty(line) as url:
        assert await exchanged(url, b" ", baudrate=9600, answer_bytes=20)
        line.power_cycle()
        await asyncio.sleep(0.3)
        says = heard(b"12345", 9600, 4800)
        assert says == await exchanged(
            url, b"", baudrate=4800, answer_bytes=len(says), once_open=lambda: line.inject(b"12345")
        )


async def test_a_flood_at_the_wrong_rate_is_kept_within_bounds() -> None:
    drive = SimulatedDrive(Knobs(baudrate=9600))
    terminal = PseudoTerminal(DeviceLine.of(drive))
    port = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)
    try:
        set_rate(port, 4800)
        for _ in range(20):
            drive.inject(b"x" * 4096)
        assert len(terminal._garbled) < 2 * 4096
        assert os.read(port, 10) == heard(b"x" * 4096, 9600, 4800)[:10]
    finally:
        os.close(port)
        terminal.close()


# The link


def names_in(folder: Path) -> list[str]:
    return [each.name for each in folder.iterdir()]


async def test_a_link_leads_to_the_port_and_is_taken_away(tmp_path: Path) -> None:
    link = tmp_path / "x"
    async with serve_pty(SimulatedDrive(), link=link) as url:
        assert url == f"serial://{link}"
        assert link.readlink().is_char_device()
    assert not link.is_symlink()


async def test_a_link_to_a_port_that_is_gone_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "x"
    link.symlink_to("/dev/pts/987654")
    async with serve_pty(SimulatedDrive(), link=link):
        assert link.is_char_device()


async def test_a_link_of_one_that_was_killed_is_replaced_although_its_port_has_become_ours(tmp_path: Path) -> None:
    link = tmp_path / "x"
    async with serve_pty(SimulatedDrive()) as url:
        link.symlink_to(url.removeprefix("serial://"))
    async with serve_pty(SimulatedDrive(), link=link) as url:  # the system gives the lowest number that is free
        assert link.is_char_device()
    assert not link.is_symlink()
    assert names_in(tmp_path) == []


async def test_a_link_that_somebody_else_makes_at_the_same_time_is_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = tmp_path / "x"
    link.symlink_to("/dev/pts/987654")
    rename = Path.rename

    def rename_late(self: Path, target: Path) -> Path:
        link.unlink()
        link.symlink_to("/dev/tty")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", rename_late)
    with pytest.raises(TransportError, match="is there already"):
        async with serve_pty(SimulatedDrive(), link=link):
            pass
    assert str(link.readlink()) == "/dev/tty"
    assert names_in(tmp_path) == ["x"]


@pytest.mark.parametrize("kind", ["file", "link to a file", "link to a port", "link to nothing"])
async def test_what_is_not_ours_is_never_replaced(tmp_path: Path, kind: str) -> None:
    link = tmp_path / "x"
    if kind == "file":
        link.write_text("mine")
    else:
        targets = {"link to a file": __file__, "link to a port": "/dev/tty", "link to nothing": "/nowhere/at/all"}
        link.symlink_to(targets[kind])
    drive = SimulatedDrive()
    before = os.lstat(link)
    with pytest.raises(TransportError, match="is there already"):
        async with serve_pty(drive, link=link):
            pass
    assert os.lstat(link).st_ino == before.st_ino
    async with serve_pty(drive):  # the line is free again
        pass


async def test_a_link_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    with pytest.raises(TransportError, match=r"no link to .* can be made"):
        async with serve_pty(SimulatedDrive(), link=tmp_path / "nowhere" / "x"):
            pass


async def test_a_link_that_somebody_else_has_made_meanwhile_stays(tmp_path: Path) -> None:
    link = tmp_path / "x"
    async with serve_pty(SimulatedDrive(), link=link):
        link.unlink()
        link.write_text("theirs")
    assert link.read_text() == "theirs"


# The handshake


async def test_what_a_held_drive_is_sent_waits_for_it() -> None:
    drive = SimulatedDrive()
    line = DeviceLine.of(drive)
    line.hold(held=True)
    async with serve_pty(drive) as url:
        port = os.open(url.removeprefix("serial://"), os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(port, b"S1\r")
            await asyncio.sleep(1)
            assert drive.log.texts(LogKind.LINE) == []
            line.hold(held=False)
            await asyncio.sleep(1)
            assert drive.log.texts(LogKind.LINE) == ["S1"]
        finally:
            os.close(port)
