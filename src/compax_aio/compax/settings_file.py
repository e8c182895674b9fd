"""Settings of a drive as a file: TOML that people read and write, read strictly, written whole or not at all."""

from __future__ import annotations

import dataclasses
import json
import re
import typing
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, Final, TypeVar

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import name_of, replace_file
from .facts.settings import DIALECT_FACTS, SETTING_FACTS, SettingFact
from .settings import AxisUnit, Dialect, DriveSettings
from .value_file import read_toml

__all__ = ["read_settings", "settings_from", "settings_text", "write_settings"]

_Table = TypeVar("_Table", DriveSettings, Dialect, AxisUnit)

_LONGEST_NUMBER: Final = 12
"""Digits of a value of P90."""

_HEAD: Final = """\
# Settings of a COMPAX drive for compax_aio. What is left out has its default.
# In brackets: how well the default is founded, and where the manuals speak of it.
"""
_UNITS_EXAMPLE: Final = """\
# [units.1]
# name = "mm"
# decimals = 2
"""
_BY_NAME: Final = {fact.name: fact for fact in SETTING_FACTS}
_OF_DIALECT: Final = {fact.name: fact for fact in DIALECT_FACTS}


# Reading ------------------------------------------------------------------------------------------------------------


def read_settings(path: str | Path) -> DriveSettings:
    """
    Read the settings of a drive from *path*; what the file does not say has its default.

    Raises:
        InvalidCommandError: It is no TOML, has a key that is no setting, or a value that cannot be meant; says which.
        OSError: It cannot be read.
    """
    content = read_toml(Path(path), "settings")
    try:
        return _table(DriveSettings, content, "")
    except InvalidCommandError as error:
        raise InvalidCommandError(f"{name_of(Path(path))}: {error.what}", hint=error.hint) from error


def settings_from(table: Mapping[str, Any]) -> DriveSettings:
    """
    Make settings of a table that was read, of TOML or JSON; what it does not say has its default.

    Raises:
        InvalidCommandError: It has a key that is no setting, or a value that cannot be meant; says which.
    """
    return _table(DriveSettings, dict(table), "")


def _table(kind: type[_Table], content: object, where: str) -> _Table:
    """Read one table of the file, which stands at *where*."""
    if not isinstance(content, dict):
        raise InvalidCommandError(f"{where} must be a table, not {shown(content)}")
    hints = typing.get_type_hints(kind)
    for key in content:
        if key not in hints:
            raise _unknown(_at(where, key), key, hints)
    needed = [each.name for each in dataclasses.fields(kind) if _has_no_default(each) and each.name not in content]
    if needed:
        raise InvalidCommandError(f"{where} says nothing of {', '.join(needed)}")
    return kind(**{key: _value(hints[key], value, _at(where, key)) for key, value in content.items()})


def _at(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def _has_no_default(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _unknown(name: str, key: str, possible: Iterable[str]) -> InvalidCommandError:
    close = get_close_matches(key, possible, 1)
    guess = f"did you mean {close[0]}? " if close else ""
    return InvalidCommandError(f"there is no setting {shown(name)}", hint=f"{guess}there are {', '.join(possible)}")


def _value(hint: Any, value: object, name: str) -> Any:
    """Read one value of the type that *hint* says."""
    if (typing.get_origin(hint) or hint) is Mapping:
        return _units(value, name)
    options = [each for each in typing.get_args(hint) if each is not NoneType]
    if typing.get_origin(hint) is not tuple and len(options) == 1:
        hint = options[0]  # nothing in the file stands for None
    if typing.get_origin(hint) is tuple:
        if not isinstance(value, list) or len(value) != 2:
            raise InvalidCommandError(f"{name} must be two numbers as [-10, 500], not {shown(value)}")
        return tuple(_number(each, name) for each in value)
    if hint is Dialect:
        return _table(Dialect, value, name)
    if issubclass(hint, Enum):
        return _member(hint, value, name)
    if hint is float:
        return _number(value, name)
    if type(value) is not hint:
        wanted = {bool: "true or false", int: "a whole number", str: "a text in quotes"}[hint]
        raise InvalidCommandError(f"{name} must be {wanted}, not {shown(value)}")
    return value


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidCommandError(f"{name} must be a number, not {shown(value)}")
    try:
        return float(value)
    except OverflowError:
        raise InvalidCommandError(f"{name} is too large a number") from None


def _member(kind: type[Enum], value: object, name: str) -> Enum:
    if not isinstance(value, str) or value not in kind.__members__:
        raise InvalidCommandError(f"{name} must be one of {', '.join(kind.__members__)}, not {shown(value)}")
    return kind[value]


def _units(value: object, name: str) -> dict[int, AxisUnit]:
    if not isinstance(value, dict):
        raise InvalidCommandError(f"{name} must be tables as [{name}.1], not {shown(value)}")
    units = {}
    for key, unit in value.items():
        if not _is_whole(key):
            raise InvalidCommandError(f"{name}.{key}: {shown(key)} is no value of P90, which are whole numbers")
        units[int(key)] = _table(AxisUnit, unit, f"{name}.{key}")
    return units


def _is_whole(text: str) -> bool:
    return len(text) <= _LONGEST_NUMBER and re.fullmatch(r"-?(0|[1-9][0-9]*)", text) is not None and text != "-0"


# Writing ------------------------------------------------------------------------------------------------------------


def write_settings(path: str | Path, settings: DriveSettings) -> None:
    """
    Write *settings* to *path*, each with what it means; a file that is there is replaced at the end, or left as it is.

    Raises:
        InvalidCommandError: A name in them cannot be written as text.
        OSError: The file cannot be written.
    """
    replace_file(Path(path), settings_text(settings))


def settings_text(settings: DriveSettings) -> str:
    """
    Return *settings* as TOML, every one of them, each with what it means and how well its default is founded.

    Raises:
        InvalidCommandError: A name in them cannot be written as text.
    """
    plain = [each.name for each in dataclasses.fields(settings) if each.name not in {"units", "dialect"}]
    return "\n".join(
        [
            _HEAD,
            *(_entry(_BY_NAME[name], getattr(settings, name), _default(DriveSettings, name)) for name in plain),
            _comment(_BY_NAME["units"]),
            *(_unit_table(number, unit) for number, unit in sorted(settings.units.items())),
            *([] if settings.units else [_UNITS_EXAMPLE]),
            f"{_comment(_BY_NAME['dialect'])}\n[dialect]\n",
            *(
                _entry(_OF_DIALECT[each.name], getattr(settings.dialect, each.name), each.default)
                for each in dataclasses.fields(settings.dialect)
            ),
        ]
    )


def _default(kind: type[DriveSettings], name: str) -> object:
    return next(each.default for each in dataclasses.fields(kind) if each.name == name)


def _entry(fact: SettingFact, value: object, default: object) -> str:
    return "\n".join((*_entry_lines(fact, value, default), ""))


def _entry_lines(fact: SettingFact, value: object, default: object) -> Iterator[str]:
    yield _comment(fact)
    if value is None:
        yield f"# {fact.name} is not set"
    elif value == default:
        yield f"{fact.name} = {_toml(value)}"
    else:
        yield f"{fact.name} = {_toml(value)}  # default: {'not set' if default is None else _toml(default)}"


def _comment(fact: SettingFact) -> str:
    founded = [fact.certainty.name.lower()] if fact.certainty else ["chosen here"]
    return f"# {fact.meaning} ({', '.join(founded + [fact.source] * bool(fact.source))})"


def _unit_table(number: int, unit: AxisUnit) -> str:
    return f"[units.{number}]\nname = {_toml(unit.name)}\ndecimals = {_toml(unit.decimals)}\n"


def _toml(value: object) -> str:
    """Write a value as TOML has it, which for these is nearly what Python and JSON have."""
    if isinstance(value, Enum):
        return _toml(value.name)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        try:
            text.encode()
        except UnicodeEncodeError:
            raise InvalidCommandError(f"{shown(value)} cannot be written to a file: it is no text") from None
        return text
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Iterable):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(float(typing.cast("float", value)))
