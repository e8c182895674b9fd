"""Device control is said as it is meant, in few bytes or many, and is found in any stream, however it is cut."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.camm1.control_parser import ControlFound, ControlParser, DataFound, FlawFound, Found
from compax_aio.camm1.instructions import (
    CONTROLS,
    AbortCutting,
    AbortOutput,
    AllocateMemory,
    AskBufferSize,
    AskError,
    AskFreeSpace,
    AskModel,
    AskStatus,
    BlockHandshake,
    Control,
    DtrControl,
    EnqAckMode1,
    PresetHandshake,
    ProgrammedOff,
    ProgrammedOn,
    ReplyFormat,
    Reset,
    SignFormat,
    encode,
    from_parameters,
)
from compax_aio.camm1.profiles import HP_7475A, PNC_900, PNC_1050, PNC_1610
from compax_aio.errors import InvalidCommandError

codes = st.integers(0, 127)
delays = st.integers(0, 32_767)
blocks = st.integers(0, 15_358)
signs = st.binary(max_size=10).map(lambda text: bytes(byte & 0x7F for byte in text if byte & 0x7F))
areas = st.integers(0, 12_752)

controls: st.SearchStrategy[Control] = st.one_of(
    st.sampled_from([
        AskFreeSpace(), AskModel(), AskStatus(), AskError(), AskBufferSize(), AbortOutput(), AbortCutting(), Reset(),
        ProgrammedOn(), ProgrammedOff(),
    ]),
    st.builds(ReplyFormat, delays, codes, codes, codes, codes),
    st.builds(ReplyFormat, delays, codes, codes, codes, initiator=codes),
    st.builds(SignFormat, delays, signs),
    st.builds(EnqAckMode1, blocks, codes, signs),
    st.builds(BlockHandshake, blocks, codes, signs),
    st.builds(DtrControl, blocks, st.integers(0, 255)),
    st.builds(PresetHandshake, st.integers(0, 3)),
    st.builds(AllocateMemory, areas, areas, areas, areas, areas),
)  # fmt: skip


def found_in(*pieces: bytes) -> list[Found]:
    """All that is found, with data that came in several parts as one."""
    parser = ControlParser()
    merged: list[Found] = []
    for each in (found for piece in pieces for found in parser.feed(piece)):
        last = merged[-1] if merged else None
        if isinstance(each, DataFound) and isinstance(last, DataFound) and last.offset + len(last.data) == each.offset:
            merged[-1] = DataFound(last.data + each.data, last.offset)
        else:
            merged.append(each)
    return merged


# There and back -------------------------------------------------------------------------------------------------------


@given(control=controls, explicit=st.booleans(), behind=st.sampled_from([b"", b"PU;"]))
def test_whatever_is_said_is_found_again(control: Control, explicit: bool, behind: bytes) -> None:
    text = encode(control, explicit=explicit)
    data = [DataFound(behind, len(text))] if behind else []
    assert found_in(text + behind) == [ControlFound(control, 0), *data]


@given(controls)
def test_the_short_form_is_no_longer_than_the_explicit_one(control: Control) -> None:
    assert len(encode(control)) <= len(encode(control, explicit=True))


@given(
    parts=st.lists(
        controls.map(encode)
        | st.binary(max_size=5)
        | st.sampled_from([b"\x1b", b"\x1b.", b"\x1b.M1;", b":", b"\x1b.B:", b"\x1b.q", b"\x1b.M1;x;3:", b"\x1b.P9:"]),
        max_size=12,
    ),
    data=st.data(),
)
def test_however_a_stream_is_cut_the_same_is_found(parts: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(parts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    pieces = [stream[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert found_in(*pieces) == found_in(stream)


@given(st.lists(controls.map(encode) | st.binary(max_size=5).map(lambda text: text.replace(b"\x1b", b"")), max_size=12))
def test_data_is_what_no_device_control_is(parts: list[bytes]) -> None:
    stream = b"".join(part + (b"" if part[:1] == b"\x1b" else b";") for part in parts)
    for each in found_in(stream):
        assert not isinstance(each, FlawFound)
        if isinstance(each, DataFound):
            assert stream[each.offset : each.offset + len(each.data)] == each.data


# Worked examples ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("control", "short", "explicit"),
    [
        (AskFreeSpace(), b"\x1b.B", b"\x1b.B"),
        (ReplyFormat(), b"\x1b.M:", b"\x1b.M0;0;0;13;0;0:"),
        (ReplyFormat(terminator=10), b"\x1b.M;;;10:", b"\x1b.M0;0;0;10;0;0:"),
        (ReplyFormat(second_terminator=10), b"\x1b.M;;;;10:", b"\x1b.M0;0;0;13;10;0:"),
        (ReplyFormat(trigger=17), b"\x1b.M;17:", b"\x1b.M0;17;0;13;0;0:"),
        (EnqAckMode1(128, 5, b"\x06"), b"\x1b.H128;5;6:", b"\x1b.H128;5;6;0;0;0;0;0;0;0;0;0:"),
        (BlockHandshake(80, 0, b"\x11"), b"\x1b.I;;17:", b"\x1b.I80;0;17;0;0;0;0;0;0;0;0;0:"),
        (SignFormat(0, b"\x13"), b"\x1b.N;19:", b"\x1b.N0;19;0;0;0;0;0;0;0;0;0:"),
        (DtrControl(dtr=0), b"\x1b.@;0:", b"\x1b.@1024;0:"),
        (PresetHandshake(3), b"\x1b.P3:", b"\x1b.P3:"),
        (Reset(), b"\x1b.R", b"\x1b.R"),
    ],
)
def test_instructions_are_written_as_manuals_print_them(control: Control, short: bytes, explicit: bytes) -> None:
    assert (encode(control), encode(control, explicit=True)) == (short, explicit)


def test_a_colon_stands_where_the_machines_manual_prints_one() -> None:
    assert encode(AskStatus(), PNC_1610) == b"\x1b.O:"
    assert encode(AskStatus(), PNC_900) == b"\x1b.O"
    assert encode(AskModel(), PNC_1610) == b"\x1b.A:"
    assert encode(AskFreeSpace(), PNC_1610) == b"\x1b.B"


def test_what_a_machine_does_not_have_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match=r"PNC-1610 has no ESC\.@"):
        encode(DtrControl(), PNC_1610)
    with pytest.raises(InvalidCommandError, match=r"PNC-900 has no ESC\.A"):
        encode(AskModel(), PNC_900)
    assert encode(ProgrammedOn(), HP_7475A) == b"\x1b.("


def test_a_threshold_below_the_machines_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="PNC-1050 at 10 free bytes or more, not at 5"):
        encode(BlockHandshake(5, 0, b"\x11"), PNC_1050)
    assert encode(BlockHandshake(5, 0, b"\x11"), PNC_1610) == b"\x1b.I5;;17:"
    assert encode(BlockHandshake(5, 5, b"\x06"), PNC_1050) == b"\x1b.I5;5;6:"
    assert encode(BlockHandshake(5), PNC_1050) == b"\x1b.I5:"


@pytest.mark.parametrize(
    ("letter", "arguments", "match"),
    [
        ("M", {"turnaround_ms": 32_768}, "P1 of ESC.M, delay before a reply, is a whole number from 0 to 32767"),
        ("M", {"trigger": 128}, "P2 of ESC.M"),
        ("M", {"terminator": -1}, "P4 of ESC.M"),
        ("M", {"terminator": 13.0}, "P4 of ESC.M"),
        ("M", {"turnaround_ms": True}, "P1 of ESC.M"),
        ("M", {"second_terminator": 10, "initiator": 2}, "a second terminator or an initiator, not both"),
        ("N", {"signs": b"12345678901"}, "at most 10 characters"),
        ("N", {"signs": b"\x00"}, "none of them 0"),
        ("N", {"signs": b"\xff"}, "P2 of ESC.N"),
        ("N", {"signs": "\x13"}, "the string of ESC.N"),
        ("I", {"block_bytes": 15_359}, "P1 of ESC.I"),
        ("@", {"dtr": 256}, "P2 of ESC.@"),
        ("P", {"preset": 4}, "P1 of ESC.P"),
    ],
)
def test_what_cannot_be_said_is_refused(letter: str, arguments: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidCommandError, match=match):
        CONTROLS[letter](**arguments)


def test_a_string_ends_at_its_first_0() -> None:
    assert from_parameters("N", [None, 19, 0, 20]) == SignFormat(0, b"\x13")
    assert from_parameters("H", []) == EnqAckMode1()


def test_an_initiator_wins_over_a_second_terminator() -> None:
    assert from_parameters("M", [0, 0, 0, 13, 10, 2]) == ReplyFormat(initiator=2)


# Flaws ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stream", "code", "control"),
    [
        (b"\x1b.q", 11, None),
        (b"\x1b.b", 11, None),
        (b"\x1b.M5;x;3:", 12, ReplyFormat(5)),
        (b"\x1b.I-5:", 12, BlockHandshake()),
        (b"\x1b.M5;200;3:", 13, ReplyFormat(5)),
        (b"\x1b.P9:", 13, PresetHandshake()),
        (b"\x1b.M99999999999999999999:", 13, ReplyFormat()),
        (b"\x1b.M0;0;0;13;0;0;0:", 14, ReplyFormat()),
        (b"\x1b.N5\x1b.R", 14, Reset()),
    ],
)
def test_a_flaw_has_its_code_and_what_is_obeyed_all_the_same(stream: bytes, code: int, control: Control | None) -> None:
    found = found_in(stream)
    assert [each.code for each in found if isinstance(each, FlawFound)] == [code]
    assert [each.control for each in found if isinstance(each, ControlFound)] == ([control] if control else [])
    assert not [each for each in found if isinstance(each, DataFound)]


def test_a_flaw_stands_where_the_wrong_byte_stands() -> None:
    assert found_in(b"PU;\x1b.q") == [DataFound(b"PU;", 0), FlawFound(11, 5)]


def test_a_colon_behind_an_instruction_without_parameters_is_swallowed_once() -> None:
    assert found_in(b"\x1b.B::") == [ControlFound(AskFreeSpace(), 0), DataFound(b":", 4)]


def test_a_lone_escape_is_data() -> None:
    assert found_in(b"a\x1bb\x1b\x1b.B") == [DataFound(b"a\x1bb\x1b", 0), ControlFound(AskFreeSpace(), 4)]


def test_an_escape_behind_a_dot_begins_anew() -> None:
    parser = ControlParser()
    states = [parser.is_idle]
    assert not parser.feed(b"\x1b.")
    states.append(parser.is_idle)
    assert parser.feed(b"\x1b.B") == [ControlFound(AskFreeSpace(), 2)]
    assert [*states, parser.is_idle] == [True, False, True]


def test_other_names_of_the_wiring_instructions_are_the_same() -> None:
    assert [each.control for each in found_in(b"\x1b.Y\x1b.Z") if isinstance(each, ControlFound)] == [
        ProgrammedOn(), ProgrammedOff(),
    ]  # fmt: skip


def test_an_instruction_is_a_value() -> None:
    assert replace(ReplyFormat(), turnaround_ms=5) == ReplyFormat(5)
    assert len({AskError(), AskError(), AskStatus()}) == 2
