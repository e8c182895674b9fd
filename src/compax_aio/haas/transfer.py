"""A transfer as the caller holds it: a future of its result, that can be watched and cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, Protocol, TypeVar

from ..checked_numbers import check_number
from ..errors import CompaxError, InvalidCommandError

if TYPE_CHECKING:
    from ..transports.line_errors import LineErrors
    from .language.data_file import DataFile
    from .language.program_file import ProgramFile
    from .verifying import Verified

__all__ = [
    "Damage",
    "Kind",
    "Received",
    "Sent",
    "Transfer",
    "TransferAccount",
    "TransferOwner",
    "TransferPhase",
    "TransferProgress",
    "Way",
]

Kind = Literal["program", "programs", "parameters", "settings", "offsets", "macros", "drip feed"]
"""What goes over the line."""
Way = Literal["receive", "send"]

TransferPhase = Literal["starting", "waiting for operator", "under way", "held", "ending", "verifying", "over"]
"""
``starting``: what is to be sent is checked, and the line waited for. ``waiting for operator``: somebody has to press a
key at the control. ``under way``: the file goes over the line. ``held``: the control has no room (Xoff, CTS).
``ending``: all of it is over the line, and the end is waited for. ``verifying``: it goes over the line once more, to
be compared. ``over``: it has ended.
"""

_ResultT = TypeVar("_ResultT")

_MOST_PLACES: Final = 20
_LOOK_S: Final = 0.25
"""So often it is looked how far a transfer is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """What was damaged on its way, as far as this end can tell."""

    places: tuple[int, ...] = ()
    """Offsets in the file of bytes that cannot be right: a wrong parity bit, or a byte above 7F; the first ones."""
    bytes: int = 0
    """How many of these there are."""
    counted: LineErrors | None = None
    """What the port has counted meanwhile; None: it does not count."""

    def __bool__(self) -> bool:
        return bool(self.bytes or self.counted)

    def __str__(self) -> str:
        """Say it in one clause."""
        said = []
        if self.bytes:
            first = ", ".join(map(str, self.places[:_MOST_PLACES]))
            said.append(f"{self.bytes} byte{'s' * (self.bytes > 1)} cannot be right, at offset {first}")
        if self.counted:
            said.append(f"the port has counted {self.counted}")
        return " and ".join(said) or "no damage was seen"


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferAccount:
    """What is known of a transfer: how far it came, and what is left of it."""

    kind: Kind
    way: Way
    phase: TransferPhase
    """In which it is, or was when it ended."""
    bytes: int = 0
    """Of the file: that came, or that have left, as far as can be told."""
    total_bytes: int | None = None
    """Of the file; None: nobody knows."""
    blocks: int = 0
    """Of XMODEM, acknowledged; 0 without it."""
    repeated_blocks: int = 0
    """Of XMODEM, that went over the line once more."""
    lines: int = 0
    """Whole ones, among these bytes."""
    bytes_after_xoff: int = 0
    """Of them left after the control had said stop: they were on their way already."""
    hold_offsets: tuple[int, ...] = ()
    """Where in the file the control said stop, the last times."""
    damage_offsets: tuple[int, ...] = ()
    """Where in the file a byte came damaged, the first times."""
    archive: Path | None = None
    """Where the bytes are; ``*.incomplete`` unless the transfer ended well."""

    @property
    def offset(self) -> int:
        """Where in the file it is, or ended."""
        return self.bytes

    @property
    def line(self) -> int:
        """In which line of the file that is, from 1."""
        return self.lines + 1

    def __str__(self) -> str:
        """Say it in one clause."""
        word = "have left" if self.way == "send" else "came"
        if not self.bytes:
            return "nothing of the file was sent" if self.way == "send" else "nothing of the file came"
        of = "" if self.total_bytes is None else f" of {self.total_bytes}"
        blocks = f" in {self.blocks} blocks" if self.blocks else ""
        xoff = f"; {self.bytes_after_xoff} left after the control had said stop" if self.bytes_after_xoff else ""
        return f"{self.bytes}{of} bytes{blocks} {word}, {self.lines} whole lines{xoff}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferProgress:
    """How far a transfer is."""

    phase: TransferPhase
    bytes: int
    total_bytes: int | None
    blocks: int
    lines: int
    held_s: float
    """For how long the control has held the line until now."""
    operator: str | None
    """What somebody has to do at the control now; None: nothing."""
    elapsed_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Received:
    """A file that came whole, as far as this end can tell."""

    control: str
    kind: Kind
    data: bytes
    """As it came."""
    file: ProgramFile | DataFile
    """The same, read; ``bytes(file)`` is *data*."""
    proof: str
    """What has shown the end of the file: ``"DC4"``, ``"xmodem EOT"``, ``"silence after %"``."""
    damage: Damage | None
    """None: nothing on this line tells damage, and there may be some; see :attr:`verified`."""
    verified: Verified | None
    """What a second look has proved; None: there was none."""
    archive: Path | None
    duration_s: float
    warnings: tuple[str, ...] = ()

    def __bytes__(self) -> bytes:
        return self.data


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """A file that was sent whole. Whether the control has stored it, only its screen says, or reading it back."""

    control: str
    kind: Kind
    bytes: int
    blocks: int
    lines: int
    proof: str
    """``"reader off seen"``, ``"xmodem acknowledged"``, ``"left the line"``, ``"read back equal"``."""
    only_on_screen: str
    """What to look for at the control, which tells nobody else."""
    bytes_after_xoff: int
    """Left after the control had said stop: more than its buffer has room for makes alarm 414."""
    held_s: float
    verified: Verified | None
    duration_s: float
    warnings: tuple[str, ...] = ()


class TransferOwner(Protocol):
    """Who carries a transfer out."""

    def snapshot(self) -> TransferProgress:
        """Say how far it is."""

    def account(self) -> TransferAccount:
        """Say what is known of it."""

    def abandon(self) -> None:
        """Deal with a transfer that was cancelled."""


class Transfer(asyncio.Future[_ResultT]):
    """
    A transfer under way; awaiting it gives :class:`Received` or :class:`Sent`, or raises why there is none.

    Cancelling it (also by a time-out around it, a failing task group, leaving the control's block, Ctrl-C) writes no
    more of it: XMODEM is told (CAN), the rest is left unsent, and the line can be used again. What the control has
    already taken stays there; :attr:`account` says how much that was.

    Attributes:
        description: What goes over the line, in a few words.
        failure: The error that it has ended with; None if it has not.
    """

    def __init__(self, owner: TransferOwner, description: str) -> None:
        super().__init__()
        self.description = description
        self.failure: CompaxError | None = None
        self._owner = owner
        self._changed = asyncio.Event()
        self.add_done_callback(lambda _: self._changed.set())

    @property
    def phase(self) -> TransferPhase:
        """What is going on."""
        return self._owner.snapshot().phase

    @property
    def account(self) -> TransferAccount:
        """What is known of it now."""
        return self._owner.account()

    def cancel(self, msg: Any = None) -> bool:
        """Give the transfer up; nothing more of the file is written from now on."""
        if not super().cancel(msg):
            return False
        self._owner.abandon()
        return True

    async def progress(self, *, interval_s: float = 0.1) -> AsyncIterator[TransferProgress]:
        """
        Yield how far the transfer is, whenever that changes, and once at its end.

        Args:
            interval_s: Shortest time between two of them.

        Yields:
            The newest state; its *operator* says what has to be done at the control. Errors end the iteration:
            awaiting the transfer raises them.

        Raises:
            InvalidCommandError: The interval is none.
        """
        if not check_number("interval_s", interval_s) >= 0:
            raise InvalidCommandError(f"interval_s is 0 or more, not {interval_s!r}")
        told: TransferProgress | None = None
        is_last = False
        while not is_last:
            is_last = self.done()
            self._changed.clear()
            now = self._owner.snapshot()
            if is_last or told is None or replace(now, elapsed_s=told.elapsed_s) != told:
                told = now
                yield now
            if not is_last and not self.done():
                await asyncio.sleep(interval_s)
                with suppress(TimeoutError):  # nobody tells of each byte that leaves
                    async with asyncio.timeout(_LOOK_S):
                        await self._changed.wait()

    # What the one who carries it out tells it -----------------------------------------------------------------------

    def note_change(self) -> None:
        """Note that it is further, or in another phase."""
        self._changed.set()

    def note_cancelled(self) -> None:
        """Note that whoever carries it out was cancelled."""
        super().cancel()

    def finish(self, result: _ResultT) -> None:
        """Note that it has ended well."""
        if not self.done():
            self.set_result(result)

    def fail(self, error: BaseException) -> None:
        """Raise *error* in whoever awaits it."""
        if isinstance(error, CompaxError):
            self.failure = error
        if not self.done():
            self.set_exception(error)
