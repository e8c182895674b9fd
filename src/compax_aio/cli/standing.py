"""How a drive stands, as one record and as a picture of it for people: bits with their meaning, numbers with units."""

from __future__ import annotations

from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from ..compax.codecs import DriveStatus
from ..compax.facts.device_errors import DeviceError
from ..compax.facts.status import S16_BITS, S17_BITS, StatusBit

__all__ = ["Standing", "as_line", "as_table"]

_GOOD_WHEN_SET = frozenset({"no_fault", "no_warning"})
_BAD_WHEN_SET = frozenset({"stopped_by_input"})
_NOTHING_KNOWN = frozenset({"reserved", "unused"})


@dataclass(frozen=True, kw_only=True)
class Standing:
    """
    How a drive stands, by readings one after the other.

    What is None was not said by the drive, and stands in *refused*; but for *error*, which is None without one.
    """

    drive: str
    unit: str
    status: DriveStatus | None
    error: DeviceError | None
    position: float | None
    target: float | None
    following_error: float | None
    speed: float | None
    torque: float | None
    refused: dict[str, str] = field(default_factory=dict)
    """By name, how the drive refused to say it, or why its answer is none."""


def as_table(standing: Standing) -> RenderableType:
    """Show *standing*: numbers, bits in two columns, the error with its remedy, what was refused."""
    name = Text(standing.drive, style="bold")
    return Group(name, _numbers(standing), Text(""), _bits(standing.status), Text(""), *_troubles(standing))


def as_line(standing: Standing) -> str:
    """Say *standing* in one line, for what is no terminal."""
    status = standing.status
    told = [
        f"position {_number(standing.position)} {standing.unit}",
        f"target {_number(standing.target)}",
        "status not said" if status is None else _in_a_word(status),
    ]
    if standing.error is not None:
        told.append(f"E{standing.error.code}: {standing.error.meaning}")
    return ", ".join(told)


def _in_a_word(status: DriveStatus) -> str:
    if status.command_active:
        return "moving"
    return "position reached" if status.position_reached else "standing"


def _numbers(standing: Standing) -> RenderableType:
    table = Table(box=None, pad_edge=False, show_header=False)
    for _ in range(2):
        table.add_column(style="dim")
        table.add_column(justify="right")
        table.add_column()
    unit = standing.unit
    table.add_row("position", _number(standing.position), unit, "speed", _number(standing.speed, 1), "% (inferred)")
    table.add_row("target", _number(standing.target), unit, "torque", _number(standing.torque, 1), "% (inferred)")
    table.add_row("following error", _number(standing.following_error), unit, "", "", "")
    return table


def _number(value: float | None, decimals: int = 3) -> str:
    return "not said" if value is None else f"{value:.{decimals}f}"


def _bits(status: DriveStatus | None) -> RenderableType:
    if status is None:
        return Text("The drive does not say its status.", style="red")
    table = Table(box=None, pad_edge=False)
    for heading, digits in (("S16", status.s16), ("S17", status.s17)):
        table.add_column("")
        table.add_column(Text(f"{heading}  {digits}"), ratio=1)
    for first, second in zip(S16_BITS, S17_BITS, strict=True):
        table.add_row(*_bit(first, status), *_bit(second, status))
    return table


def _bit(bit: StatusBit, status: DriveStatus) -> tuple[Text, Text]:
    is_set = getattr(status, bit.name)
    meaning = bit.meaning_when_set
    if bit.name in _GOOD_WHEN_SET and not is_set:
        style, meaning = "bold red", f"not so: {meaning}"
    elif bit.name in _BAD_WHEN_SET and is_set:
        style = "bold yellow"
    else:
        style = "dim" if not is_set or bit.name in _NOTHING_KNOWN else "bold"
    return Text("1" if is_set else "0", style=style), Text(meaning, style=style)


def _troubles(standing: Standing) -> list[RenderableType]:
    error = standing.error
    told: list[RenderableType] = []
    if error is not None:
        cause = f"\n  cause: {error.cause}" if error.cause else ""
        where = f" (UG p. {error.page})" if error.page else ""
        text = f"E{error.code}: {error.meaning}{cause}\n  remedy: {error.remedy}{where}"
        told.append(Text(text, style="bold red"))
    elif "error" not in standing.refused:
        told.append(Text("No error is present (S30)."))
    told += [Text(f"{name} was not said: {why}", style="yellow") for name, why in standing.refused.items()]
    return told
