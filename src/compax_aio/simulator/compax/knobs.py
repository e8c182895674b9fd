"""What can be set on a simulated drive: every ambiguity of the manuals, the mechanics, and the line's speed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from compax_aio.compax.facts.commands import COMMANDS
from compax_aio.compax.facts.limits import MAX_ACCELERATION_TIME_MS, MAX_POSITION, MAX_SPEED_PERCENT

from ..knob_fields import Range, impossible
from ..knobs import DeviceKnobs, Seconds

__all__ = ["Knobs"]


class _NewWord:
    """A word that means nothing else; what it is at the line, blanks mean nothing."""

    _FORM = re.compile("[A-Z][A-Z ]{0,18}[A-Z]")
    _TAKEN = frozenset({"VP", "VC", *(form.replace(" ", "") for row in COMMANDS for form in (row.long, row.short))})

    def __str__(self) -> str:
        return "2 to 20 capitals, no command that has another meaning"

    def allows(self, value: str) -> bool:
        return self._FORM.fullmatch(value) is not None and value.replace(" ", "") not in self._TAKEN


_Position = Annotated[float, Range(-MAX_POSITION, MAX_POSITION)]
_RampTime = Annotated[int, Range(0, MAX_ACCELERATION_TIME_MS)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs(DeviceKnobs):
    """
    How one simulated drive behaves where the manuals leave it open, and what it moves.

    Where the pages at hand leave several readings open, the default is the likeliest, and each other one can be set.

    Raises:
        TransportError: A value is not possible; says which are.
    """

    device: ClassVar[str] = "COMPAX"

    # How it answers

    error_style: Literal["code", "text", "prompt_only", "silent"] = "code"
    """``E92`` and prompt; ``E92 command active`` and prompt; a bare prompt; nothing at all."""
    position_reached: Literal["prompt_first", "final_only"] = "prompt_first"
    """An accepted ``$`` command gets its prompt and later ``$``; or nothing but the final ``$``."""
    position_reached_on_stop: bool = False
    """``$`` is sent also when STOP, BREAK or a fault ended the move (then once, not again after START)."""
    position_reached_on_home: bool = True
    """``POSA HOME$`` sends ``$``; if not, it is accepted and sends none."""
    comparator_messages: Literal["always", "with_sign"] = "always"
    """Comparators send their number in every move, or only in one that carried ``$``."""
    comparator_form: Literal["number_first", "prompt_first"] = "number_first"
    """``n CR LF >`` or ``CR LF > n``."""
    comparator_numbering: Literal["comparators", "points"] = "comparators"
    """The number counts comparators alone, or all prepared points, speed steps too (UG p. 162 leaves it open)."""
    reply_padding: Literal["none", "blanks", "unit"] = "none"
    """``S001: 123.45``; right-aligned between blanks; followed by the unit."""
    decimals: Literal[2, 3] = 2
    """Of positions and distances, in and out (UG p. 100); ``unit=inch`` in a query means 3 unless it says."""
    status_bits_blank: bool = False
    """S16 and S17 as ``1101 0000``."""
    fault_numbers: Literal["two", "one"] = "two"
    """S30 is ``55 0`` or ``55``."""
    echo_sign: Literal["echo_and_execute", "echo_only"] = "echo_and_execute"
    """What ``?`` does besides sending back what was received."""
    store: Literal["until_executed", "until_next_line"] = "until_executed"
    """How long ``,`` keeps an instruction: until ``!`` took it, or at most until any other line."""
    long_line: Literal["error", "truncate"] = "error"
    """More than 30 characters are refused, or cut."""
    echo: bool = False
    """A received line comes back with its CR before it is answered."""
    power_on_text: Literal["nothing", "prompt", "banner"] = "nothing"
    """What the drive sends when power comes back."""
    lower_case: Literal["folded", "error"] = "folded"
    """What becomes of small letters: the fieldbus wants capitals (IBS p. 23), RS-232 does not say."""
    ready_after_answer: bool = False
    """A command is received only after the last answer is out (UG p. 160): bytes before that are lost, not kept."""
    xonxoff: bool = False
    """P20 bit 0: Xoff from the host holds the output. Without it Xon and Xoff are characters like others."""
    p20: Annotated[int, Range(0, 255)] = 0
    """P20 at the beginning, beside what ``xonxoff`` and ``error_style`` set; 16: binary commands (UG p. 166)."""

    # Parameters

    password: Literal["enforced", "off"] = "enforced"
    """Parameters but P40-P49 are written only after GOTO 302 or GOTO 620; or always."""
    vp: Literal["needed", "at_once"] = "needed"
    """Written parameters but P40-P49 take effect at VP; or at once."""
    parameter_reading: Literal["written", "valid"] = "written"
    """A parameter that waits for VP reads as it was written; or as it is still valid."""
    trailing_zeros: Literal["not_control", "all", "none"] = "not_control"
    """All decimals that are stored in parameters but P40-P49, ``P002: 100.000``; in variables too; or in none."""

    real_zero_word: Annotated[str, _NewWord()] = "REALZERO"
    """Takes the place where the axis is as real zero: the function exists (CAN p. 32), its word is a placeholder."""

    # The line and the processor

    baudrate: Literal[0, 9600, 4800] = 0
    """Byte timing of both directions, ten bits a byte; 0: bytes take no time."""
    answer_time_s: Seconds = 0.002
    """From the CR of a line to its execution and the first byte of its answer (not documented)."""
    record_time_s: Annotated[float, Range(0.0001, 3600)] = 0.002
    """What a record of the program takes (not documented)."""
    self_test_s: Seconds = 0.0
    """After power-on, S16 bit 1 stays 0 and positioning is refused for so long (UG p. 209; the time is unknown)."""

    # The axis

    unit: Literal["mm", "inch", "degree", "increments"] = "mm"
    """P90: what positions are counted in."""
    nominal_speed: Annotated[float, Range(0.001, 1e9)] = 200.0
    """Units per second at SPEED 100."""
    speed_percent: Annotated[float, Range(0.001, MAX_SPEED_PERCENT)] = 100.0
    """P2: the speed from power-on until SPEED says another."""
    acceleration_ms: _RampTime = 250
    """P6: the time from standstill to nominal speed, from power-on until ACCEL says another."""
    stop_ramp_ms: _RampTime = 100
    """P10: the time from nominal speed to standstill for STOP, BREAK and faults."""
    position: _Position = 0.0
    """What S1 reads at the beginning."""
    machine_zero: _Position = 0.0
    """Where machine zero lies, as a distance from the position at the beginning; meaningless if ``homed``."""
    homed: bool = False
    """Machine zero has been found, so that it lies at position 0."""
    travel_min: _Position = -MAX_POSITION
    """P12: targets below it are refused."""
    travel_max: _Position = MAX_POSITION
    """P11: targets above it are refused."""
    following_error_factor: Annotated[float, Range(0, 1)] = 0.001
    """Following error in units for each unit per second: the time in s by which the axis lags behind."""

    def _check_together(self) -> None:
        if self.travel_min >= self.travel_max:
            raise impossible(self.device, "travel_min", self.travel_min, f"less than travel_max, {self.travel_max:g}")

    @classmethod
    def _defaults_with(cls, query: Mapping[str, str]) -> Mapping[str, Any]:
        return {"decimals": 3} if query.get("unit") == "inch" else {}
