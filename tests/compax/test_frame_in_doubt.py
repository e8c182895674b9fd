"""A binary motion that was not answered: half of it would take for its end whatever is sent, so nothing is."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fakes.answers import PROMPT, answer_to, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.link.lines import Line, connected, elapsed, unique_name

from compax_aio.compax.binary import BinaryTransfer
from compax_aio.compax.protocol import (
    Acknowledged,
    Answered,
    CompaxProtocol,
    MessageForm,
    PositionReached,
    Rejected,
    State,
    Stray,
    UnexpectedAnswer,
)
from compax_aio.errors import AnswerTimeoutError, ConnectionLostError, LinkProtocolError
from compax_aio.link.contract import Event, HoldOver, InStep, Lane, LateEnding, MarkerSpent, TurnOver
from compax_aio.transports.loopback import listen

BINARY: Final = BinaryTransfer(settings=True, motion=True).encode
PA360: Final = bytes.fromhex("88 41 00 00 00 68 01 00")
SD50: Final = bytes.fromhex("88 53 00 00 00 32 00 00")
ANSWER_TIMEOUT_S: Final = 1.0
RESYNC_ATTEMPTS: Final = 3


def in_step(encode: Callable[[str], bytes] = BINARY) -> CompaxProtocol:
    protocol = CompaxProtocol(MessageForm.PROMPT_FIRST, encode)
    protocol.line_opened()
    protocol.send_marker()
    protocol.receive(answer_to(protocol.bytes_to_send().decode().strip()))
    assert protocol.events() == [InStep()]
    return protocol


def waiting_for(line: str) -> CompaxProtocol:
    protocol = in_step()
    protocol.send(line)
    protocol.bytes_to_send()
    return protocol


def held() -> CompaxProtocol:
    protocol = waiting_for("PA360")
    protocol.time_ran_out()
    return protocol


def stop_outstanding() -> CompaxProtocol:
    protocol = held()
    protocol.send_ahead("STOP")
    protocol.bytes_to_send()
    return protocol


def stop_answered() -> CompaxProtocol:
    protocol = stop_outstanding()
    protocol.receive(PROMPT)
    protocol.events()
    return protocol


def read(protocol: CompaxProtocol, data: bytes) -> list[Event]:
    protocol.receive(data)
    return protocol.events()


# How a line goes out --------------------------------------------------------------------------------------------------


def test_a_line_goes_out_as_it_is_encoded_and_is_told_as_it_was_said() -> None:
    protocol = in_step()
    protocol.send("PA360")
    assert protocol.bytes_to_send() == PA360
    with pytest.raises(LinkProtocolError) as caught:
        protocol.send("S1")
    assert caught.value.sent == "PA360"
    assert protocol.state is State.AWAITING_FRAME


def test_a_motion_with_a_sign_goes_out_as_text() -> None:
    protocol = in_step()
    protocol.send("PA360$")
    assert protocol.bytes_to_send() == b"PA360$\r"
    assert protocol.state is State.AWAITING_ANSWER


def test_how_lines_go_out_can_be_changed_on_an_open_line() -> None:
    protocol = in_step(CompaxProtocol().encode)
    protocol.send("SD50")
    assert protocol.bytes_to_send() == b"SD50\r"
    protocol.receive(PROMPT)
    protocol.encode = BINARY
    protocol.send("SD50")
    assert protocol.bytes_to_send() == SD50


def test_markers_and_stops_are_text_whatever_is_binary() -> None:
    protocol = CompaxProtocol(encode=lambda text: b"\x88" + text.encode())
    protocol.line_opened()
    protocol.send_ahead("STOP")
    assert protocol.bytes_to_send() == b"STOP\r"
    protocol.time_ran_out()
    protocol.send_marker()
    assert protocol.bytes_to_send() == b"S17\r"


@pytest.mark.parametrize("line", ["PA360", "SD50", "AL250"])
@pytest.mark.parametrize("echoes", [True, False])
@pytest.mark.parametrize(
    ("reply", "outcome"), [(b"", Acknowledged()), (b"E92", Rejected(92, "E92")), (b"HUH", UnexpectedAnswer("HUH"))]
)
def test_a_frame_is_answered_as_the_same_line_in_text(line: str, echoes: bool, reply: bytes, outcome: TurnOver) -> None:
    protocol = waiting_for(line)
    assert read(protocol, (BINARY(line) if echoes else b"") + reply + PROMPT) == [outcome]


def test_a_message_of_the_move_before_ends_no_frames_turn() -> None:
    protocol = waiting_for("PA360")
    assert read(protocol, b"$" + PROMPT) == [PositionReached()]
    assert protocol.state is State.AWAITING_FRAME


# A motion whose time ran out ------------------------------------------------------------------------------------------


def test_after_a_motion_frame_nothing_is_sent_not_even_a_marker() -> None:
    protocol = held()
    assert protocol.state is State.FRAME_IN_DOUBT
    assert protocol.in_doubt
    assert not protocol.is_busy
    assert protocol.held is not None
    assert "'PA360'" in protocol.held.why
    assert "reconcile()" in protocol.held.remedy
    for send in (CompaxProtocol.send_marker, lambda protocol: protocol.send("S1")):
        with pytest.raises(LinkProtocolError):
            send(protocol)
    assert protocol.bytes_to_send() == b""


def test_an_answer_that_makes_no_sense_leaves_a_motion_frame_in_doubt_too() -> None:
    protocol = waiting_for("PA360")
    assert read(protocol, b"HUH" + PROMPT) == [UnexpectedAnswer("HUH")]
    assert protocol.held is not None


@pytest.mark.parametrize("line", ["SD50", "AL250", "PA360$", "PR10$", "PH"])
def test_any_other_line_whose_time_ran_out_is_followed_by_markers(line: str) -> None:
    protocol = waiting_for(line)
    protocol.time_ran_out()
    assert protocol.held is None
    protocol.send_marker()
    assert protocol.bytes_to_send()


@pytest.mark.parametrize("line", ["PA360", "PR-10"])
@pytest.mark.parametrize(("reply", "outcome"), [(b"", Acknowledged()), (b"E92", Rejected(92, "E92"))])
def test_a_late_answer_ends_the_doubt(line: str, reply: bytes, outcome: TurnOver) -> None:
    protocol = waiting_for(line)
    protocol.time_ran_out()
    assert read(protocol, reply + PROMPT) == [LateEnding(line, outcome), InStep()]
    assert protocol.state is State.READY
    assert protocol.held is None


@pytest.mark.parametrize("said", [b"$", b"1", b"HUH", b"S001: 5", b"U" * 300])
def test_nothing_else_that_comes_ends_it(said: bytes) -> None:
    protocol = held()
    events = read(protocol, said + PROMPT)
    assert InStep() not in events
    assert protocol.state is State.FRAME_IN_DOUBT


def test_a_stop_may_be_sent_again_and_again_until_it_is_answered() -> None:
    protocol = held()
    for _ in range(5):
        protocol.send_ahead("STOP")
        assert protocol.is_busy
        assert protocol.held is not None
        assert protocol.bytes_to_send() == b"STOP\r"
        protocol.time_ran_out()
        assert protocol.events() == []
        assert protocol.state is State.FRAME_IN_DOUBT


@pytest.mark.parametrize("reply", [b"", b"E92"])
@pytest.mark.parametrize("is_late", [True, False])
def test_two_answers_after_a_stop_show_that_no_half_frame_is_left_and_nothing_else(reply: bytes, is_late: bool) -> None:
    """Half a frame answers nothing. But the stop may have completed it, and the prompt be that of what it has made."""
    protocol = held()
    for answered in (1, 2):
        assert protocol.held is not None
        protocol.send_ahead("STOP")
        assert protocol.bytes_to_send() == b"STOP\r"
        if is_late:
            protocol.time_ran_out()
        assert read(protocol, reply + PROMPT) == [MarkerSpent(), HoldOver()][:answered]
    assert protocol.held is None
    assert protocol.state is State.IN_DOUBT
    assert read(protocol, reply + PROMPT) == [Stray(reply.decode())], "of whichever of them"
    protocol.send_marker()
    protocol.bytes_to_send()
    assert read(protocol, PROMPT) == [Stray("")]


def test_what_was_answered_for_one_motion_counts_for_no_other() -> None:
    protocol = held()
    protocol.send_ahead("STOP")
    read(protocol, PROMPT)
    protocol.resume()
    protocol.send_marker()
    read(protocol, answer_to(protocol.bytes_to_send().decode().rpartition("\r")[0].rpartition("\r")[2]))
    protocol.send("PR5")
    protocol.time_ran_out()
    protocol.send_ahead("STOP")
    assert read(protocol, PROMPT) == [MarkerSpent()]
    assert protocol.held is not None
    assert "'PR5'" in protocol.held.why


@pytest.mark.parametrize("said", [b"$", b"1", b"HUH", b"S001: 5"])
@pytest.mark.parametrize("is_late", [True, False])
def test_nothing_else_that_comes_after_a_stop_shows_that(said: bytes, is_late: bool) -> None:
    protocol = held()
    protocol.send_ahead("STOP")
    if is_late:
        protocol.time_ran_out()
    read(protocol, said + PROMPT)
    assert protocol.held is not None


@pytest.mark.parametrize("reply", [b"", b"E90"])
def test_what_comes_on_a_new_line_before_anything_was_sent_proves_nothing(reply: bytes) -> None:
    """The drive keeps half a frame while its line is gone; a device server may hand over what is left of the old."""
    for make in (held, lambda: waiting_for("PA360"), stop_outstanding, stop_answered):
        protocol = make()
        protocol.line_opened()
        assert protocol.state is State.FRAME_IN_DOUBT
        read(protocol, reply + PROMPT)
        assert protocol.state is State.FRAME_IN_DOUBT
        assert protocol.held is not None
        assert "'PA360'" in protocol.held.why
        for answered in (1, 2):
            assert protocol.held is not None
            protocol.send_ahead("STOP")
            protocol.time_ran_out()
            assert read(protocol, reply + PROMPT) == [MarkerSpent(), HoldOver()][:answered]
        assert protocol.held is None


def test_a_new_line_while_a_stop_is_outstanding_is_held_as_before() -> None:
    protocol = held()
    protocol.send_ahead("STOP")
    protocol.line_opened()
    assert protocol.state is State.FRAME_IN_DOUBT
    assert protocol.bytes_to_send() == b""


def test_a_persons_word_lets_markers_out_and_a_markers_answer_ends_the_doubt() -> None:
    protocol = held()
    protocol.resume()
    assert protocol.held is None
    assert protocol.in_doubt
    protocol.send_marker()
    assert read(protocol, answer_to(protocol.bytes_to_send().decode().strip())) == [InStep()]


def test_after_a_persons_word_a_prompt_acknowledges_no_motion() -> None:
    """The marker may have completed it, to another one."""
    protocol = held()
    protocol.resume()
    protocol.send_marker()
    assert read(protocol, PROMPT) == [Stray("")]
    assert protocol.in_doubt


def test_after_a_persons_word_a_prompt_does_not_bring_the_line_in_step() -> None:
    """It may be said by a drive that was switched on again."""
    protocol = held()
    protocol.resume()
    assert read(protocol, PROMPT) == [Stray("")]
    assert protocol.in_doubt


def test_a_persons_word_while_a_stop_is_outstanding_lets_it_be_answered_first() -> None:
    protocol = held()
    protocol.send_ahead("STOP")
    protocol.resume()
    assert (protocol.held, protocol.is_busy) == (None, True)
    assert read(protocol, PROMPT) == [MarkerSpent()]
    assert protocol.state is State.IN_DOUBT


def test_a_persons_word_changes_nothing_where_nothing_is_held() -> None:
    for protocol in (CompaxProtocol(), in_step(), waiting_for("PA360"), waiting_for("S1")):
        before = protocol.state
        protocol.resume()
        assert protocol.state is before
    protocol = waiting_for("SD50")
    protocol.time_ran_out()
    protocol.resume()
    assert read(protocol, PROMPT)[0] == LateEnding("SD50", Acknowledged())


# A setting whose time ran out -----------------------------------------------------------------------------------------


def test_a_setting_is_acknowledged_late_while_nothing_was_sent_since() -> None:
    protocol = waiting_for("SD50")
    protocol.time_ran_out()
    assert read(protocol, PROMPT) == [LateEnding("SD50", Acknowledged()), InStep()]


def test_a_prompt_after_a_marker_acknowledges_no_setting_in_binary() -> None:
    """The marker may have completed the frame, to another speed."""
    protocol = waiting_for("SD50")
    protocol.time_ran_out()
    protocol.send_marker()
    protocol.bytes_to_send()
    assert read(protocol, PROMPT) == [Stray("")]
    protocol.time_ran_out()
    protocol.send_marker()
    assert read(protocol, answer_to(protocol.bytes_to_send().decode().strip())) == [InStep()]


# A drive that reads frames, behind wires that cut them ----------------------------------------------------------------


class BinaryDrive:
    """Reads text and frames as the manual has them, with no line of the library's own reader; moves as it is told."""

    def __init__(self) -> None:
        self.buffer = b""
        self.motions: list[float] = []
        self.speeds: list[float] = []
        self.stops = 0

    def receive(self, data: bytes) -> bytes:
        replies = b""
        for byte in data:
            self.buffer += bytes([byte])
            if self.buffer[0] & 0x80:
                if len(self.buffer) < self.buffer[0] - 0x80:
                    continue
                replies += self._execute_frame(self._take())
            elif byte == 0x0D:
                replies += self._execute_line(self._take())
        return replies

    def _take(self) -> bytes:
        taken, self.buffer = self.buffer, b""
        return taken

    def _execute_frame(self, frame: bytes) -> bytes:
        number = int.from_bytes(frame[2:8], "little", signed=True) / 2**24
        if frame[1:2] == b"A":
            self.motions.append(number)
        elif frame[1:2] == b"S":
            self.speeds.append(number)
        else:
            return b"E90" + PROMPT
        return PROMPT

    def _execute_line(self, line: bytes) -> bytes:
        text = line.decode("latin-1").strip("\r")
        if text == "STOP":
            self.stops += 1
        elif not (text[:1] in ("S", "P") and text[1:].isdigit()):
            return b"E90" + PROMPT
        return as_drive(text)


@pytest.mark.parametrize("arrived", range(9))
@pytest.mark.parametrize("answers_get_through", [True, False])
def test_wherever_a_motion_is_cut_only_stops_reach_the_drive_until_nothing_of_it_is_left(
    arrived: int, answers_get_through: bool
) -> None:
    protocol, drive = waiting_for("PA360"), BinaryDrive()
    drive.receive(PA360[:arrived])
    protocol.time_ran_out()
    for _ in range(3):
        if protocol.held is None:
            break
        protocol.send_ahead("STOP")
        reply = drive.receive(protocol.bytes_to_send())
        if answers_get_through:
            protocol.receive(reply)
            assert InStep() not in protocol.events()
            assert (protocol.held is None) <= (drive.buffer == b"")
        if protocol.is_busy:
            protocol.time_ran_out()
    assert (protocol.held is None) == answers_get_through
    protocol.send_ahead("STOP")  # as the link does, before any marker
    drive.receive(protocol.bytes_to_send())
    protocol.time_ran_out()
    assert drive.buffer == b""
    assert drive.stops >= 1, "after all that the first of them have made"
    # Of one byte and "STOP" comes a speed, of more a motion to elsewhere.
    assert (len(drive.speeds), len(drive.motions)) == (int(arrived == 1), int(arrived > 1))
    protocol.resume()
    protocol.send_marker()
    protocol.receive(drive.receive(protocol.bytes_to_send()))
    assert protocol.events()[-1] == InStep()


@pytest.mark.parametrize("arrived", range(9))
def test_wherever_a_setting_is_cut_the_line_comes_back_in_step_and_nothing_false_is_acknowledged(arrived: int) -> None:
    protocol, drive = waiting_for("SD50"), BinaryDrive()
    protocol.receive(drive.receive(SD50[:arrived]) if arrived < 8 else drive.receive(SD50)[:0])
    protocol.time_ran_out()
    events: list[Event] = []
    for _ in range(RESYNC_ATTEMPTS):
        if InStep() in events:
            break
        if protocol.is_busy:
            protocol.time_ran_out()
        protocol.send_marker()
        events += read(protocol, drive.receive(protocol.bytes_to_send()))
    assert events[-1] == InStep()
    assert drive.buffer == b""
    assert not any(isinstance(event, LateEnding) and event.sent == "SD50" for event in events)


@given(
    arrived=st.integers(0, 8),
    doings=st.lists(st.sampled_from(["stop", "stop", "time", "open", "answers", "message", "noise"]), max_size=10),
)
def test_whatever_happens_nothing_but_stops_goes_out_while_half_a_frame_may_be_there(
    arrived: int, doings: list[str]
) -> None:
    protocol, drive = waiting_for("PA360"), BinaryDrive()
    answers = drive.receive(PA360[:arrived])
    protocol.time_ran_out()
    for doing in doings:
        if doing == "stop" and not protocol.is_busy:
            protocol.send_ahead("STOP")
            answers += drive.receive(protocol.bytes_to_send())
        elif doing == "time" and protocol.is_busy:
            protocol.time_ran_out()
        elif doing == "open":
            protocol.line_opened()
        elif doing == "answers":
            protocol.receive(answers)
            answers = b""
        elif doing == "message":
            protocol.receive(b"$" + PROMPT)
        elif doing == "noise":
            protocol.receive(b"x\xff" + PROMPT)
        if protocol.held is None:
            assert drive.buffer == b"", "what is sent now is nobody's end"
            return
        with pytest.raises(LinkProtocolError):
            protocol.send_marker()
        with pytest.raises(LinkProtocolError):
            protocol.send("S1")
        assert protocol.bytes_to_send() == b""


# The link -------------------------------------------------------------------------------------------------------------


class FrameFarEnd(ScriptedFarEnd):
    """A far end whose frames are answered by what *frames* gives in turn, None being silence."""

    def __init__(self, *frames: bytes | None) -> None:
        super().__init__()
        self.frames = list(frames)

    def data_received(self, data: bytes) -> None:
        if data[:1] < b"\x80":
            super().data_received(data)
            return
        self.writes.append(data)
        if (reply := self.frames.pop(0) if self.frames else None) is not None:
            self.say(reply)


async def binary_line(*frames: bytes | None) -> Line:
    line = await connected(FrameFarEnd(*frames))
    assert isinstance(line.protocol, CompaxProtocol)
    line.protocol.encode = BINARY
    return line


def move(line: Line, text: str = "PA360") -> asyncio.Future[TurnOver]:
    return line.link.exchange(text, Lane.MOTION, settles_late=True)


async def held_line() -> Line:
    line = await binary_line(None)
    await asyncio.gather(move(line), return_exceptions=True)
    assert line.link.held is not None
    line.far.writes.clear()
    line.far.lines.clear()
    return line


async def test_a_motion_in_binary_is_answered_as_any_other() -> None:
    line = await binary_line(PROMPT, b"E92" + PROMPT)
    assert await move(line) == Acknowledged()
    assert await move(line, "PR5") == Rejected(92, "E92")
    assert line.far.writes == [PA360, bytes.fromhex("88 52 00 00 00 05 00 00")]
    assert line.far.lines == []


@pytest.mark.parametrize("settles_late", [True, False])
async def test_a_motion_that_is_not_answered_fails_after_the_grace_and_says_what_to_do(settles_late: bool) -> None:
    line = await binary_line(None)
    error, took_s = await elapsed(line.link.exchange("PA360", Lane.MOTION, settles_late=settles_late))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(ANSWER_TIMEOUT_S * (1 + settles_late))
    assert error.sent == "PA360"
    assert "no answer within 1 s" in error.what
    assert "cut" in error.what
    assert "reconcile()" in (error.hint or "")
    await asyncio.sleep(100)
    assert line.far.writes == [PA360], "nothing more, ever"


async def test_what_waits_behind_it_is_told_too_and_what_comes_later_at_once() -> None:
    line = await binary_line(None)
    waiters = [move(line), line.ask("S1"), line.ask("SD5", Lane.CONTROL), line.ask("PA1", Lane.MOTION)]
    loop = asyncio.get_running_loop()
    before = loop.time()
    errors = await asyncio.gather(*waiters, return_exceptions=True)
    assert loop.time() - before == pytest.approx(2 * ANSWER_TIMEOUT_S)
    errors += [(await elapsed(line.ask("S2")))[0], (await elapsed(line.ask("SD7", Lane.CONTROL)))[0]]
    assert loop.time() - before == pytest.approx(2 * ANSWER_TIMEOUT_S)
    for error, text in zip(errors, ["PA360", "S1", "SD5", "PA1", "S2", "SD7"], strict=True):
        assert isinstance(error, AnswerTimeoutError)
        assert "'PA360' may have arrived cut" in error.what
        assert (error.sent == text) == (text == "PA360")
        assert error.sent is not None or f"{text!r} was not sent" in error.what
    assert line.far.writes == [PA360]


@pytest.mark.parametrize(("reply", "outcome"), [(PROMPT, Acknowledged()), (b"E92" + PROMPT, Rejected(92, "E92"))])
async def test_a_late_answer_within_the_grace_reaches_who_waits_and_all_goes_on(
    reply: bytes, outcome: TurnOver
) -> None:
    line = await binary_line(None)
    asyncio.get_running_loop().call_later(1.5, line.far.say, reply)
    moved, read = move(line), line.ask("S1")
    assert await moved == outcome
    assert await read == Answered("S001: 1")
    assert line.far.lines == ["S1"], "and no marker"
    assert line.link.held is None
    await asyncio.sleep(10)
    assert await line.answer("S2") == "S002: 2"


async def test_a_grace_that_was_not_used_up_puts_nothing_off() -> None:
    line = await binary_line(None, b"HUH" + PROMPT)
    asyncio.get_running_loop().call_later(1.1, line.far.say, PROMPT)
    assert await move(line) == Acknowledged()
    assert await move(line) == UnexpectedAnswer("HUH")
    error, took_s = await elapsed(line.ask("S1"))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s < 0.1


async def test_an_answer_after_the_grace_lets_all_go_on_too() -> None:
    line = await held_line()
    line.far.say(PROMPT)
    await asyncio.sleep(0.01)
    assert line.link.held is None
    assert await line.answer("S1") == "S001: 1"


async def test_a_stop_goes_out_although_it_is_held_and_follows_in_step() -> None:
    line = await held_line()
    waiting = [line.ask("STOP", Lane.STOP), line.ask("S1")]
    assert await asyncio.gather(*waiting) == [Acknowledged(), Answered("S001: 1")]
    *stops, marker, in_step, read = line.far.lines
    assert (stops, in_step, read) == (["STOP"] * 3, "STOP", "S1")
    assert marker in {"S16", "S30"}
    assert line.link.held is None


async def test_a_stop_that_is_taken_for_the_end_of_the_frame_is_repeated_until_it_is_understood() -> None:
    line = await held_line()
    replies = iter([None, PROMPT])
    line.far.script = lambda text: next(replies, as_drive(text)) if text == "STOP" else as_drive(text)
    outcome, took_s = await elapsed(line.ask("STOP", Lane.STOP))
    assert outcome == Acknowledged()
    assert took_s == pytest.approx(ANSWER_TIMEOUT_S, abs=0.1)
    stops, marker = line.far.lines[:-2], line.far.lines[-2]
    assert stops == ["STOP"] * 4
    assert marker in {"S16", "S30"}


async def test_a_stop_that_is_not_answered_is_repeated_in_bounded_time() -> None:
    line = await held_line()
    line.far.script = lambda text: None
    error, took_s = await elapsed(line.ask("STOP", Lane.STOP))
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(RESYNC_ATTEMPTS * ANSWER_TIMEOUT_S)
    assert line.far.lines == ["STOP"] * RESYNC_ATTEMPTS


async def test_a_stop_does_not_wait_for_the_grace() -> None:
    line = await binary_line(None)
    moved, stop = move(line), line.ask("STOP", Lane.STOP)
    outcome, took_s = await elapsed(stop)
    assert outcome == Acknowledged()
    assert took_s == pytest.approx(ANSWER_TIMEOUT_S, abs=0.1)
    assert isinstance((await elapsed(moved))[0], AnswerTimeoutError), "of what moved, there is no telling"


async def test_a_stop_that_is_never_answered_is_told_as_doubtful_and_is_sent_again_when_it_is_asked_again() -> None:
    line = await held_line()
    line.far.script = lambda text: None
    for _ in range(2):
        line.far.lines.clear()
        error, _ = await elapsed(line.ask("STOP", Lane.STOP))
        assert isinstance(error, AnswerTimeoutError)
        assert f"sent {RESYNC_ATTEMPTS} times" in error.what
        assert error.sent == "STOP"
        assert line.far.lines == ["STOP"] * RESYNC_ATTEMPTS
    assert line.link.held is not None


async def test_a_stop_that_nobody_wants_any_more_is_not_sent() -> None:
    line = await binary_line(None)
    moved = move(line)
    line.ask("STOP", Lane.STOP).cancel()
    await asyncio.gather(moved, return_exceptions=True)
    assert line.far.writes == [PA360]


async def test_a_persons_word_brings_the_line_back_in_step() -> None:
    line = await held_line()
    line.link.resume()
    assert line.link.held is None
    assert await line.answer("S1") == "S001: 1"
    assert len(line.far.lines) == 2, "a marker, and the question"


async def test_a_persons_word_within_the_grace_ends_the_wait() -> None:
    line = await binary_line(None)
    moved = move(line)
    await asyncio.sleep(ANSWER_TIMEOUT_S + 0.5)
    line.far.script = lambda text: None
    line.link.resume()
    error, took_s = await elapsed(moved)
    line.far.script = as_drive
    assert isinstance(error, AnswerTimeoutError)
    assert took_s == pytest.approx(0, abs=0.01)
    assert await line.answer("S1") == "S001: 1"
    await asyncio.sleep(10)
    assert await line.answer("S2") == "S002: 2"


async def test_a_persons_word_where_nothing_is_held_sends_nothing() -> None:
    line = await binary_line()
    line.link.resume()
    await asyncio.sleep(1)
    assert line.far.writes == []


async def test_noise_while_it_is_held_changes_nothing() -> None:
    line = await held_line()
    line.far.say(b"x\xff" + PROMPT + b"$" + PROMPT)
    await asyncio.sleep(10)
    assert line.far.writes == []
    assert line.link.held is not None
    assert PositionReached() in line.events


async def test_a_line_that_is_lost_during_a_motion_in_binary_says_what_the_drive_may_hold() -> None:
    line = await binary_line(None)
    moved = move(line)
    await asyncio.sleep(0.1)
    line.far.transport.abort()
    error, _ = await elapsed(moved)
    assert isinstance(error, ConnectionLostError)
    assert "cut" in (error.hint or "")
    assert "off and on" in (error.hint or "")
    assert line.link.held is not None


async def test_a_held_line_that_is_closed_leaves_no_timer_behind() -> None:
    line = await binary_line(None)
    moved = move(line)
    await asyncio.sleep(ANSWER_TIMEOUT_S + 0.1)
    await line.link.close()
    assert isinstance((await elapsed(moved))[0], ConnectionLostError)
    await asyncio.sleep(100)
    assert line.far.writes == [PA360]


async def test_a_held_line_that_is_opened_again_sends_nothing_and_says_so_at_once() -> None:
    line = await held_line()
    line.far.transport.abort()
    await asyncio.sleep(0.1)
    name, far = unique_name(), FrameFarEnd()
    with await listen(name, lambda: far):
        error, took_s = await elapsed(line.link.open(f"loop://{name}"))
    assert isinstance(error, AnswerTimeoutError)
    assert "may have arrived cut" in error.what
    assert took_s < 0.1
    assert far.writes == []


async def test_a_setting_in_binary_that_is_not_answered_is_followed_by_a_marker() -> None:
    line = await binary_line(None, PROMPT)
    setting, read = line.link.exchange("SD50", Lane.MOTION, settles_late=True), line.ask("S1")
    errors = await asyncio.gather(setting, read, return_exceptions=True)
    assert isinstance(errors[0], AnswerTimeoutError)
    assert errors[1] == Answered("S001: 1")
    assert line.far.writes[0] == SD50
    assert await line.link.exchange("SD50", Lane.MOTION) == Acknowledged()
