"""The link after a time-out: back in step by a marker, late answers told apart, everybody told in bounded time."""

from __future__ import annotations

import asyncio
import itertools
from random import Random

import pytest
from tests.fakes.answers import PROMPT, answer_to, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.fakes.transports import DeafTransport
from tests.link.lines import Line, connected, elapsed, unique_name

from compax_aio.compax.protocol import Acknowledged, Answered, PositionReached, Rejected, Stray, UnexpectedAnswer
from compax_aio.errors import AnswerTimeoutError, CompaxError, ConnectionLostError, UnexpectedAnswerError
from compax_aio.link.contract import Lane, TurnOver
from compax_aio.transports.loopback import listen

ANSWER_TIMEOUT_S = 1.0
RESYNC_ATTEMPTS = 3
LONGEST_S = ANSWER_TIMEOUT_S * (1 + 2 * RESYNC_ATTEMPTS) + 0.01
"""The exchange in flight, and a stop ahead of every marker."""


def silent(_: str) -> None:
    return None


def silent_about(*texts: str) -> ScriptedFarEnd:
    return ScriptedFarEnd(lambda text: None if text in texts else as_drive(text))


async def outcomes_of(*waiters: asyncio.Future[TurnOver]) -> tuple[list[TurnOver | BaseException], float]:
    """Return all outcomes, and how many seconds the last of them took."""
    loop = asyncio.get_running_loop()
    before = loop.time()
    outcomes = await asyncio.gather(*waiters, return_exceptions=True)
    return list(outcomes), loop.time() - before


# Time-outs ------------------------------------------------------------------------------------------------------------


async def test_an_unanswered_read_fails_after_its_time_and_says_what_was_sent() -> None:
    line = await connected(silent_about("S1"))
    error, took_s = await elapsed(line.ask("S1"))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(ANSWER_TIMEOUT_S)
    assert (error.device, error.sent, error.received) == ("x", "S1", None)
    assert error.hint
    assert [entry.partition(" ")[2] for entry in error.exchanges][-1] == "→ S1␍"
    assert line.link.stats.timeouts == 1


async def test_what_came_of_an_answer_is_in_the_error() -> None:
    line = await connected(ScriptedFarEnd())
    line.far.script = lambda text: b"S001: 12." if text == "S1" else as_drive(text)
    error, _ = await elapsed(line.ask("S1"))
    assert isinstance(error, AnswerTimeoutError)
    assert error.received == "S001: 12."


async def test_after_a_time_out_a_marker_is_answered_before_anything_else_is_sent() -> None:
    line = await connected(silent_about("S1"))
    outcomes = await asyncio.gather(
        *(line.ask(text, lane) for text, lane in (("S1", Lane.READ), ("PA1", Lane.MOTION), ("SD5", Lane.CONTROL))),
        return_exceptions=True,
    )
    assert isinstance(outcomes[0], AnswerTimeoutError)
    assert outcomes[1:] == [Acknowledged(), Acknowledged()]
    assert line.far.lines[0] == "S1"
    assert line.far.lines[1] in {"S16", "S30"}
    assert line.far.lines[2:] == ["SD5", "PA1"]


async def test_a_read_is_not_repeated_by_itself() -> None:
    line = await connected(silent_about("S1", "PA1"))
    await asyncio.gather(line.ask("S1"), line.ask("PA1", Lane.MOTION), return_exceptions=True)
    await asyncio.sleep(60)
    assert line.far.lines.count("S1") == 1
    assert line.far.lines.count("PA1") == 1, "P2"


async def test_the_line_stays_in_doubt_for_nobody_and_is_quiet() -> None:
    line = await connected()
    line.far.script = silent
    line.ask("S1")
    await asyncio.sleep(10)
    sent = len(line.far.lines)
    assert sent == 1 + RESYNC_ATTEMPTS
    await asyncio.sleep(1000)
    assert len(line.far.lines) == sent


def late_line() -> ScriptedFarEnd:
    """A drive that takes 2.5 s for S1 and for PA100, and no time for anything else."""
    far = ScriptedFarEnd()

    def script(text: str) -> bytes:
        far.delay_s = 2.5 if text in {"S1", "PA100"} else 0.0
        return as_drive(text)

    far.script = script
    return far


async def test_a_late_answer_is_dropped_and_shifts_nothing() -> None:
    line = await connected(late_line())
    outcomes = await asyncio.gather(*(line.ask(f"S{number}") for number in (1, 2, 3, 4)), return_exceptions=True)
    assert isinstance(outcomes[0], AnswerTimeoutError)
    assert outcomes[1:] == [Answered(f"S00{number}: {number}") for number in (2, 3, 4)]
    assert line.link.stats.late_answers >= 1
    assert not any(isinstance(event, Stray) for event in line.events)


async def test_a_late_answer_is_not_given_to_the_same_question_asked_again() -> None:
    far = ScriptedFarEnd()
    serials = itertools.count(1)
    delays = iter([2.5])

    def script(text: str) -> bytes:
        far.delay_s = next(delays, 0.0) if text == "S1" else 0.0
        return answer_to(text, next(serials)) if text[0] == "S" else PROMPT

    line = await connected(far)
    serials = itertools.count(1)
    far.script = script
    first = line.ask("S1")
    await asyncio.sleep(0.1)
    again = line.ask("S1")
    assert isinstance((await elapsed(first))[0], AnswerTimeoutError)
    outcome = await again
    assert isinstance(outcome, Answered)
    asked_again = [place for place, text in enumerate(line.far.lines) if text == "S1"][1]
    assert outcome.text == f"S001: {asked_again + 1}"


async def test_a_late_acknowledgement_reaches_who_waits_for_it() -> None:
    line = await connected(late_line())
    waiter = line.link.exchange("PA100", Lane.MOTION, settles_late=True)
    outcome, took_s = await elapsed(waiter)
    assert outcome == Acknowledged()
    assert took_s == pytest.approx(2.5)
    assert line.far.lines.count("PA100") == 1


async def test_who_waits_for_a_late_outcome_is_told_when_the_doubt_is_over() -> None:
    line = await connected(silent_about("PA100"))
    line.far.delay_s = 0.2
    error, took_s = await elapsed(line.link.exchange("PA100", Lane.MOTION, settles_late=True))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(1.2)


async def test_a_message_while_in_doubt_is_handed_on() -> None:
    line = await connected(silent_about("S1"))
    waiter = line.ask("S1")
    await asyncio.sleep(0.5)
    line.far.say(b"$\r\n>")
    await asyncio.gather(waiter, return_exceptions=True)
    assert line.events == [PositionReached()]


async def test_an_unexpected_text_is_followed_by_a_marker() -> None:
    far = ScriptedFarEnd()
    line = await connected(far)
    far.script = lambda text: b"WHAT" + PROMPT if text == "SD5" else as_drive(text)
    waiters = [line.ask("SD5", Lane.CONTROL), line.ask("S1")]
    assert [await each for each in waiters] == [UnexpectedAnswer("WHAT"), Answered("S001: 1")]
    assert len(line.far.lines) == 3


async def test_half_a_line_in_the_drives_buffer_costs_one_marker() -> None:
    """Another host, or the last program, left ``PA1``; the first marker completes it to a line that is refused."""
    far = ScriptedFarEnd()
    remainder = ["PA1"]
    far.script = lambda text: b"E90" + PROMPT if remainder and remainder.pop() else as_drive(text)
    line = Line(far)
    line.connect()
    assert await line.answer("S1") == "S001: 1"
    assert len(far.lines) == 3


@pytest.mark.parametrize("seed", range(30))
async def test_answers_late_and_lost_are_never_given_to_another_question(seed: int) -> None:
    """Torture (P3, P4): every answer has a serial number; a third of them are late, some are lost."""
    random = Random(seed)
    far = ScriptedFarEnd()
    sent: list[str] = []

    def script(text: str) -> bytes | None:
        sent.append(text)
        far.delay_s = random.choice([0, 0, 0.3, 0.9, 1.2, 2.7])
        if random.random() < 0.1:
            return None
        return answer_to(text, len(sent) - 1) if text[0] == "S" and text != "STOP" else PROMPT

    line = await connected(far)
    far.script = script

    failures: list[tuple[str, str | None]] = []

    async def caller(number: int) -> None:
        for _ in range(8):
            text, lane = random.choice(
                [(f"S{number}", Lane.READ), ("S16", Lane.CONTROL), ("PA1", Lane.MOTION), ("STOP", Lane.STOP)]
            )
            before = len(sent)
            waiter = line.link.exchange(text, lane, settles_late=random.random() < 0.5)
            try:
                outcome = await asyncio.wait_for(waiter, random.choice([0.5, 60, 60, 60]))
            except TimeoutError:
                continue
            except CompaxError as error:
                failures.append((text, error.sent))
                continue
            if isinstance(outcome, Answered):
                serial = int(outcome.text.partition(":")[2])
                assert sent[serial] == text, f"replay: seed {seed}"
                assert serial >= before, f"replay: seed {seed}"
            else:
                assert outcome == Acknowledged()
                assert text in {"PA1", "STOP"}
            await asyncio.sleep(random.choice([0, 0.2, 2]))

    async with asyncio.timeout(8 * 4 * LONGEST_S * 4):
        await asyncio.gather(*(caller(number) for number in (1, 2, 3, 16)))
    assert all(asked == named for asked, named in failures)
    await line.link.close()


# Silence --------------------------------------------------------------------------------------------------------------


async def test_everything_queued_on_a_silent_line_fails_in_bounded_time() -> None:
    """P3: not one after the other, but together."""
    line = await connected()
    line.far.script = silent
    waiters = [line.ask(f"P{number}", lane) for number in range(1, 100) for lane in Lane]
    failures, took_s = await outcomes_of(*waiters)
    assert took_s <= LONGEST_S
    assert len(failures) == len(waiters)
    assert {failure.sent for failure in failures if isinstance(failure, AnswerTimeoutError)} == {
        f"P{number}" for number in range(1, 100)
    }
    assert sum(not text.startswith("S") for text in line.far.lines) == 1 + RESYNC_ATTEMPTS


@pytest.mark.parametrize("settles_late", [True, False])
async def test_one_exchange_on_a_silent_line_fails_in_bounded_time(settles_late: bool) -> None:
    line = await connected()
    line.far.script = silent
    error, took_s = await elapsed(line.link.exchange("PA1", Lane.MOTION, settles_late=settles_late))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s <= LONGEST_S


async def test_a_line_that_comes_back_is_used_again() -> None:
    line = await connected()
    line.far.script = silent
    await asyncio.gather(*(line.ask(f"S{number}") for number in range(1, 5)), return_exceptions=True)
    line.far.script = as_drive
    outcome, took_s = await elapsed(line.ask("S1"))
    assert outcome == Answered("S001: 1")
    assert took_s < 0.1


async def test_a_line_that_hands_over_all_its_late_answers_at_once_is_in_step_at_once() -> None:
    line = await connected()
    held: list[str] = []
    line.far.script = held.append
    for _ in range(5):
        await asyncio.gather(line.ask("S2"), return_exceptions=True)
    line.far.script = as_drive
    line.far.say(b"".join(as_drive(text) for text in held))
    assert await line.answer("S2") == "S002: 2"
    assert await line.answer("S16") == "S016: 16"


async def test_each_question_to_a_silent_line_fails_by_itself() -> None:
    line = await connected()
    line.far.script = silent
    for _ in range(3):
        error, took_s = await elapsed(line.ask("S1"))
        assert isinstance(error, AnswerTimeoutError)
        assert took_s <= LONGEST_S
        assert len(error.exchanges) <= 24


async def test_a_flood_does_not_put_off_a_time_out() -> None:
    line = await connected()
    line.far.script = silent
    loop = asyncio.get_running_loop()

    async def flood() -> None:
        while True:
            line.far.say(b"\x55" * 100)
            await asyncio.sleep(0.001)

    flooding = loop.create_task(flood())
    error, took_s = await elapsed(asyncio.wait_for(line.ask("S1"), 30))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(ANSWER_TIMEOUT_S, abs=0.01)
    async with asyncio.timeout(30):
        failures, took_s = await outcomes_of(line.ask("S2"), line.ask("S3"))
    assert took_s <= LONGEST_S
    assert all(isinstance(failure, AnswerTimeoutError) for failure in failures)
    flooding.cancel()
    line.far.script = as_drive
    line.far.say(PROMPT)
    assert await line.answer("S1") == "S001: 1"


async def test_a_drive_that_is_refusing_every_marker_fails_the_queue() -> None:
    line = await connected()
    line.far.script = lambda text: b"HUH" + PROMPT if text == "SD5" else b"E90" + PROMPT
    outcomes, took_s = await outcomes_of(line.ask("SD5", Lane.CONTROL), line.ask("S1"))
    assert outcomes[0] == UnexpectedAnswer("HUH")
    assert isinstance(outcomes[1], AnswerTimeoutError)
    assert took_s <= LONGEST_S


# Stop in doubt --------------------------------------------------------------------------------------------------------


async def test_a_stop_goes_ahead_of_the_marker_once_and_follows_in_step() -> None:
    line = await connected(silent_about("S1"))
    read = line.ask("S1")
    stop = line.ask("STOP", Lane.STOP)
    assert isinstance((await elapsed(read))[0], AnswerTimeoutError)
    assert await stop == Acknowledged()
    assert line.far.lines[:2] == ["S1", "STOP"]
    assert line.far.times[1] == pytest.approx(line.far.times[0] + ANSWER_TIMEOUT_S)
    assert line.far.lines[2] in {"S16", "S30"}
    assert line.far.lines[3:] == ["STOP"]


async def test_a_stop_that_nobody_wants_any_more_does_not_go_ahead() -> None:
    line = await connected(silent_about("S1"))
    read = line.ask("S1")
    line.ask("STOP", Lane.STOP).cancel()
    await asyncio.gather(read, return_exceptions=True)
    await line.answer("S2")
    assert "STOP" not in line.far.lines


async def test_a_stop_on_a_silent_line_is_written_and_fails_in_bounded_time() -> None:
    line = await connected()
    line.far.script = silent
    read = line.ask("S1")
    stop, took_s = await elapsed(line.ask("STOP", Lane.STOP))
    assert isinstance(stop, AnswerTimeoutError)
    assert took_s <= LONGEST_S
    assert line.far.lines.count("STOP") == RESYNC_ATTEMPTS
    await asyncio.gather(read, return_exceptions=True)


async def test_a_stop_on_a_line_that_was_given_up_is_written_before_any_marker() -> None:
    line = await connected()
    line.far.script = silent
    await asyncio.gather(line.ask("S1"), return_exceptions=True)
    await asyncio.sleep(10)
    line.far.lines.clear()
    stop = line.ask("STOP", Lane.STOP)
    await asyncio.sleep(0.01)
    assert line.far.lines == ["STOP"]
    await asyncio.gather(stop, return_exceptions=True)


async def test_a_late_refusal_of_the_motion_reaches_who_waits_for_it() -> None:
    """With nothing else unanswered, an error can only be its own."""
    line = await connected()
    line.far.script = silent
    waiter = line.link.exchange("SD5", Lane.CONTROL, settles_late=True)
    await asyncio.sleep(0.5)
    line.far.say(b"E90" + PROMPT)
    assert await waiter == Rejected(90, "E90")


# Closing --------------------------------------------------------------------------------------------------------------


async def test_closing_is_over_in_a_second_though_the_transport_is_slow() -> None:
    line = Line(ScriptedFarEnd())
    transport = DeafTransport(line.link, lost_after_s=0.9)
    _, took_s = await elapsed(line.link.close())
    assert took_s <= 1.0
    assert transport.calls[0] == "close"
    assert "abort" in transport.calls


async def test_closing_gives_the_transport_half_a_second_to_drain() -> None:
    line = Line(ScriptedFarEnd())
    transport = DeafTransport(line.link, lost_after_s=0.4)
    await line.link.close()
    assert transport.calls == ["close"]


async def test_a_cancelled_closing_hangs_up_at_once() -> None:
    line = Line(ScriptedFarEnd())
    transport = DeafTransport(line.link, lost_after_s=0.4)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.1):
            await line.link.close()
    assert transport.calls == ["close", "abort"]


async def test_an_exchange_after_closing_has_begun_is_refused() -> None:
    line = Line(ScriptedFarEnd())
    DeafTransport(line.link, lost_after_s=0.4)
    closing = asyncio.ensure_future(line.link.close())
    await asyncio.sleep(0.1)
    with pytest.raises(ConnectionLostError):
        await line.ask("PA1", Lane.MOTION)
    await closing


async def test_a_far_end_that_answers_markers_with_errors_and_text_is_given_up() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(lambda _: b"E12\r\n>unknown command\r\n>", delay_s=0.05))
    with await listen(name, lambda: line.far), pytest.raises(AnswerTimeoutError):
        await line.link.open(f"loop://{name}")
    assert len(line.far.lines) == RESYNC_ATTEMPTS


async def test_an_error_says_what_came_before_the_markers() -> None:
    line = await connected(ScriptedFarEnd(lambda text: None if text == "PA100" else as_drive(text)))
    error, _ = await elapsed(line.link.exchange("PA100", Lane.MOTION, settles_late=True))
    assert isinstance(error, AnswerTimeoutError)
    assert error.received is None


async def test_a_stop_in_doubt_is_written_before_every_marker() -> None:
    line = await connected()
    line.far.script = silent
    line.ask("S1")
    stop, _ = await elapsed(line.ask("STOP", Lane.STOP))
    assert isinstance(stop, AnswerTimeoutError)
    after = line.far.lines[1:]
    assert after[0::2] == ["STOP"] * RESYNC_ATTEMPTS
    assert all(marker.startswith("S") and marker != "STOP" for marker in after[1::2])


# A line that never stays in step --------------------------------------------------------------------------------------


def twice(text: str) -> bytes | None:
    """Answer as two drives on one line would, or an adapter that doubles what it receives."""
    answer = as_drive(text)
    return answer and answer * 2


async def test_who_asks_on_a_line_where_everything_comes_twice_is_told_in_bounded_time() -> None:
    line = await connected(ScriptedFarEnd())
    line.far.script = twice
    before = len(line.far.lines)
    error, took_s = await elapsed(line.ask("S1"))
    later, _ = await elapsed(line.ask("S1"))
    assert not isinstance(error, CompaxError)  # the first of the two is the answer, and nothing was in doubt before
    assert isinstance(later, UnexpectedAnswerError)
    assert later.hint
    assert "two devices" in later.hint
    assert took_s < LONGEST_S
    assert len(line.far.lines) - before < 30


async def test_a_line_where_everything_comes_twice_is_not_asked_for_ever_while_nobody_waits() -> None:
    line = await connected(ScriptedFarEnd())
    line.far.script = twice
    await elapsed(line.ask("S1"))
    before = len(line.far.lines)
    await asyncio.sleep(100)
    assert len(line.far.lines) - before < 30


async def test_a_line_that_stays_in_step_again_is_used_again() -> None:
    line = await connected(ScriptedFarEnd())
    line.far.script = twice
    await elapsed(line.ask("S1"))
    await elapsed(line.ask("S1"))
    line.far.script = as_drive
    answer, _ = await elapsed(line.ask("S1"))
    assert isinstance(answer, Answered)
