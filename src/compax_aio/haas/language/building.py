"""Make the file that is sent: one ``%`` pair around all programs, ends of blocks and names as the control has them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

from ...errors import InvalidCommandError
from ...escaping import shown
from ..facts.alarms import ALARMS
from ..facts.eob import EobPattern
from ..facts.programs import NAME_DIGITS
from .lines import LINE_ENDS
from .program_file import Program, ProgramFile, parse_program_file

__all__ = ["Programs", "build_program_file"]

Programs = Program | ProgramFile | str | bytes
"""Something that holds programs."""

_NUMBER: Final = re.compile(rb"[Oo][ \t]*[0-9]+")


def build_program_file(
    programs: Programs | Iterable[Programs],
    *,
    eob: EobPattern | str = EobPattern.CR_LF,
    o_digits: int = NAME_DIGITS,
    for_dnc: bool = False,
) -> ProgramFile:
    """
    Put programs into one file as it is sent (sheet, sections 4 and 11).

    An end of block, ``%``, all programs, ``%``, each in its line. Lead-ins, tails and further ``%`` lines of what is
    given are left out, for the last ``%`` would be ambiguous; blocks stay as they are, but for their ends and the
    digits of names. Whether they are right is not asked: that is ``check_program()``.

    Args:
        programs: A program, a file, text, or several of them.
        eob: How blocks end (Setting 25).
        o_digits: How many a name is written with: 5, or 4 on controls of the 1990s.
        for_dnc: What is fed by DNC is not stored and may have no name.

    Raises:
        InvalidCommandError: There is no program, or one has no name or one that is not possible.
    """
    end = EobPattern(eob).data
    sources = (programs,) if isinstance(programs, Program | ProgramFile | str | bytes) else programs
    every = [each for source in sources for each in _programs_of(source)]
    if not every:
        raise InvalidCommandError(
            "there is no program", hint=f"the control would raise {ALARMS['empty-program']}; give one"
        )
    parts = [b"", b"%"]
    for program in every:
        parts += _blocks_of(program, o_digits, for_dnc=for_dnc)
    return parse_program_file(end.join([*parts, b"%", b""]), eob=eob)


def _programs_of(source: Programs) -> tuple[Program, ...]:
    if isinstance(source, Program):
        return (source,)
    return (source if isinstance(source, ProgramFile) else parse_program_file(source)).programs


def _blocks_of(program: Program, o_digits: int, *, for_dnc: bool) -> Iterator[bytes]:
    lines = [block.raw.rstrip(LINE_ENDS) for block in program.blocks]
    if program.name is not None or not for_dnc:
        lines[0] = _named(program, lines[0], o_digits)
    return iter(lines)


def _named(program: Program, line: bytes, o_digits: int) -> bytes:
    if program.name is None:
        raise InvalidCommandError(
            f"line {program.line}: a program without a name",
            hint=f"the control would raise {ALARMS['no-program-name']}; begin it with O and its number",
        )
    number = program.number
    if number is None or number >= 10**o_digits:
        raise InvalidCommandError(
            f"line {program.line}: {shown(program.name.text)} is no name of {o_digits} digits",
            hint=f"the control would raise {ALARMS['illegal-program-name']}; choose another number",
        )
    return _NUMBER.sub(b"O%0*d" % (o_digits, number), line, count=1)
