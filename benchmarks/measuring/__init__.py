"""How figures are measured: interleaved rounds, the far end in a process of its own, and what the machine did."""

from __future__ import annotations

from .effort import FULL, LEAST, SHORT, Effort
from .far_end_process import FarEnd, far_end, stay
from .figures import Figure, Row, Target, above, at_least, at_most
from .loops import LOOPS, fastest_loop
from .machine import Machine, Noise
from .rounds import Measured, Results, interleaved, interleaved_async
from .spread import spread_of

__all__ = [
    "FULL",
    "LEAST",
    "LOOPS",
    "SHORT",
    "Effort",
    "FarEnd",
    "Figure",
    "Machine",
    "Measured",
    "Noise",
    "Results",
    "Row",
    "Target",
    "above",
    "at_least",
    "at_most",
    "far_end",
    "fastest_loop",
    "interleaved",
    "interleaved_async",
    "spread_of",
    "stay",
]
