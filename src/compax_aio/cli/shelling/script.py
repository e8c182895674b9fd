"""Lines that nobody types: carried out one after the other, up to the first that fails."""

from __future__ import annotations

import asyncio
import os
import stat
import sys
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from ...compax.drive import Drive
from ...compax.moves import MoveResult
from ...errors import CompaxError, InvalidCommandError
from ...escaping import escaped
from ..interruption import in_motion
from ..printing import Printing
from ..unasked import UnaskedText
from .language import Language, Order
from .replies import Reply, told_event, told_move
from .underway import Underway

__all__ = ["Script", "lines_of", "lines_of_stdin"]

_END: Final = "exit"
_LONGEST_LINE: Final = 64 * 1024
_MOTION_HINT: Final = "nobody can be asked here: --allow-motion says that the axis may move"


class Script:
    """
    Carries out lines, and prints what each was answered.

    Args:
        drive: Which is talked to.
        printing: How.
        may_move: Whether lines that can move the axis are sent.
    """

    def __init__(self, drive: Drive, printing: Printing, *, may_move: bool) -> None:
        self._drive = drive
        self._printing = printing
        self._may_move = may_move
        self._underway = Underway()
        self._unasked = UnaskedText()
        self._language = Language(drive, self._underway)

    def check(self, lines: Iterable[str]) -> None:
        """
        Look at *lines* before any of them is carried out.

        Raises:
            InvalidCommandError: Of the first that cannot be carried out.
        """
        for number, line in enumerate(lines, start=1):
            text = line.strip()
            if text.lower() == _END:
                return
            if _says_something(text):
                with _named(number, text, "none of the lines was sent"):
                    self.understand(text)

    async def run(self, lines: AsyncIterator[str]) -> None:
        """
        Carry out *lines*; what was started and has not ended is stopped when the drive is closed.

        Raises:
            CompaxError: Of the first line that failed, which is named in a note; those after it are not sent.
        """
        events = asyncio.ensure_future(self._tell_events())
        number = 0
        try:
            async for line in lines:
                number += 1
                text = line.strip()
                if text.lower() == _END:
                    break
                if _says_something(text):
                    with _named(number, text, "nothing after it was sent"):
                        await self._carry_out(text)
            await self._tell_what_runs()
        finally:
            events.cancel()

    def understand(self, text: str) -> Order:
        """
        Return what a line of a script orders.

        Raises:
            InvalidCommandError: It means nothing, or not in a script, or could move the axis, which was not allowed.
        """
        if text.split(maxsplit=1)[0].lower() == "watch":
            raise InvalidCommandError(
                "watch is for a person at the prompt", hint="`compax status --watch` and `compax record` do it here"
            )
        order = self._language.understand(text)
        if order.can_move and not self._may_move:
            raise InvalidCommandError(f"{text!r} can move the axis, and was not sent", hint=_MOTION_HINT)
        return order

    async def _carry_out(self, text: str) -> None:
        reply = await self.understand(text).carry_out()
        if reply.move is None:
            self._show(text, reply)
            return
        with in_motion(self._drive.name):
            result: MoveResult = await reply.move
        self._show(text, told_move(result, self._drive.settings))

    def _show(self, text: str, reply: Reply) -> None:
        self._printing.show({"line": text, **reply.data}, reply.people)

    async def _tell_events(self) -> None:
        async for event in self._drive.events():
            if (text := told_event(event, self._unasked)) is not None:
                self._printing.note(text.plain)

    async def _tell_what_runs(self) -> None:
        """Say that leaving stops a motion that was started by a raw line, if it still runs."""
        if self._underway.unseen is None:
            return
        at = asyncio.get_running_loop().time()
        self._underway.note_status(await self._drive.status(), at)
        if self._underway:
            self._printing.note(f"{self._underway}: it is stopped now; `move 100` and POSA 100$ wait for the end")


def _says_something(text: str) -> bool:
    return bool(text) and not text.startswith("#")


@contextmanager
def _named(number: int, text: str, what_followed: str) -> Iterator[None]:
    """Let an error say in which line it came."""
    try:
        yield
    except CompaxError as error:
        error.add_note(f"in line {number}: {escaped(text)}; {what_followed}")
        raise


async def lines_of(lines: Iterable[str]) -> AsyncIterator[str]:
    """Give *lines*, one after the other."""
    for line in lines:
        yield line


async def lines_of_stdin() -> AsyncIterator[str]:
    """
    Give the lines of standard input as they come, without holding up the event loop.

    Raises:
        InvalidCommandError: One is longer than any line that can be meant, or no text.
    """
    descriptor = sys.stdin.fileno()
    if _is_never_waited_for(descriptor):
        for line in sys.stdin.buffer:
            yield _text(line)
        return
    reader = asyncio.StreamReader(limit=_LONGEST_LINE)
    transport, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(descriptor), "rb")
    )
    try:
        while data := await _line_of(reader):
            yield _text(data)
    finally:
        transport.close()
        with suppress(OSError):
            os.set_blocking(descriptor, True)  # as whoever uses it after us expects it


def _is_never_waited_for(descriptor: int) -> bool:
    """Whether it is a file on disk or the empty device, which no event loop can wait for either."""
    status = os.fstat(descriptor)
    return stat.S_ISREG(status.st_mode) or os.path.samestat(status, Path(os.devnull).stat())


async def _line_of(reader: asyncio.StreamReader) -> bytes:
    try:
        return await reader.readline()
    except ValueError:
        raise InvalidCommandError(f"a line of the input has more than {_LONGEST_LINE} bytes") from None


def _text(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise InvalidCommandError(f"the input is no text: {error}") from error
