"""Binary transfer: numbers, words and frames as the manual has them, and which lines go out so."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from compax_aio.compax.binary import (
    BinaryTransfer,
    decode_frame,
    decode_number,
    decode_word,
    encode_ascii,
    encode_frame,
    encode_number,
    encode_word,
    is_frame,
    is_motion_frame,
)
from compax_aio.compax.facts.binary import BINARY_FRAMES
from compax_aio.errors import InvalidCommandError

positions = st.decimals(-8_388_608, 8_388_607, places=3)

# Operands -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "sent"),
    [
        (10, "00 00 00 0A 00 00"),
        (360, "00 00 00 68 01 00"),
        (450.5, "00 00 80 C2 01 00"),
        (-1, "00 00 00 FF FF FF"),
        (-450.5, "00 00 80 3D FE FF"),
        (0, "00 00 00 00 00 00"),
        (8_388_607, "00 00 00 FF FF 7F"),
        (-8_388_608, "00 00 00 00 00 80"),
        (Fraction(1, 2**24), "01 00 00 00 00 00"),
    ],
)
def test_a_number_is_written_as_the_manual_has_it(value: float | Fraction, sent: str) -> None:
    assert encode_number(value) == bytes.fromhex(sent)
    assert decode_number(bytes.fromhex(sent)) == value


@given(number=positions)
@example(number=Decimal("0.001"))
@example(number=Decimal("-3999999.999"))
def test_a_number_with_three_decimals_comes_back_as_it_was(number: Decimal) -> None:
    assert round(Decimal(decode_number(encode_number(number))), 3) == number
    assert encode_number(float(number)) == encode_number(number), "as a float it is the same"


@given(data=st.binary(min_size=6, max_size=6))
def test_every_six_bytes_are_a_number_and_make_the_same_six_bytes(data: bytes) -> None:
    assert encode_number(decode_number(data)) == data


@given(number=positions)
def test_a_number_is_the_nearest_that_can_be_said(number: Decimal) -> None:
    assert abs(Fraction(decode_number(encode_number(number))) - Fraction(number)) <= Fraction(1, 2**25)


@pytest.mark.parametrize(
    "value", [float("nan"), float("inf"), float("-inf"), 8_388_608, -8_388_608.001, 1e300, Decimal("NaN"), None, "x"]
)
def test_a_number_that_has_no_form_is_refused(value: float) -> None:
    with pytest.raises(InvalidCommandError, match="8,388,608"):
        encode_number(value)


@pytest.mark.parametrize(("value", "sent"), [(0, "0000"), (250, "00FA"), (256, "0100"), (65_535, "FFFF")])
def test_a_word_is_written_most_significant_byte_first(value: int, sent: str) -> None:
    assert encode_word(value) == bytes.fromhex(sent)
    assert decode_word(bytes.fromhex(sent)) == value


@pytest.mark.parametrize("value", [-1, 65_536, 1.0, True, None])
def test_a_word_that_has_no_form_is_refused(value: int) -> None:
    with pytest.raises(InvalidCommandError, match="65535"):
        encode_word(value)


def test_operands_of_another_length_are_refused() -> None:
    for length in (0, 1, 3, 5, 7):
        with pytest.raises(InvalidCommandError):
            decode_number(bytes(length))
        with pytest.raises(InvalidCommandError):
            decode_word(bytes(length))


# Frames ---------------------------------------------------------------------------------------------------------------

FRAMES = {
    "PA360": "88 41 00 00 00 68 01 00",
    "PR-10": "88 52 00 00 00 F6 FF FF",
    "SD50.5": "88 53 00 00 80 32 00 00",
    "AL250": "84 4C 00 FA",
    "AL-250": "84 44 00 FA",
    "OT O7=1": "85 4F 00 07 31",
    "OT O7=0": "85 4F 00 07 30",
    "PR100 OT O9=1": "8C 52 00 00 00 64 00 00 4F 00 09 31",
    "PR100 SD50": "8F 52 00 00 00 64 00 00 53 00 00 00 32 00 00",
}


@pytest.mark.parametrize(("line", "frame"), FRAMES.items())
def test_a_line_and_its_frame_say_the_same(line: str, frame: str) -> None:
    assert encode_frame(line) == bytes.fromhex(frame)
    assert decode_frame(bytes.fromhex(frame)) == line


def test_every_command_of_the_table_has_been_tried() -> None:
    assert {bytes.fromhex(frame)[0] for frame in FRAMES.values()} == {0x80 + row.length for row in BINARY_FRAMES}
    assert len({(frame[:5], frame[23:26]) for frame in FRAMES.values()}) == len(BINARY_FRAMES)


@pytest.mark.parametrize(
    ("line", "short"),
    [
        ("POSA 360.0", "PA360"),
        ("PA +360", "PA360"),
        ("POSR -10", "PR-10"),
        ("SPEED 50.5", "SD50.5"),
        ("ACCEL 250", "AL250"),
        ("ACCEL- 250", "AL-250"),
        ("AL -250", "AL-250"),
        ("OUTPUT O7=1", "OT O7=1"),
        ("POSR 100 OUTPUT O9=1", "PR100 OT O9=1"),
        ("POSR 100 SPEED 50", "PR100 SD50"),
        ("P A 3 6 0", "PA360"),
    ],
)
def test_long_forms_and_blanks_make_no_difference(line: str, short: str) -> None:
    assert encode_frame(line) == encode_frame(short) is not None


@pytest.mark.parametrize(
    "line",
    [
        *("PA360$", "PA360,", "PR10?", "SD50!", "!", "PA360 $"),
        *("PH", "POSA HOME", "STOP", "START", "QUIT", "VP", "S17", "P40=1", "V1=5", "N5", "GOTO 302", ""),
        *("PA.P40", "POSA .V1", "PR.V1SD50", "SD.V1", "AL.P41"),
        *("OT O1=1 O2=0", "OT O1=2", "OT O0=1", "OT O17=1", "OT O1-O4=1010", "PR100 OT O17=1"),
        *("AL--5", "AL2.5", "AL65536", "PA8388608", "SD", "PA", "PA1.2.3", "PA1E5", "PR100 SD50 SD60", "pa5"),
        *("PA٣", "PAnan", "PR100 AL50", "SPEED SYNC"),
    ],
)
def test_everything_else_has_no_frame(line: str) -> None:
    assert encode_frame(line) is None


@given(word=st.sampled_from(["PA", "PR", "SD", "PR100 SD"]), number=st.decimals(-4_000_000, 4_000_000, places=3))
def test_whatever_number_a_line_says_its_frame_says_too(word: str, number: Decimal) -> None:
    line = f"{word}{number.normalize() + 0:f}"
    frame = encode_frame(line)
    assert frame is not None
    assert frame[0] == 0x80 + len(frame)
    assert decode_frame(frame) == (line if line != f"{word}-0" else f"{word}0")


@given(time_ms=st.integers(0, 65_535), sign=st.sampled_from(["", "-"]))
def test_whatever_time_a_line_says_its_frame_says_too(time_ms: int, sign: str) -> None:
    frame = encode_frame(f"AL{sign}{time_ms}")
    assert frame is not None
    assert decode_frame(frame) == f"AL{sign}{time_ms}"


@given(
    data=st.binary(max_size=16)
    | st.sampled_from(list(FRAMES.values()))
    .map(bytes.fromhex)
    .flatmap(
        lambda frame: st.integers(0, len(frame) - 1).flatmap(
            lambda at: st.integers(0, 255).map(lambda byte: frame[:at] + bytes([byte]) + frame[at + 1 :])
        )
    )
)
def test_whatever_is_taken_for_a_frame_makes_the_same_frame_again(data: bytes) -> None:
    try:
        line = decode_frame(data)
    except InvalidCommandError:
        return
    assert encode_frame(line) in (data, None)
    assert encode_frame(line) is not None or "O" in line, "an output that there is not"


@pytest.mark.parametrize("damage", [lambda frame: frame[:-1], lambda frame: frame + b"\0", lambda frame: frame * 2])
@pytest.mark.parametrize("frame", FRAMES.values())
def test_half_a_frame_and_more_than_one_are_no_frame(frame: str, damage: object) -> None:
    assert callable(damage)
    with pytest.raises(InvalidCommandError, match="no frame"):
        decode_frame(damage(bytes.fromhex(frame)))


def test_what_goes_out_tells_by_its_first_bytes_what_it_is() -> None:
    for line, frame in FRAMES.items():
        assert is_frame(bytes.fromhex(frame))
        assert is_motion_frame(bytes.fromhex(frame)) == (line in {"PA360", "PR-10"})
        assert not is_frame(encode_ascii(line))
        assert not is_motion_frame(encode_ascii(line))
    assert not is_frame(b"")


# What goes out --------------------------------------------------------------------------------------------------------

SETTINGS = ["SD50.5", "AL250", "AL-250", "SPEED 50"]
MOTIONS = ["PA360", "PR-10", "POSA 360"]
OTHERS = ["PA360$", "PR10$", "OT O7=1", "PR100 OT O9=1", "PR100 SD50", "PH", "STOP", "S17", "P40=1", "SD50,", "!"]


@pytest.mark.parametrize("settings", [True, False])
@pytest.mark.parametrize("motion", [True, False])
def test_what_was_asked_for_goes_out_as_frames_and_nothing_else(settings: bool, motion: bool) -> None:
    transfer = BinaryTransfer(settings=settings, motion=motion)
    for lines, is_binary in ((SETTINGS, settings), (MOTIONS, motion), (OTHERS, False)):
        for line in lines:
            assert transfer.encode(line) == (encode_frame(line) if is_binary else line.encode() + b"\r")


def test_motions_are_not_asked_for_unless_it_is_said() -> None:
    assert BinaryTransfer() == BinaryTransfer(settings=True, motion=False)


@pytest.mark.parametrize(
    "line", ["SD17", "SD19", "AL17", "AL4352", "AL-4864", "PA17", "PR-239", "PA4352", "PR0.06640625"]
)
def test_a_frame_that_holds_a_byte_of_flow_control_goes_out_as_text(line: str) -> None:
    frame = encode_frame(line)
    assert frame is not None
    assert {0x11, 0x13} & set(frame)
    assert BinaryTransfer(motion=True).encode(line) == line.encode() + b"\r"


@given(number=st.decimals(-1000, 1000, places=2))
def test_no_byte_of_flow_control_ever_goes_out(number: Decimal) -> None:
    transfer = BinaryTransfer(motion=True)
    for word in ("PA", "PR", "SD"):
        assert not {0x11, 0x13} & set(transfer.encode(f"{word}{number}"))
