"""Tells a promise that was broken on a party line as a short story."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

from compax_aio.simulator.smc.log import LogKind

from ..hunt.promises import Broken
from ..hunt.story import merged, short
from ..hunt.testimony import WireKind
from .testimony import SeenLine

__all__ = ["party_story"]

_BYTES: Final = re.compile(r" *([0-9.]+) ([→←⇒] .*)")
_LONGEST_LINE: Final = 160
_ON_THE_WIRE: Final = frozenset({LogKind.RECEIVED, LogKind.CONNECTED, LogKind.DISCONNECTED})
"""What the wire shows better."""


def party_story(testimony: SeenLine, found: Iterable[Broken], *, all_of_it: bool = False) -> str:
    """
    Tell it.

    Args:
        testimony: What was seen.
        found: What is wrong with it.
        all_of_it: With what arrives at the axes as well, which is what was written unless something befell it.
    """
    wire = [(entry.at, 2, str(entry)) for entry in testimony.wire if all_of_it or entry.kind is not WireKind.ARRIVED]
    far = [
        (entry.at, 1, f"{entry.at:9.4f}     {entry.axis or 'line'}: {entry.kind} {entry.text}")
        for entry in testimony.far.log
        if entry.kind not in _ON_THE_WIRE
    ]
    parts = [f"seed {testimony.scenario.seed}", str(testimony.scenario), "", "--- → client, ⇒ axes, ← to client"]
    parts += [*_joined(merged(wire, far, testimony.calls)), ""]
    if complaints := [*testimony.complaints, *testimony.left]:
        parts += ["--- asyncio", *complaints, ""]
    parts += [str(broken) for broken in found] or ["no promise is broken"]
    if testimony.excused:
        parts.append(f"excused: {short(dict(testimony.excused))}")
    return "\n".join(parts)


def _joined(lines: Iterable[str]) -> Iterator[str]:
    """Put characters between which nothing else happened into one line, for they come one at a time."""
    line = ""
    for each in lines:
        match = _BYTES.fullmatch(each)
        if match and line and len(line) + len(match[2]) < _LONGEST_LINE:
            line += f"  {match[2]}"
            continue
        if line:
            yield line
        line = each if match else ""
        if not match:
            yield each
    if line:
        yield line
