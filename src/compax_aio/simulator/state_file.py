"""What simulated devices keep without power, as files that are written whole and read strictly."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from compax_aio.escaping import shown
from compax_aio.text_file import name_of, read_text, replace_file

__all__ = ["load_state_file", "write_state_file"]


def write_state_file(path: str | os.PathLike[str], state: Mapping[str, Any]) -> None:
    """
    Write *state* to *path* as JSON; a file that is there is replaced at the end, or left as it is.

    Raises:
        OSError: The file cannot be written.
    """
    replace_file(Path(path), json.dumps(state, indent=2, allow_nan=False) + "\n")


def load_state_file(
    path: str | os.PathLike[str], check: Callable[[Mapping[str, Any]], object], device: str
) -> dict[str, Any]:
    """
    Read a file that :func:`write_state_file` has written.

    Args:
        path: Of the file.
        check: Raises ValueError if no such device could keep that state.
        device: Which device, for messages: ``drive``.

    Raises:
        ValueError: It is no such file, or holds something that no such device can keep; says what and where.
        OSError: It cannot be read.
    """
    path = Path(path)
    try:
        text = read_text(path, "state")
        state = json.loads(text, object_pairs_hook=_object, parse_constant=_no_number)
        check(state)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{name_of(path)} is no state of a simulated {device}: {error}") from error
    assert isinstance(state, dict)
    return state


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a table of *pairs*; of two values for one name nobody knows which is meant."""
    table: dict[str, Any] = {}
    for name, value in pairs:
        if name in table:
            raise ValueError(f"{shown(name)} stands there twice")
        table[name] = value
    return table


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")
