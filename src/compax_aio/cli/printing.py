"""What a command prints: for people, or with ``--json`` one document for programs; errors on the other stream."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Final, TextIO

from cyclopts import Parameter
from rich.console import Console, RenderableType
from rich.text import Text

from ..errors import CompaxError
from .exit_codes import exit_code_of

__all__ = ["Printing", "as_json", "notes_console", "results_console", "tell_error", "tell_warning"]

_NOT_PRINTED: Final = re.compile(r"[\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
_NARROWEST: Final = 40
"""Columns; a terminal that is narrower breaks lines itself."""


def as_json(value: Any) -> Any:
    """Return *value* as JSON has it: dataclasses and mappings as objects, members by name, errors with all they say."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, BaseException):
        return _error_document(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name: as_json(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): as_json(each) for key, each in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, str | bytes):
        return [as_json(each) for each in value]
    is_plain = isinstance(value, bool | int | NoneType) or (isinstance(value, float) and isfinite(value))
    return value if is_plain else str(value)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Printing:
    """How results are printed."""

    json: Annotated[bool, Parameter(negative=())] = False
    """Print data as JSON, for programs."""

    def show(self, data: Any, people: RenderableType | None = None) -> None:
        """Print *data* as one line of JSON, or what *people* read in its place."""
        if self.json:
            print(_document(as_json(data), sys.stdout), flush=True)  # noqa: T201
        elif people is not None:
            results_console(soft_wrap=isinstance(people, str | Text)).print(people, markup=False)

    def note(self, text: str) -> None:
        """Tell a person what is going on, beside the results; programs are spared it."""
        if not self.json:
            notes_console().print(text, markup=False)


class _Console(Console):
    """A console that leaves it to the command what becomes of an output that nobody reads: axes may have to stop."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        raise BrokenPipeError


def notes_console() -> Console:
    """Return the console for what is no result: progress, notes and errors."""
    return _wide_enough(_Console(file=sys.stderr, highlight=False, soft_wrap=True))


def results_console(*, soft_wrap: bool = False) -> Console:
    """Return the console for results."""
    return _wide_enough(_Console(highlight=False, soft_wrap=soft_wrap))


def _wide_enough(console: Console) -> Console:
    """Do not believe a terminal that has no width: everything would be cut to nothing."""
    if (width := console.width) < _NARROWEST:
        console.width = max(width, _NARROWEST)  # which is kept, also when the terminal gets another one
    return console


def tell_error(error: BaseException, *, as_document: bool) -> None:
    """Say *error* on the error stream, as a person or a program reads it; never with a traceback."""
    if as_document:
        print(_document({"error": _error_document(error)}, sys.stderr), file=sys.stderr)  # noqa: T201
        return
    kind = "" if isinstance(error, OSError) else f"{type(error).__name__}: "
    console = notes_console()
    console.print(Text.assemble((kind, "bold red"), _told(error)))
    for note in getattr(error, "__notes__", ()):
        console.print(Text(note))
    if isinstance(error, CompaxError) and error.exchanges:
        console.print(Text("the last that went over the line:", style="dim"))
        for line in error.exchanges[-6:]:
            console.print(Text(f"  {line}", style="dim"))


def tell_warning(text: str, *, as_document: bool) -> None:
    """Say beside the results what is no error, and should be known."""
    if as_document:
        print(_document({"warning": text}, sys.stderr), file=sys.stderr)  # noqa: T201
    else:
        notes_console().print(Text.assemble(("warning: ", "yellow"), text))


def _told(error: BaseException) -> str:
    """Write an error in one line; those of the system by what they are about, without their number."""
    if isinstance(error, OSError) and error.strerror:
        about = f"{error.filename}: " if error.filename is not None else ""
        return f"{about}{error.strerror}"
    return str(error) or type(error).__name__


def _document(told: Any, stream: TextIO) -> str:
    """Write one line of JSON that *stream* can take, whatever characters it knows."""
    knows_all = (getattr(stream, "encoding", None) or "").lower().startswith("utf")
    document = json.dumps(told, ensure_ascii=not knows_all)
    # What JSON may hold and a terminal would heed (0x9b is an escape sequence), and what is no character at all.
    return _NOT_PRINTED.sub(lambda found: f"\\u{ord(found[0]):04x}", document)


def _error_document(error: BaseException) -> dict[str, Any]:
    told: dict[str, Any] = {"kind": type(error).__name__, "text": _told(error), "exit_code": exit_code_of(error)}
    if isinstance(error, CompaxError):
        for name in ("what", "device", "sent", "received", "hint", "code", "exchanges"):
            told[name] = as_json(getattr(error, name))
    for name in ("job", "transfer"):  # what is known of a job of a cutter, of a transfer of a control
        if (account := getattr(error, name, None)) is not None:
            told[name] = as_json(account)
    if isinstance(error, OSError) and error.filename is not None:
        told["file"] = str(Path(error.filename))
    told["notes"] = list(getattr(error, "__notes__", ()))
    return told
