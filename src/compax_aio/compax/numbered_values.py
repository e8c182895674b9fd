"""Numbered values of a drive: read, written and read back, saved, compared and restored, nothing half in silence."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from ..checked_numbers import check_number
from ..errors import (
    CommandRejectedError,
    CompaxError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from .codecs import decode_number
from .half_done import HalfDone, RollBack
from .line import DriveLine
from .value_file import read_file, write_file
from .value_tables import ValueTable

__all__ = ["Difference", "NumberedValues", "Progress", "Restored"]

Progress = Callable[[int, int], None]
"""Called with how many values are done, and how many there are."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A value that is not the same in the file and in the drive."""

    name: str
    number: int
    in_file: float
    in_drive: float | None
    """None where the drive does not give it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Restored:
    """What a restore has done, or would do."""

    changed: Mapping[int, tuple[float, float]]
    """By number: what the drive had, and what it has now (or would have, after a dry run)."""
    unchanged: int
    was_dry_run: bool
    pending: tuple[int, ...] = ()
    """Those of *changed* that are not in force before :meth:`Parameters.make_valid`."""


class NumberedValues:
    """
    Numbers of a drive that are read and written one by one.

    Args:
        line: The drive's line.
        table: Which values there are.
    """

    def __init__(self, line: DriveLine, table: ValueTable) -> None:
        self._line = line
        self._table = table
        self.incomplete: RestoreIncompleteError | None = None
        """
        What the last restore has left half done, for :meth:`roll_back`, also when its caller was cancelled; else None.
        """

    # One ------------------------------------------------------------------------------------------------------------

    async def read(self, number: int) -> float:
        """
        Read one value.

        Raises:
            InvalidCommandError: There is no such number; nothing was sent.
            CommandRejectedError: The drive does not give it.
        """
        return await self._line.read(self._name(number), decode_number)

    async def write(self, number: int, value: float) -> float:
        """
        Write one value, read it back, and return it; it is sent once, whatever happens.

        Raises:
            InvalidCommandError: The number or value cannot be said to the drive; nothing was sent.
            CommandRejectedError: The drive refused it; parameters want :meth:`Parameters.unlock` first.
            UnexpectedAnswerError: The drive took it, and reads back something else.
            AnswerTimeoutError: Whether the drive took it is unknown; read it.
        """
        return await self._write(number, value)

    async def _write(self, number: int, value: float, on_sent: Callable[[], None] | None = None) -> float:
        number = self._table.index(number)
        value = check_number(self._name(number), value)
        text = self._written(number, value)

        def sent() -> None:
            self._note_sent(number)
            if on_sent is not None:
                on_sent()

        try:
            await self._line.command(text, on_sent=sent)
        except CommandRejectedError as error:
            self._note_refused(number)
            if number not in self._table.live:
                error.hint = f"write it inside parameters.unlocked() if it is protected; else {error.hint}"
            raise
        read_back = await self.read(number)
        if read_back != self._table.rounded(number, value):
            raise UnexpectedAnswerError(
                f"{self._name(number)} was written as {value:g} and reads back as {read_back:g}",
                device=self._line.name,
                sent=text,
                hint="the drive rounds or limits it, or gives the old value until VP",
                exchanges=self._line.link.recent(),
            )
        return read_back

    # All ------------------------------------------------------------------------------------------------------------

    async def read_all(self, *, on_progress: Progress | None = None) -> dict[int, float]:
        """Read every value that the drive gives; those that it refuses to give are left out."""
        values = {}
        numbers = self._table.decimals
        for done, number in enumerate(numbers, start=1):
            with suppress(CommandRejectedError):
                values[number] = await self.read(number)
            if on_progress is not None:
                on_progress(done, len(numbers))
        return values

    async def save(self, path: str | Path, *, on_progress: Progress | None = None) -> dict[int, float]:
        """
        Read all values and write them to *path* as TOML; the file is replaced whole, or left as it was.

        Raises:
            OSError: The file cannot be written.
        """
        values = await self.read_all(on_progress=on_progress)
        work = partial(
            write_file,
            Path(path),
            kind=self._table.kind,
            letter=self._table.letter,
            drive=self._line.name,
            saved_at=datetime.now(UTC),
            values=values,
            decimals=self._table.decimals,
            comments={number: comment for number in values if (comment := self._comment(number))},
        )
        await asyncio.get_running_loop().run_in_executor(None, work)
        return values

    async def diff(self, path: str | Path, *, on_progress: Progress | None = None) -> tuple[Difference, ...]:
        """
        Compare a saved file with the drive; only what differs, in the order of numbers.

        Args:
            path: A file of :meth:`save`.
            on_progress: Called after each value that was read.

        Raises:
            InvalidCommandError: It is no such file, or holds what cannot be said to the drive.
            OSError: It cannot be read.
        """
        return await self._compare(await self._load(path), on_progress)

    async def _compare(
        self, values: Mapping[int, float], on_progress: Progress | None = None
    ) -> tuple[Difference, ...]:
        differences = []
        for done, (number, value) in enumerate(values.items(), start=1):
            try:
                in_drive: float | None = await self.read(number)
            except CommandRejectedError:
                in_drive = None
            if in_drive != value:
                differences.append(Difference(self._name(number), number, value, in_drive))
            if on_progress is not None:
                on_progress(done, len(values))
        return tuple(differences)

    async def restore(
        self, path: str | Path, *, dry_run: bool = False, on_progress: Progress | None = None
    ) -> Restored:
        """
        Write what differs from a saved file, each value read back; the first that fails ends it.

        If its caller is cancelled, a note on the CancelledError and a warning in the log say how far it got, and
        :attr:`incomplete` has it for :meth:`roll_back`.

        Args:
            path: A file of :meth:`save`.
            dry_run: Only say what would be written.
            on_progress: Called after each value that was written.

        Raises:
            InvalidCommandError: The file holds something that cannot be said to the drive; nothing was written.
            RestoreIncompleteError: A value was refused, was not read back as written, or its fate is unknown; says
                which were applied, which not, and which is uncertain. :meth:`roll_back` takes them back.
        """
        return await self.write_several(await self._load(path), dry_run=dry_run, on_progress=on_progress)

    async def write_several(
        self,
        values: Mapping[int, float],
        *,
        dry_run: bool = False,
        on_progress: Progress | None = None,
        on_compared: Progress | None = None,
    ) -> Restored:
        """
        Write those of *values* that the drive does not have yet, as :meth:`restore` does, with what it raises.

        Args:
            values: By number.
            dry_run: Only say what would be written.
            on_progress: Called after each value that was written.
            on_compared: Called after each value that was read before, to be compared.
        """
        values = {self._table.index(number): value for number, value in values.items()}
        for number, value in values.items():
            self._written(number, value)
        wanted = {number: self._table.rounded(number, values[number]) for number in sorted(values)}
        changes = self._changes(await self._compare(wanted, on_compared))
        if not dry_run:
            await self._write_all(changes, on_progress)
        return Restored(
            changed=changes,
            unchanged=len(wanted) - len(changes),
            was_dry_run=dry_run,
            pending=self._waiting(changes),
        )

    async def _write_all(self, changes: Mapping[int, tuple[float, float]], on_progress: Progress | None) -> None:
        self.incomplete = None
        account, number = HalfDone(changes, self._name), 0
        try:
            for number, (_, new) in changes.items():
                account.begin(number)
                await self._write(number, new, account.note_sent)
                account.note_applied()
                if on_progress is not None:
                    on_progress(len(account.applied), len(changes))
        except BaseException as error:
            account.note_failure(error, self._name(number))
            self.incomplete = self._incomplete(error, number, account)
            if isinstance(error, CompaxError):
                raise self.incomplete from error
            account.tell_with(error, self.incomplete)
            raise

    async def roll_back(self, error: RestoreIncompleteError) -> None:
        """
        Write the values that the drive had before a restore that was not completed, the uncertain ones first.

        The first that fails raises, as in :meth:`write`, and ends it, with a note on how far it got; it can be
        repeated.

        Raises:
            InvalidCommandError: *error* is that of another drive, or not of these values; nothing was written.
        """
        with RollBack(error, self._table.kind, self._line.name, self._name) as back:
            for number, old in back.old.items():
                await self.write(number, old)
                back.done.append(number)
        if error is self.incomplete:
            self.incomplete = None

    def _changes(self, differences: Iterable[Difference]) -> dict[int, tuple[float, float]]:
        changes = {each.number: (each.in_drive, each.in_file) for each in differences}
        known = {number: (old, new) for number, (old, new) in changes.items() if old is not None}
        if missing := [self._name(number) for number in changes if number not in known]:
            raise RestoreIncompleteError(
                f"nothing was written: the drive does not give {', '.join(missing)}",
                device=self._line.name,
                hint="is the file that of another drive? take them out of it, or write them one by one",
                not_applied=tuple(changes),
                kind=self._table.kind,
            )
        return known

    def _incomplete(self, error: BaseException, number: int, account: HalfDone) -> RestoreIncompleteError:
        told = error if isinstance(error, CompaxError) else None
        why = told.what if told else f"it was ended by {type(error).__name__}"
        if number in account.applied:
            what = f"the restore did not come to its end: {why}"
        else:
            text = self._written(number, account.changes[number][1])
            what = f"it is uncertain whether {text} was restored" if account.uncertain else f"{text} was not restored"
            what += f": {why}"
        waiting = self._waiting((*account.applied, *account.uncertain))
        return account.report(
            what,
            kind=self._table.kind,
            device=self._line.name,
            sent=told.sent if told else None,
            received=told.received if told else None,
            hint="mend the cause and restore again, or roll_back() what was written"
            + (f"; not in force before VP: {', '.join(map(self._name, waiting))}" if waiting else ""),
            exchanges=told.exchanges if told else self._line.link.recent(),
        )

    def _note_sent(self, number: int) -> None:
        """Take note that *number* is on the wire."""

    def _note_refused(self, number: int) -> None:
        """Take note that the drive has refused what was sent of *number*."""

    def _waiting(self, numbers: Iterable[int]) -> tuple[int, ...]:
        return tuple(number for number in numbers if number not in self._table.live)

    # Small things ---------------------------------------------------------------------------------------------------

    async def _load(self, path: str | Path) -> dict[int, float]:
        work = partial(read_file, Path(path), kind=self._table.kind, letter=self._table.letter)
        file = await asyncio.get_running_loop().run_in_executor(None, work)
        for number, value in file.values.items():
            self._written(number, value)
        return dict(sorted(file.values.items()))

    def _comment(self, number: int) -> str | None:
        fact = self._table.facts.get(number)
        if fact is None:
            return None
        unit = self._line.settings.unit if fact.unit == "axis" else fact.unit
        return f"{fact.meaning} [{unit}]" if unit else fact.meaning

    def _name(self, number: int) -> str:
        return self._table.name(number)

    def _written(self, number: int, value: float) -> str:
        return self._table.written(number, value, self._line.settings.dialect.write_value)
