"""Two files beside each other: what matters is told, what a control writes in its own way is not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.comparing import (
    Difference,
    How,
    ProgramDifference,
    compare_data,
    diff,
    first_difference,
    same_program,
)
from compax_aio.haas.language.building import build_program_file
from compax_aio.haas.language.data_file import DataFile, parse_data_file
from compax_aio.haas.language.program_file import ProgramFile, parse_program_file


def settings(*lines: str, end: str = "\n") -> DataFile:
    return parse_data_file(end.join(("%", *lines, "%", "")), "settings")


# Numbered data --------------------------------------------------------------------------------------------------------


def test_a_changed_value_is_told_with_the_name_of_the_setting() -> None:
    found = diff(settings("N0 V1", "N11 V9600", "N12 V1"), settings("N0 V1", "N11 V19200", "N12 V1"))
    assert found == (
        Difference(
            number=11, name="BAUD RATE SELECT", how=How.CHANGED, before="9600", after="19200", before_line=3,
            after_line=3,
        ),
    )  # fmt: skip
    assert str(found[0]) == "N11 (BAUD RATE SELECT): 9600 became 19200"


def test_blanks_ends_lead_in_and_n0_do_not_count() -> None:
    before = settings("N0 V1", "N1 V- 5", "", "N2 V7")
    after = parse_data_file(b"\x12%\r\nN 1V -5 \r\nN02 V7\r\n%\r\n\x14", "settings")
    comparison = compare_data(before, after)
    assert comparison.is_equal
    assert comparison.checksum_differs
    assert comparison.checksums == ("1", None)
    assert not compare_data(before, before).checksum_differs


def test_values_are_compared_as_text() -> None:
    assert [str(each) for each in diff(settings("N1 V100"), settings("N1 V100."))] == ["N1: 100 became 100."]


def test_numbers_that_are_missing_or_new_are_told() -> None:
    found = diff(settings("N1 V1", "N2 V2", "N3 V3"), settings("N1 V1", "N3 V3", "N4 V4"))
    assert [(each.number, each.how, each.before, each.after) for each in found] == [
        (2, How.MISSING, "2", None),
        (4, How.ADDED, None, "4"),
    ]
    assert [str(each) for each in found] == ["N2: is missing, was 2", "N4: is new, 4"]
    assert (found[0].before_line, found[0].after_line) == (3, None)


def test_another_order_is_told_once() -> None:
    found = diff(settings("N1 V1", "N2 V2", "N3 V3"), settings("N2 V2", "N1 V1", "N3 V3"))
    assert [(each.number, each.how) for each in found] == [(1, How.MOVED)]
    assert str(found[0]) == "N1: stood in line 2, stands in line 3"


def test_numbers_that_come_twice_are_compared_one_by_one() -> None:
    found = diff(settings("N1 V1", "N1 V2"), settings("N1 V1", "N1 V3", "N1 V4"))
    assert [(each.before, each.after) for each in found] == [("2", "3"), (None, "4")]


def test_macro_variables_have_names_and_their_n9999_counts() -> None:
    before = parse_data_file("%\nN3027 V0\nN9999 V0\n%\n", "macros")
    after = parse_data_file("%\nN3027 V1\nN9999 V1\n%\n", "macros")
    assert [str(each) for each in diff(before, after)] == ["N3027 (spindle speed): 0 became 1", "N9999: 0 became 1"]


def test_parameters_and_settings_cannot_be_compared() -> None:
    with pytest.raises(InvalidCommandError, match="settings and offsets cannot be compared"):
        diff(settings("N1 V1"), parse_data_file("%\nN1 V1\n%\n", "offsets"))
    with pytest.raises(InvalidCommandError, match="programs and numbered data"):
        diff(settings("N1 V1"), parse_program_file("%\nO1\n%\n"))


@given(st.dictionaries(st.integers(1, 20), st.integers(-5, 5)), st.dictionaries(st.integers(1, 20), st.integers(-5, 5)))
def test_what_is_told_makes_the_one_of_the_other(before: dict[int, int], after: dict[int, int]) -> None:
    def file(values: dict[int, int]) -> DataFile:
        return settings(*(f"N{number} V{value}" for number, value in sorted(values.items())))

    made = {number: str(value) for number, value in before.items()}
    for each in diff(file(before), file(after)):
        assert made.get(each.number) == each.before
        if each.after is None:
            del made[each.number]
        else:
            made[each.number] = each.after
    assert made == {number: str(value) for number, value in after.items()}


# Programs -------------------------------------------------------------------------------------------------------------

SENT = "%\nO1234(A b)\nN10 G0 X1. (go  there)\n\nIF [#1 EQ 2] GOTO 10\nM30\n%\n"


@pytest.mark.parametrize(
    "received",
    [
        SENT,
        "\r\n" + SENT.replace("\n", "\r\n") + "\x14",
        SENT.replace("N10 G0 X1. (", "N10G0X1.(").replace("O1234", "O01234 "),
        SENT.replace("M30\n", "M30\n\n\n"),
        SENT.replace("M30", "M30 "),
        SENT.replace("[#1 EQ 2] GOTO", "[#1EQ2]GOTO"),
        SENT.replace("\n", "\n\n"),
    ],
)
def test_what_a_control_writes_in_its_own_way_does_not_count(received: str) -> None:
    assert first_difference(SENT, received) is None
    assert same_program(SENT, received)
    assert diff(parse_program_file(SENT), parse_program_file(received)) == ()


@pytest.mark.parametrize(
    ("received", "said"),
    [
        (
            SENT.replace("X1.", "X2."),
            "O1234, line 3: 'N10 G0 X1. (go  there)' became 'N10 G0 X2. (go  there)' (line 3)",
        ),
        (SENT.replace("go  there", "go there"), "O1234, line 3: 'N10 G0 X1. (go  there)' became 'N10 G0 X1. (go there"),
        (SENT.replace("\n\n", "\n"), "O1234, line 4: '' became 'IF [#1 EQ 2] GOTO 10' (line 4)"),
        (SENT.replace("M30", "(M30)"), "O1234, line 6: 'M30' became '(M30)' (line 6)"),
        (SENT.replace("M30\n", ""), "O1234, line 6: 'M30' is missing"),
        (SENT.replace("M30\n", "M30\nM99\n"), "O1234: 'M99' is new (line 7)"),
        (SENT.replace("O1234", "O1235"), "O1234, line 2: 'O1234(A b)' is missing"),
        ("%\n%\n", "O1234, line 2: 'O1234(A b)' is missing"),
    ],
)
def test_the_first_place_that_differs_is_told(received: str, said: str) -> None:
    found = first_difference(SENT, received)
    assert isinstance(found, ProgramDifference)
    assert str(found).startswith(said)
    assert not same_program(SENT, received)


def test_of_several_programs_each_one_that_differs_is_told() -> None:
    before = parse_program_file("%\nO1\nG0\nO2\nG1\nO3\nG2\nO4\nG3\n%\n")
    after = parse_program_file("%\nO2\nG1\nO1\nG9\nO3\nG2\nG3\nO5\n%\n")
    assert [(each.number, each.name, each.how, each.before, each.after) for each in diff(before, after)] == [
        (1, "O1", How.CHANGED, "G0", "G9"),
        (3, "O3", How.ADDED, None, "G3"),
        (4, "O4", How.MISSING, "O4", None),
        (5, "O5", How.ADDED, None, "O5"),
    ]


def test_programs_without_names_are_compared_too() -> None:
    found = first_difference("%\nG0\n%\n", "%\nG1\n%\n")
    assert str(found) == "a program without a name, line 2: 'G0' became 'G1' (line 2)"
    assert same_program("%\nOABC\n%\n", "%\nOABC\n%\n")
    assert not same_program("%\nOABC\n%\n", "%\nOABD\n%\n")


WORDS = st.sampled_from(["G0", "X1.5", "(A COMMENT)", "M98 P1", "#1=2"])
BLOCKS = st.lists(st.lists(WORDS, max_size=4).map(" ".join), max_size=6)


@given(BLOCKS, st.sampled_from(["cr lf", "lf", "cr", "cr cr", "lf lf"]), st.booleans(), st.sampled_from([4, 5]))
def test_a_program_is_known_again_as_a_control_sends_it(blocks: list[str], eob: str, spaces: bool, digits: int) -> None:
    sent = parse_program_file("\n".join(["%", "O0077", *blocks, "%", ""]), eob="lf")
    written = build_program_file(sent, eob=eob, o_digits=digits)
    data = bytes(written)
    if not spaces:
        data = data.replace(b" X", b"X").replace(b" G", b"G")
    back: ProgramFile = parse_program_file(data, eob=eob)
    assert first_difference(sent, back) is None
