"""How bad a finding in a program or a job is."""

from __future__ import annotations

from enum import Enum

__all__ = ["Severity"]


class Severity(Enum):
    """How bad it is."""

    ERROR = "error"
    """The device cannot be told this, or it cannot be meant so."""
    WARNING = "warning"
    """Probably not meant so."""
    NOTE = "note"
    """All right, but read otherwise than it is written."""
