"""The line of a control, byte by byte: pauses, questions, what is owed, transfers, and what comes unasked."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError, LinkProtocolError
from compax_aio.haas.facts.queries import QUERIES
from compax_aio.haas.profiles import (
    CLASSIC,
    CLASSIC_DC_CODES,
    CLASSIC_RTS_CTS,
    CLASSIC_XMODEM,
    NEXT_GENERATION,
    Profile,
)
from compax_aio.haas.protocol import HaasProtocol
from compax_aio.haas.protocol_events import (
    Answered,
    CutShort,
    HeldBack,
    LeftOver,
    NobodyAnswers,
    Overheard,
    Printed,
    ReaderOff,
    ReaderOn,
    TransferOver,
    Unreadable,
)
from compax_aio.haas.protocol_states import BUSY, DOUBTFUL, TRANSITIONS, State, Step
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfers.account import Ending
from compax_aio.haas.transfers.choosing import drip_feed, receive_file, send_file
from compax_aio.haas.transfers.notes import TransferBegan, TransferHeld
from compax_aio.haas.transfers.strategy import Patience, Strategy
from compax_aio.link.contract import Event, GoesOn, InStep, LateEnding, MarkerSpent, TurnOver
from compax_aio.link.level import LineLevel

DC1, DC3 = b"\x11", b"\x13"
SETTINGS = ControlSettings()
PATIENCE = Patience()
FILE = b"%\r\nN0 V12345\r\nN1 V100\r\n%\r\n"


def told(protocol: HaasProtocol) -> list[Event]:
    """List what was noticed, but for steps."""
    return [each for each in protocol.events() if not isinstance(each, GoesOn)]


def framed(text: str) -> bytes:
    return b"\x02" + text.encode() + b"\x17\r\n>"


def opened(profile: Profile = CLASSIC) -> HaasProtocol:
    protocol = HaasProtocol(profile, SETTINGS)
    protocol.line_opened()
    return protocol


def in_step(profile: Profile = CLASSIC) -> HaasProtocol:
    protocol = opened(profile)
    protocol.send_marker()
    protocol.time_ran_out()
    assert told(protocol) == [InStep()]
    return protocol


def asking(text: str = "Q100", profile: Profile = CLASSIC) -> HaasProtocol:
    protocol = in_step(profile)
    protocol.send(text)
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == (profile.request_prefix + text + profile.request_end).encode()
    protocol.events()
    return protocol


def owing(*questions: str) -> HaasProtocol:
    """Return a line on which these questions were not answered in time."""
    protocol = asking(questions[0])
    protocol.time_ran_out()
    for text in questions[1:]:
        back_in_step(protocol)
        protocol.send(text)
        protocol.time_ran_out()  # the pause
        protocol.time_ran_out()  # the question that is asked first
    back_in_step(protocol)
    protocol.bytes_to_send()
    protocol.events()
    return protocol


def back_in_step(protocol: HaasProtocol) -> None:
    protocol.send_marker()
    protocol.time_ran_out()


def receiving(protocol: HaasProtocol, synchronization: str = "xon/xoff") -> list[bytes]:
    """Begin to receive a file; return where its pieces come."""
    pieces: list[bytes] = []
    protocol.load(receive_file(synchronization, "receive", pieces.append, patience=PATIENCE, max_bytes=10_000))
    protocol.send("receive")
    return pieces


def sending(protocol: HaasProtocol, synchronization: str = "xon/xoff", data: bytes = FILE) -> Strategy:
    """Begin to send a file, up to the pause in front of it."""
    strategy = send_file(synchronization, "send", data, patience=PATIENCE)
    protocol.load(strategy)
    protocol.send("send")
    return strategy


def only_over(protocol: HaasProtocol) -> TransferOver:
    (over,) = [each for each in protocol.events() if isinstance(each, TransferOver)]
    return over


# In step --------------------------------------------------------------------------------------------------------------


def test_to_get_in_step_nothing_is_sent_and_nothing_must_come() -> None:
    protocol = opened()
    protocol.send_marker()
    assert protocol.bytes_to_send() == b""
    assert protocol.patience_s == SETTINGS.quiet_s
    protocol.time_ran_out()
    assert told(protocol) == [InStep()]
    assert not protocol.in_doubt
    assert protocol.held is None
    protocol.resume()


def test_what_comes_in_the_pause_puts_it_off() -> None:
    protocol = opened()
    protocol.send_marker()
    protocol.receive(b"PART 7\r")
    assert protocol.events() == [Printed("PART 7"), GoesOn()]
    assert protocol.is_busy


def test_a_line_that_never_stops_does_not_get_in_step_and_is_told() -> None:
    protocol = opened()
    protocol.send_marker()
    for _ in range(70):
        protocol.receive(b"N10 G01 X1.2345 Y6.7890 Z0.1250 F100.0 (a file that flows)...\r\n")
    assert MarkerSpent() in protocol.events()
    assert protocol.in_doubt
    assert not protocol.is_busy
    assert protocol.stranger(time_is_over=False) is None
    stranger = protocol.stranger(time_is_over=True)
    assert stranger is not None
    assert "RESET" in stranger.remedy
    back_in_step(protocol)
    assert protocol.stranger(time_is_over=True) is None


def test_a_trickle_that_never_stops_does_not_put_it_off_for_ever() -> None:
    protocol = opened()
    protocol.send_marker()
    for _ in range(257):
        protocol.receive(b"x")
    assert MarkerSpent() in protocol.events()


def test_half_an_answer_and_half_a_line_are_told_when_the_pause_is_over() -> None:
    protocol = opened()
    protocol.send_marker()
    protocol.receive(b"PART\x02S/N, 12")
    protocol.events()
    protocol.time_ran_out()
    assert told(protocol) == [Overheard("S/N, 12"), Printed("PART"), InStep()]


def test_nothing_is_ever_sent_ahead() -> None:
    with pytest.raises(InvalidCommandError, match="no stop"):
        opened().send_ahead("Q100")


def test_what_is_out_of_turn_is_refused() -> None:
    protocol = opened()
    with pytest.raises(LinkProtocolError, match="send begun while in doubt"):
        protocol.send("Q100")
    protocol = asking()
    with pytest.raises(LinkProtocolError, match="send begun while asking"):
        protocol.send("Q101")


def test_what_is_no_question_is_refused() -> None:
    with pytest.raises(InvalidCommandError):
        in_step().send("O1234")


# Questions ------------------------------------------------------------------------------------------------------------


def test_a_question_is_sent_when_the_line_was_silent_for_a_moment() -> None:
    protocol = in_step()
    protocol.send("Q600 3027")
    assert protocol.bytes_to_send() == b""
    assert protocol.patience_s == SETTINGS.gap_s
    protocol.receive(b"PART 7\r")
    assert protocol.events() == [Printed("PART 7"), GoesOn()]
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q600 3027\r\n"
    protocol.receive(framed("MACRO, 3027,    0.0000"))
    assert told(protocol) == [Answered("MACRO, 3027,    0.0000")]
    assert not protocol.is_busy
    assert not protocol.in_doubt


def test_busy_and_unknown_are_answers() -> None:
    for text in ("STATUS, BUSY", "UNKNOWN"):
        protocol = asking("Q500")
        protocol.receive(framed(text))
        assert told(protocol) == [Answered(text)]


def test_over_ethernet_answers_have_another_frame() -> None:
    protocol = asking("Q600 3027", NEXT_GENERATION)
    protocol.receive(b">MACRO, 0.0\r\n")
    assert told(protocol) == [Answered("MACRO, 0.0")]


def test_a_late_echo_is_none_of_what_programs_print() -> None:
    protocol = owing("Q100")
    protocol.send("Q101")
    protocol.time_ran_out()
    protocol.receive(b"Q100\r\n" + framed("S/N, 1") + b"Q101\r\n" + framed("SOFTWARE, 2"))
    assert told(protocol) == [LateEnding("Q100", Answered("S/N, 1")), Answered("SOFTWARE, 2")]


def test_what_a_line_owes_that_was_lost_the_next_one_may_bring() -> None:
    protocol = asking("Q600 500")
    protocol.line_lost()
    protocol.line_opened()
    back_in_step(protocol)
    protocol.send("Q600 501")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q100\r\n"
    protocol.receive(framed("MACRO, 7.0"))
    protocol.events()
    assert protocol.state is State.CATCHING_UP


@pytest.mark.parametrize(
    ("characters_per_s", "quiet_s"), [(960.0, SETTINGS.gap_s), (30.0, 16 / 30), (None, SETTINGS.gap_s)]
)
def test_on_a_slow_line_a_pause_is_longer_than_what_a_uart_holds_back(
    characters_per_s: float | None, quiet_s: float
) -> None:
    protocol = in_step()
    protocol.level = LineLevel(characters_per_s)
    protocol.send("Q100")
    assert protocol.patience_s == pytest.approx(quiet_s)


def test_what_the_bytes_before_it_take_and_its_own_is_added_to_the_time_of_an_answer() -> None:
    protocol = in_step()
    protocol.level = LineLevel(1000.0, lambda: 500)
    protocol.send("Q100")
    protocol.time_ran_out()
    patience_s = protocol.patience_s
    assert patience_s == pytest.approx(SETTINGS.answer_timeout_s + 0.506 + 0.064)


def test_an_echo_is_no_print() -> None:
    protocol = asking("Q100")
    protocol.receive(b"Q100\r\n" + framed("S/N, 1234567"))
    assert told(protocol) == [Answered("S/N, 1234567")]


def test_an_answer_to_something_else_answers_nothing() -> None:
    protocol = asking("Q100")
    protocol.receive(framed("USING TOOL, 4"))
    assert told(protocol) == [Overheard("USING TOOL, 4")]
    assert protocol.is_busy
    protocol.receive(framed("S/N, 1"))
    assert told(protocol) == [Answered("S/N, 1")]


@pytest.mark.parametrize("data", [framed("S/M, 1234567"), b"\x02S/N, 12\x0134567\x17\r\n>"])
def test_a_garbled_answer_is_told_and_another_one_may_still_come(data: bytes) -> None:
    protocol = asking("Q100")
    protocol.receive(data)
    (unreadable,) = told(protocol)
    assert isinstance(unreadable, Unreadable)
    assert unreadable.sent == "Q100"
    assert protocol.in_doubt
    back_in_step(protocol)
    protocol.receive(framed("S/N, 1234567"))
    assert LateEnding("Q100", Answered("S/N, 1234567")) in protocol.events()


def test_an_answer_with_a_damaged_byte_is_none() -> None:
    protocol = asking("Q100")
    protocol.receive(b"\x02S/N, 12\xb334567\x17\r\n>")
    assert isinstance(told(protocol)[0], Unreadable)


def test_half_an_answer_of_before_is_not_joined_to_the_next_one() -> None:
    protocol = in_step()
    protocol.receive(b"\x02S/N, 99")
    protocol.send("Q100")
    protocol.time_ran_out()
    protocol.receive(b"\x02S/N, 1\x17\r\n>")
    assert told(protocol) == [Overheard("S/N, 99"), Answered("S/N, 1")]


# What is owed ---------------------------------------------------------------------------------------------------------


def test_an_answer_that_comes_late_is_known_as_late() -> None:
    protocol = owing("Q201")
    protocol.receive(framed("USING TOOL, 4"))
    assert told(protocol) == [LateEnding("Q201", Answered("USING TOOL, 4"))]


def test_while_something_is_owed_another_question_goes_first() -> None:
    protocol = owing("Q500")
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q100\r\n"
    protocol.receive(framed("STATUS, BUSY"))
    assert told(protocol) == [LateEnding("Q500", Answered("STATUS, BUSY"))]
    protocol.receive(framed("S/N, 1"))
    assert told(protocol) == []
    assert protocol.patience_s == SETTINGS.gap_s
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"
    protocol.receive(framed("PROGRAM, O00010, IDLE, PARTS, 42"))
    assert told(protocol) == [Answered("PROGRAM, O00010, IDLE, PARTS, 42")]


def test_the_question_that_goes_first_is_one_that_is_not_owed_itself() -> None:
    protocol = owing("Q100")
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q101\r\n"
    protocol.receive(framed("S/N, 1"))
    assert told(protocol) == [LateEnding("Q100", Answered("S/N, 1"))]


def test_a_question_whose_answer_cannot_be_mistaken_is_asked_at_once_although_something_is_owed() -> None:
    protocol = owing("Q500")
    protocol.send("Q201")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q201\r\n"
    protocol.receive(framed("STATUS, BUSY"))
    assert told(protocol) == [LateEnding("Q500", Answered("STATUS, BUSY"))]
    protocol.receive(framed("USING TOOL, 4"))
    assert told(protocol) == [Answered("USING TOOL, 4")]
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"


def test_what_was_asked_before_something_that_is_answered_is_owed_no_more() -> None:
    protocol = owing("Q500")
    protocol.send("Q201")
    protocol.time_ran_out()
    protocol.receive(framed("USING TOOL, 4"))
    protocol.bytes_to_send()
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"


def test_what_was_asked_before_something_that_is_answered_late_is_owed_no_more() -> None:
    protocol = owing("Q500", "Q201")
    protocol.receive(framed("USING TOOL, 4"))
    assert told(protocol) == [LateEnding("Q201", Answered("USING TOOL, 4"))]
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"


def test_a_question_that_is_owed_itself_is_not_asked_before_that_is_settled() -> None:
    protocol = owing("Q201")
    protocol.send("Q201")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q100\r\n"


def test_an_answer_that_says_nothing_of_what_it_answers_does_not_show_that_nothing_is_owed() -> None:
    protocol = owing("Q500")
    protocol.send("Q500")
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.receive(framed("STATUS, BUSY") * 2)
    assert told(protocol) == [LateEnding("Q500", Answered("STATUS, BUSY")), Overheard("STATUS, BUSY")]
    assert protocol.state is State.CATCHING_UP


def test_when_that_is_unanswered_too_the_question_is_not_sent() -> None:
    protocol = owing("Q500")
    protocol.send("Q600 1")
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.time_ran_out()
    assert told(protocol) == [NobodyAnswers("Q600 1", "Q100")]
    assert protocol.bytes_to_send() == b""
    assert protocol.in_doubt
    back_in_step(protocol)
    protocol.send("Q600 1")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q101\r\n"


def test_a_control_that_never_answers_is_asked_again_and_again() -> None:
    protocol = owing("Q500", *["Q500"] * 40)
    protocol.send("Q500")
    protocol.time_ran_out()
    asked = protocol.bytes_to_send().strip().decode()
    assert asked in QUERIES
    answer = QUERIES[asked].classic_example
    protocol.receive(framed(answer))
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"


def test_a_write_is_never_asked_first_and_its_late_answer_is_known() -> None:
    protocol = owing("E500 1.5")
    protocol.receive(framed("!"))
    assert told(protocol) == [LateEnding("E500 1.5", Answered("!"))]


def test_a_new_line_owes_nothing() -> None:
    protocol = owing("Q500")
    protocol.line_lost()
    protocol.line_opened()
    back_in_step(protocol)
    protocol.send("Q201")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q201\r\n"


# Xoff -----------------------------------------------------------------------------------------------------------------


def test_a_control_that_says_stop_is_asked_nothing_until_it_says_go_on() -> None:
    protocol = in_step()
    protocol.receive(DC3)
    protocol.send("Q100")
    assert protocol.patience_s == SETTINGS.silence_timeout_s
    protocol.receive(b"x")
    assert GoesOn() not in protocol.events()
    protocol.receive(DC1)
    assert GoesOn() in protocol.events()
    assert protocol.patience_s == SETTINGS.gap_s
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q100\r\n"


def test_a_stop_that_comes_in_the_pause_counts_too() -> None:
    protocol = in_step()
    protocol.send("Q100")
    protocol.receive(DC3)
    assert protocol.events() == [GoesOn()]
    assert protocol.patience_s == SETTINGS.silence_timeout_s


def test_a_control_that_never_says_go_on_is_told_and_asked_the_next_time() -> None:
    protocol = in_step()
    protocol.receive(DC3)
    protocol.send("Q100")
    protocol.time_ran_out()
    assert told(protocol) == [HeldBack("Q100", by_xoff=True)]
    assert protocol.bytes_to_send() == b""
    back_in_step(protocol)
    protocol.send("Q100")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q100\r\n"


def test_signs_within_an_answer_are_no_part_of_it() -> None:
    protocol = asking("Q100")
    protocol.receive(b"\x02S/N, 12" + DC3 + b"34" + DC1 + b"\x17\r\n>")
    assert told(protocol) == [Answered("S/N, 1234")]


def test_a_program_that_prints_without_end_keeps_questions_back_and_that_is_told() -> None:
    protocol = in_step()
    protocol.send("Q100")
    for _ in range(300):
        protocol.receive(b"PART 50% DONE\r")
    assert HeldBack("Q100", by_xoff=False) in protocol.events()
    assert protocol.bytes_to_send() == b""


def test_with_wires_signs_mean_nothing() -> None:
    protocol = in_step(CLASSIC_RTS_CTS)
    protocol.receive(DC3)
    protocol.send("Q100")
    assert protocol.patience_s == SETTINGS.gap_s


def test_with_dc_codes_a_reader_that_nobody_waits_for_is_told_and_holds_nothing() -> None:
    protocol = in_step(CLASSIC_DC_CODES)
    protocol.receive(DC1 + DC3)
    assert told(protocol) == [ReaderOn(), ReaderOff()]
    protocol.send("Q100")
    assert protocol.patience_s == SETTINGS.gap_s


# Transfers ------------------------------------------------------------------------------------------------------------


def test_a_file_is_awaited_at_once_and_comes_whole() -> None:
    protocol = in_step()
    pieces = receiving(protocol)
    assert protocol.is_busy
    assert protocol.patience_s == PATIENCE.start_s
    protocol.receive(FILE)
    assert protocol.events() == [TransferBegan("receive"), GoesOn()]
    assert protocol.patience_s == PATIENCE.tail_s
    protocol.time_ran_out()
    (over,) = told(protocol)
    assert isinstance(over, TransferOver)
    assert over.account.ending is Ending.COMPLETE
    assert b"".join(pieces) == FILE
    assert not protocol.in_doubt


def test_a_file_that_does_not_come_leaves_the_line_in_doubt() -> None:
    protocol = in_step()
    receiving(protocol)
    protocol.time_ran_out()
    assert only_over(protocol).account.ending is Ending.NOT_STARTED
    assert protocol.in_doubt


def test_what_is_printed_in_front_of_a_file_is_told() -> None:
    protocol = in_step()
    pieces = receiving(protocol)
    protocol.receive(b"PART 7\r" + FILE)
    assert Printed("PART 7") in protocol.events()
    assert b"".join(pieces) == FILE


@pytest.mark.parametrize("at", [0, 3, 8, len(FILE)])
def test_a_late_answer_within_a_file_is_taken_out(at: int) -> None:
    protocol = owing("Q201")
    pieces = receiving(protocol)
    protocol.receive(FILE[:at] + framed("USING TOOL, 4") + FILE[at:])
    assert LateEnding("Q201", Answered("USING TOOL, 4")) in protocol.events()
    protocol.time_ran_out()
    assert b"".join(pieces) == FILE


def test_the_rest_of_an_answer_in_front_of_a_file_is_none_of_it() -> None:
    protocol = asking("Q100")
    protocol.receive(b"\x02S/N, 1\x17")
    assert told(protocol) == [Answered("S/N, 1")]
    pieces = receiving(protocol)
    protocol.receive(b"\r\n>" + FILE)
    protocol.time_ran_out()
    assert b"".join(pieces) == FILE


def test_an_answer_that_nobody_owes_is_a_part_of_the_file_if_it_stands_in_one() -> None:
    protocol = in_step()
    pieces = receiving(protocol)
    data = FILE[:8] + framed("S/N, 1") + FILE[8:]
    protocol.receive(data)
    protocol.time_ran_out()
    assert b"".join(pieces) == data


def test_what_looks_like_an_answer_and_is_none_stays_in_the_file_as_damage() -> None:
    protocol = owing("Q201")
    pieces = receiving(protocol)
    long = b"N1 G01 X1.\r\n" * 40
    protocol.receive(b"%\r\n\x02" + long + b"%\r\n")
    protocol.time_ran_out()
    account = only_over(protocol).account
    assert b"".join(pieces) == b"%\r\n\x02" + long + b"%\r\n"
    assert account.damage_offsets == (3,)


def test_a_damaged_byte_of_a_file_is_told_at_its_place() -> None:
    protocol = in_step()
    pieces = receiving(protocol)
    data = bytearray(FILE)
    data[12] |= 0x80
    protocol.receive(bytes(data))
    protocol.time_ran_out()
    assert only_over(protocol).account.damage_offsets == (12,)
    assert b"".join(pieces) == bytes(data)


def test_parity_in_the_bytes_is_put_on_and_taken_off() -> None:
    profile = replace(CLASSIC, parity_in="bytes")
    protocol = in_step(profile)
    protocol.send("Q100")
    protocol.time_ran_out()
    sent = protocol.bytes_to_send()
    assert bytes(byte & 0x7F for byte in sent) == b"Q100\r\n"
    assert all(byte.bit_count() % 2 == 0 for byte in sent)


def test_a_file_goes_out_when_the_line_was_silent_for_a_moment() -> None:
    protocol = in_step()
    sending(protocol)
    assert protocol.patience_s == SETTINGS.gap_s
    assert protocol.bytes_to_send() == b""
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == FILE[:16]
    protocol.receive(DC3)
    assert TransferHeld("send", 16, 0) in protocol.events()
    assert protocol.patience_s == PATIENCE.body_s
    protocol.receive(DC1)
    assert protocol.bytes_to_send() == FILE[16:]
    protocol.time_ran_out()
    protocol.time_ran_out()
    over = only_over(protocol)
    assert (over.account.ending, over.account.bytes) == (Ending.COMPLETE, len(FILE))
    assert not protocol.in_doubt


def test_signs_that_come_in_one_piece_let_no_more_out_than_may_wait() -> None:
    protocol = in_step()
    sending(protocol, data=FILE * 20)
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.receive((DC3 + DC1) * 5)
    assert len(protocol.bytes_to_send()) <= 16


def test_half_an_answer_while_a_file_is_sent_is_not_joined_to_the_next_one() -> None:
    protocol = in_step()
    sending(protocol)
    protocol.time_ran_out()
    protocol.receive(b"\x02S/N, 99")
    while protocol.is_busy:
        protocol.bytes_to_send()
        protocol.time_ran_out()
    assert only_over(protocol).account.ending is Ending.COMPLETE
    protocol.receive(b"7\x17\r\n>")
    assert Overheard("S/N, 997") not in told(protocol)


def test_a_file_waits_longer_when_an_answer_is_owed() -> None:
    protocol = owing("Q201")
    sending(protocol)
    assert protocol.patience_s == SETTINGS.quiet_s
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.receive(framed("USING TOOL, 4"))
    assert LateEnding("Q201", Answered("USING TOOL, 4")) in protocol.events()


def test_a_file_is_not_sent_to_a_control_that_says_stop() -> None:
    protocol = in_step()
    protocol.receive(DC3)
    sending(protocol)
    protocol.time_ran_out()
    assert told(protocol) == [HeldBack("send", by_xoff=True)]
    assert protocol.bytes_to_send() == b""


def test_recv_may_be_pressed_before_a_file_is_sent() -> None:
    protocol = in_step(CLASSIC_DC_CODES)
    protocol.receive(DC1)
    sending(protocol, "dc codes")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == FILE[:16]
    protocol = in_step(CLASSIC_DC_CODES)
    protocol.receive(DC1 + DC3)
    sending(protocol, "dc codes")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b""


def test_a_reader_that_was_on_counts_for_one_file() -> None:
    protocol = in_step(CLASSIC_DC_CODES)
    protocol.receive(DC1)
    sending(protocol, "dc codes")
    protocol.time_ran_out()
    protocol.preempt("send")
    protocol.bytes_to_send()
    protocol.time_ran_out()
    sending(protocol, "dc codes")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b""


def test_what_is_printed_while_a_file_is_sent_is_told() -> None:
    protocol = in_step()
    sending(protocol)
    protocol.time_ran_out()
    protocol.receive(b"PART 7\r" + framed("S/N, 1"))
    assert told(protocol) == [TransferBegan("send"), Printed("PART 7"), Overheard("S/N, 1")]


def test_giving_up_a_sending_writes_no_more_and_waits_until_the_line_is_quiet() -> None:
    protocol = in_step()
    sending(protocol)
    protocol.time_ran_out()
    protocol.bytes_to_send()
    protocol.preempt("send")
    assert protocol.bytes_to_send() == b""
    over = only_over(protocol)
    assert (over.account.ending, over.account.written_bytes) == (Ending.GIVEN_UP, 16)
    assert protocol.is_busy
    assert protocol.in_doubt
    protocol.time_ran_out()
    assert told(protocol) == [InStep()]


def test_giving_up_a_reception_drops_what_still_comes_of_it() -> None:
    protocol = in_step()
    pieces = receiving(protocol)
    protocol.receive(FILE[:10])
    protocol.preempt("receive")
    protocol.receive(FILE[10:])
    events = protocol.events()
    assert LeftOver(len(FILE) - 10) in events
    assert not [each for each in events if isinstance(each, Printed)]
    assert b"".join(pieces) == FILE[:10]
    protocol.time_ran_out()
    protocol.receive(b"PART 7\r")
    assert Printed("PART 7") in protocol.events()


def test_giving_up_xmodem_tells_the_control() -> None:
    protocol = in_step(CLASSIC_XMODEM)
    sending(protocol, "xmodem")
    protocol.time_ran_out()
    protocol.receive(b"\x15")
    assert len(protocol.bytes_to_send()) == 132
    protocol.preempt("send")
    assert protocol.bytes_to_send() == b"\x18\x18\x18"


def test_xmodem_has_all_that_comes() -> None:
    protocol = in_step(CLASSIC_XMODEM)
    pieces = receiving(protocol, "xmodem")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"\x15"
    data = bytes(range(128))
    protocol.receive(b"\x01\x01\xfe" + data + bytes([sum(data) & 0xFF]))
    assert protocol.bytes_to_send() == b"\x06"
    assert b"".join(pieces) == data


def test_giving_up_a_question_leaves_its_answer_owed() -> None:
    protocol = asking("Q500")
    protocol.preempt("something")
    assert told(protocol) == [CutShort("Q500")]
    protocol.receive(framed("STATUS, BUSY"))
    assert told(protocol) == [LateEnding("Q500", Answered("STATUS, BUSY"))]


def test_giving_up_while_the_question_that_goes_first_is_asked_leaves_that_owed() -> None:
    protocol = owing("Q500")
    protocol.send("Q600 1")
    protocol.time_ran_out()
    protocol.preempt("something")
    assert told(protocol) == [CutShort("Q600 1")]
    protocol.receive(framed("S/N, 1"))
    assert told(protocol) == [LateEnding("Q100", Answered("S/N, 1"))]


def test_giving_up_before_anything_was_sent_leaves_nothing_owed() -> None:
    protocol = in_step()
    protocol.send("Q500")
    protocol.preempt("something")
    assert told(protocol) == [CutShort("Q500")]
    protocol.time_ran_out()
    protocol.send("Q500")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == b"Q500\r\n"


def test_giving_up_with_nothing_outstanding_is_a_pause() -> None:
    protocol = in_step()
    protocol.preempt("something")
    assert told(protocol) == []
    protocol.time_ran_out()
    assert told(protocol) == [InStep()]


def test_a_line_that_is_lost_ends_a_transfer() -> None:
    protocol = in_step()
    strategy = sending(protocol)
    protocol.time_ran_out()
    protocol.line_lost()
    assert strategy.ending is Ending.LINE_LOST
    assert protocol.bytes_to_send() == b""
    assert protocol.in_doubt


def test_a_drip_feed_is_a_transfer_like_another() -> None:
    protocol = in_step()
    protocol.load(drip_feed("xon/xoff", "drip", FILE, patience=PATIENCE))
    protocol.send("drip")
    protocol.time_ran_out()
    assert protocol.bytes_to_send() == FILE[:16]


# All of it ------------------------------------------------------------------------------------------------------------


def test_every_state_can_be_reached_and_left() -> None:
    reached = {state for (_, step), state in TRANSITIONS.items() if step not in {Step.LINE_OPENED, Step.LINE_LOST}}
    left = {before for before, step in TRANSITIONS if step not in {Step.LINE_OPENED, Step.LINE_LOST, Step.PREEMPTED}}
    assert reached == left == set(State)
    assert {State.IN_DOUBT, State.QUIETING} == DOUBTFUL
    assert set(State) - {State.IN_DOUBT, State.READY} == BUSY


STREAM = b"PART 7\r" + framed("S/N, 1") + b"\n" + FILE + b"\x02" + DC3 + b"noise" + DC1 + framed("USING TOOL, 4") + FILE


LINES: list[Callable[[], HaasProtocol]] = [
    in_step,
    asking,
    lambda: owing("Q201"),
    opened,
    lambda: in_step(CLASSIC_DC_CODES),
]


@given(cuts=st.lists(st.integers(0, len(STREAM)), max_size=20), state=st.integers(0, len(LINES) - 1))
def test_pieces_of_any_size_make_no_difference(cuts: Sequence[int], state: int) -> None:
    def outcome(pieces: list[bytes]) -> tuple[list[Event], bytes]:
        protocol = LINES[state]()
        files = receiving(protocol) if state in {0, 2, 4} else []
        events: list[Event] = []
        for piece in pieces:
            protocol.receive(piece)
            events += told(protocol)
        if protocol.is_busy:
            protocol.time_ran_out()
        return events + told(protocol), b"".join(files)

    places = sorted({0, len(STREAM), *cuts})
    pieces = [STREAM[begin:end] for begin, end in pairwise(places)]
    assert outcome(pieces) == outcome([STREAM])


class Conversation:
    """
    A line and a control that answers, late, or never; in order, and each question once at most.

    Every question that is written is numbered, and each answer knows the number of the one that it answers.
    """

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.protocol = opened()
        self.unanswered: list[tuple[int, str]] = []
        self.written = 0
        self.outstanding: tuple[int, str] | None = None
        """The question whose turn it is, and its number when it was written; 0: it has not been."""

    def take(self, answering: int | None = None) -> None:
        """Let the control hear, and check what is told."""
        data = self.protocol.bytes_to_send()
        assert data.count(b"\r\n") <= 1, "more than one question at a time"
        if data:
            self.written += 1
            text = data.decode().strip()
            self.unanswered.append((self.written, text))
            if self.outstanding is not None and self.protocol.state is State.ASKING:
                self.outstanding = (self.written, text)
        for event in self.protocol.events():
            if isinstance(event, Answered):
                assert self.outstanding is not None
                assert self.outstanding[0] == answering, f"{self.outstanding} got the answer to {answering}"
            if isinstance(event, TurnOver):
                self.outstanding = None

    def send(self) -> None:
        if not (self.protocol.is_busy or self.protocol.in_doubt):
            self.outstanding = (0, self.chance.choice(["Q500", "Q600 1", "Q100", "Q201"]))
            self.protocol.send(self.outstanding[1])
            self.take()

    def let_time_pass(self) -> None:
        if self.protocol.state is State.ASKING:
            self.protocol.time_ran_out()
            self.outstanding = None
        elif self.protocol.is_busy:
            self.protocol.time_ran_out()
        elif self.protocol.in_doubt:
            self.protocol.send_marker()
        self.take()

    def answer(self) -> None:
        if self.unanswered:
            number, text = self.unanswered.pop(0)
            answers = {
                "Q500": ["STATUS, BUSY", f"PROGRAM, O1, IDLE, PARTS, {number}"],
                "Q600 1": [f"MACRO, {number}", f"MACRO, 1, {number}", "STATUS, BUSY", "UNKNOWN"],
            }
            own = answers.get(text) or [f"{QUERIES[text].classic}, {number}"]
            self.protocol.receive(framed(self.chance.choice(own)))
            self.take(number)

    def lose_an_answer(self) -> None:
        if self.unanswered:
            self.unanswered.pop(0)

    def print(self) -> None:
        self.protocol.receive(b"PART 7\r")
        self.take()

    def preempt(self) -> None:
        if self.chance.random() < 0.2:
            self.protocol.preempt("x")
            self.take()

    def reopen(self) -> None:
        if self.chance.random() < 0.05:
            self.protocol.line_lost()
            self.protocol.line_opened()
            self.unanswered.clear()
            self.outstanding = None
            self.take()


@pytest.mark.parametrize("seed", range(200))
def test_whatever_happens_one_thing_is_outstanding_and_no_late_answer_is_credited(seed: int) -> None:
    chance = random.Random(seed)
    talk = Conversation(chance)
    doings = [talk.send, talk.lose_an_answer, talk.print, talk.preempt, talk.reopen]
    doings += [talk.let_time_pass, talk.answer] * 2
    for _ in range(300):
        chance.choice(doings)()
    for _ in range(5):  # with nothing coming, each turn is over after a few pauses
        if talk.protocol.is_busy:
            talk.protocol.time_ran_out()
    assert not talk.protocol.is_busy
