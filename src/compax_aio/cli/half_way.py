"""Writing that stops half way: what of it the drive has is said, and it is taken back if that is wanted."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from types import TracebackType
from typing import Annotated, Protocol

from cyclopts import Parameter

from compax_aio import CompaxError, RestoreIncompleteError

from .confirming import confirm
from .interruption import say_at_end
from .printing import Printing, notes_console
from .values import account_document, account_table

__all__ = ["HalfWay", "RollBackFlag", "Yes"]

Yes = Annotated[bool, Parameter(negative=(), help="Do not ask.")]
RollBackFlag = Annotated[
    bool, Parameter(negative=(), help="If it stops half way, write back what was there before, without being asked.")
]


class _Restorable(Protocol):
    incomplete: RestoreIncompleteError | None

    async def roll_back(self, error: RestoreIncompleteError) -> None:
        """Write back what was there before."""


class HalfWay:
    """
    Says of what is written in a block how far it came, if it fails or is interrupted; the error goes on.

    Args:
        drive: The name of the drive.
        there: What is written.
        name: Names a number, for people.
        printing: How it is said.
        roll_back: Whether to take back what was written, without asking.
        may_ask: Whether somebody may be asked, if that was not said.
    """

    def __init__(
        self,
        drive: str,
        there: _Restorable,
        name: Callable[[int], str],
        printing: Printing,
        *,
        roll_back: bool,
        may_ask: bool,
    ) -> None:
        self._drive = drive
        self._there = there
        self._name = name
        self._printing = printing
        self._roll_back = roll_back
        self._may_ask = may_ask

    async def __aenter__(self) -> None:
        pass

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if isinstance(error, RestoreIncompleteError):
            self._tell(error)
            if error.applied or error.uncertain:
                await self._take_back(error, is_wanted=self._roll_back or await self._is_asked_for())
        elif isinstance(error, asyncio.CancelledError) and (left := self._there.incomplete) is not None:
            self._tell(left)
            is_back = bool(left.applied or left.uncertain) and await self._take_back(left, is_wanted=self._roll_back)
            say_at_end(f"Interrupted. {'What was written was taken back.' if is_back else left.what}")

    def _tell(self, left: RestoreIncompleteError) -> None:
        if not self._printing.json:
            notes_console().print(account_table(left, self._name), markup=False)

    async def _is_asked_for(self) -> bool:
        if not self._may_ask or not sys.stdin.isatty():
            return False
        return await confirm(f"Write back what {self._drive} had before?")

    async def _take_back(self, left: RestoreIncompleteError, *, is_wanted: bool) -> bool:
        is_back = False
        try:
            if is_wanted:
                await self._there.roll_back(left)
                is_back = True
                self._printing.note(f"What was written was taken back: {self._drive} has what it had before.")
        except CompaxError as error:
            left.add_note(f"it could not be taken back: {error}")
            for note in getattr(error, "__notes__", ()):
                left.add_note(note)
        if self._printing.json:
            self._printing.show(account_document(left, rolled_back=is_back))
        return is_back
