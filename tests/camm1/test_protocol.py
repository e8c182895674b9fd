"""The line of a cutter, byte by byte: signed replies, doubt, bursts, and what comes late, damaged or unasked."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.camm1.bursting import Burst
from compax_aio.camm1.handshakes import pacing_of
from compax_aio.camm1.pacing import Handshake
from compax_aio.camm1.protocol import CutterProtocol
from compax_aio.camm1.protocol_events import (
    Answered,
    BurstOver,
    CutShort,
    SettingsLost,
    StatusSeen,
    Stray,
    Unreadable,
)
from compax_aio.camm1.protocol_states import BUSY, DOUBTFUL, TRANSITIONS, State, Step
from compax_aio.camm1.room import Room
from compax_aio.camm1.settings import CutterSettings
from compax_aio.camm1.signs import SIGNS
from compax_aio.errors import LinkProtocolError
from compax_aio.link.contract import Event, GoesOn, InStep, LateEnding
from compax_aio.link.level import LineLevel

KILL, ABORT = "\x1b.K", b"\x1b.J"
STATUS, FREE = b"\x1b.O", b"\x1b.B"


def told(protocol: CutterProtocol) -> list[Event]:
    """List what was noticed, but for steps and for the status that getting in step tells."""
    return [each for each in protocol.events() if not isinstance(each, GoesOn | StatusSeen)]


def form(sign: str) -> bytes:
    return f"\x1b.M0;0;0;13;0;{ord(sign)}:".encode()


def in_step(settings: CutterSettings | None = None) -> CutterProtocol:
    protocol = CutterProtocol(settings or CutterSettings())
    protocol.line_opened()
    protocol.send_marker()
    protocol.bytes_to_send()
    protocol.receive(b"#8\r")
    assert told(protocol) == [InStep()]
    return protocol


def asking(text: str = "\x1b.B") -> CutterProtocol:
    protocol = in_step()
    protocol.send(text)
    assert protocol.bytes_to_send() == text.encode()
    return protocol


# Getting in step ------------------------------------------------------------------------------------------------------


def test_a_new_line_agrees_on_a_sign_and_asks_for_the_status_in_one_go() -> None:
    protocol = CutterProtocol(CutterSettings(turnaround_ms=50))
    protocol.line_opened()
    assert protocol.in_doubt
    assert not protocol.is_busy
    protocol.send_marker()
    assert protocol.bytes_to_send() == ABORT + b"\x1b.M50;0;0;13;0;35:" + STATUS
    protocol.receive(b"#8\r")
    assert protocol.events()[-2:] == [StatusSeen("8"), InStep()]
    assert protocol.state is State.READY


def test_replies_to_somebody_else_do_not_end_the_doubt() -> None:
    protocol = CutterProtocol(CutterSettings())
    protocol.line_opened()
    protocol.send_marker()
    protocol.receive(b"1024\r%8\r")
    assert protocol.in_doubt
    protocol.receive(b"#264\r")
    assert InStep() in told(protocol)


def test_a_cutter_that_waits_for_a_trigger_or_an_echo_is_given_them_when_it_keeps_silent() -> None:
    protocol = CutterProtocol(CutterSettings())
    protocol.line_opened()
    sent = []
    for _ in range(3):
        protocol.send_marker()
        sent.append(protocol.bytes_to_send())
        protocol.time_ran_out()
    assert [each.startswith(b"\x11\r\n\x1b.J") for each in sent] == [False, False, True]
    signs = [each.split(b";")[-1] for each in sent]
    assert len(set(signs)) == 3


def test_a_cutter_that_puts_no_sign_in_front_is_taken_as_it_is() -> None:
    protocol = CutterProtocol(CutterSettings())
    protocol.line_opened()
    protocol.send_marker()
    protocol.bytes_to_send()
    protocol.receive(b"8\r")
    assert protocol.in_doubt  # it might be a late reply to somebody else
    protocol.time_ran_out()
    assert not protocol.has_signs
    protocol.send_marker()
    assert protocol.bytes_to_send() == ABORT
    protocol.receive(b"1024\r")  # late: it came before anything was asked
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"\x1b.M0;0;0;13;0;0:" + STATUS
    protocol.receive(b"8\r")
    assert InStep() in told(protocol)
    protocol.send("\x1b.E")
    protocol.receive(b"\r")
    assert told(protocol) == [Answered("")]


def test_a_cutter_that_once_put_a_sign_in_front_is_not_taken_for_one_that_cannot() -> None:
    protocol = asking()
    protocol.time_ran_out()
    for _ in range(3):
        protocol.send_marker()
        protocol.time_ran_out()
        protocol.receive(b"8\r")
        protocol.receive(b"8\r")
        protocol.time_ran_out()
    assert protocol.has_signs


# Asking ---------------------------------------------------------------------------------------------------------------


def test_a_signed_reply_answers_what_was_asked() -> None:
    protocol = asking()
    protocol.receive(b"#10")
    assert protocol.is_busy
    protocol.receive(b"24\r\n")
    assert told(protocol) == [Answered("1024")]
    assert not protocol.is_busy


def test_a_reply_may_say_nothing_behind_its_sign() -> None:
    protocol = asking("\x1b.E")
    protocol.receive(b"#\r")
    assert told(protocol) == [Answered("")]


def test_xon_and_xoff_are_taken_out_of_replies() -> None:
    protocol = asking()
    protocol.receive(b"\x13#1\x110\x1324\r")
    assert told(protocol) == [Answered("1024")]


def test_a_reply_without_its_sign_puts_the_line_in_doubt() -> None:
    protocol = asking()
    protocol.receive(b"1024\r")
    assert told(protocol) == [Unreadable("\x1b.B", "1024")]
    assert protocol.in_doubt


def test_a_reply_of_an_earlier_doubt_is_no_answer() -> None:
    protocol = asking()
    protocol.receive(b"%999\r")
    assert told(protocol) == [Stray("999")]
    protocol.receive(b"#1024\r")
    assert told(protocol) == [Answered("1024")]


def test_more_than_any_reply_has_puts_the_line_in_doubt_and_is_kept_short() -> None:
    protocol = asking()
    protocol.receive(b"#" + b"1" * 5000)
    events = told(protocol)
    assert isinstance(events[0], Unreadable)
    assert all(len(each.text) <= 64 for each in events if isinstance(each, Unreadable | Stray))
    assert protocol.in_doubt


def test_what_comes_when_nothing_was_asked_is_told_in_pieces_of_a_bearable_size() -> None:
    protocol = in_step()
    protocol.receive(b"hello\r" + b"x" * 1000)
    strays = told(protocol)
    assert strays[0] == Stray("hello")
    assert all(isinstance(each, Stray) and len(each.text) <= 64 for each in strays)


def test_the_form_of_replies_is_said_as_it_is_when_the_text_goes_out() -> None:
    protocol = in_step()
    protocol.send("\x1b.R\x1b.M:\x1b.E")
    assert protocol.bytes_to_send() == b"\x1b.R" + form("#") + b"\x1b.E"


@given(st.binary(max_size=300), st.integers(min_value=1, max_value=7))
def test_whatever_comes_memory_is_bounded_and_the_line_can_get_in_step_again(noise: bytes, piece: int) -> None:
    protocol = asking()
    for start in range(0, len(noise), piece):
        protocol.receive(noise[start : start + piece])
    if protocol.is_busy:
        protocol.time_ran_out()
    protocol.line_opened()
    protocol.send_marker()
    sent = protocol.bytes_to_send()
    sign = chr(int(sent.split(b";")[-1].split(b":")[0]))
    protocol.receive(b"\r" + sign.encode() + b"8\r")
    assert InStep() in told(protocol)


# Doubt ----------------------------------------------------------------------------------------------------------------


def test_after_a_time_out_output_is_aborted_what_is_late_dropped_and_a_new_sign_agreed_on() -> None:
    protocol = asking()
    protocol.time_ran_out()
    assert protocol.in_doubt
    protocol.send_marker()
    assert protocol.bytes_to_send() == ABORT
    protocol.receive(b"#1024\r")
    assert told(protocol) == [LateEnding("\x1b.B", Answered("1024"))]
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == STATUS
    protocol.receive(b"#264\r")
    assert protocol.bytes_to_send() == form("$") + STATUS
    protocol.receive(b"#1024\r")  # the late one, later still
    assert told(protocol) == [Stray("1024")]
    protocol.receive(b"$264\r")
    assert told(protocol) == [InStep()]


def test_a_cutter_that_has_forgotten_the_sign_was_switched_off_and_on_which_is_told_before_anything_goes_on() -> None:
    protocol = asking()
    protocol.time_ran_out()
    protocol.send_marker()
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.receive(b"264\r")
    assert told(protocol) == [SettingsLost("264")]
    assert protocol.bytes_to_send() == form("$") + STATUS
    protocol.receive(b"$264\r")
    assert told(protocol) == [InStep()]


def test_a_damaged_sign_is_no_sign_of_a_reset() -> None:
    protocol = asking()
    protocol.time_ran_out()
    protocol.send_marker()
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.receive(b"\xa3264\r")
    assert told(protocol) == [Stray("£264")]
    protocol.time_ran_out()
    assert protocol.in_doubt


def test_a_sign_that_the_cutter_may_have_heard_or_not_is_known_either_way() -> None:
    for heard in (b"#", b"$"):
        protocol = asking()
        protocol.time_ran_out()
        protocol.send_marker()
        protocol.time_ran_out()
        protocol.receive(b"#264\r")
        protocol.time_ran_out()  # the answer with the new sign is lost, or the sign itself was
        protocol.send_marker()
        protocol.time_ran_out()
        protocol.bytes_to_send()
        protocol.receive(heard + b"264\r")
        assert protocol.bytes_to_send() == form("%") + STATUS


def test_an_output_instruction_that_was_given_up_is_cleared_from_the_buffer() -> None:
    protocol = asking("OA;")
    protocol.time_ran_out()
    protocol.send_marker()
    assert protocol.bytes_to_send() == KILL.encode() + ABORT


def test_what_waits_for_cutting_has_a_longer_time() -> None:
    settings = CutterSettings(answer_timeout_s=1, cutting_timeout_s=99)
    times = []
    for text in ("\x1b.B", "OA;", "\x1b.L", "\x1b.L:"):
        protocol = in_step(settings)
        protocol.send(text)
        times.append(protocol.patience_s)
    assert times == [1, 99, 99, 99]


def test_bytes_that_must_leave_first_have_their_time() -> None:
    protocol = in_step(CutterSettings(answer_timeout_s=1))
    protocol.level = LineLevel(100.0, lambda: 50)
    protocol.send("\x1b.B")
    protocol.bytes_to_send()
    assert protocol.patience_s == pytest.approx(1.5)


def test_a_question_that_the_line_holds_back_is_not_given_up_but_not_for_ever() -> None:
    protocol = in_step(CutterSettings(answer_timeout_s=1, held_timeout_s=10))
    protocol.level = LineLevel(1000.0, lambda: 3)
    protocol.send("\x1b.B")
    for _ in range(20):
        if not protocol.is_busy:
            break
        protocol.time_ran_out()
    assert protocol.in_doubt


def test_abort_goes_out_at_any_time_and_the_turn_is_over_by_it() -> None:
    protocol = asking()
    protocol.preempt(KILL)
    assert protocol.bytes_to_send() == KILL.encode()
    assert told(protocol) == [CutShort("\x1b.B", KILL)]
    assert protocol.state is State.SETTLING
    protocol.time_ran_out()
    protocol.send_marker()
    assert protocol.bytes_to_send() == ABORT


def test_a_stop_in_doubt_goes_out_without_its_question() -> None:
    protocol = asking()
    protocol.time_ran_out()
    protocol.send_ahead(KILL + "\x1b.O")
    assert protocol.bytes_to_send() == KILL.encode() + ABORT
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == STATUS


def test_a_question_in_doubt_is_not_sent_ahead() -> None:
    protocol = asking()
    protocol.time_ran_out()
    protocol.send_ahead("\x1b.O")
    assert protocol.bytes_to_send() == ABORT


def test_a_lost_line_forgets_what_was_agreed_on() -> None:
    protocol = asking()
    protocol.line_lost()
    assert protocol.in_doubt
    assert not protocol.is_busy
    protocol.line_opened()
    protocol.send_marker()
    assert protocol.bytes_to_send() == ABORT + form("$") + STATUS


def test_it_is_never_held_and_knows_no_strangers() -> None:
    protocol = in_step()
    protocol.resume()
    assert protocol.held is None
    assert protocol.stranger(time_is_over=True) is None


def test_what_is_out_of_turn_is_refused() -> None:
    protocol = asking()
    with pytest.raises(LinkProtocolError, match="query sent while asking"):
        protocol.send("\x1b.O")
    idle = in_step()
    idle.load(Burst("b", [b"PU;"]))
    with pytest.raises(LinkProtocolError, match="handshake"):
        idle.send("b")


def test_the_table_of_transitions_leads_out_of_every_state() -> None:
    for state in State:
        assert TRANSITIONS[state, Step.LINE_LOST] is State.IN_DOUBT
        assert TRANSITIONS[state, Step.PREEMPTED] is State.SETTLING
    assert set(TRANSITIONS.values()) == set(State)
    assert not {State.READY} & (BUSY | DOUBTFUL)
    assert len(set(SIGNS)) == len(SIGNS)


# Bursts ---------------------------------------------------------------------------------------------------------------


def bursting(handshake: Handshake, instructions: Sequence[bytes], size: int = 256) -> tuple[CutterProtocol, Burst]:
    protocol = in_step()
    protocol.pacing = pacing_of(handshake, Room.of(size))
    protocol.level = LineLevel(1000.0, lambda: 0)
    burst = Burst("burst", instructions)
    protocol.load(burst)
    protocol.send("burst")
    return protocol, burst


def test_a_burst_asks_for_room_writes_whole_instructions_and_is_over_when_all_is_written() -> None:
    protocol, burst = bursting("software", [b"PU10,20;", b"PD30,40;"])
    assert protocol.bytes_to_send() == FREE
    protocol.receive(b"#256\r")
    assert protocol.bytes_to_send() == b"PU10,20;PD30,40;"
    assert told(protocol) == [BurstOver(is_full=False)]
    assert (burst.written, burst.written_bytes) == (2, 16)


def test_a_burst_without_room_is_over_at_once_and_says_so() -> None:
    protocol, burst = bursting("software", [b"PU10,20;"])
    protocol.bytes_to_send()
    protocol.receive(b"#36\r")
    assert told(protocol) == [BurstOver(is_full=True)]
    assert burst.written == 0


def test_a_burst_that_can_be_written_at_once_is_told_as_over_when_the_link_listens() -> None:
    protocol, _ = bursting("xonxoff", [b"PU10,20;"])
    assert protocol.bytes_to_send() == b"PU10,20;"
    assert protocol.patience_s == 0
    assert protocol.is_busy
    protocol.time_ran_out()
    assert told(protocol) == [BurstOver(is_full=False)]


def test_no_more_is_written_of_a_burst_that_was_given_up() -> None:
    protocol, burst = bursting("software", [b"PU10,20;"] * 100)
    protocol.bytes_to_send()
    burst.is_given_up = True
    protocol.receive(b"#256\r")
    assert protocol.bytes_to_send() == b""
    assert told(protocol) == [BurstOver(is_full=False)]


def test_xoff_in_the_middle_stops_it_and_a_lost_xon_is_asked_for() -> None:
    protocol, burst = bursting("xonxoff", [b"PU10,20;"] * 1000)
    protocol.bytes_to_send()
    protocol.receive(b"\x13")
    written = burst.written
    assert protocol.patience_s == CutterSettings().look_s
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == FREE
    protocol.receive(b"#10\r")
    assert told(protocol) == [BurstOver(is_full=True)]
    assert burst.written == written


def test_xon_lets_it_go_on_when_there_is_room() -> None:
    protocol, burst = bursting("xonxoff", [b"PU10,20;"] * 1000)
    protocol.bytes_to_send()
    protocol.receive(b"\x13")
    written = burst.written
    protocol.receive(b"\x11")
    assert protocol.bytes_to_send() == FREE
    protocol.receive(b"#200\r")
    assert burst.written > written


def test_slices_go_out_as_the_line_empties() -> None:
    protocol = in_step()
    protocol.pacing = pacing_of("xonxoff", Room.of(1024))
    level = [0]
    protocol.level = LineLevel(1000.0, lambda: level[0])
    protocol.load(Burst("burst", [b"PU10,20;"] * 1000))
    protocol.send("burst")
    first = protocol.bytes_to_send()
    most = protocol.pacing.most_unsent_bytes
    assert most is not None
    assert most - 8 < len(first) <= most
    level[0] = len(first)
    assert protocol.patience_s == pytest.approx((len(first) - most // 2) / 1000)
    level[0] = most // 2
    protocol.time_ran_out()
    assert len(protocol.bytes_to_send()) <= most // 2


@pytest.mark.parametrize(("handshake", "end"), [("enq1", b"\r"), ("enq2", b"")])
def test_an_acknowledged_enquiry_lets_a_block_go(handshake: Handshake, end: bytes) -> None:
    protocol, burst = bursting(handshake, [b"PU10,20;"] * 2)
    assert protocol.bytes_to_send() == b"\x05"
    protocol.receive(b"?" + end + b"<")
    assert protocol.bytes_to_send() == b""
    protocol.receive(b">" + end)
    assert burst.written == 2
    assert protocol.bytes_to_send() == b"PU10,20;" * 2


def test_the_acknowledgement_of_the_dummy_handshake_is_none() -> None:
    protocol, burst = bursting("enq2", [b"PU10,20;"])
    protocol.receive(b"\x06" * 200)
    assert burst.written == 0
    assert any(isinstance(each, Stray) for each in told(protocol))


def test_an_enquiry_that_is_not_acknowledged_is_taken_back_and_free_space_asked_for() -> None:
    protocol, burst = bursting("enq1", [b"PU10,20;"])
    protocol.bytes_to_send()
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == ABORT + FREE
    protocol.receive(b"<>\r<>#40\r")  # an acknowledgement that was on its way already
    assert told(protocol) == [BurstOver(is_full=True)]
    assert burst.written == 0
    assert protocol.pacing is not None
    assert protocol.pacing.free_bytes == 40


@pytest.mark.parametrize("reply", [b"#abc\r", b"#257\r", b"256\r", b"#123456\r"])
def test_free_space_that_cannot_be_puts_the_line_in_doubt(reply: bytes) -> None:
    protocol, burst = bursting("software", [b"PU10,20;"])
    protocol.receive(reply)
    assert isinstance(told(protocol)[0], Unreadable)
    assert protocol.in_doubt
    assert burst.written == 0


def test_a_question_without_an_answer_puts_the_line_in_doubt_and_what_comes_then_is_late() -> None:
    protocol, _ = bursting("software", [b"PU10,20;"])
    protocol.bytes_to_send()
    protocol.time_ran_out()
    assert protocol.in_doubt
    protocol.send_marker()
    protocol.receive(b"#256\r")
    assert told(protocol) == [LateEnding("burst", Answered("256"))]


def test_abort_in_the_middle_of_a_burst_drops_what_was_not_handed_out() -> None:
    protocol, _ = bursting("software", [b"PU10,20;"])
    protocol.preempt(KILL)
    assert protocol.bytes_to_send() == KILL.encode()
    assert told(protocol) == [CutShort("burst", KILL)]


def test_where_the_cable_may_hold_questions_back_they_have_long() -> None:
    settings = CutterSettings(answer_timeout_s=1, held_timeout_s=77)
    protocol = in_step(settings)
    protocol.pacing = pacing_of("hardwire", Room.of(1024))
    protocol.send("\x1b.B")
    assert protocol.patience_s == 77


@given(st.lists(st.integers(min_value=1, max_value=9), max_size=40), st.sampled_from(["software", "enq1", "enq2"]))
def test_replies_in_pieces_of_any_size_say_the_same(pieces: list[int], handshake: Handshake) -> None:
    outcomes = []
    for cut in (pieces, [1000]):
        protocol, burst = bursting(handshake, [b"PU10,20;"] * 3)
        data = b"#200\r" if handshake == "software" else b"?<>" if handshake == "enq2" else b"?\r<>\r"
        at = 0
        for size in itertools.chain(cut, itertools.repeat(1)):
            if at >= len(data):
                break
            protocol.receive(data[at : at + size])
            at += size
        outcomes.append((burst.written, protocol.bytes_to_send(), protocol.state))
    assert outcomes[0] == outcomes[1]
