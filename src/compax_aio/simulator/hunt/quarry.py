"""What is hunted: how a scenario of it is drawn, run, held against the promises, and told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from .drawing import draw_scenario
from .promises import Broken, broken
from .simulation import simulate
from .story import story

__all__ = ["COMPAX", "Quarry"]


@dataclass(frozen=True, slots=True)
class Quarry:
    """One kind of device, with all that a hunt needs of it."""

    device: str
    """What the command line calls it."""
    draw: Callable[[int], Any]
    """A scenario from a seed."""
    simulate: Callable[[Any], Any]
    """What was seen of a scenario."""
    broken: Callable[[Any], list[Broken]]
    """What is wrong with it."""
    story: Callable[..., str]
    """Both, for people; see :func:`~compax_aio.simulator.hunt.story.story`."""


COMPAX: Final = Quarry("compax", draw_scenario, simulate, broken, story)
