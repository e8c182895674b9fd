"""Parameters and variables of a drive: read, written and read back, saved, compared and restored."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from ..errors import (
    CommandRejectedError,
    CompaxError,
    InvalidCommandError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from ..link.cancellation import despite_cancellation
from ..link.contract import Lane
from .codecs import decode_number
from .facts.limits import MAX_POSITION
from .facts.parameters import PASSWORD_OFF, PASSWORD_ON
from .line import DriveLine
from .plain_line import check_line
from .value_file import read_file, write_file
from .value_tables import PARAMETER_TABLE, VARIABLE_TABLE, ValueTable
from .vocabulary import check_number

__all__ = [
    "PARAMETER_TABLE",
    "VARIABLE_TABLE",
    "Difference",
    "NumberedValues",
    "Parameters",
    "Progress",
    "Restored",
]

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
        text = self._written(number, value)
        await self._tell(number, text)
        read_back = await self.read(number)
        if read_back != self._rounded(number, value):
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

    async def diff(self, path: str | Path) -> tuple[Difference, ...]:
        """
        Compare a saved file with the drive; only what differs, in the order of numbers.

        Raises:
            InvalidCommandError: It is no such file, or holds what cannot be said to the drive.
            OSError: It cannot be read.
        """
        return await self._compare(await self._load(path))

    async def _compare(self, values: Mapping[int, float]) -> tuple[Difference, ...]:
        differences = []
        for number, value in values.items():
            try:
                in_drive: float | None = await self.read(number)
            except CommandRejectedError:
                in_drive = None
            if in_drive != value:
                differences.append(Difference(self._name(number), number, value, in_drive))
        return tuple(differences)

    async def restore(
        self, path: str | Path, *, dry_run: bool = False, on_progress: Progress | None = None
    ) -> Restored:
        """
        Write what differs from a saved file, each value read back; the first that fails ends it.

        Args:
            path: A file of :meth:`save`.
            dry_run: Only say what would be written.
            on_progress: Called after each value that was written.

        Raises:
            InvalidCommandError: The file holds something that cannot be said to the drive; nothing was written.
            RestoreIncompleteError: A value was refused, was not read back as written, or its fate is unknown; says
                which were applied, which not, and which is uncertain. :meth:`roll_back` takes them back.
        """
        values = await self._load(path)
        changes = self._changes(await self._compare(values))
        applied: dict[int, tuple[float, float]] = {}
        for number, change in changes.items():
            if not dry_run:
                try:
                    await self.write(number, change[1])
                except CompaxError as error:
                    raise self._incomplete(error, number, changes, applied) from error
            applied[number] = change
            if on_progress is not None:
                on_progress(len(applied), len(changes))
        return Restored(
            changed=applied,
            unchanged=len(values) - len(changes),
            was_dry_run=dry_run,
            pending=self._waiting(applied),
        )

    async def roll_back(self, error: RestoreIncompleteError) -> None:
        """
        Write the values that the drive had before a restore that was not completed, the uncertain ones first.

        The first that fails raises, as in :meth:`write`, and ends it; it can be repeated.
        """
        for number, (old, _) in (*reversed(error.uncertain.items()), *reversed(error.applied.items())):
            await self.write(number, old)

    def _changes(self, differences: Iterable[Difference]) -> dict[int, tuple[float, float]]:
        changes = {each.number: (each.in_drive, each.in_file) for each in differences}
        known = {number: (old, new) for number, (old, new) in changes.items() if old is not None}
        if missing := [self._name(number) for number in changes if number not in known]:
            raise RestoreIncompleteError(
                f"nothing was written: the drive does not give {', '.join(missing)}",
                device=self._line.name,
                hint="is the file that of another drive? take them out of it, or write them one by one",
                not_applied=tuple(changes),
            )
        return known

    def _incomplete(
        self,
        error: CompaxError,
        number: int,
        changes: Mapping[int, tuple[float, float]],
        applied: Mapping[int, tuple[float, float]],
    ) -> RestoreIncompleteError:
        text = self._written(number, changes[number][1])
        refused = isinstance(error, InvalidCommandError) or _is_refusal_of(text, error)
        uncertain = {} if refused else {number: changes[number]}
        left = tuple(each for each in changes if each not in applied and each not in uncertain)
        lists = f"applied: {self._names(applied)}; not applied: {self._names(left)}"
        if uncertain:
            lists += f"; uncertain: {self._names(uncertain)}"
        waiting = self._waiting((*applied, *uncertain))
        return RestoreIncompleteError(
            f"{text} was not restored: {error.what}; {lists}"
            if refused
            else f"it is uncertain whether {text} was restored: {error.what}; {lists}",
            device=self._line.name,
            sent=error.sent,
            received=error.received,
            hint="mend the cause and restore again, or roll_back() what was written"
            + (f"; not in force before VP: {self._names(waiting)}" if waiting else ""),
            exchanges=error.exchanges,
            applied=applied,
            not_applied=left,
            uncertain=uncertain,
        )

    async def _tell(self, number: int, text: str) -> None:  # noqa: ARG002  # the number is for who keeps account
        await self._line.command(text)

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

    def _names(self, numbers: Iterable[int]) -> str:
        return ", ".join(map(self._name, numbers)) or "none"

    def _name(self, number: int) -> str:
        if isinstance(number, bool) or not isinstance(number, int) or number not in self._table.decimals:
            raise InvalidCommandError(
                f"there is no {self._table.letter}{number!r} among the {self._table.kind} of a COMPAX"
            )
        return f"{self._table.letter}{number}"

    def _rounded(self, number: int, value: float) -> float:
        return round(check_number(self._name(number), value), self._table.decimals[number]) + 0.0

    def _written(self, number: int, value: float) -> str:
        rounded, decimals = self._rounded(number, value), self._table.decimals[number]
        if abs(rounded - float(value)) > 1e-9 * max(1.0, abs(rounded)):
            raise InvalidCommandError(f"{self._name(number)} has {decimals} decimals (IBS p. 24), not {value!r}")
        if abs(rounded) > MAX_POSITION * 10:
            raise InvalidCommandError(f"{self._name(number)} cannot be {value!r}: a number has 7 digits (UG p. 158)")
        return check_line(f"{self._name(number)}={rounded:.{decimals}f}")


class Parameters(NumberedValues):
    """
    The parameters P1-P250 of a drive.

    Writing wants the password off (:meth:`unlocked`). Written values take effect at :meth:`make_valid` (VP), but for
    the control parameters P40-P49, which are live (UG p. 100-101, 158).
    """

    def __init__(self, line: DriveLine) -> None:
        super().__init__(line, PARAMETER_TABLE)
        self._pending: set[int] = set()

    @property
    def pending(self) -> tuple[int, ...]:
        """Numbers that were written from here and are not in force before :meth:`make_valid`."""
        return tuple(sorted(self._pending))

    async def _tell(self, number: int, text: str) -> None:
        was_pending = number in self._pending
        self._pending.update(self._waiting([number]))
        try:
            await super()._tell(number, text)
        except CommandRejectedError:
            if not was_pending:
                self._pending.discard(number)
            raise

    async def make_valid(self) -> None:
        """Declare written parameters valid (VP, CAN p. 32): they are in force from now on."""
        await self._line.command(self._line.settings.dialect.make_valid)
        self._pending.clear()

    async def unlock(self) -> None:
        """
        Remove the write protection (``GOTO 302``, CAN p. 32), and look at S17 whether it is gone.

        Raises:
            UnexpectedAnswerError: The drive acknowledged it, and is still protected.
        """
        await self._line.command(PASSWORD_OFF)
        await self._expect_password(active=True)

    async def lock(self) -> None:
        """Restore the write protection (``GOTO 270``, CAN p. 32), and look at S17 whether it is back."""
        await self._line.command(PASSWORD_ON)
        await self._expect_password(active=False)

    @asynccontextmanager
    async def unlocked(self) -> AsyncIterator[Parameters]:
        """Unlock for a block; it is locked again however the block ends, a cancellation included."""
        try:
            await self.unlock()
            yield self
        finally:
            if self._line.link.is_open:
                await despite_cancellation(self.lock())

    async def _expect_password(self, *, active: bool) -> None:
        status = await self._line.status(Lane.CONTROL)
        if status.password_active is not active:
            raise UnexpectedAnswerError(
                f"the drive acknowledged it, and its parameters are still {'protected' if active else 'unprotected'}",
                device=self._line.name,
                sent=PASSWORD_OFF if active else PASSWORD_ON,
                received=f"S17 {status.s17}",
                hint="another password may be set; ask who commissioned the machine",
            )


def _is_refusal_of(text: str, error: CompaxError) -> bool:
    """Whether the drive refused *text* itself, and not what was asked after it."""
    return isinstance(error, CommandRejectedError) and error.sent == text
