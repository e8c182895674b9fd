"""What is remembered of a drive from one move to the next."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Memory"]


@dataclass(slots=True)
class Memory:
    """What is remembered of a drive from one move to the next."""

    messages_owed: int = 0
    """Commands with ``$`` that were sent, less the ``$`` that came."""
    points_prepared: int = 0
    """Speed steps and comparators that the drive holds for a move that was not started."""
    messages_without_prompt: int = 0
    """Commands in a row whose ``$`` came without the prompt that others send first."""
    stored: int = 0
    """Motions that were stored with ``,`` and not executed with ``!``: one of them may be in the drive's memory."""
    doubt: str | None = None
    """Why the drive takes no motion until :meth:`Drive.reconcile`."""
