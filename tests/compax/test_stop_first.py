"""STOP on a line that is not open yet: it is the first that goes over it, and it is not called done before it is."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

import compax_aio
from compax_aio.compax.settings import Dialect
from compax_aio.compax.stop_first import stop_first
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_loopback
from compax_aio.transports.loopback import listen


@asynccontextmanager
async def moving_drive(knobs: Knobs | None = None) -> AsyncIterator[tuple[SimulatedDrive, str]]:
    """A drive that somebody has set in motion and left alone."""
    drive = SimulatedDrive(knobs or Knobs())
    async with serve_loopback(drive, "moving") as url:
        async with compax_aio.connect(url) as other:
            move = other.move_to(1000, on_cancel="detach")
            await move.accepted
        with pytest.raises(compax_aio.ConnectionLostError):
            await move
        await asyncio.sleep(1)
        assert drive.moving
        yield drive, url


async def test_a_drive_that_moves_is_stopped_and_its_standstill_is_told() -> None:
    async with moving_drive() as (drive, url):
        stopped = await stop_first(url, name="x")
        assert not drive.moving
        assert stopped.drive == "x"
        assert stopped.position == pytest.approx(drive.position, abs=0.01)
        assert stopped.status.idle_after_stop
        assert not stopped.status.command_active


async def test_stop_is_complete_at_the_drive_after_its_five_bytes() -> None:
    async with moving_drive(Knobs(baudrate=9600)) as (drive, url):
        before, began_at = len(drive.log), asyncio.get_running_loop().time()
        await stop_first(url)
        connected, first, *_ = list(drive.log)[before:]
        assert (connected.kind, first.kind, first.text) == (LogKind.CONNECTED, LogKind.LINE, "STOP")
        assert first.at - began_at == pytest.approx(5 * 10 / 9600, abs=1e-3)


async def test_half_a_line_in_the_buffer_of_the_drive_spoils_the_first_stop_and_not_the_second() -> None:
    async with moving_drive() as (drive, url):
        drive.receive(b"PA2", asyncio.get_running_loop().time())
        await stop_first(url)
        lines = drive.log.texts(LogKind.LINE)
        assert "STOP" in lines[lines.index("PA2STOP") :]
        assert not drive.moving


async def test_a_drive_that_stands_may_be_stopped_as_well() -> None:
    stopped = await stop_first("sim://compax?position=12.5")
    assert stopped.position == 12.5


@pytest.mark.parametrize("settings", [None, compax_aio.DriveSettings(reconnect=False)])
async def test_a_line_that_cannot_be_opened_is_told_with_what_that_means(
    settings: compax_aio.DriveSettings | None,
) -> None:
    with pytest.raises(compax_aio.TransportError) as failure:
        await stop_first("loop://nobody", settings=settings)
    assert str(failure.value).startswith("loop://nobody: STOP was not sent: ")
    assert "emergency stop" in str(failure.value)


async def test_a_silent_drive_is_told_stop_again_and_again_and_then_it_is_said_that_it_may_move() -> None:
    async with moving_drive() as (drive, url):
        drive.silent = True
        with pytest.raises(compax_aio.AnswerTimeoutError) as failure:
            await stop_first(url)
        assert "STOP was sent, and not acknowledged" in failure.value.what
        assert "the axis may be moving" in str(failure.value.hint)
        assert drive.log.texts(LogKind.LINE).count("STOP") >= 2
        assert asyncio.all_tasks() == {asyncio.current_task()}


async def test_another_word_for_stop_is_taken_from_the_dialect() -> None:
    settings = compax_aio.DriveSettings(dialect=Dialect(stop="HALT"))
    with pytest.raises(compax_aio.CommandRejectedError, match="not acknowledged"):
        await _stop_of_moving(settings)


async def _stop_of_moving(settings: compax_aio.DriveSettings) -> None:
    async with moving_drive(Knobs(nominal_speed=10)) as (_, url):
        await stop_first(url, settings=settings)


async def test_one_that_is_cancelled_while_the_axis_brakes_ends_at_its_standstill() -> None:
    async with moving_drive(Knobs(stop_ramp_ms=2000)) as (drive, url):
        stopping = asyncio.create_task(stop_first(url))
        await asyncio.sleep(0.5)
        stopping.cancel()
        with pytest.raises(asyncio.CancelledError):
            await stopping
        assert not drive.moving


async def test_a_line_that_is_lost_under_stop_is_told_as_one_on_which_it_was_sent() -> None:
    class HangsUp(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            self.transport = transport

        def data_received(self, data: bytes) -> None:
            self.transport.close()

    listener = await listen("hangs-up", HangsUp)
    with pytest.raises(compax_aio.ConnectionLostError) as failure:
        await stop_first("loop://hangs-up")
    listener.close()
    assert failure.value.what.startswith("STOP was sent, and not acknowledged: ")
    assert "the axis may be moving" in str(failure.value.hint)
