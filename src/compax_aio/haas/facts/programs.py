"""What holds for program files: names, protected programs, limits."""

from __future__ import annotations

from typing import Final

__all__ = [
    "DNC_MAX_LINE_NUMBER",
    "HIGHEST_PROGRAM",
    "LONG_BLOCK_BYTES",
    "MAX_NAME_DIGITS",
    "NAME_DIGITS",
    "PROTECTED_PROGRAMS",
    "TAIL_S",
]

MAX_NAME_DIGITS: Final = 5
"""Behind the O of a name; one to five are read (OpenDNC; four on controls of the 1990s, a knowledge-base article)."""
NAME_DIGITS: Final = 5
"""That are written, unless the profile says four (OpenDNC)."""
HIGHEST_PROGRAM: Final = 99_999
PROTECTED_PROGRAMS: Final = range(8000, 10_000)
"""Probing and the vendor's macros: not to be overwritten (OpenDNC)."""
DNC_MAX_LINE_NUMBER: Final = 100_000
"""About so much; higher N numbers crashed a VF-2 in DNC, without N words it ran (machinists' forums on DNC)."""
LONG_BLOCK_BYTES: Final = 256
"""Longer blocks are told: as much as a receive buffer is taken to hold. No source has a limit (placeholder)."""
TAIL_S: Final = 1.0
"""Silence behind a ``%`` line after which it was the last one (inferred)."""
