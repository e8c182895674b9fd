"""What numbers a COMPAX takes (UG p. 100-101, IBS p. 33-48)."""

from __future__ import annotations

from typing import Final

__all__ = [
    "MAX_ACCELERATION_TIME_MS",
    "MAX_POSITION",
    "MAX_PREPARED_POINTS",
    "MAX_SPEED_PERCENT",
    "OUTPUT_NUMBERS",
    "POSITION_DECIMALS",
    "POSITION_DECIMALS_INCH",
    "SPEED_DECIMALS",
]

POSITION_DECIMALS: Final = 2
"""Decimals of positions and distances in every unit but inches (UG p. 100)."""

POSITION_DECIMALS_INCH: Final = 3
"""Decimals of positions and distances in inches (UG p. 100)."""

MAX_POSITION: Final = 4_000_000.0
"""Largest position or distance either way, in the axis's own unit (UG p. 104, IBS p. 33, about)."""

MAX_PREPARED_POINTS: Final = 8
"""Speed steps and comparators of one positioning, together (UG p. 101)."""

MAX_SPEED_PERCENT: Final = 600.0
"""Of nominal speed: the largest number SPEED takes (IBS p. 42); what the axis bears is less."""

SPEED_DECIMALS: Final = 3
"""Of SPEED; the speed of a speed step has none (IBS p. 42, UG p. 101)."""

MAX_ACCELERATION_TIME_MS: Final = 65_000
"""For ACCEL and ACCEL-, whole milliseconds from 0 on (IBS p. 48)."""

OUTPUT_NUMBERS: Final = range(1, 17)
"""O0 is the power stage and no output of a comparator (UG p. 162); that the others end at O16 is inferred."""
