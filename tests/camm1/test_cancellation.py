"""A job that is given up, whoever does it and when: the machine stops, the tool is up, and the next job is cut."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress

import anyio
import pytest
from tests.camm1.bench import HANDSHAKES, Bench, Handshake, bench, ending, expected_vectors, job_of, now, until, vectors

from compax_aio.camm1.cut import Cut, CutResult
from compax_aio.camm1.events import CutEnded
from compax_aio.camm1.settings import CutterSettings
from compax_aio.errors import CompaxError, MoveActiveError, MoveStoppedError
from compax_aio.simulator.camm1 import LogKind

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

JOB = job_of(6000)
SQUARE = "IN;PA;PU100,100;PD500,100,500,500,100,500,100,100;PU;"


def kills(on: Bench) -> int:
    return sum(each.kind is LogKind.CONTROL and each.text == "K" for each in on.far.log)


async def check_usable(on: Bench, handshake: Handshake = "software") -> None:
    """The machine has stopped at a boundary of the job, its tool is up, and it cuts the next job."""
    if (job := on.cutter.job) is not None:
        await job.abort()  # or wait for the abort that is under way
    made = vectors(on.far)
    assert made == expected_vectors(JOB)[: len(made)]
    on.far.new_sheet()
    result = await on.cutter.cut(SQUARE, handshake=handshake)
    assert isinstance(result, CutResult)
    assert [each for each in vectors(on.far) if each[4]] == [each for each in expected_vectors(SQUARE) if each[4]]


@pytest.mark.parametrize("size", [60, 1024])
@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_an_abort_in_the_middle_leaves_the_machine_usable(handshake: Handshake, size: int) -> None:
    wired = handshake == "hardwire"
    async with bench(physical_size=size, dtr_wired=wired, dtr_overshoot=0) as on:
        cut = on.cutter.cut(JOB, handshake=handshake)
        await asyncio.sleep(5)
        before = now()
        await cut.abort()
        assert now() - before < (3 if wired else 0.7)
        assert isinstance(await ending(cut), MoveStoppedError)
        assert on.far.stored_bytes == 0
        assert not on.far.position()[2]
        await check_usable(on, handshake)


@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_a_cancelled_job_is_aborted_at_once_and_the_next_one_waits_for_that(handshake: Handshake) -> None:
    async with bench(dtr_wired=handshake == "hardwire", dtr_overshoot=0) as on:
        events = on.cutter.events()
        cut = on.cutter.cut(JOB, handshake=handshake)
        await asyncio.sleep(2)
        sent = on.cutter.stats.bytes_sent
        cut.cancel()
        assert on.cutter.stats.bytes_sent == sent + 3  # ESC.K, before cancel() has returned
        following = on.cutter.cut(SQUARE, handshake=handshake)
        with pytest.raises(asyncio.CancelledError):
            await cut
        await following
        made = [each for each in vectors(on.far) if each[4]]
        assert made[-4:] == [each for each in expected_vectors(SQUARE) if each[4]]
        ended = [each for each in events.take_waiting() if isinstance(each, CutEnded)]
        assert [each.outcome for each in ended] == ["cancelled", "reached"]
        assert 0 < ended[0].account.bytes_sent < len(JOB)


@pytest.mark.parametrize("after_s", [0.0, 0.0005, 0.02, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_it_may_be_cancelled_at_any_moment(handshake: Handshake, after_s: float) -> None:
    async with bench(dtr_wired=handshake == "hardwire", dtr_overshoot=0) as on:
        cut = on.cutter.cut(JOB, handshake=handshake)
        await asyncio.sleep(after_s)
        cut.cancel()
        await check_usable(on, handshake)


async def test_it_may_be_cancelled_at_each_moment_of_its_end() -> None:
    for part in range(30):
        async with bench() as on:
            cut = on.cutter.cut(SQUARE)
            await asyncio.sleep(0.6 + part * 0.04)
            cut.cancel()
            on.far.advance()
            await on.cutter.cut(SQUARE)


async def test_a_timeout_around_it_aborts_it() -> None:
    async with bench() as on:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(3):
                await on.cutter.cut(JOB)
        await check_usable(on)


async def test_a_failing_task_group_aborts_it() -> None:
    async def fail() -> None:
        await asyncio.sleep(3)
        raise ValueError("another part of the program")

    async def cut(on: Bench) -> None:
        await on.cutter.cut(JOB)

    async with bench() as on:
        with pytest.raises(ExceptionGroup):  # noqa: PT012  # a task group is no single statement
            async with asyncio.TaskGroup() as group:
                group.create_task(cut(on))
                group.create_task(fail())
        await check_usable(on)


async def test_a_cancel_scope_of_anyio_aborts_it() -> None:
    async with bench() as on:
        with anyio.move_on_after(3):
            await on.cutter.cut(JOB)
        await check_usable(on)


async def test_leaving_the_block_aborts_it_and_waits_until_the_tool_is_up() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB)
        await asyncio.sleep(3)
        await on.cutter.close()
        assert isinstance(await ending(cut), MoveStoppedError)
        assert on.far.stored_bytes == 0
        assert not on.far.position()[2]
        assert kills(on) == 1


async def test_a_job_that_shall_finish_is_cut_although_it_is_cancelled_and_leaving_the_block_waits_for_it() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB, on_cancel="finish")
        await asyncio.sleep(3)
        cut.cancel()
        with pytest.raises(asyncio.CancelledError):
            await cut
        await on.cutter.close()
        assert vectors(on.far) == expected_vectors(JOB)
        assert kills(on) == 0


async def test_a_job_that_shall_finish_takes_no_other_beside_it() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB, on_cancel="finish")
        await asyncio.sleep(1)
        cut.cancel()
        following = on.cutter.cut(SQUARE)
        with pytest.raises(MoveActiveError):
            on.cutter.cut(SQUARE)
        await following
        assert vectors(on.far)[: len(expected_vectors(JOB))] == expected_vectors(JOB)


async def test_a_paused_job_may_be_aborted_and_cancelled() -> None:
    async with bench() as on:
        for is_cancelled in (False, True):
            cut: Cut = on.cutter.cut(JOB)
            await asyncio.sleep(2)
            await cut.pause()
            await asyncio.sleep(5)
            if is_cancelled:
                cut.cancel()
            await cut.abort()
            on.far.new_sheet()
            await on.cutter.cut(SQUARE)


async def test_a_job_is_aborted_while_the_operator_has_paused_it_and_the_tool_goes_up_when_he_lets_it() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB)
        await asyncio.sleep(3)
        on.far.press_pause()
        await asyncio.sleep(3)
        await cut.abort()
        assert on.far.stored_bytes <= len(";PU;")
        on.far.press_pause()
        await until(lambda: on.far.is_idle)
        assert not on.far.position()[2]
        await check_usable(on)


async def test_an_abort_of_a_job_that_is_over_is_harmless() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        await cut
        await cut.abort()
        assert not cut.cancel()
        assert kills(on) == 0


async def test_two_aborts_are_one() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB)
        await asyncio.sleep(2)
        await asyncio.gather(cut.abort(), cut.abort(), on.cutter.stop())
        assert kills(on) == 1
        await check_usable(on)


async def test_stop_without_a_job_drops_what_somebody_else_has_sent() -> None:
    async with bench() as on:
        served_by = on.far.served_by
        assert served_by is not None
        on.far.receive(b"PD0,4000;PD0,0;" * 20, served_by.time())
        served_by.changed()
        await asyncio.sleep(2)
        status = await on.cutter.stop()
        assert status.buffer_is_empty
        assert len(vectors(on.far)) < 10
        assert not on.far.position()[2]


async def test_an_abort_goes_on_although_answers_are_lost() -> None:
    for count in range(1, 8):
        async with bench() as on:
            cut = on.cutter.cut(JOB)
            await asyncio.sleep(2)
            on.far.trouble.replies_to_lose = count
            await cut.abort()
            on.far.heal()
            await check_usable(on)


@pytest.mark.parametrize("hold", ["pause", "setup"])
async def test_a_machine_that_is_held_in_the_middle_of_an_abort_is_told(hold: str) -> None:
    settings = CutterSettings(baud_rate=9600, stop_timeout_s=4, cutting_timeout_s=1)
    async with bench(settings, fails_to_close=True) as on:
        press = on.far.press_pause if hold == "pause" else on.far.press_setup
        cut = on.cutter.cut("PD0,8000;PD0,0;" * 30)
        await asyncio.sleep(2)
        aborting = asyncio.create_task(cut.abort())
        await asyncio.sleep(0.3)
        press()
        await asyncio.wait([aborting, asyncio.create_task(asyncio.sleep(30))])
        held = aborting.exception()
        if held is not None:
            assert on.cutter.in_doubt
        press()
        await until(lambda: on.far.is_idle)
        await on.cutter.stop()
        on.far.new_sheet()
        await on.cutter.cut(SQUARE)


async def test_an_abort_that_nobody_hears_is_told_in_bounded_time_and_may_be_repeated() -> None:
    async with bench(CutterSettings(baud_rate=9600, stop_timeout_s=3)) as on:
        on.far.power_off()
        started = now()
        with pytest.raises(CompaxError):
            await on.cutter.stop()
        assert now() - started < 30
        on.far.power_on()
        await on.cutter.stop()


async def test_an_abort_waits_for_a_line_that_was_lost_just_now() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB)
        await asyncio.sleep(2)
        on.lose_line()
        await asyncio.sleep(0)
        with suppress(CompaxError):
            await cut.abort()
        await asyncio.wait([cut])
        assert cut.exception() is not None
        await on.cutter.stop()
        await check_usable(on)


async def test_a_caller_that_is_cancelled_in_an_abort_does_not_end_the_abort() -> None:
    async with bench() as on:
        cut = on.cutter.cut(JOB)
        await asyncio.sleep(2)
        aborting = asyncio.create_task(cut.abort())
        await asyncio.sleep(0.01)
        aborting.cancel()
        await asyncio.wait([aborting])
        await asyncio.wait([cut])
        assert isinstance(cut.exception(), MoveStoppedError)
        await check_usable(on)


@pytest.mark.parametrize("lowest_first", [True, False])
async def test_with_a_slow_line_no_more_is_on_its_way_than_a_quarter_of_a_second(lowest_first: bool) -> None:
    for baud in (1200, 9600) if lowest_first else (4800, 2400):
        async with bench(CutterSettings(baud_rate=baud), baudrate=baud, time_factor=0.01) as on:
            cut = on.cutter.cut(JOB)
            for _ in range(50):
                await asyncio.sleep(0.0313)
                unsent = on.cutter._line.link.unsent_bytes
                assert unsent <= max(48, baud / 10 * 0.25) + 30
            cut.cancel()
            await on.cutter.stop()


PROGRAM = """
import asyncio, sys
from compax_aio import camm1
from compax_aio.simulator.camm1 import Knobs
from compax_aio.simulator.server import cutter_named

async def main():
    far = cutter_named("table", Knobs(baudrate=9600))
    try:
        async with camm1.connect("sim://camm1?name=table") as cutter:
            cut = cutter.cut("PD0,4000;PD0,0;" * 400)
            await asyncio.sleep(0.5)
            print("cutting", flush=True)
            await cut
    finally:
        print("stored", far.stored_bytes, "down", far.position()[2], flush=True)

try:
    asyncio.run(main())
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.real_time
async def test_ctrl_c_aborts_it_before_the_program_ends() -> None:
    with subprocess.Popen(  # noqa: ASYNC220  # it starts at once
        [sys.executable, "-c", textwrap.dedent(PROGRAM)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        assert await asyncio.to_thread(program.stdout.readline) == "cutting\n"
        program.send_signal(signal.SIGINT)
        out, err = await asyncio.to_thread(program.communicate, timeout=30)
    assert out.splitlines() == ["stored 0 down False", "interrupted"], err
