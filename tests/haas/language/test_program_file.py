"""Program files: programs, names, comments, blocks with their places; ``bytes(file)`` is what it was made of."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.language.building import build_program_file
from compax_aio.haas.language.program_file import Name, name_of_line, parse_program_file

TRACE = b"\n%\nO05555(CS390_Test_NC)\n(Using G0 which travels along dogleg path.)\nN10G90G94G17\nN66465M30\n\n%\n"
"""As a control sent it (sheet, section 4), in the middle cut short."""

FILLED = TRACE + b"\x1a" * (-len(TRACE) % 128)
"""As XMODEM brings it."""

ANY_FILE = st.lists(
    st.sampled_from(
        [b"%", b"O1234", b"O99999(A)", b"O(", b":1", b"N1G0X1", b"\r", b"\n", b"\r\n", b" ", b"\x00\x11", b"\x1a", b"("]
    )
).map(b"".join) | st.binary()  # fmt: skip


@pytest.mark.parametrize("data", [TRACE, FILLED])
def test_the_file_of_the_trace(data: bytes) -> None:
    file = parse_program_file(data)
    assert bytes(file) == data
    assert len(file) == len(data)
    assert file.lead_in == b"\n"
    assert file.tail == data[len(TRACE) :]
    assert file.payload == TRACE[1:]
    assert file.eob is EobPattern.LF
    assert file.percent_lines == (2, 8)
    assert (file.has_start, file.has_end) == (True, True)
    (program,) = file
    assert (program.number, program.comment, str(program)) == (5555, "CS390_Test_NC", "O05555 (CS390_Test_NC)")
    assert (program.line, program.offset) == (3, 3)
    assert [block.text for block in program.blocks[-3:]] == ["N10G90G94G17", "N66465M30", ""]
    assert [block.is_blank for block in program.blocks] == [False, False, False, False, True]
    assert file.numbers == (5555,)
    assert file.program(5555) is program
    assert file.program(1) is None


@given(ANY_FILE, st.sampled_from([None, *EobPattern]))
def test_a_file_gives_the_bytes_it_was_made_of(data: bytes, eob: EobPattern | None) -> None:
    file = parse_program_file(data, eob=eob)
    assert bytes(file) == data
    for program in file.programs:
        assert data[program.offset :].startswith(bytes(program))
        for block in program.blocks:
            assert data[block.offset :].startswith(block.raw)
            assert block.raw


@pytest.mark.parametrize("eob", EobPattern)
def test_all_ends_of_blocks_are_read_alike(eob: EobPattern) -> None:
    data = eob.data.join([b"", b"%", b"O00012", b"G0X1", b"", b"M30", b"%", b""])
    file = parse_program_file(data)
    assert file.eob is eob
    assert file.programs[0].text == "O00012\nG0X1\n\nM30\n"
    assert [block.line for block in file.programs[0].blocks] == [3, 4, 5, 6]


def test_any_mix_of_ends_is_read_and_cr_lf_counts_once() -> None:
    file = parse_program_file(b"%\r\nO1\nG0\rG1\r\r\nM30\n\r%")
    assert file.eob is None
    assert [block.text for block in file.programs[0].blocks] == ["O1", "G0", "G1", "", "M30", ""]


def test_several_programs_within_one_pair() -> None:
    file = parse_program_file(b"%\nO1(ONE)\nM99\n\nO00002\nO123(EMPTY BEFORE)\n%\n")
    assert file.numbers == (1, 2, 123)
    assert [len(each.blocks) for each in file] == [3, 1, 1]
    assert [each.line for each in file] == [2, 5, 6]


def test_programs_that_were_wrapped_one_by_one() -> None:
    file = parse_program_file(b"%\nO1\nM30\n%\n\n%\nO2\nM30\n%\n")
    assert file.numbers == (1, 2)
    assert file.percent_lines == (1, 4, 6, 9)
    assert bytes(file.programs[0]) == b"O1\nM30\n"


def test_text_from_a_disk_without_percent_lines() -> None:
    file = parse_program_file("O1\nM30\n")
    assert (file.has_start, file.has_end, file.numbers) == (False, False, (1,))
    assert bytes(file) == b"O1\nM30\n"


def test_blocks_in_front_of_the_first_name_are_a_program_without_one() -> None:
    file = parse_program_file(b"%\n\n(HEADER)\nO1\n%\n")
    assert [(each.number, str(each)) for each in file] == [(None, "a program without a name"), (1, "O1")]
    assert file.programs[0].comment is None
    assert file.programs[0].line == 2


def test_a_file_that_holds_nothing_has_no_programs() -> None:
    for data in (b"", b"%", b"%\n%\n", b"\n%\n\n \x00\n%\n\x1a"):
        assert parse_program_file(data).programs == ()


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (b"O05555(CS390)\n", Name("O05555", 5555, "CS390")),
        (b"O1", Name("O1", 1, None)),
        (b"O12345 ( A B )G0", Name("O12345", 12345, " A B ")),
        (b"\x00 O77(open\r\n", Name("O77", 77, "open")),
        (b"o5", Name("o5", 5, None)),
        (b"O 5", Name("O5", 5, None)),
        (b"O123456", Name("O123456", None, None)),
        (b"O", Name("O", None, None)),
        (b"OX1", Name("O", None, None)),
        (b"O" + b"9" * 10_000, Name("O" + "9" * 10_000, None, None)),
        (b"N1O5", None),
        (b"", None),
    ],
)
def test_names(line: bytes, name: Name | None) -> None:
    assert name_of_line(line) == name


def test_leader_and_punch_codes_are_no_text() -> None:
    (program,) = parse_program_file(b"\x12%\r\nO1\r\n\x00G0\x13 \x11X1\x7f\r\n%\r\n\x14").programs
    assert program.blocks[1].text == "G0 X1"
    assert program.blocks[1].raw == b"\x00G0\x13 \x11X1\x7f\r\n"


# Building -------------------------------------------------------------------------------------------------------------


def test_a_file_to_be_sent_is_one_pair_around_all_programs() -> None:
    """Sheet, section 11: end of block, %, the programs, %, each with the profile's end of block."""
    file = build_program_file(["%\nO1(A)\nM30\n%\n", b"O00002\r\nG0\r\n\r\nM30"], eob="cr lf", o_digits=5)
    assert bytes(file) == b"\r\n%\r\nO00001(A)\r\nM30\r\nO00002\r\nG0\r\n\r\nM30\r\n%\r\n"
    assert file.numbers == (1, 2)


@pytest.mark.parametrize("eob", EobPattern)
def test_what_was_built_is_read_as_what_it_was_built_of(eob: EobPattern) -> None:
    file = build_program_file(TRACE, eob=eob)
    assert file.programs[0].text == parse_program_file(TRACE).programs[0].text
    assert file.eob is eob
    assert bytes(build_program_file(file, eob="lf")) == TRACE


def test_names_are_written_with_the_digits_of_the_control() -> None:
    assert bytes(build_program_file("O05555(A)\n", eob="lf", o_digits=4)) == b"\n%\nO5555(A)\n%\n"
    assert bytes(build_program_file("O 7\n", eob="lf")) == b"\n%\nO00007\n%\n"


def test_one_program_of_a_file_can_be_sent() -> None:
    file = parse_program_file(b"%\nO1\nM30\nO2\nM99\n%\n")
    assert bytes(build_program_file(file.programs[1], eob="lf")) == b"\n%\nO00002\nM99\n%\n"


@pytest.mark.parametrize(
    ("text", "digits", "what"),
    [
        ("%\n%\n", 5, "no program"),
        ("G0X1\n", 5, "line 1: a program without a name"),
        ("%\nO123456\n%", 5, "line 2: 'O123456' is no name of 5 digits"),
        ("O12345\n", 4, "is no name of 4 digits"),
        ("OABC\n", 5, "is no name"),
    ],
)
def test_what_no_control_can_store_is_refused(text: str, digits: int, what: str) -> None:
    with pytest.raises(InvalidCommandError, match=what) as raised:
        build_program_file(text, o_digits=digits)
    assert "alarm 4" in str(raised.value)


def test_what_is_fed_needs_no_name() -> None:
    assert bytes(build_program_file("G0X1\nM30\n", eob="lf", for_dnc=True)) == b"\n%\nG0X1\nM30\n%\n"
    assert bytes(build_program_file("O7\nM30\n", eob="lf", for_dnc=True)) == b"\n%\nO00007\nM30\n%\n"
