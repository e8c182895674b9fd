"""Parameters and variables of a drive: read, written and read back, saved, compared and restored."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

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
from .facts.parameters import (
    CONTROL_PARAMETERS,
    MAX_PARAMETER,
    PARAMETERS,
    PASSWORD_OFF,
    PASSWORD_ON,
    VARIABLE_DECIMALS,
    VARIABLES,
    ParameterFact,
    parameter_decimals,
)
from .line import DriveLine
from .plain_line import check_line
from .value_file import read_file, write_file
from .vocabulary import check_number

__all__ = [
    "PARAMETER_TABLE",
    "VARIABLE_TABLE",
    "Difference",
    "NumberedValues",
    "Parameters",
    "Progress",
    "Restored",
    "ValueTable",
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueTable:
    """One kind of numbered values: which there are, and how exact each is."""

    kind: str
    """For people, and the name of the table in a file."""
    letter: str
    decimals: Mapping[int, int]
    """By number."""
    facts: Mapping[int, ParameterFact]
    """Those whose meaning is known."""


PARAMETER_TABLE: Final = ValueTable(
    kind="parameters",
    letter="P",
    decimals={number: parameter_decimals(number) for number in range(1, MAX_PARAMETER + 1)},
    facts={fact.number: fact for fact in PARAMETERS},
)

VARIABLE_TABLE: Final = ValueTable(
    kind="variables", letter="V", decimals=dict.fromkeys(VARIABLES, VARIABLE_DECIMALS), facts={}
)
"""V1-V39 and V50-V70 (UG p. 100, 104)."""


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
        await self._line.command(text)
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
        Write what differs from a saved file, each value read back; the first refusal ends it.

        Args:
            path: A file of :meth:`save`.
            dry_run: Only say what would be written.
            on_progress: Called after each value that was written.

        Raises:
            InvalidCommandError: The file holds something that cannot be said to the drive; nothing was written.
            RestoreIncompleteError: A value was refused, or its fate is unknown; says which were applied and which
                not. :meth:`roll_back` takes them back.
        """
        values = await self._load(path)
        changes = {each.number: (each.in_drive, each.in_file) for each in await self._compare(values)}
        applied: dict[int, tuple[float, float]] = {}
        for number, (old, new) in changes.items():
            try:
                if old is None:
                    raise InvalidCommandError(f"the drive does not give {self._name(number)}, so it is not written")
                if not dry_run:
                    await self.write(number, new)
            except CompaxError as error:
                left = [self._name(each) for each in changes if each not in applied]
                raise RestoreIncompleteError(
                    f"{self._name(number)} = {new:g} was not restored: {error.what}; "
                    f"applied: {', '.join(map(self._name, applied)) or 'none'}; not applied: {', '.join(left)}",
                    device=self._line.name,
                    sent=error.sent,
                    received=error.received,
                    hint="mend the cause and restore again, or roll_back() what was applied",
                    applied=applied,
                    not_applied=tuple(number for number in changes if number not in applied),
                ) from error
            applied[number] = (old, new)
            if on_progress is not None:
                on_progress(len(applied), len(changes))
        return Restored(changed=applied, unchanged=len(values) - len(changes), was_dry_run=dry_run)

    async def roll_back(self, error: RestoreIncompleteError) -> None:
        """Write the values that the drive had before a restore that was not completed."""
        for number, (old, _) in reversed(error.applied.items()):
            await self.write(number, old)

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

    async def write(self, number: int, value: float) -> float:
        """Write one parameter; see :meth:`NumberedValues.write` and :attr:`pending`."""
        self._written(number, value)
        was_pending = number in self._pending
        if number not in CONTROL_PARAMETERS:
            self._pending.add(number)
        try:
            return await super().write(number, value)
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
