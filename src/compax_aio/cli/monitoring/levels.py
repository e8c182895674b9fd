"""How much something wants to be seen: by a sign and a colour, so that either is enough."""

from __future__ import annotations

from enum import Enum

__all__ = ["Level"]


class Level(Enum):
    """How much something wants to be seen."""

    QUIET = "■"
    """All is as it should be, and nothing moves."""
    ACTIVE = "◆"
    """Something moves, or was done."""
    WAITING = "…"
    """Something is awaited."""
    ATTENTION = "△"
    """Somebody should know before going on."""
    ALARM = "▲"
    """Somebody should do something."""

    @property
    def sign(self) -> str:
        """One character that says it without colour."""
        return self.value
