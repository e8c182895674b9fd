"""What the axis is and whether it has power: unit, travel, outputs, power stage, real zero, speed on the way."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from tests.promises.bench import bench, ending, lines, motions, scripted

from compax_aio import (
    CommandRejectedError,
    Dialect,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveError,
    UnexpectedAnswerError,
)
from compax_aio.compax.settings import AxisUnit

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def test_the_travel_is_read_on_request_and_enforced_before_a_byte_is_sent() -> None:
    async with bench(travel_min=-10, travel_max=200) as (drive, far):
        axis = await drive.read_axis()
        assert axis.travel == (-10.0, 200.0)
        assert drive.settings.travel == axis.travel
        before = len(lines(far))
        for target in (200.01, -10.01, 1e6):
            with pytest.raises(InvalidCommandError, match=r"outside the travel of the axis, -10\.00 to 200\.00"):
                drive.move_to(target)
        await asyncio.sleep(1)
        assert len(lines(far)) == before
        await drive.move_to(200)


async def test_a_relative_move_that_would_leave_the_travel_is_not_sent() -> None:
    async with bench(travel_max=100) as (drive, far):
        await drive.read_axis()
        await drive.move_to(60)
        error = await ending(drive.move_by(41))
        assert isinstance(error, InvalidCommandError)
        assert "101" in error.what
        assert motions(far) == ["POSA 60.00"]
        await drive.move_by(40)


async def test_without_reading_nothing_is_enforced_and_the_drive_decides() -> None:
    async with bench(travel_max=100) as (drive, _):
        assert drive.settings.travel is None
        assert isinstance(await ending(drive.move_to(101)), CommandRejectedError)


async def test_travel_can_be_given_by_the_settings() -> None:
    async with bench(settings=DriveSettings(travel=(0, 50))) as (drive, _):
        with pytest.raises(InvalidCommandError):
            drive.move_to(-1)
    for travel in ((50.0, 0.0), (0.0, float("nan")), (1.0, 1.0)):
        with pytest.raises(InvalidCommandError, match="lowest and a highest"):
            DriveSettings(travel=travel)


async def test_the_unit_is_looked_up_in_the_settings_and_changes_the_decimals() -> None:
    units = {1: AxisUnit("mm"), 2: AxisUnit("inch", 3)}
    async with bench(settings=DriveSettings(units=units), unit="inch", decimals=3) as (drive, far):
        assert drive.unit == "units"
        axis = await drive.read_axis()
        assert (axis.unit_code, axis.unit, axis.decimals) == (2, "inch", 3)
        assert (drive.unit, drive.settings.decimals) == ("inch", 3)
        result = await drive.move_to(1.2345)
        assert result.target in {1.234, 1.235}
        assert far.position == result.target


async def test_a_unit_that_nobody_has_named_changes_nothing() -> None:
    async with bench(settings=DriveSettings(unit="steps")) as (drive, _):
        axis = await drive.read_axis()
        assert (axis.unit_code, axis.unit, axis.decimals) == (1, "steps", 2)


async def test_limits_that_are_the_same_limit_nothing() -> None:
    async with scripted({"P90": "P090: 1.000", "P11": "P011: 0.000", "P12": "P012: 0.000"}) as (drive, _):
        assert (await drive.read_axis()).travel is None


async def test_a_drive_that_does_not_give_its_limits_changes_nothing() -> None:
    async with scripted({"P90": "P090: 1", "P11": "E90"}) as (drive, _):
        with pytest.raises(CommandRejectedError):
            await drive.read_axis()
        assert drive.settings.travel is None


# Outputs and power ----------------------------------------------------------------------------------------------------


async def test_outputs_are_set_one_or_several_in_a_row() -> None:
    async with bench() as (drive, far):
        await drive.output(7, 1)
        assert far.outputs[7]
        await drive.output(7, False, True, 1)
        assert [far.outputs[number] for number in (7, 8, 9)] == [False, True, True]
        assert lines(far)[-2:] == ["OT O7=1", "OT O7=011"]


@pytest.mark.parametrize("call", [(0, 1), (17, 1), (16, 1, 1), (1,), (1, *[0] * 9), (1, 2), (True, 1), (1.0, 1)])
async def test_outputs_that_a_drive_does_not_have_are_refused(call: Any) -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        with pytest.raises(InvalidCommandError):
            await drive.output(*call)
        assert len(lines(far)) == before


async def test_power_is_switched_and_the_status_shows_it() -> None:
    async with bench() as (drive, far):
        status = await drive.power("off")
        assert (status.output_0_is_1, status.running) == (True, False)
        assert isinstance(await ending(drive.move_to(10)), CommandRejectedError)
        status = await drive.power("off_brake_open")
        assert status.output_0_is_2
        status = await drive.power("on")
        assert (status.output_0_is_1, status.output_0_is_2, status.running) == (False, False, True)
        await drive.move_to(10)
        assert [line for line in lines(far) if "O0" in line] == ["OT O0=1", "OT O0=2", "OT O0=0"]


async def test_power_that_the_status_does_not_show_is_told() -> None:
    async with scripted() as (drive, _):
        with pytest.raises(UnexpectedAnswerError, match="its status does not show it") as caught:
            await drive.power("off")
        assert caught.value.sent == "OT O0=1"
        await drive.power("on")


async def test_power_is_not_switched_under_a_moving_axis() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        with pytest.raises(MoveActiveError):
            await drive.power("off")
        with pytest.raises(MoveActiveError):
            await DriveAndZero.set_real_zero(drive)
        assert not any("O0" in line for line in lines(far))
        await drive.stop()
        with pytest.raises(InvalidCommandError, match="on, off, off_brake_open"):
            await drive.power("ON")  # type: ignore[arg-type]


class DriveAndZero:
    """Real zero with a word, for a drive whose settings have none."""

    @staticmethod
    async def set_real_zero(drive: Any) -> None:
        from dataclasses import replace  # noqa: PLC0415

        drive._line.settings = replace(drive.settings, dialect=Dialect(real_zero="RZ"))
        await drive.set_real_zero()


async def test_real_zero_wants_a_word_that_only_the_user_can_know() -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        with pytest.raises(InvalidCommandError, match="stands on no page"):
            await drive.set_real_zero()
        assert len(lines(far)) == before
    async with scripted(settings=DriveSettings(dialect=Dialect(real_zero="RZ"))) as (drive, script):
        await drive.set_real_zero()
        assert script.lines[-1] == "RZ"


# Another speed on the way ---------------------------------------------------------------------------------------------


async def test_a_move_that_does_not_run_takes_no_other_speed() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10)
        with pytest.raises(MoveError, match="does not run"):
            await move.change_speed(50)
        await move
        with pytest.raises(MoveError, match="does not run"):
            await move.change_speed(50)
        assert not any(line.startswith("PR0") for line in lines(far))


@pytest.mark.parametrize("percent", [0, -1, 101, 12.5, float("nan")])
async def test_a_speed_that_cannot_be_said_is_refused(percent: Any) -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        with pytest.raises(InvalidCommandError):
            await move.change_speed(percent)
        assert not any(line.startswith("PR0") for line in lines(far))
        await drive.stop()


async def test_another_speed_is_worded_by_the_dialect() -> None:
    settings = DriveSettings(dialect=Dialect(change_speed="POSR 0 SPEED {percent}"))
    async with scripted({"S17": "S017: 00100010"}, settings=settings) as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        await move.change_speed(30)
        assert far.lines[-1] == "POSR 0 SPEED 30"
        far.answers["S17"] = "S017: 00000010"
        await drive.stop()


async def test_a_speed_that_is_sent_too_late_may_not_act_on_the_next_move() -> None:
    async with scripted() as (drive, far):
        move = drive.move_to(1000)
        await move.accepted

        def end_the_move(line: str) -> None:
            if line == "S5":
                far.transport.write(b"S005: 0" + b"\r\n>" + b"$\r\n>")

        far.on_line = end_the_move
        far.answers["S5"] = None
        reading = asyncio.ensure_future(drive.torque())
        await asyncio.sleep(0)
        with pytest.raises(MoveError, match="may act on the next move"):
            await move.change_speed(30)
        await reading
        assert (await move).confirmed_by == "message"
        with pytest.raises(MoveError, match="would act on this one"):
            drive.move_to(0)


async def test_words_of_the_dialect_must_be_words() -> None:
    for wrong in (
        {"stop": ""},
        {"stop": "STOP\r"},
        {"record": "N{n}"},
        {"record": "N{m}: {text}"},
        {"set_pointer": "GOTO"},
        {"change_speed": "PR0 SD{percent:q}"},
        {"stop": None},
        {"real_zero": 7},
        {"power_on": "OT O0=0" * 5},
    ):
        with pytest.raises(InvalidCommandError):
            Dialect(**wrong)
    with pytest.raises(InvalidCommandError, match="second opt-in"):
        DriveSettings(binary_motion=True)
