"""Another device at the far end: known by what it says, told at once; and no COMPAX is ever taken for one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.fakes.answers import PROMPT, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.link.lines import Line, elapsed, unique_name

from compax_aio.compax.facts.strangers import ECHO, STRANGERS
from compax_aio.compax.protocol import CompaxProtocol
from compax_aio.errors import AnswerTimeoutError, CommandRejectedError, ConnectionLostError, UnexpectedAnswerError
from compax_aio.link.contract import InStep, MarkerSpent
from compax_aio.transports.loopback import listen

COMPAX3 = "a Compax3"
ALL_MARKERS_S = 3.0


@asynccontextmanager
async def opening(far: ScriptedFarEnd) -> AsyncIterator[tuple[Line, BaseException | None, float]]:
    """Open a line to *far*; give the line, why it failed if it did, and how long it took."""
    name = unique_name()
    line = Line(far)
    with await listen(name, lambda: far):
        error, took_s = await elapsed(line.link.open(f"loop://{name}"))
        yield line, error, took_s
        await line.link.close()


def refusing(text: str) -> bytes:
    """Answer as a Compax3 to what it does not know."""
    return b"! 0005\r"


# Known at once --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("answer", [b"! 0005\r", b"!0005\r", b"! 00aF\r", b">\r", b"> \r"])
@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.3])
async def test_a_compax3_is_known_by_its_second_answer(answer: bytes, delay_s: float) -> None:
    async with opening(ScriptedFarEnd(lambda _: answer, delay_s=delay_s)) as (line, error, took_s):
        assert isinstance(error, UnexpectedAnswerError)
        assert COMPAX3 in str(error)
        assert "COMPAX-M" in (error.hint or "")
        assert error.device == "x"
        assert answer.decode()[:1] in (error.received or "")
        assert error.exchanges
        assert took_s == pytest.approx(2 * delay_s, abs=0.01)
        assert len(line.far.lines) == 2, "and no third question"
        assert len(set(line.far.lines)) == 2
        assert not line.link.is_open


async def test_a_compax3_that_echoes_is_known_too() -> None:
    async with opening(ScriptedFarEnd(lambda text: f"{text}\r! 0005\r".encode())) as (_, error, took_s):
        assert isinstance(error, UnexpectedAnswerError)
        assert COMPAX3 in str(error)
        assert took_s < 0.1


async def test_who_asks_a_compax3_on_a_line_that_nobody_opened_is_told_at_once_each_time() -> None:
    line = Line(ScriptedFarEnd(refusing))
    line.connect()
    for text in ("S1", "S2", "S3"):
        error, took_s = await elapsed(line.ask(text))
        assert isinstance(error, UnexpectedAnswerError)
        assert error.sent == text
        assert took_s < 0.1
    await line.link.close()


# Known when nothing better comes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "echo", [lambda text: text.encode() + b"\r", lambda text: text.encode() + b"\r\n"], ids=["CR", "CR LF"]
)
async def test_what_only_echoes_is_told_when_the_markers_time_is_over(echo: Callable[[str], bytes]) -> None:
    async with opening(ScriptedFarEnd(echo)) as (line, error, took_s):
        assert isinstance(error, UnexpectedAnswerError)
        assert ECHO.name in str(error)
        assert "loop-back" in (error.hint or "")
        assert took_s == pytest.approx(ALL_MARKERS_S)
        assert len(line.far.lines) == 3


@pytest.mark.parametrize(
    ("answer", "word"),
    [
        (b"\r\nbench login: ", "login"),
        (b"Password: ", "login"),
        (b"User name:", "login"),
        (b"\r\nERROR\r\n", "modem"),
        (b"\r\nOK\r\n", "modem"),
        (b"\r\nNO CARRIER\r\n", "modem"),
    ],
)
@pytest.mark.parametrize("echoes", [True, False])
async def test_a_login_and_a_modem_are_told_when_the_markers_time_is_over(
    answer: bytes, word: str, echoes: bool
) -> None:
    far = ScriptedFarEnd(lambda text: (text.encode() + b"\r" if echoes else b"") + answer)
    async with opening(far) as (_, error, took_s):
        assert isinstance(error, UnexpectedAnswerError)
        assert word in str(error)
        assert took_s == pytest.approx(ALL_MARKERS_S)


# Not known: silence and other noise -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "answer",
    [
        None,
        b"\xf8\x80\xf8",
        b"! 0005",  # half an answer
        b"!\r",
        b"! 005\r",
        b"! 00055\r",
        b"x! 0005\r",
        b"! 0005 Hz\r",
        b">",
        b"S17",
        b"17\r",
        b"7.25\r",
        b"$\r",
        b"\0\0",
    ],
)
async def test_what_is_no_strangers_answer_is_silence(answer: bytes | None) -> None:
    async with opening(ScriptedFarEnd(lambda _: answer)) as (_, error, took_s):
        assert isinstance(error, AnswerTimeoutError)
        assert took_s == pytest.approx(ALL_MARKERS_S)


async def test_an_echo_with_anything_else_is_no_echo() -> None:
    async with opening(ScriptedFarEnd(lambda text: text.encode() + b"\r.")) as (_, error, _):
        assert isinstance(error, AnswerTimeoutError)


async def test_one_answer_of_a_compax3_among_noise_is_not_enough() -> None:
    answers = iter([b"! 0005\r"])
    async with opening(ScriptedFarEnd(lambda _: next(answers, None))) as (_, error, _):
        assert isinstance(error, AnswerTimeoutError)


# A COMPAX is no stranger ----------------------------------------------------------------------------------------------


COMPAXES: dict[str, Callable[[str], bytes]] = {
    "echo": lambda text: text.encode() + b"\r" + as_drive(text),
    "echo with CR LF": lambda text: text.encode() + b"\r\n" + as_drive(text),
    "noise before": lambda text: b"\xff! 0005\r" + as_drive(text),
    "a message before": lambda text: b"$" + PROMPT + as_drive(text),
    "a comparator before": lambda text: b"3" + PROMPT + as_drive(text),
    "a late prompt before": lambda text: PROMPT + as_drive(text),
    "late prompts before": lambda text: PROMPT * 3 + as_drive(text),
    "the rest of a prompt before": lambda text: b">" + as_drive(text),
    "a comparator, prompt first": lambda text: PROMPT + b"1" + as_drive(text),
}


@pytest.mark.parametrize("script", COMPAXES.values(), ids=COMPAXES.keys())
async def test_a_compax_that_says_more_is_opened(script: Callable[[str], bytes]) -> None:
    async with opening(ScriptedFarEnd(script)) as (line, error, _):
        assert error is None
        assert await line.answer("S1") == "S001: 1"


@pytest.mark.parametrize(
    "banner",
    [b"E92\r\n>", b"COMPAX ready\r\n>", b"READY! 1234\r\n", b"! 0000\r", b">\r", b"\r\n\r\n", b"login: \r\nOK\r\n"],
)
async def test_a_banner_at_power_on_makes_no_stranger(banner: bytes) -> None:
    banners = iter([banner])
    async with opening(ScriptedFarEnd(lambda text: next(banners, b"") + as_drive(text))) as (line, error, _):
        assert error is None
        assert await line.answer("S1") == "S001: 1"


@pytest.mark.parametrize("after_s", [0.2, 0.9, 1.7, 2.5])
async def test_an_echo_whose_answer_takes_its_time_is_no_stranger(after_s: float) -> None:
    far = ScriptedFarEnd()

    def script(text: str) -> None:
        far.say(text.encode() + b"\r")
        asyncio.get_running_loop().call_later(after_s, far.say, as_drive(text))

    far.script = script
    async with opening(far) as (_, error, _):
        assert error is None if after_s < 1 else isinstance(error, AnswerTimeoutError)


async def test_a_line_that_has_answered_as_a_compax_once_is_never_a_strangers() -> None:
    line = Line(ScriptedFarEnd())
    line.connect()
    await line.answer("S1")
    line.far.script = refusing
    outcomes = [(await elapsed(line.ask(text)))[0] for text in ("S1", "S2")]
    assert all(isinstance(outcome, AnswerTimeoutError) for outcome in outcomes)
    line.far.script = as_drive
    assert await line.answer("S1") == "S001: 1"
    await line.link.close()


async def test_a_compax_that_refuses_everything_is_no_stranger() -> None:
    async with opening(ScriptedFarEnd(lambda _: b"E92" + PROMPT)) as (_, error, _):
        assert isinstance(error, AnswerTimeoutError)
        assert not isinstance(error, CommandRejectedError)


async def test_a_line_that_is_lost_is_lost_whatever_it_said() -> None:
    far = ScriptedFarEnd(lambda text: text.encode() + b"\r")
    asyncio.get_running_loop().call_later(0.5, lambda: far.transport.abort())  # noqa: PLW0108  # not open yet
    async with opening(far) as (_, error, _):
        assert isinstance(error, ConnectionLostError)


# Byte by byte ---------------------------------------------------------------------------------------------------------


def opened() -> CompaxProtocol:
    protocol = CompaxProtocol()
    protocol.line_opened()
    protocol.send_marker()
    protocol.bytes_to_send()
    return protocol


def test_the_first_answer_ends_the_markers_turn_and_the_second_is_certain() -> None:
    protocol = opened()
    protocol.receive(b"! 0005\r")
    assert protocol.events() == [MarkerSpent()]
    assert protocol.stranger(time_is_over=False) is None
    protocol.send_marker()
    protocol.receive(b"! 0005\r")
    stranger = protocol.stranger(time_is_over=False)
    assert stranger is not None
    assert stranger.name == COMPAX3


def test_a_prompt_after_all_makes_it_a_compax() -> None:
    protocol = opened()
    protocol.receive(b"! 0005\r")
    protocol.receive(b"! 0005\r")
    protocol.receive(PROMPT)
    assert protocol.stranger(time_is_over=True) is None
    protocol.line_opened()
    protocol.send_marker()
    protocol.receive(b"! 0005\r! 0005\r")
    assert protocol.stranger(time_is_over=True) is None, "for good"


def test_before_anything_was_said_nobody_is_known() -> None:
    assert CompaxProtocol().stranger(time_is_over=True) is None
    assert opened().stranger(time_is_over=True) is None


def test_a_new_line_begins_anew() -> None:
    protocol = opened()
    protocol.receive(b"! 0005\r")
    protocol.line_opened()
    protocol.send_marker()
    protocol.receive(b"! 0005\r")
    assert protocol.stranger(time_is_over=False) is None


@pytest.mark.parametrize("end", [b"", b"\r\n>", b"S017: 0\r\n>"])
@pytest.mark.parametrize(
    "said", [b"! 0005\r", b"! 0005\r! 0006\r", b">\r", b"\r\n! 0005\r", b"! 0005", b"x\r> \r", b"\r\n>\r\n! 0005\r"]
)
def test_how_a_strangers_bytes_are_cut_makes_no_difference(said: bytes, end: bytes) -> None:
    whole, single = opened(), opened()
    whole.receive(said + end)
    for byte in said + end:
        single.receive(bytes([byte]))
    assert whole.events() == single.events()
    assert whole.state is single.state
    for time_is_over in (True, False):
        assert whole.stranger(time_is_over=time_is_over) == single.stranger(time_is_over=time_is_over)


def test_a_flood_that_is_no_compax_keeps_memory_bounded() -> None:
    protocol = opened()
    for _ in range(2000):
        protocol.receive(b"U" * 1000)
    assert protocol._recognition is not None, "as long as no prompt has come"
    assert len(protocol._recognition._received) <= 512
    protocol.time_ran_out()
    protocol.receive(PROMPT + as_drive("S1"))
    protocol.send_marker()
    marker = protocol.bytes_to_send().decode().strip()
    protocol.receive(as_drive(marker))
    assert InStep() in protocol.events()


@given(
    texts=st.lists(
        st.sampled_from(["", "E92", "E90 syntax", "$", "1", "8", "S001: 5", "S017: 00000010", "N005: END", "COMPAX"]),
        max_size=6,
    ),
    keep=st.integers(0, 60),
    echo=st.booleans(),
)
@example(texts=["", "", "", ""], keep=2, echo=False)
@example(texts=["", "", "", ""], keep=4, echo=True)
def test_nothing_that_a_compax_says_from_wherever_one_begins_to_hear_it_is_a_strangers(
    texts: list[str], keep: int, echo: bool
) -> None:
    """The beginning may be lost, and it may be cut anywhere."""
    whole = b"".join((b"S17\r" if echo else b"") + text.encode() + PROMPT for text in texts)
    protocol = opened()
    for byte in whole[-keep:] if keep else b"":
        protocol.receive(bytes([byte]))
        assert protocol.stranger(time_is_over=False) is None


@given(piece=st.lists(st.sampled_from([b"S17", b"\r", b"\n", b">", b"$", b"E92", b"1", b" ", b"\xff"]), max_size=8))
def test_one_prompt_is_enough_to_be_a_compax(piece: list[bytes]) -> None:
    protocol = opened()
    protocol.receive(b"".join(piece) + PROMPT)
    for time_is_over in (True, False):
        assert protocol.stranger(time_is_over=time_is_over) is None


def test_every_stranger_says_what_to_do_and_where_that_is_from() -> None:
    for row in (*STRANGERS, ECHO):
        assert row.name
        assert row.remedy
        assert row.source
