"""What is known of each model, every cell with its source and how well it is founded; the sheet says what is not."""

# ruff: noqa: RUF009  (a cell is frozen, so that all models may share it as a default)

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Generic, TypeVar

from ...certainty import Certainty
from .handshakes import AckRule, PowerOnHandshake, XonRule
from .line import STEPS_PER_MM
from .mnemonics import CAMM_GL_III, HP_7470A_SET, HP_7475A_SET
from .reports import StatusStyle

__all__ = ["MODELS", "Fact", "Model"]

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Fact(Generic[_T]):
    """One cell."""

    value: _T | None
    """None where it is not known, or where the machine has no such thing: the certainty says which."""
    certainty: Certainty
    source: str = ""

    @property
    def known(self) -> _T | None:
        """The value, unless it is a placeholder: what a client may go by."""
        return None if self.certainty is Certainty.PLACEHOLDER else self.value


def _printed(value: _T | None, source: str) -> Fact[_T]:
    return Fact(value, Certainty.DOCUMENTED, source)


def _reported(value: _T | None, source: str) -> Fact[_T]:
    return Fact(value, Certainty.REPORTED, source)


def _inferred(value: _T | None, source: str) -> Fact[_T]:
    return Fact(value, Certainty.INFERRED, source)


def _guess(value: _T | None) -> Fact[_T]:
    return Fact(value, Certainty.PLACEHOLDER)


def _unknown() -> Fact[_T]:
    return Fact(None, Certainty.UNKNOWN)


_BASIC: Final = frozenset("BMNHI")
_STATUS_AND_ABORT: Final = frozenset("OELJKR")
_CUTTER: Final = _BASIC | _STATUS_AND_ABORT
_HP_WIRING: Final = frozenset("()YZ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """
    One model, as cells.

    Attributes:
        name: As it is written on the machine.
        buffer_bytes: What ``.B`` answers when nothing is stored; a client measures it all the same.
        physical_bytes: What the buffer holds, where it holds more than it tells.
        baud_rates: That can be chosen.
        frame: Data bits, parity, stop bits as it is delivered.
        controls: Letters of the device control instructions that it has.
        colons: Letters without parameters that its manual prints with a colon.
        lowest_threshold: Of P1 of ``.I`` for Xon/Xoff, bytes.
        status_style: How ``.O`` answers.
        model_answer: Of ``.A``; None if it has none.
        identity: What ``OI;`` answers.
        size_waits_for_empty: Whether ``.L`` answers only once the buffer is empty.
        power_on: The handshake after power-on.
        xon_rule: When Xon is sent.
        ack_rule: When ENQ is acknowledged.
        mnemonics: Names of the instructions of its languages.
        steps_per_mm: Of coordinates.
        area_mm: The largest sheet it can cut: along the axis that is fed, then across; which of x and y is fed is not
            known.
        speeds_cm_s: Lowest and highest of ``VS``.
        force_instruction: ``!FS`` or ``FS``; None if the force is set by hand.
        forces: Lowest and highest of it: gf with ``!FS``, the machine's own steps with ``FS``.
        tool_instruction: ``!ST`` or ``SP``.
        tools: Lowest and highest of it.
        feeds_mm: Lowest and highest of ``!PG``; None if it has none.
        remarks: For people.
    """

    name: str
    buffer_bytes: Fact[int] = _guess(1024)
    physical_bytes: Fact[int] = _unknown()
    baud_rates: Fact[tuple[int, ...]] = _guess((9600,))
    frame: Fact[str] = _guess("8N1")
    controls: Fact[frozenset[str]] = _inferred(_CUTTER, "first page of the table, PNC-900")
    colons: Fact[frozenset[str]] = _inferred(frozenset(), "PNC-900 p. 20-21")
    lowest_threshold: Fact[int] = _printed(0, "PNC-1610 p. 29")
    status_style: Fact[StatusStyle] = _guess(StatusStyle.CODES)
    model_answer: Fact[str] = _unknown()
    identity: Fact[str] = _unknown()
    size_waits_for_empty: Fact[bool] = _guess(False)
    power_on: Fact[PowerOnHandshake] = _guess(PowerOnHandshake.HARDWIRE)
    xon_rule: Fact[XonRule] = _guess(XonRule.HALF)
    ack_rule: Fact[AckRule] = _printed(AckRule.ABOVE, "PNC-1610 p. 28")
    mnemonics: Fact[frozenset[str]] = _inferred(CAMM_GL_III, "PNC-900 p. 18-19")
    steps_per_mm: Fact[float] = _inferred(STEPS_PER_MM, "PNC-900 p. 23")
    area_mm: Fact[tuple[float, float]] = _unknown()
    speeds_cm_s: Fact[tuple[float, float]] = _unknown()
    force_instruction: Fact[str] = _unknown()
    forces: Fact[tuple[float, float]] = _unknown()
    tool_instruction: Fact[str] = _inferred("!ST", "PNC-900 p. 19")
    tools: Fact[tuple[int, int]] = _inferred((0, 1), "PNC-900 p. 19")
    feeds_mm: Fact[tuple[float, float]] = _inferred((-1600, 1600), "PNC-900 p. 19")
    remarks: str = ""


_PNC_900_AREA: Final = (24_998.0, 280.0)

_PNC_1610: Final = Model(
    name="PNC-1610",
    controls=_inferred(_BASIC | frozenset("PAO") | frozenset("ELJKR"), "PNC-1610 p. 28-29; PNC-900 p. 21"),
    colons=_printed(frozenset("OA"), "PNC-1610 p. 29"),
    status_style=_printed(StatusStyle.WORD, "PNC-1610 p. 29"),
    model_answer=_printed("1610", "PNC-1610 p. 29"),
    identity=_guess("1610"),
    size_waits_for_empty=_guess(True),
    remarks="presets by .P; no .@ is listed; document 980109",
)

_PNC_900: Final = Model(
    name="PNC-900",
    buffer_bytes=_printed(1024, "PNC-900 p. 21"),
    physical_bytes=_printed(2048, "PNC-900 p. 23"),
    baud_rates=_printed((4800, 9600), "PNC-900 p. 5, 24"),
    frame=_printed("8N1", "PNC-900 p. 5, 24"),
    controls=_printed(_CUTTER | {"@"}, "PNC-900 p. 20-21"),
    colons=_printed(frozenset(), "PNC-900 p. 20-21"),
    status_style=_printed(StatusStyle.CODES, "PNC-900 p. 20"),
    model_answer=_inferred(None, "not in PNC-900 p. 20-21"),
    identity=_printed("900", "PNC-900 p. 19"),
    size_waits_for_empty=_printed(False, "PNC-900 p. 21"),
    power_on=_printed(PowerOnHandshake.HARDWIRE, "PNC-900 p. 5: SW-6 off"),
    mnemonics=_printed(CAMM_GL_III, "PNC-900 p. 18-19"),
    steps_per_mm=_printed(STEPS_PER_MM, "PNC-900 p. 23"),
    area_mm=_printed(_PNC_900_AREA, "PNC-900 p. 8, 23"),
    speeds_cm_s=_printed((1, 20), "PNC-900 p. 19, 23"),
    force_instruction=_inferred(None, "a slider, 30-200 gf (PNC-900 p. 23)"),
    tool_instruction=_printed("!ST", "PNC-900 p. 19"),
    tools=_printed((0, 1), "PNC-900 p. 19"),
    feeds_mm=_printed((-1600, 1600), "PNC-900 p. 19"),
    remarks="2 KB buffer of which 1024 are told; a data error is cleared by a power cycle alone",
)

_PNC_1050: Final = Model(
    name="PNC-1050",
    controls=_inferred(_CUTTER | {"@"}, "PNC-1050 p. 32-33"),
    lowest_threshold=_printed(10, "PNC-1050 p. 33"),
)

_HP_7475A: Final = Model(
    name="HP 7475A",
    buffer_bytes=_reported(1024, "7475A notes"),
    baud_rates=_reported((300, 600, 1200, 2400, 4800, 9600), "up to 9600: hpplot; 7475A notes"),
    frame=_reported("8N1", "hpplot; 7475A notes"),
    controls=_inferred(_CUTTER | {"@"} | _HP_WIRING, "HP7470 p. 10-23"),
    status_style=_reported(StatusStyle.HP, "hpgl-buddy"),
    model_answer=_reported(None, "djipco/hpgl"),
    identity=_reported("7475A", "7475A notes"),
    size_waits_for_empty=_guess(True),
    power_on=_reported(PowerOnHandshake.HARDWIRE, "softsolder 2015-05-04"),
    xon_rule=_reported(XonRule.STORED_512, "grblHAL HPGL plugin"),
    ack_rule=_printed(AckRule.AT_LEAST, "HP7470 p. 10-16"),
    mnemonics=_reported(HP_7475A_SET, "hpgl-to-svg"),
    steps_per_mm=_reported(1 / 0.02488, "vpype"),
    force_instruction=_inferred(None, "not in its set"),
    tool_instruction=_inferred("SP", "in its set"),
    tools=_inferred((0, 6), "six pens"),
    feeds_mm=_inferred(None, "!PG is Roland's"),
)

MODELS: Final[Mapping[str, Model]] = MappingProxyType(
    {
        row.name: row
        for row in (
            _PNC_1610,
            _PNC_900,
            _PNC_1050,
            Model(name="PNC-1200", controls=_inferred(_CUTTER | {"@"}, "PNC-1850/1200 p. 41, first page")),
            Model(name="PNC-1600", controls=_inferred(_CUTTER | {"@"}, "PNC-1900/1600 p. 33, first page")),
            Model(
                name="PNC-1410",
                baud_rates=_reported((2400, 4800, 9600, 19200), "inkcut 303"),
                area_mm=_unknown(),
                remarks="889 mm wide (inkcut 303)",
            ),
            Model(
                name="CX-24",
                force_instruction=_unknown(),
                remarks="584 mm wide; moves to bottom right and up as +x and +y (cammcut)",
            ),
            Model(
                name="GS-24",
                steps_per_mm=_reported(STEPS_PER_MM, "fab tools"),
                speeds_cm_s=_reported((1, 50), "10-500 mm/s: fab tools"),
                force_instruction=_reported("!FS", "a common fab tool, .camm samples"),
                forces=_reported((30, 350), "30-350 gf: fab tools"),
                tool_instruction=_reported("!ST", "a common fab tool, .camm samples"),
            ),
            Model(
                name="DXY-1300",
                buffer_bytes=_printed(1024, "DXY p. 5-19"),
                baud_rates=_guess((9600,)),
                frame=_reported("8N1", "DXY p. 5-10; a workshop runs 7E1"),
                controls=_inferred(_CUTTER | {"@"}, "DXY ch. 5"),
                lowest_threshold=_printed(10, "DXY p. 5-20"),
                status_style=_printed(StatusStyle.CODES, "DXY p. 5-21"),
                identity=_guess("DXY-1300"),
                size_waits_for_empty=_guess(True),
                xon_rule=_inferred(XonRule.FREE_ABOVE_512, "DXY p. 5-12, of the DXY-1000"),
                mnemonics=_inferred(CAMM_GL_III | HP_7475A_SET, "DXY ch. 3"),
                force_instruction=_unknown(),
                tool_instruction=_inferred("SP", "a plotter with pens"),
                tools=_inferred((0, 8), "eight pens"),
                feeds_mm=_inferred(None, "a flat bed"),
            ),
            Model(
                name="HP 7470A",
                buffer_bytes=_printed(255, "HP7470 p. 10-26"),
                baud_rates=_HP_7475A.baud_rates,
                frame=_HP_7475A.frame,
                controls=_printed(_CUTTER | {"@"} | _HP_WIRING, "HP7470 p. 10-23"),
                colons=_printed(frozenset(), "HP7470 p. 10-23"),
                status_style=_reported(StatusStyle.HP, "hpgl-buddy"),
                model_answer=_reported(None, "djipco/hpgl"),
                identity=_guess("7470A"),
                size_waits_for_empty=_guess(True),
                xon_rule=_printed(XonRule.STORED_128, "HP7470 p. 10-20"),
                ack_rule=_printed(AckRule.AT_LEAST, "HP7470 p. 10-16"),
                mnemonics=_inferred(HP_7470A_SET, "HP 7475A without what came with it"),
                steps_per_mm=_inferred(STEPS_PER_MM, "as HP-GL has it"),
                force_instruction=_inferred(None, "not in its set"),
                tool_instruction=_inferred("SP", "in its set"),
                tools=_inferred((0, 2), "two pens"),
                feeds_mm=_inferred(None, "!PG is Roland's"),
            ),
            _HP_7475A,
        )
    }
)
