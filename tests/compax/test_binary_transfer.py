"""Binary transfer on a whole drive: only where asked for and allowed, and a frame that is cut moves nothing unseen."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from tests.promises.bench import bench, ending, is_moving, lines, motions, now, scripted, served_through

import compax_aio
from compax_aio import Dialect, Drive, DriveSettings, MoveError, MoveInDoubtError
from compax_aio.errors import AnswerTimeoutError
from compax_aio.simulator.compax import Knobs, SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

SETTINGS = DriveSettings(binary_settings=True)
MOTION = DriveSettings(binary_settings=True, binary_motion=True)


def frames(far: SimulatedDrive) -> list[str]:
    """List the frames that the far end has received, by their meaning."""
    return [line.partition("(")[2].rstrip(")") for line in lines(far) if line[:1] == "8"]


async def test_speed_and_ramps_go_as_frames_and_everything_else_as_text() -> None:
    async with bench(settings=SETTINGS, p20=16) as (drive, far):
        result = await drive.move_to(
            100, speed_percent=50.5, acceleration_ms=300, deceleration_ms=250, steps=[(50, 20)]
        )
        assert frames(far) == ["SPEED 50.500", "ACCEL 300", "ACCEL- 250"]
        assert "PA100$" in lines(far)
        assert "PR50 SD20" in lines(far)
        assert result.confirmed_by == "message"
        assert far.position == 100


async def test_a_motion_goes_as_a_frame_only_by_the_second_opt_in() -> None:
    async with bench(settings=MOTION, p20=16) as (drive, far):
        result = await drive.move_to(360)
        assert lines(far)[-1][:1] in "S8"
        assert frames(far) == ["POSA 360.00"]
        assert result.confirmed_by == "status"  # a frame takes no sign
        await drive.move_by(-10)
        assert frames(far)[-1] == "POSR -10.00"
        assert far.position == 350
        await drive.home()
        assert "PH" in lines(far)


@pytest.mark.parametrize("p20", [0, 1])
async def test_where_p20_does_not_allow_it_everything_goes_as_text(p20: int, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        async with bench(settings=MOTION, p20=p20) as (drive, far):
            await drive.move_to(100, speed_percent=50)
            assert frames(far) == []
            assert drive.interface is not None
            assert not drive.interface.binary
    assert "takes no binary transfer" in caplog.text


async def test_where_nobody_asks_for_it_everything_goes_as_text_and_its_danger_is_said(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        async with bench(p20=16) as (drive, far):
            await drive.move_to(100, speed_percent=50)
            assert frames(far) == []
    assert "stray byte" in caplog.text


@asynccontextmanager
async def on_a_bad_line(
    spoil: Callable[[bytes], bytes], settings: DriveSettings
) -> AsyncIterator[tuple[Drive, SimulatedDrive]]:
    far = SimulatedDrive(Knobs(p20=16))
    async with (
        served_through(far, "bad", spoil) as url,
        compax_aio.connect(url, name="x", settings=settings) as drive,
    ):
        yield drive, far


def cut_once(first_bytes: bytes, left: int) -> Callable[[bytes], bytes]:
    """Lose the end of the first write that begins so."""
    done = False

    def spoil(data: bytes) -> bytes:
        nonlocal done
        if done or not data.startswith(first_bytes):
            return data
        done = True
        return data[:left]

    return spoil


async def test_a_speed_whose_frame_was_cut_is_said_again_as_text_before_anything_moves() -> None:
    async with on_a_bad_line(cut_once(b"\x88S", 5), SETTINGS) as (drive, far):
        await drive.move_to(100, speed_percent=50)
        told = lines(far)
        assert told.index("SD50") < told.index("PA100$")
        assert motions(far) == ["POSA 100.00"]
        await drive.move_to(0, speed_percent=30)
        assert "SD30" in lines(far)  # no more frames on a line that loses bytes


async def test_a_setting_in_doubt_is_said_again_even_if_its_own_move_was_given_up() -> None:
    async with on_a_bad_line(cut_once(b"\x88S", 5), SETTINGS) as (drive, far):
        with pytest.raises(AnswerTimeoutError):
            await drive.command("SD50")
        assert "SD50" not in lines(far)
        await drive.move_to(100)
        assert lines(far).index("SD50") < lines(far).index("PA100$")


async def test_a_motion_whose_frame_was_cut_moves_nothing_and_nothing_is_sent_that_could_complete_it() -> None:
    async with on_a_bad_line(cut_once(b"\x88A", 4), MOTION) as (drive, far):
        move = drive.move_to(360)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert "cut" in error.what
        before = drive.stats.bytes_sent
        for attempt in (drive.position(), drive.status(), drive.command("SD50")):
            assert isinstance(await ending(attempt), AnswerTimeoutError)
        with pytest.raises(MoveInDoubtError):
            drive.move_to(0)
        await asyncio.sleep(100)
        assert drive.stats.bytes_sent == before
        assert motions(far) == []
        far.power_cycle()  # what the manual says brings the interface back (UG p. 167)
        await drive.reconcile()
        with pytest.raises(MoveError, match="give the move its speed_percent"):
            drive.move_to(10)
        await drive.move_to(10, speed_percent=50)
        assert motions(far) == ["POSA 10.00"]
        assert lines(far).count("PA10$") == 1  # no more frames on a line that loses bytes


async def test_leaving_the_block_sends_nothing_that_could_complete_a_motion_and_says_so() -> None:
    far = SimulatedDrive(Knobs(p20=16))
    async with served_through(far, "bad", cut_once(b"\x88A", 4)) as url:
        drive = await compax_aio.connect(url, name="x", settings=MOTION)
        assert isinstance(await ending(drive.move_to(360)), MoveInDoubtError)
        before = drive.stats.bytes_sent
        with pytest.raises(MoveInDoubtError, match="closed without a stop"):
            await drive.close()
    assert drive.stats.bytes_sent == before
    await asyncio.sleep(10)
    assert motions(far) == []
    assert not drive.is_open


async def test_a_stop_that_is_asked_for_is_sent_and_the_axis_ends_up_standing() -> None:
    async with on_a_bad_line(cut_once(b"\x88A", 4), MOTION) as (drive, far):
        assert isinstance(await ending(drive.move_to(360)), MoveInDoubtError)
        await drive.stop()
        assert not far.moving
        assert lines(far).count("STOP") >= 1
        await drive.reconcile()
        stood_at = far.position
        await asyncio.sleep(10)
        assert far.position == stood_at


async def test_a_motion_frame_whose_answer_was_late_is_no_doubt() -> None:
    async with bench(settings=MOTION, p20=16) as (drive, far):
        far.extra_answer_delay_s = 1.2
        move = drive.move_to(100)
        await asyncio.sleep(0.1)
        far.extra_answer_delay_s = 1.2
        await move.accepted
        far.extra_answer_delay_s = 0
        await move
        assert motions(far) == ["POSA 100.00"]


async def test_a_motion_frame_whose_answer_was_lost_is_in_doubt_until_somebody_has_looked() -> None:
    async with bench(settings=MOTION, p20=16) as (drive, far):
        far.lose_answers = 1
        move = drive.move_to(1000)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert now() < 5
        assert is_moving(far)  # it had arrived whole
        await drive.stop()
        assert not is_moving(far)
        status = await drive.reconcile()
        assert status.idle_after_stop
        await drive.move_to(0, speed_percent=100)
        await drive.move_to(10)


# P20 at connect -------------------------------------------------------------------------------------------------------


async def test_a_drive_that_keeps_quiet_about_errors_is_told_and_believed_by_its_status_only(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        async with bench(p20=2, travel_max=50) as (drive, far):
            assert drive.interface is not None
            assert drive.interface.errors_suppressed
            assert (await drive.move_to(20)).confirmed_by == "status"
            error = await ending(drive.move_to(60))  # refused, and nobody says so
            assert "ended at 20.00" in error.what
            assert motions(far) == ["POSA 20.00"]
    assert "keeps quiet about errors" in caplog.text


@pytest.mark.parametrize("answer", ["E90", "", None, "P020: what"])
async def test_a_drive_that_does_not_give_p20_is_used_all_the_same(
    answer: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        async with scripted({"P20": answer}) as (drive, _):
            assert drive.interface is None
            assert await drive.position() == 0
    assert "does not give P20" in caplog.text


async def test_which_weight_of_p20_keeps_errors_quiet_is_a_setting() -> None:
    settings = DriveSettings(errors_suppressed_weight=4, xonxoff_weight=8)
    async with scripted({"P20": "P020: 4"}, settings=settings) as (drive, _):
        assert drive.interface is not None
        assert drive.interface.errors_suppressed
        assert drive.interface.unknown == 0
        assert drive.settings.verify_messages
    async with scripted({"P20": "P020: 3"}, settings=settings) as (drive, _):
        assert drive.interface is not None
        assert not drive.interface.errors_suppressed
        assert not drive.interface.xonxoff
        assert drive.interface.unknown == 3


async def test_how_a_parameter_is_written_is_a_word_of_the_dialect() -> None:
    settings = DriveSettings(dialect=Dialect(write_value="{name} {value}"))
    async with scripted({"P40": "P040: 1.500"}, settings=settings) as (drive, far):
        await drive.parameters.write(40, 1.5)
        assert "P40 1.500" in far.lines
