"""
Device control instructions, ``ESC .`` and a letter: as values, as bytes, and out of any stream of bytes.

An instruction is what it sets, with the default for whatever is left out; how short it is written changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import ClassVar, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.instructions import CONTROL_INSTRUCTIONS, MAX_SIGNS, SAFE_CODE, Kind
from .profiles import Profile

__all__ = [
    "CONTROLS",
    "AbortCutting",
    "AbortOutput",
    "AllocateMemory",
    "AskBufferSize",
    "AskError",
    "AskFreeSpace",
    "AskModel",
    "AskStatus",
    "BlockHandshake",
    "Control",
    "DtrControl",
    "EnqAckMode1",
    "PresetHandshake",
    "ProgrammedOff",
    "ProgrammedOn",
    "ReplyFormat",
    "Reset",
    "SignFormat",
    "encode",
    "from_parameters",
]

_HEAD: Final = b"\x1b."


@dataclass(frozen=True, slots=True)
class Control:
    """One device control instruction; its fields are its parameters, in order."""

    letter: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Refuse what is out of range, before a byte is written."""
        for number, (row, value) in enumerate(
            zip(CONTROL_INSTRUCTIONS[self.letter].parameters, self.parameters, strict=True), start=1
        ):
            highest = min(row.highest, SAFE_CODE) if row.kind is Kind.CHARACTER else row.highest
            if type(value) is not int or not row.lowest <= value <= highest:
                raise InvalidCommandError(
                    f"P{number} of ESC.{self.letter}, {row.meaning}, is a whole number from {row.lowest} to {highest} "
                    f"({row.source}), not {shown(value)}"
                )

    @property
    def parameters(self) -> tuple[int, ...]:
        """All of its numbers, P1 first; a string of characters is filled up with 0."""
        values: list[int] = []
        for each in fields(self):
            value = getattr(self, each.name)
            values += _padded(self.letter, value) if each.name == "signs" else [value]
        return tuple(values)


def _padded(letter: str, signs: object) -> list[int]:
    if not isinstance(signs, bytes | tuple) or len(signs) > MAX_SIGNS or 0 in signs:
        raise InvalidCommandError(
            f"the string of ESC.{letter} has at most {MAX_SIGNS} characters, none of them 0 (HP7470 p. 10-30), "
            f"not {shown(signs)}"
        )
    return [*signs, *[0] * (MAX_SIGNS - len(signs))]


# Without parameters ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AskFreeSpace(Control):
    """``.B``: how many bytes of the data buffer are free, counting all that was sent before it (PNC-1610 p. 28)."""

    letter: ClassVar[str] = "B"


@dataclass(frozen=True, slots=True)
class AskModel(Control):
    """``.A``: the model number (PNC-1610 p. 29)."""

    letter: ClassVar[str] = "A"


@dataclass(frozen=True, slots=True)
class AskStatus(Control):
    """``.O``: whether data is left, and whether the machine is paused (PNC-1610 p. 29; PNC-900 p. 20)."""

    letter: ClassVar[str] = "O"


@dataclass(frozen=True, slots=True)
class AskError(Control):
    """``.E``: the error of the line, which reading clears (PNC-900 p. 21)."""

    letter: ClassVar[str] = "E"


@dataclass(frozen=True, slots=True)
class AskBufferSize(Control):
    """``.L``: the size of the buffer; on some machines answered only once it is empty (PNC-900 p. 21; DPX p. 45)."""

    letter: ClassVar[str] = "L"


@dataclass(frozen=True, slots=True)
class AbortOutput(Control):
    """``.J``: drop output that waits or is on its way (PNC-900 p. 21)."""

    letter: ClassVar[str] = "J"


@dataclass(frozen=True, slots=True)
class AbortCutting(Control):
    """``.K``: finish the cutting instruction in progress, drop all later ones (PNC-900 p. 21)."""

    letter: ClassVar[str] = "K"


@dataclass(frozen=True, slots=True)
class Reset(Control):
    """``.R``: as ``.J .M: .N: .H: .I: .@:``; data and errors stay (PNC-900 p. 21)."""

    letter: ClassVar[str] = "R"


@dataclass(frozen=True, slots=True)
class ProgrammedOn(Control):
    """``.(``: HP alone (HP7470 p. 10-23)."""

    letter: ClassVar[str] = "("


@dataclass(frozen=True, slots=True)
class ProgrammedOff(Control):
    """``.)``: HP alone (HP7470 p. 10-23)."""

    letter: ClassVar[str] = ")"


# With parameters ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ReplyFormat(Control):
    """
    ``.M``: how replies are framed (PNC-1610 p. 28). Characters are codes; 0 is none.

    With a second terminator there is no initiator, and the other way round.
    """

    letter: ClassVar[str] = "M"
    turnaround_ms: int = 0
    trigger: int = 0
    echo_terminator: int = 0
    terminator: int = 13
    second_terminator: int = 0
    initiator: int = 0

    def __post_init__(self) -> None:
        """Refuse what is out of range, and what excludes each other."""
        Control.__post_init__(self)
        if self.second_terminator and self.initiator:
            raise InvalidCommandError(
                "replies have a second terminator or an initiator, not both (PNC-1610 p. 28)",
                hint="leave one of them 0",
            )


@dataclass(frozen=True, slots=True)
class SignFormat(Control):
    """``.N``: the delay between characters, and the Xoff or immediate string (PNC-1610 p. 28; DXY p. 5-19)."""

    letter: ClassVar[str] = "N"
    intercharacter_ms: int = 0
    signs: bytes = b""


@dataclass(frozen=True, slots=True)
class EnqAckMode1(Control):
    """``.H``: ENQ is acknowledged when a block has room, dressed as ``.M`` says (PNC-1610 p. 28); bare, the dummy."""

    letter: ClassVar[str] = "H"
    block_bytes: int = 80
    enquiry: int = 0
    signs: bytes = b""


@dataclass(frozen=True, slots=True)
class BlockHandshake(Control):
    """``.I``: Xon/Xoff if *enquiry* is 0, else ENQ/ACK mode 2 (PNC-1610 p. 29); bare, the dummy."""

    letter: ClassVar[str] = "I"
    block_bytes: int = 80
    enquiry: int = 0
    signs: bytes = b""


@dataclass(frozen=True, slots=True)
class DtrControl(Control):
    """``.@``: whether DTR follows the free space (*dtr* is odd), and a logical buffer size (PNC-900 p. 20)."""

    letter: ClassVar[str] = "@"
    buffer_bytes: int = 1024
    dtr: int = 1


@dataclass(frozen=True, slots=True)
class PresetHandshake(Control):
    """``.P``: one of four presets, which have traps: see ``facts.handshakes.PRESETS`` (PNC-1610 p. 29)."""

    letter: ClassVar[str] = "P"
    preset: int = 0


@dataclass(frozen=True, slots=True)
class AllocateMemory(Control):
    """``.T``: HP 7550A alone (cursor)."""

    letter: ClassVar[str] = "T"
    io_bytes: int = 0
    polygon_bytes: int = 0
    character_bytes: int = 0
    replot_bytes: int = 0
    vector_bytes: int = 0


_CLASSES: Final[tuple[type[Control], ...]] = (
    AskFreeSpace, AskModel, AskStatus, AskError, AskBufferSize, AbortOutput, AbortCutting, Reset, ProgrammedOn,
    ProgrammedOff, ReplyFormat, SignFormat, EnqAckMode1, BlockHandshake, DtrControl, PresetHandshake, AllocateMemory,
)  # fmt: skip

CONTROLS: Final[Mapping[str, type[Control]]] = MappingProxyType(
    {each.letter: each for each in _CLASSES} | {"Y": ProgrammedOn, "Z": ProgrammedOff}
)
"""By letter; ``.Y`` is ``.(`` and ``.Z`` is ``.)``."""


def from_parameters(letter: str, values: list[int | None]) -> Control:
    """
    Return the instruction of *letter* with these numbers, P1 first; None and what is missing are the default.

    A string ends at the first 0; of a second terminator and an initiator, the initiator wins, by inference.

    Raises:
        InvalidCommandError: A number is out of range.
    """
    cls, rows = CONTROLS[letter], CONTROL_INSTRUCTIONS[letter].parameters
    given = [*values, *[None] * (len(rows) - len(values))]
    numbers = [row.default if value is None else value for row, value in zip(rows, given, strict=True)]
    arguments: dict[str, object] = {}
    for index, each in enumerate(fields(cls)):
        if each.name != "signs":
            arguments[each.name] = numbers[index]
        else:
            signs = numbers[index:]
            signs = signs[: signs.index(0)] if 0 in signs else signs
            arguments["signs"] = bytes(signs) if max(signs, default=0) < 256 else tuple(signs)
    if cls is ReplyFormat and arguments["initiator"]:
        arguments["second_terminator"] = 0
    return cls(**arguments)


def encode(control: Control, profile: Profile | None = None, *, explicit: bool = False) -> bytes:
    """
    Return the bytes of a device control instruction.

    Args:
        control: What to say.
        profile: The machine: what it does not have is refused, and a colon is written where its manual prints one.
        explicit: Write every parameter, defaults too; else as few as say the same.

    Raises:
        InvalidCommandError: That machine has no such instruction, or not with that threshold.
    """
    row = CONTROL_INSTRUCTIONS[control.letter]
    if profile is not None:
        _check_for(control, profile)
    head = _HEAD + control.letter.encode()
    if not row.takes_parameters:
        return head + (b":" if profile is not None and control.letter in profile.colons else b"")
    pairs = zip(row.parameters, control.parameters, strict=True)
    texts = [str(value) if explicit or value != each.default else "" for each, value in pairs]
    while texts and not texts[-1]:
        texts.pop()
    return head + ";".join(texts).encode() + b":"


def _check_for(control: Control, profile: Profile) -> None:
    if control.letter not in profile.controls:
        raise InvalidCommandError(
            f"{profile.name} has no ESC.{control.letter}",
            hint="if it is known to have it, add the letter to 'controls' of its profile",
        )
    if (
        isinstance(control, BlockHandshake)
        and not control.enquiry
        and control.signs
        and control.block_bytes < profile.lowest_threshold
    ):
        raise InvalidCommandError(
            f"Xoff is sent by {profile.name} at {profile.lowest_threshold} free bytes or more, "
            f"not at {control.block_bytes}"
        )
