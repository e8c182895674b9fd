"""
Every exception of compax_aio, one tree.

.. code-block:: text

    CompaxError
    ├── TransportError                  the line could not be opened, or failed
    │   └── ConnectionLostError         an open line went away
    ├── AnswerTimeoutError              the device did not answer in time
    ├── CommandRejectedError            the device answered with an error
    ├── InvalidCommandError             refused here, before a byte was sent (also a ValueError)
    │   └── MoveActiveError             a move is running on that drive (also a MoveError)
    ├── UnexpectedAnswerError           the device answered something that is no answer to what was sent
    ├── RestoreIncompleteError          a restore stopped half way; says what was applied, what not, what is uncertain
    ├── LinkProtocolError               a protocol was used out of turn: a defect in the caller's code
    └── MoveError                       a move did not end at its target
        ├── MoveStoppedError            it was stopped on the way
        ├── DriveFaultError             the drive reports a fault
        ├── MoveTimeoutError            it took too long, or stands still without having arrived
        └── MoveInDoubtError            nobody can say; look at the machine, then `reconcile()`
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .escaping import escaped

__all__ = [
    "AnswerTimeoutError",
    "CommandRejectedError",
    "CompaxError",
    "ConnectionLostError",
    "DriveFaultError",
    "InvalidCommandError",
    "LinkProtocolError",
    "MoveActiveError",
    "MoveError",
    "MoveInDoubtError",
    "MoveStoppedError",
    "MoveTimeoutError",
    "RestoreIncompleteError",
    "TransportError",
    "UnexpectedAnswerError",
]


class CompaxError(Exception):
    """
    Root of all that compax_aio raises on purpose.

    Attributes:
        what: What happened, in one clause.
        device: Name of the drive or line it happened on, or None.
        sent: The line that was sent, without its CR, or None if nothing was sent.
        received: What came back, as text, or None if nothing came.
        hint: What to do next, or None.
        code: The device's own error number (``E92`` is 92), or None.
        exchanges: The last exchanges of that line, oldest first, readable.
    """

    def __init__(
        self,
        what: str,
        *,
        device: str | None = None,
        sent: str | None = None,
        received: str | None = None,
        hint: str | None = None,
        code: int | None = None,
        exchanges: tuple[str, ...] = (),
    ) -> None:
        super().__init__(what)
        self.what = what
        self.device = device
        self.sent = sent
        self.received = received
        self.hint = hint
        self.code = code
        self.exchanges = exchanges

    def __str__(self) -> str:
        """Say where, what, what was sent and received, and what to do."""
        what = escaped(self.what, keep="\n")  # a listing has an error a line
        text = f"{escaped(self.device)}: {what}" if self.device else what
        if self.sent is not None:
            text += f"; sent {self.sent!r}"
        if self.received is not None:
            text += f"; received {self.received!r}"
        if self.hint:
            text += f"; {escaped(self.hint)}"
        return text


class TransportError(CompaxError):
    """The line could not be opened, or failed."""


class ConnectionLostError(TransportError):
    """An open line went away."""


class AnswerTimeoutError(CompaxError):
    """The device did not answer in time."""


class CommandRejectedError(CompaxError):
    """The device answered a command with an error."""


class InvalidCommandError(CompaxError, ValueError):
    """The device cannot be told this; nothing was sent."""


class UnexpectedAnswerError(CompaxError):
    """The device answered something that is no answer to what was sent."""


class RestoreIncompleteError(CompaxError):
    """
    A restore stopped half way.

    Attributes:
        applied: By number, what the drive had before and what it has now, read back.
        not_applied: Numbers that the drive still has as before: it refused them, or was not told.
        uncertain: By number, what the drive had before and what was sent; what it has now is not known.
        kind: Of what: ``"parameters"``, ``"variables"`` or ``"program"``.
    """

    def __init__(
        self,
        what: str,
        *,
        applied: Mapping[int, tuple[Any, Any]] | None = None,
        not_applied: tuple[int, ...] = (),
        uncertain: Mapping[int, tuple[Any, Any]] | None = None,
        kind: str = "",
        **more: Any,
    ) -> None:
        super().__init__(what, **more)
        self.applied = dict(applied or {})
        self.not_applied = not_applied
        self.uncertain = dict(uncertain or {})
        self.kind = kind


class LinkProtocolError(CompaxError):
    """A line protocol was used out of turn: a defect in the code that drives it."""


class MoveError(CompaxError):
    """A move did not end at its target."""


class MoveActiveError(MoveError, InvalidCommandError):
    """A move is running on that drive; the new one was not sent."""


class MoveStoppedError(MoveError):
    """The move was stopped on the way."""


class DriveFaultError(MoveError):
    """The drive reports a fault."""


class MoveTimeoutError(MoveError):
    """The move took longer than allowed, or the axis stands still without having arrived."""


class MoveInDoubtError(MoveError):
    """Whether the move was carried out is not known; the drive takes no motion until ``reconcile()``."""
