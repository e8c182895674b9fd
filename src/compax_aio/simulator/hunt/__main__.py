"""The command ``python -m compax_aio.simulator.hunt``."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections.abc import Iterable, Sequence
from typing import Final

from ..smc_hunt.quarry import SMC
from .day import run_day
from .hunting import Hunt
from .quarry import COMPAX, Quarry
from .shrink import shrink

__all__ = ["main"]

_DESCRIPTION: Final = """\
Looks for seeds that break a promise of compax_aio.

Each seed is a whole application: one to four simulated drives, or a line with one to five SMC axes (--device smc);
users who move, stop, read, cancel and leave, and troubles that befall the drives, their lines and the event loop; all
in virtual time, so that many run in a second. What the far end has seen is held against what every caller was told,
promise by promise (P1 to P10). Nothing depends on anything but the seed: what was found once is found again.
"""
_EXAMPLES: Final = """\
examples:
  python -m compax_aio.simulator.hunt                          seeds 0 to 9999
  python -m compax_aio.simulator.hunt --seeds 5000:90000       others
  python -m compax_aio.simulator.hunt --minutes 30 --jobs 4    for half an hour, from a place that changes
  python -m compax_aio.simulator.hunt --seed 17                one seed with its story, shrunk if it breaks a promise
  python -m compax_aio.simulator.hunt --seed 17 --keep 0,3,5   some parts of it, by the numbers that the story gives
  python -m compax_aio.simulator.hunt --device smc --seed 17   the same of a line with SMC axes
  python -m compax_aio.simulator.hunt --day                    24 hours of eight drives with troubles

exit code: 0 nothing found, 1 something found, 130 ended by Ctrl-C
"""
_QUARRIES: Final = {each.device: each for each in (COMPAX, SMC)}
_USUAL_SEEDS: Final = "0:10000"
_TOLD: Final = 5
"""Finds that are shrunk and told; the others are listed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Hunt as the command line says; returns the exit code."""
    wanted = _parser().parse_args(arguments)
    quarry = _QUARRIES[wanted.device]
    try:
        if wanted.day:
            return run_day(wanted.hours, _print)
        if wanted.seed is not None:
            return _replay(quarry, wanted.seed, wanted.keep, shrinks=not wanted.as_is)
        return _hunt(quarry, wanted)
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m compax_aio.simulator.hunt",
        description=_DESCRIPTION,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--device", choices=tuple(_QUARRIES), default=COMPAX.device, help=f"what is hunted ({COMPAX.device})"
    )
    parser.add_argument("--seeds", type=_range, metavar="FROM:TO", help=f"which seeds (usual: {_USUAL_SEEDS})")
    parser.add_argument("--minutes", type=float, metavar="M", help="leave off after so long")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (all processors)")
    parser.add_argument("--seed", type=int, metavar="N", help="tell the story of one seed")
    parser.add_argument("--keep", type=_numbers, metavar="N,N", help="with --seed: nothing but these parts of it")
    parser.add_argument("--as-is", action="store_true", help="with --seed: do not shrink it")
    parser.add_argument("--first", action="store_true", help="leave off at the first find")
    parser.add_argument("--quiet", action="store_true", help="list what is found, and tell no stories")
    parser.add_argument("--day", action="store_true", help="one long scenario: a day of eight drives")
    parser.add_argument("--hours", type=float, default=24.0, metavar="H", help="with --day: shorter, or longer (24)")
    return parser


def _range(text: str) -> range:
    first, _, end = text.partition(":")
    return range(int(first), int(end))


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in text.split(","))


def _replay(quarry: Quarry, seed: int, keep: Sequence[int] | None, *, shrinks: bool) -> int:
    whole = scenario = quarry.draw(seed)
    if keep is not None:
        scenario = scenario.keep(keep)
    testimony = quarry.simulate(scenario)
    found = quarry.broken(testimony)
    if found and shrinks and keep is None:
        scenario = shrink(scenario, found[0].promise, quarry)
        testimony = quarry.simulate(scenario)
        found = quarry.broken(testimony)
    _print(quarry.story(testimony, found, all_of_it=not shrinks))
    kept = f" --keep {','.join(map(str, scenario.numbers))}" if scenario != whole else ""
    device = "" if quarry is COMPAX else f" --device {quarry.device}"
    _print(f"again: python -m compax_aio.simulator.hunt{device} --seed {seed}{kept}")
    return 1 if found else 0


def _hunt(quarry: Quarry, wanted: argparse.Namespace) -> int:
    seeds: Iterable[int]
    until = None
    if wanted.minutes is not None:
        until = time.monotonic() + 60 * wanted.minutes
        seeds = wanted.seeds or itertools.count(int(time.time()))
    else:
        seeds = wanted.seeds or _range(_USUAL_SEEDS)
    hunt = Hunt(quarry)
    progress = _Progress(first=wanted.first)
    code = 0
    try:
        hunt.go(seeds, jobs=wanted.jobs, until=until, on_progress=progress)
    except _EnoughError:
        pass
    except KeyboardInterrupt:
        code = 130
    progress.end()
    _summary(hunt, 0 if wanted.quiet else _TOLD)
    return code or (1 if hunt.finds else 0)


def _summary(hunt: Hunt, told: int) -> None:
    _print(f"{hunt.tried} seeds, {hunt.seeds_a_second:.0f} a second, {len(hunt.finds)} break a promise")
    for find in hunt.finds[:told]:
        _print("")
        _replay(hunt.quarry, find.seed, None, shrinks=True)
    for find in hunt.finds[told:]:
        _print(f"seed {find.seed}: {', '.join(find.promises)}")


class _EnoughError(Exception):
    """The first find was all that was wanted."""


class _Progress:
    """One line that tells how far a hunt has got; written anew where it is a terminal, else now and then."""

    def __init__(self, *, first: bool) -> None:
        self._first = first
        self._told = 0
        self._next_at = 0.0
        self._is_terminal = sys.stderr.isatty()

    def __call__(self, hunt: Hunt) -> None:
        for find in hunt.finds[self._told :]:
            self._write(f"seed {find.seed} breaks {', '.join(find.promises)}", stays=True)
        self._told = len(hunt.finds)
        if self._first and hunt.finds:
            raise _EnoughError
        if time.monotonic() >= self._next_at:
            self._next_at = time.monotonic() + (0.5 if self._is_terminal else 10.0)
            self._write(f"{hunt.tried} seeds, {hunt.seeds_a_second:.0f} a second, {len(hunt.finds)} found", stays=False)

    def end(self) -> None:
        """Leave the line."""
        if self._is_terminal:
            sys.stderr.write("\r\x1b[K")

    def _write(self, text: str, *, stays: bool) -> None:
        if self._is_terminal:
            sys.stderr.write(f"\r\x1b[K{text}" + ("\n" if stays else ""))
        else:
            sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def _print(text: str) -> None:
    sys.stdout.write(f"{text}\n")


if __name__ == "__main__":
    sys.exit(main())
