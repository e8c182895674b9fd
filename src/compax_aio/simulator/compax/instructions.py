"""What a simulated drive can be told, word by word, after its text has been read."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "Acceleration",
    "Assign",
    "Break",
    "ChangeSpeed",
    "Deceleration",
    "ExecuteStored",
    "Instruction",
    "MakeValid",
    "MoveBy",
    "MoveHome",
    "MoveTo",
    "NotSimulated",
    "Nothing",
    "Operand",
    "Outputs",
    "Password",
    "Power",
    "PreparedOutput",
    "PreparedSpeed",
    "Query",
    "Quit",
    "RealZero",
    "SetPointer",
    "Single",
    "Speed",
    "Start",
    "Statement",
    "Stop",
    "WriteRecord",
]


@dataclass(frozen=True, slots=True)
class MoveTo:
    """POSA x."""

    target: float


@dataclass(frozen=True, slots=True)
class MoveBy:
    """POSR d."""

    distance: float


@dataclass(frozen=True, slots=True)
class MoveHome:
    """POSA HOME."""


@dataclass(frozen=True, slots=True)
class PreparedSpeed:
    """POSR d SPEED v, or POSR d SPEED v ACCEL t."""

    distance: float
    percent: float
    time_ms: int | None = None
    """Of the step's own ramp."""


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """POSR 0 SPEED v: the positioning that runs goes on at another speed."""

    percent: float


@dataclass(frozen=True, slots=True)
class PreparedOutput:
    """POSR d OUTPUT Ox=y."""

    distance: float
    output: int
    value: bool


@dataclass(frozen=True, slots=True)
class Speed:
    """SPEED v."""

    percent: float


@dataclass(frozen=True, slots=True)
class Acceleration:
    """ACCEL v."""

    time_ms: int


@dataclass(frozen=True, slots=True)
class Deceleration:
    """ACCEL- v."""

    time_ms: int


@dataclass(frozen=True, slots=True)
class Outputs:
    """OUTPUT Ox=y..., one digit for each output from Ox on."""

    first: int
    values: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Power:
    """OUTPUT O0=0, 1 or 2."""

    mode: int


@dataclass(frozen=True, slots=True)
class Stop:
    """STOP."""


@dataclass(frozen=True, slots=True)
class Start:
    """START."""


@dataclass(frozen=True, slots=True)
class Break:
    """BREAK."""


@dataclass(frozen=True, slots=True)
class Quit:
    """QUIT."""


@dataclass(frozen=True, slots=True)
class Password:
    """GOTO 302, 270 or 620."""

    number: int


@dataclass(frozen=True, slots=True)
class Query:
    """S, P, V or N and a number."""

    kind: str
    number: int


@dataclass(frozen=True, slots=True)
class Operand:
    """A constant, or the parameter, variable or status value that stands for a number."""

    kind: str
    """P, V or S; empty for a constant."""
    number: int
    value: float = 0.0
    """Of a constant."""


@dataclass(frozen=True, slots=True)
class Assign:
    """Pn=a or Vn=a, and perhaps an operator and another operand."""

    kind: str
    number: int
    left: Operand
    operator: str = ""
    right: Operand | None = None


@dataclass(frozen=True, slots=True)
class MakeValid:
    """VP or VC."""

    word: str


@dataclass(frozen=True, slots=True)
class WriteRecord:
    """Nn and the text of a record."""

    record: int
    text: str


@dataclass(frozen=True, slots=True)
class SetPointer:
    """GOTO n or GOTO EXT: START begins there; no record means EXT, which the inputs choose."""

    record: int | None


@dataclass(frozen=True, slots=True)
class Single:
    """SINGLE n: execute one record."""

    record: int


@dataclass(frozen=True, slots=True)
class RealZero:
    """Take the place where the axis is as real zero."""


@dataclass(frozen=True, slots=True)
class NotSimulated:
    """What the manuals name and do not explain, or what takes a variant that this is not."""

    word: str


@dataclass(frozen=True, slots=True)
class ExecuteStored:
    """``!``."""


@dataclass(frozen=True, slots=True)
class Nothing:
    """An empty line."""


Instruction = (
    MoveTo
    | MoveBy
    | MoveHome
    | PreparedSpeed
    | ChangeSpeed
    | PreparedOutput
    | Speed
    | Acceleration
    | Deceleration
    | Outputs
    | Power
    | Stop
    | Start
    | Break
    | Quit
    | Password
    | Query
    | Assign
    | MakeValid
    | WriteRecord
    | SetPointer
    | Single
    | RealZero
    | NotSimulated
    | ExecuteStored
    | Nothing
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """One line: an instruction and its function signs."""

    instruction: Instruction
    reports: bool = False
    """``$``"""
    stores: bool = False
    """``,``"""
    echoes: bool = False
    """``?``"""
