"""A drive's program memory: records read and written, listings uploaded, saved, downloaded and taken back."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import Final

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    InvalidCommandError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from ..escaping import escaped, shown
from ..text_file import replace_file
from .codecs import value_text
from .facts.program_commands import RECORD_NUMBERS, RECORD_TEMPLATE
from .half_done import HalfDone, RollBack
from .listing_source import ListingSource, load_listing
from .numbered_values import Progress
from .plain_line import as_index
from .program import check, listing, parse, parse_record, raise_for_errors, record_text, wire_line
from .program.problems import Problem, Severity
from .program.records import End, MoveTo, Program, Record
from .program.shown import Shown, compare, read_shown, superfluous_ends
from .program_run import ProgramRun, check_record_number

__all__ = ["Downloaded", "ProgramMemory", "Uploaded", "WrittenRecord"]


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenRecord:
    """One record that was written, and what the drive shows of it."""

    number: int
    text: str
    """Behind its number, as the drive sent it."""
    is_verified: bool
    """False: what the drive shows is right as far as it goes, but may be cut at 30 characters (IBS p. 54)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uploaded:
    """What the drive shows of its program memory."""

    program: Program
    """END records at the end that nothing needs are left out: a memory that was never written is one END."""
    unreadable: Mapping[int, str]
    """By number, as the drive sent it: no record, or one that may be cut at 30 characters (IBS p. 54)."""

    def listing(self) -> str:
        """Print it in the manual's style (UG p. 95); what could not be read stands in comments."""
        lines = {number: listing({number: record}) for number, record in self.program.items()}
        for number, text in self.unreadable.items():
            line = RECORD_TEMPLATE.format(n=number, text=escaped(text))
            lines[number] = f"; {line}  ; cannot be read, or may be cut at 30 characters (IBS p. 54)\n"
        return "".join(lines[number] for number in sorted(lines))


@dataclass(frozen=True, slots=True, kw_only=True)
class Downloaded:
    """What a download has done, or would do."""

    changed: Mapping[int, tuple[str, str]]
    """By number: what the drive showed, and what it was given (or would be, after a dry run)."""
    unchanged: int
    verified: tuple[int, ...]
    """Those of *changed* that read back as they were written."""
    not_verifiable: tuple[int, ...]
    """Those that read back right as far as the drive shows them; see :attr:`WrittenRecord.is_verified`."""
    warnings: tuple[Problem, ...]
    """What :func:`~compax_aio.compax.program.check` thinks of the listing; errors are raised."""
    was_dry_run: bool


_KIND: Final = "program"


class ProgramMemory(ProgramRun):
    """
    N001 to N250 of a drive, one instruction each (UG p. 95), and the program that they are.

    The form in which RS-232 writes a record is inferred (``Dialect.record``), so each one is read back. What a drive
    does with a record that comes while it runs a program or moves is not documented: it is refused here.
    """

    incomplete: RestoreIncompleteError | None = None
    """What the last download has left half done, for :meth:`roll_back`, also when its caller was cancelled."""

    # One ------------------------------------------------------------------------------------------------------------

    async def read(self, number: int) -> str:
        """
        Read a record as the drive sends it, without its number: ``POSA 250``.

        An answer has at most 30 characters (UG p. 160), so longer combined commands are not shown whole (IBS p. 54).

        Args:
            number: 1-250.

        Raises:
            InvalidCommandError: There is no such record; nothing was sent.
            CommandRejectedError: The drive does not give it.
        """
        return value_text(await self._line.query(f"N{check_record_number(number)}"))

    async def read_record(self, number: int) -> Record:
        """
        Read a record and take it apart; see :meth:`read`.

        Raises:
            UnexpectedAnswerError: It cannot be read, or may be cut: ``ACCEL 25`` may be ``ACCEL 250``.
        """
        text = await self._shown(number)
        record = read_shown(text, decimals=self._decimals)
        if record is None:
            raise UnexpectedAnswerError(
                f"{_name(number)} cannot be read, or may be cut at 30 characters (IBS p. 54)",
                device=self._line.name,
                sent=f"N{number}",
                received=text.strip(),
                hint="read() gives its text; write it anew to be sure of it",
                exchanges=self._line.link.recent(),
            )
        return record

    async def write(self, number: int, record: str | Record) -> WrittenRecord:
        """
        Write one record, read it back and compare; it is sent once, abbreviated if it is too long otherwise.

        Args:
            number: 1-250.
            record: Its text without number, ``"POSA 250"``, or a record of :mod:`compax_aio.compax.program`. Whether
                it makes sense among the others is not looked at.

        Raises:
            InvalidCommandError: It is no record, cannot be held by the drive, or has more than 30 characters
                (UG p. 160); nothing was sent.
            MoveActiveError: A program runs or the axis moves; it was not sent.
            CommandRejectedError: The drive refused it.
            UnexpectedAnswerError: The drive took it, and shows something else.
            AnswerTimeoutError: Whether the drive took it is unknown; the hint says what the record shows.
        """
        number = check_record_number(number)
        checked = self._checked_record(number, record)
        await self._refuse_while_busy(_name(number))
        return await self._write(number, checked)

    async def teach(self, number: int) -> float:
        """
        Write the actual position into a record, as ``POSA`` (a function of the drive, CAN p. 69), and return it.

        The RS-232 word for it is unknown, so S1 is read and the record written; in :attr:`Drive.unit`, rounded to the
        decimals of the settings.

        Raises:
            MoveActiveError: A program runs or the axis moves; it was not written.
        """
        await self._refuse_while_busy(_name(check_record_number(number)))
        position = Decimal(f"{await self._line.position():.{self._decimals}f}")
        await self.write(number, MoveTo(position))
        return float(position)

    # All ------------------------------------------------------------------------------------------------------------

    async def upload(self, *, first: int = 1, last: int = 250, on_progress: Progress | None = None) -> Uploaded:
        """
        Read the records from *first* to *last*.

        Raises:
            InvalidCommandError: There are no such records; nothing was sent.
        """
        numbers = range(check_record_number(first), check_record_number(last) + 1)
        if not numbers:
            raise InvalidCommandError(f"from {first} to {last} there is no record")
        texts: dict[int, str] = {}
        for done, number in enumerate(numbers, start=1):
            try:
                texts[number] = await self._shown(number)
            except CommandRejectedError as error:
                texts[number] = error.received or ""
            if on_progress is not None:
                on_progress(done, len(numbers))
        memory = {number: read_shown(text, decimals=self._decimals) for number, text in texts.items()}
        unused = superfluous_ends(memory)
        return Uploaded(
            program=Program({n: record for n, record in memory.items() if record is not None and n not in unused}),
            unreadable={number: texts[number].strip() for number, record in memory.items() if record is None},
        )

    async def save(self, path: str | Path, *, on_progress: Progress | None = None) -> Uploaded:
        """
        Upload all records and write them to *path* as a listing; the file is replaced whole, or left as it was.

        Raises:
            OSError: The file cannot be written.
        """
        uploaded = await self.upload(on_progress=on_progress)
        name = escaped(self._line.name)
        at = datetime.now(UTC).isoformat(timespec="seconds")
        text = f"; Program of {name}, a COMPAX drive, as it showed it; saved at {at}\n{uploaded.listing()}"
        await asyncio.get_running_loop().run_in_executor(None, replace_file, Path(path), text)
        return uploaded

    async def download(
        self,
        source: ListingSource,
        *,
        clear_rest: bool = False,
        dry_run: bool = False,
        on_progress: Progress | None = None,
        on_compared: Progress | None = None,
    ) -> Downloaded:
        """
        Check a program, compare it with what is there, and write what differs, each record read back.

        Records that it does not name are left as they are. The first that fails ends it. If its caller is cancelled, a
        note on the CancelledError and a warning in the log say how far it got, and :attr:`incomplete` has it for
        :meth:`roll_back`.

        Args:
            source: A file or its name; a listing, which has a line break or begins with a record number; its lines; or
                records by number.
            clear_rest: Write END into all records that it does not name.
            dry_run: Only say what would be written.
            on_progress: Called after each record that was written.
            on_compared: Called after each record that was read before, to be compared.

        Raises:
            InvalidCommandError: The listing has errors, all of them in its text; nothing was sent.
            MoveActiveError: A program runs or the axis moves; nothing was written.
            CommandRejectedError: The drive does not show a record; nothing was written.
            RestoreIncompleteError: A record was refused, was not read back as written, or its fate is unknown; says
                which were applied, which not, and which is uncertain. :meth:`roll_back` takes them back.
            OSError: The file cannot be read.
        """
        loaded = await load_listing(source)
        # In a thread: a listing of 250 records takes a while, and other drives have moves to watch.
        program, warnings = await asyncio.get_running_loop().run_in_executor(None, self._checked_program, loaded)
        if not (program or clear_rest):
            raise InvalidCommandError("there is no record in the listing", hint="begin each line like N001:")
        wanted = {**(dict.fromkeys(RECORD_NUMBERS, End()) if clear_rest else {}), **program}
        if not dry_run:
            await self._refuse_while_busy("the program")
        changes = await self._changes(wanted, on_compared)
        written: list[WrittenRecord] = []
        if not dry_run:
            await self._write_all(changes, wanted, written, on_progress)
        return Downloaded(
            changed=changes,
            unchanged=len(wanted) - len(changes),
            verified=tuple(each.number for each in written if each.is_verified),
            not_verifiable=tuple(each.number for each in written if not each.is_verified),
            warnings=warnings,
            was_dry_run=dry_run,
        )

    async def roll_back(self, error: RestoreIncompleteError) -> None:
        """
        Write the records that the drive had before a download that was not completed, the uncertain one first.

        The first that fails raises, as :meth:`write` does, with a note on how far it got; it can be repeated.

        Raises:
            InvalidCommandError: What the drive had shown of some cannot be read, or may be cut; the others are back.
                Or *error* is no program's, or that of another drive; nothing was written.
        """
        lost: list[str] = []
        with RollBack(error, _KIND, self._line.name, _name) as back:
            for number, old in back.old.items():
                record = read_shown(old, decimals=self._decimals)
                if record is None:
                    lost.append(f"{_name(number)} ({old!r})")
                else:
                    await self.write(number, record)
                    back.done.append(number)
        if error is self.incomplete:
            self.incomplete = None
        if lost:
            raise InvalidCommandError(
                f"not rolled back, for what the drive had shown cannot be read or may be cut: {', '.join(lost)}",
                device=self._line.name,
                hint="write them by hand",
            )

    # Small things ---------------------------------------------------------------------------------------------------

    @property
    def _decimals(self) -> int:
        return self._line.settings.decimals

    @property
    def _template(self) -> str:
        return self._line.settings.dialect.record

    async def _shown(self, number: int) -> str:
        """Read a record, with blanks before it if the drive sent some: they count where an answer may be cut."""
        answer = await self._line.query(f"N{check_record_number(number)}")
        return value_text(answer).rjust(len(answer) - len(RECORD_TEMPLATE.format(n=number, text="")))

    def _checked_record(self, number: int, record: str | Record) -> Record:
        text = str.__str__(record) if isinstance(record, str) else record_text(record)
        checked = parse_record(text, decimals=self._decimals)
        if not isinstance(record, str) and checked != record:
            raise InvalidCommandError(f"{shown(record)} cannot be said to the drive: {shown(text)} means {checked!r}")
        wire_line(number, checked, template=self._template)
        return checked

    def _checked_program(self, source: str | Mapping[int, Record]) -> tuple[Program, tuple[Problem, ...]]:
        if not isinstance(source, str):
            source = _by_plain_numbers(source)
        text = source if isinstance(source, str) else listing(source)
        problems = check(text, decimals=self._decimals, template=self._template)
        raise_for_errors(problems)
        program = parse(text, decimals=self._decimals)
        for number, record in program.items():
            # A Goto(302) would be written as what removes the password.
            self._checked_record(number, record if isinstance(source, str) else source[number])
        return program, tuple(each for each in problems if each.severity is not Severity.ERROR)

    async def _changes(self, wanted: Mapping[int, Record], on_compared: Progress | None) -> dict[int, tuple[str, str]]:
        changes = {}
        for done, (number, record) in enumerate(sorted(wanted.items()), start=1):
            old = await self._shown(number)
            if compare(old, record, decimals=self._decimals) is not Shown.SAME:
                changes[number] = (old, record_text(record))
            if on_compared is not None:
                on_compared(done, len(wanted))
        return changes

    async def _write(self, number: int, record: Record, on_sent: Callable[[], None] | None = None) -> WrittenRecord:
        line = wire_line(number, record, template=self._template)
        try:
            await self._line.command(line, on_sent=on_sent)
        except AnswerTimeoutError as error:
            error.hint = "whether the drive took it is unknown; read the record"
            with suppress(CompaxError):
                text = await self._shown(number)
                if compare(text, record, decimals=self._decimals) is Shown.SAME:
                    return WrittenRecord(number=number, text=text.strip(), is_verified=True)
                error.hint = f"the record shows {text.strip()!r} now"
            raise
        text = await self._shown(number)
        shown = compare(text, record, decimals=self._decimals)
        if shown is Shown.OTHER:
            raise UnexpectedAnswerError(
                f"{_name(number)} was written as {record_text(record)!r} and reads back as {text.strip()!r}",
                device=self._line.name,
                sent=line,
                hint="the drive words it otherwise, refuses it in silence (P20), or takes records in another form "
                "(Dialect.record)",
                exchanges=self._line.link.recent(),
            )
        return WrittenRecord(number=number, text=text.strip(), is_verified=shown is Shown.SAME)

    async def _write_all(
        self,
        changes: Mapping[int, tuple[str, str]],
        wanted: Mapping[int, Record],
        written: list[WrittenRecord],
        on_progress: Progress | None,
    ) -> None:
        self.incomplete = None
        account, number = HalfDone(changes, _name), 0
        try:
            for number in changes:
                account.begin(number)
                await self._refuse_while_busy(_name(number))
                written.append(await self._write(number, wanted[number], account.note_sent))
                account.note_applied()
                if on_progress is not None:
                    on_progress(len(written), len(changes))
        except BaseException as error:
            account.note_failure(error, f"N{number}")
            self.incomplete = self._incomplete(error, number, account)
            if isinstance(error, CompaxError):
                raise self.incomplete from error
            account.tell_with(error, self.incomplete)
            raise

    def _incomplete(self, error: BaseException, number: int, account: HalfDone) -> RestoreIncompleteError:
        told = error if isinstance(error, CompaxError) else None
        what = "the download did not come to its end"
        if number not in account.applied:
            taken = "written, but not surely taken" if account.uncertain else "not taken"
            what = f"{_name(number)}: {account.changes[number][1]} was {taken}"
        return account.report(
            f"{what}: {told.what if told else f'it was ended by {type(error).__name__}'}",
            kind=_KIND,
            device=self._line.name,
            sent=told.sent if told else None,
            received=told.received if told else None,
            hint="do not start a program of which only a part is there: mend the cause and download it again, or "
            "roll_back() what was written",
            exchanges=told.exchanges if told else self._line.link.recent(),
        )


def _by_plain_numbers(records: Mapping[int, Record]) -> dict[int, Record]:
    """Return *records* by numbers that write themselves as numbers; that they exist is looked at with all the rest."""
    plain = {as_index(number): record for number, record in records.items()}
    if None in plain or len(plain) < len(records):
        raise InvalidCommandError(f"records have whole numbers, each once, not {shown([*records])}")
    return {number: record for number, record in plain.items() if number is not None}


def _name(number: int) -> str:
    return f"N{number:03d}"
