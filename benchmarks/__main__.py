"""
Every figure of the design, measured in one run beside its target, the floor and what a user would pick instead.

Run it with ``make bench`` (seconds a figure) or ``make bench-full`` (minutes); ``docs/performance.md`` says how figures
are measured, and what they were.
"""

from __future__ import annotations

import argparse
import logging
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Final, TypeAlias

from .measuring import FULL, LEAST, SHORT, Effort, Figure, Machine, Noise
from .measuring.reporting import as_json, as_table, write_json

__all__ = ["FIGURES", "has_failed", "main", "measure"]

FIGURES: Final = (
    "exchange_cost",
    "peers",
    "counts",
    "wire_share",
    "many_lines",
    "latency",
    "memory",
    "simulator_speed",
    "import_time",
)
"""Modules of :mod:`benchmarks.figures`, in the order of the table."""

_FAILED: Final = "failed: "

Measure: TypeAlias = Callable[[Effort], Sequence[Figure]]


def _measure_of(name: str) -> Measure:
    function: Measure = import_module(f"benchmarks.figures.{name}").measure
    return function


def measure(names: Sequence[str], effort: Effort, tell: Callable[[str], object]) -> Mapping[str, Sequence[Figure]]:
    """
    Measure the figures of those modules, one after the other.

    Ctrl-C leaves off, and what was measured stays; so does all else where one module fails, whose figure says why.
    """
    measured: dict[str, Sequence[Figure]] = {}
    for number, name in enumerate(names, 1):
        tell(f"[{number}/{len(names)}] {name} …")
        try:
            measured[name] = _measure_of(name)(effort)
        except KeyboardInterrupt:
            tell(f"left off in {name}; what follows was measured before")
            break
        except Exception as error:
            tell(traceback.format_exc())
            measured[name] = [Figure(name=name, value=None, notes=[f"{_FAILED}{type(error).__name__}: {error}"])]
    return measured


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__.partition("\n\n")[0],
        epilog=f"figures: {', '.join(FIGURES)}. Exit status: 0 measured, whether the targets are reached or not; "
        "1 a figure failed; 130 ended by Ctrl-C; 2 bad arguments.",
    )
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--full", action="store_true", help="minutes a figure, for numbers to be printed")
    length.add_argument("--least", action="store_true", help="only to see that everything can be measured")
    parser.add_argument("--only", nargs="+", choices=FIGURES, metavar="NAME", help="only these figures")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything that was found to FILE")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is asked for, print one table, and return the exit status."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    if asked.json is not None and not asked.json.absolute().parent.is_dir():
        parser.error(f"there is no folder for {asked.json}")
    logging.disable(logging.WARNING)  # some peers tell a lot
    effort = replace(FULL if asked.full else LEAST if asked.least else SHORT, noise=Noise())
    machine = Machine.here()
    names = asked.only or FIGURES
    measured = measure(names, effort, lambda text: print(text, file=sys.stderr, flush=True))
    print(as_table([figure for of_module in measured.values() for figure in of_module], machine, effort))
    if asked.json is not None:
        write_json(asked.json, as_json(measured, machine, effort))
    if len(measured) < len(names):
        return 130
    return 1 if any(has_failed(each) for of_module in measured.values() for each in of_module) else 0


def has_failed(figure: Figure) -> bool:
    """Whether its module could not measure it, though it should."""
    return figure.value is None and any(note.startswith(_FAILED) for note in figure.notes)


if __name__ == "__main__":
    sys.exit(main())
