"""The COMPAX line, byte by byte and without an event loop: turns, messages, noise, doubt."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from typing import Final
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from tests.fakes.answers import PROMPT, answer_to

from compax_aio.compax.binary import BinaryTransfer
from compax_aio.compax.facts.status import MARKERS
from compax_aio.compax.protocol import (
    TRANSITIONS,
    Acknowledged,
    Answered,
    ComparatorReached,
    CompaxProtocol,
    MessageForm,
    PositionReached,
    Rejected,
    State,
    Stray,
    UnexpectedAnswer,
)
from compax_aio.compax.protocol_states import LineOpened
from compax_aio.errors import LinkProtocolError
from compax_aio.link.contract import Event, InStep, LateEnding, MarkerSpent, TurnOver

Message = PositionReached | ComparatorReached

# Situations -----------------------------------------------------------------------------------------------------------


def ask_marker(protocol: CompaxProtocol) -> str:
    """Send the next marker and return its line."""
    protocol.send_marker()
    return protocol.bytes_to_send().decode().removesuffix("\r")


def in_step(message_form: MessageForm = MessageForm.UNKNOWN) -> CompaxProtocol:
    protocol = CompaxProtocol(message_form)
    protocol.line_opened()
    protocol.receive(answer_to(ask_marker(protocol)))
    assert protocol.events() == [InStep()]
    return protocol


def waiting_for(line: str, message_form: MessageForm = MessageForm.UNKNOWN) -> CompaxProtocol:
    protocol = in_step(message_form)
    protocol.send(line)
    assert protocol.bytes_to_send() == line.encode() + b"\r"
    return protocol


def in_doubt_about(line: str, message_form: MessageForm = MessageForm.UNKNOWN) -> CompaxProtocol:
    protocol = waiting_for(line, message_form)
    protocol.time_ran_out()
    return protocol


def newly_opened() -> CompaxProtocol:
    protocol = CompaxProtocol()
    protocol.line_opened()
    return protocol


def marker_outstanding(*, after: str | None = None) -> CompaxProtocol:
    protocol = in_doubt_about(after) if after else newly_opened()
    ask_marker(protocol)
    return protocol


def stop_ahead(*, after: str | None = None) -> CompaxProtocol:
    protocol = in_doubt_about(after) if after else newly_opened()
    protocol.send_ahead("STOP")
    protocol.bytes_to_send()
    return protocol


def frame_outstanding() -> CompaxProtocol:
    protocol = in_step()
    protocol.encode = BinaryTransfer(motion=True).encode
    protocol.send("PA100")
    protocol.bytes_to_send()
    return protocol


def frame_in_doubt(*, stop_ahead: bool = False) -> CompaxProtocol:
    protocol = frame_outstanding()
    protocol.time_ran_out()
    if stop_ahead:
        protocol.send_ahead("STOP")
        protocol.bytes_to_send()
    return protocol


SITUATIONS: Final[dict[str, Callable[[], CompaxProtocol]]] = {
    "in step": in_step,
    "query outstanding": lambda: waiting_for("S1"),
    "command outstanding": lambda: waiting_for("SD50"),
    "command with $ outstanding": lambda: waiting_for("PA100$"),
    "command with $ outstanding, prompt comes first": lambda: waiting_for("PA100$", MessageForm.PROMPT_FIRST),
    "newly opened": newly_opened,
    "marker outstanding": marker_outstanding,
    "query in doubt": lambda: in_doubt_about("S1"),
    "command in doubt": lambda: in_doubt_about("PA100$"),
    "command in doubt, marker outstanding": lambda: marker_outstanding(after="SD50"),
    "command with $ in doubt, marker outstanding": lambda: marker_outstanding(after="PA100$"),
    "query in doubt, marker outstanding": lambda: marker_outstanding(after="S1"),
    "stop ahead": stop_ahead,
    "stop ahead of a doubtful command": lambda: stop_ahead(after="PA100$"),
    "motion frame outstanding": frame_outstanding,
    "motion frame in doubt": frame_in_doubt,
    "stop ahead of a doubtful motion frame": lambda: frame_in_doubt(stop_ahead=True),
}

situations = pytest.mark.parametrize("situation", SITUATIONS.values(), ids=SITUATIONS.keys())


def read(protocol: CompaxProtocol, data: bytes) -> list[Event]:
    protocol.receive(data)
    return protocol.events()


# Turns ----------------------------------------------------------------------------------------------------------------


def test_a_new_protocol_is_in_doubt_and_sends_nothing_by_itself() -> None:
    protocol = CompaxProtocol()
    assert protocol.in_doubt
    assert not protocol.is_busy
    assert protocol.bytes_to_send() == b""


def test_a_command_is_acknowledged_by_a_bare_prompt() -> None:
    protocol = waiting_for("SD50")
    assert (protocol.is_busy, protocol.in_doubt) == (True, False)
    assert read(protocol, PROMPT) == [Acknowledged()]
    assert protocol.state is State.READY
    assert (protocol.is_busy, protocol.in_doubt) == (False, False)


def test_bytes_to_send_are_given_once() -> None:
    protocol = in_step()
    protocol.send("S1")
    assert protocol.bytes_to_send() == b"S1\r"
    assert protocol.bytes_to_send() == b""


def test_events_are_given_once() -> None:
    protocol = waiting_for("SD50")
    protocol.receive(PROMPT)
    assert protocol.events()
    assert protocol.events() == []


@situations
def test_only_a_ready_line_takes_a_command(situation: Callable[[], CompaxProtocol]) -> None:
    protocol = situation()
    if protocol.state is State.READY:
        protocol.send("S2")
        return
    with pytest.raises(LinkProtocolError, match="CommandSent"):
        protocol.send("S2")
    assert protocol.bytes_to_send() == b""


@situations
def test_markers_and_what_goes_ahead_are_only_for_a_free_line_in_doubt(
    situation: Callable[[], CompaxProtocol],
) -> None:
    for send in (CompaxProtocol.send_marker, lambda protocol: protocol.send_ahead("STOP")):
        protocol = situation()
        may_be_sent = protocol.held is None or send is not CompaxProtocol.send_marker
        if protocol.in_doubt and not protocol.is_busy and may_be_sent:
            send(protocol)
            assert protocol.is_busy
        else:
            with pytest.raises(LinkProtocolError):
                send(protocol)
            assert protocol.bytes_to_send() == b""


@situations
def test_time_runs_out_only_for_something_outstanding(situation: Callable[[], CompaxProtocol]) -> None:
    protocol = situation()
    if protocol.is_busy:
        may_be_cut = protocol.held is not None or protocol.state is State.AWAITING_FRAME
        protocol.time_ran_out()
        assert protocol.state is (State.FRAME_IN_DOUBT if may_be_cut else State.IN_DOUBT)
    else:
        with pytest.raises(LinkProtocolError):
            protocol.time_ran_out()


def test_misuse_names_the_line_that_is_outstanding() -> None:
    with pytest.raises(LinkProtocolError) as caught:
        waiting_for("PA100$").send("S1")
    assert caught.value.sent == "PA100$"
    assert caught.value.hint


@situations
def test_a_line_that_is_opened_again_is_in_doubt(situation: Callable[[], CompaxProtocol]) -> None:
    protocol = situation()
    protocol.receive(b"half a li")
    may_be_cut = protocol.held is not None or protocol.state is State.AWAITING_FRAME
    protocol.line_opened()
    assert protocol.state is (State.FRAME_IN_DOUBT if may_be_cut else State.IN_DOUBT)
    protocol.resume()
    marker = ask_marker(protocol)
    assert InStep() in read(protocol, answer_to(marker))


def test_every_state_knows_messages_noise_and_a_new_line() -> None:
    """The three things that can happen at any time."""
    for state, event in itertools.product(State, (PositionReached, ComparatorReached, Stray, LineOpened)):
        assert (state, event) in TRANSITIONS


def test_every_state_can_be_entered_and_left_for_ready() -> None:
    reachable = {State.READY}
    for _ in State:
        reachable |= {after for (before, _), after in TRANSITIONS.items() if before in reachable}
    assert reachable == set(State)
    returning = {State.READY}
    for _ in State:
        returning |= {before for (before, _), after in TRANSITIONS.items() if after in returning}
    assert returning == set(State)


def test_only_a_settled_doubt_or_an_ended_turn_makes_the_line_ready() -> None:
    into_ready = {
        event for (before, event), after in TRANSITIONS.items() if after is State.READY and before is not State.READY
    }
    assert into_ready == {Acknowledged, Answered, Rejected, InStep}


# Answers --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sent", ["S1", "S01", "S001"])
@pytest.mark.parametrize(
    "answer",
    [
        "S001: 12.50",
        "S1: 12.50",
        "S01:12.50",
        "S001=12.50",
        "S001 = 12.50",
        "S001 +12.50",
        "S001:    12.50   ",
        "  S001: 12.50",
        "S001: 12.50 mm",
        "S001:",
    ],
)
def test_a_query_is_answered_by_its_letter_and_number_in_any_dress(sent: str, answer: str) -> None:
    protocol = waiting_for(sent)
    assert read(protocol, answer.encode() + PROMPT) == [Answered(answer.strip())]
    assert protocol.state is State.READY


@pytest.mark.parametrize("sent", ["P40", "V5", "N5", "S18"])
def test_parameters_variables_and_records_are_answered_alike(sent: str) -> None:
    assert read(waiting_for(sent), answer_to(sent, 7)) == [Answered(answer_to(sent, 7)[:-3].decode())]


@pytest.mark.parametrize("other", ["S010: 1", "S011: 1", "S100: 1", "P001: 1", "S1000: 1", "V001: 1", "s001: 1"])
def test_an_answer_to_something_else_is_not_taken(other: str) -> None:
    protocol = waiting_for("S1")
    assert read(protocol, other.encode() + PROMPT) == [Stray(other)]
    assert read(protocol, answer_to("S1", 3)) == [Answered("S001: 3")]


def test_a_bare_prompt_answers_no_query() -> None:
    protocol = waiting_for("S1")
    assert not any(isinstance(event, TurnOver) for event in read(protocol, PROMPT))
    assert protocol.is_busy


@pytest.mark.parametrize(
    ("reply", "code"),
    [
        ("E92", 92),
        ("E9", 9),
        ("E092", 92),
        ("E92: command active", 92),
        ("E92 command active", 92),
        ("ERROR E92", 92),
        ("error: E90, syntax", 90),
        ("  E55", 55),
        ("(E55)", 55),
    ],
)
@pytest.mark.parametrize("sent", ["PA100$", "SD50", "S1", "P40=1.5"])
def test_an_error_number_anywhere_on_the_line_refuses(sent: str, reply: str, code: int) -> None:
    protocol = waiting_for(sent)
    assert read(protocol, reply.encode() + PROMPT) == [Rejected(code, reply.strip())]
    assert protocol.state is State.READY


@pytest.mark.parametrize("text", ["HELLO", "1.5E3", "SPEED", "E", "E1234", "OK", "POSE92X", "9", "12", "$$", "0"])
def test_a_text_that_is_no_answer_ends_a_command_in_doubt(text: str) -> None:
    protocol = waiting_for("SD50")
    assert read(protocol, text.encode() + PROMPT) == [UnexpectedAnswer(text)]
    assert protocol.state is State.IN_DOUBT


def test_a_text_that_is_no_answer_leaves_a_query_outstanding() -> None:
    protocol = waiting_for("S1")
    assert read(protocol, b"HELLO" + PROMPT) == [Stray("HELLO")]
    assert protocol.is_busy
    assert read(protocol, answer_to("S1")) == [Answered("S001: 0")]


def test_a_number_inside_an_answer_is_no_error() -> None:
    assert read(waiting_for("N5"), b"N005: IF ERROR GOTO E92" + PROMPT) == [Answered("N005: IF ERROR GOTO E92")]


def test_something_unasked_for_in_a_quiet_moment_puts_the_line_in_doubt() -> None:
    for text in (b"", b"HELLO", b"S001: 5", b"E92"):
        protocol = in_step()
        assert read(protocol, text + PROMPT) == [Stray(text.decode())]
        assert protocol.in_doubt


def test_the_second_copy_of_an_answer_is_not_given_to_anybody() -> None:
    protocol = waiting_for("S1")
    assert read(protocol, answer_to("S1", 4) * 2) == [Answered("S001: 4"), Stray("S001: 4")]
    assert protocol.in_doubt


# Messages -------------------------------------------------------------------------------------------------------------


def test_messages_in_a_quiet_moment_leave_the_line_in_step() -> None:
    protocol = in_step()
    assert read(protocol, b"$\r\n>3\r\n>$ \r\n>") == [PositionReached(), ComparatorReached(3), PositionReached()]
    assert protocol.state is State.READY


@situations
def test_the_message_of_an_earlier_move_frees_no_line(situation: Callable[[], CompaxProtocol]) -> None:
    protocol = situation()
    if protocol.message_form is MessageForm.UNKNOWN:
        protocol.message_form = MessageForm.PROMPT_FIRST
    before = protocol.state
    assert read(protocol, b"$\r\n>") == [PositionReached()]
    assert protocol.state is before


@situations
def test_a_comparator_frees_no_line(situation: Callable[[], CompaxProtocol]) -> None:
    protocol = situation()
    before = protocol.state
    assert read(protocol, b"2\r\n>") == [ComparatorReached(2)]
    assert protocol.state is before


def test_a_message_may_come_between_a_query_and_its_answer() -> None:
    protocol = waiting_for("S1")
    events = read(protocol, b"2\r\n>$\r\n>" + answer_to("S1", 5))
    assert events == [ComparatorReached(2), PositionReached(), Answered("S001: 5")]


@pytest.mark.parametrize("number", range(1, 9))
def test_a_comparator_may_be_printed_prompt_first(number: int) -> None:
    """The running text of UG p. 162; what follows then stands glued to the number."""
    protocol = waiting_for("S1")
    events = read(protocol, PROMPT + f"{number}".encode() + answer_to("S1", 5))
    assert [event for event in events if event != Stray("")] == [ComparatorReached(number), Answered("S001: 5")]


@pytest.mark.parametrize("glue", ["", " "])
def test_a_comparator_glued_to_the_next_answer_is_told_apart(glue: str) -> None:
    for sent, reply, outcome in (
        ("S1", "S001: 5", Answered("S001: 5")),
        ("SD50", "E92", Rejected(92, "E92")),
    ):
        assert read(waiting_for(sent), f"4{glue}{reply}".encode() + PROMPT) == [ComparatorReached(4), outcome]
    assert read(in_step(), f"4{glue}$".encode() + PROMPT) == [ComparatorReached(4), PositionReached()]


def test_a_prompt_first_comparator_is_noticed_at_once_in_a_quiet_moment() -> None:
    protocol = in_step()
    assert read(protocol, PROMPT) == [Stray("")]
    assert read(protocol, b"7") == [ComparatorReached(7)]
    marker = ask_marker(protocol)
    assert read(protocol, answer_to(marker)) == [InStep()]


def test_a_prompt_first_comparator_and_an_acknowledgement_are_one_of_each() -> None:
    protocol = waiting_for("SD50")
    assert read(protocol, PROMPT + b"1" + PROMPT) == [Acknowledged(), ComparatorReached(1)]
    assert protocol.state is State.READY


@pytest.mark.parametrize("text", ["9", "0", "10"])
def test_a_number_that_no_comparator_bears_is_noise(text: str) -> None:
    assert read(in_step(), text.encode() + PROMPT) == [Stray(text)]


def test_a_prompt_before_the_message_shows_that_the_prompt_comes_first() -> None:
    protocol = waiting_for("PA100$")
    assert read(protocol, PROMPT) == [Acknowledged()]
    assert protocol.message_form is MessageForm.PROMPT_FIRST
    protocol.send("PA200$")
    assert read(protocol, b"$\r\n>") == [PositionReached()], "the message of the first move"
    assert protocol.is_busy
    assert read(protocol, PROMPT) == [Acknowledged()]


def test_the_prompt_of_a_command_without_a_message_shows_nothing() -> None:
    protocol = waiting_for("SD50")
    read(protocol, PROMPT)
    assert protocol.message_form is MessageForm.UNKNOWN


@pytest.mark.parametrize("form", [MessageForm.UNKNOWN, MessageForm.FINAL_ONLY])
def test_a_drive_that_sends_the_message_alone_acknowledges_with_it(form: MessageForm) -> None:
    protocol = waiting_for("PA100$", form)
    assert read(protocol, b"$\r\n>") == [Acknowledged(by_message=True), PositionReached()]
    assert protocol.state is State.READY


def test_a_message_that_comes_after_the_time_acknowledges_late_where_nothing_else_does() -> None:
    protocol = marker_outstanding(after="PA100$")
    protocol.message_form = MessageForm.FINAL_ONLY
    assert read(protocol, b"$\r\n>") == [LateEnding("PA100$", Acknowledged(by_message=True)), PositionReached()]
    assert protocol.in_doubt, "the marker is still unanswered"


# Echo and noise -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", [b"\r", b"\r\n", b"\r\r\n", b""])
def test_an_echo_of_the_line_is_no_part_of_its_answer(end: bytes) -> None:
    assert read(waiting_for("SD50"), b"SD50" + end + PROMPT) == [Acknowledged()]
    assert read(waiting_for("S1"), b"S1" + end + answer_to("S1", 5)) == [Answered("S001: 5")]
    assert read(waiting_for("PA100$"), b"PA100$" + end + b"E92" + PROMPT) == [Rejected(92, "E92")]


def test_an_echo_of_another_line_is_no_acknowledgement() -> None:
    assert read(waiting_for("SD50"), b"SD500" + PROMPT) == [UnexpectedAnswer("SD500")]


def test_an_answer_that_begins_like_the_query_is_no_echo() -> None:
    assert read(waiting_for("S1"), b"S17: 00000000" + PROMPT) == [Stray("S17: 00000000")]


@pytest.mark.parametrize("noise", [b"\0", b"\x11", b"\x13", b"\x13\x11\0"])
def test_flow_control_and_break_bytes_are_no_text(noise: bytes) -> None:
    answer = noise + b"S0" + noise + b"01: 5" + noise + PROMPT
    assert read(waiting_for("S1"), answer) == [Answered("S001: 5")]
    assert read(waiting_for("SD50"), noise + PROMPT) == [Acknowledged()]


def test_garbage_before_an_answer_is_never_part_of_a_value() -> None:
    protocol = waiting_for("S1")
    assert read(protocol, b"\xff\x80" + answer_to("S1", 5)) == [Stray("\xff\x80S001: 5")]
    assert protocol.is_busy


def test_garbage_on_a_line_of_its_own_spoils_nothing() -> None:
    protocol = waiting_for("S1")
    assert read(protocol, b"\xff\x80\r\n" + answer_to("S1", 5)) == [Stray("\xff\x80"), Answered("S001: 5")]


def test_an_answer_whose_prompt_was_lost_is_not_credited() -> None:
    """Whose it was could be told, but the drive is not known to be ready for the next line."""
    protocol = waiting_for("S1")
    assert read(protocol, b"S001: 5\r\n" + b"HELLO" + PROMPT) == [Stray("S001: 5"), Stray("HELLO")]
    assert protocol.is_busy


def test_a_flood_without_a_prompt_keeps_memory_bounded_and_is_survived() -> None:
    protocol = waiting_for("S1")
    for _ in range(2000):
        protocol.receive(b"\x55" * 1000)
        protocol.events()
        assert len(protocol._received) <= 256
    protocol.time_ran_out()
    protocol.receive(PROMPT)
    marker = ask_marker(protocol)
    assert InStep() in read(protocol, answer_to(marker))


def test_a_flood_in_small_pieces_makes_few_events() -> None:
    protocol = in_step()
    for _ in range(10_000):
        protocol.receive(b"U")
    assert 0 < len(protocol.events()) < 100


def test_a_prompt_cut_by_the_end_of_a_flood_is_still_found() -> None:
    for cut in (1, 2):
        protocol = waiting_for("S1")
        protocol.receive(b"U" * 300 + PROMPT[:cut])
        protocol.receive(PROMPT[cut:] + answer_to("S1", 5))
        assert protocol.events()[-1] == Answered("S001: 5")


# Doubt ----------------------------------------------------------------------------------------------------------------


def test_a_lone_end_sign_is_never_sent() -> None:
    """It would execute half a line that stands in the drive's buffer."""
    protocol = newly_opened()
    for _ in range(40):
        line = ask_marker(protocol)
        assert line[0] == "S"
        assert int(line[1:]) in MARKERS
        protocol.time_ran_out()


def test_a_marker_differs_from_everything_that_is_unanswered() -> None:
    for asked in MARKERS:
        protocol = in_doubt_about(f"S{asked}")
        unanswered = {f"S{asked}"}
        for _ in range(len(MARKERS) - 1):
            marker = ask_marker(protocol)
            assert marker not in unanswered
            unanswered.add(marker)
            protocol.time_ran_out()


def test_a_marker_differs_from_a_query_that_was_written_with_zeros() -> None:
    for asked in MARKERS:
        protocol = in_doubt_about(f"S{asked:03d}")
        for _ in range(len(MARKERS) - 1):
            assert int(ask_marker(protocol)[1:]) != asked
            protocol.time_ran_out()


def test_a_marker_on_a_new_line_differs_from_what_the_old_one_left_unanswered() -> None:
    """A device server may hand the late answers of the old connection to the new one."""
    protocol = newly_opened()
    first = ask_marker(protocol)
    protocol.line_opened()
    second = ask_marker(protocol)
    assert second != first
    assert InStep() not in read(protocol, answer_to(first))
    assert InStep() in read(protocol, answer_to(second))


def test_only_the_answer_to_the_last_marker_ends_the_doubt() -> None:
    protocol = newly_opened()
    markers = []
    for _ in range(3):
        markers.append(ask_marker(protocol))
        protocol.time_ran_out()
    markers.append(ask_marker(protocol))
    for marker in markers[:-1]:
        assert read(protocol, answer_to(marker, 1)) == [
            LateEnding(marker, Answered(answer_to(marker, 1)[:-3].decode()))
        ]
        assert protocol.in_doubt
    assert read(protocol, answer_to(markers[-1])) == [InStep()]
    assert protocol.state is State.READY


@pytest.mark.parametrize("unanswered", [15, 20, 29, 100])
def test_answers_to_markers_asked_twice_are_credited_to_the_oldest_first(unanswered: int) -> None:
    """With fourteen numbers the fifteenth marker repeats the first; only the last answer of all ends the doubt."""
    protocol = newly_opened()
    markers = []
    for _ in range(unanswered):
        markers.append(ask_marker(protocol))
        protocol.time_ran_out()
    last = ask_marker(protocol)
    for marker in markers:
        events = read(protocol, answer_to(marker))
        assert [type(event) for event in events] == [LateEnding]
    assert protocol.in_doubt
    assert read(protocol, answer_to(last)) == [InStep()]


def test_the_answer_to_a_marker_proves_that_lost_lines_were_lost() -> None:
    protocol = in_doubt_about("S1")
    lost = ask_marker(protocol)
    protocol.time_ran_out()
    assert read(protocol, answer_to(ask_marker(protocol))) == [InStep()]
    assert read(protocol, answer_to("S1", 5)) == [Stray("S001: 5")], f"S1 and {lost} are settled"
    assert protocol.in_doubt


def test_a_marker_that_half_a_line_has_spoilt_is_followed_by_another() -> None:
    """``PA1`` stood in the drive's buffer: it has read ``PA1S17`` and refused it."""
    protocol = marker_outstanding()
    assert read(protocol, b"E90" + PROMPT) == [MarkerSpent()]
    assert protocol.state is State.IN_DOUBT
    assert read(protocol, answer_to(ask_marker(protocol))) == [InStep()]


def test_a_late_prompt_ends_the_doubt_about_the_only_command() -> None:
    protocol = in_doubt_about("PA100$", MessageForm.PROMPT_FIRST)
    assert read(protocol, PROMPT) == [LateEnding("PA100$", Acknowledged()), InStep()]
    assert protocol.state is State.READY


def test_a_late_prompt_while_a_marker_is_outstanding_leaves_the_marker_outstanding() -> None:
    protocol = in_doubt_about("PA100$")
    marker = ask_marker(protocol)
    assert read(protocol, PROMPT) == [LateEnding("PA100$", Acknowledged())]
    assert protocol.state is State.AWAITING_MARKER
    assert read(protocol, answer_to(marker)) == [InStep()]


def test_a_late_answer_is_told_apart_from_everything_since() -> None:
    protocol = in_doubt_about("S1")
    marker = ask_marker(protocol)
    assert read(protocol, answer_to("S1", 5)) == [LateEnding("S1", Answered("S001: 5"))]
    assert read(protocol, answer_to(marker)) == [InStep()]


def test_a_late_answer_before_any_marker_ends_the_doubt() -> None:
    protocol = in_doubt_about("S1")
    assert read(protocol, answer_to("S1", 5)) == [LateEnding("S1", Answered("S001: 5")), InStep()]


def test_a_late_error_before_any_marker_refuses_the_only_line() -> None:
    protocol = in_doubt_about("PA100")
    assert read(protocol, b"E92" + PROMPT) == [LateEnding("PA100", Rejected(92, "E92")), InStep()]


def test_an_error_with_a_command_and_a_marker_unanswered_settles_neither() -> None:
    """It may refuse the command, or what the command left of itself together with the marker."""
    protocol = in_doubt_about("PA100")
    marker = ask_marker(protocol)
    assert read(protocol, b"E92" + PROMPT) == [Stray("E92")]
    assert protocol.state is State.AWAITING_MARKER
    assert read(protocol, answer_to(marker)) == [InStep()]


def test_a_prompt_that_may_belong_to_two_commands_is_credited_to_neither() -> None:
    protocol = stop_ahead(after="PA100$")
    protocol.time_ran_out()
    marker = ask_marker(protocol)
    assert read(protocol, PROMPT) == [Stray("")]
    assert read(protocol, PROMPT) == [Stray("")]
    assert read(protocol, answer_to(marker)) == [InStep()]


def test_an_empty_prompt_proves_nothing_on_a_new_line() -> None:
    protocol = marker_outstanding()
    assert read(protocol, PROMPT) == [Stray("")]
    assert protocol.state is State.AWAITING_MARKER


@pytest.mark.parametrize("reply", [b"", b"E90"])
def test_whatever_answers_what_was_sent_ahead_only_ends_its_turn(reply: bytes) -> None:
    for after in (None, "PA100$"):
        protocol = stop_ahead(after=after)
        assert read(protocol, reply + PROMPT) == [MarkerSpent()]
        assert protocol.state is State.IN_DOUBT


def test_noise_in_doubt_proves_nothing() -> None:
    protocol = marker_outstanding(after="SD50")
    assert read(protocol, b"HELLO" + PROMPT + b"S099: 5" + PROMPT) == [Stray("HELLO"), Stray("S099: 5")]
    assert protocol.state is State.AWAITING_MARKER


def test_after_an_unexpected_answer_a_marker_brings_the_line_back_in_step() -> None:
    protocol = waiting_for("SD50")
    read(protocol, b"HELLO" + PROMPT)
    assert read(protocol, answer_to(ask_marker(protocol))) == [InStep()]
    protocol.send("SD50")


# Properties -----------------------------------------------------------------------------------------------------------

FRAGMENTS: Final = [
    *(PROMPT, b"\r", b"\n", b">", b"$", b" ", b"\0", b"\x11", b"\x13", b"\xff", b"\xb2", b"\xa0", b"\x85"),
    *(b"1", b"2", b"8", b"9", b"0", b":", b"=", b"-", b".", b"E92", b"E90 x", b"E", b"hello"),
    *(b"S001: 5", b"S1", b"S", b"S017: 00000000", b"S016", b"S17 1", b"P40=1", b"N5", b"SD50", b"PA100$", b"STOP"),
    *(b"! 0005", b"!", b"\x88A", BinaryTransfer(motion=True).encode("PA100")),
]
streams = st.lists(st.sampled_from(FRAGMENTS), max_size=18).map(b"".join)


def cut(stream: bytes, places: list[int]) -> list[bytes]:
    ends = sorted({place % (len(stream) + 1) for place in places} | {0, len(stream)})
    return [stream[start:end] for start, end in itertools.pairwise(ends)]


@situations
@settings(max_examples=40, deadline=None)
@given(stream=streams, places=st.lists(st.integers(0, 300), max_size=12))
@example(stream=PROMPT + b"1" + PROMPT + b"2S001: 5" + PROMPT, places=[1, 3, 4, 5])
def test_how_the_bytes_are_cut_makes_no_difference(
    situation: Callable[[], CompaxProtocol], stream: bytes, places: list[int]
) -> None:
    """True of everything a drive says; a stretch of more than 256 bytes without a prompt is noise, and not compared."""
    whole, pieces, single = situation(), situation(), situation()
    for protocol, parts in (
        (whole, [stream]),
        (pieces, cut(stream, places)),
        (single, [bytes([byte]) for byte in stream]),
    ):
        for part in parts:
            protocol.receive(part)
    expected = whole.events()
    assert pieces.events() == expected
    assert single.events() == expected
    assert pieces.state is single.state is whole.state
    assert pieces.message_form is whole.message_form


PIECES_OF_ANSWERS: Final = [
    "S001",
    "S1",
    "S 1",
    "S0",
    "S000",
    "P1",
    "N5",
    ":",
    "=",
    " ",
    "\t",
    ">",
    "5",
    "E92",
    "$",
    "1",
]


@settings(max_examples=400, deadline=None)
@given(
    asked=st.sampled_from(["S1", "S 1", "S01", "P1", "N5", "SD50"]),
    answer=st.lists(
        st.sampled_from([*PIECES_OF_ANSWERS, "\r", "\n", "\0", "\x11", "END", "\xb2", 300 * "5"]), max_size=7
    ).map("".join),
)
@example(asked="S1", answer="S001: 5")
@example(asked="S1", answer="S001: 5 ")
@example(asked="S1", answer="S1S001: 5")
def test_an_answer_as_it_nearly_always_is_is_read_as_any_other(asked: str, answer: str) -> None:
    at_once, at_length = waiting_for(asked), waiting_for(asked)
    at_once.receive(answer.encode("latin-1") + PROMPT)
    with patch("compax_aio.compax.protocol.PLAIN_ANSWER", re.compile(r"(?!)")):
        at_length.receive(answer.encode("latin-1") + PROMPT)
    assert at_once.events() == at_length.events()
    assert at_once.state is at_length.state


@situations
@settings(max_examples=30, deadline=None)
@given(pieces=st.lists(st.one_of(st.binary(max_size=400), streams), max_size=8))
def test_no_bytes_whatever_are_an_error_of_the_reader(
    situation: Callable[[], CompaxProtocol], pieces: list[bytes]
) -> None:
    protocol = situation()
    for piece in pieces:
        protocol.receive(piece)
        for event in protocol.events():
            assert isinstance(event, TurnOver | LateEnding | InStep | MarkerSpent | Stray | Message)
    assert len(protocol._received) <= 256
    # Whatever has come, the line can be brought back in step.
    if protocol.state is State.READY:
        protocol.send("S99")
        protocol.bytes_to_send()
    if protocol.is_busy:
        protocol.time_ran_out()
    protocol.receive(PROMPT)
    protocol.resume()
    if protocol.in_doubt:
        assert InStep() in read(protocol, answer_to(ask_marker(protocol)))


@situations
@settings(max_examples=30, deadline=None)
@given(stream=streams)
def test_one_turn_ends_at_most_once(situation: Callable[[], CompaxProtocol], stream: bytes) -> None:
    protocol = situation()
    was_awaiting = protocol.state in (State.AWAITING_ANSWER, State.AWAITING_FRAME)
    ended = [event for event in read(protocol, stream) if isinstance(event, TurnOver)]
    assert len(ended) <= was_awaiting


# A model of the drive, and of the wires between -----------------------------------------------------------------------


MESSAGES: Final = (b"$\r\n>", b"1\r\n>", b"8\r\n>")


class LineModel(RuleBasedStateMachine):
    """
    A drive that does everything right and in order, behind wires that delay and lose.

    Every line sent has a serial number of its own, and the drive puts it into its answer: so an answer that is
    credited to another line is seen at once (P4). Lines and answers are lost whole, or a line loses its end and stays
    in the drive's buffer until the next one completes it: a line in text to one that is refused, a frame to one that
    says something else and is accepted.
    """

    def __init__(self) -> None:
        super().__init__()
        self.protocol = CompaxProtocol(MessageForm.PROMPT_FIRST, BinaryTransfer().encode)
        self.protocol.line_opened()
        self.serial = 0
        self.sent: dict[int, str] = {}
        self.asked = -1
        self.to_drive: list[tuple[int, bytes]] = []
        self.drive_buffer = b""
        self.to_host: list[bytes] = []
        self.messages = 0
        self.whole = b""
        self.is_half_carried = False
        self.accepted: set[int] = set()
        self.refused: set[int] = set()

    def _take_sent(self, line: str | None = None) -> int:
        data = self.protocol.bytes_to_send()
        assert data[0] >= 0x80 or (data.endswith(b"\r") and data.count(b"\r") == 1), "one line at a time (P1)"
        self.serial += 1
        self.sent[self.serial] = line or data[:-1].decode()
        self.to_drive.append((self.serial, data))
        return self.serial

    @precondition(lambda self: self.protocol.state is State.READY)
    @rule(line=st.sampled_from(["S1", "S2", "S16", "S17", "P40", "SD50", "SD17", "AL250", "PA100$"]))
    def send(self, line: str) -> None:
        self.protocol.send(line)
        self.asked = self._take_sent(line)

    @precondition(lambda self: self.protocol.in_doubt and not self.protocol.is_busy)
    @rule()
    def send_marker(self) -> None:
        self.protocol.send_marker()
        self._take_sent()

    @precondition(lambda self: self.protocol.in_doubt and not self.protocol.is_busy)
    @rule()
    def send_stop_ahead(self) -> None:
        self.protocol.send_ahead("STOP")
        self._take_sent()

    @precondition(lambda self: self.protocol.is_busy)
    @rule()
    def time_runs_out(self) -> None:
        self.protocol.time_ran_out()

    @precondition(lambda self: self.to_drive)
    @rule(
        damage=st.sampled_from(["none", "none", "none", "none", "none", "all lost", "end lost"]), cut=st.integers(1, 7)
    )
    def carry_a_line_to_the_drive(self, damage: str, cut: int) -> None:
        serial, data = self.to_drive.pop(0)
        if damage == "all lost":
            return
        if damage == "end lost":
            data = data[: -min(cut, len(data) - 1)] if data[0] >= 0x80 else data[:-1]
        for byte in data:
            self.drive_buffer += bytes([byte])
            if self._is_whole(self.drive_buffer):
                command, self.drive_buffer = self.drive_buffer, b""
                self._execute(serial, command, is_as_sent=command == data)

    @staticmethod
    def _is_whole(buffer: bytes) -> bool:
        return len(buffer) == buffer[0] - 0x80 if buffer[0] >= 0x80 else buffer.endswith(b"\r")

    def _execute(self, serial: int, command: bytes, *, is_as_sent: bool) -> None:
        if command[0] >= 0x80:
            if is_as_sent:
                self.accepted.add(serial)
            self.to_host.append(PROMPT)
        elif not is_as_sent:
            self.refused.add(serial)
            self.to_host.append(b"E90" + PROMPT)
        elif command[:1] in (b"S", b"P") and command[1:-1].isdigit():
            self.to_host.append(answer_to(command[:-1].decode(), serial))
        else:
            self.accepted.add(serial)
            self.to_host.append(PROMPT)

    @rule(message=st.sampled_from(MESSAGES))
    def send_a_message(self, message: bytes) -> None:
        self.to_host.append(message)
        self.messages += 1

    @precondition(lambda self: self.to_host and not self.is_half_carried)
    @rule()
    def lose_what_the_drive_says(self) -> None:
        self.messages -= self.to_host.pop(0) in MESSAGES

    @precondition(lambda self: self.to_host)
    @rule(size=st.integers(1, 40))
    def carry_bytes_to_the_host(self, size: int) -> None:
        said = self.to_host.pop(0)
        if not self.is_half_carried:
            self.whole = said
        self.is_half_carried = len(said) > size
        if self.is_half_carried:
            self.to_host.insert(0, said[size:])
        elif self.whole in MESSAGES:
            self.messages -= 1
        self.protocol.receive(said[:size])
        for event in self.protocol.events():
            self._judge(event)

    def _judge(self, event: Event) -> None:
        if isinstance(event, Answered):
            assert int(event.text.partition(":")[2]) == self.asked, "the answer to another line"
        elif isinstance(event, Acknowledged):
            assert self.asked in self.accepted
        elif isinstance(event, Rejected):
            assert self.asked in self.refused
        elif isinstance(event, LateEnding):
            self._judge_late(event.sent, event.outcome)
        else:
            assert isinstance(event, InStep | MarkerSpent | Stray | Message)

    def _judge_late(self, sent: str, outcome: TurnOver) -> None:
        if isinstance(outcome, Answered):
            assert self.sent[int(outcome.text.partition(":")[2])] == sent
        elif isinstance(outcome, Acknowledged):
            assert any(self.sent[serial] == sent for serial in self.accepted)
        else:
            assert isinstance(outcome, Rejected)
            assert any(self.sent[serial] == sent for serial in self.refused)

    @invariant()
    def nothing_is_on_its_way_when_the_line_is_in_step(self) -> None:
        if self.protocol.state is State.READY:
            assert not self.to_drive
            assert not self.drive_buffer
            assert len(self.to_host) == self.messages


TestLineModel = LineModel.TestCase
TestLineModel.settings = settings(max_examples=80, stateful_step_count=40, deadline=None)


# Noise ----------------------------------------------------------------------------------------------------------------


def test_flow_control_inside_a_prompt_does_not_hide_it() -> None:
    assert read(waiting_for("SD50"), b"\r\x11\n\x13>") == [Acknowledged()]


@pytest.mark.parametrize("tail", [b"", b"$", b"5", b"\r\n", b"\r\nE92"])
@pytest.mark.parametrize("line", ["SD50", "PA100$"])
@pytest.mark.parametrize("piece", [1, 2, 3, 1000])
def test_the_prompt_that_ends_a_flood_acknowledges_nothing(piece: int, line: str, tail: bytes) -> None:
    protocol = waiting_for(line)
    data = b"U" * 300 + tail + PROMPT
    events = [event for at in range(0, len(data), piece) for event in read(protocol, data[at : at + piece])]
    assert [type(event) for event in events] == [Stray, UnexpectedAnswer]
    assert protocol.in_doubt


@pytest.mark.parametrize("make", [in_step, lambda: waiting_for("S1"), lambda: waiting_for("SD50")])
def test_the_text_of_noise_is_bounded(make: Callable[[], CompaxProtocol]) -> None:
    protocol = make()
    for data in (b"U" * 262_144, b"U" * 262_144 + PROMPT, PROMPT):
        for event in read(protocol, data):
            assert not isinstance(event, Stray | UnexpectedAnswer) or len(event.text) <= 300


def test_hundreds_of_late_answers_end_the_doubt_only_with_the_last() -> None:
    protocol = in_doubt_about("SD50")
    markers = []
    for _ in range(300):
        markers.append(ask_marker(protocol))
        protocol.time_ran_out()
    markers.append(ask_marker(protocol))
    read(protocol, PROMPT)
    for marker in markers[:-1]:
        assert InStep() not in read(protocol, answer_to(marker))
        assert protocol.in_doubt
    assert read(protocol, answer_to(markers[-1])) == [InStep()]


@pytest.mark.parametrize("answer", ["N5 POSA 250", "N5 END", "N5 SPEED 50", "N5POSA 5"])
def test_an_answer_with_a_blank_for_its_colon_is_no_echo(answer: str) -> None:
    assert read(waiting_for("N5"), answer.encode() + PROMPT) == [Answered(answer)]


def test_an_error_behind_an_echo_is_an_error() -> None:
    assert read(waiting_for("S30"), b"S30 E55" + PROMPT) == [Answered("S30 E55")]
    assert read(waiting_for("S30"), b"S30\rE92" + PROMPT) == [Rejected(92, "E92")]
    assert read(waiting_for("S30"), b"S30E92" + PROMPT) == [Rejected(92, "E92")]


def test_a_query_with_blanks_knows_its_answer() -> None:
    assert read(waiting_for("S 1"), b"S001: 5" + PROMPT) == [Answered("S001: 5")]


def test_a_line_opened_again_sends_nothing_of_the_old_one() -> None:
    protocol = in_step()
    protocol.send("PA100")
    protocol.line_opened()
    assert protocol.bytes_to_send() == b""


def test_a_prompt_on_a_new_line_acknowledges_no_command_of_the_old_one() -> None:
    protocol = waiting_for("PA100")
    protocol.line_opened()
    assert read(protocol, PROMPT) == [Stray("")]
    assert protocol.in_doubt
