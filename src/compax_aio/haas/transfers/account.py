"""What is known of a transfer, under way or over: its phase, how it ended, and how much went over the line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

__all__ = ["Ending", "LineAccount", "Phase", "Proof"]

Proof = Literal["reader off seen", "xmodem acknowledged", "left the line"]
"""What is proved of a file that was sent: never that the control has stored it, which only its screen shows."""


class Phase(Enum):
    """How far a transfer is."""

    WAIT_START = "waiting for the control"
    """Nothing of the file has gone over the line: the operator has not pressed SEND or RECV, as far as can be seen."""
    BODY = "in the file"
    TAIL = "at the end"
    """The last ``%`` is over; what shows that this was all is awaited."""
    DONE = "done"


class Ending(Enum):
    """How a transfer ended."""

    COMPLETE = "complete"
    NOT_STARTED = "not started"
    """The control did not begin in time: nobody pressed SEND or RECV."""
    WENT_SILENT = "went silent"
    """It stopped in the middle of the file."""
    END_UNANSWERED = "end unanswered"
    """It has taken all of the file, and not answered its end (XMODEM)."""
    UNLIKE = "unlike"
    """What it sends is by another synchronisation."""
    HELD_TOO_LONG = "held too long"
    """The control told to stop, with Xoff, and never to go on."""
    STUCK = "stuck"
    """What was written does not leave: the wires hold the line (RTS/CTS), or the network does."""
    CANCELLED = "cancelled by the control"
    GARBLED = "garbled"
    """The same block was damaged, or lost, too often (XMODEM)."""
    TOO_LARGE = "too large"
    """More came than was to be received."""
    GIVEN_UP = "given up"
    """It was cancelled here."""
    LINE_LOST = "line lost"


@dataclass(frozen=True, slots=True, kw_only=True)
class LineAccount:
    """
    How much of a transfer has gone over the line.

    Attributes:
        label: What the transfer is called.
        sends: Whether the file goes to the control.
        phase: In which it is, or was when it ended.
        ending: How it ended; None: it is under way.
        bytes: Of the file that have left, as far as can be told, or have come.
        written_bytes: Of what is sent, that were handed to the line; those that have not left may do so yet.
        total_bytes: Of the file; None: nobody knows.
        lines: Of the file, whole ones, until there.
        blocks: Of XMODEM, that were acknowledged.
        repeated_blocks: Of XMODEM, that went over the line once more.
        is_held: Whether the control has told to stop, with Xoff.
        holds: How often it did.
        hold_offsets: Where in the file the last of them were: how many bytes had left by then.
        held_bytes: How many bytes left although Xoff had come, in all: they were on their way already.
        most_held_bytes: The most of them at one Xoff.
        damage_offsets: Where in the file a byte came damaged, or cannot be; the first ones.
        damaged_bytes: How many did.
        has_dc2: Whether the control began with DC2.
        has_dc4: Whether it ended with DC4.
        is_closed: Whether the last line that has come, and has anything, is a percent sign: what is received is whole.
        detail: What is known besides of how it ended; a clause for a person.
        dropped_bytes: Signs of the handshake and leader that came between and are no part of the file.
        signs_inside: How many of these came in the middle of the file, where none should be.
        sign_offsets: Where in the file; the first ones.
    """

    label: str
    sends: bool
    phase: Phase
    ending: Ending | None = None
    bytes: int = 0
    written_bytes: int = 0
    total_bytes: int | None = None
    lines: int = 0
    blocks: int = 0
    repeated_blocks: int = 0
    is_held: bool = False
    holds: int = 0
    hold_offsets: tuple[int, ...] = ()
    held_bytes: int = 0
    most_held_bytes: int = 0
    damage_offsets: tuple[int, ...] = ()
    damaged_bytes: int = 0
    has_dc2: bool = False
    has_dc4: bool = False
    dropped_bytes: int = 0
    signs_inside: int = 0
    sign_offsets: tuple[int, ...] = ()
    is_closed: bool = False
    detail: str = ""

    @property
    def offset(self) -> int:
        """Where in the file it is, or ended."""
        return self.bytes
