"""Files of numbered data: every byte kept, N0 and N9999 treated as the manual says, errors with their places."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.facts.data_files import DataKind
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.language.data_file import DataFile, parse_data_file

DC_OUT = b"\x12%\r\nN0 V12345\r\nN1 V100\r\n%\r\n\x14"
"""Sheet, section 12."""

NUMBERS = st.integers(0, 9999)
VALUES = st.from_regex(r"([+-] ?)?([0-9]{1,9}(\.[0-9]{0,6})?|\.[0-9]{1,4})", fullmatch=True)
LINE = st.builds(
    "N{}{}{}V{}{}{}".format, st.sampled_from(["", " "]), NUMBERS, st.sampled_from(["", " ", "  "]),
    st.sampled_from(["", " ", "\t"]), VALUES, st.sampled_from(["", "  ", "\x00"]),
)  # fmt: skip
END = st.sampled_from(["\r\n", "\n", "\r", "\r\r", "\n\n", "\n\r\n"])


@st.composite
def files(draw: Any) -> bytes:
    lines = draw(st.lists(LINE, max_size=8))
    text = draw(st.sampled_from(["", "\r\n", "\x12", "\x00\x00"]))
    for line in ("%", *lines, "%"):
        text += line + draw(END)
    return str(text + draw(st.sampled_from(["", "\x14", "\x1a\x1a"]))).encode("latin-1")


@given(files(), st.sampled_from(DataKind))
def test_a_file_gives_the_bytes_it_was_made_of(data: bytes, kind: DataKind) -> None:
    file = parse_data_file(data, kind)
    assert bytes(file) == data
    assert len(file) == len(data)
    for each in file:
        assert data[each.offset :].startswith(each.raw)
    assert len(file.lines) == data.count(b"N")


def test_the_vector_of_the_sheet() -> None:
    file = parse_data_file(DC_OUT, "parameters")
    assert (file.kind, file.checksum, file.values) == (DataKind.PARAMETERS, "12345", {1: "100"})
    assert (file.had_n0, file.had_n9999, file.last_value) == (True, False, None)
    assert file.payload == DC_OUT[1:-1]
    assert (file.lead_in, file.tail) == (b"\x12", b"\x14")
    assert file.eob is EobPattern.CR_LF
    assert (file.has_start, file.has_end) == (True, True)
    assert [each.line for each in file] == [2, 3]


def test_values_are_text() -> None:
    file = parse_data_file("%\nN1 V007\nN2 V-1.50\nN3V.5\nN 4 V 5.\nN5 V+ 12\nN6 V99999999999999999999\n%\n", "offsets")
    assert file.values == {1: "007", 2: "-1.50", 3: ".5", 4: "5.", 5: "+12", 6: "99999999999999999999"}


@pytest.mark.parametrize(
    ("line", "column", "what"),
    [
        ("G0X1", 1, "a line of data begins with N, not 'G0X1'"),
        ("  n1 V1", 3, "begins with N, not 'n1 V1'"),
        ("(N1 V100)", 1, "begins with N"),
        ("N V1", 3, "behind N stands a number"),
        ("N1234567890 V1", 2, "at most 9 digits"),
        ("N1", 3, "behind the number stands V, not nothing"),
        ("N1 X5", 4, "behind the number stands V, not 'X5'"),
        ("N1 V", 5, "behind V stands a value: .*, not nothing"),
        ("N1 VABC", 5, "behind V stands a value"),
        ("N1 V-.", 5, "behind V stands a value"),
        ("N1 V5 7", 7, "behind the value stands nothing, not '7'"),
        ("N1 V5;", 6, "behind the value stands nothing, not ';'"),
        ("%N1 V5", 1, "begins with N"),
        ("N1 V5\xc4", 6, "behind the value stands nothing, not 'Ä'"),
    ],
)
def test_what_is_no_line_of_data_is_told_with_its_place(line: str, column: int, what: str) -> None:
    with pytest.raises(InvalidCommandError, match=rf"line 3, column {column}: .*{what}") as raised:
        parse_data_file(f"%\nN0 V1\n{line}\n%\n", "settings")
    assert "alarm 4" in str(raised.value)


def test_text_around_the_data_is_none_of_it() -> None:
    file = parse_data_file(b"GARBAGE\n%\nN1 V1\n%\nMORE\n", "settings")
    assert file.values == {1: "1"}
    assert file.tail == b"MORE\n"


def test_a_kind_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="'tools' is no kind of data; there are parameters, settings"):
        parse_data_file(b"", "tools")


# Editing --------------------------------------------------------------------------------------------------------------

SETTINGS = b"\x12%\r\nN0 V777\r\nN1 V100\r\nN2  V 200 \r\n\r\nN3 V300\r\n%\r\n\x14"


@pytest.mark.parametrize("kind", ["settings", "offsets"])
def test_a_change_leaves_n0_out_and_all_else_as_it_was(kind: str) -> None:
    file = parse_data_file(SETTINGS, kind)
    changed = file.with_values({2: "-250.5"})
    assert bytes(changed) == b"\x12%\r\nN1 V100\r\nN2  V -250.5 \r\n\r\nN3 V300\r\n%\r\n\x14"
    assert not changed.had_n0
    assert changed.values == {1: "100", 2: "-250.5", 3: "300"}
    assert bytes(file) == SETTINGS


def test_a_value_as_it_was_changes_nothing_and_keeps_n0() -> None:
    file = parse_data_file(SETTINGS, "settings")
    assert file.with_values({1: "100", 3: 300}) is file
    assert file.with_values({}) is file


def test_the_same_number_written_otherwise_is_a_change() -> None:
    """Compared as text: nothing is known of how a control reads them."""
    file = parse_data_file(SETTINGS, "settings")
    assert b"N0" not in bytes(file.with_values({1: "100."}))


@given(st.dictionaries(st.sampled_from([1, 2, 3]), VALUES))
def test_only_the_values_that_are_given_change(values: dict[int, str]) -> None:
    file = parse_data_file(SETTINGS, "settings")
    changed = file.with_values(values)
    bare = {number: value.replace(" ", "") for number, value in values.items()}
    assert changed.values == {**file.values, **bare}
    assert changed.had_n0 == (changed.values == file.values)


MACROS = b"%\nN100 V1.5\nN9999 V0\nN101 V2\n%\n"


def test_n9999_of_macro_variables_stays_where_it_stood() -> None:
    file = parse_data_file(MACROS, "macros")
    assert (file.had_n0, file.had_n9999, file.last_value, file.values) == (False, True, "0", {100: "1.5", 101: "2"})
    assert bytes(file.with_values({101: 3.25})) == b"%\nN100 V1.5\nN9999 V0\nN101 V3.25\n%\n"


def test_macro_variables_never_get_an_n0() -> None:
    file = parse_data_file(b"%\nN0 V1\nN100 V1\nN9999 V0\n%\n", "macros")
    assert bytes(file.with_values({100: "2"})) == b"%\nN100 V2\nN9999 V0\n%\n"


def test_parameters_are_never_edited() -> None:
    file = parse_data_file(DC_OUT, "parameters")
    for values in ({1: "200"}, {1: "100"}, {}):
        with pytest.raises(InvalidCommandError, match="byte for byte"):
            file.with_values(values)
    with pytest.raises(InvalidCommandError, match="N0 is mandatory with parameters"):
        file.without_checksum()


@pytest.mark.parametrize(
    ("values", "what"),
    [
        ({0: "1"}, "N0 is no setting"),
        ({9999: "1"}, "N9999 is no setting"),
        ({7: "1"}, "the file of settings has no N7"),
        ({4: "1"}, "the file of settings has N4 2 times"),
        ({1: ""}, "N1: '' is no value"),
        ({1: "1\n2"}, "is no value"),
        ({1: "ON"}, "'ON' is no value"),
        ({1: True}, "True is no value"),
        ({1: float("nan")}, "nan is no value"),
        ({1: 1e30}, r"1e\+30 is no value"),
        ({1: "٣"}, "is no value"),
    ],
)
def test_what_cannot_be_written_is_refused(values: dict[int, Any], what: str) -> None:
    file = parse_data_file(b"%\nN0 V1\nN1 V1\nN4 V1\nN4 V2\nN9999 V1\n%\n", "settings")
    with pytest.raises(InvalidCommandError, match=what):
        file.with_values(values)


def test_n0_can_be_left_out_alone() -> None:
    file = parse_data_file(SETTINGS, "offsets")
    assert bytes(file.without_checksum()) == SETTINGS.replace(b"N0 V777\r\n", b"")
    bare = file.without_checksum()
    assert bare.without_checksum() is bare


def test_doubled_ends_of_lines_stay_doubled() -> None:
    file = parse_data_file(b"%\n\nN0 V1\n\nN1 V1\n\n%\n\n", "settings")
    changed: DataFile = file.with_values({1: 2})
    assert bytes(changed) == b"%\n\nN1 V2\n\n%\n\n"
    assert changed.eob is EobPattern.LF_LF
