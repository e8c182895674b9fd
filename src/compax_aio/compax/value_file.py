"""Parameters and variables as a file: TOML that people read, written whole or not at all, read strictly."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from pathlib import Path
from typing import Any, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import name_of, read_text, replace_file

__all__ = ["ValueFile", "read_file", "read_toml", "write_file"]

_KEY: Final = re.compile(r"([PV])([0-9]{1,3})")
_SHOWN: Final = 5
"""Of the names in a file that is no such file, so many are told."""
_MAX_DECIMALS: Final = 15
"""Enough for whatever a number in an answer has told."""
_MAX_DOTS: Final = 100
"""In a line: reading a key of ten thousand parts, ``a.a.a``, takes hours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueFile:
    """What such a file says."""

    kind: str
    """``parameters`` or ``variables``: the name of the table that holds the values."""
    drive: str
    saved_at: str
    values: Mapping[int, float]


def write_file(
    path: Path,
    *,
    kind: str,
    letter: str,
    drive: str,
    saved_at: datetime,
    values: Mapping[int, float],
    decimals: Mapping[int, int],
    comments: Mapping[int, str],
) -> None:
    """
    Write *values* to *path*; a file that is there is replaced at the end, or left as it is.

    Raises:
        OSError: The file cannot be written.
    """
    lines = [
        f"# {kind.capitalize()} of a COMPAX drive, as it sent them.",
        f'kind = "{kind}"',
        f'drive = "{_plain(drive)}"',
        f"saved_at = {saved_at.isoformat(timespec='seconds')}",
        "",
        f"[{kind}]",
    ]
    for number, value in sorted(values.items()):
        line = f"{letter}{number} = {_as_sent(value, decimals[number])}"
        lines.append(f"{line:<24}# {_plain(comments[number])}" if number in comments else line)
    replace_file(path, "\n".join(lines) + "\n")


def _as_sent(value: float, decimals: int) -> str:
    """Write *value* with *decimals*, or with as many more as it has: what was not sent is not written."""
    exact = (f"{value:.{more}f}" for more in range(decimals, _MAX_DECIMALS))
    return next((text for text in exact if float(text) == value), repr(value))


def _plain(text: str) -> str:
    """Write *text* so that it neither ends a line, nor a string, nor is lost on the way to a file."""
    return "".join(each if each.isprintable() and each not in '"\\' else "?" for each in text)


def read_toml(path: Path, kind: str) -> dict[str, Any]:
    """
    Read a file of *kind*, which names it in errors, as TOML.

    Raises:
        InvalidCommandError: It is too large, or no TOML.
        OSError: It cannot be read.
    """
    text = read_text(path, f"TOML file of {kind}")
    if any(line.count(".") > _MAX_DOTS for line in text.split("\n")):
        raise InvalidCommandError(
            f"{name_of(path)} is no TOML that is read here: a line has more than {_MAX_DOTS} dots"
        )
    try:
        content = tomllib.loads(text)
        repr(content)  # as whoever tells what is wrong with it will want to
    except (ValueError, RecursionError) as error:  # no TOML, or a number of thousands of digits
        raise InvalidCommandError(f"{name_of(path)} is no TOML: {error}") from error
    return content


def read_file(path: Path, *, kind: str, letter: str) -> ValueFile:
    """
    Read a file that :func:`write_file` has written, or somebody by its example.

    Raises:
        InvalidCommandError: It is no such file, or holds something that is no such value; says what and where.
        OSError: It cannot be read.
    """
    content = read_toml(path, kind)
    if content.get("kind") != kind or set(content) - {"kind", "drive", "saved_at", kind}:
        raise InvalidCommandError(
            f"{name_of(path)} is no file of {kind}: "
            f'it must say kind = "{kind}" and hold a table [{kind}], and nothing else',
            hint=f"it holds {', '.join(map(shown, sorted(content)[:_SHOWN])) or 'nothing'}",
        )
    table = content.get(kind)
    if not isinstance(table, dict):
        raise InvalidCommandError(f"{name_of(path)} has no table [{kind}]")
    values: dict[int, float] = {}
    for key, value in table.items():
        found = _KEY.fullmatch(key)
        if found is None or found[1] != letter or int(found[2]) in values:
            raise InvalidCommandError(f"{name_of(path)}: {shown(key)} is not one of {letter}1, {letter}2, …, each once")
        values[int(found[2])] = _number(path, key, value)
    return ValueFile(
        kind=kind, drive=str(content.get("drive", "")), saved_at=str(content.get("saved_at", "")), values=values
    )


def _number(path: Path, key: str, value: object) -> float:
    if not isinstance(value, bool) and isinstance(value, int | float):
        with suppress(OverflowError):
            if isfinite(value):
                return float(value)
    raise InvalidCommandError(f"{name_of(path)}: {key} = {shown(value)} is no number that a drive has")
