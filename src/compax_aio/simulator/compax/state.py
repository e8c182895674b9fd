"""What a simulated drive keeps without power, as plain data that is read strictly."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NoReturn, TypeVar

from compax_aio.escaping import shown

from ..state_file import load_state_file, write_state_file
from .faults import STAGES
from .parameters import stored
from .program import check_record
from .refusals import RefusedError

__all__ = ["Kept", "read_state", "read_state_file", "write_state_file", "written_state"]

_KIND: Final = "simulated COMPAX"
_VERSION: Final = 1
_AXIS_KEYS: Final = frozenset({"position", "machine_zero", "homed"})
_KEYS: Final = frozenset({
    "kind", "version", "parameters", "variables", "program", "error_history", "error_present", "axis", "cycles",
    "operating_time_s",
})  # fmt: skip
_LARGEST: Final = 1e12
_LONGEST_RECORD: Final = 100
"""Characters; none that a drive takes has more than 30, and in long form twice as many."""
_NAME: Final = re.compile("([NPV])(0|[1-9][0-9]{0,2})")
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What outlives the power; P, V and N by number."""

    parameters: Mapping[int, float]
    """Valid ones that are not as the knobs say."""
    variables: Mapping[int, float]
    """Those that are not 0."""
    program: Mapping[int, str]
    error_history: tuple[int, ...]
    """Newest first."""
    error_present: bool
    """It was not acknowledged when the power went off."""
    position: float
    machine_zero: float
    """Its position, known or not."""
    homed: bool
    cycles: int
    """S9."""
    operating_time_s: float
    """S10."""


def written_state(kept: Kept) -> dict[str, Any]:
    """Say it with dictionaries, lists, texts, numbers and flags alone, so that JSON and TOML can hold it."""
    return {
        "kind": _KIND,
        "version": _VERSION,
        "parameters": {f"P{number}": value for number, value in sorted(kept.parameters.items())},
        "variables": {f"V{number}": value for number, value in sorted(kept.variables.items())},
        "program": {f"N{number}": text for number, text in sorted(kept.program.items())},
        "error_history": list(kept.error_history),
        "error_present": kept.error_present,
        "axis": {"position": kept.position, "machine_zero": kept.machine_zero, "homed": kept.homed},
        "cycles": kept.cycles,
        "operating_time_s": kept.operating_time_s,
    }


def read_state(state: Mapping[str, Any]) -> Kept:
    """
    Read what :func:`written_state` has written, or somebody by its example.

    Raises:
        ValueError: It is no such state, or holds something that no drive can keep; says what.
    """
    if not isinstance(state, Mapping) or state.get("kind") != _KIND or state.get("version") != _VERSION:
        _refuse(f"it must say kind {_KIND!r} and version {_VERSION}")
    _expect_keys(state, "", _KEYS)
    axis = _table(state, "axis")
    _expect_keys(axis, "axis: ", _AXIS_KEYS)
    return Kept(
        parameters=_numbered(state, "parameters", "P", _stored),
        variables=_numbered(state, "variables", "V", _stored),
        program=_numbered(state, "program", "N", _record),
        error_history=_history(state["error_history"]),
        error_present=_flag(state, "error_present"),
        position=_number(axis, "position"),
        machine_zero=_number(axis, "machine_zero"),
        homed=_flag(axis, "homed"),
        cycles=_count(state, "cycles"),
        operating_time_s=_number(state, "operating_time_s", low=0),
    )


def read_state_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """
    Read a file that :func:`.write_state_file` has written, and look whether a drive could keep that.

    Raises:
        ValueError: It is no such file, or holds something that no drive can keep; says what and where.
        OSError: It cannot be read.
    """
    return load_state_file(path, read_state, "drive")


def _refuse(why: str) -> NoReturn:
    raise ValueError(why)


def _expect_keys(table: Mapping[str, Any], where: str, names: frozenset[str]) -> None:
    if missing := names - set(table):
        _refuse(f"{where}{min(missing)} is missing")
    if unknown := set(table) - names:
        _refuse(f"{where}{shown(min(map(str, unknown)))} means nothing")


def _table(state: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = state[name]
    if not isinstance(table, Mapping):
        _refuse(f"{name} is no table")
    return table


def _flag(table: Mapping[str, Any], name: str) -> bool:
    if not isinstance(table[name], bool):
        _refuse(f"{name} = {shown(table[name])} is neither true nor false")
    return bool(table[name])


def _number(table: Mapping[str, Any], name: str, low: float = -_LARGEST) -> float:
    value = table[name]
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= _LARGEST:
        _refuse(f"{name} = {shown(value)} is no such number")
    return float(value)


def _count(table: Mapping[str, Any], name: str) -> int:
    value = _number(table, name, low=0)
    if value != int(value):
        _refuse(f"{name} = {shown(value)} is no count")
    return int(value)


def _history(codes: Any) -> tuple[int, ...]:
    if not isinstance(codes, list | tuple) or len(codes) != STAGES:
        _refuse(f"error_history has {STAGES} codes")
    if any(isinstance(code, bool) or not isinstance(code, int) or not 0 <= code <= 99 for code in codes):
        _refuse(f"error_history = {shown(list(codes))} holds something else than codes from 0 to 99")
    return tuple(codes)


def _numbered(
    state: Mapping[str, Any], name: str, letter: str, read: Callable[[str, int, Any], _T]
) -> Mapping[int, _T]:
    values: dict[int, _T] = {}
    for key, value in _table(state, name).items():
        found = _NAME.fullmatch(key) if isinstance(key, str) else None
        if found is None or found[1] != letter:
            _refuse(f"{name}: {shown(key)} is not one of {letter}1, {letter}2, ...")
        try:
            values[int(found[2])] = read(letter, int(found[2]), value)
        except RefusedError as refused:
            raise ValueError(f"{name}: {key} = {shown(value)} is refused: {refused}") from None
    return values


def _stored(letter: str, number: int, value: Any) -> float:
    name = f"{letter}{number}"
    exact = _number({name: value}, name)
    if stored(letter, number, exact) != exact:
        _refuse(f"{name} = {shown(value)} is finer than it can be stored")
    return exact + 0.0


def _record(_: str, number: int, text: Any) -> str:
    if not isinstance(text, str):
        _refuse(f"N{number} = {shown(text)} is no text")
    if len(text) > _LONGEST_RECORD:
        _refuse(f"N{number} has {len(text)} characters and is no record")
    return check_record(number, text)
