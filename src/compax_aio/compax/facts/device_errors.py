"""The error codes that the pages at hand explain (UG p. 209, 211); the manual's own list was not available."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = [
    "DEVICE_ERRORS",
    "ERROR_RANGES",
    "FAULT_CODES",
    "HISTORY_ACKNOWLEDGED",
    "HISTORY_POWERED_ON",
    "MOVE_ACTIVE_CODE",
    "DeviceError",
    "ErrorRange",
    "device_error",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceError:
    """One error code of the drive."""

    code: int
    meaning: str
    cause: str | None = None
    """What brings it about; None where no page at hand says it."""
    remedy: str
    page: int | None
    """Of the User Guide; None where the code is not in our table."""
    certainty: Certainty = Certainty.DOCUMENTED
    """Of meaning and cause."""

    def __str__(self) -> str:
        """Write ``E92: a move is already active; …``."""
        where = f" (p. {self.page})" if self.page else ""
        return f"E{self.code}: {self.meaning}; {self.remedy}{where}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorRange:
    """What is known of all codes of a range."""

    codes: range
    meaning: str
    effect: str
    remedy: str
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


MOVE_ACTIVE_CODE: Final = 92
"""Answers a positioning command while another one runs (UG p. 162, 209)."""

DEVICE_ERRORS: Final = (
    DeviceError(
        code=10,
        meaning="a fault that the pages at hand name and do not explain",
        remedy="look it up in the error list of the drive's manual, then quit()",
        page=209,
        certainty=Certainty.UNKNOWN,
    ),
    DeviceError(
        code=53,
        meaning="overload of motor or unit",
        cause="the effective load of motor or unit has reached 100 % (quantities 29 and 30 of S13 to S15)",
        remedy="reduce load or duty, then quit()",
        page=211,
    ),
    DeviceError(code=55, meaning="emergency stop", remedy="release the emergency stop, then quit()", page=209),
    DeviceError(
        code=MOVE_ACTIVE_CODE,
        meaning="a move is already active",
        cause="a positioning command came while S17 bit 3 was 1",
        remedy="await it or stop it first",
        page=209,
    ),
)

FAULT_CODES: Final = range(1, 58)
"""E1-E57, as printed: a fault, S16 bit 1 = 0, positioning refused (UG p. 209)."""

HISTORY_ACKNOWLEDGED: Final = 99
"""In S18: the error before this mark was acknowledged (UG p. 209)."""

HISTORY_POWERED_ON: Final = 98
"""In S18: power came back while the error before this mark was present (UG p. 209)."""

ERROR_RANGES: Final = (
    ErrorRange(
        codes=FAULT_CODES,
        meaning="fault",
        effect="S16 bit 1 is 0, and no positioning command is accepted",
        remedy="mend the cause, then quit(); some want power off and on, and which is not known",
        source="UG p. 209",
    ),
    ErrorRange(
        codes=range(58, HISTORY_POWERED_ON),
        meaning="in S18 and S30 a warning, as an answer a refusal",
        effect="a warning: S16 bit 2 is 0; a refusal: the line was not carried out, and the drive runs on",
        remedy="look it up in the error list of the drive's manual",
        source="UG p. 209",
        certainty=Certainty.INFERRED,
    ),
    ErrorRange(
        codes=range(HISTORY_POWERED_ON, HISTORY_POWERED_ON + 1),
        meaning="in S18 a mark, no error",
        effect="power came back while the error before it was present",
        remedy="",
        source="UG p. 209",
    ),
    ErrorRange(
        codes=range(HISTORY_ACKNOWLEDGED, HISTORY_ACKNOWLEDGED + 1),
        meaning="in S18 a mark, no error",
        effect="the error before it was acknowledged",
        remedy="",
        source="UG p. 209",
    ),
)
"""
The page prints "E57" for warnings too; most likely "greater than" was lost in front of it. That refusals have codes of
their own is inferred from E92, the one refusal that is documented.
"""

_BY_CODE: Final = {row.code: row for row in DEVICE_ERRORS}


def device_error(code: int) -> DeviceError:
    """Find the row of *code*; for a code that no page at hand explains, a row that says so."""
    return _BY_CODE.get(code) or DeviceError(
        code=code,
        meaning="a fault that is not in our table" if code in FAULT_CODES else "not in our table",
        remedy="look it up in the error list of the drive's manual",
        page=None,
        certainty=Certainty.UNKNOWN,
    )
