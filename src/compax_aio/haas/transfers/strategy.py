"""What all transfers have in common: a start, a body, a tail; bytes in, bytes out, and how long a pause may be."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from ...errors import LinkProtocolError
from ...link.contract import Event
from ...link.level import LineLevel
from .account import Ending, LineAccount, Phase, Proof

__all__ = ["Patience", "Strategy"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long each phase of a transfer may take, in seconds, with nothing new."""

    start_s: float = 120.0
    """Until the operator has pressed SEND or RECV."""
    body_s: float = 30.0
    """Silence in the middle of a file; or for so long the control may hold the line."""
    tail_s: float = 2.0
    """After the last ``%``: so long nothing must come, for the file to be whole …"""
    reader_off_s: float = 5.0
    """… and so long the control may take to say that it has read it (DC3, with DC codes)."""
    block_s: float = 10.0
    """For a block of XMODEM, or its acknowledgement."""
    most_repeats: int = 10
    """Of a block of XMODEM."""
    drip_held_s: float = 3600.0
    """For so long the control may hold a drip feed: a block under way may take long, and so may a feed hold."""


class Strategy(ABC):
    """
    One transfer of a file, by one synchronisation.

    The protocol calls :meth:`begin` once; then :meth:`receive` with what comes, and :meth:`time_ran_out` when nothing
    has come, or nothing that counts, for :attr:`pause_s`; until there is an :attr:`ending`.

    Args:
        label: What it is called in errors, logs and on records; sending it over the link begins it.
        patience: How long each phase may take.

    Attributes:
        phase: How far it is.
        ending: How it ended; None: it is under way, or has not begun.
        proof: What is proved of a file that was sent; None: nothing, or it was not sent.
    """

    sends: bool
    """Whether the file goes to the control."""
    takes_all = False
    """Whether all bytes that come belong to it, whatever they are: blocks of XMODEM may have any."""

    def __init__(self, label: str, patience: Patience) -> None:
        self.label = label
        self.patience = patience
        self.phase = Phase.WAIT_START
        self.ending: Ending | None = None
        self.proof: Proof | None = None
        self._ended_in = Phase.WAIT_START
        self._level = LineLevel()
        self._write: Callable[[bytes], None] = _refuse
        self._has_moved = False
        self._notes: list[Event] = []

    # What differs ---------------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def pause_s(self) -> float:
        """How long it may take from now, or from what came last that counts, until something must happen."""

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Read *data*, a piece of any size; return what of it is none of this transfer's."""

    @abstractmethod
    def time_ran_out(self) -> None:
        """Go on after a pause, or take note that something did not come in time."""

    @abstractmethod
    def account(self) -> LineAccount:
        """Say how much has gone over the line."""

    def _begin(self, *, reader_is_on: bool) -> None:  # noqa: B027  # who receives waits
        """Write what goes first."""

    def _farewell(self) -> bytes:
        """Return what tells the control that it is given up."""
        return b""

    def note_damage(self) -> None:  # noqa: B027  # of what is sent, nothing comes
        """Take note that the byte that is received next is damaged."""

    # What the protocol calls ----------------------------------------------------------------------------------------

    def begin(self, level: LineLevel, write: Callable[[bytes], None], *, reader_is_on: bool = False) -> None:
        """
        Begin.

        Args:
            level: What is known of the line.
            write: Called with what is to be written.
            reader_is_on: The control has said so already (DC1, when the operator pressed RECV), before this began.
        """
        if self._write is not _refuse:
            raise LinkProtocolError(f"{self.label!r} has begun already: a transfer is never sent twice")
        self._level, self._write = level, write
        self._begin(reader_is_on=reader_is_on)

    def give_up(self) -> None:
        """Write no more of it, and tell the control where the synchronisation has a way; harmless when it is over."""
        if self.ending is None:
            if (farewell := self._farewell()) and self._write is not _refuse:
                self._write(farewell)
            self._end(Ending.GIVEN_UP)

    def line_lost(self) -> None:
        """Take note that the line is gone; harmless when it is over."""
        if self.ending is None:
            self._end(Ending.LINE_LOST)

    def take_moved(self) -> bool:
        """Return whether something has happened since the last call by which :attr:`pause_s` counts anew."""
        has_moved, self._has_moved = self._has_moved, False
        return has_moved

    def take_notes(self) -> list[Event]:
        """Take what is to be told, in order."""
        notes, self._notes = self._notes, []
        return notes

    # For the kinds --------------------------------------------------------------------------------------------------

    def _enter(self, phase: Phase) -> None:
        self.phase = self._ended_in = phase
        self._has_moved = True

    def _end(self, ending: Ending, proof: Proof | None = None) -> None:
        self._ended_in = self.phase
        self.phase = Phase.DONE
        self.ending, self.proof = ending, proof
        self._has_moved = True


def _refuse(data: bytes) -> None:
    raise LinkProtocolError(f"{len(data)} bytes of a transfer that has not begun")
