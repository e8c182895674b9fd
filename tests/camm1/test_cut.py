"""A job as the caller holds it: cut whole and proved, watched, paused, refused, stalled, spoilt, or in doubt."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.camm1.bench import (
    FAST,
    HANDSHAKES,
    SIZES,
    Handshake,
    bench,
    codes,
    ending,
    expected_vectors,
    job_of,
    now,
    until,
    vectors,
)

from compax_aio.camm1.checking import Sheet
from compax_aio.camm1.cut import Cut, CutProgress, CutResult
from compax_aio.camm1.events import CutBegun, CutEnded, CutterError, CutterPaused, CutterReset, CutterResumed
from compax_aio.camm1.profiles import PNC_1610
from compax_aio.camm1.settings import CutterSettings
from compax_aio.errors import (
    CommandRejectedError,
    CompaxError,
    DriveFaultError,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.link.contract import Lane
from compax_aio.simulator.camm1 import LogKind

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

SQUARE = "IN;PA;PU100,100;PD500,100,500,500,100,500,100,100;PU;"
"""Cut in about half a second."""
ENDLESS = "PD0,40000;PD0,0;" * 200
"""Takes minutes."""


# Cut whole ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_a_job_is_cut_whole_and_its_end_is_proved(handshake: Handshake) -> None:
    async with bench() as on:
        result = await on.cutter.cut(SQUARE, handshake=handshake)
        assert vectors(on.far) == expected_vectors(SQUARE)
        assert result == CutResult(
            cutter="c",
            bytes=len(SQUARE),
            instructions=5,
            handshake=handshake,
            handshake_because="it was asked for",
            proved_by="OA",
            duration_s=result.duration_s,
        )
        assert on.far.is_idle
        assert not on.far.position()[2]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_a_slow_cutter_loses_nothing(handshake: Handshake, size: int) -> None:
    job = job_of(3 * min(size, 1024) + 1000)
    async with bench(physical_size=size, dtr_wired=handshake == "hardwire", dtr_overshoot=0) as on:
        await on.cutter.cut(job, handshake=handshake)
        assert vectors(on.far) == expected_vectors(job)
        assert on.far.lost_bytes == 0
        # A question may arrive in the millisecond in which the cutter sends Xoff; nobody can know before.
        assert set(codes(on.far)) <= ({"10"} if handshake == "xonxoff" else set())


async def test_auto_asks_for_free_space_and_says_why() -> None:
    async with bench() as on:
        result = await on.cutter.cut(SQUARE)
        assert result.handshake == "software"
        assert "ESC.B" in result.handshake_because


async def test_jobs_follow_each_other_with_any_handshake() -> None:
    async with bench() as on:
        for handshake in (*HANDSHAKES, *reversed(HANDSHAKES)):
            on.far.new_sheet()
            await on.cutter.cut(SQUARE, handshake=handshake)
            assert [each for each in vectors(on.far) if each[4]] == [e for e in expected_vectors(SQUARE) if e[4]]


async def pieces(*texts: str | bytes, pause_s: float = 0.0) -> AsyncIterator[str | bytes]:
    for each in texts:
        await asyncio.sleep(pause_s)
        yield each


async def test_a_job_may_be_bytes_a_file_or_pieces_that_split_its_instructions_anywhere(tmp_path: Path) -> None:
    path = tmp_path / "square.hpgl"
    path.write_bytes(SQUARE.encode())
    async with bench() as on:
        jobs: list[Any] = [SQUARE.encode(), bytearray(SQUARE.encode()), path, pieces(*SQUARE, pause_s=0.01)]
        for job in jobs:
            on.far.new_sheet()
            result = await on.cutter.cut(job)
            assert [each for each in vectors(on.far) if each[4]] == [e for e in expected_vectors(SQUARE) if e[4]]
            assert result.instructions == 5


async def test_pieces_that_come_slowly_go_as_they_come() -> None:
    async with bench() as on:
        cut = on.cutter.cut(pieces("PU100,100;", "PD200,200;", "PU;", pause_s=10))
        await asyncio.sleep(12)
        assert vectors(on.far) == [(0, 0, 100, 100, False)]
        await cut
        assert vectors(on.far)[1:] == [(100, 100, 200, 200, True)]


async def test_a_stream_without_end_is_cut_until_it_is_aborted() -> None:
    taken = 0

    async def endless() -> AsyncIterator[str]:
        nonlocal taken
        while True:
            taken += 1
            yield "PD100,100;PD0,0;"

    async with bench() as on:
        cut = on.cutter.cut(endless())
        await asyncio.sleep(60)
        ahead = taken * 16 - on.far.cuttings.vectors.total * 8
        assert ahead < 4 * 1024
        await cut.abort()
        assert isinstance(await ending(cut), MoveStoppedError)


async def test_a_long_list_is_parted_and_cuts_the_same_line() -> None:
    job = job_of(4000, longest_list=60)
    for handshake in HANDSHAKES:
        async with bench(physical_size=60, dtr_wired=handshake == "hardwire") as on:
            result = await on.cutter.cut(job, handshake=handshake)
            assert vectors(on.far) == expected_vectors(job)
            assert result.instructions > job.count(";")


async def test_a_label_is_never_parted() -> None:
    async with bench() as on:
        await on.cutter.cut("PU0,0;LBone; two PD9,9;\x03PU10,10;")
        assert [(each.name, each.text) for each in on.far.cuttings.marks if each.name == "LB"] == [
            ("LB", "one; two PD9,9;")
        ]


async def test_what_ends_without_its_semicolon_is_ended_by_what_lifts_the_tool() -> None:
    async with bench() as on:
        await on.cutter.cut("PU10,10;PD20,20")
        assert vectors(on.far) == [(0, 0, 10, 10, False), (10, 10, 20, 20, True)]
        assert not on.far.position()[2]


async def test_a_job_of_mode_1_is_ended_in_its_own_way() -> None:
    async with bench() as on:
        result = await on.cutter.cut("H\nM 100,100\nD 200,100,200,200\n")
        assert [each for each in vectors(on.far) if each[4]] == [(100, 100, 200, 100, True), (200, 100, 200, 200, True)]
        assert result.proved_by == "OA"
        assert not on.far.position()[2]


async def test_device_control_and_questions_in_a_job_are_left_out_and_told() -> None:
    async with bench() as on:
        result = await on.cutter.cut("\x1b.K\x1b.M;17:IN;OA;PU10,10;OI;PD20,20;PU;", check=False)
        assert vectors(on.far) == [(0, 0, 10, 10, False), (10, 10, 20, 20, True)]
        assert any("left out" in each for each in result.warnings)
        assert not codes(on.far)


# Watched --------------------------------------------------------------------------------------------------------------


async def watched(cut: Cut) -> list[CutProgress]:
    return [each async for each in cut.progress(interval_s=0.05)]


async def test_progress_tells_how_far_it_is_from_its_start_to_its_end() -> None:
    job = job_of(3000)
    async with bench() as on:
        cut = on.cutter.cut(job)
        watching = asyncio.create_task(watched(cut))
        await cut
        seen = await watching
        states: list[str] = [each.state for each in seen]
        assert states[0] == "starting"
        assert {"cutting", "finishing", "over"} <= set(states)
        last: CutProgress = seen[-1]
        assert (last.bytes_sent, last.bytes_total) == (len(job), len(job))
        assert last.instructions_sent == last.instructions_total
        end: object = expected_vectors(job)[-1][2:4]
        assert last.position_steps == end
        assert [each.bytes_sent for each in seen] == sorted(each.bytes_sent for each in seen)
        assert any(each.free_bytes is not None and each.free_bytes < 1024 for each in seen)


async def test_an_interval_that_is_none_is_refused() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        with pytest.raises(InvalidCommandError):
            await anext(cut.progress(interval_s=-1))
        await cut


async def test_events_tell_that_a_job_began_and_how_it_ended() -> None:
    async with bench() as on:
        events = on.cutter.events()
        await on.cutter.cut(SQUARE)
        cut = on.cutter.cut(ENDLESS)
        await asyncio.sleep(2)
        await cut.abort()
        await ending(cut)
        begun, ended, again, stopped = events.take_waiting()
        assert isinstance(begun, CutBegun)
        assert isinstance(ended, CutEnded)
        assert isinstance(again, CutBegun)
        assert isinstance(stopped, CutEnded)
        assert (ended.outcome, ended.error) == ("reached", None)
        assert (stopped.outcome, type(stopped.error)) == ("stopped", MoveStoppedError)
        assert ended.account.bytes_sent == len(SQUARE)
        assert [each.as_mark().word for each in (begun, ended, stopped)] == ["accepted", "reached", "stopped"]


# Paused ---------------------------------------------------------------------------------------------------------------


async def test_paused_from_here_nothing_more_is_sent_until_it_goes_on() -> None:
    job = job_of(3000)
    async with bench() as on:
        cut = on.cutter.cut(job)
        await asyncio.sleep(1.5)
        await cut.pause()
        sent = cut.account.bytes_sent
        await asyncio.sleep(100)
        assert cut.account.bytes_sent == sent < len(job)
        assert on.far.is_idle
        await cut.resume()
        await cut
        assert vectors(on.far) == expected_vectors(job)
        await cut.pause()  # harmless
        await cut.resume()


@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_a_pause_at_the_machine_is_seen_told_and_waited_for(handshake: Handshake) -> None:
    job = job_of(3000)
    async with bench(dtr_wired=handshake == "hardwire", dtr_overshoot=0) as on:
        events = on.cutter.events()
        cut = on.cutter.cut(job, handshake=handshake)
        await asyncio.sleep(2)
        on.far.press_pause()
        await asyncio.sleep(200)
        assert not cut.done()
        seen = cut._owner.snapshot().state
        assert seen == "operator pause" or handshake == "hardwire"
        on.far.press_pause()
        await cut
        assert vectors(on.far) == expected_vectors(job)
        told = [type(each) for each in events.take_waiting()]
        assert CutterPaused in told or handshake == "hardwire"
        assert told.count(CutterPaused) == told.count(CutterResumed)


async def test_a_machine_that_is_paused_when_a_job_begins_is_waited_for() -> None:
    async with bench() as on:
        on.far.press_pause()
        cut = on.cutter.cut(SQUARE)
        await asyncio.sleep(30)
        assert not vectors(on.far)
        on.far.press_pause()
        await cut
        assert vectors(on.far) == expected_vectors(SQUARE)


@pytest.mark.parametrize("handshake", ["software", "xonxoff", "enq1", "enq2"])
async def test_a_job_that_the_operator_ends_is_never_told_as_cut(handshake: Handshake) -> None:
    job = job_of(6000)
    async with bench(fails_to_close=True) as on:
        cut = on.cutter.cut(job, handshake=handshake)
        await asyncio.sleep(3)
        on.far.press_pause()
        await asyncio.sleep(4)
        on.far.press_setup()
        error = await ending(cut)
        assert isinstance(error, MoveInDoubtError)
        assert "deleted" in str(error)
        assert len(vectors(on.far)) < len(expected_vectors(job))
        await until(lambda: on.far.is_idle)
        await on.cutter.reconcile()
        on.far.new_sheet()
        await on.cutter.cut(SQUARE, handshake=handshake)
        assert [each for each in vectors(on.far) if each[4]] == [e for e in expected_vectors(SQUARE) if e[4]]


async def test_a_machine_that_has_dropped_its_data_while_it_is_paused_has_ended_the_job() -> None:
    async with bench() as on:
        cut = on.cutter.cut(job_of(6000))
        await asyncio.sleep(3)
        on.far.press_pause()
        await asyncio.sleep(4)
        on.far.press_setup()
        on.far.press_pause()
        error = await ending(cut)
        assert isinstance(error, MoveStoppedError)
        on.far.press_pause()


# Refused --------------------------------------------------------------------------------------------------------------


async def test_a_job_with_errors_is_refused_before_a_byte_of_it_is_sent() -> None:
    async with bench() as on:
        error = await ending(on.cutter.cut("IN;PU0,0;QQ5;PD1;PU;"))
        assert isinstance(error, InvalidCommandError)
        assert "2 errors in the job" in str(error)
        assert not [each for each in on.far.log if each.kind is LogKind.INSTRUCTION]
        assert not hasattr(error, "job")


async def test_a_job_outside_of_the_sheet_is_refused_if_a_sheet_is_told() -> None:
    async with bench() as on:
        error = await ending(on.cutter.cut("PU0,0;PD99999,0;PU;", sheet=Sheet(100, 100)))
        assert "sheet" in str(error)
        result = await on.cutter.cut("PU0,0;PD99,0;PU;", sheet=Sheet(100, 100))
        assert not result.warnings


async def test_what_is_only_suspect_is_cut_and_told() -> None:
    async with bench() as on:
        result = await on.cutter.cut("PU0,0;PD10,10;")
        assert any("left down" in each for each in result.warnings)


async def test_a_stream_with_an_error_stops_where_it_is() -> None:
    async with bench() as on:
        error = await ending(on.cutter.cut(pieces("PU10,10;PD20,20;", "QQ;", "PD30,30;", pause_s=1)))
        assert isinstance(error, InvalidCommandError)
        assert "QQ" in str(error)
        assert error.job.instructions_sent == 2  # type: ignore[attr-defined]
        assert (20, 20, 30, 30, True) not in vectors(on.far)
        await on.cutter.cut(SQUARE)


async def test_a_stream_that_fails_stops_the_machine_and_its_own_error_is_raised() -> None:
    async def broken() -> AsyncIterator[str]:
        yield ENDLESS[:320]
        await asyncio.sleep(2)
        raise OSError("the disk is gone")

    async with bench() as on:
        cut = on.cutter.cut(broken())
        with pytest.raises(OSError, match="the disk is gone") as raised:
            await cut
        assert any("bytes of the job" in note for note in raised.value.__notes__)
        assert on.far.stored_bytes == 0
        await on.cutter.cut(SQUARE)


@pytest.mark.parametrize(
    ("job", "what"),
    [
        ("PU0,0;LBno end", "no end"),
        ("PU0,0;\x11PD1,1;", "DC1"),
        ("PU0,0;PD1,1\x05;", "ENQ"),
        (f"LB{'x' * 2000}\x03", "get through"),
    ],
)
async def test_what_can_be_told_to_no_cutter_is_refused_checked_or_not(job: str, what: str) -> None:
    async with bench() as on:
        error = await ending(on.cutter.cut(job, check=False))
        assert isinstance(error, InvalidCommandError)
        assert what in str(error)
        assert not [each for each in on.far.log if each.kind is LogKind.INSTRUCTION]


@pytest.mark.parametrize(
    "wrong",
    [
        {"job": 5},
        {"job": "päper☃"},
        {"handshake": "rts"},
        {"on_cancel": "detach"},
        {"check": "yes"},
    ],
)
async def test_what_is_no_job_is_refused_at_once(wrong: dict[str, Any]) -> None:
    async with bench() as on:
        with pytest.raises(InvalidCommandError):
            on.cutter.cut(**{"job": SQUARE, **wrong})
        assert on.cutter.job is None


async def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    async with bench() as on:
        with pytest.raises(FileNotFoundError):
            await on.cutter.cut(tmp_path / "none.hpgl")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")
async def test_nobody_waits_for_the_other_end_of_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    async with bench() as on:
        with pytest.raises(OSError, match="no plain file"):
            await on.cutter.cut(tmp_path / "pipe")
        await on.cutter.cut(SQUARE)


async def test_a_second_job_is_refused_while_one_is_under_way() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        assert on.cutter.job is cut
        with pytest.raises(MoveActiveError):
            on.cutter.cut(SQUARE)
        await cut


async def test_a_cutter_that_has_data_of_somebody_else_takes_no_job_until_it_is_stopped() -> None:
    async with bench() as on:
        on.far.receive(ENDLESS.encode()[:400], on.far.served_by.time() if on.far.served_by else 0.0)
        await asyncio.sleep(1)
        error = await ending(on.cutter.cut(SQUARE))
        assert isinstance(error, MoveActiveError)
        await on.cutter.stop()
        await on.cutter.cut(SQUARE)


async def test_a_handshake_that_the_cutter_does_not_take_is_refused_with_its_error() -> None:
    profile = replace(PNC_1610, controls=PNC_1610.controls | {"@"})
    async with bench(profile=profile, dtr_control="dtr") as on:
        await on.cutter.cut(SQUARE, handshake="hardwire")
    with pytest.raises(CommandRejectedError, match="error 11") as raised:
        async with bench(profile=profile):
            pass
    assert raised.value.code == 11


async def test_a_machine_of_which_nobody_knows_how_to_use_its_dtr_line_takes_no_hardwire_handshake() -> None:
    profile = replace(PNC_1610, controls=PNC_1610.controls - {"P"})
    async with bench(profile=profile) as on:
        error = await ending(on.cutter.cut(SQUARE, handshake="hardwire"))
        assert isinstance(error, InvalidCommandError)
        assert "'@'" in str(error)


# Stalled, spoilt ------------------------------------------------------------------------------------------------------


async def test_a_machine_that_takes_nothing_and_is_not_paused_is_told_with_what_to_look_at() -> None:
    async with bench(CutterSettings(baud_rate=9600, stop_timeout_s=5)) as on:
        on.far.press_setup()
        started = now()
        error = await ending(on.cutter.cut(job_of(4000)))
        assert isinstance(error, MoveTimeoutError)
        assert "SETUP" in str(error)
        assert 60 <= now() - started < 90
        assert error.job.bytes_sent < 4000  # type: ignore[attr-defined]
        on.far.press_setup()
        await on.cutter.stop()
        await on.cutter.cut(SQUARE)


async def test_a_short_job_stalls_in_its_buffer_the_same() -> None:
    async with bench(CutterSettings(baud_rate=9600, stall_timeout_s=10)) as on:
        on.far.press_setup()
        error = await ending(on.cutter.cut(SQUARE))
        assert isinstance(error, MoveTimeoutError)


async def test_a_line_that_the_cable_holds_for_too_long_is_told() -> None:
    settings = CutterSettings(baud_rate=9600, held_timeout_s=30, stop_timeout_s=5)
    async with bench(settings, dtr_wired=True, dtr_overshoot=0, fails_to_close=True) as on:
        cut = on.cutter.cut(job_of(6000), handshake="hardwire")
        await asyncio.sleep(3)
        on.far.press_pause()
        error = await ending(cut)
        assert isinstance(error, CompaxError)
        assert on.cutter.in_doubt
        on.far.press_pause()
        await until(lambda: on.far.is_idle)
        await on.cutter.stop()
        await on.cutter.cut(SQUARE)


@pytest.mark.parametrize("code", [15, 16])
async def test_an_error_of_the_line_ruins_the_job_and_stops_it(code: int) -> None:
    async with bench() as on:
        events = on.cutter.events()
        cut = on.cutter.cut(job_of(20_000))
        await asyncio.sleep(3)
        on.fail(code)
        error = await ending(cut)
        assert isinstance(error, DriveFaultError)
        assert error.code == code
        assert error.job.bytes_sent < 20_000  # type: ignore[attr-defined]
        assert any(isinstance(each, CutterError) and each.code == code for each in events.take_waiting())
        assert on.far.stored_bytes == 0
        await on.cutter.cut(SQUARE)


async def test_an_error_that_ruins_nothing_is_a_warning() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        await asyncio.sleep(0.3)
        on.fail(12)
        result = await cut
        assert any("error 12" in each for each in result.warnings)


async def test_an_error_from_before_the_job_is_none_of_its_own() -> None:
    async with bench() as on:
        on.fail(16)
        result = await on.cutter.cut(SQUARE)
        assert any("error 16" in each for each in result.warnings)


async def test_what_the_cutter_has_not_understood_ruins_the_job() -> None:
    async with bench() as on:
        error = await ending(on.cutter.cut("PU10,10;PD1;PD20,20;PU;", check=False))
        assert isinstance(error, DriveFaultError)
        assert error.code == 2
        assert "OE" in str(error)


async def test_an_error_of_the_language_from_before_the_job_is_none_of_its_own() -> None:
    async with bench() as on:
        await ending(on.cutter.cut("ZZ;", check=False))
        assert (await on.cutter.cut(SQUARE)).warnings == ()


# In doubt -------------------------------------------------------------------------------------------------------------


async def test_a_lost_line_ends_the_job_which_is_never_resumed_and_no_other_is_begun_before_reconcile() -> None:
    job = job_of(6000)
    async with bench() as on:
        cut = on.cutter.cut(job)
        await asyncio.sleep(3)
        on.lose_line()
        error = await ending(cut)
        assert isinstance(error, MoveInDoubtError)
        sent = error.job.bytes_sent  # type: ignore[attr-defined]
        assert 0 < sent < len(job)
        with pytest.raises(MoveInDoubtError, match="reconcile"):
            on.cutter.cut(SQUARE)
        await until(lambda: on.cutter.is_open)
        with pytest.raises(MoveInDoubtError, match="still has data"):
            await on.cutter.reconcile()
        await until(lambda: on.far.is_idle)
        made = vectors(on.far)
        assert made == expected_vectors(job)[: len(made)]
        assert len(made) <= job[:sent].count(";")
        assert (await on.cutter.reconcile()).buffer_is_empty
        assert on.cutter.in_doubt is None
        on.far.new_sheet()
        await on.cutter.cut(SQUARE)


async def test_a_lost_line_may_be_stopped_as_well() -> None:
    async with bench() as on:
        cut = on.cutter.cut(ENDLESS)
        await asyncio.sleep(3)
        on.lose_line()
        await ending(cut)
        await on.cutter.stop()
        assert on.cutter.in_doubt is None
        await on.cutter.cut(SQUARE)


@pytest.mark.parametrize("handshake", ["software", "xonxoff", "enq1", "enq2"])
@pytest.mark.parametrize("off_s", [0.0, 0.5, 12.0])
async def test_a_power_cycle_is_never_told_as_cut(handshake: Handshake, off_s: float) -> None:
    async with bench() as on:
        events = on.cutter.events()
        cut = on.cutter.cut(job_of(6000), handshake=handshake)
        await asyncio.sleep(3)
        on.far.power_off()
        await asyncio.sleep(off_s)
        on.far.power_on()
        error = await ending(cut)
        assert isinstance(error, MoveInDoubtError)
        assert "switched off and on" in str(error)
        assert any(isinstance(each, CutterReset) for each in events.take_waiting())
        await until(lambda: on.far.is_idle)
        await on.cutter.reconcile()
        on.far.new_sheet()
        await on.cutter.cut(SQUARE, handshake=handshake)
        assert [each for each in vectors(on.far) if each[4]] == [e for e in expected_vectors(SQUARE) if e[4]]


async def test_a_cutter_that_goes_silent_for_good_ends_the_job_in_bounded_time() -> None:
    async with bench(fails_to_close=True) as on:
        cut = on.cutter.cut(job_of(6000))
        await asyncio.sleep(3)
        on.far.power_off()
        started = now()
        error = await ending(cut)
        assert isinstance(error, MoveInDoubtError)
        assert now() - started < 120


async def test_a_lost_answer_about_errors_leaves_the_job_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    async with bench() as on:
        real = on.cutter._line.error

        async def lossy(lane: Lane = Lane.READ) -> int:
            if on.far.cuttings.vectors.total > 3 and not lost:
                lost.append(True)
                on.far.trouble.replies_to_lose = 1
            return await real(lane)

        lost: list[bool] = []
        monkeypatch.setattr(on.cutter._line, "error", lossy)
        error = await ending(on.cutter.cut(SQUARE))
        assert isinstance(error, MoveInDoubtError)
        assert "ESC.E" in str(error)


async def test_where_nothing_behind_the_job_is_answered_it_is_not_told_as_cut() -> None:
    profile = replace(PNC_1610, mnemonics=PNC_1610.mnemonics - {"OA", "OE"})
    async with bench(profile=profile) as on:
        error = await ending(on.cutter.cut(SQUARE))
        assert isinstance(error, MoveInDoubtError)
        assert "not answered anything that stands behind it" in str(error)
    waits = replace(profile, size_waits_for_empty=True)
    async with bench(profile=waits) as on:
        assert (await on.cutter.cut(SQUARE)).proved_by == ".L"


async def test_a_job_is_not_told_as_cut_while_its_last_vector_is_made() -> None:
    for answers in ("parse", "motion"):
        async with bench(o_answers=answers, speed_cm_s=1.0) as on:
            await on.cutter.cut("PU0,0;PD2000,0;PU;")
            assert on.far.position() == (2000, 0, False)


async def test_an_answer_behind_the_job_that_is_lost_is_asked_for_again() -> None:
    for lost in (1, 2):
        async with bench(CutterSettings(baud_rate=9600, cutting_timeout_s=2)) as on:
            cut = on.cutter.cut(SQUARE)
            await until(lambda on=on: any(each.text == "OA" for each in on.far.log))  # type: ignore[misc]
            on.far.trouble.replies_to_lose = lost
            assert (await cut).proved_by == "OA"


async def test_an_answer_about_the_language_that_is_lost_leaves_the_job_in_doubt() -> None:
    async with bench(CutterSettings(baud_rate=9600, cutting_timeout_s=2)) as on:

        def lose(*_: Any) -> None:
            if any(each.text == "OE" for each in list(on.far.log)[-1:]):
                on.far.trouble.replies_to_lose = 1

        on.far.log.on_entry = lose
        error = await ending(on.cutter.cut(SQUARE))
        assert isinstance(error, MoveInDoubtError)
        assert "OE was not answered" in str(error)


async def test_a_machine_that_is_paused_at_the_very_end_is_waited_for() -> None:
    async with bench(CutterSettings(baud_rate=9600, cutting_timeout_s=2)) as on:
        cut = on.cutter.cut(SQUARE)
        await until(lambda: any(each.text == "OA" for each in on.far.log))
        on.far.press_pause()
        await asyncio.sleep(30)
        assert not cut.done()
        on.far.press_pause()
        assert (await cut).proved_by == "OA"


async def test_a_line_that_is_lost_at_the_very_end_leaves_the_job_in_doubt() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        await until(lambda: any(each.text == "OA" for each in on.far.log))
        on.lose_line()
        assert isinstance(await ending(cut), MoveInDoubtError)


async def test_an_error_of_the_language_that_ruins_nothing_is_a_warning() -> None:
    async with bench() as on:

        def err(*_: Any) -> None:
            if any(each.text == "OE" for each in list(on.far.log)[-1:]):
                on.far._machine.data_error = 5

        on.far.log.on_entry = err
        result = await on.cutter.cut(SQUARE)
        assert any("error 5 of OE" in each for each in result.warnings)


async def test_a_paused_job_that_is_paused_before_it_began_waits() -> None:
    async with bench() as on:
        cut = on.cutter.cut(SQUARE)
        await cut.pause()
        await asyncio.sleep(10)
        assert not vectors(on.far)
        await cut.resume()
        await cut


async def test_the_account_says_what_was_sent_and_taken_and_where_that_stands_in_the_job() -> None:
    job = "IN;PA;\n" + "\n".join(f"PD{100 * each},0;" for each in range(1, 300)) + "\nPU;"
    async with bench() as on:
        cut = on.cutter.cut(job)
        await asyncio.sleep(3)
        await cut.abort()
        error = await ending(cut)
        account = error.job  # type: ignore[attr-defined]
        assert account == cut.account
        assert account.bytes_total == len(job)
        assert account.instructions_sent == account.line + 1
        assert account.column == 1
        assert job[account.offset :].startswith(f"PD{account.position_steps[0]:.0f},0;")
        assert 0 < account.instructions_taken <= account.instructions_sent
        assert len(vectors(on.far)) >= account.instructions_taken - 4
        assert f"{account.instructions_sent} instructions" in str(error)


async def test_an_account_of_nothing_says_so() -> None:
    async with bench() as on:
        on.far.press_pause()
        cut = on.cutter.cut(SQUARE)
        await asyncio.sleep(1)
        await cut.abort()
        error = await ending(cut)
        assert "nothing of the job was sent" in str(error)
        on.far.press_pause()


# A naive sender -------------------------------------------------------------------------------------------------------


async def test_a_naive_sender_overflows_the_same_cutter() -> None:
    job = job_of(6000)
    async with bench() as on:
        served_by = on.far.served_by
        assert served_by is not None
        on.far.receive(job.encode(), served_by.time())
        served_by.changed()
        await until(lambda: on.far.lost_bytes > 1000)
        assert vectors(on.far) != expected_vectors(job)
        assert "16" in codes(on.far)


@pytest.mark.parametrize("handshake", HANDSHAKES)
async def test_a_fast_cutter_keeps_the_wire_busy(handshake: Handshake) -> None:
    job = job_of(20_000)
    async with bench(time_factor=FAST) as on:
        sent_before, started = on.cutter.stats.bytes_sent, now()
        await on.cutter.cut(job, handshake=handshake, check=False)
        wire_s = (on.cutter.stats.bytes_sent - sent_before) * 10 / 9600
        assert wire_s / (now() - started) >= 0.97
        assert vectors(on.far) == expected_vectors(job)


async def test_a_failed_abort_is_logged_and_told(caplog: pytest.LogCaptureFixture) -> None:
    settings = CutterSettings(baud_rate=9600, stop_timeout_s=3)
    async with bench(settings, fails_to_close=True) as on:
        cut = on.cutter.cut(ENDLESS)
        await asyncio.sleep(2)
        on.far.power_off()
        with caplog.at_level(logging.WARNING, "compax_aio.camm1"), pytest.raises(CompaxError):
            await cut.abort()
        error = await ending(cut)
        assert isinstance(error, MoveInDoubtError)
        assert "not shown that it stopped" in str(error)
        assert "not confirmed" in caplog.text
