"""What differs among cutters and plotters, as data that a user can change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from types import MappingProxyType
from typing import Any, Final

from ..certainty import Certainty
from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.handshakes import AckRule
from .facts.instructions import CONTROL_INSTRUCTIONS, MAX_BLOCK_SIZE
from .facts.line import DEFAULT_BAUD_RATE, STEPS_PER_MM
from .facts.mnemonics import CAMM_GL_III, MODE_1
from .facts.models import MODELS, Fact
from .facts.reports import StatusStyle

__all__ = [
    "CX_24",
    "DXY_1300",
    "GS_24",
    "HP_7470A",
    "HP_7475A",
    "PNC_900",
    "PNC_1050",
    "PNC_1200",
    "PNC_1410",
    "PNC_1600",
    "PNC_1610",
    "PROFILES",
    "Profile",
    "profile_named",
]

_NEEDED_CONTROLS: Final = frozenset("BEK")
"""Without them no job could be sent, looked after or stopped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """
    One model; ``dataclasses.replace()`` makes another. Nothing asks for its name.

    None stands for what is not known, or not there, and stays so: what needs it is asked of the machine, or refused.
    ``compax_aio.camm1.facts.models`` has the source of each, and what a simulated machine has where nothing is known.

    Attributes:
        name: For people.
        controls: Letters of the device control instructions that it has.
        colons: Letters without parameters that are closed with a colon all the same.
        buffer_bytes: What ``.B`` answers when nothing is stored; it is asked all the same.
        baud_rate: It is likely set to; 9600 where nothing is known.
        lowest_threshold: Of P1 of ``.I`` for Xon/Xoff, bytes.
        status_style: How ``.O`` answers; None: told by its bits 3 and 4 alone, which all have in common.
        model_answer: What ``.A`` answers; None: it has none, or it is not known.
        identity: What ``OI;`` answers.
        size_waits_for_empty: Whether ``.L`` answers only once the buffer is empty; None: reckon with it.
        acknowledges_at_equal: Whether ENQ is acknowledged if just as much is free as was asked for.
        mnemonics: Names of the instructions that its languages have.
        mnemonics_are_documented: Whether its manual lists them: then others are errors, not only suspect.
        steps_per_mm: Of coordinates.
        area_mm: The largest sheet: along the axis that is fed, and across.
        speeds_cm_s: Lowest and highest of ``VS``.
        force_instruction: ``!FS`` or ``FS``.
        forces: Lowest and highest of it: gf with ``!FS``, the machine's own steps with ``FS``.
        tool_instruction: ``!ST`` or ``SP``.
        tools: Lowest and highest of it.
        feeds_mm: Lowest and highest of ``!PG``.
        remarks: For people.
    """

    name: str
    controls: frozenset[str] = frozenset("BMNHIOELJKR")
    colons: frozenset[str] = frozenset()
    buffer_bytes: int | None = None
    baud_rate: int = DEFAULT_BAUD_RATE
    lowest_threshold: int = 10
    status_style: StatusStyle | None = None
    model_answer: str | None = None
    identity: str | None = None
    size_waits_for_empty: bool | None = None
    acknowledges_at_equal: bool = False
    mnemonics: frozenset[str] = CAMM_GL_III
    mnemonics_are_documented: bool = False
    steps_per_mm: float = STEPS_PER_MM
    area_mm: tuple[float, float] | None = None
    speeds_cm_s: tuple[float, float] | None = None
    force_instruction: str | None = None
    forces: tuple[float, float] | None = None
    tool_instruction: str | None = None
    tools: tuple[int, int] | None = None
    feeds_mm: tuple[float, float] | None = None
    remarks: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Refuse what cannot be meant, before an instruction is worded by it."""
        for each in fields(self):
            value, (is_meant, wanted) = getattr(self, each.name), _EXPECTED[each.name]
            if not is_meant(value):
                raise InvalidCommandError(f"{each.name} of a profile is {wanted}, not {shown(value)}")

    @property
    def has_mode_1(self) -> bool:
        """Whether it has the language of one letter."""
        return not self.mnemonics.isdisjoint(MODE_1)


# What a field may be -------------------------------------------------------------------------------------------------

_Expected = tuple[Callable[[Any], bool], str]
"""A test, and in words what passes it."""


def _is_number(value: object) -> bool:
    return type(value) in (int, float) and isfinite(value)  # type: ignore[arg-type]


def _is_above_0(value: object) -> bool:
    return _is_number(value) and value > 0  # type: ignore[operator]


def _is_whole_above_0(value: object) -> bool:
    return type(value) is int and value > 0


def _is_flag(value: object) -> bool:
    return type(value) is bool


def _is_text(value: object) -> bool:
    return type(value) is str and value.isascii() and value.isprintable() and bool(value.strip())


def _is_span(value: object) -> bool:
    return type(value) is tuple and len(value) == 2 and all(map(_is_number, value)) and value[0] <= value[1]


def _is_area(value: object) -> bool:
    return type(value) is tuple and len(value) == 2 and all(map(_is_above_0, value))


def _are_letters(value: object) -> bool:
    return type(value) is frozenset and value <= frozenset(CONTROL_INSTRUCTIONS)


def _or_unknown(is_meant: Callable[[Any], bool], wanted: str) -> _Expected:
    return (lambda value: value is None or is_meant(value), f"{wanted}, or None where it is not known")


_TEXT: Final = _or_unknown(_is_text, "a printable text")
_SPAN: Final = _or_unknown(_is_span, "a lowest and a highest number, (1, 20)")
_KNOWN_LETTERS: Final = "letters of device control instructions, as a frozenset"

_EXPECTED: Final[Mapping[str, _Expected]] = {
    "name": (_is_text, "a printable text"),
    "controls": (
        lambda value: _are_letters(value) and value >= _NEEDED_CONTROLS,
        f"{_KNOWN_LETTERS}, B, E, K among them",
    ),
    "colons": (_are_letters, _KNOWN_LETTERS),
    "buffer_bytes": _or_unknown(_is_whole_above_0, "a whole number of bytes above 0"),
    "baud_rate": (_is_whole_above_0, "a whole number above 0"),
    "lowest_threshold": (
        lambda value: type(value) is int and 0 <= value <= MAX_BLOCK_SIZE,
        f"a whole number from 0 to {MAX_BLOCK_SIZE}",
    ),
    "status_style": _or_unknown(lambda value: isinstance(value, StatusStyle), "a StatusStyle"),
    "model_answer": _TEXT,
    "identity": _TEXT,
    "size_waits_for_empty": _or_unknown(_is_flag, "True or False"),
    "acknowledges_at_equal": (_is_flag, "True or False"),
    "mnemonics": (
        lambda value: type(value) is frozenset and bool(value) and all(map(_is_text, value)),
        "names of instructions, as a frozenset",
    ),
    "mnemonics_are_documented": (_is_flag, "True or False"),
    "steps_per_mm": (_is_above_0, "a number above 0"),
    "area_mm": _or_unknown(_is_area, "two lengths in mm above 0"),
    "speeds_cm_s": _or_unknown(lambda value: _is_span(value) and value[0] > 0, "a lowest and a highest speed above 0"),
    "force_instruction": _or_unknown(lambda value: value in ("!FS", "FS"), "'!FS' or 'FS'"),
    "forces": _SPAN,
    "tool_instruction": _or_unknown(lambda value: value in ("!ST", "SP"), "'!ST' or 'SP'"),
    "tools": _SPAN,
    "feeds_mm": _SPAN,
    "remarks": (lambda value: type(value) is str, "a text"),
}  # fmt: skip


# The models ----------------------------------------------------------------------------------------------------------


def _value(fact: Fact[Any], default: Any = None) -> Any:
    """Return what a client may go by: no placeholder."""
    return default if fact.known is None else fact.known


def _profile(name: str) -> Profile:
    model = MODELS[name]
    rates = _value(model.baud_rates, (DEFAULT_BAUD_RATE,))
    return Profile(
        name=name,
        controls=_value(model.controls),
        colons=_value(model.colons),
        buffer_bytes=_value(model.buffer_bytes),
        baud_rate=DEFAULT_BAUD_RATE if DEFAULT_BAUD_RATE in rates else max(rates),
        lowest_threshold=_value(model.lowest_threshold, 10),
        status_style=_value(model.status_style),
        model_answer=_value(model.model_answer),
        identity=_value(model.identity),
        size_waits_for_empty=_value(model.size_waits_for_empty),
        acknowledges_at_equal=model.ack_rule.known is AckRule.AT_LEAST,
        mnemonics=_value(model.mnemonics) | {*filter(None, [_value(model.force_instruction)])},
        mnemonics_are_documented=model.mnemonics.certainty is Certainty.DOCUMENTED,
        steps_per_mm=_value(model.steps_per_mm, STEPS_PER_MM),
        area_mm=_value(model.area_mm),
        speeds_cm_s=_value(model.speeds_cm_s),
        force_instruction=_value(model.force_instruction),
        forces=_value(model.forces),
        tool_instruction=_value(model.tool_instruction),
        tools=_value(model.tools),
        feeds_mm=_value(model.feeds_mm),
        remarks=model.remarks,
    )


PNC_1610: Final = _profile("PNC-1610")
PNC_900: Final = _profile("PNC-900")
PNC_1050: Final = _profile("PNC-1050")
PNC_1200: Final = _profile("PNC-1200")
PNC_1600: Final = _profile("PNC-1600")
PNC_1410: Final = _profile("PNC-1410")
CX_24: Final = _profile("CX-24")
GS_24: Final = _profile("GS-24")
DXY_1300: Final = _profile("DXY-1300")
HP_7470A: Final = _profile("HP 7470A")
HP_7475A: Final = _profile("HP 7475A")

PROFILES: Final[Mapping[str, Profile]] = MappingProxyType(
    {
        each.name: each
        for each in (
            PNC_1610,
            PNC_900,
            PNC_1050,
            PNC_1200,
            PNC_1600,
            PNC_1410,
            CX_24,
            GS_24,
            DXY_1300,
            HP_7470A,
            HP_7475A,
        )
    }
)
"""By name."""


def profile_named(name: str) -> Profile:
    """
    Return the profile of that name, however it is spaced and written: ``pnc1610``, ``PNC-1610``, ``hp_7475a``.

    Raises:
        InvalidCommandError: There is none; those that there are are told.
    """
    wanted = "".join(filter(str.isalnum, name)).upper()
    for each in PROFILES.values():
        if "".join(filter(str.isalnum, each.name)).upper() == wanted:
            return each
    raise InvalidCommandError(f"no profile {shown(name)}", hint=f"there are {', '.join(PROFILES)}")
