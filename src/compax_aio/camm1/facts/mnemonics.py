"""
The cutting languages: instructions of mode 1, of mode 2, and common ones, with the shapes of their arguments.

Names and meanings are those of PNC-900 p. 18-19, of mode 1 also the arguments. Of mode 2 the manual gives the arguments
of few instructions; the others are those that HP-GL has, of which CAMM-GL III mode 2 is a kin, by inference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final

from ...certainty import Certainty

__all__ = [
    "CALL_OF_MODE_2",
    "CAMM_GL_III",
    "COMMON",
    "HP_7470A_SET",
    "HP_7475A_SET",
    "MODE_1",
    "MODE_2",
    "Mnemonic",
    "Shape",
    "mnemonic_of",
]

CALL_OF_MODE_2: Final = "^"
"""Stands in mode 1 in front of an instruction of mode 2 (PNC-900 p. 18)."""


class Shape(Enum):
    """What stands between a mnemonic and the end of the instruction."""

    NUMBERS = "numbers"
    LABEL = "label"
    """Any text, ended by the label terminator: ETX, or what ``DT`` has set."""
    LINE = "line"
    """Any text, ended by the end of the line: ``P`` of mode 1; that its end is no other is inferred."""
    SIGN = "sign"
    """One character, whichever it is, right behind the mnemonic: ``DT``, ``SM``."""
    PACKED = "packed"
    """Any characters up to ``;``, letters too: ``PE`` of HP-GL/2."""
    QUOTED = "quoted"
    """A text in quotation marks, in which ``;`` and letters end nothing: ``CO`` of HP-GL/2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mnemonic:
    """
    One instruction of a cutting language.

    Attributes:
        name: One letter in mode 1, two in mode 2, ``!`` and two for common ones.
        counts: How many numbers it may have; None: any, and see *multiple_of* and *fewest*.
        multiple_of: Of pairs: 2.
        ranges: Lowest and highest of the first numbers, None where none is known; what a model has is among its facts.
        draws: The machine may draw by it, if the tool is down, or whatever it was.
        moves: The tool may stand elsewhere afterwards.
        certainty: Of the arguments; the name is documented for whatever models have it.
    """

    name: str
    meaning: str
    shape: Shape = Shape.NUMBERS
    counts: tuple[int, ...] | None = (0,)
    fewest: int = 0
    multiple_of: int = 1
    ranges: tuple[tuple[float, float] | None, ...] = ()
    draws: bool = False
    moves: bool = False
    certainty: Certainty = Certainty.INFERRED
    source: str = "PNC-900 p. 18-19"

    def takes(self, count: int) -> bool:
        """Whether it may have so many numbers."""
        if self.counts is not None:
            return count in self.counts
        return count >= self.fewest and count % self.multiple_of == 0

    @property
    def wanted(self) -> str:
        """How many numbers it takes, in words: ``0 or 4``, ``pairs of numbers``."""
        if self.counts is not None:
            *others, last = (str(count) for count in self.counts)
            return f"{', '.join(others)} or {last}" if others else last
        kind = "pairs of numbers" if self.multiple_of == 2 else "numbers"
        return f"{kind}, {self.fewest} or more" if self.fewest else kind


def _table(*rows: Mnemonic) -> Mapping[str, Mnemonic]:
    return MappingProxyType({row.name: row for row in rows})


_PRINTED: Final = Certainty.DOCUMENTED


def _one(name: str, meaning: str, counts: tuple[int, ...] | None = (0,), **more: object) -> Mnemonic:
    return Mnemonic(
        name=name, meaning=meaning, counts=counts, certainty=_PRINTED, source="PNC-900 p. 18", **more  # type: ignore[arg-type]
    )  # fmt: skip


MODE_1: Final = _table(
    _one("H", "go to the user origin", moves=True),
    _one("D", "cut, absolute", None, fewest=2, multiple_of=2, draws=True, moves=True),
    _one("M", "move with the tool up, absolute", None, fewest=2, multiple_of=2, moves=True),
    _one("I", "cut, relative", None, fewest=2, multiple_of=2, draws=True, moves=True),
    _one("R", "move with the tool up, relative", None, fewest=2, multiple_of=2, moves=True),
    _one("L", "line pattern", (1,), ranges=((-5, 5),)),
    _one("B", "dash pitch", (1,)),
    _one("X", "axis with ticks", (3,), ranges=((0, 1), None, (1, 32_767)), draws=True, moves=True),
    _one("P", "print characters", None, shape=Shape.LINE, draws=True, moves=True),
    _one("S", "character size", (1,), ranges=((0, 127),)),
    _one("Q", "rotation of text, by 90°", (1,), ranges=((0, 3),)),
    _one("N", "symbol", (1,), ranges=((1, 15),), draws=True),
    _one("C", "arc around a point", (5, 6), draws=True, moves=True),
    _one("E", "arc from the tool position", (3, 4), draws=True, moves=True),
    _one("A", "centre for G and K", (2,)),
    _one("G", "arc around the centre of A", (3, 4), draws=True, moves=True),
    _one("K", "radial division line", (3,), draws=True, moves=True),
    _one("T", "rectangle, hatched or not", (5,), draws=True, moves=True),
)
"""By letter; lists of M and R are taken as the form of M has them, though R is printed with one pair."""

COMMON: Final = _table(
    _one("!NR", "not ready"),
    _one("!PG", "feed the sheet, mm", (1,), moves=True),
    _one("!ST", "tool 0 or 1", (1,)),
    Mnemonic(
        name="!FS", meaning="force, gf", counts=(0, 1), certainty=Certainty.REPORTED,
        source="a common fab tool, for GS-24",
    ),
)  # fmt: skip
"""Valid in both modes."""

_PAIRS: Final[dict[str, object]] = {"counts": None, "multiple_of": 2, "draws": True, "moves": True}


def _two(name: str, meaning: str, *counts: int, **more: object) -> Mnemonic:
    return Mnemonic(name=name, meaning=meaning, **{"counts": counts or (0,), **more})  # type: ignore[arg-type]


def _hp(name: str, meaning: str, *counts: int, **more: object) -> Mnemonic:
    return _two(name, meaning, *counts, **{"source": "HP 7475A", **more})


_AREA: Final = {"draws": True, "moves": False}

MODE_2: Final = _table(
    _two("IN", "initialise", 0, 1, certainty=_PRINTED),
    _two("DF", "defaults", certainty=_PRINTED),
    _two("IP", "scaling points P1 and P2", 0, 2, 4),
    _two("IW", "window", 0, 4),
    _two("SC", "scaling by user units", 0, 4),
    _two("PA", "plot absolute", certainty=_PRINTED, **_PAIRS),
    _two("PR", "plot relative", certainty=_PRINTED, **_PAIRS),
    _two("PU", "tool up", certainty=_PRINTED, **{**_PAIRS, "draws": False}),
    _two("PD", "tool down", certainty=_PRINTED, **_PAIRS),
    _two("VS", "speed, cm/s", 0, 1, 2, certainty=_PRINTED),
    _two("PT", "pen thickness", 0, 1),
    _two("CI", "circle", 1, 2, **_AREA),
    _two("AA", "arc, absolute", 3, 4, draws=True, moves=True),
    _two("AR", "arc, relative", 3, 4, draws=True, moves=True),
    _two("EA", "edge of a rectangle, absolute", 2, **_AREA),
    _two("ER", "edge of a rectangle, relative", 2, **_AREA),
    _two("RA", "filled rectangle, absolute", 2, **_AREA),
    _two("RR", "filled rectangle, relative", 2, **_AREA),
    _two("EW", "edge of a wedge", 3, 4, **_AREA),
    _two("WG", "filled wedge", 3, 4, **_AREA),
    _two("FT", "fill type", 0, 1, 2, 3),
    _two("LT", "line type", 0, 1, 2, 3),
    _two("TL", "tick length", 0, 1, 2),
    _two("XT", "tick on x", **_AREA),
    _two("YT", "tick on y", **_AREA),
    _two("LB", "label", shape=Shape.LABEL, counts=None, draws=True, moves=True),
    _two("DT", "label terminator", shape=Shape.SIGN, counts=None),
    _two("CA", "alternate character set", 0, 1),
    _two("CS", "standard character set", 0, 1),
    _two("SA", "select the alternate set"),
    _two("SS", "select the standard set"),
    _two("CP", "move by characters", 0, 2, moves=True),
    _two("DI", "direction of text, absolute", 0, 2),
    _two("DR", "direction of text, relative", 0, 2),
    _two("SI", "character size, absolute", 0, 2),
    _two("SR", "character size, relative", 0, 2),
    _two("SL", "slant of characters", 0, 1),
    _two("SM", "symbol at every point", shape=Shape.SIGN, counts=None),
    _two("UC", "character of one's own", counts=None, draws=True, moves=True),
    _two("IM", "mask of errors", 0, 1, 2, 3, ranges=((0, 255),), certainty=_PRINTED),
    _two("OA", "output the actual position", certainty=_PRINTED),
    _two("OC", "output the commanded position", certainty=_PRINTED),
    _two("OE", "output the error", certainty=_PRINTED),
    _two("OF", "output the steps per mm", certainty=_PRINTED),
    _two("OH", "output the hard-clip limits", certainty=_PRINTED),
    _two("OI", "output the model", certainty=_PRINTED),
    _two("OO", "output the options", certainty=_PRINTED),
    _two("OP", "output P1 and P2", certainty=_PRINTED),
    _two("OS", "output the status", certainty=_PRINTED),
    _two("OW", "output the window", certainty=_PRINTED),
    # Known of relatives alone.
    _hp("SP", "select a pen", 0, 1),
    _two("FS", "force", 0, 1, 2, certainty=Certainty.REPORTED, source="cursor; Inkcut"),
    _hp("OD", "output the digitised point", source="DXY"),
    _hp("DC", "digitise: clear"),
    _hp("DP", "digitise: point"),
    _hp("RO", "rotate the coordinates", 0, 1),
    _hp("PS", "paper size", 0, 1),
    _two("AS", "acceleration", 0, 1, 2, source="HP 7550A"),
    _two("AP", "automatic pen lift", 0, 1, source="HP 7550A"),
    _two("PM", "polygon mode", 0, 1, source="HP 7550A"),
    _two("EP", "edge of the polygon", source="HP 7550A", **_AREA),
    _two("FP", "fill the polygon", 0, 1, source="HP 7550A", **_AREA),
    _two("PG", "next sheet", 0, 1, source="HP 7550A"),
    _two("NR", "not ready", 0, 1, source="HP 7550A"),
    _two("WD", "write to the display", shape=Shape.LABEL, counts=None, source="DPX p. 45"),
    _two("BL", "label into the buffer", shape=Shape.LABEL, counts=None, source="HP 7550A"),
    _two("PE", "encoded polyline", shape=Shape.PACKED, counts=None, draws=True, moves=True, source="HP-GL/2"),
    _two("CO", "comment", shape=Shape.QUOTED, counts=None, source="HP-GL/2"),
)
"""By name; which machine has which is in the sets below."""

_CUTTER: Final = (
    "IN DF IP IW SC PA PR PU PD VS PT CI AA AR EA ER RA RR EW WG FT LT TL XT YT "
    "LB DT CA CS SA SS CP DI DR SI SR SL SM UC IM OA OC OE OF OH OI OO OP OS OW"
)

CAMM_GL_III: Final = frozenset([*MODE_1, *_CUTTER.split(), "!NR", "!PG", "!ST"])
"""Both modes and what is common to them (PNC-900 p. 18-19); ``SP`` and a force are not among them."""

HP_7475A_SET: Final = frozenset([*_CUTTER.split(), "SP", "OD", "DC", "DP", "RO", "PS"])
"""As a converter lists it (hpgl-to-svg)."""

HP_7470A_SET: Final = HP_7475A_SET - frozenset(
    ["AA", "AR", "CI", "EA", "ER", "RA", "RR", "EW", "WG", "FT", "PT", "RO", "PS", "OH", "OW"]
)
"""Without arcs, rectangles, wedges, fills and rotation, which came with the HP 7475A."""


def mnemonic_of(name: str) -> Mnemonic | None:
    """Return what is known of *name* in whichever language it is; None: nothing."""
    return MODE_2.get(name) or MODE_1.get(name) or COMMON.get(name)
