"""The commands of the program memory: N001 to N250, one command each (UG p. 95, 100-101; sources by row)."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from typing import Final

from .certainty import Certainty
from .limits import MAX_ACCELERATION_TIME_MS, MAX_POSITION, MAX_SPEED_PERCENT, SPEED_DECIMALS

__all__ = [
    "ARITHMETIC_SIGNS",
    "COMPARISON_SIGNS",
    "CONTROL_PARAMETERS",
    "GERMAN_LETTERS",
    "INPUT_NUMBERS",
    "MAX_LEVELS",
    "NUMBERS",
    "PARAMETERS",
    "PASSWORDS",
    "POWER_MODES",
    "PROGRAM_COMMANDS",
    "RECORD_NUMBERS",
    "RECORD_TEMPLATE",
    "STATUS_NUMBERS",
    "SYSTEM_VARIABLES",
    "VARIABLES",
    "NumberFact",
    "ProgramCommandFact",
]

RECORD_NUMBERS: Final = range(1, 251)
"""N001-N250 (UG p. 95)."""

RECORD_TEMPLATE: Final = "N{n:03d}: {text}"
"""How a record is written over RS-232: by the style of the listings (UG p. 95); no page at hand says so. Inferred."""

PASSWORDS: Final = {302: "removes the password protection", 270: "restores it", 620: "removes its second level"}
"""GOTO with these is no jump (CAN p. 32); they lie above the records."""

CONTROL_PARAMETERS: Final = range(40, 50)
"""``.P40``-``.P49`` may stand for a number (UG p. 100)."""

PARAMETERS: Final = range(1, 251)
"""P1-P250 (IBS p. 24), in comparisons and assignments (IBS p. 56)."""

VARIABLES: Final = range(1, 40)
"""``.V1``-``.V39`` may stand for a number (UG p. 100)."""

SYSTEM_VARIABLES: Final = range(50, 71)
"""V50-V70 belong to the cam controller (UG p. 104); that a program may use them is inferred."""

STATUS_NUMBERS: Final = range(1, 40)
"""S1-S39 (IBS p. 12), in comparisons and assignments (IBS p. 56)."""

INPUT_NUMBERS: Final = range(1, 17)
"""I1-I16: I16 is the mark input (UG p. 100); that none lies beyond is inferred."""

MAX_LEVELS: Final = 8
"""Digits of ``Ox=y`` and ``Ix=y``: that many in a row, from x on (CAN p. 59, 61)."""

POWER_MODES: Final = range(3)
"""y of OUTPUT O0=y (UG p. 209)."""

COMPARISON_SIGNS: Final = ("<=", ">=", "<>", "=", "<", ">")
"""IBS p. 56; longer ones first, so that a reader can match them in this order."""

ARITHMETIC_SIGNS: Final = ("+", "-", "*", "/", "\\", "%")
r"""IBS p. 56; ``\`` divides whole numbers, ``%`` is the remainder."""

GERMAN_LETTERS: Final = {"I": "E", "O": "A", "O0": "A0"}
"""Tables print E (Eingang) for I and A (Ausgang) for O in places (CAN p. 59, 61); English text has I and O."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberFact:
    """What number may stand in one place of a command."""

    meaning: str
    unit: str
    low: Decimal
    high: Decimal
    above_low: bool = False
    """Whether *low* itself is too little."""
    decimals: int | None
    """None: as many as the drive's positions, 2, or 3 with inches (UG p. 100)."""
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


_LARGEST: Final = Decimal(8_388_607)
"""A number is 24 bits with sign before the point and 24 behind it (UG p. 167)."""

_POSITION: Final = Decimal(int(MAX_POSITION))
_RAMP: Final = Decimal(MAX_ACCELERATION_TIME_MS)
_SPEED: Final = Decimal(int(MAX_SPEED_PERCENT))
_ZERO: Final = Decimal(0)

NUMBERS: Final = {
    "position": NumberFact(
        meaning="a position", unit="units", low=-_POSITION, high=_POSITION, decimals=None, source="UG p. 100, IBS p. 33"
    ),
    "distance": NumberFact(
        meaning="a distance", unit="units", low=-_POSITION, high=_POSITION, decimals=None, source="UG p. 100, IBS p. 33"
    ),
    "point": NumberFact(
        meaning="the distance of a prepared point",
        unit="units",
        low=_ZERO,
        high=_POSITION,
        above_low=True,
        decimals=None,
        source="UG p. 101",
    ),
    "percent": NumberFact(
        meaning="a speed", unit="%", low=_ZERO, high=_SPEED, above_low=True, decimals=SPEED_DECIMALS, source="IBS p. 42"
    ),
    "step_percent": NumberFact(
        meaning="the speed of a speed step",
        unit="%",
        low=_ZERO,
        high=_SPEED,
        above_low=True,
        decimals=0,
        source="UG p. 101, IBS p. 42",
    ),
    "ramp_ms": NumberFact(
        meaning="an acceleration time", unit="ms", low=_ZERO, high=_RAMP, decimals=0, source="IBS p. 48"
    ),
    "wait_ms": NumberFact(
        meaning="a waiting time",
        unit="ms",
        low=_ZERO,
        high=_LARGEST,
        decimals=0,
        source="UG p. 95, 167",
        certainty=Certainty.INFERRED,
    ),
    "count": NumberFact(
        meaning="a count",
        unit="",
        low=Decimal(1),
        high=_LARGEST,
        decimals=0,
        source="UG p. 95, 167",
        certainty=Certainty.INFERRED,
    ),
    "constant": NumberFact(
        meaning="a constant",
        unit="",
        low=-_LARGEST,
        high=_LARGEST,
        decimals=6,
        source="IBS p. 24, 56, UG p. 167",
        certainty=Certainty.INFERRED,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramCommandFact:
    """
    One form of one program command.

    In braces stand the places for numbers and the like: the names in ``NUMBERS``, where ``.Pn`` and ``.Vn`` may stand
    instead of a number; ``value``: Pn, Vn, Sn or a constant; ``target``: Pn or Vn; ``comparison``, ``arithmetic``: a
    sign; ``jump``: GOTO or GOSUB and a record; ``record``, ``password``, ``output``, ``input``, ``mode``: a plain
    number; ``level``: 0 or 1; ``levels``: 1 to 8 of these.
    """

    long: str
    """As in listings."""
    short: str
    """With the abbreviations of direct mode; the same as *long* where none is known."""
    meaning: str
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


def _row(long: str, meaning: str, source: str, *, short: str = "", inferred: bool = False) -> ProgramCommandFact:
    certainty = Certainty.INFERRED if inferred else Certainty.DOCUMENTED
    return ProgramCommandFact(long=long, short=short or long, meaning=meaning, source=source, certainty=certainty)


PROGRAM_COMMANDS: Final = (
    _row(
        "ACCEL- {ramp_ms}",
        "braking time from nominal speed to standstill, from the next positioning on",
        "UG p. 162, IBS p. 48",
        short="AL- {ramp_ms}",
        inferred=True,
    ),
    _row(
        "ACCEL {ramp_ms}",
        "time from standstill to nominal speed, from the next positioning on",
        "UG p. 95, IBS p. 48, CAN p. 61",
        short="AL {ramp_ms}",
    ),
    _row(
        "SPEED SYNC",
        "speed from an external encoder",
        "UG p. 124, CAN p. 32, name only",
        short="SD SYNC",
        inferred=True,
    ),
    _row("SPEED {percent}", "speed in % of nominal speed", "UG p. 95, CAN p. 61", short="SD {percent}"),
    _row(
        "SPEED {percent} WAIT {wait_ms}",
        "speed, then wait",
        "CAN p. 59, 61",
        short="SD {percent} WAIT {wait_ms}",
    ),
    _row("POSA HOME", "find machine zero", "UG p. 162, CAN p. 61", short="PH"),
    _row("POSA {position}", "move to an absolute position", "UG p. 95, CAN p. 61", short="PA {position}"),
    _row("POSR CAM", "move by a cam (XX70)", "CAN p. 59", short="PR CAM"),
    _row("POSR {distance}", "move by a distance", "UG p. 100, CAN p. 61", short="PR {distance}"),
    _row(
        "POSR {point} SPEED {step_percent}",
        "speed step of the next positioning",
        "UG p. 101, 162",
        short="PR {point} SD {step_percent}",
    ),
    _row(
        "POSR {point} SPEED {step_percent} ACCEL {ramp_ms}",
        "speed step of the next positioning, with its own ramp",
        "IBS p. 43",
        short="PR {point} SD {step_percent} AL {ramp_ms}",
    ),
    _row(
        "POSR {point} OUTPUT O{output}={level}",
        "comparator of the next positioning",
        "UG p. 101, 162",
        short="PR {point} OT O{output}={level}",
    ),
    _row("WAIT POSA {position}", "cut to length (XX50)", "IBS p. 39, CAN p. 61"),
    _row("WAIT POSR {distance}", "cut to length (XX50)", "IBS p. 40, CAN p. 61"),
    _row("WAIT START", "wait for a start signal", "CAN-S p. 28"),
    _row("WAIT {wait_ms}", "wait", "UG p. 95, CAN p. 61"),
    _row("OUTPUT O0={mode}", "switch the drive and its brake", "UG p. 162, 209", short="OT O0={mode}"),
    _row(
        "OUTPUT O{output}={levels}",
        "set 1 to 8 outputs, from O{output} on",
        "UG p. 95, CAN p. 59",
        short="OT O{output}={levels}",
    ),
    _row("GOTO EXT", "jump to the record that inputs choose", "CAN p. 59"),
    _row("GOTO {password}", "password: no jump", "CAN p. 32"),
    _row("GOTO {record}", "jump", "UG p. 95, CAN p. 59"),
    _row("GOSUB EXT", "call the record that inputs choose", "CAN p. 59"),
    _row("GOSUB {record}", "call", "CAN p. 59"),
    _row("RETURN", "back from a call", "CAN p. 59"),
    _row("REPEAT {count}", "repeat what follows up to END", "UG p. 95, CAN p. 61"),
    _row("END", "end of a REPEAT, else of the program", "UG p. 95"),
    _row("LOOP {count}", "a positioning command of unknown meaning", "UG p. 162, CAN p. 59"),
    _row("IF ERROR {jump}", "jump or call after an error", "CAN p. 59"),
    _row("IF STOP {jump}", "jump or call after a stop", "CAN p. 59"),
    _row("IF I{input}={levels} {jump}", "compare 1 to 8 inputs, from I{input} on", "UG p. 95, CAN p. 59"),
    _row("IF {value}{comparison}{value} {jump}", "compare two values", "IBS p. 56"),
    _row("{target}={value}", "assign", "IBS p. 56"),
    _row("{target}={value}{arithmetic}{value}", "calculate", "IBS p. 56"),
)
"""In the order in which a reader tries them: ``ACCEL-250`` is no negative ACCEL, ``GOTO 302`` no jump."""
