"""Faults as they are ordered in words: by chance, on a timetable, or both; ``garbled=0.01``, ``silent@10s+5s``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal

from compax_aio.errors import InvalidCommandError

__all__ = [
    "ANY_CODE",
    "FAULT_KINDS",
    "FaultKind",
    "PlannedFault",
    "duration_s",
    "kind_named",
    "read_fault",
    "read_faults",
]

Nature = Literal["noise", "answering", "spell", "moment"]

_FORM: Final = re.compile(
    r"(?P<name>[A-Za-z]+\d*)(?:=(?P<chance>[^:@+]+))?(?::(?P<amount>[^:@+]+))?"
    r"(?:@(?P<start>[^:@+]+)(?:\+(?P<span>[^:@+]+))?)?"
)
_DURATION: Final = re.compile(r"(\d{1,6}(?:\.\d{1,6})?)(ms|s|min)?")
_UNITS_S: Final = {"ms": 0.001, "s": 1.0, "min": 60.0, "": 1.0}
_CODE: Final = re.compile(r"[Ee]([1-9]\d?)")
_LAST_CODE: Final = 97
"""98 and 99 are marks of the error history (UG p. 209)."""
_HINT: Final = "forms: garbled=0.01, late=0.05:300ms, silent@10s+5s, unplug=0.01:2s@30s+60s, E55@12s"


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultKind:
    """
    One kind of fault.

    Attributes:
        nature: ``noise`` befalls single bytes; ``answering`` what the device sends until the next command; a ``spell``
            begins and ends; a ``moment`` happens once.
        amount_s: Of answering how much, of a spell how long, if nothing else is said.
        code: Of a fault of the device itself.
    """

    name: str
    meaning: str
    nature: Nature
    amount_s: float | None = None
    code: int | None = None

    @property
    def chance_is_per(self) -> str:
        """Of what a chance is one."""
        return "byte" if self.nature == "noise" else "command"


FAULT_KINDS: Final = (
    FaultKind(name="garbled", nature="noise", meaning="one bit of a byte is wrong, either way"),
    FaultKind(name="lost", nature="noise", meaning="a byte does not arrive, either way"),
    FaultKind(name="doubled", nature="noise", meaning="a byte arrives twice, either way"),
    FaultKind(name="late", nature="answering", amount_s=0.5, meaning="what the device sends comes so much later"),
    FaultKind(name="split", nature="answering", amount_s=0.005, meaning="it comes byte by byte, so far apart"),
    FaultKind(name="silent", nature="spell", amount_s=1.0, meaning="nothing comes from the device; it goes on working"),
    FaultKind(name="held", nature="spell", amount_s=1.0, meaning="nothing is taken from the host, as after Xoff"),
    FaultKind(name="power", nature="spell", amount_s=1.0, meaning="the device is without power"),
    FaultKind(
        name="unplug", nature="spell", amount_s=2.0, meaning="the cable is pulled out: port or connection is lost"
    ),
    FaultKind(name="cut", nature="moment", meaning="the line is cut within an answer, and is there again at once"),
)
ANY_CODE: Final = FaultKind(
    name="E1-E97", nature="moment", meaning="the drive has this fault or warning; E55: emergency stop"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedFault:
    """
    A fault that has been ordered.

    Attributes:
        kind: What happens.
        text: How it was ordered.
        chance: Of how many bytes or commands it befalls, from 0 to 1; None: all, or once if it is no such thing.
        amount_s: See :class:`FaultKind`.
        start_s: When it begins, from the start of the timetable on.
        span_s: How long it goes on; None: to the end.
    """

    kind: FaultKind
    text: str
    chance: float | None
    amount_s: float
    start_s: float
    span_s: float | None


def read_faults(texts: Iterable[str]) -> tuple[PlannedFault, ...]:
    """Read several faults; raises as :func:`read_fault`."""
    return tuple(map(read_fault, texts))


def read_fault(text: str) -> PlannedFault:
    """
    Read ``NAME[=CHANCE][:AMOUNT][@START[+SPAN]]``: ``late=0.05:300ms@10s+5s``.

    Raises:
        InvalidCommandError: It has another form, there is no such fault, or a number is out of its range.
    """
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise InvalidCommandError(f"{text!r} is no fault", hint=_HINT)
    kind = kind_named(found["name"])
    chance, amount, start, span = (found[each] for each in ("chance", "amount", "start", "span"))
    if amount is not None and kind.amount_s is None:
        raise InvalidCommandError(f"{text!r}: {kind.name} takes no time of its own", hint=_HINT)
    if kind.nature == "spell" and chance is None and amount is not None:
        raise InvalidCommandError(f"{text!r}: how long it lasts is said by + here", hint=f"{kind.name}@10s+{amount}")
    if kind.nature == "moment" and chance is None and (start is None or span is not None):
        raise InvalidCommandError(
            f"{text!r}: {kind.name} happens once, so say when, or how often",
            hint=f"{kind.name}@10s or {kind.name}=0.01",
        )
    return PlannedFault(
        kind=kind,
        text=text.strip(),
        chance=None if chance is None else _chance(chance),
        amount_s=duration_s(amount) if amount is not None else kind.amount_s or 0.0,
        start_s=0.0 if start is None else duration_s(start),
        span_s=None if span is None else duration_s(span),
    )


def kind_named(name: str) -> FaultKind:
    """
    Return the kind of that name; ``E55`` is a fault of the device itself.

    Raises:
        InvalidCommandError: There is none.
    """
    for kind in FAULT_KINDS:
        if kind.name == name.lower():
            return kind
    code = _CODE.fullmatch(name)
    if code is not None and int(code[1]) <= _LAST_CODE:
        return replace(ANY_CODE, name=f"E{code[1]}", code=int(code[1]))
    names = ", ".join(kind.name for kind in (*FAULT_KINDS, ANY_CODE))
    raise InvalidCommandError(f"there is no fault {name!r}", hint=f"there are {names}")


def duration_s(text: str) -> float:
    """
    Read a time: ``5s``, ``300ms``, ``2min``, or ``5``, in seconds.

    Raises:
        InvalidCommandError: It is none, or longer than 11 days.
    """
    found = _DURATION.fullmatch(text.strip())
    if found is None:
        raise InvalidCommandError(f"{text!r} is no time", hint="times are written 5s, 300ms, 2min or 5, in seconds")
    return float(found[1]) * _UNITS_S[found[2] or ""]


def _chance(text: str) -> float:
    try:
        chance = float(text)
    except ValueError:
        chance = -1.0
    if not 0 <= chance <= 1:
        raise InvalidCommandError(f"{text!r} is no chance", hint="a chance is a number from 0 to 1: 0.01 is one of 100")
    return chance
