"""What a line with axes makes of its exchanges: checked answers, one more attempt where it is allowed, and errors."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest
from tests.smc.bench import Cable, bench, commands, ending, now

from compax_aio.errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    UnexpectedAnswerError,
)
from compax_aio.link.contract import Lane
from compax_aio.simulator.smc import SimulatedPartyLine
from compax_aio.smc.line import SmcLine
from compax_aio.smc.profile import DCB_274, Profile
from compax_aio.smc.protocol_events import Answered, CutShort, EntryFailed, Unreadable
from compax_aio.smc.settings import SmcSettings

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@asynccontextmanager
async def lined(**knobs: object) -> AsyncIterator[tuple[SmcLine, SimulatedPartyLine, Cable]]:
    """Give what is under a line with axes, its far end, and the cable."""
    async with bench(fails_to_close=True, **knobs) as (line, far, cable):  # type: ignore[arg-type]
        cable.typed.clear()
        far.log.clear()
        yield line._line, far, cable


def story(error: CompaxError) -> str:
    """Write an error as a person reads it, with the last exchanges."""
    return f"{error}\n" + "\n".join(error.exchanges)


# One more attempt ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", range(2))
@pytest.mark.parametrize("fault", ["lost", "wrong"])
async def test_a_question_that_was_not_heard_whole_is_asked_once_more(place: int, fault: str) -> None:
    async with lined(axes="AB", position=700) as (line, far, cable):
        lose = far.lose_next_echo if fault == "lost" else far.garble_next_echo
        cable.at("BZ"[: place + 1], lambda: lose("B"))
        assert await line.position("B") == 700
        # A line feed clears the buffer, and so ends what was typed before.
        assert bytes(cable.typed).count(b"BZ\n") == 1 + place


@pytest.mark.parametrize("place", range(4))
async def test_what_is_told_and_was_not_heard_whole_is_told_once_more(place: int) -> None:
    async with lined() as (line, far, cable):
        cable.at("AV77"[: place + 1], lambda: far.lose_next_echo("A"))
        await line.tell("A", "V77")
        assert far.axes["A"].parameters.slew_speed == 77
        assert commands(far).count("V77") == 1 + (place == 3)


@pytest.mark.parametrize("method", ["ask", "tell"])
async def test_there_is_no_third_attempt(method: str) -> None:
    async with lined(axes="AB") as (line, far, cable):
        text = "Z" if method == "ask" else "V77"
        cable.at("B", lambda: far.lose_next_echo("B"), times=100)
        error = await ending(getattr(line, method)("B", text))
        assert isinstance(error, AnswerTimeoutError)
        assert bytes(cable.typed).count(b"B") - bytes(cable.typed).count(b"\nB\n") <= 2 + 2
        assert error.sent == f"B{text}"
        assert f"bus axis B: no echo of character 1 of 'B{text}', 'B', within 0.25 s" in str(error)
        assert "is there an axis of that name, and is it switched on?" in str(error)


async def test_what_is_to_be_sent_at_most_once_is_not_sent_again() -> None:
    async with lined() as (line, far, cable):
        cable.at("AR500", lambda: far.garble_next_echo("A"))
        outcome = await line.start("A", "R500", Lane.MOTION)
        assert isinstance(outcome, EntryFailed)
        assert bytes(cable.typed) == b"AR500"
        error = line.refusal("A", "R500", outcome)
        assert isinstance(error, UnexpectedAnswerError)
        assert "a wrong echo of character 5 of 'AR500', '0'" in str(error)
        assert "the line was cleared, and the command not sent again" in str(error)


async def test_a_question_whose_answer_does_not_come_is_not_asked_again_by_itself() -> None:
    async with lined(axes="AB") as (line, far, cable):
        far.delay_next_answer("A", 3.0)
        error = await ending(line.ask("A", "Z"))
        assert isinstance(error, AnswerTimeoutError)
        assert "no answer within 2 s" in str(error)
        assert bytes(cable.typed).count(b"AZ\n") == 1


async def test_who_tells_is_told_of_a_time_out_when_the_line_is_in_step_again() -> None:
    async with lined(axes="AB") as (line, far, _):
        far.delay_next_answer("A", 3.0)
        begun_at = now()
        assert isinstance(await ending(line.start("A", "V500", Lane.CONTROL)), AnswerTimeoutError)
        assert now() - begun_at > 2.0
        assert not line.protocol.in_doubt


async def test_an_answer_that_is_late_is_nobodys() -> None:
    async with lined(axes="AB", position=500) as (line, far, _):
        far.delay_next_answer("A", 2.2)
        first = asyncio.ensure_future(line.position("A"))
        others = [asyncio.ensure_future(line.status("B")) for _ in range(3)]
        assert isinstance(await ending(first), AnswerTimeoutError)
        assert [(await each).raw for each in others] == [0, 0, 0]
        assert await line.position("A") == 500


async def test_who_has_answered_can_be_asked_when_the_line_gets_in_step_and_nobody_else() -> None:
    async with lined(axes="ABC", connects="A") as (line, _, _):
        assert line.protocol.names == ["A"]
        assert isinstance(await ending(line.position("Z")), AnswerTimeoutError)
        for axis in "BAB":
            await line.position(axis)
        await line.tell("C", "V500")
        assert line.protocol.names == ["A", "B"]
    async with lined(mode="single") as (line, _, _):
        await line.position("")
        assert line.protocol.names == []


# Errors --------------------------------------------------------------------------------------------------------------


async def test_an_error_of_a_missing_echo_has_its_story() -> None:
    async with lined() as (line, far, cable):
        cable.at("AV5", lambda: far.lose_next_echo("A"), times=2)
        error = await ending(line.tell("A", "V500"))
        assert error.device == "bus axis A"
        assert error.sent == "AV500"
        assert "no echo of character 3 of 'AV500', '5', within 0.25 s" in str(error)
        assert any("→ ␊A" in each or "→ AV5" in each for each in error.exchanges), story(error)


async def test_an_error_of_a_wrong_echo_says_what_came() -> None:
    async with lined() as (line, far, cable):
        cable.at("A^", lambda: far.garble_next_echo("A"), times=2)
        error = await ending(line.ask("A", "^"))
        assert isinstance(error, UnexpectedAnswerError)
        assert "a wrong echo of character 2 of 'A^', '^'" in str(error)
        assert error.received
        assert error.received != "^"


@pytest.mark.parametrize("unknown", ["?", "#"])
async def test_an_axis_that_does_not_understand_refuses(unknown: str) -> None:
    async with lined(unknown=unknown) as (line, _, _):
        line.settings = SmcSettings(profile=_refusing(unknown))
        for call in (line.tell("A", "N5"), line.ask("A", "N5")):
            error = await ending(call)
            assert isinstance(error, CommandRejectedError)
            assert error.received == unknown
            assert error.sent == "AN5"
            assert "is its value in range" in str(error)


def _refusing(text: str) -> Profile:
    return replace(DCB_274, refusals=frozenset({text}))


async def test_an_answer_that_is_no_number_is_told_with_its_axis() -> None:
    async with lined(axes="AB") as (line, far, cable):
        cable.at("BZ\n", lambda: far.inject(b"nonsense"))
        error = await ending(line.position("B"))
        assert isinstance(error, UnexpectedAnswerError)
        assert (error.device, error.sent) == ("bus axis B", "BZ")
        assert error.exchanges
        assert "nonsense" in str(error)
        assert await line.position("B") == 0


@pytest.mark.parametrize(
    ("outcome", "kind", "text"),
    [
        (Answered("5"), UnexpectedAnswerError, "that is no answer to what was sent"),
        (Answered("?"), CommandRejectedError, "the axis did not understand it"),
        (Unreadable("AV5", "xyz"), UnexpectedAnswerError, "that is no answer to what was sent"),
        (CutShort("AV5", "\x1b", was_complete=True), UnexpectedAnswerError, "ESC was sent while it was under way"),
        (CutShort("AV5", "\x03", was_complete=False), UnexpectedAnswerError, "^C was sent while it was under way"),
        (EntryFailed("AV5", 1, "", was_begun=True), AnswerTimeoutError, "no echo of character 2 of 'AV5', 'V'"),
        (EntryFailed("AV5", 0, "x", was_begun=False), UnexpectedAnswerError, "a wrong echo of character 1 of 'AV5'"),
    ],
)
async def test_every_outcome_that_is_no_success_is_an_error_that_says_so(
    outcome: Answered, kind: type[CompaxError], text: str
) -> None:
    async with lined() as (line, _, _):
        error = line.refusal("A", "V5", outcome)
        assert type(error) is kind
        assert text in str(error)
        assert (error.device, error.sent) == ("bus axis A", "AV5")
        assert error.hint
        assert line.refusal("A", "V5", Answered("")) is None


async def test_nothing_for_an_answer_is_told_apart_from_something_else() -> None:
    async with lined() as (line, _, _):
        assert "that is no answer" in str(line.error_of("A", "Z", Answered("")))
        assert "nothing was answered" in str(line.error_of("A", "V5", CutLost()))


class CutLost(Answered):
    """An outcome of another kind, without a text."""

    def __init__(self) -> None:
        super().__init__("")


async def test_the_line_names_its_axes_for_people() -> None:
    async with lined() as (line, _, _):
        assert line.called("A") == "bus axis A"
        assert line.called("") == "bus"


# Lanes and loss ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "waits"),
    [
        (lambda line: line.ask("A", "Z"), True),
        (lambda line: line.ask("A", "Z", Lane.CONTROL), True),
        (lambda line: line.start("A", "@", Lane.STOP), True),
        (lambda line: line.ask("A", "Z", Lane.MOTION), False),
        (lambda line: line.tell("A", "V5"), False),
        (lambda line: line.start("A", "R5", Lane.MOTION), False),
    ],
    ids=["read", "look", "stop", "look before a motion", "setting", "motion"],
)
async def test_what_asks_or_stops_waits_for_a_lost_line_and_nothing_else(
    call: Callable[[SmcLine], asyncio.Future[object]], waits: bool
) -> None:
    async with lined() as (line, far, cable):
        cable.pull_and_plug(1.0)
        await asyncio.sleep(0.01)
        begun_at = now()
        if waits:
            await call(line)
            assert now() - begun_at > 0.5
        else:
            assert isinstance(await ending(call(line)), ConnectionLostError)
            assert now() == begun_at
            assert commands(far) == []


async def test_that_a_command_is_on_the_wire_is_told_when_it_is() -> None:
    async with lined() as (line, far, _):
        told: list[float] = []
        busy = line.start("A", "V500", Lane.CONTROL)
        motion = line.start("A", "R1", Lane.MOTION, lambda: told.append(now()))
        assert told == []
        await busy
        assert told == [now()]
        await motion
        assert commands(far) == ["V500", "R1"]


async def test_names_that_are_wrong_are_not_spoken_to_but_for_stops_and_looks() -> None:
    async with lined(axes="AB", mode="daisy") as (line, _, cable):
        line.wrong_names = "the chain has taken 'B', not 'AB'"
        for call in (line.ask("A", "Z"), line.ask("A", "Z", Lane.MOTION), line.tell("A", "V5")):
            error = await ending(call)
            assert isinstance(error, UnexpectedAnswerError)
            assert "the chain has taken 'B', not 'AB'" in str(error)
            assert "reset() deals them anew" in str(error)
        with pytest.raises(UnexpectedAnswerError):
            line.start("A", "R5", Lane.MOTION)
        assert bytes(cable.typed) == b""
        await line.start("A", "@", Lane.STOP)
        assert (await line.status("A", Lane.CONTROL)).raw == 0
