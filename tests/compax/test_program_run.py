"""A program at work: started at most once, stopped wherever it is, waited for, and never left running by itself."""

from __future__ import annotations

import asyncio

import pytest
from tests.compax.program.programs import MANUAL
from tests.promises.bench import bench, ending, lines, motions, now, received, scripted, until

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    Dialect,
    DriveFaultError,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
    UnexpectedAnswerError,
)
from compax_aio.simulator.compax import LogKind, SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

STANDS = "S016: 11010000"
STOPPED = "S016: 11010100"
IDLE = "S017: 00000010"
RUNS = "S017: 00010010"
MOVES = "S017: 00100010"


def starts(far: SimulatedDrive) -> int:
    return lines(far).count("START")


def runs(far: SimulatedDrive) -> bool:
    """Say whether the last thing that the drive's program did was to begin or to go on."""
    told = far.log.texts(LogKind.PROGRAM)
    return bool(told) and told[-1].startswith(("started", "continued"))


# The program of the manual --------------------------------------------------------------------------------------------


async def test_the_program_of_the_manual_moves_when_its_input_says_so() -> None:
    async with bench() as (drive, far):
        await drive.program.download(MANUAL)
        await drive.program.start(1)
        assert lines(far)[-2:] == ["GOTO 1", "START"]
        await asyncio.sleep(0.35)
        assert await drive.program.running()
        assert motions(far) == []
        far.inputs[7] = True
        await drive.program.wait_finished(timeout_s=60)
        assert not await drive.program.running()
        assert far.position == 1250
        assert far.log.texts(LogKind.OUTPUT) == ["O8=1", "O8=0"]
        assert motions(far) == ["POSA 1250.00"]
        assert starts(far) == 1


async def test_the_program_of_the_manual_sets_its_output_when_nothing_comes() -> None:
    async with bench() as (drive, far):
        await drive.program.download(MANUAL)
        began = now()
        await drive.program.start()
        await drive.program.wait_finished()
        assert far.log.texts(LogKind.OUTPUT) == ["O7=1"]
        assert motions(far) == []
        assert 1.0 < now() - began < 2.0


async def test_a_program_compares_variables() -> None:
    text = "N001: V1=0\nN002: V1=V1+1\nN003: IF V1<=3 GOTO 2\nN004: IF V1<>4 GOTO 6\nN005: POSA .V1\nN006: END\n"
    async with bench() as (drive, far):
        await drive.program.download(text)
        assert (await drive.program.upload(last=7)).listing() == text
        await drive.program.start(1)
        await drive.program.wait_finished()
        assert await drive.variables.read(1) == 4
        assert far.position == 4


# Starting -------------------------------------------------------------------------------------------------------------


async def test_a_program_starts_at_any_record() -> None:
    async with bench() as (drive, far):
        far.load_program(["OUTPUT O1=1", "END", "OUTPUT O2=1", "END"])
        await drive.program.start(3)
        await drive.program.wait_finished()
        assert far.log.texts(LogKind.OUTPUT) == ["O2=1"]


async def test_the_words_are_part_of_the_dialect() -> None:
    dialect = Dialect(start="ST", break_off="BR", set_pointer="GOTO{n}", single_record="SINGLE{n}")
    async with bench(settings=DriveSettings(dialect=dialect)) as (drive, far):
        far.load_program(["WAIT 50", "END", "OUTPUT O2=1", "OUTPUT O3=1"])
        await drive.program.start(1)
        await drive.program.break_off()
        await drive.program.run_record(3)
        await asyncio.sleep(0.1)
        assert [line for line in lines(far) if line[:2] in {"GO", "BR", "SI"}] == ["GOTO1", "BR", "SINGLE3"]
        assert "ST" in lines(far)
        assert far.log.texts(LogKind.OUTPUT) == ["O2=1"]


async def test_a_single_record_wants_a_word_that_is_known() -> None:
    async with bench() as (drive, far):
        before = lines(far)
        error = await ending(drive.program.run_record(5))
        assert isinstance(error, InvalidCommandError)
        assert "Dialect(single_record=" in str(error)
        assert lines(far) == before


@pytest.mark.parametrize("record", [0, 251, True, 1.0, "1"])
async def test_a_record_that_there_is_not_starts_nothing(record: int) -> None:
    async with bench(settings=DriveSettings(dialect=Dialect(single_record="SINGLE{n}"))) as (drive, far):
        before = lines(far)
        for work in (drive.program.start(record), drive.program.run_record(record)):
            assert isinstance(await ending(work), InvalidCommandError)
        assert lines(far) == before


async def test_a_program_is_not_started_while_anything_runs() -> None:
    settings = DriveSettings(dialect=Dialect(single_record="SINGLE{n}"))
    async with bench(settings=settings) as (drive, far):
        far.load_program(["WAIT 5000", "END"])
        move = drive.move_to(100)
        for work in (drive.program.start(), drive.program.start(1), drive.program.run_record(1)):
            assert isinstance(await ending(work), MoveActiveError)
        await move
        await drive.program.start()
        for work in (drive.program.start(), drive.program.start(1), drive.program.run_record(1)):
            error = await ending(work)
            assert isinstance(error, MoveActiveError)
            assert "a program runs" in str(error)
        assert starts(far) == 1
        assert not [line for line in lines(far) if line.startswith(("GOTO", "SINGLE"))]


async def test_a_program_is_not_started_while_somebody_else_moves_the_axis() -> None:
    async with scripted({"S17": MOVES}) as (drive, far):
        error = await ending(drive.program.start())
        assert "the axis moves" in str(error)
        assert "START" not in far.lines


async def test_a_program_is_not_started_with_a_fault() -> None:
    async with bench() as (drive, far):
        far.raise_fault(55)
        error = await ending(drive.program.start(1))
        assert isinstance(error, DriveFaultError)
        assert error.code == 55
        assert "was not sent" in str(error)
        assert starts(far) == 0


async def test_a_program_is_not_started_while_a_move_is_in_doubt() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=1)) as (drive, far):
        move = drive.move_to(100)
        await move.accepted
        far.silent = True
        assert isinstance(await ending(move), MoveInDoubtError)
        far.silent = False
        assert isinstance(await ending(drive.program.start()), MoveInDoubtError)
        assert starts(far) == 0


async def test_a_pointer_that_is_refused_starts_nothing() -> None:
    settings = DriveSettings(dialect=Dialect(set_pointer="POINTER {n}"))
    async with bench(settings=settings) as (drive, far):
        assert isinstance(await ending(drive.program.start(1)), CommandRejectedError)
        assert starts(far) == 0


async def test_what_was_stopped_is_not_continued_by_a_start_elsewhere() -> None:
    async with bench() as (drive, far):
        far.load_program(["OUTPUT O1=1", "END"])
        move = drive.move_to(1000)
        await asyncio.sleep(0.5)
        await drive.stop()
        await ending(move)
        await drive.program.start(1)
        await asyncio.sleep(1)
        assert far.log.texts(LogKind.OUTPUT) == ["O1=1"]
        assert motions(far) == ["POSA 1000.00"]


async def test_a_program_that_waits_for_a_start_goes_on() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT START", "WAIT START", "OUTPUT O1=1", "END"])
        await drive.program.start(1)
        await asyncio.sleep(0.1)
        assert isinstance(await ending(drive.program.start(1)), MoveActiveError)
        for _ in range(2):
            assert await drive.program.running()
            await drive.program.start()
            await asyncio.sleep(0.1)
        assert far.outputs[1]
        await drive.program.wait_finished()


# At most once ---------------------------------------------------------------------------------------------------------


async def test_a_start_whose_acknowledgement_is_lost_is_found_by_status_and_not_sent_again() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT 3000", "OUTPUT O1=1", "END"])
        starting = asyncio.ensure_future(drive.program.start(1))
        await received(far, "START")
        far.lose_answers = 1
        await starting
        await drive.program.wait_finished()
        assert starts(far) == 1
        assert far.log.texts(LogKind.OUTPUT) == ["O1=1"]


async def test_a_start_that_the_status_does_not_show_is_told_as_lost_or_over() -> None:
    async with scripted({"START": None}) as (drive, far):
        error = await ending(drive.program.start())
        assert isinstance(error, AnswerTimeoutError)
        assert "no program running" in str(error)
        assert far.lines.count("START") == 1
        far.answers["START"] = "?"
        assert isinstance(await ending(drive.program.start()), UnexpectedAnswerError)
        far.answers["STOP"] = ""


async def test_a_start_that_continued_a_move_is_found_by_its_motion() -> None:
    async with scripted({"START": None, "S16": STOPPED}) as (drive, far):

        def move(line: str) -> None:
            if line == "START":
                far.answers |= {"S16": STANDS, "S17": MOVES}
            if line == "STOP":
                far.answers |= {"S16": STOPPED, "S17": IDLE}

        far.on_line = move
        await drive.program.start()


async def test_a_start_behind_which_the_drive_falls_silent_is_in_doubt() -> None:
    settings = DriveSettings(in_doubt_after_s=5, stop_timeout_s=2)
    async with bench(settings=settings) as (drive, far):
        far.load_program(["WAIT 3000", "END"])
        starting = asyncio.ensure_future(drive.program.start(1))
        await received(far, "START")
        far.silent = True
        error = await ending(starting)
        assert isinstance(error, MoveInDoubtError)
        assert isinstance(error.__cause__, AnswerTimeoutError)
        far.silent = False
        assert starts(far) == 1


async def test_a_line_that_is_lost_behind_a_start_is_told_as_that() -> None:
    async with scripted({"START": "?"}, settings=DriveSettings(reconnect=False)) as (drive, far):

        def hang_up(line: str) -> None:
            if "START" in far.lines and line[:2] == "S1":
                far.transport.abort()

        far.on_line = hang_up
        assert isinstance(await ending(drive.program.start()), ConnectionLostError)
        assert far.lines.count("START") == 1


async def test_a_wait_for_start_that_still_waits_proves_no_start() -> None:
    async with scripted({"START": None, "S17": RUNS}) as (drive, _):
        assert isinstance(await ending(drive.program.start()), AnswerTimeoutError)


async def test_a_prompt_of_a_drive_that_keeps_quiet_about_errors_proves_no_start() -> None:
    async with scripted({"P20": "P020: 3"}) as (drive, far):
        error = await ending(drive.program.start())
        assert isinstance(error, MoveInDoubtError)
        assert "proves nothing" in str(error)

        def begin(line: str) -> None:
            if line in {"START", "STOP"}:
                far.answers["S17"] = RUNS if line == "START" else IDLE

        far.on_line = begin
        await drive.program.start()
        assert far.lines.count("START") == 2


# Stopping -------------------------------------------------------------------------------------------------------------


async def test_a_stopped_program_stands_until_it_is_started_again() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 1000", "OUTPUT O1=1", "END"])
        await drive.program.start(1)
        await asyncio.sleep(1)
        await drive.program.stop()
        assert not far.moving
        assert not await drive.program.running()
        assert isinstance(await ending(drive.program.wait_finished()), MoveStoppedError)
        await drive.program.start()
        await drive.program.wait_finished()
        assert far.position == 1000
        assert far.outputs[1]


async def test_a_program_that_is_broken_off_is_not_continued() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 1000", "OUTPUT O1=1", "END", "OUTPUT O2=1", "END"])
        await drive.program.start(1)
        await asyncio.sleep(1)
        await drive.program.break_off()
        assert not far.moving
        far.load_program(["OUTPUT O3=1", "END"])
        await drive.program.start()
        await asyncio.sleep(1)
        assert far.log.texts(LogKind.OUTPUT) == ["O3=1"]
        assert motions(far) == ["POSA 1000.00"]


async def test_a_program_that_takes_over_a_stop_is_told_and_can_be_broken_off() -> None:
    settings = DriveSettings(standstill_timeout_s=2)
    async with bench(settings=settings) as (drive, far):
        far.load_program(["IF STOP GOTO 4", "POSA 1000", "END", "IF STOP GOTO 4", "POSA 5000", "POSA -5000", "GOTO 5"])
        await drive.program.start(1)
        await asyncio.sleep(1)
        error = await ending(drive.program.stop())
        assert isinstance(error, MoveTimeoutError)
        await drive.program.break_off()
        assert not runs(far)
        assert not far.moving


async def test_a_handler_of_a_stop_may_end_in_its_own_time() -> None:
    async with bench() as (drive, far):
        far.load_program(["IF STOP GOTO 4", "WAIT 5000", "END", "WAIT 1000", "OUTPUT O1=1", "END"])
        await drive.program.start(1)
        await asyncio.sleep(0.5)
        await drive.program.stop()
        assert far.outputs[1]
        assert not runs(far)


async def test_a_drive_that_does_not_stop_its_program_is_stopped_again_when_the_block_is_left() -> None:
    async with scripted({"S17": RUNS}, settings=DriveSettings(standstill_timeout_s=1)) as (drive, far):
        for work in (drive.program.stop(), drive.program.break_off()):
            error = await ending(work)
            assert isinstance(error, MoveTimeoutError)
            assert "the program runs" in str(error)
        before = far.lines.count("STOP")
    assert far.lines.count("STOP") == before + 1


# Waiting --------------------------------------------------------------------------------------------------------------


async def test_a_wait_that_is_too_short_leaves_the_program_alone() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT 5000", "OUTPUT O1=1", "END"])
        await drive.program.start(1)
        began = now()
        assert isinstance(await ending(drive.program.wait_finished(timeout_s=2)), MoveTimeoutError)
        assert 2 <= now() - began < 2.1
        assert await drive.program.running()
        await drive.program.wait_finished()
        assert far.outputs[1]
        for timeout_s in (0, -1, float("nan"), "5"):
            assert isinstance(
                await ending(drive.program.wait_finished(timeout_s)),  # type: ignore[arg-type]
                InvalidCommandError,
            )


async def test_a_fault_ends_the_wait() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 1000", "END"])
        await drive.program.start(1)
        await asyncio.sleep(1)
        far.raise_fault(10)
        error = await ending(drive.program.wait_finished())
        assert isinstance(error, DriveFaultError)
        assert error.code == 10


async def test_a_fault_that_the_program_goes_on_with_ends_the_wait_as_well() -> None:
    async with scripted({"S17": RUNS, "S16": "S016: 01010000", "S30": "S030: 55 0"}) as (drive, _):
        error = await ending(drive.program.wait_finished())
        assert isinstance(error, DriveFaultError)
        assert "while the program runs" in str(error)


async def test_a_fault_that_has_ended_the_program_is_told() -> None:
    async with scripted({"S16": "S016: 01010000", "S30": "S030: 55 0"}) as (drive, _):
        error = await ending(drive.program.wait_finished())
        assert isinstance(error, DriveFaultError)
        assert "a fault ended the program: E55" in str(error)


async def test_a_stop_by_the_input_ends_the_wait() -> None:
    async with scripted({"S17": RUNS}) as (drive, far):
        asyncio.get_running_loop().call_later(1, far.answers.__setitem__, "S17", "S017: 00001010")
        error = await ending(drive.program.wait_finished())
        assert isinstance(error, MoveStoppedError)
        assert "by input I6" in str(error)


async def test_a_stop_that_was_shown_all_the_time_proves_none_and_no_end() -> None:
    async with scripted({"S17": RUNS, "S16": STOPPED}) as (drive, far):
        asyncio.get_running_loop().call_later(1, far.answers.__setitem__, "S17", IDLE)
        assert isinstance(await ending(drive.program.wait_finished()), MoveInDoubtError)


async def test_the_axis_stands_when_a_wait_is_over() -> None:
    async with scripted({"S17": MOVES}) as (drive, far):
        asyncio.get_running_loop().call_later(3, far.answers.__setitem__, "S17", IDLE)
        began = now()
        await drive.program.wait_finished()
        assert now() - began >= 3


async def test_a_drive_that_falls_silent_ends_the_wait() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=3, stop_timeout_s=1)) as (drive, far):
        far.load_program(["WAIT 1", "GOTO 1"])
        await drive.program.start(1)
        far.deaf = True
        began = now()
        assert isinstance(await ending(drive.program.wait_finished()), AnswerTimeoutError)
        assert now() - began < 20
        far.deaf = False


async def test_a_line_that_is_lost_ends_the_wait() -> None:
    async with scripted({"S17": RUNS}, settings=DriveSettings(reconnect=False)) as (drive, far):
        asyncio.get_running_loop().call_later(1, far.transport.abort)
        assert isinstance(await ending(drive.program.wait_finished()), ConnectionLostError)


async def test_a_wait_asks_ever_more_rarely() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT 60000", "END"])
        await drive.program.start(1)
        await drive.program.wait_finished()
        assert 120 <= lines(far).count("S17") <= 130


# Never alone ----------------------------------------------------------------------------------------------------------


async def test_leaving_the_block_stops_a_program_that_runs() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSR 10", "WAIT 100", "GOTO 1"])
        await drive.program.start(1)
        await asyncio.sleep(2.5)
        assert runs(far)
    assert not far.moving
    assert not runs(far)
    assert lines(far).count("STOP") == 1


@pytest.mark.parametrize("after_s", [0.0, 0.001, 0.005, 0.05, 1.0])
async def test_a_caller_who_is_cancelled_leaves_no_program_running(after_s: float) -> None:
    async with bench() as (_, far):
        far.load_program(["POSR 10", "WAIT 100", "GOTO 1"])

    async def run_for_ever() -> None:
        async with compax_aio.connect("sim://compax?name=x", name="x") as drive:
            await drive.program.start(1)
            await drive.program.wait_finished()

    task = asyncio.ensure_future(run_for_ever())
    await until(lambda: "START" in lines(far), to_the_tick=True)
    await asyncio.sleep(after_s)
    task.cancel()
    await asyncio.wait([task])
    assert task.cancelled()
    assert not runs(far)
    assert not far.moving
    assert starts(far) == 1
