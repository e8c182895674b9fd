"""Replies are taken out of every frame that can be set, whatever handshake signs come in between; and read."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.camm1.facts.reports import HpGlStatus, StatusStyle
from compax_aio.camm1.instructions import BlockHandshake, EnqAckMode1, ReplyFormat, SignFormat
from compax_aio.camm1.replies import (
    CutterStatus,
    Framing,
    Noise,
    Position,
    Received,
    Reply,
    ReplyReader,
    Sign,
    SignSeen,
    decode_bytes,
    decode_error,
    decode_hp_gl_status,
    decode_numbers,
    decode_position,
    decode_status,
)
from compax_aio.errors import InvalidCommandError, UnexpectedAnswerError

XON, XOFF, ACK, HEARD = b"\x11", b"\x13", b"\x06", b"\x05"


def received(framing: Framing, *pieces: bytes) -> list[Received]:
    reader = ReplyReader(framing)
    return [each for piece in pieces for each in reader.feed(piece)]


def dressed(framing: Framing, text: str) -> bytes:
    """As a machine sends it."""
    initiator = bytes(filter(None, (framing.reply.initiator,)))
    return initiator + text.encode("latin-1") + framing.terminator


formats = st.one_of(
    st.builds(ReplyFormat, terminator=st.sampled_from([13, 10, 3]), second_terminator=st.sampled_from([0, 10, 13])),
    st.builds(ReplyFormat, terminator=st.sampled_from([13, 10, 3]), initiator=st.sampled_from([0, 2, 35])),
)
framings = st.builds(
    Framing,
    reply=formats,
    xon=st.sampled_from([b"", XON, b"\x11\x12"]),
    xoff=st.sampled_from([b"", XOFF, b"\x13\x14\x15"]),
    ack=st.sampled_from([b"", ACK]),
    data_bits=st.sampled_from([7, 8]),
)
texts = st.text("0123456789,.-A", max_size=12)


# Frames ---------------------------------------------------------------------------------------------------------------


@given(framing=framings, replies=st.lists(texts, max_size=5), data=st.data())
def test_replies_come_out_of_any_frame_with_signs_anywhere_in_between(
    framing: Framing, replies: list[str], data: st.DataObject
) -> None:
    stream, seen = b"", []
    signs = framing.signs
    for byte in b"".join(dressed(framing, text) for text in replies):
        if signs and data.draw(st.integers(0, 3)) == 0:
            sign, text = data.draw(st.sampled_from(signs))
            stream += text
            seen.append(sign)
        noisy = byte | (0x80 if framing.data_bits == 7 and data.draw(st.booleans()) else 0)
        stream += bytes([noisy])
    found = received(framing, *(bytes([byte]) for byte in stream))
    assert [each.text for each in found if isinstance(each, Reply)] == replies
    assert [each.sign for each in found if isinstance(each, SignSeen)] == seen
    assert not [each for each in found if isinstance(each, Noise)]
    assert received(framing, stream) == found


@given(framing=framings, stream=st.binary(max_size=2000))
def test_whatever_comes_little_is_held(framing: Framing, stream: bytes) -> None:
    reader = ReplyReader(framing)
    for byte in stream * 3:
        for each in reader.feed(bytes([byte])):
            size = len(each.text) if isinstance(each, Reply) else len(each.data) if isinstance(each, Noise) else 0
            assert size <= 257


@pytest.mark.parametrize(
    ("reply", "stream"),
    [
        (ReplyFormat(), b"1024\r"),
        (ReplyFormat(terminator=10), b"1024\n"),
        (ReplyFormat(second_terminator=10), b"1024\r\n"),
        (ReplyFormat(initiator=2), b"\x021024\r"),
        (ReplyFormat(terminator=0, second_terminator=10), b"1024\n"),
    ],
)
def test_the_sheets_frames(reply: ReplyFormat, stream: bytes) -> None:
    assert received(Framing(reply=reply), stream) == [Reply("1024")]


def test_half_a_terminator_ends_nothing() -> None:
    assert received(Framing(reply=ReplyFormat(second_terminator=10)), b"10\r24\r\n") == [Reply("10\r24")]


def test_what_stands_in_front_of_an_initiator_is_noise() -> None:
    framing = Framing(reply=ReplyFormat(initiator=2))
    assert received(framing, b"xy\x0210\r\x0224\r") == [Noise(b"xy"), Reply("10"), Reply("24")]
    assert received(framing, b"z" * 300) == [Noise(b"z" * 257)]


def test_a_reply_without_end_is_noise() -> None:
    assert received(Framing(), b"z" * 300 + b"\r") == [Noise(b"z" * 257), Reply("z" * 43)]


def test_an_acknowledgement_of_mode_1_ends_like_a_reply() -> None:
    mode_1 = Framing.of(ReplyFormat(second_terminator=10), None, EnqAckMode1(128, 5, ACK))
    assert received(mode_1, b"\x06\r\n", b"1024\r\n") == [SignSeen(Sign.ACKNOWLEDGED), Reply("1024")]
    assert received(mode_1, b"\x061024\r\n") == [SignSeen(Sign.ACKNOWLEDGED), Reply("1024")]


def test_an_acknowledgement_of_mode_2_comes_alone() -> None:
    mode_2 = Framing.of(ReplyFormat(), SignFormat(0, HEARD), BlockHandshake(128, 5, ACK))
    assert received(mode_2, b"\x05\x061024\r") == [SignSeen(Sign.HEARD), SignSeen(Sign.ACKNOWLEDGED), Reply("1024")]


def test_a_framing_follows_from_what_was_sent() -> None:
    xonxoff = Framing.of(ReplyFormat(), SignFormat(0, XOFF), BlockHandshake(80, 0, XON))
    assert xonxoff.signs == ((Sign.XON, XON), (Sign.XOFF, XOFF))
    assert Framing.of(ReplyFormat(), SignFormat(0, XOFF)).signs == ()
    assert Framing.of(ReplyFormat(), data_bits=7).data_bits == 7
    assert Framing.of(ReplyFormat(), None, EnqAckMode1(80, 5, ACK)).ack_is_ended


def test_what_the_host_owes_follows_from_the_frame() -> None:
    framing = Framing(reply=ReplyFormat(trigger=17, echo_terminator=10))
    assert (framing.behind_request, framing.behind_reply) == (b"\x11", b"\n")
    assert (Framing().behind_request, Framing().behind_reply) == (b"", b"")


def test_another_frame_forgets_what_was_held() -> None:
    reader = ReplyReader()
    assert not reader.feed(b"10")
    reader.reframe(Framing(reply=ReplyFormat(terminator=10)))
    assert reader.feed(b"24\n") == [Reply("24")]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"data_bits": 9}, "7 or 8 data bits"),
        ({"reply": ReplyFormat(terminator=0)}, "need a terminator"),
        ({"xon": XON, "xoff": XON}, "is no other sign"),
        ({"xon": b"\r"}, "no character of the frame"),
        ({"ack": b"\x02", "reply": ReplyFormat(initiator=2)}, "no character of the frame"),
        ({"ack": b"A"}, "ends with no letter or digit"),
    ],
)
def test_what_could_not_be_told_apart_is_refused(change: dict[str, object], match: str) -> None:
    with pytest.raises(InvalidCommandError, match=match):
        Framing(**change)  # type: ignore[arg-type]


# What replies say -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "code"), [("0", 0), ("", 0), (" ", 0), ("16", 16), (" 11 ", 11)])
def test_an_error_number_may_be_missing(text: str, code: int) -> None:
    assert decode_error(text) == code


@pytest.mark.parametrize(
    ("text", "style", "status"),
    [
        ("0", StatusStyle.CODES, CutterStatus(number=0, buffer_is_empty=False, is_paused=False)),
        ("8", None, CutterStatus(number=8, buffer_is_empty=True, is_paused=False)),
        ("24", StatusStyle.CODES, CutterStatus(number=24, buffer_is_empty=True, is_paused=True)),
        (
            "264",
            StatusStyle.WORD,
            CutterStatus(number=264, buffer_is_empty=True, is_paused=False, has_drawn=False),
        ),
        (
            "298",
            StatusStyle.WORD,
            CutterStatus(number=298, buffer_is_empty=True, is_paused=False, has_drawn=True),
        ),
        ("32", StatusStyle.HP, CutterStatus(number=32, buffer_is_empty=False, is_paused=False, is_suspended=True)),
        ("16", StatusStyle.HP, CutterStatus(number=16, buffer_is_empty=False, is_paused=True, is_suspended=False)),
    ],
)
def test_a_status_says_what_its_encoding_says(text: str, style: StatusStyle | None, status: CutterStatus) -> None:
    assert decode_status(text, style) == status


def test_positions_and_numbers() -> None:
    assert decode_position("100,-200,1") == Position(100, -200, True)
    assert decode_position(" 100.25 , 0,0") == Position(100.25, 0, False)
    assert decode_numbers("0,0,11040,7721", 4) == (0, 0, 11040, 7721)
    assert decode_bytes(" 1024 ") == 1024
    assert decode_hp_gl_status("24") == HpGlStatus.INITIALISED | HpGlStatus.READY


@pytest.mark.parametrize("text", ["", "-1", "1.5", "1,2", "abc", "1e3", "9" * 10, "\u0663"])
def test_what_is_no_number_of_bytes_is_told(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="the answer is no number of bytes"):
        decode_bytes(text)


@pytest.mark.parametrize("text", ["-1", "E11", "1000", "11,12"])
def test_what_is_no_error_number_is_told(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="no error number"):
        decode_error(text)


@pytest.mark.parametrize("text", ["", "65536", "PU", "8,"])
def test_what_is_no_status_is_told(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="no status"):
        decode_status(text)


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "1,2,x", "1,,2"])
def test_what_is_no_position_is_told(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="not 3 numbers"):
        decode_position(text)


def test_a_tool_is_up_or_down() -> None:
    with pytest.raises(UnexpectedAnswerError, match="neither up nor down"):
        decode_position("1,2,3")


@pytest.mark.parametrize("text", ["256", "", "-1"])
def test_what_is_no_status_byte_is_told(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="no status byte"):
        decode_hp_gl_status(text)
