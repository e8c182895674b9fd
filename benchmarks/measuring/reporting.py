"""One table in the terminal, and the same as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from compax_aio.text_file import replace_file

from .effort import Effort
from .figures import Figure, Row
from .machine import Machine

__all__ = ["as_json", "as_table", "write_json"]

_HEAD = ("figure", "target", "measured", "ratio", "reached", "spread")


def _number(value: float | None, unit: str) -> str:
    if value is None:
        return "not measured"
    digits = 0 if abs(value) >= 1000 else 1 if abs(value) >= 100 else 2 if abs(value) >= 0.1 else 4
    return f"{value:,.{digits}f} {unit}".rstrip()


def _share(value: float | None) -> str:
    return "" if value is None else f"± {value:.1%}"


def _line(figure: Figure) -> tuple[str, ...]:
    reached = {True: "yes", False: "NO", None: "" if figure.target is None else "?"}[figure.is_reached]
    target = figure.target.told(figure.unit) if figure.target else ""
    return figure.name, target, _number(figure.value, figure.unit), "", reached, _share(figure.spread)


def _under(figure: Figure, row: Row) -> tuple[str, ...]:
    ratio = "" if row.ratio is None else f"{row.ratio:,.2f} times {figure.ratio_of}".removesuffix(" times ")
    name = f"    {row.name}" + (f" ({row.note})" if row.note else "")
    return name, "", _number(row.value, row.unit), ratio, "", _share(row.spread)


def as_table(figures: Sequence[Figure], machine: Machine, effort: Effort) -> str:
    """Write all figures in columns; what stands beside a figure stands under it, and notes last."""
    lines: list[tuple[str, ...]] = [_HEAD]
    notes: list[str] = []
    for figure in figures:
        lines.append(_line(figure))
        lines += [_under(figure, row) for row in figure.rows]
        notes += [f"{figure.name}: {note}" for note in figure.notes]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    written = ["  ".join(map(str.ljust, line, widths)).rstrip() for line in lines]
    written.insert(1, "  ".join("─" * width for width in widths))
    told = [machine.told(), effort.noise.told(), f"effort: {effort.name}; spread: half of the quartiles' distance"]
    return "\n".join([*written, "", *dict.fromkeys(notes), *([""] if notes else []), *told])


def as_json(figures: Mapping[str, Sequence[Figure]], machine: Machine, effort: Effort) -> str:
    """Write all figures, by the module that measured them, the machine and its noise."""
    return json.dumps(
        {
            "machine": machine.as_dict(),
            "noise": effort.noise.as_dict(),
            "effort": {"name": effort.name, "rounds": effort.rounds, "round_s": effort.round_s},
            "figures": {name: [each.as_dict() for each in of_module] for name, of_module in figures.items()},
        },
        indent=2,
        ensure_ascii=False,
    )


def write_json(path: Path, text: str) -> None:
    """Write it whole, or leave what was there."""
    replace_file(path, text + "\n")
