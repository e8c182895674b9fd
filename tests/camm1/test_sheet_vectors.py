"""The byte vectors of the fact sheet, from this end: what is sent is these bytes, and what comes is understood so."""

from __future__ import annotations

import pytest
from tests.camm1.bench import bench

from compax_aio.camm1.facts.line import DC1, DC3
from compax_aio.camm1.facts.reports import StatusStyle
from compax_aio.camm1.instructions import (
    AbortCutting,
    AskError,
    AskFreeSpace,
    AskModel,
    AskStatus,
    BlockHandshake,
    Control,
    EnqAckMode1,
    ReplyFormat,
    Reset,
    SignFormat,
    encode,
)
from compax_aio.camm1.profiles import PNC_900, PNC_1610, Profile
from compax_aio.camm1.replies import (
    Framing,
    Reply,
    ReplyReader,
    Sign,
    SignSeen,
    decode_bytes,
    decode_error,
    decode_status,
)

VECTORS: list[tuple[int, Profile | None, Control, str]] = [
    (1, None, AskFreeSpace(), "1B 2E 42"),
    (3, None, AskError(), "1B 2E 45"),
    (5, None, ReplyFormat(terminator=10), "1B 2E 4D 3B 3B 3B 31 30 3A"),
    (7, None, EnqAckMode1(128, 5, b"\x06"), "1B 2E 48 31 32 38 3B 35 3B 36 3A"),
    (8, None, BlockHandshake(128, 5, b"\x06"), "1B 2E 49 31 32 38 3B 35 3B 36 3A"),
    (9, None, BlockHandshake(), "1B 2E 49 3A"),
    (10, None, SignFormat(signs=bytes((DC3,))), "1B 2E 4E 3B 31 39 3A"),
    (12, None, ReplyFormat(trigger=DC1), "1B 2E 4D 3B 31 37 3A"),
    (13, None, ReplyFormat(echo_terminator=10), "1B 2E 4D 3B 3B 31 30 3A"),
    (16, PNC_900, AskStatus(), "1B 2E 4F"),
    (18, PNC_1610, AskModel(), "1B 2E 41 3A"),
    (19, None, AbortCutting(), "1B 2E 4B"),
    (20, None, Reset(), "1B 2E 52"),
]


@pytest.mark.parametrize(("number", "profile", "control", "expected"), VECTORS, ids=[f"#{each[0]}" for each in VECTORS])
def test_what_is_sent_is_these_bytes(number: int, profile: Profile | None, control: Control, expected: str) -> None:
    assert encode(control, profile) == bytes.fromhex(expected)


def test_6_a_second_terminator_and_what_it_frames() -> None:
    control = ReplyFormat(terminator=13, second_terminator=10)
    assert encode(control, explicit=True) == b"\x1b.M0;0;0;13;10;0:"  # says the same as .M;;;13;10:
    assert ReplyReader(Framing.of(control)).feed(bytes.fromhex("31 30 32 34 0D 0A")) == [Reply("1024")]


def test_10_xon_and_its_threshold() -> None:
    control = BlockHandshake(80, signs=bytes((DC1,)))
    assert encode(control, explicit=False) == b"\x1b.I;;17:"  # 80 is the default: the same as .I80;;17:
    framing = Framing.of(ReplyFormat(), SignFormat(signs=bytes((DC3,))), control)
    assert ReplyReader(framing).feed(bytes.fromhex("13 11")) == [SignSeen(Sign.XOFF), SignSeen(Sign.XON)]


@pytest.mark.parametrize(("reply", "free"), [("31 30 32 34 0D", 1024), ("31 30 32 31 0D", 1021)])
def test_1_2_and_19_free_space(reply: str, free: int) -> None:
    (each,) = ReplyReader().feed(bytes.fromhex(reply))
    assert isinstance(each, Reply)
    assert decode_bytes(each.text) == free


@pytest.mark.parametrize(
    ("reply", "code"), [("30 0D", 0), ("31 31 0D", 11), ("31 36 0D", 16), ("31 34 0D", 14), ("31 30 0D", 10)]
)
def test_3_4_14_15_17_and_20_errors(reply: str, code: int) -> None:
    (each,) = ReplyReader().feed(bytes.fromhex(reply))
    assert isinstance(each, Reply)
    assert decode_error(each.text) == code


@pytest.mark.parametrize(
    ("ack", "is_mode_1", "handshake"),
    [("06 0D", True, EnqAckMode1(128, 5, b"\x06")), ("06", False, BlockHandshake(128, 5, b"\x06"))],
)
def test_7_and_8_acknowledgements(ack: str, is_mode_1: bool, handshake: EnqAckMode1 | BlockHandshake) -> None:
    framing = Framing.of(ReplyFormat(), handshake=handshake)
    assert framing.ack_is_ended is is_mode_1
    assert ReplyReader(framing).feed(bytes.fromhex(ack)) == [SignSeen(Sign.ACKNOWLEDGED)]


@pytest.mark.parametrize(("reply", "style"), [("38", StatusStyle.CODES), ("32 36 34", StatusStyle.WORD)])
def test_16_an_idle_machine(reply: str, style: StatusStyle) -> None:
    status = decode_status(bytes.fromhex(reply).decode(), style)
    assert status.buffer_is_empty
    assert not status.is_paused


async def test_9_and_14_never_come_of_it() -> None:
    """No job trusts the dummy handshake, and no two questions are ever outstanding."""
    async with bench(power_on_handshake="dummy") as on:
        for handshake in ("enq1", "enq2", "software"):
            await on.cutter.cut("IN;PU10,10;PD20,20;PU;" * 40, handshake=handshake)
        assert on.far.lost_bytes == 0
        assert await on.cutter.error() == 0
