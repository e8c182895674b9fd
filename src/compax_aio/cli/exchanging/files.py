"""Files of controls as commands read them: whole, before a line is opened, and told apart by what is in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from cyclopts import Parameter

from compax_aio import InvalidCommandError
from compax_aio.haas.facts.data_files import CHECKSUM_NUMBER, LAST_NUMBER, DataKind
from compax_aio.haas.language.data_file import DataLine, lines_of_data
from compax_aio.haas.language.lines import Lines
from compax_aio.haas.language.program_file import parse_program_file

from ...text_file import name_of, open_file
from ..files import reading

__all__ = ["ControlFile", "FileKind", "KindOption", "NamedFile", "read_file"]

FileKind = Literal["program", "parameters", "settings", "offsets", "macros"]

ControlFile = Annotated[Path, Parameter(name="FILE", help="File of programs, or of numbered data.")]
KindOption = Annotated[
    FileKind | None,
    Parameter(
        name="--kind",
        help="What the files are. Programs and macro variables are recognised; parameters, settings and offsets look "
        "alike, and are known by a name that begins so, as `receive` gives it.",
    ),
]

_MOST_BYTES: Final = 64 * 1024 * 1024
_DATA_KINDS: Final = frozenset(each.value for each in DataKind)


@dataclass(frozen=True)
class NamedFile:
    """
    A file, and what it is.

    Attributes:
        name: As it was given.
        data: All of it.
        kind: None: numbered data, of which nothing says what they are.
        programs: Their numbers; none of numbered data.
    """

    name: str
    data: bytes
    kind: FileKind | None
    programs: tuple[int, ...] = ()

    @property
    def data_kind(self) -> DataKind | None:
        """Of numbered data, if that is known."""
        return None if self.kind in {None, "program"} else DataKind(str(self.kind))

    def expect_kind(self) -> FileKind:
        """
        Return what it is.

        Raises:
            InvalidCommandError: Nobody knows.
        """
        if self.kind is None:
            raise InvalidCommandError(
                f"{self.name} has numbered data, and nothing says what the numbers are: parameters, settings and "
                "offsets look alike",
                hint="say --kind settings, or what they are",
            )
        return self.kind


def read_file(path: Path, kind: FileKind | None = None) -> NamedFile:
    """
    Read a file, and find out what it is, if *kind* does not say it.

    Raises:
        InvalidCommandError: It cannot be read, or is too large.
    """
    with reading(path), open_file(path) as file:
        data = file.read(_MOST_BYTES + 1)
    name = name_of(path)
    if len(data) > _MOST_BYTES:
        raise InvalidCommandError(f"{name} is larger than any file of a control: more than {_MOST_BYTES} bytes")
    return _named(name, data, kind or _kind_of(path, data))


def _named(name: str, data: bytes, kind: FileKind | None) -> NamedFile:
    programs = parse_program_file(data).numbers if kind == "program" else ()
    return NamedFile(name, data, kind, programs)


def _kind_of(path: Path, data: bytes) -> FileKind | None:
    read = list(lines_of_data(Lines(data)))
    numbers = [each.number for each in read if isinstance(each, DataLine)]
    if len(numbers) * 2 <= len(read) or not numbers:  # a damaged line makes no program of numbered data
        return "program"
    if LAST_NUMBER in numbers and CHECKSUM_NUMBER not in numbers:
        return "macros"
    return _kind_by_name(path)


def _kind_by_name(path: Path) -> FileKind | None:
    words: Sequence[str] = path.name.lower().replace("-", " ").replace("_", " ").replace(".", " ").split()
    if words and words[0] in _DATA_KINDS:
        return words[0]  # type: ignore[return-value]  # one of these
    return None
