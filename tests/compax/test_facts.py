"""The tables of facts: nothing twice, nothing silently missing, every row with its page or with its doubt."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import pytest

from compax_aio import Dialect, Drive, DriveSettings
from compax_aio.compax import facts
from compax_aio.compax.codecs import SerialInterface
from compax_aio.compax.facts.certainty import Certainty
from compax_aio.compax.facts.control_functions import CONTROL_FUNCTIONS, ControlFunction
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS, ERROR_RANGES, FAULT_CODES, device_error
from compax_aio.compax.facts.parameters import PARAMETERS
from compax_aio.compax.facts.quantities import QUANTITIES, SELECTORS, quantity
from compax_aio.compax.facts.serial_interface import INTERFACE_BITS, INTERFACE_PARAMETER, INTERFACE_VALUES
from compax_aio.compax.facts.settings import DIALECT_FACTS, SETTING_FACTS
from compax_aio.compax.facts.status import S16_BITS, S17_BITS
from compax_aio.compax.parameters import Parameters
from compax_aio.compax.program import normalise
from compax_aio.compax.program_memory import ProgramMemory

OWNERS = {"Drive": Drive, "Parameters": Parameters, "ProgramMemory": ProgramMemory}


def rows_of_all_tables() -> Iterator[tuple[str, Any]]:
    for module in pkgutil.iter_modules(facts.__path__):
        for name, table in vars(importlib.import_module(f"{facts.__name__}.{module.name}")).items():
            rows = table.values() if isinstance(table, dict) else table if isinstance(table, tuple) else (table,)
            for row in rows:
                if is_dataclass(row) and not isinstance(row, type):
                    yield f"{module.name}.{name}", row


def test_every_row_that_is_documented_or_inferred_has_a_source() -> None:
    """A placeholder may have one as well: where the function is described whose word it is."""
    founded = {Certainty.DOCUMENTED, Certainty.INFERRED}
    checked = [(name, row) for name, row in rows_of_all_tables() if hasattr(row, "certainty")]
    assert len(checked) > 200
    assert not [
        (name, row)
        for name, row in checked
        if row.certainty in founded and not (getattr(row, "source", "") or getattr(row, "page", None))
    ]


# Status ---------------------------------------------------------------------------------------------------------------


def test_every_bit_says_where_it_stands_and_how_surely() -> None:
    for bit in (*S16_BITS, *S17_BITS):
        assert bit.certainty is Certainty.DOCUMENTED
        assert "UG p. 209" in bit.source


# Chosen quantities ----------------------------------------------------------------------------------------------------


def test_every_quantity_stands_once_and_the_first_sixteen_are_said_to_be_unknown() -> None:
    assert [row.number for row in QUANTITIES] == list(range(1, 33))
    assert [row.number for row in QUANTITIES if row.certainty is Certainty.UNKNOWN] == list(range(1, 17))
    assert all(row.source == "UG p. 211" for row in QUANTITIES[16:])


def test_the_quantities_of_the_manual_are_those() -> None:
    assert "external encoder" in quantity(27).meaning
    assert (quantity(27).unit, quantity(28).unit) == ("axis", "axis")
    assert "motor" in quantity(29).meaning
    assert "unit" in quantity(30).meaning
    assert (quantity(29).unit, quantity(30).unit) == ("%", "%")
    assert [quantity(number).meaning[-1] for number in range(23, 27)] == list("1234")


@pytest.mark.parametrize("number", [0, -1, 33, 10_000])
def test_a_quantity_beyond_the_table_says_that_it_is_unknown(number: int) -> None:
    assert (quantity(number).number, quantity(number).certainty) == (number, Certainty.UNKNOWN)


def test_the_parameters_that_choose_are_known_as_such() -> None:
    meanings = {fact.number: fact.meaning for fact in PARAMETERS}
    assert {status: meanings[parameter] for status, parameter in SELECTORS.items()} == {
        status: f"quantity shown in S{status}" for status in (13, 14, 15)
    }


# The serial interface -------------------------------------------------------------------------------------------------


def test_the_bits_of_p20_are_five_weights_and_only_binary_is_documented() -> None:
    assert [bit.weight for bit in INTERFACE_BITS] == [1, 2, 4, 8, 16]
    assert [bit.weight for bit in INTERFACE_BITS if bit.certainty is Certainty.DOCUMENTED] == [16]
    assert [bit.weight for bit in INTERFACE_BITS if bit.certainty is Certainty.INFERRED] == [1, 2]
    names = {bit.name for bit in INTERFACE_BITS if bit.name}
    assert names == {field.name for field in fields(SerialInterface)} - {"raw", "unknown"}


@pytest.mark.parametrize("value", sorted(INTERFACE_VALUES))
def test_the_values_of_p20_in_the_manual_are_read_as_the_manual_has_them(value: int) -> None:
    interface = SerialInterface.decode(value)
    told = INTERFACE_VALUES[value]
    assert interface.xonxoff == ("Xon/Xoff" in told)
    assert interface.errors_suppressed == ("no error messages" in told)
    assert interface.binary == ("no binary" not in told)
    assert INTERFACE_PARAMETER == 20


# Control functions ----------------------------------------------------------------------------------------------------


def test_there_are_nineteen_control_functions() -> None:
    assert [row.number for row in CONTROL_FUNCTIONS] == list(range(1, 20))


@pytest.mark.parametrize("row", CONTROL_FUNCTIONS, ids=lambda row: str(row.number))
def test_a_control_function_has_a_word_or_says_that_it_is_unknown(row: ControlFunction) -> None:
    assert (row.word is None) == (row.certainty is Certainty.UNKNOWN)


@pytest.mark.parametrize("row", [row for row in CONTROL_FUNCTIONS if row.member], ids=lambda row: str(row.number))
def test_the_member_that_sends_a_control_function_exists(row: ControlFunction) -> None:
    owner, _, member = (row.member or "").partition(".")
    assert callable(getattr(OWNERS[owner], member))


@pytest.mark.parametrize("row", [row for row in CONTROL_FUNCTIONS if row.setting], ids=lambda row: str(row.number))
def test_the_word_of_a_control_function_is_that_of_the_dialect(row: ControlFunction) -> None:
    word = getattr(Dialect(), row.setting or "")
    if row.word is None:
        assert word is None
    else:
        assert normalise(word) == row.word


# Errors ---------------------------------------------------------------------------------------------------------------


def test_every_code_of_two_digits_is_in_one_range() -> None:
    codes = [code for row in ERROR_RANGES for code in row.codes]
    assert codes == list(range(1, 100))
    assert ERROR_RANGES[0].codes == FAULT_CODES
    assert ERROR_RANGES[1].certainty is Certainty.INFERRED, "the sign before E57 is lost in the page"


def test_every_error_says_what_to_do_and_a_cause_only_where_a_page_gives_one() -> None:
    assert all(row.remedy for row in DEVICE_ERRORS)
    assert {row.code for row in DEVICE_ERRORS if row.cause} == {53, 92}
    assert device_error(53).cause is not None
    assert device_error(17).cause is None
    assert device_error(17).remedy


def test_an_error_that_is_named_and_not_explained_says_so() -> None:
    """E10 stands in the example of the error history alone (UG p. 209)."""
    assert device_error(10).certainty is device_error(17).certainty is device_error(90).certainty is Certainty.UNKNOWN
    assert device_error(10).page == 209
    assert device_error(55).certainty is Certainty.DOCUMENTED


# Settings -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "table"), [(DriveSettings, SETTING_FACTS), (Dialect, DIALECT_FACTS)])
def test_every_setting_says_how_its_default_is_founded(kind: Any, table: Any) -> None:
    assert [fact.name for fact in table] == [field.name for field in fields(kind)]


def test_a_word_without_a_default_is_one_that_is_unknown() -> None:
    for fact in DIALECT_FACTS:
        assert (getattr(Dialect(), fact.name) is None) == (fact.certainty is Certainty.UNKNOWN)


def test_words_are_as_certain_in_the_dialect_as_in_the_table_of_functions() -> None:
    certainties = {fact.name: fact.certainty for fact in DIALECT_FACTS}
    for row in CONTROL_FUNCTIONS:
        if row.setting:
            assert certainties[row.setting] is row.certainty, row.setting
