"""Parameters of a drive: protected by a password, in force after VP; and what is numbered and read the same way."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from ..errors import CompaxError, UnexpectedAnswerError
from ..link.cancellation import despite_cancellation
from ..link.contract import Lane
from .facts.parameters import PASSWORD_OFF, PASSWORD_ON
from .line import DriveLine
from .numbered_values import Difference, NumberedValues, Progress, Restored
from .value_tables import PARAMETER_TABLE, VARIABLE_TABLE

__all__ = [
    "PARAMETER_TABLE",
    "VARIABLE_TABLE",
    "Difference",
    "NumberedValues",
    "Parameters",
    "Progress",
    "Restored",
]


class Parameters(NumberedValues):
    """
    The parameters P1-P250 of a drive.

    Writing wants the password off (:meth:`unlocked`). Written values take effect at :meth:`make_valid` (VP), but for
    the control parameters P40-P49, which are live (UG p. 100-101, 158).
    """

    def __init__(self, line: DriveLine) -> None:
        super().__init__(line, PARAMETER_TABLE)
        self._writes: dict[int, int] = {}
        """By number, when it was written last, counted in writes."""
        self._before: dict[int, int] = {}
        """And the time before that, which counts again when the drive refuses."""
        self._count = 0
        self._valid_up_to = 0
        self._users = 0
        """How many blocks want the password off."""
        self._password_turn = asyncio.Lock()

    @property
    def pending(self) -> tuple[int, ...]:
        """Numbers that were written from here and are not in force before :meth:`make_valid`."""
        return tuple(sorted(number for number, count in self._writes.items() if count > self._valid_up_to))

    def _note_sent(self, number: int) -> None:
        if self._waiting([number]):
            self._count += 1
            self._before[number] = self._writes.get(number, 0)
            self._writes[number] = self._count

    def _note_refused(self, number: int) -> None:
        if number in self._before:
            self._writes[number] = self._before.pop(number)

    async def make_valid(self) -> None:
        """Declare written parameters valid (VP, CAN p. 32): they are in force from now on."""
        sent_after = 0

        def note_sent() -> None:
            nonlocal sent_after
            sent_after = self._count

        await self._line.command(self._line.settings.dialect.make_valid, on_sent=note_sent)
        self._valid_up_to = max(self._valid_up_to, sent_after)

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
        """
        Unlock for a block; it is locked again however the block ends, a cancellation included.

        Blocks may overlap: the last that is left locks. A block that fails raises its own error, with a note if the
        lock could not be restored.

        Raises:
            UnexpectedAnswerError: The drive keeps its password, or does not take it back.
            CommandRejectedError, AnswerTimeoutError, ConnectionLostError: It may be unlocked still.
        """
        failure: BaseException | None = None
        self._users += 1
        try:
            async with self._password_turn:
                await self.unlock()
            yield self
        except BaseException as error:
            failure = error
            raise
        finally:
            self._users -= 1
            try:
                await despite_cancellation(self._lock_after_the_last())
            except asyncio.CancelledError:
                if not isinstance(failure, asyncio.CancelledError):
                    raise
                # Cancelled once more: the first one has the notes.
            except CompaxError as error:
                told = failure or error
                told.add_note(f"{self._line.name}: the parameters may be unprotected still: {error}")
                if failure is None:
                    raise

    async def _lock_after_the_last(self) -> None:
        async with self._password_turn:
            if not self._users:
                await self.lock()

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
