"""How a cutter keeps its buffer from overflowing: presets, thresholds, and what goes with which output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final

__all__ = [
    "OUTPUT_RULES",
    "PRESETS",
    "RESET_EXPANSION",
    "AckRule",
    "OutputKind",
    "OutputRule",
    "PowerOnHandshake",
    "Preset",
    "XonRule",
    "xon_when_stored",
]


class PowerOnHandshake(Enum):
    """What rules after power-on (PNC-900 p. 5, 24: chosen with SW-6)."""

    HARDWIRE = "hardwire"
    XONXOFF = "xonxoff"
    DUMMY = "dummy"


class AckRule(Enum):
    """When ENQ is acknowledged, free space against block size."""

    ABOVE = "gt"
    """Free space is larger (PNC-1610 p. 28)."""
    AT_LEAST = "ge"
    """Free space is at least as large (HP7470 p. 10-16)."""


class XonRule(Enum):
    """When Xon is sent after an Xoff. Of no CAMM-1 is it known."""

    HALF = "half"
    """``min(size // 2, size - 1 - P1)`` stored: the general form of the others, by inference."""
    FREE_ABOVE_512 = "free>512"
    """DXY-1000, 1024 bytes (DXY p. 5-12)."""
    STORED_128 = "stored<=128"
    """HP 7470A, 255 bytes: stored ≤ 128; if P1 > 128, once free ≥ P1 + 1 (HP7470 p. 10-20)."""
    STORED_512 = "stored<=512"
    """HP 7475A, 1024 bytes: stored ≤ 512; if P1 > 512, stored ≤ size - (P1 + 1) (grblHAL HPGL plugin)."""


def xon_when_stored(rule: XonRule, size_bytes: int, threshold_bytes: int) -> int:
    """Return at how many stored bytes, or fewer, Xon is sent; never below 0."""
    if rule is XonRule.FREE_ABOVE_512:
        return max(0, size_bytes - 513)
    if rule is XonRule.HALF:
        return max(0, min(size_bytes // 2, size_bytes - 1 - threshold_bytes))
    level = 128 if rule is XonRule.STORED_128 else 512
    return max(0, level if threshold_bytes <= level else size_bytes - (threshold_bytes + 1))


# Presets of .P -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Preset:
    """One preset of ``.P`` and what it stands for, without ``ESC .`` (PNC-1610 p. 29; DXY-1150A p. 36)."""

    number: int
    name: str
    stands_for: tuple[str, ...]
    trap: str = ""


PRESETS: Final[Mapping[int, Preset]] = MappingProxyType(
    {
        row.number: row
        for row in (
            Preset(
                number=0, name="ENQ/ACK dummy", stands_for=("I:", "M:", "N:", "@:"),
                trap="the default of .@ turns the DTR handshake on as well",
            ),
            Preset(
                number=1, name="Xon/Xoff", stands_for=("I80;;17:", "M50;;10;13:", "N10;19:", "@;0:"),
                trap="after every reply, data is dropped until an LF",
            ),
            Preset(
                number=2, name="ENQ/ACK mode 2", stands_for=("I80;5;6:", "M;17;10;13:", "N:", "@;0:"),
                trap="a reply waits for DC1, and after it data is dropped until an LF",
            ),
            Preset(number=3, name="hardwire", stands_for=("I:", "M:", "N:", "@;1:")),
        )
    }
)  # fmt: skip
"""The traps are inferred from the table."""

RESET_EXPANSION: Final = ("J", "M:", "N:", "H:", "I:", "@:")
"""What ``.R`` is the same as (PNC-900 p. 21); data and errors stay, by inference."""


# Output --------------------------------------------------------------------------------------------------------------


class OutputKind(Enum):
    """What a cutter sends."""

    REPLY = "reply"
    """To ``.B .E .L .O .A`` and to ``OA OC OE …``."""
    ACK_MODE_1 = "acknowledgement or immediate response, mode 1"
    ACK_MODE_2 = "acknowledgement or immediate response, mode 2"
    XON_XOFF = "Xon or Xoff"
    DUMMY_ACK = "acknowledgement of the dummy handshake"


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputRule:
    """Which settings of ``.M`` and ``.N`` apply."""

    trigger: bool = False
    turnaround: bool = False
    echo_terminator: bool = False
    initiator: bool = False
    terminator: bool = False
    intercharacter: bool = False


OUTPUT_RULES: Final[Mapping[OutputKind, OutputRule]] = MappingProxyType(
    {
        OutputKind.REPLY: OutputRule(
            trigger=True, turnaround=True, echo_terminator=True, initiator=True, terminator=True, intercharacter=True
        ),
        OutputKind.ACK_MODE_1: OutputRule(
            trigger=True, turnaround=True, echo_terminator=True, terminator=True, intercharacter=True
        ),
        OutputKind.ACK_MODE_2: OutputRule(turnaround=True, intercharacter=True),
        OutputKind.XON_XOFF: OutputRule(intercharacter=True),
        OutputKind.DUMMY_ACK: OutputRule(turnaround=True),
    }
)
"""HP7470 p. 10-29, 10-30; Automove p. 6-11, which has no delay between the characters of Xon and Xoff."""
