"""``compax info``: who a drive is, what its axis and its interface are, what has gone wrong, and how its line does."""

from __future__ import annotations

from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from .. import Axis, Drive
from ..compax.codecs import HistoryEntry, SerialInterface, StatusValue
from ..compax.facts.device_errors import DeviceError
from ..compax.facts.serial_interface import INTERFACE_BITS
from .asking import Asking
from .interruption import moves_nothing
from .opening import DriveLine, Url
from .printing import Printing

__all__ = ["Info", "LineFigures", "info"]

_IDENTIFICATION = range(31, 40)
_OF_THE_UNIT = range(6, 11)


@dataclass(frozen=True, kw_only=True)
class LineFigures:
    """How the line has done since it was opened."""

    exchanges: int
    timeouts: int
    strays: int
    resynchronisations: int
    median_answer_s: float | None
    slowest_hundredth_s: float | None
    """All but the slowest hundredth of the answers came within this."""


@dataclass(frozen=True, kw_only=True)
class Info:
    """What a drive says of itself; what is None or missing stands in *refused*."""

    drive: str
    url: str
    identification: dict[str, str]
    """S31 to S39, as the drive sent them; which of them is the firmware stands on no page at hand (IBS p. 12)."""
    unit_of_values: dict[str, StatusValue]
    """S6 to S10: temperature, voltages, motion cycles, operating hours."""
    axis: Axis | None
    interface: SerialInterface | None
    error: DeviceError | None
    error_history: tuple[HistoryEntry, ...] | None
    line: LineFigures
    refused: dict[str, str] = field(default_factory=dict)


@moves_nothing
async def info(
    url: Url,
    *,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Say who a drive is: firmware, axis, interface, error history.

    Reads its identification (S31 to S39), temperature, voltages and counters (S6 to S10), unit and travel of the axis
    (P90, P11, P12), how its interface is set (P20), the error that is present and those before it, and how fast the
    line answers. What a drive refuses to say is told as refused. Nothing moves.

    ```sh
    compax info serial:///dev/ttyUSB0
    compax info tcp://192.168.1.50:4001 --settings drive.toml --json
    ```
    """
    async with line.open(url) as drive:
        told = await _read(drive, url)
    printing.show(told, _for_people(told))


async def _read(drive: Drive, url: str) -> Info:
    asking = Asking()
    identification: dict[str, str] = {}
    values: dict[str, StatusValue] = {}
    for number in (*_IDENTIFICATION, *_OF_THE_UNIT):
        value = await asking.ask(f"S{number}", drive.read_status(number))
        if value is not None and number in _IDENTIFICATION:
            identification[f"S{number}"] = value.raw
        elif value is not None:
            values[f"S{number}"] = value
    axis = await asking.ask("axis", drive.read_axis())
    if drive.interface is None:
        # It was asked for when the line was opened; once more, to see how it is refused.
        await asking.ask("P20", drive.parameters.read(20))
    error = await asking.ask("error", drive.error())
    history = await asking.ask("error_history", drive.error_history())
    stats = drive.stats
    return Info(
        drive=drive.name,
        url=url,
        identification=identification,
        unit_of_values=values,
        axis=axis,
        interface=drive.interface,
        error=error,
        error_history=history,
        line=LineFigures(
            exchanges=stats.exchanges,
            timeouts=stats.timeouts,
            strays=stats.strays,
            resynchronisations=stats.resynchronisations,
            median_answer_s=stats.answer_time_s(50),
            slowest_hundredth_s=stats.answer_time_s(99),
        ),
        refused=asking.refused,
    )


# For people -----------------------------------------------------------------------------------------------------------


def _for_people(told: Info) -> RenderableType:
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for topic, lines in (
        ("drive", [told.drive]),
        ("identification", _identification(told)),
        ("unit", [_of_value(number, value) for number, value in told.unit_of_values.items()]),
        ("axis", _axis(told.axis)),
        ("interface", _interface(told.interface)),
        ("error", _error(told)),
        ("error history", _history(told.error_history)),
        ("line", _figures(told.line)),
    ):
        if lines:
            table.add_row(topic, Text("\n".join(lines)))
    refused = [Text(f"{name} was not said: {why}", style="yellow") for name, why in told.refused.items()]
    return Group(table, *refused)


def _identification(told: Info) -> list[str]:
    if not told.identification:
        return ["not given"]
    values = "  ".join(f"{number} {text!r}" for number, text in told.identification.items())
    return [values, "(which of these is the firmware stands on no page at hand)"]


def _of_value(number: str, value: StatusValue) -> str:
    unit = f" {value.unit}" if value.unit else ""
    return (
        f"{value.meaning}: {value.raw if not isinstance(value.value, float) else f'{value.value:g}{unit}'} ({number})"
    )


def _axis(axis: Axis | None) -> list[str]:
    if axis is None:
        return ["not given"]
    travel = "not limited" if axis.travel is None else f"{axis.travel[0]:,.10g} to {axis.travel[1]:,.10g} {axis.unit}"
    return [
        f"unit: {axis.unit} (P90 = {axis.unit_code:g}; what it means is said in the settings, not by the drive)",
        f"decimals: {axis.decimals}",
        f"travel: {travel} (P12, P11)",
    ]


def _interface(interface: SerialInterface | None) -> list[str]:
    if interface is None:
        return ["P20 not given"]
    lines = [f"P20 = {interface.raw}"]
    for bit in INTERFACE_BITS:
        if bit.name:
            is_set = "yes" if getattr(interface, bit.name) else "no"
            lines.append(
                f"  {bit.name.replace('_', ' ')}: {is_set} ({bit.meaning_when_set}; {bit.certainty.name.lower()})"
            )
    if interface.unknown:
        lines.append(f"  bits of unknown meaning: {interface.unknown} together")
    return lines


def _error(told: Info) -> list[str]:
    if told.error is None:
        return ["not given"] if "error" in told.refused else ["none is present (S30)"]
    return [str(told.error)]


def _history(history: tuple[HistoryEntry, ...] | None) -> list[str]:
    if history is None:
        return ["not given"]
    return [
        f"E{entry.error.code}: {entry.error.meaning}, "
        + (f"ended by {entry.ended_by}" if entry.ended_by else "not acknowledged before the next")
        for entry in history
    ] or ["empty (S18)"]


def _figures(line: LineFigures) -> list[str]:
    lines = [
        f"{line.exchanges} answers, {line.timeouts} time-outs, {line.strays} texts that nobody asked for, brought in "
        f"step {line.resynchronisations} times"
    ]
    if line.median_answer_s is not None and line.slowest_hundredth_s is not None:
        lines.append(
            f"answer time: {line.median_answer_s * 1000:.1f} ms (median), {line.slowest_hundredth_s * 1000:.1f} ms "
            "(99 of 100)"
        )
    return lines
