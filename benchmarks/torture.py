"""
Who gets whose answer? An answer comes after the time-out of its caller, and two more questions are asked.

Run it with ``make torture``; what it prints is told in ``docs/torture.md``. Peers that are not installed are named.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import logging
import platform
import sys
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Final

from .torture_conversations import (
    LATE_S,
    TIMEOUT_S,
    UNNAMED,
    Conversation,
    Write,
    ask_late,
    cancel_a_caller,
    write_unanswered,
)
from .torture_peers import PEERS, Peer

__all__ = ["DETAILS_HEAD", "OVERVIEW_HEAD", "TRIALS", "Result", "Trial", "main", "measure", "table"]

NOT_INSTALLED: Final = "not installed"

Found = Conversation | Write | str
"""What a trial found; a text says why it could not be made."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One column of the overview."""

    title: str
    run: Callable[[Peer], Awaitable[Conversation | Write]]
    unfit: Callable[[Peer], str] = lambda _: ""
    """Why a peer cannot take part, or nothing."""


TRIALS: Final[Mapping[str, Trial]] = {
    "late": Trial("late, B waits", ask_late),
    "late_before": Trial("late, B comes after", partial(ask_late, pauses=True)),
    "late_unnamed": Trial(
        "late prompt", partial(ask_late, questions=UNNAMED), lambda peer: "" if peer.is_on_lines else "n.a."
    ),
    "cancelled": Trial("caller cancelled", cancel_a_caller, lambda peer: "blocks" if peer.blocks else ""),
    "unanswered": Trial("frames of an order", write_unanswered),
}

DETAILS_HEAD: Final = ("peer", "version", "A got", "B got", "C got", "verdict")
OVERVIEW_HEAD: Final = ("peer", *(trial.title for trial in TRIALS.values()))


@dataclass(frozen=True, slots=True)
class Result:
    """What one peer did."""

    peer: Peer
    version: str
    found: Mapping[str, Found]

    def details(self) -> Sequence[str]:
        """Fill a row of the table of details."""
        late = self.found.get("late", "")
        told = [*late.told(), late.verdict] if isinstance(late, Conversation) else ["", "", "", str(late)]
        return [self.peer.name, self.version, *told]

    def overview(self) -> Sequence[str]:
        """Fill a row of the overview."""
        return [self.peer.name, *(_cell(self.found.get(key, NOT_INSTALLED)) for key in TRIALS)]

    def as_json(self) -> Mapping[str, Any]:
        """Say everything that is known."""
        return {
            "peer": self.peer.name,
            "version": self.version,
            "remedy": self.peer.is_remedy,
            "trials": {key: _as_json(each) for key, each in self.found.items()},
        }


def _cell(found: Found) -> str:
    match found:
        case Conversation():
            return found.verdict
        case Write():
            return f"{found.frames}: {found.told}"
        case _:
            return found


def _as_json(found: Found) -> Any:
    match found:
        case Conversation():
            asked = [each.question for each in found.outcomes]
            got = {question.name: told for question, told in zip(asked, found.told(), strict=True)}
            return {"verdict": found.verdict, "got": got}
        case Write():
            return {"frames": found.frames, "told": found.told}
        case _:
            return found


async def measure(peer: Peer) -> Result:
    """Put one peer through all trials that it can take part in."""
    if (version := peer.version) is None:
        return Result(peer, NOT_INSTALLED, {})
    found: dict[str, Found] = {}
    for key, trial in TRIALS.items():
        try:
            found[key] = trial.unfit(peer) or await trial.run(peer)
        except Exception as error:  # one that cannot be opened here must not end the others' run
            found[key] = f"failed: {type(error).__name__}"
    return Result(peer, version, found)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table that reads as text and as Markdown."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    written = ["| " + " | ".join(map(str.ljust, line, widths)) + " |" for line in lines]
    written.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(written)


async def _measure_all(peers: Iterable[Peer]) -> list[Result]:
    results = []
    for peer in peers:
        print(f"{peer.name} …", file=sys.stderr)
        results.append(await measure(peer))
    return results


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print two tables, and return the exit status: 1 if compax_aio shifted an answer."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything that was found to FILE")
    parser.add_argument("--only", metavar="WORD", default="", help="only peers whose name holds WORD")
    options = parser.parse_args(argv)
    logging.disable(logging.CRITICAL)  # peers tell of time-outs there, which are what they are here for
    results = asyncio.run(_measure_all(each for each in PEERS if options.only in each.name))
    conditions = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "python": platform.python_version(),
        "system": platform.system(),
        "timeout_s": TIMEOUT_S,
        "late_s": LATE_S,
    }
    print(", ".join(f"{key} {value}" for key, value in conditions.items()), end="\n\n")
    print(table(DETAILS_HEAD, (each.details() for each in results)), end="\n\n")
    print(table(OVERVIEW_HEAD, (each.overview() for each in results)))
    if options.json is not None:
        options.json.write_text(json.dumps({**conditions, "peers": [each.as_json() for each in results]}, indent=1))
    ours = [each for each in results if each.peer is PEERS[0]]
    return int(
        any(
            found.verdict != "right"
            for each in ours
            for found in each.found.values()
            if isinstance(found, Conversation)
        )
    )


if __name__ == "__main__":
    sys.exit(main())
