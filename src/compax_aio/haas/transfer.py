"""A transfer as the caller holds it: a future of its result, that can be watched and cancelled."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeVar

from ..motion.under_way import UnderWay

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
    """Where the bytes are; ``*.incomplete`` until they have all come and were found to be what they should be."""

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
    """What has shown the end of the file: ``"DC4 seen"``, ``"xmodem EOT"``, ``"silence after %"``."""
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


class Transfer(UnderWay[_ResultT, TransferProgress, TransferAccount]):
    """
    A transfer under way; awaiting it gives :class:`Received` or :class:`Sent`, or raises why there is none.

    Cancelling it (also by a time-out around it, a failing task group, leaving the control's block, Ctrl-C) writes no
    more of it: XMODEM is told (CAN), the rest is left unsent, and the line can be used again. What the control has
    already taken stays there; :attr:`account` says how much that was.

    Attributes:
        description: What goes over the line, in a few words.
        failure: The error that it has ended with; None if it has not.
    """

    _look_s = 0.25  # nobody tells of each byte that leaves

    @property
    def phase(self) -> TransferPhase:
        """What is going on."""
        return self._owner.snapshot().phase

    def _is_news(self, now: TransferProgress, told: TransferProgress) -> bool:
        return replace(now, elapsed_s=told.elapsed_s) != told

    def note_cancelled(self) -> None:
        """Note that whoever carries it out was cancelled."""
        asyncio.Future.cancel(self)  # not to be abandoned any more
