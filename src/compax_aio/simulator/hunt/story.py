"""Tells a broken promise as a short story: what was set up, what was done, what befell, and the bytes around it."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterable, Iterator
from typing import Final

from compax_aio.simulator.compax.log import LogKind

from .promises import Broken
from .testimony import Call, Seen, SeenAxis

__all__ = ["merged", "short", "story"]

_LONGEST_LINE: Final = 200
_ON_THE_WIRE: Final = frozenset({LogKind.LINE, LogKind.ANSWER, LogKind.CONNECTED, LogKind.DISCONNECTED})
"""What the wire shows better."""
_CONCERNS: Final = re.compile(r"([a-z]): ")


def story(testimony: Seen, found: Iterable[Broken], *, all_of_it: bool = False) -> str:
    """
    Tell it.

    Args:
        testimony: What was seen.
        found: What is wrong with it.
        all_of_it: Tell of every axis; else of those that a promise was broken on.
    """
    found = list(found)
    concerned = {match[1] for broken in found if (match := _CONCERNS.match(broken.how))}
    parts = [f"seed {testimony.scenario.seed}", str(testimony.scenario), ""]
    for name, axis in testimony.axes.items():
        if all_of_it or not concerned or name in concerned:
            parts += [f"--- axis {name}: → client, ⇒ drive, ← to client", *_lines(axis), ""]
    if complaints := [*testimony.complaints, *testimony.left]:
        parts += ["--- asyncio", *complaints, ""]
    parts += [str(broken) for broken in found] or ["no promise is broken"]
    return "\n".join(parts)


def _lines(axis: SeenAxis) -> Iterator[str]:
    """Merge what happened, from both ends and all callers, in the order of time."""
    wire = [(entry.at, 2, str(entry)) for entry in axis.wire]
    drive = [
        (entry.at, 1, f"{entry.at:9.4f}     drive: {entry.kind} {entry.text}")
        for entry in axis.log
        if entry.kind not in _ON_THE_WIRE
    ]
    return merged(wire, drive, axis.calls)


def merged(
    wire: Iterable[tuple[float, int, str]], far: Iterable[tuple[float, int, str]], calls: Iterable[Call]
) -> Iterator[str]:
    """Merge what happened on a line and at its far end with what was asked and told, in the order of time."""
    calls = list(calls)
    asked = [
        (call.asked_at, 0, f"{call.asked_at:9.4f} > {call.axis}.{call.what} {short(call.detail)} [{call.item}]")
        for call in calls
    ]
    told = [
        (call.ended_at, 3, f"{call.ended_at:9.4f} < {call.axis}.{call.what} [{call.item}] told {short(call.outcome)}")
        for call in calls
        if call.ended_at is not None
    ]
    lines = heapq.merge(*(sorted(part, key=lambda line: line[0]) for part in (wire, far, asked, told)))
    return (text[:_LONGEST_LINE] for _, _, text in lines)


def short(value: object) -> str:
    """Write a value for people, an error in full."""
    if isinstance(value, BaseException):
        return f"{type(value).__name__}: {value}"
    return "" if value is None else repr(value)
