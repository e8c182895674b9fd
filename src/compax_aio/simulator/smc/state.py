"""What the controllers of a simulated line keep without power, as plain data that is read strictly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from compax_aio.escaping import shown

from .memory import Parameters

__all__ = ["KIND", "KeptAxis", "read_state", "written_state"]

KIND: Final = "simulated SMC line"
_VERSION: Final = 1
_LARGEST: Final = 1e12
_MOST_WRITES: Final = 2**53
_LARGEST_PROGRAM: Final = 8192
_LARGEST_PARAMETER: Final = 1_000_000
_KEYS: Final = frozenset({"kind", "version", "axes"})
_AXIS_KEYS: Final = frozenset({"name", "parameters", "program", "writes", "place"})


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptAxis:
    """What one controller keeps; unlike a real one it also remembers where its axis stands."""

    name: str
    parameters: Parameters
    program: bytes
    """Without the erased bytes behind it."""
    writes: int
    place: float


def written_state(axes: Mapping[str, KeptAxis]) -> dict[str, Any]:
    """Say it with dictionaries, texts and numbers alone, so that JSON and TOML can hold it."""
    return {
        "kind": KIND,
        "version": _VERSION,
        "axes": {
            letter: {
                "name": axis.name,
                "parameters": {name: getattr(axis.parameters, name) for name in Parameters.names()},
                "program": axis.program.hex(" "),
                "writes": axis.writes,
                "place": axis.place,
            }
            for letter, axis in axes.items()
        },
    }


def read_state(state: Mapping[str, Any]) -> dict[str, KeptAxis]:
    """
    Read what :func:`written_state` has written.

    Raises:
        ValueError: It is no such state, or holds something that no controller can keep; says what.
    """
    if not isinstance(state, Mapping) or state.get("kind") != KIND or state.get("version") != _VERSION:
        _refuse(f"it must say kind {KIND!r} and version {_VERSION}")
    _expect_keys(state, "", _KEYS)
    return {letter: _axis(f"axis {shown(letter)}", axis) for letter, axis in _table(state["axes"], "axes").items()}


def _axis(where: str, axis: Any) -> KeptAxis:
    table = _table(axis, where)
    _expect_keys(table, f"{where}: ", _AXIS_KEYS)
    name = table["name"]
    if not isinstance(name, str) or len(name) != 1 or ord(name) > 255:
        _refuse(f"{where}: the name {shown(name)} is no character")
    return KeptAxis(
        name=name,
        parameters=_parameters(where, table["parameters"]),
        program=_program(where, table["program"]),
        writes=_count(where, "writes", table["writes"], _MOST_WRITES),
        place=_place(where, table["place"]),
    )


def _parameters(where: str, parameters: Any) -> Parameters:
    table = _table(parameters, f"{where}: parameters")
    _expect_keys(table, f"{where}: parameters: ", frozenset(Parameters.names()))
    values = {name: _count(where, name, table[name], _LARGEST_PARAMETER) for name in Parameters.names()}
    if not values["initial_speed"] or not values["slew_speed"]:
        _refuse(f"{where}: a speed is 0")
    return Parameters(**values)


def _program(where: str, text: Any) -> bytes:
    try:
        program = bytes.fromhex(text)
    except (TypeError, ValueError):
        _refuse(f"{where}: the program {shown(text)} is no row of bytes, as 52 00 0F")
    if len(program) > _LARGEST_PROGRAM:
        _refuse(f"{where}: the program has more than {_LARGEST_PROGRAM} bytes")
    return program


def _count(where: str, name: str, value: Any, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        _refuse(f"{where}: {name} = {shown(value)} is no whole number from 0 to {most}")
    return value


def _place(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not -_LARGEST <= value <= _LARGEST:
        _refuse(f"{where}: place = {shown(value)} is no such number")
    return float(value)


def _table(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        _refuse(f"{what} is no table")
    return value


def _expect_keys(table: Mapping[str, Any], where: str, names: frozenset[str]) -> None:
    if missing := names - set(table):
        _refuse(f"{where}{min(missing)} is missing")
    if unknown := set(table) - names:
        _refuse(f"{where}{shown(min(map(str, unknown)))} means nothing")


def _refuse(why: str) -> NoReturn:
    raise ValueError(why)
