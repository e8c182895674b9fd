"""What is wrong with a job, said before a byte of it is sent: where, what, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ..errors import InvalidCommandError
from ..problems import MOST_OF_A_KIND, Problem, refuse_errors
from ..severity import Severity
from .facts.line import DC1, DC3, ENQ, ESCAPE, ETX, MAX_COORDINATE
from .facts.mnemonics import Mnemonic, Shape, mnemonic_of
from .language.instruction import Instruction, Language
from .language.job import Job, instructions_of
from .language.numbers import numbers
from .language.splitting import SPLITTABLE
from .language.stripping import is_output, stripped
from .language.tracking import Path, Tracker
from .profiles import PNC_1610, Profile

__all__ = ["MOST_OF_A_KIND", "Checker", "Problem", "Sheet", "check", "raise_for_errors"]


@dataclass(frozen=True, slots=True)
class Sheet:
    """
    What lies in the machine, from the origin on, in mm along x and y.

    Raises InvalidCommandError for a side that is not above 0.
    """

    x_mm: float
    y_mm: float

    def __post_init__(self) -> None:
        """Refuse what is no sheet."""
        for side in (self.x_mm, self.y_mm):
            if type(side) not in (int, float) or not 0 < side < float("inf"):
                raise InvalidCommandError(f"a sheet has two sides above 0 mm, not {self.x_mm!r} by {self.y_mm!r}")


class _Kind(Enum):
    """What is counted together."""

    CONTROL = "device control"
    OUTPUT = "instructions that answer"
    UNKNOWN = "unknown instructions"
    NOT_HERE = "instructions that this machine may not have"
    ARGUMENTS = "wrong arguments"
    RANGE = "numbers out of range"
    CUT_OUTSIDE = "cuts outside of the sheet"
    TRAVEL_OUTSIDE = "ways outside of the sheet"
    SIGNS = "characters that a line may take for signs"
    EIGHT_BITS = "characters of 8 bits"
    TOO_LONG = "instructions longer than the buffer"
    UNENDED = "instructions without their end"
    DOWN = "tool down"


_HANDSHAKE_SIGNS: Final = bytes((DC1, DC3, ENQ))
_Finding = tuple[_Kind, Severity, str, str]


class Checker:
    """
    Looks at a job instruction by instruction, so that it may be as long as it likes.

    Args:
        profile: The machine.
        sheet: What lies in it; without it, what the profile knows of the largest one.
        buffer_bytes: Of the machine, if it is known better than by the profile.

    Attributes:
        tracker: Where the tool is, as far as the job says.
    """

    def __init__(
        self, profile: Profile = PNC_1610, sheet: Sheet | None = None, *, buffer_bytes: int | None = None
    ) -> None:
        self.tracker = Tracker()
        self._profile = profile
        self._buffer_bytes = buffer_bytes or profile.buffer_bytes
        self._right, self._top, self._of = _limits(profile, sheet)
        self._outside = Severity.ERROR if sheet else Severity.WARNING
        self._rows: dict[tuple[Language, str], Mnemonic | None] = {}
        self._counts: Counter[_Kind] = Counter()
        self._lowered_by: Instruction | None = None
        self._last: Instruction | None = None

    def take(self, instruction: Instruction) -> list[Problem]:
        """Return what is wrong with the next instruction."""
        if instruction.language is Language.BLANK:
            return []
        self._last = instruction
        problems = []
        for kind, severity, what, hint in self._findings(instruction):
            self._counts[kind] += 1
            if self._counts[kind] <= MOST_OF_A_KIND:
                problems.append(_problem(instruction, severity, what, hint))
        return problems

    def finish(self) -> list[Problem]:
        """Return what is wrong at the end of the job, and how much was not told one by one."""
        if self._last is None:
            return []
        problems = []
        if self.tracker.tool_is_down:
            problems.append(
                _problem(
                    self._lowered_by or self._last,
                    Severity.WARNING,
                    "the tool is left down at the end of the job",
                    "end with PU; (mode 1: H)",
                )
            )
        for kind, count in self._counts.items():
            if count > MOST_OF_A_KIND:
                problems.append(
                    _problem(
                        self._last,
                        Severity.NOTE,
                        f"{count - MOST_OF_A_KIND} more of this kind: {kind.value}",
                        "they are not told one by one",
                    )
                )
        return problems

    # One instruction ------------------------------------------------------------------------------------------------

    def _findings(self, instruction: Instruction) -> Iterator[_Finding]:
        data = instruction.data
        if not data.isascii() or data.translate(None, _HANDSHAKE_SIGNS) != data:
            yield from _signs_within(data)
        if ESCAPE in data:
            yield (
                _Kind.CONTROL,
                Severity.WARNING,
                f"device control {_control_within(instruction)} in a job",
                "it is taken out before the job is sent: the sender alone says such things",
            )
            remains = stripped(instruction)
            if remains is None or remains.language is Language.BLANK:
                return
            instruction = remains
        row = self._row(instruction)
        if row is None:
            yield (
                _Kind.UNKNOWN,
                Severity.ERROR,
                f"{_shown(instruction)} is no instruction",
                "take it out; a number or text without its instruction is often what is left of one that was cut",
            )
            return
        yield from self._about_name(instruction, row)
        if not instruction.is_complete:
            yield _about_end(row)
        if self._buffer_bytes and len(data) > self._buffer_bytes and instruction.name not in SPLITTABLE:
            yield (
                _Kind.TOO_LONG,
                Severity.ERROR,
                f"{row.name} has {len(data)} bytes, the buffer {self._buffer_bytes}",
                "say it in several instructions",
            )
        if row.shape is Shape.NUMBERS:
            yield from self._about_numbers(instruction, row)
        else:
            self.tracker.follow(instruction)

    def _row(self, instruction: Instruction) -> Mnemonic | None:
        key = instruction.language, instruction.name
        if key not in self._rows:
            self._rows[key] = None if instruction.language is Language.UNKNOWN else mnemonic_of(instruction.name)
        return self._rows[key]

    def _about_name(self, instruction: Instruction, row: Mnemonic) -> Iterator[_Finding]:
        if is_output(instruction):
            yield (
                _Kind.OUTPUT,
                Severity.WARNING,
                f"{row.name} has the machine answer",
                "it is taken out before the job is sent: nobody would read the answer",
            )
        elif row.name not in self._profile.mnemonics:
            is_listed = self._profile.mnemonics_are_documented
            yield (
                _Kind.NOT_HERE,
                Severity.ERROR if is_listed else Severity.WARNING,
                f"{self._profile.name} is not known to have {row.name} ({row.meaning})",
                "take it out, or add it to 'mnemonics' of the profile if the machine has it",
            )

    def _about_numbers(self, instruction: Instruction, row: Mnemonic) -> Iterator[_Finding]:
        try:
            values = numbers(instruction.arguments)
        except ValueError as error:
            yield _Kind.ARGUMENTS, Severity.ERROR, f"{row.name}: {str(error)[:60]}", f"it takes {row.wanted}"
            return
        if not row.takes(len(values)):
            yield (
                _Kind.ARGUMENTS,
                Severity.ERROR,
                f"{row.name} takes {row.wanted}, not {len(values)}",
                f"it is: {row.meaning}",
            )
            return
        if values and (max(values) > MAX_COORDINATE or min(values) < -MAX_COORDINATE):
            yield (
                _Kind.RANGE,
                Severity.ERROR,
                f"{row.name}: a number beyond ±{MAX_COORDINATE}",
                "no machine takes it (PNC-900 p. 18)",
            )
            return
        if row.multiple_of == 1:
            yield from self._about_ranges(row, values)
        path = self.tracker.follow(instruction, values)
        if self.tracker.tool_is_down and path is not None and path.is_cut:
            self._lowered_by = instruction
        if path is not None and self.tracker.is_certain:
            yield from self._about_way(row, path)

    def _about_ranges(self, row: Mnemonic, values: list[float]) -> Iterator[_Finding]:
        profile = self._profile
        ranges = {
            "VS": (profile.speeds_cm_s,),
            "!PG": (profile.feeds_mm,),
            profile.force_instruction: (profile.forces,),
            profile.tool_instruction: (profile.tools,),
        }.get(row.name, row.ranges)
        for value, span in zip(values, ranges, strict=False):
            if span is not None and not span[0] <= value <= span[1]:
                yield (
                    _Kind.RANGE,
                    Severity.ERROR,
                    f"{row.name}{value:g}: {row.meaning}, is from {span[0]:g} to {span[1]:g}",
                    f"keep within it, or correct the profile of {profile.name}",
                )

    def _about_way(self, row: Mnemonic, path: Path) -> Iterator[_Finding]:
        left, right, bottom, top = path.bounds
        if left >= 0 and bottom >= 0 and right <= self._right and top <= self._top:
            return
        per_mm = self._profile.steps_per_mm
        wrong = [
            f"{axis} = {value / per_mm:.1f} mm"
            for axis, value, is_wrong in (
                ("x", left, left < 0),
                ("x", right, right > self._right),
                ("y", bottom, bottom < 0),
                ("y", top, top > self._top),
            )
            if is_wrong
        ]
        yield (
            _Kind.CUT_OUTSIDE if path.is_cut else _Kind.TRAVEL_OUTSIDE,
            self._outside if path.is_cut else Severity.WARNING,
            f"{row.name} {'cuts' if path.is_cut else 'goes'} to {', '.join(wrong)}, outside of {self._of}",
            "move or scale the job; negative coordinates are not cut (PNC-900 p. 8, 13)",
        )


def _limits(profile: Profile, sheet: Sheet | None) -> tuple[float, float, str]:
    """Return the highest x and y in steps, and of what; which side of the largest sheet is x, nobody knows."""
    if sheet is not None:
        return sheet.x_mm * profile.steps_per_mm, sheet.y_mm * profile.steps_per_mm, "the sheet"
    if profile.area_mm is not None:
        longest = max(profile.area_mm) * profile.steps_per_mm
        return longest, longest, f"what {profile.name} can cut"
    return MAX_COORDINATE, MAX_COORDINATE, "what can be cut"


def _problem(instruction: Instruction, severity: Severity, what: str, hint: str) -> Problem:
    return Problem(
        line=instruction.line,
        column=instruction.column,
        offset=instruction.place,
        severity=severity,
        what=what,
        hint=hint,
    )


def _shown(instruction: Instruction) -> str:
    text = instruction.data[instruction.begin :].decode("latin-1").strip()
    return repr(text if len(text) <= 20 else f"{text[:19]}…")


def _control_within(instruction: Instruction) -> str:
    data = instruction.data
    at = data.index(ESCAPE)
    return repr(data[at : at + 3].decode("latin-1"))


def _signs_within(data: bytes) -> Iterator[_Finding]:
    if not data.isascii():
        yield (
            _Kind.EIGHT_BITS,
            Severity.WARNING,
            "a character of 8 bits",
            "on a line of 7 bits it arrives as another one; use ASCII",
        )
    if data.translate(None, _HANDSHAKE_SIGNS) != data:
        yield (
            _Kind.SIGNS,
            Severity.ERROR,
            "DC1, DC3 or ENQ in a job",
            "the line takes them for signs of its handshake; take them out",
        )


def _about_end(row: Mnemonic) -> _Finding:
    if row.shape is Shape.LABEL:
        return (
            _Kind.UNENDED,
            Severity.ERROR,
            f"the text of {row.name} has no end",
            f"end it with the label terminator, ETX ({ETX:02X} hex) unless DT has set another",
        )
    return _Kind.UNENDED, Severity.WARNING, f"{row.name} at the end of the job is not ended", "end it with ;"


def check(
    job: Job | str | bytes | Iterable[bytes | str],
    profile: Profile = PNC_1610,
    sheet: Sheet | None = None,
    *,
    buffer_bytes: int | None = None,
) -> tuple[Problem, ...]:
    """
    Say what is wrong with a job, in its order, and at last what was only counted; nothing found: ``()``.

    What is looked at: unknown instructions, such that the machine may not have, wrong counts of arguments, what is no
    number or out of range; ways outside of the sheet, followed through relative moves and arcs; labels without an end,
    a tool that is left down, instructions longer than the buffer; device control, instructions that answer, and
    characters that a line may take for something else. Of each kind 20 are told one by one, the others are counted.

    Args:
        job: A job, text, bytes, or pieces of it of any size: then memory is that of a piece.
        profile: The machine.
        sheet: What lies in it.
        buffer_bytes: Of the machine, if it is known better than by the profile.

    Raises:
        InvalidCommandError: It cannot be taken apart: a character without a code of 8 bits, an instruction without end.
    """
    pieces = (job,) if isinstance(job, str | bytes) else job
    each = job.instructions if isinstance(job, Job) else instructions_of(pieces, profile)  # type: ignore[arg-type]
    checker = Checker(profile, sheet, buffer_bytes=buffer_bytes)
    problems = [problem for instruction in each for problem in checker.take(instruction)]
    problems += checker.finish()
    return tuple(sorted(problems, key=lambda problem: (problem.severity is Severity.NOTE, problem.offset)))


def raise_for_errors(problems: Iterable[Problem]) -> None:
    """
    Do nothing if none of *problems* is an error.

    Raises:
        InvalidCommandError: With all of the errors in its text, one a line.
    """
    refuse_errors(problems, "the job")
