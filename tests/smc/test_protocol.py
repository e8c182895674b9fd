"""The host's end of the echo handshake, byte by byte, without a loop and without a clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import LinkProtocolError
from compax_aio.link.contract import Event, GoesOn, InStep, MarkerSpent
from compax_aio.smc.facts import MAX_COMMAND_LENGTH, POSSIBLE_NAMES, Mode
from compax_aio.smc.protocol import SmcProtocol
from compax_aio.smc.protocol_events import Answered, CutShort, Damaged, EntryFailed, NamesDealt, Stray, Unreadable
from compax_aio.smc.protocol_states import BUSY, DOUBTFUL, TRANSITIONS, State, Step
from compax_aio.smc.settings import SmcSettings

ESC, RESET, LF, CR, BS = b"\x1b", b"\x03", b"\n", b"\r", b"\b"
SINGLE, PARTY, DAISY = Mode.SINGLE, Mode.PARTY, Mode.DAISY
SETTINGS = SmcSettings()


class Hand:
    """A protocol, and the link that serves it: bytes and time in, bytes and events out."""

    def __init__(self, mode: Mode = PARTY, names: str = "X", **settings: Any) -> None:
        self.protocol = SmcProtocol(mode, SmcSettings(**settings), names)
        self.told: list[Event] = []

    def state(self) -> State:
        """Say where the line is; a method, so that nobody takes it for a fact that stays."""
        return self.protocol.state

    def out(self) -> bytes:
        """Take what is to be written."""
        return self.protocol.bytes_to_send()

    def hear(self, data: bytes) -> bytes:
        """Let *data* come in one piece; return what is written then."""
        self.protocol.receive(data)
        return self.out()

    def wait(self) -> bytes:
        """Let the time run out; return what is written then."""
        self.protocol.time_ran_out()
        return self.out()

    def begin(self, text: str) -> bytes:
        self.protocol.send(text)
        return self.out()

    def mark(self) -> bytes:
        self.protocol.send_marker()
        return self.out()

    def preempt(self, text: bytes) -> bytes:
        self.protocol.preempt(text.decode())
        return self.out()

    def events(self, *but: type[Event]) -> list[Event]:
        """Take the events, but for those that say only that it goes on."""
        return [event for event in self.protocol.events() if not isinstance(event, (GoesOn, *but))]

    def clear(self, sent: bytes) -> bytes:
        """Wait until the buffers are cleared, and answer to a blank as a single axis does; return all that is sent."""
        whole = sent
        while self.state() is State.CLEARING:
            if sent == b" ":
                self.hear(b" ")
            sent = self.wait()
            whole += sent
        return whole

    def get_in_step(self) -> None:
        """Have the doubt of the beginning ended."""
        end = CR if self.protocol._mode is SINGLE else LF
        answer = b"#\r\n" if self.protocol._mode is SINGLE else LF
        sent = self.clear(self.mark())[-1:]
        while sent != end:
            assert self.state() is State.PROBING
            sent = self.hear(sent)
        assert self.hear(answer) == b""
        assert self.state() is State.READY
        self.events()

    def type(self, text: str) -> bytes:
        """Give a command, and its echoes one after the other; return what was written, the terminator included."""
        sent = whole = self.begin(text)
        while self.state() is State.TYPING:
            sent = self.hear(sent)
            assert len(sent) == 1, "one character at a time"
            whole += sent
        return whole


def ready(mode: Mode = PARTY, names: str = "X", **settings: Any) -> Hand:
    hand = Hand(mode, "" if mode is SINGLE else names, **settings)
    hand.get_in_step()
    return hand


# Vectors -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sent", "answered", "text"),
    [
        ("X^", b"0\n", "0"),
        ("XZ", b"1000\n", "1000"),
        ("XZ", b"   1000.00\n", "1000.00"),
        ("Y-500", b"\n", ""),
        ("X+1000", b"\n", ""),
        ("XR-8388607.99", b"\n", ""),
    ],
)
def test_a_command_on_a_party_line_is_what_the_manual_prints(sent: str, answered: bytes, text: str) -> None:
    """DCB p. 26; the line feed in front of a command is the terminator of the one before."""
    hand = ready()
    assert hand.type(sent) == sent.encode() + LF
    assert hand.hear(answered) == b""
    assert hand.events() == [Answered(text)]
    assert hand.state() is State.READY


@pytest.mark.parametrize(
    ("sent", "answered", "text"),
    [("V500", b"\r\n", ""), ("Z0", b"        -5\r\n", "-5"), ("Z0", b"   -5.00\r\n", "-5.00")],
)
def test_a_command_of_a_single_axis_ends_with_cr(sent: str, answered: bytes, text: str) -> None:
    """DCB p. 27: the CR is not echoed before the data."""
    hand = ready(SINGLE)
    assert hand.type(sent) == sent.encode() + CR
    hand.hear(answered)
    assert hand.events() == [Answered(text)]


@pytest.mark.parametrize(
    "answer",
    [
        b" v2.55\r\n#\r\n",
        b" 1342     4038 ADVANCED MICRO SYSTEMS, INC\r\nMAX-2000 v1.15i\r\n#",
        b" AMS 1.12\r\n#",
        b" #\r\n",
        b" ",
    ],
    ids=["789A-4", "1.15i", "pre-1.14", "signed on", "echo alone"],
)
@pytest.mark.parametrize("prompt", [b"#\r\n", b"\r\n#\r\n", b" #\r\n", b"#"])
def test_a_single_axis_gets_in_step_however_it_signs_on_and_prompts(answer: bytes, prompt: bytes) -> None:
    hand = Hand(SINGLE, "")
    assert hand.mark() == b" ", "any other character would become its name (DCB p. 23)"
    assert hand.protocol.patience_s == SETTINGS.sign_on_s
    assert hand.hear(answer) == b""
    erased = b""
    while hand.state() is State.CLEARING:
        sent = hand.wait()
        erased += sent
        hand.hear(b"\b \b")
    assert erased == BS * (MAX_COMMAND_LENGTH + 1) + CR, "all that may stand in the buffer, and the blank"
    assert hand.state() is State.PROBE_ENDING
    hand.events()
    hand.hear(prompt)
    if not prompt.endswith(LF):
        assert hand.state() is State.PROBE_ENDING
        hand.wait()  # where the prompt has no line of its own
    assert hand.events() == [InStep()]
    assert hand.state() is State.READY


def test_an_empty_line_without_a_prompt_is_no_proof() -> None:
    """An axis that is in program entry, or another device, answers so."""
    hand = Hand(SINGLE, "")
    hand.clear(hand.mark())
    hand.hear(b"\r\n")
    assert hand.events() == []
    hand.wait()
    assert hand.state() is State.IN_DOUBT
    assert hand.events() == []


@pytest.mark.parametrize("ahead", [False, True])
def test_to_a_single_axis_that_is_deaf_nothing_is_sent_but_blanks(ahead: bool) -> None:
    """It may be about to wake up from a reset, and take what it hears first for its name (DCB p. 23)."""
    hand = Hand(SINGLE, "")
    for _ in range(3):
        hand.protocol.send_ahead("@") if ahead else hand.protocol.send_marker()
        assert hand.out() == b" "
        assert hand.wait() == b""
        assert hand.events() == [MarkerSpent()]
        assert hand.state() is State.IN_DOUBT
    hand = ready(SINGLE)
    hand.preempt(RESET)
    hand.wait()
    assert hand.wait() == b" "
    assert hand.wait() == b""
    assert hand.state() is State.IN_DOUBT


def test_four_controllers_of_a_daisy_chain_take_names() -> None:
    """DCB p. 24: LF A goes out, LF E comes back."""
    hand = Hand(DAISY, "A")
    assert hand.mark() == LF
    assert hand.wait() == b"A"
    assert hand.hear(b"\nE") == LF
    assert hand.hear(LF) == b""
    assert hand.events() == [NamesDealt("E", offered="A"), InStep()]


def test_a_chain_that_has_its_names_echoes() -> None:
    hand = Hand(DAISY, "A")
    hand.mark()
    assert hand.wait() == b"A"
    assert hand.hear(b"A") == LF
    hand.hear(LF)
    assert hand.events() == [InStep()]


def test_noise_deals_no_names() -> None:
    """A controller that takes a name sends LF in front of the next one (DCB p. 24)."""
    hand = Hand(DAISY, "A")
    hand.mark()
    hand.wait()
    assert hand.hear(b"E") == b""
    assert hand.events() == [MarkerSpent()]
    assert hand.state() is State.IN_DOUBT


@pytest.mark.parametrize("byte", [b" ", b"\x00", b"\r", b"\x1b"])
def test_what_is_no_name_deals_none(byte: bytes) -> None:
    hand = Hand(DAISY, "A")
    hand.mark()
    hand.wait()
    hand.hear(LF + byte)
    assert hand.events() == [MarkerSpent()]


@pytest.mark.parametrize("text", ["B^", "B+1000"])
def test_names_that_are_dealt_instead_of_an_echo_are_told(text: str) -> None:
    """A chain that was reset takes the name in front of any command for the first of its own (DCB p. 24)."""
    hand = ready(DAISY, "ABCD")
    hand.begin(text)
    assert hand.hear(b"\nF") == b""
    dealt, failed = hand.events()
    assert dealt == NamesDealt("F", offered="B")
    assert failed == EntryFailed(text, 0, "F", was_begun=False)
    assert hand.state() is State.IN_DOUBT


# Typing --------------------------------------------------------------------------------------------------------------


@given(
    name=st.sampled_from(POSSIBLE_NAMES),
    text=st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), min_size=1, max_size=MAX_COMMAND_LENGTH),
    body=st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=40),
    data=st.data(),
)
def test_no_character_is_sent_before_the_echo_of_the_one_before(
    name: str, text: str, body: str, data: st.DataObject
) -> None:
    hand = ready(names=name)
    whole, sent = name + text, hand.begin(name + text)
    for place, character in enumerate(whole):
        assert sent == character.encode()
        assert hand.state() is State.TYPING
        assert hand.protocol.patience_s == SETTINGS.echo_timeout_s
        if not place and data.draw(st.booleans(), "LF in front"):
            assert hand.hear(LF) == b""
        assert hand.hear(b"") == hand.out() == b"", "nothing is sent twice"
        sent = hand.hear(sent)
        assert isinstance(hand.protocol.events()[-1], GoesOn), "each echo gives the axis its time anew"
    assert sent == LF
    assert hand.state() is State.ENDING
    assert hand.protocol.patience_s == SETTINGS.answer_timeout_s
    answer = body.encode() + LF
    if name + text not in {name + "Q", name + "X"} and text[0] not in "QX":
        cuts = sorted(data.draw(st.lists(st.integers(0, len(answer)), max_size=5), "cuts"))
        for begin, end in itertools.pairwise([0, *cuts, len(answer)]):
            assert hand.hear(answer[begin:end]) == b""
        assert hand.events() == [Answered(body.strip())]
        assert hand.state() is State.READY


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("came", [b"", b"?", b"\x00", b"\xff"], ids=["lost", "wrong", "nul", "8 bits"])
def test_a_missing_or_wrong_echo_ends_the_entry_and_nothing_is_sent_after_it(place: int, came: bytes) -> None:
    hand, command = ready(), "XR-4711"
    sent = hand.begin(command)
    for _ in range(place):
        sent = hand.hear(sent)
    hand.events()
    assert (hand.hear(came) if came else hand.wait()) == b""
    (failed,) = hand.events(Damaged)
    assert failed == EntryFailed(command, place, came.decode("latin-1"), was_begun=place > 0)
    assert isinstance(failed, EntryFailed)
    assert failed.expected == command[place]
    assert hand.state() is (State.HALF_TYPED if place else State.IN_DOUBT)
    assert hand.protocol.in_doubt
    assert not hand.protocol.is_busy


def test_a_line_feed_in_the_middle_of_a_command_is_a_wrong_echo() -> None:
    hand = ready()
    hand.begin("XR500")
    hand.hear(b"X")
    assert hand.hear(LF) == b""
    assert hand.events(Damaged) == [EntryFailed("XR500", 1, "\n", was_begun=True)]


@pytest.mark.parametrize("fields", range(1, 4))
def test_line_feeds_in_front_of_the_names_echo_are_of_earlier_terminators(fields: int) -> None:
    hand = ready()
    hand.begin("X^")
    assert hand.hear(LF * fields) == b""
    assert hand.hear(b"X") == b"^"
    assert hand.events() == []


@pytest.mark.parametrize("place", range(4))
def test_what_came_before_a_character_was_sent_is_no_echo_of_it(place: int) -> None:
    """A line that babbles what is expected must not make a burst of the command: it would be cut by the UART."""
    hand, command = ready(), "XR50\n"
    hand.begin(command[:-1])
    for character in command[:place]:
        hand.hear(character.encode())
    hand.events()
    assert hand.hear(command[place : place + 2].encode()) == b"", "not even the next character"
    damaged = [Damaged("X", ("R50"[: place - 1], "R50"[:place])[place == 1 :])] if place else []
    assert hand.events() == [
        *damaged,
        EntryFailed("XR50", place, command[place : place + 2], was_begun=place > 0),
    ]
    assert hand.state() is (State.HALF_TYPED if place else State.IN_DOUBT)


def test_a_marker_that_is_answered_too_early_is_spent() -> None:
    hand = Hand()
    hand.mark()
    assert hand.wait() == b"X"
    assert hand.hear(b"X\n") == b""
    assert hand.events() == [MarkerSpent()]
    assert hand.state() is State.IN_DOUBT


@pytest.mark.parametrize(
    ("text", "place", "came", "holds"),
    [
        ("XR500", 1, "", ("R",)),
        ("XR500", 1, "M", ("R", "M")),
        ("XR500", 2, "", ("R", "R5")),
        ("XR500", 2, "7", ("R", "R5", "R7")),
        ("XR500", 4, "\n", ("R50", "R500", "R50\n")),
        ("X^", 1, "V", ("^", "V")),
    ],
)
def test_what_an_axis_may_hold_of_a_damaged_command_is_told(
    text: str, place: int, came: str, holds: tuple[str, ...]
) -> None:
    """Up to the last echo, with the character behind it, or with what came back in its place."""
    hand = ready()
    sent = hand.begin(text)
    for _ in range(place):
        sent = hand.hear(sent)
    hand.hear(came.encode()) if came else hand.wait()
    assert [event for event in hand.events() if isinstance(event, Damaged)] == [Damaged("X", holds)]


@pytest.mark.parametrize("mode", [PARTY, SINGLE])
def test_nothing_is_damaged_where_characters_are_taken_back_or_escape_clears(mode: Mode) -> None:
    hand = ready(mode, cancel_with="escape" if mode is PARTY else "line feed")
    hand.begin("XR500")
    hand.hear(b"X")
    hand.hear(b"?")
    (failed,) = hand.events()
    assert isinstance(failed, EntryFailed)


# Results -------------------------------------------------------------------------------------------------------------


def test_a_result_that_does_not_come_leaves_doubt() -> None:
    hand = ready()
    hand.type("XZ")
    hand.hear(b"10")
    assert hand.wait() == b""
    assert hand.events() == []
    assert hand.state() is State.IN_DOUBT


def test_an_answer_that_has_no_end_is_told() -> None:
    hand = ready()
    hand.type("XZ")
    hand.hear(b"1" * 64)
    assert hand.events() == []
    hand.hear(b"2" * 500)
    assert hand.events(Stray) == [Unreadable("XZ", "1" * 64)]
    assert hand.state() is State.IN_DOUBT


def test_the_longest_answer_is_taken() -> None:
    hand = ready()
    hand.type("XZ")
    hand.hear(b"1" * 63 + LF)
    assert hand.events() == [Answered("1" * 63)]


def test_an_earlier_result_is_no_part_of_the_next() -> None:
    hand = ready()
    hand.type("XZ")
    hand.hear(b"1000\n")
    hand.events()
    hand.type("X^")
    hand.hear(b"0\n")
    assert hand.events() == [Answered("0")]


def test_a_result_that_was_given_up_is_no_part_of_the_next() -> None:
    hand = ready()
    hand.type("XZ")
    hand.hear(b"10")
    hand.wait()
    hand.get_in_step()
    hand.type("X^")
    hand.hear(b"0\n")
    assert hand.events() == [Answered("0")]


def test_a_listing_goes_on_until_there_is_silence() -> None:
    hand = ready(SINGLE)
    hand.type("Q")
    hand.hear(b"\r\n 0 O 0\r\n")
    assert hand.state() is State.LISTING
    assert isinstance(hand.protocol.events()[-1], GoesOn)
    assert hand.protocol.patience_s == SETTINGS.listing_quiet_s
    hand.hear(b" 1 R 10000.00\r\n6 W 0\r\n")
    assert len(hand.protocol.events()) == 2, "each line gives the axis its time anew"
    assert hand.wait() == b""
    assert hand.events() == [Answered("\r\n 0 O 0\r\n 1 R 10000.00\r\n6 W 0")]
    assert hand.state() is State.READY


def test_a_listing_that_does_not_begin_leaves_doubt() -> None:
    hand = ready()
    hand.type("XQ")
    hand.hear(b" 0 O")
    hand.wait()
    assert hand.state() is State.IN_DOUBT
    assert hand.events() == []


@pytest.mark.parametrize("data", [b"0 O 0\n" * 10_000, b"x" * 60_000], ids=["lines", "no end"])
def test_a_listing_without_end_is_given_up(data: bytes) -> None:
    hand = ready()
    hand.type("XQ")
    for begin in range(0, len(data), 64):
        hand.hear(data[begin : begin + 64])
        assert len(hand.protocol._received) <= 16_385
    (lost,) = hand.events(Stray)
    assert isinstance(lost, Unreadable)
    assert lost.sent == "XQ"
    assert len(lost.text) <= 64
    assert hand.state() is State.IN_DOUBT


def test_a_listing_may_have_as_many_characters_as_a_full_memory() -> None:
    hand = ready()
    hand.type("XQ")
    hand.hear(b"0 W 0\n" * 2_730)
    assert hand.state() is State.LISTING
    hand.wait()
    (answer,) = hand.events()
    assert isinstance(answer, Answered)
    assert answer.text.count("W") == 2_730


def test_a_probe_that_is_answered_by_a_flood_is_spent() -> None:
    hand = Hand()
    hand.mark()
    hand.hear(hand.wait())
    hand.hear(b"z" * 65)
    assert hand.events(Stray) == [MarkerSpent()]
    assert hand.state() is State.IN_DOUBT


# Strays --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("data", [LF, CR, b"\r\n", b"\n\n\n", b""])
def test_line_ends_that_come_unasked_are_nothing_to_tell(data: bytes) -> None:
    hand = ready()
    hand.hear(data)
    assert hand.events() == []


def test_noise_between_exchanges_is_told_and_harms_nobody() -> None:
    hand = ready()
    hand.hear(b"\xff\x00noise")
    assert hand.events() == [Stray("\xff\x00noise")]
    hand.type("X^")
    hand.hear(b"1\n")
    assert hand.events() == [Answered("1")]


def test_noise_is_told_in_part() -> None:
    hand = ready()
    hand.hear(b"y" * 1000)
    assert hand.events() == [Stray("y" * 64)]


def test_what_comes_behind_an_answer_is_stray() -> None:
    hand = ready()
    hand.type("X^")
    hand.hear(b"0\njog")
    assert hand.events() == [Answered("0"), Stray("jog")]


def test_what_comes_while_the_buffers_are_cleared_is_told() -> None:
    """The answer of an axis that has executed what it held."""
    hand = Hand()
    hand.mark()
    hand.hear(b"   500\n")
    assert hand.events() == [Stray("   500\n")]
    assert hand.wait() == b"X"


# Getting in step -----------------------------------------------------------------------------------------------------


def test_a_marker_is_a_line_feed_a_pause_and_the_name_of_an_axis() -> None:
    hand = Hand()
    assert hand.state() is State.IN_DOUBT
    assert hand.mark() == LF
    assert hand.protocol.patience_s == SETTINGS.quiet_s
    assert hand.protocol.is_busy
    assert hand.wait() == b"X"
    assert hand.protocol.patience_s == SETTINGS.echo_timeout_s
    assert hand.hear(b"X") == LF
    assert hand.protocol.patience_s == SETTINGS.echo_timeout_s
    assert hand.events() == []
    assert hand.hear(LF) == b""
    assert hand.events() == [InStep()]
    assert not hand.protocol.in_doubt


def test_where_no_axis_is_known_there_is_nobody_to_ask() -> None:
    hand = Hand(names="")
    assert hand.mark() == LF
    assert hand.wait() == b""
    assert hand.events() == [InStep()]
    assert hand.state() is State.READY


def test_a_name_that_does_not_come_back_is_a_marker_spent() -> None:
    hand = Hand(names="XY")
    hand.mark()
    hand.wait()
    assert hand.wait() == b""
    assert hand.events() == [MarkerSpent()]
    assert hand.mark() == LF
    assert hand.wait() == b"Y", "each time another one"
    hand.hear(b"Y")
    assert hand.wait() == b""
    assert hand.state() is State.IN_DOUBT, "half an answer is none"
    hand.mark()
    assert hand.wait() == b"Y", "for it may have more to say"


def test_who_has_answered_is_asked_again() -> None:
    """On a line with many axes that are switched off each doubt would cost their time-outs."""
    hand = Hand(names="ABC")
    for name in (b"A", b"B"):
        hand.mark()
        assert hand.wait() == name
        hand.wait()
    hand.get_in_step()
    hand.begin("A^")
    hand.wait()
    hand.mark()
    assert hand.wait() == b"C"


def test_a_new_line_goes_on_with_the_axis_that_was_not_asked_yet() -> None:
    """Else a line whose first six axes are switched off would never come back, though the seventh answers."""
    hand = Hand(names="AB")
    hand.mark()
    hand.wait()
    hand.wait()
    hand.protocol.line_lost()
    hand.protocol.line_opened()
    hand.mark()
    assert hand.wait() == b"B"


def test_the_axis_that_may_have_more_to_say_is_asked_first_and_twice() -> None:
    hand = ready(names="ABC")
    hand.type("BZ")
    hand.wait()
    asked = []
    for _ in range(4):
        hand.mark()
        asked.append(hand.wait())
        hand.wait()
    assert asked == [b"B", b"B", b"A", b"B"]


def test_the_axis_that_holds_half_a_command_is_asked_first() -> None:
    hand = ready(names="AB")
    hand.begin("BZ")
    hand.hear(b"B")
    hand.wait()
    assert hand.mark() == LF
    assert hand.wait() == b"B"


def test_an_axis_that_never_heard_its_name_is_not_asked_first() -> None:
    hand = ready(names="AB")
    hand.begin("BZ")
    hand.wait()
    hand.mark()
    assert hand.wait() == b"A"


@pytest.mark.parametrize("mode", [PARTY, DAISY])
def test_escape_cancels_where_that_is_wanted(mode: Mode) -> None:
    hand = ready(mode, cancel_with="escape")
    hand.begin("XR500")
    hand.hear(b"X")
    hand.hear(b"?")
    assert hand.mark() == ESC
    assert hand.protocol.patience_s == pytest.approx(0.005)
    assert hand.wait() == ESC
    assert hand.protocol.patience_s == SETTINGS.escape_quiet_s
    assert hand.wait() == LF
    assert hand.protocol.patience_s == SETTINGS.quiet_s
    assert hand.wait() == b"X"


def test_escape_is_not_sent_for_less_than_half_a_command() -> None:
    hand = ready(cancel_with="escape")
    hand.begin("XR500")
    hand.wait()
    assert hand.mark() == LF
    hand = ready(cancel_with="escape")
    hand.type("XR500")
    hand.wait()
    assert hand.mark() == LF


def test_escape_cancels_a_single_axis_where_that_is_wanted() -> None:
    hand = ready(SINGLE, cancel_with="escape")
    hand.begin("R500")
    hand.hear(b"?")
    assert [hand.mark(), hand.wait(), hand.wait()] == [ESC, ESC, CR]


@pytest.mark.parametrize("place", range(4))
def test_what_was_typed_to_a_single_axis_is_taken_back(place: int) -> None:
    hand = ready(SINGLE)
    sent = hand.begin("R500")
    for _ in range(place):
        sent = hand.hear(sent)
    hand.wait()
    assert hand.clear(hand.mark()) == b" " + BS * (place + 2) + CR, "with the one that did not come back, and the blank"


def test_a_single_axis_holds_nothing_of_a_line_that_was_cleared() -> None:
    hand = ready(SINGLE)
    hand.type("Z0")
    hand.wait()
    assert hand.clear(hand.mark()) == b" " + BS * 4 + CR
    hand.hear(b"#\r\n")
    hand.begin("Z0")
    hand.wait()
    assert hand.clear(hand.mark()) == b" " + BS * 2 + CR


@pytest.mark.parametrize("mode", [PARTY, SINGLE])
def test_a_stop_can_go_ahead_of_the_doubt(mode: Mode) -> None:
    hand = Hand(mode, "X" if mode is PARTY else "")
    text = "X@" if mode is PARTY else "@"
    hand.protocol.send_ahead(text)
    whole = sent = hand.clear(hand.out())[-1:]
    while hand.state() is State.PROBING:
        sent = hand.hear(sent)
        whole += sent
    assert whole == text.encode() + (LF if mode is PARTY else CR)
    hand.hear(LF)
    assert hand.events() == [InStep()]
    assert hand.state() is State.READY


def test_no_stop_goes_ahead_in_a_daisy_chain() -> None:
    """One that was reset would deal its names from the one of the stop (DCB p. 24)."""
    hand = Hand(DAISY, "ABCD")
    hand.protocol.send_ahead("C@")
    hand.out()
    assert hand.wait() == b"A"


@pytest.mark.parametrize("place", range(2))
def test_a_stop_that_goes_ahead_and_is_not_heard_whole_leaves_doubt(place: int) -> None:
    hand = Hand()
    hand.protocol.send_ahead("X@")
    hand.out()
    sent = hand.wait()
    for _ in range(place):
        sent = hand.hear(sent)
    assert hand.hear(b"?") == b""
    assert hand.events() == [*[Damaged("X", ("@", "?"))][:place], MarkerSpent()]
    assert hand.state() is State.IN_DOUBT


# ESC and ^C ----------------------------------------------------------------------------------------------------------


def everywhere() -> dict[State, Hand]:
    """Give a line in each of its states; what it has sent is taken, and its events are, too."""
    hands = {State.IN_DOUBT: Hand()}
    for state in (State.CLEARING, State.PROBING, State.PROBE_ENDING):
        hands[state] = hand = Hand()
        sent = hand.mark()
        while hand.state() is not state:
            sent = hand.hear(sent) if hand.state() is State.PROBING else hand.wait()
    for state in (State.READY, State.TYPING, State.ENDING, State.LISTING, State.HALF_TYPED):
        hands[state] = hand = ready()
        if state is not State.READY:
            sent = hand.begin("XQ")
            while state in {State.ENDING, State.LISTING} and hand.state() is State.TYPING:
                sent = hand.hear(sent)
        if state is State.LISTING:
            hand.hear(LF)
        if state is State.HALF_TYPED:
            hand.hear(b"X")
            hand.hear(b"X")
    for state, hand in hands.items():
        hand.events()
        assert hand.state() is state
    return hands


STATES = pytest.mark.parametrize("state", State)


@STATES
def test_escape_goes_out_at_once_and_twice_whatever_is_going_on(state: State) -> None:
    """The first one may have fallen on a character that was not read yet."""
    hand = everywhere()[state]
    assert hand.preempt(ESC) == ESC
    cut = [CutShort("XQ", "\x1b", state is not State.TYPING)]
    assert hand.events() == (cut if state in {State.TYPING, State.ENDING, State.LISTING} else [])
    assert hand.state() is State.CLEARING
    assert [hand.wait(), hand.wait(), hand.wait()] == [ESC, LF, b"X"]
    assert hand.hear(b"X") == LF
    hand.hear(LF)
    assert hand.events() == [InStep()]


@STATES
def test_reset_waits_a_moment_and_goes_out_once(state: State) -> None:
    hand = everywhere()[state]
    assert hand.preempt(RESET) == b"", "the character before it must have been read"
    assert hand.protocol.patience_s == SETTINGS.quiet_s
    assert hand.wait() == RESET
    assert hand.protocol.patience_s == SETTINGS.profile.reset_time_s
    assert [hand.wait(), hand.wait()] == [LF, b"X"]


def test_what_was_to_be_sent_is_not_sent_after_escape() -> None:
    hand = ready()
    hand.protocol.send("X+1")
    assert hand.preempt(ESC) == ESC
    hand = ready()
    hand.begin("X+1")
    hand.protocol.receive(b"X")
    assert hand.preempt(ESC) == ESC
    (cut,) = hand.events()
    assert cut == CutShort("X+1", "\x1b", was_complete=False)


def test_a_name_goes_out_just_once_behind_the_reset() -> None:
    """DCB p. 23: whatever comes first after a reset is the name."""
    hand = ready(SINGLE)
    assert hand.preempt(b"\x03B") == b""
    assert [hand.wait(), hand.wait(), hand.wait()] == [RESET, b"B", b" "]
    assert hand.hear(b"A   1342 ADVANCED MICRO SYSTEMS, INC\r\n#") == b""
    assert hand.wait() == CR
    hand.hear(b"#\r\n")
    assert hand.events(Stray) == [InStep()]


def test_a_reset_of_a_single_axis_is_followed_by_a_blank() -> None:
    hand = ready(SINGLE)
    hand.preempt(RESET)
    assert [hand.wait(), hand.wait(), hand.hear(b" "), hand.wait()] == [RESET, b" ", b"", CR]


def test_a_reset_deals_the_names_of_a_chain_anew() -> None:
    hand = ready(DAISY, "ABCD")
    hand.preempt(RESET)
    assert [hand.wait(), hand.wait(), hand.wait()] == [RESET, LF, b"A"]
    assert hand.hear(b"\nE") == LF
    hand.hear(LF)
    assert hand.events() == [NamesDealt("E", offered="A"), InStep()]


@pytest.mark.parametrize("mode", Mode)
def test_a_reset_that_escape_overtakes_is_carried_out_all_the_same(mode: Mode) -> None:
    """Else whoever asked for it would be told of one that never was."""
    hand = ready(mode)
    hand.preempt(RESET)
    sent = hand.clear(hand.preempt(ESC))
    assert sent.startswith(ESC + ESC)
    assert sent.count(RESET) == 1


@pytest.mark.parametrize("text", [ESC, RESET])
def test_nothing_but_a_blank_comes_first_after_the_reset_of_a_single_axis(text: bytes) -> None:
    """DCB p. 23: it would become its name."""
    hand = ready(SINGLE)
    hand.preempt(RESET)
    assert hand.wait() == RESET
    sent = hand.clear(hand.preempt(text))
    assert sent.startswith(b" ")
    assert text in sent


# Lines, opened and lost ----------------------------------------------------------------------------------------------


@STATES
@pytest.mark.parametrize("step", ["opened", "lost"])
def test_a_line_that_is_opened_or_lost_is_in_doubt(state: State, step: str) -> None:
    hand = everywhere()[state]
    hand.protocol.line_opened() if step == "opened" else hand.protocol.line_lost()
    assert hand.protocol.in_doubt
    assert not hand.protocol.is_busy
    assert hand.out() == b""
    assert hand.events() == []
    assert hand.mark() == LF
    assert [hand.wait(), hand.hear(b"X"), hand.hear(LF)] == [b"X", LF, b""]
    assert hand.events() == [InStep()]


@pytest.mark.parametrize(
    ("place", "holds"), [(0, None), (1, ("R",)), (2, ("R", "R5")), (3, ("R5", "R50")), (4, None), (5, None)]
)
def test_a_loss_in_the_middle_of_a_command_is_told(place: int, holds: tuple[str, ...] | None) -> None:
    """What clears the buffers on the next line executes what the axis holds of it."""
    hand = ready()
    sent = hand.begin("XR50")
    for _ in range(place):
        sent = hand.hear(sent)
    hand.events()
    hand.protocol.line_lost()
    assert hand.events() == ([Damaged("X", holds)] if holds else [])
    assert hand.state() is (State.HALF_TYPED if holds else State.IN_DOUBT)


@pytest.mark.parametrize("losses", [1, 2])
def test_escape_cancels_half_a_command_on_the_next_line_where_that_is_wanted(losses: int) -> None:
    hand = ready(cancel_with="escape")
    hand.begin("XR500")
    hand.hear(b"X")
    for _ in range(losses):
        hand.protocol.line_lost()
        hand.protocol.line_opened()
    assert hand.mark() == ESC


def test_on_a_new_line_a_single_axis_may_hold_a_whole_command() -> None:
    hand = ready(SINGLE)
    hand.protocol.line_lost()
    hand.protocol.line_opened()
    assert hand.clear(hand.mark()) == b" " + BS * 13 + CR


# The table -----------------------------------------------------------------------------------------------------------


def test_every_state_can_be_left_and_reached() -> None:
    assert {state for state, _ in TRANSITIONS} == set(State)
    assert set(TRANSITIONS.values()) == set(State)
    assert {step for _, step in TRANSITIONS} == set(Step)
    assert State.READY not in DOUBTFUL | BUSY
    assert set(State) - BUSY == {State.IN_DOUBT, State.HALF_TYPED, State.READY}
    for state, hand in everywhere().items():
        assert hand.protocol.in_doubt is (state in DOUBTFUL)
        assert hand.protocol.is_busy is (state in BUSY)
        assert hand.protocol.held is None
        assert hand.protocol.stranger(time_is_over=True) is None
        hand.protocol.resume()
        assert hand.state() is state


@STATES
def test_what_is_not_allowed_is_refused_and_changes_nothing(state: State) -> None:
    calls: tuple[tuple[Callable[[SmcProtocol], None], frozenset[State]], ...] = (
        (lambda protocol: protocol.send("X^"), frozenset({State.READY})),
        (lambda protocol: protocol.send_marker(), frozenset({State.IN_DOUBT, State.HALF_TYPED})),
        (lambda protocol: protocol.send_ahead("X@"), frozenset({State.IN_DOUBT, State.HALF_TYPED})),
        (lambda protocol: protocol.time_ran_out(), BUSY),
    )
    for call, allowed in calls:
        hand = everywhere()[state]
        if state in allowed:
            call(hand.protocol)
            continue
        with pytest.raises(LinkProtocolError, match="is not possible while"):
            call(hand.protocol)
        assert hand.state() is state
        assert hand.out() == b""
