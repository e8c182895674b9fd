"""The hunt on a party line, as the command line and the tests hold it."""

from __future__ import annotations

from typing import Final

from ..hunt.quarry import Quarry
from .drawing import draw_party
from .promises import broken_on_line
from .simulation import simulate_party
from .story import party_story

__all__ = ["SMC"]

SMC: Final = Quarry("smc", draw_party, simulate_party, broken_on_line, party_story)
