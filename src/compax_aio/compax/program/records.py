"""What one record of the program memory says, typed; and a program: its records by number (UG p. 95)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeAlias

__all__ = [
    "Acceleration",
    "Assign",
    "Deceleration",
    "End",
    "Gosub",
    "GosubExternal",
    "Goto",
    "GotoExternal",
    "IfCompare",
    "IfError",
    "IfInputs",
    "IfStop",
    "Jump",
    "Loop",
    "MoveBy",
    "MoveByCam",
    "MoveHome",
    "MoveTo",
    "Number",
    "Operand",
    "Outputs",
    "Parameter",
    "Password",
    "Power",
    "PreparedOutput",
    "PreparedSpeed",
    "Program",
    "Record",
    "Repeat",
    "Return",
    "Speed",
    "SpeedSync",
    "Status",
    "Value",
    "Variable",
    "Wait",
    "WaitDistance",
    "WaitPosition",
    "WaitStart",
]

# Operands -------------------------------------------------------------------------------------------------------------

Number: TypeAlias = Decimal | int
"""Exact, as the drive takes decimals: write ``Decimal("0.1")``."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Pn: P40-P49 in place of a number (``.P40``), P1-P250 in comparisons and assignments (UG p. 100, IBS p. 56)."""

    number: int


@dataclass(frozen=True, slots=True)
class Variable:
    """Vn, V1-V39; ``.V1`` in place of a number (UG p. 100)."""

    number: int


@dataclass(frozen=True, slots=True)
class Status:
    """Sn, S1-S39, in comparisons and assignments (IBS p. 56)."""

    number: int


Operand: TypeAlias = Number | Parameter | Variable
"""What may stand for a number (UG p. 100)."""

Value: TypeAlias = Number | Parameter | Variable | Status
"""What may be compared and calculated with (IBS p. 56)."""


# Settings and positioning ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Acceleration:
    """ACCEL: time in ms from standstill to nominal speed, whole, 0-65 000 (IBS p. 48)."""

    time_ms: Operand


@dataclass(frozen=True, slots=True)
class Deceleration:
    """ACCEL-: braking time in ms from nominal speed, whole, 0-65 000 (IBS p. 48); in programs inferred."""

    time_ms: Operand


@dataclass(frozen=True, slots=True)
class Speed:
    """SPEED, or SPEED WAIT: in % of nominal speed, above 0 to 600, 3 decimals (IBS p. 42); then wait, in ms."""

    percent: Operand
    wait_ms: Operand | None = None


@dataclass(frozen=True, slots=True)
class SpeedSync:
    """SPEED SYNC: speed from an external encoder (UG p. 124, name only)."""


@dataclass(frozen=True, slots=True)
class MoveTo:
    """POSA: an absolute position in the axis's own unit, ±4 000 000, 2 decimals, 3 with inches (UG p. 100)."""

    position: Operand


@dataclass(frozen=True, slots=True)
class MoveHome:
    """POSA HOME: find machine zero (UG p. 162)."""


@dataclass(frozen=True, slots=True)
class MoveBy:
    """POSR: a distance in the axis's own unit, ±4 000 000, 2 decimals, 3 with inches (UG p. 100)."""

    distance: Operand


@dataclass(frozen=True, slots=True)
class MoveByCam:
    """POSR CAM, XX70 only (CAN p. 59)."""


@dataclass(frozen=True, slots=True)
class PreparedSpeed:
    """
    POSR SPEED, or POSR SPEED ACCEL: a speed step of the next positioning (UG p. 101, IBS p. 43).

    *distance* counts from the start and is positive; *percent* is whole, 1-600; *ramp_ms* whole, 0-65 000.
    """

    distance: Operand
    percent: Operand
    ramp_ms: Operand | None = None


@dataclass(frozen=True, slots=True)
class PreparedOutput:
    """POSR OUTPUT: at a positive *distance* of the next positioning, set one of O1-O16 to 0 or 1 (UG p. 101)."""

    distance: Operand
    output: int
    level: bool


@dataclass(frozen=True, slots=True)
class Loop:
    """LOOP: a positioning command (UG p. 162); what it does stands on no page at hand."""

    count: Operand


# Waiting and outputs --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Wait:
    """WAIT: in ms, whole (UG p. 95)."""

    time_ms: Operand


@dataclass(frozen=True, slots=True)
class WaitStart:
    """WAIT START: until a start signal (CAN-S p. 28)."""


@dataclass(frozen=True, slots=True)
class WaitPosition:
    """WAIT POSA: cut to length, XX50 only; in the axis's own unit (IBS p. 39)."""

    position: Operand


@dataclass(frozen=True, slots=True)
class WaitDistance:
    """WAIT POSR: cut to length, XX50 only; in the axis's own unit (IBS p. 40)."""

    distance: Operand


@dataclass(frozen=True, slots=True)
class Outputs:
    """OUTPUT Ox=y: 1 to 8 outputs of O1-O16, from Ox = *first* on (CAN p. 59)."""

    first: int
    levels: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Power:
    """OUTPUT O0=y: the drive and its brake; y is 0, 1 or 2 (UG p. 162, 209)."""

    mode: int


# The way through the program ------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Goto:
    """GOTO: on with record 1-250 (UG p. 95)."""

    record: int


@dataclass(frozen=True, slots=True)
class Gosub:
    """GOSUB: call record 1-250; RETURN comes back (CAN p. 59)."""

    record: int


Jump: TypeAlias = Goto | Gosub
"""What an IF may do."""


@dataclass(frozen=True, slots=True)
class GotoExternal:
    """GOTO EXT: on with the record that inputs choose (CAN p. 59)."""


@dataclass(frozen=True, slots=True)
class GosubExternal:
    """GOSUB EXT: call the record that inputs choose (CAN p. 59)."""


@dataclass(frozen=True, slots=True)
class Password:
    """GOTO 302, 270 or 620: remove, restore, remove at the second level; no jump (CAN p. 32)."""

    number: int


@dataclass(frozen=True, slots=True)
class Return:
    """RETURN: back from a GOSUB (CAN p. 59)."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """REPEAT: what follows, up to its END, that many times (UG p. 95)."""

    count: Operand


@dataclass(frozen=True, slots=True)
class End:
    """END: of the innermost REPEAT that is open, else of the program (UG p. 95)."""


@dataclass(frozen=True, slots=True)
class IfInputs:
    """IF Ix=y: jump if 1 to 8 inputs of I1-I16, from Ix = *first* on, are so (UG p. 95, CAN p. 59)."""

    first: int
    levels: tuple[bool, ...]
    jump: Jump


@dataclass(frozen=True, slots=True)
class IfError:
    """IF ERROR: where to go after an error (CAN p. 59)."""

    jump: Jump


@dataclass(frozen=True, slots=True)
class IfStop:
    """IF STOP: where to go after a stop (CAN p. 59)."""

    jump: Jump


@dataclass(frozen=True, slots=True)
class IfCompare:
    """IF a op b: *comparison* is one of ``= < > <= >= <>`` (IBS p. 56)."""

    left: Value
    comparison: str
    right: Value
    jump: Jump


@dataclass(frozen=True, slots=True)
class Assign:
    r"""Pn or Vn = a, or = a op b, where *operation* is one of ``+ - * / \ %`` (IBS p. 56)."""

    target: Parameter | Variable
    left: Value
    operation: str | None = None
    right: Value | None = None


Record: TypeAlias = (
    Acceleration
    | Deceleration
    | Speed
    | SpeedSync
    | MoveTo
    | MoveHome
    | MoveBy
    | MoveByCam
    | PreparedSpeed
    | PreparedOutput
    | Loop
    | Wait
    | WaitStart
    | WaitPosition
    | WaitDistance
    | Outputs
    | Power
    | Goto
    | Gosub
    | GotoExternal
    | GosubExternal
    | Password
    | Return
    | Repeat
    | End
    | IfInputs
    | IfError
    | IfStop
    | IfCompare
    | Assign
)
"""One command of the program memory."""


class Program(Mapping[int, Record]):
    """
    Records by number (1-250), in the order of their numbers; it does not change.

    ``program | {5: End()}`` gives a new one. Nothing is checked here: that is what ``check()`` is for.
    """

    __slots__ = ("_records",)

    def __init__(self, records: Mapping[int, Record] | None = None) -> None:
        self._records: dict[int, Record] = dict(sorted((records or {}).items()))

    def __getitem__(self, number: int) -> Record:
        return self._records[number]

    def __iter__(self) -> Iterator[int]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    def __or__(self, other: Mapping[int, Record]) -> Program:
        return Program({**self, **other})

    def __repr__(self) -> str:
        return f"Program({self._records!r})"
