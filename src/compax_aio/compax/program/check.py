"""Whether a program makes sense: its jumps, its ends, its variables, its prepared points, the length of its lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from ..facts.limits import MAX_PREPARED_POINTS, POSITION_DECIMALS
from ..facts.line import MAX_LINE_LENGTH
from ..facts.program_commands import RECORD_NUMBERS, RECORD_TEMPLATE
from .printing import listing, shortest_line
from .problems import Problem, Severity
from .reading import Reading, SourceRecord, read
from .records import (
    Assign,
    End,
    Gosub,
    GosubExternal,
    Goto,
    GotoExternal,
    IfCompare,
    IfError,
    IfInputs,
    IfStop,
    Jump,
    Loop,
    MoveBy,
    MoveByCam,
    MoveHome,
    MoveTo,
    PreparedOutput,
    PreparedSpeed,
    Record,
    Repeat,
    Return,
)

__all__ = ["check"]

_POSITIONING: Final = MoveTo | MoveHome | MoveBy | MoveByCam | Loop
"""LOOP counts as one (UG p. 162)."""


def check(
    program: str | Mapping[int, Record], *, decimals: int = POSITION_DECIMALS, template: str = RECORD_TEMPLATE
) -> list[Problem]:
    """
    Say what is wrong with a program, in the order of its lines; an empty list means nothing was found.

    What is looked at: all that ``parse()`` looks at; jumps and calls to records that are not there; a way that runs
    over the last record without END; REPEAT without END (each END belongs to the innermost open REPEAT before it, in
    the order of the records, else it ends the program); records that nothing leads to, from the first one on, and gaps
    that the program runs into; variables V1-V39 that are read and never written; more than 8 prepared points before a
    positioning (UG p. 101), counted along ways that only lead forward, and anew after each call; lines that have more
    than 30 characters even if abbreviated (UG p. 160).

    Args:
        program: A listing; or records by number, whose lines and columns are then those of ``listing(program)``.
        decimals: Of positions and distances: 2, or 3 where the unit is inches (UG p. 100).
        template: How the drive takes a record, with ``{n}`` and ``{text}``.

    Raises:
        InvalidCommandError: Only for what is no program at all: a record that cannot be written, or a bad *template*.
    """
    reading = read(program if isinstance(program, str) else listing(program), decimals=decimals)
    if not reading.is_whole:
        return reading.problems
    problems = [*reading.problems, *_too_long(reading, template), *_never_written(reading)]
    loop_ends, unclosed = _loops(reading)
    problems += unclosed
    problems += _missing_targets(reading)
    # With records missing that could not be read, nobody knows which way the program goes.
    if reading.sources and not reading.unread:
        flow = _Flow(reading, loop_ends)
        problems += [*flow.runs_out(), *flow.never_reached(), *flow.too_many_points()]
    return sorted(problems, key=lambda problem: (problem.line, problem.column))


def _problem(
    source: SourceRecord, message: str, hint: str, *, column: int | None = None, severity: Severity = Severity.ERROR
) -> Problem:
    where = source.column if column is None else column
    message = f"N{source.number:03d}: {message}"
    return Problem(line=source.line, column=where, severity=severity, message=message, hint=hint)


def _too_long(reading: Reading, template: str) -> Iterator[Problem]:
    for source in reading.sources.values():
        line = shortest_line(source.number, source.record, template=template)
        if len(line) > MAX_LINE_LENGTH:
            yield _problem(
                source,
                f"{len(line)} characters even if abbreviated; the drive's entry buffer takes {MAX_LINE_LENGTH} "
                "(UG p. 160)",
                "use shorter numbers, or a variable in place of one",
            )


def _never_written(reading: Reading) -> Iterator[Problem]:
    records = [source.record for source in reading.sources.values()]
    known = {record.target for record in records if isinstance(record, Assign)}
    for _, source in sorted(reading.sources.items()):
        for variable, column in source.reads:
            if variable not in known:
                known.add(variable)  # told once
                yield _problem(
                    source,
                    f"V{variable.number} is read, but no record writes it",
                    f"write it first, V{variable.number}=0, unless it is set from outside",
                    column=column,
                    severity=Severity.WARNING,
                )


def _loops(reading: Reading) -> tuple[set[int], list[Problem]]:
    """Find the ENDs that close a REPEAT, and the REPEATs that none closes."""
    open_: list[SourceRecord] = []
    ends = set()
    for number, source in sorted(reading.sources.items()):
        if isinstance(source.record, Repeat):
            open_.append(source)
        elif isinstance(source.record, End) and open_:
            open_.pop()
            ends.add(number)
    hint = "close it with END; another END ends the program (UG p. 95)"
    return ends, [_problem(source, "REPEAT without END", hint) for source in open_]


def _jump(record: Record) -> Jump | None:
    if isinstance(record, IfInputs | IfError | IfStop | IfCompare):
        return record.jump
    return record if isinstance(record, Goto | Gosub) else None


def _missing_targets(reading: Reading) -> Iterator[Problem]:
    for source in reading.sources.values():
        jump = _jump(source.record)
        if jump and jump.record in RECORD_NUMBERS and jump.record not in {*reading.sources, *reading.unread}:
            word = "GOTO" if isinstance(jump, Goto) else "GOSUB"
            yield _problem(
                source,
                f"{word} {jump.record}, but there is no N{jump.record:03d}",
                "write that record, or correct the number",
                column=source.jump_column,
            )


class _Flow:
    """Which record may come after which."""

    def __init__(self, reading: Reading, loop_ends: set[int]) -> None:
        self._sources = dict(sorted(reading.sources.items()))
        self._numbers = [*self._sources]
        self._loop_ends = loop_ends
        self._following = dict(zip(self._numbers, self._numbers[1:], strict=False))
        self._reached = self._reach()

    def runs_out(self) -> Iterator[Problem]:
        """Where the program runs over its last record, or into a gap, in which the drive may hold old records."""
        for number in self._numbers:
            source = self._sources[number]
            if number not in self._reached or not self._goes_on(number):
                continue
            following = self._following.get(number)
            if following is None:
                hint = "let END, GOTO or RETURN be the last record"
                yield _problem(source, "the program runs on behind its last record; END is missing", hint)
            elif following != number + 1:
                yield _problem(
                    source,
                    f"the program runs on into N{number + 1:03d}, which is not in this listing",
                    f"number without gaps, or GOTO {following}; the drive may still hold an old record there",
                    severity=Severity.WARNING,
                )

    def never_reached(self) -> Iterator[Problem]:
        """Say which records nothing leads to, once for each row of them."""
        row: list[int] = []
        for number in [*self._numbers, None]:
            if number is not None and number not in self._reached:
                row.append(number)
            elif row:
                names = f"N{row[0]:03d}" if len(row) == 1 else f"N{row[0]:03d} to N{row[-1]:03d}"
                yield _problem(
                    self._sources[row[0]],
                    f"nothing in the program leads to {names}",
                    f"start there, jump there, or take {'it' if len(row) == 1 else 'them'} out",
                    severity=Severity.WARNING,
                )
                row = []

    def too_many_points(self) -> Iterator[Problem]:
        """Count prepared points on the ways forward; what a called record prepares or moves is not known here."""
        points = dict.fromkeys(self._numbers, 0)
        for number in self._numbers:
            source, count = self._sources[number], points[number]
            record = source.record
            if isinstance(record, PreparedSpeed | PreparedOutput):
                count += 1
                if count == MAX_PREPARED_POINTS + 1:
                    yield _problem(
                        source,
                        f"the {count}th prepared point before a positioning; it takes at most {MAX_PREPARED_POINTS} "
                        "(UG p. 101)",
                        "take one out, or position before it",
                    )
            elif isinstance(record, _POSITIONING):
                count = 0
            jump = _jump(record)
            called = isinstance(jump, Gosub) or isinstance(record, GosubExternal)
            if self._goes_on(number) and number in self._following:
                following = self._following[number]
                points[following] = max(points[following], 0 if called else count)
            if jump and jump.record > number and jump.record in points:
                points[jump.record] = max(points[jump.record], count)

    def _reach(self) -> set[int]:
        reached: set[int] = set()
        waiting = [self._numbers[0]]
        while waiting:
            number = waiting.pop()
            if number in reached:
                continue
            reached.add(number)
            record = self._sources[number].record
            if isinstance(record, GotoExternal | GosubExternal):
                return set(self._numbers)  # inputs may choose any record
            jump = _jump(record)
            if jump and jump.record in self._sources:
                waiting.append(jump.record)
            if self._goes_on(number) and number in self._following:
                waiting.append(self._following[number])
        return reached

    def _goes_on(self, number: int) -> bool:
        """Whether the next record may come next."""
        record = self._sources[number].record
        if isinstance(record, End):
            return number in self._loop_ends
        return not isinstance(record, Goto | GotoExternal | Return)
