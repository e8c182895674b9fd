"""How well a fact is founded."""

from __future__ import annotations

from ...certainty import Certainty

__all__ = ["Certainty"]
