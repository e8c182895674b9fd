"""A cutter as callers hold it: connected and greeted, asked, stopped, reset, lost and found, closed."""

from __future__ import annotations

import asyncio
import logging
from dataclasses import replace
from typing import Any

import pytest
from tests.camm1.bench import HANDSHAKES, bench, ending, job_of, now, until, vectors

from compax_aio.camm1 import PROFILES, CutterSettings, Profile, connect
from compax_aio.camm1.events import ConnectionLost, ConnectionRestored, CutterReset, Stopped, UnexpectedText
from compax_aio.camm1.line import CutterLine, meaning_of
from compax_aio.camm1.profiles import HP_7475A, PNC_900, PNC_1610
from compax_aio.errors import (
    AnswerTimeoutError,
    ConnectionLostError,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    TransportError,
    UnexpectedAnswerError,
)
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def controls(on: Any) -> list[str]:
    return [each.text for each in on.far.log if each.kind is LogKind.CONTROL]


# Connecting -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))
async def test_every_model_is_greeted_and_cuts(profile: Profile) -> None:
    async with bench(profile=profile, model=profile.name) as on:
        assert on.cutter.is_open
        assert on.cutter.capacity_bytes is not None
        assert not {"11", "12", "13", "14"} & {each.text for each in on.far.log if each.kind is LogKind.IO_ERROR}
        result = await on.cutter.cut("IN;PU100,100;PD200,200;PU;")
        assert result.proved_by == "OA"
        assert vectors(on.far)[-1] == (100, 100, 200, 200, True)


async def test_connecting_resets_what_others_have_set_up_and_moves_nothing() -> None:
    async with bench(power_on_handshake="xonxoff") as on:
        assert "R" in controls(on)
        assert on.cutter.identity == "1610"
        assert not [each for each in on.far.log if each.kind is LogKind.INSTRUCTION]
        assert repr(on.cutter) == "<Cutter c PNC-1610 open>"
    assert repr(on.cutter) == "<Cutter c PNC-1610 closed>"


async def test_one_without_a_question_for_its_model_is_asked_in_its_own_language() -> None:
    async with bench(profile="pnc-900", model="PNC-900") as on:
        assert on.cutter.identity == "900"
        assert await on.cutter.identify() == "900"


async def test_another_machine_than_expected_is_refused_with_what_it_says() -> None:
    with pytest.raises(UnexpectedAnswerError, match="'1850', not '1610'") as raised:
        async with bench(answer_a="1850"):
            pass
    assert "profile" in str(raised.value)


async def test_a_model_that_tells_its_firmware_too_is_known_by_the_first_word() -> None:
    async with bench(answer_a="1610,2.5") as on:
        assert on.cutter.identity == "1610"


async def test_one_whose_replies_bear_no_sign_is_used_without_and_a_log_says_so(
    caplog: pytest.LogCaptureFixture,
) -> None:
    far = SimulatedCutter(Knobs(baudrate=9600))
    transmitter = far._inside.transmitter
    send = transmitter.send

    def plain(text: bytes, *more: Any, **options: Any) -> None:
        transmitter.format = replace(transmitter.format, initiator=b"")  # as one that ignores P6 of .M
        send(text, *more, **options)

    transmitter.send = plain  # type: ignore[method-assign]
    with caplog.at_level(logging.WARNING, "compax_aio.camm1"):
        async with bench(far=far) as on:
            assert not on.cutter._line.protocol.has_signs
            assert await on.cutter.free_space() == 1024
            far.trouble.replies_to_delay_s.append(2.03)
            assert isinstance(await ending(on.cutter.free_space()), AnswerTimeoutError)
            assert await on.cutter.error() == 0
            for handshake in HANDSHAKES:
                await on.cutter.cut("PU10,10;PD20,20;PU;" * 80, handshake=handshake)
    assert "no sign" in caplog.text


async def test_nobody_at_the_other_end_is_told_with_what_to_look_at() -> None:
    far_settings = CutterSettings(baud_rate=9600, answer_timeout_s=0.2, resync_attempts=2)
    async with bench() as on:
        on.far.power_off()
        on.listener.close()
    with pytest.raises(AnswerTimeoutError, match="baud rate"):
        async with bench(far_settings, far=on.far):
            pass


async def test_a_line_that_cannot_be_opened_is_told() -> None:
    with pytest.raises(TransportError):
        await connect("loop://nobody")


@pytest.mark.parametrize("wrong", [{"profile": 5}, {"profile": "PNC-1"}, {"settings": 5}])
async def test_what_is_no_profile_and_no_settings_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidCommandError):
        connect("loop://x", **wrong)


async def test_lost_and_damaged_answers_do_not_keep_it_from_being_greeted() -> None:
    connected = 0
    for seed in range(30):
        async with bench(lose_reply=0.1, garble_reply=0.1, seed=seed, fails_to_close=True) as on:
            connected += on.cutter.is_open
    assert connected == 30


async def test_the_errors_that_it_told_when_it_was_opened_are_kept() -> None:
    async with bench() as on:
        on.fail(16)
        on.lose_line()
        await until(lambda: not on.cutter.is_open)
        await until(lambda: on.cutter.is_open)
        assert on.cutter.errors_found == (16,)


# Asking ---------------------------------------------------------------------------------------------------------------


async def test_it_answers_what_it_is_asked() -> None:
    async with bench() as on:
        cutter = on.cutter
        assert await cutter.free_space() == 1024
        assert await cutter.buffer_size() == 1024
        assert await cutter.error() == 0
        on.fail(12)
        assert await cutter.error() == 12
        assert (await cutter.status()).buffer_is_empty
        assert await cutter.identify() == "1610"
        assert await cutter.output("oa;") == "0,0,0"
        assert cutter.settings.baud_rate == 9600
        assert cutter.stats.exchanges > 5


async def test_many_who_ask_at_once_are_all_answered() -> None:
    async with bench() as on:
        questions = [ask() for ask in (on.cutter.free_space, on.cutter.status, on.cutter.error) for _ in range(20)]
        answers = await asyncio.gather(*questions)
        assert answers[:20] == [1024] * 20
        assert answers[-20:] == [0] * 20


async def test_questions_are_answered_in_the_middle_of_a_job() -> None:
    async with bench() as on:
        cut = on.cutter.cut(job_of(6000))
        await asyncio.sleep(2)
        started = now()
        assert await on.cutter.free_space() < 1024
        assert not (await on.cutter.status()).buffer_is_empty
        assert now() - started < 2.5
        for refused in (on.cutter.error(), on.cutter.buffer_size(), on.cutter.output("OA"), on.cutter.identify()):
            with pytest.raises(MoveActiveError):
                await refused
        with pytest.raises(MoveActiveError):
            await on.cutter.reset()
        await cut


async def test_what_is_no_output_instruction_is_refused() -> None:
    async with bench() as on:
        for wrong in ("PU", "", 5, "OA;PD"):
            with pytest.raises(InvalidCommandError, match="OA"):
                await on.cutter.output(wrong)  # type: ignore[arg-type]


async def test_a_late_answer_is_not_taken_for_the_next_one() -> None:
    async with bench() as on:
        on.far.trouble.replies_to_delay_s.append(2.5)
        error = await ending(on.cutter.free_space())
        assert isinstance(error, AnswerTimeoutError)
        assert await on.cutter.error() == 0
        assert (await on.cutter.status()).number == 264
        assert await on.cutter.free_space() == 1024


async def test_an_output_instruction_that_a_paused_machine_does_not_answer_leaves_nothing_behind() -> None:
    async with bench(CutterSettings(baud_rate=9600, cutting_timeout_s=3)) as on:
        on.far.press_pause()
        assert isinstance(await ending(on.cutter.output("OE")), AnswerTimeoutError)
        on.far.press_pause()
        assert await on.cutter.free_space() == 1024
        assert await on.cutter.output("OE") == "0"


async def test_a_damaged_answer_is_asked_for_again() -> None:
    async with bench() as on:
        on.far.trouble.replies_to_lose = 0
        on.far.inject(b"~9")
        assert await on.cutter.free_space() == 1024


async def test_what_comes_unasked_is_told() -> None:
    async with bench() as on:
        events = on.cutter.events()
        on.far.inject(b"hello\r")
        await asyncio.sleep(0.1)
        (told,) = events.take_waiting()
        assert isinstance(told, UnexpectedText)
        assert told.text == "hello"
        assert on.cutter.stats.strays == 1


async def test_reset_is_taken_and_the_line_goes_on() -> None:
    async with bench() as on:
        before = controls(on).count("R")
        await on.cutter.reset()
        assert controls(on).count("R") == before + 1
        assert await on.cutter.free_space() == 1024


async def test_a_machine_that_was_switched_off_and_on_between_jobs_is_told_as_reset() -> None:
    async with bench() as on:
        events = on.cutter.events()
        on.far.power_cycle()
        assert await on.cutter.free_space() == 1024
        told = [each for each in events.take_waiting() if isinstance(each, CutterReset)]
        assert len(told) == 1
        assert told[0].as_mark().word == "reset"
        assert on.cutter.in_doubt is None
        await on.cutter.cut("PU10,10;PD20,20;PU;")


async def test_stop_tells_that_the_machine_stands() -> None:
    async with bench() as on:
        events = on.cutter.events()
        status = await on.cutter.stop()
        assert status.buffer_is_empty
        assert [type(each) for each in events.take_waiting()] == [Stopped]


# Lost and found -------------------------------------------------------------------------------------------------------


async def test_a_lost_line_comes_back_and_what_asks_waits_for_it() -> None:
    async with bench() as on:
        events = on.cutter.events()
        on.lose_line()
        await asyncio.sleep(0.01)
        assert not on.cutter.is_open
        assert await on.cutter.free_space() == 1024
        assert [type(each) for each in events.take_waiting()] == [ConnectionLost, ConnectionRestored]


async def test_a_line_that_is_not_to_be_opened_again_stays_lost() -> None:
    async with bench(CutterSettings(baud_rate=9600, reconnect=False)) as on:
        cut = on.cutter.cut(job_of(6000))
        await asyncio.sleep(2)
        on.lose_line()
        assert isinstance(await ending(cut), MoveInDoubtError)
        assert isinstance(await ending(on.cutter.free_space()), ConnectionLostError)
        assert isinstance(await ending(on.cutter.stop()), ConnectionLostError)


async def test_another_machine_on_a_line_that_came_back_is_not_used() -> None:
    async with bench(fails_to_close=True) as on:
        on.far._around.knobs = replace(on.far.knobs, answer_a="900")
        on.lose_line()
        await asyncio.sleep(5)
    assert not on.cutter.is_open


async def test_closing_twice_is_harmless_and_nothing_goes_afterwards() -> None:
    async with bench() as on:
        await on.cutter.close()
        await on.cutter.close()
        assert isinstance(await ending(on.cutter.status()), ConnectionLostError)
        assert [each async for each in on.cutter.events()] == []


async def test_nothing_in_doubt_reconcile_looks_all_the_same() -> None:
    async with bench() as on:
        assert (await on.cutter.reconcile()).buffer_is_empty


# Small things ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("url", "rate"),
    [
        ("serial:///dev/ttyUSB0", 960),
        ("serial:///dev/ttyUSB0?baudrate=4800&parity=E&bytesize=7&stopbits=2", 4800 / 11),
        ("sim://camm1?baudrate=19200", 1920),
        ("tcp://host:4001", None),
        ("serial:///dev/ttyUSB0?baudrate=x", None),
    ],
)
async def test_how_fast_a_line_is_its_url_says(url: str, rate: float | None) -> None:
    async with bench() as on:
        line: CutterLine = on.cutter._line
        line.settings = CutterSettings()
        assert line._bytes_per_s(url) == rate
        line.settings = CutterSettings(baud_rate=2400)
        assert line._bytes_per_s(url) == 240


@pytest.mark.parametrize(
    "wrong",
    [
        {"answer_timeout_s": 0},
        {"watch_s": float("nan")},
        {"turnaround_ms": 40_000},
        {"reserve_bytes": -1},
        {"baud_rate": 0},
        {"resync_attempts": 0},
        {"reconnect_attempts": 1.5},
        {"stall_timeout_s": True},
    ],
)
def test_settings_that_mean_nothing_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidCommandError):
        CutterSettings(**wrong)


def test_errors_are_told_in_words() -> None:
    assert meaning_of(16) == "error 16, the data buffer overflowed, bytes are lost"
    assert "no manual" in meaning_of(99)
    assert HP_7475A.name
    assert PNC_900.name != PNC_1610.name
