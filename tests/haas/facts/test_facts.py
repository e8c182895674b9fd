"""The tables of Haas controls: every row has its source, no number is there twice, doubt is told as doubt."""

from __future__ import annotations

import tomllib
from dataclasses import FrozenInstanceError
from importlib.resources import files

import pytest

from compax_aio.certainty import Certainty
from compax_aio.haas.facts import characters, port_settings, queries, sources, variables, xmodem
from compax_aio.haas.facts.alarms import ALARMS, alarm_numbered
from compax_aio.haas.facts.characters import CHARACTERS
from compax_aio.haas.facts.data_files import DATA_FILES, DataKind, Presence
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.facts.port_settings import PORT_SETTINGS, WORKING_SETS, Synchronization
from compax_aio.haas.facts.programs import PROTECTED_PROGRAMS
from compax_aio.haas.facts.queries import QUERIES, AnswerKind
from compax_aio.haas.facts.variables import PROTECTED, VARIABLES, protection_of


def test_no_row_is_there_twice() -> None:
    """A table by number silently keeps the last of two."""
    rows = tomllib.loads(files("compax_aio.haas.facts").joinpath("alarms.toml").read_text(encoding="utf-8"))["alarm"]
    assert len({row["name"] for row in rows}) == len(rows) == len(ALARMS)
    numbers = [each.number for each in ALARMS.values() if each.number is not None]
    assert sorted(set(numbers)) == numbers
    codes = [
        value
        for name, value in vars(characters).items()
        if name.isupper() and name[0] != "_" and isinstance(value, int)
    ]
    assert sorted(codes) == sorted(set(codes)) == sorted(CHARACTERS)


def test_every_row_names_a_source_that_is_listed() -> None:
    told = [
        *(each.source for each in ALARMS.values()),
        *(each.source for each in CHARACTERS.values()),
        *(each.source for each in PORT_SETTINGS.values()),
        *(each.source for each in WORKING_SETS),
        *(each.source for each in QUERIES.values()),
        *(each.source for each in DATA_FILES.values()),
        *(each.source for each in PROTECTED),
    ]
    for source in told:
        assert all(part in sources.SOURCES for part in source.split("; ")), source
    assert all(each.source for each in VARIABLES.values())


def test_the_best_of_several_sources_counts() -> None:
    assert sources.certainty_of(f"{sources.OPENDNC}; {sources.MANUAL}") is Certainty.DOCUMENTED
    assert sources.certainty_of(sources.OPENDNC) is Certainty.REPORTED
    assert sources.certainty_of("hearsay") is Certainty.UNKNOWN
    assert PORT_SETTINGS[14].certainty is Certainty.DOCUMENTED
    assert PORT_SETTINGS[25].certainty is Certainty.REPORTED


def test_rows_are_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        ALARMS["overrun"].number = 1  # type: ignore[misc]


# Alarms ---------------------------------------------------------------------------------------------------------------


def test_alarms_402_to_415_are_known_and_second_hand() -> None:
    for number in range(402, 416):
        alarm = alarm_numbered(number)
        assert alarm is not None
        assert not alarm.confirmed
        assert alarm.certainty is Certainty.REPORTED
        assert alarm.text
        assert alarm.meaning
        assert alarm.remedy


@pytest.mark.parametrize(("name", "heard"), [("parity-error", 416), ("framing-error", 417), ("break", 418)])
def test_numbers_that_are_only_heard_are_no_numbers(name: str, heard: int) -> None:
    assert ALARMS[name].number is None
    assert ALARMS[name].heard_as == heard
    assert alarm_numbered(heard) is None
    assert str(heard) in str(ALARMS[name])
    assert "not known" in str(ALARMS[name])


def test_what_the_manual_tells_of_errors_is_confirmed() -> None:
    """Haas 11596-8000: parity and framing errors stop the receive operation; a wrong CRC does not."""
    confirmed = {name for name, each in ALARMS.items() if each.confirmed}
    assert confirmed == {"parity-error", "framing-error", "wrong-checksum", "garbled-data"}
    assert {name for name, each in ALARMS.items() if each.stops} == {"parity-error", "framing-error"}


def test_an_alarm_is_written_with_its_number() -> None:
    assert str(ALARMS["no-program-name"]) == "alarm 404 (RS-232 NO PROG NAME)"
    assert str(ALARMS["wrong-checksum"]) == "alarm CRC ERROR (number not known)"


# Settings -------------------------------------------------------------------------------------------------------------


def test_the_settings_of_the_sheet_are_there() -> None:
    assert set(PORT_SETTINGS) == {11, 12, 13, 14, 24, 25, 37, 41, 50, 143, 156, 187}
    assert PORT_SETTINGS[25].values == ("CR LF", "LF ONLY", "CR ONLY", "CR CR", "LF LF")
    assert "115200" in PORT_SETTINGS[11].values
    assert PORT_SETTINGS[14].values == PORT_SETTINGS[50].values == ("RTS/CTS", "XON/XOFF", "DC CODES", "XMODEM")


def test_each_working_set_can_be_set() -> None:
    for each in WORKING_SETS:
        assert each.baudrate in port_settings.BAUD_RATES
        assert each.data_bits in (7, 8)
        assert each.synchronization is not Synchronization.XMODEM or (each.data_bits, each.parity) == (8, "none")


def test_ends_of_blocks_are_bytes() -> None:
    assert [each.data for each in EobPattern] == [b"\r\n", b"\n", b"\r", b"\r\r", b"\n\n"]
    assert EobPattern("cr lf") == "cr lf"


# The others -----------------------------------------------------------------------------------------------------------


def test_what_n0_and_n9999_are_in_each_kind() -> None:
    """Haas 11596-8000."""
    assert {kind: rules.checksum for kind, rules in DATA_FILES.items()} == {
        DataKind.PARAMETERS: Presence.MANDATORY,
        DataKind.SETTINGS: Presence.OPTIONAL,
        DataKind.OFFSETS: Presence.OPTIONAL,
        DataKind.MACROS: Presence.ABSENT,
    }
    assert DATA_FILES[DataKind.MACROS].last_line is Presence.MANDATORY
    assert [kind for kind, rules in DATA_FILES.items() if not rules.may_be_edited] == [DataKind.PARAMETERS]


def test_programs_8000_to_9999_are_protected() -> None:
    assert 8000 in PROTECTED_PROGRAMS
    assert 9999 in PROTECTED_PROGRAMS
    assert 7999 not in PROTECTED_PROGRAMS
    assert 10_000 not in PROTECTED_PROGRAMS


def test_each_example_of_an_answer_begins_as_its_row_says() -> None:
    for row in QUERIES.values():
        assert row.classic_example.startswith(row.classic), row.command
        assert row.ethernet_example.startswith(row.ethernet), row.command
        assert set(row.heads) == {row.classic, row.ethernet}
    assert QUERIES["Q100"].heads == ("S/N", "SERIAL NUMBER")
    assert QUERIES["Q500"].answer is AnswerKind.PROGRAM
    assert [row.command for row in QUERIES.values() if row.takes_variable] == ["Q600", "E"]
    assert queries.BUSY == "STATUS, BUSY"


def test_calibration_of_probes_is_protected_and_no_example_of_an_allow_list_touches_it() -> None:
    for number in (150, 199, 550, 599, 709, 10_550, 3000, 3006):
        assert protection_of(number) is not None, number
    for number in (1, 33, 100, 149, 200, 549, 600, 3007, 10_200):
        assert protection_of(number) is None, number
    assert not any(number in each for span in variables.EXAMPLE_WRITABLE for number in span for each in PROTECTED)


def test_variables_are_named() -> None:
    assert variables.name_of(3027) == "spindle speed"
    assert variables.name_of(5022) == "Y machine position"
    assert variables.name_of(77) == ""
    assert VARIABLES[3027].unit == "rpm"
    assert VARIABLES[3027].read_only


def test_characters_are_written_so_that_they_can_be_found() -> None:
    assert characters.name_of(0x11) == "DC1 (11 hex)"
    assert characters.name_of(0x7F) == "DEL (7F hex)"
    assert characters.name_of(0x41) == "'A'"
    assert characters.name_of(0x07) == "07 hex"
    assert characters.name_of(0xC4) == "C4 hex"


def test_the_sum_of_a_block_is_one_byte() -> None:
    """Of what the first block of the trace in the sheet (section 12) begins with, and of as much as a block holds."""
    assert xmodem.checksum(b"\x0a%\x0aO05555(") == (0x0A + 0x25 + 0x0A + 0x4F + 0x30 + 4 * 0x35 + 0x28) & 0xFF
    assert xmodem.checksum(b"\xff" * 128) == 128 * 255 % 256
