"""What is to be sent, made ready and refused before a byte of it goes: programs, and files of numbered data."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypedDict

from ..errors import InvalidCommandError
from ..escaping import shown
from ..severity import Severity
from ..text_file import name_of, open_file
from .checking import check_bare_program, check_data_file, check_program
from .facts.characters import NEVER_IN_A_FILE
from .facts.data_files import DataKind
from .language.building import build_program_file
from .language.data_file import DataFile, parse_data_file
from .language.lines import LINE_ENDS
from .language.program_file import Program, ProgramFile, parse_program_file
from .problems import Problem, raise_for_errors
from .profiles import Profile
from .transfer import Kind

__all__ = ["DataSource", "Prepared", "ProgramSource", "prepare_data", "prepare_programs"]

ProgramSource = ProgramFile | Program | str | bytes | os.PathLike[str]
"""A program: a file or a program of one, text, bytes, or the path of a file."""
DataSource = DataFile | str | bytes | os.PathLike[str]
"""Numbered data: a file, text, bytes, or the path of a file."""

_KNOWN: Final = (
    "Parameters take effect even if the control raises an alarm on them, and wrong ones can damage the machine. Make "
    "sure that they are of this very control and as it has sent them, and pass i_know_it_takes_effect=True"
)
_MAY_BE: Final = bytes(byte for byte in range(0x80) if byte not in NEVER_IN_A_FILE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """What goes over the line."""

    kind: Kind
    data: bytes
    file: ProgramFile | DataFile
    """*data*, read."""
    warnings: tuple[str, ...] = field(default=())


class _Meant(TypedDict):
    for_dnc: bool
    protected: bool
    semicolons: bool


def prepare_programs(
    sources: Iterable[ProgramSource],
    kind: Kind,
    profile: Profile,
    *,
    protected: bool,
    semicolons: bool,
    max_bytes: int,
) -> Prepared:
    """
    Check programs, and put one pair of ``%`` around all; for a thread, for they may be large.

    Raises:
        InvalidCommandError: They have errors, or are none; all of the errors are told.
        OSError: A file cannot be read.
    """
    for_dnc = kind == "drip feed"
    problems: list[Problem] = []
    programs: list[ProgramFile | Program] = []
    for source in sources:
        given = _program_of(source, profile, max_bytes)
        meant: _Meant = {"for_dnc": for_dnc, "protected": protected, "semicolons": semicolons}
        if isinstance(given, ProgramFile) and (given.has_start or given.has_end):
            problems += check_program(given, profile, **meant)
        else:  # what it lacks is put around it here
            problems += check_bare_program(given, profile, **meant)
        programs.append(given)
    raise_for_errors(problems)
    built = build_program_file(programs, eob=profile.eob, o_digits=profile.o_digits, for_dnc=for_dnc)
    if len(programs) > 1:
        _refuse_doubles(built.programs)
    if kind == "program" and len(built.programs) > 1:
        raise InvalidCommandError(f"there are {len(built.programs)} programs in it", hint="use send_programs()")
    _refuse_signs(built.data)
    _refuse_large(len(built), max_bytes)
    return Prepared(kind=kind, data=built.data, file=built, warnings=_warnings_of(problems))


def prepare_data(
    source: DataSource,
    kind: DataKind,
    profile: Profile,
    *,
    force: bool,
    i_know_it_takes_effect: bool,
    max_bytes: int,
) -> Prepared:
    """
    Check a file of numbered data; it is sent as it is, from its first ``%`` to its last.

    Raises:
        InvalidCommandError: It has errors, or may not be sent.
        OSError: It cannot be read.
    """
    if kind is DataKind.PARAMETERS and i_know_it_takes_effect is not True:
        raise InvalidCommandError("parameters are not sent unless it is said that this is meant", hint=_KNOWN)
    if isinstance(source, DataFile):
        if source.kind is not kind:
            raise InvalidCommandError(f"that is a file of {source.kind}, and no file of {kind}")
        file = source
    else:
        data = _bytes_of(source, max_bytes)
        raise_for_errors(check_data_file(data, kind, force=force))
        file = parse_data_file(data, kind, eob=profile.eob)
    problems = check_data_file(file, force=force)
    raise_for_errors(problems)
    payload = file.payload
    _refuse_signs(payload)
    _refuse_large(len(payload), max_bytes)
    if payload[-1:] not in LINE_ENDS:  # never empty: it ends with %
        payload += profile.eob_bytes
    return Prepared(kind=_KINDS[kind], data=payload, file=file, warnings=_warnings_of(problems))


_KINDS: Final[dict[DataKind, Kind]] = {
    DataKind.PARAMETERS: "parameters",
    DataKind.SETTINGS: "settings",
    DataKind.OFFSETS: "offsets",
    DataKind.MACROS: "macros",
}


def _program_of(source: ProgramSource, profile: Profile, max_bytes: int) -> ProgramFile | Program:
    if isinstance(source, ProgramFile | Program):
        return source
    return parse_program_file(_bytes_of(source, max_bytes), eob=profile.eob)


def _bytes_of(source: str | bytes | os.PathLike[str], max_bytes: int) -> bytes:
    if isinstance(source, bytes | bytearray | memoryview):
        data = bytes(source)
    elif isinstance(source, str):
        if not source.isascii():
            bad = next(each for each in source if not each.isascii())
            raise InvalidCommandError(
                f"{shown(bad)} is no 7-bit ASCII, and a control knows nothing else",
                hint="write it with other characters; of a file, give pathlib.Path(name)",
            )
        data = source.encode("ascii")
    elif isinstance(source, os.PathLike):
        path = Path(source)
        with open_file(path) as file:
            data = file.read(max_bytes + 1)
        if len(data) > max_bytes:
            raise InvalidCommandError(
                f"{name_of(path)} has more than {max_bytes} bytes",
                hint="ControlSettings.max_bytes says how many may be",
            )
    else:
        raise InvalidCommandError(f"what is sent is a file, text, bytes or a path, not {shown(source)}")
    _refuse_large(len(data), max_bytes)
    return data


def _refuse_large(size: int, max_bytes: int) -> None:
    if size > max_bytes:
        raise InvalidCommandError(
            f"it has {size} bytes, and no more than {max_bytes} are sent",
            hint="ControlSettings.max_bytes says how many may be",
        )


def _refuse_doubles(programs: Iterable[Program]) -> None:
    seen: set[int] = set()
    for number in (each.number for each in programs if each.number is not None):
        if number in seen:
            raise InvalidCommandError(
                f"program {number} is given twice", hint="the control would keep one of them; say which"
            )
        seen.add(number)


def _refuse_signs(data: bytes) -> None:
    if found := data.translate(None, _MAY_BE):
        said = ", ".join(f"{each:02X}" for each in sorted(set(found))[:10])
        raise InvalidCommandError(
            f"it has bytes that mean something else on the line, or cannot go over it: {said} (hexadecimal)",
            hint="take them out; a file that came so is damaged",
        )


def _warnings_of(problems: Iterable[Problem]) -> tuple[str, ...]:
    return tuple(str(each) for each in problems if each.severity is not Severity.ERROR)
