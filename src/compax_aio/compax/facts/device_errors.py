"""The error codes that the pages at hand explain (UG p. 209, 211); the manual's own list was not available."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = [
    "DEVICE_ERRORS",
    "FAULT_CODES",
    "HISTORY_ACKNOWLEDGED",
    "HISTORY_POWERED_ON",
    "DeviceError",
    "device_error",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceError:
    """One error code of the drive."""

    code: int
    meaning: str
    remedy: str
    page: int | None
    """Of the User Guide; None where the code is not in our table."""

    def __str__(self) -> str:
        """Write ``E92: a move is already active; …``."""
        where = f" (p. {self.page})" if self.page else ""
        return f"E{self.code}: {self.meaning}; {self.remedy}{where}"


DEVICE_ERRORS: Final = (
    DeviceError(code=53, meaning="overload of motor or unit", remedy="reduce load or duty, then quit()", page=209),
    DeviceError(code=55, meaning="emergency stop", remedy="release the emergency stop, then quit()", page=209),
    DeviceError(code=92, meaning="a move is already active", remedy="await it or stop it first", page=209),
)

FAULT_CODES: Final = range(1, 58)
"""E1-E57, as printed: a fault, S16 bit 1 = 0, positioning refused (UG p. 209)."""

HISTORY_ACKNOWLEDGED: Final = 99
"""In S18: the error before this mark was acknowledged (UG p. 209)."""

HISTORY_POWERED_ON: Final = 98
"""In S18: power came back while the error before this mark was present (UG p. 209)."""

_BY_CODE: Final = {row.code: row for row in DEVICE_ERRORS}


def device_error(code: int) -> DeviceError:
    """Find the row of *code*; for a code that no page at hand explains, a row that says so."""
    return _BY_CODE.get(code) or DeviceError(
        code=code,
        meaning="a fault that is not in our table" if code in FAULT_CODES else "not in our table",
        remedy="look it up in the error list of the drive's manual",
        page=None,
    )
