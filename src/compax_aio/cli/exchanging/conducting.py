"""One transfer after the other, watched until it is over; and what is said where one fails or is interrupted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

from compax_aio import CompaxError
from compax_aio.haas.transfer import Transfer, TransferAccount

from ..interruption import say_at_end
from ..printing import Printing
from .operator import Operator
from .view import TransferView

__all__ = ["Conductor"]

_Result = TypeVar("_Result")
_WORDS: Final = {
    "accept_damaged=True takes": "--accept-damaged takes",
    "with the profile": "with --profile",
    "the bytes are error.data; is the disk full?": "is the disk full? Receive it again when there is room",
    ": error.data has it": "",
}
"""What hints and notes of the library are called here."""
OnOperator = Callable[[str], Awaitable[None] | None]


class Conductor:
    """
    Carries transfers out, so that they can be seen.

    Args:
        printing: How it is said.
        operator: Who presses keys.

    Attributes:
        took_s: How long the bytes of the last transfer went over the line.
    """

    def __init__(self, printing: Printing, operator: Operator) -> None:
        self._printing = printing
        self._operator = operator
        self._title = ""
        self.took_s = 0.0
        self._transfer: Transfer[Any] | None = None

    async def carry_out(self, title: str, begin: Callable[[OnOperator], Transfer[_Result]]) -> _Result:
        """
        Begin a transfer, and show how it gets on until it is over.

        Args:
            title: What goes over the line.
            begin: Begins it; is given what is to be its *on_operator*.

        Raises:
            CompaxError: It has not ended well; says how far it came.
        """
        self._title = title
        with TransferView(title, self._printing) as view:
            transfer = self._transfer = begin(lambda _: self._operator.ask(view))
            try:
                async with view.ticking():
                    async for progress in transfer.progress():
                        view.show(progress)
                    self.took_s = view.took_s
                    return await transfer
            except CompaxError as error:
                _tell_people(error)
                raise

    @contextmanager
    def telling(self) -> Iterator[None]:
        """Say of the transfer under way what became of it if this block, which holds its line, is interrupted."""
        try:
            yield
        except asyncio.CancelledError:
            if self._transfer is not None and self._transfer.cancelled():
                self._tell_interrupted(self._transfer.account)
            raise

    def _tell_interrupted(self, account: TransferAccount) -> None:
        say_at_end(f"Interrupted. {self._title}: the transfer was given up; {account}. {_what_now(account)}")
        if self._printing.json:
            self._printing.show({"transfer": self._title, "interrupted": True, "account": account})


def _what_now(account: TransferAccount) -> str:
    if account.way == "receive":
        if not account.bytes:
            return "No file was written."
        return "" if account.archive is None else f"What came is in {account.archive}."
    if account.kind == "drip feed":
        return _what_the_machine_does(account)
    if not account.bytes:
        return "The control, if it waits, waits on: press RESET there."
    if account.bytes == account.total_bytes:
        return "All of it has left; whether the control has stored it, its screen shows."
    return "The control waits for the rest: press RESET there. It may have stored what it has got."


def _what_the_machine_does(account: TransferAccount) -> str:
    if not account.bytes:
        return "The machine has got nothing to run."
    return "The machine runs what it has got, then stands: look at it, press RESET, and begin anew."


def _tell_people(error: CompaxError) -> None:
    """Say what to do at a terminal, in its words, and nothing twice: the account stands in most errors already."""
    if error.hint is not None:
        error.hint = _in_words_of_here(error.hint)
    notes = getattr(error, "__notes__", [])
    notes[:] = [_in_words_of_here(each) for each in notes if each.removeprefix("transfer: ") not in error.what]


def _in_words_of_here(text: str) -> str:
    for theirs, ours in _WORDS.items():
        text = text.replace(theirs, ours)
    return text
