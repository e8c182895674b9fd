"""What can be set on a simulated cutter: its model, what no page at hand says, its mechanics, and trouble by chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final, Literal

from compax_aio.camm1.facts.handshakes import AckRule, XonRule
from compax_aio.camm1.facts.models import MODELS, Model
from compax_aio.camm1.facts.reports import StatusStyle

from ..knob_fields import Range, impossible
from ..knobs import DeviceKnobs, Probability, Seconds

__all__ = ["Knobs"]

_SPARE_BUFFER: Final = 1024
_USUAL_SPEEDS: Final = (1.0, 20.0)
_MOST_BYTES: Final = 1_000_000


class _ModelName:
    def __str__(self) -> str:
        return ", ".join(MODELS)

    def allows(self, value: str) -> bool:
        return value in MODELS


class _Answer:
    def __str__(self) -> str:
        return "up to 40 printable characters of ASCII, `model`, or `none`"

    def allows(self, value: str) -> bool:
        return 0 < len(value) <= 40 and value.isascii() and value.isprintable()


_Speed = Annotated[float, Range(0.1, 10_000)]
_Bytes = Annotated[int, Range(0, _MOST_BYTES)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs(DeviceKnobs):
    """
    How one simulated cutter behaves where no source at hand says it, and how fast it is.

    ``model`` as a value means: as that model has it, and where that is not known either, the likeliest.

    Raises:
        TransportError: A value is not possible; says which are.
    """

    device: ClassVar[str] = "CAMM-1 cutter"

    model: Annotated[str, _ModelName()] = "PNC-1610"
    """Which machine; it decides instructions, sizes, and how questions are answered."""

    # The line

    baudrate: Literal[0, 300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200] = 0
    """Byte timing of both directions; 0: bytes take no time."""
    byte_bits: Annotated[int, Range(9, 12)] = 10
    """Bits of a byte on the wire, with start, parity and stop bits."""
    data_bits: Literal[7, 8] = 8
    """7: a host that reads eight bits finds an even parity bit in replies."""
    dtr_wired: bool = False
    """DTR reaches the host, and stops what it writes; otherwise the cable has three wires."""
    dtr_overshoot: Annotated[int, Range(0, 4096)] = 0
    """So many bytes still come when DTR falls, besides the one under way: the FIFO of the host's UART."""
    host_queue: Annotated[int, Range(1, _MOST_BYTES)] = 4096
    """Bytes that the driver of the host takes before it holds the program up."""
    lost_on_close: bool = False
    """What the driver of the host has not sent when the program closes the port is lost."""

    # The buffer

    physical_size: _Bytes = 0
    """Bytes that the data buffer holds; 0: as the model, 1024 where nothing is known."""
    logical_size: _Bytes = 0
    """What .B answers at most, and .L; 0: as the model, or all that there is."""
    hidden_slack: Annotated[int, Range(-4096, 4096)] = 0
    """.B tells so many bytes more than there are; below zero: fewer."""
    free_on: Literal["fetch", "finish"] = "fetch"
    """The bytes of an instruction become free when it is read, or when it has been carried out."""
    overflow_drop: Literal["newest", "oldest"] = "newest"
    """Which bytes are lost when the buffer is full."""

    # Handshakes

    power_on_handshake: Literal["model", "hardwire", "xonxoff", "dummy"] = "model"
    """What rules after power-on; xonxoff: DC1, DC3 and 80 bytes."""
    ack_compare: Literal["model", "gt", "ge"] = "model"
    """ENQ is acknowledged when more is free than the block, or as much."""
    xon_rule: Literal["model", "half", "free>512", "stored<=128", "stored<=512"] = "model"
    """When Xon is sent after Xoff."""
    xoff_repeat_every: _Bytes = 0
    """Xoff comes again after so many more bytes; 0: once."""
    delay_on_xon: bool = False
    """The turnaround delay precedes Xon, too."""
    dtr_low_below: _Bytes = 0
    """DTR falls when less is free; 0: than the block, and a quarter of a small buffer."""
    dtr_high_at: _Bytes = 0
    """DTR rises when so much is free; 0: as it falls."""

    # Device control instructions

    bare_colon: Literal["swallow", "to_buffer", "required"] = "swallow"
    """A colon behind an instruction without parameters is taken with it, is data, or must be there."""
    allow_spaces: bool = False
    """Blanks between parameters are left out; otherwise they are error 12."""
    stray_esc: Literal["drop", "data"] = "drop"
    """ESC without a dot behind it is dropped with what follows, or both are data."""
    unfinished: Literal["drop", "apply"] = "drop"
    """What becomes of parameters that another ESC interrupts."""
    esc_splits_instruction: bool = False
    """A device control instruction within a cutting instruction ends that one."""
    dtr_control: Literal["model", "none", "dtr", "size"] = "model"
    """.@ is unknown, sets DTR alone, or the logical size too."""
    l_waits_empty: Literal["model", "0", "1"] = "model"
    """.L is answered only once the buffer is empty."""
    status_style: Literal["model", "codes", "word", "hp"] = "model"
    """How .O answers."""
    word_bit5: Literal[0, 1] = 0
    """Bit 5 of the status word."""
    answer_a: Annotated[str, _Answer()] = "model"
    """What .A answers; none: error 11."""
    answer_oi: Annotated[str, _Answer()] = "model"
    """What OI answers."""
    empty_e: bool = False
    """.E answers an empty line when there is no error."""
    error_latch: Literal["last", "first"] = "last"
    """Which of several errors .E tells."""
    reset_restores_dip: bool = False
    """.R brings the handshake of power-on back."""
    reset_clears_error: bool = False
    """.R and .K clear the error of .E."""
    k_window_ms: Annotated[float, Range(0, 10_000)] = 0.0
    """Data that comes so soon after .K is dropped as well."""
    k_drops_partial: bool = True
    """.K drops an instruction that has not come whole."""
    o_answers: Literal["parse", "motion"] = "parse"
    """Output instructions are answered while the vector before them is still made, or after it."""

    # The machine

    ready: bool = True
    """SETUP is lit at power-on."""
    accept_when_not_ready: bool = True
    """Data is taken and held while SETUP is off; otherwise it is lost."""
    language: Literal["both", "mode1", "mode2"] = "both"
    """Of cutting instructions."""
    on_data_error: Literal["model", "go_on", "stop"] = "model"
    """After an error in the data the next instruction is carried out, or none until power-on (PNC-900 p. 16)."""
    speed_cm_s: _Speed = 10.0
    """Of the tool when it is down and VS has not said another."""
    travel_cm_s: _Speed = 40.0
    """Of the tool when it is up."""
    vector_time_s: Seconds = 0.005
    """What each vector takes besides its length."""
    instruction_time_s: Seconds = 0.0005
    """What an instruction takes that moves nothing."""
    time_factor: Annotated[float, Range(0, 1000)] = 1.0
    """Everything takes so many times as long; 0: no time."""
    area_x: Annotated[int, Range(0, 2**26 - 1)] = 0
    """Steps that can be cut along x; 0: all that can be said. Below 0 nothing is cut."""
    area_y: Annotated[int, Range(0, 2**26 - 1)] = 0
    """And along y."""

    # Trouble, by chance

    seed: Annotated[int, Range(0, 2**32)] = 0
    """Of all chance."""
    lose_reply: Probability = 0.0
    """For each reply: it does not come."""
    garble_reply: Probability = 0.0
    """For each reply: one character of it is another."""
    late_reply: Probability = 0.0
    """For each reply: it comes ``late_s`` later."""
    late_s: Seconds = 1.0
    """How much later."""
    lose_xon: Probability = 0.0
    """For each Xon: it does not come."""
    spoil_byte: Probability = 0.0
    """For each byte of the host: it arrives as another, with error 15."""
    stray_byte: Probability = 0.0
    """For each device control instruction: a byte out of nothing is sent to the host."""

    def _check_together(self) -> None:
        if self.logical_size > self.physical_bytes:
            raise impossible(
                self.device, "logical_size", self.logical_size, f"at most {self.physical_bytes}, as physical"
            )
        if self.physical_size == 1:
            raise impossible(self.device, "physical_size", 1, "0, or 2 at least")

    # As the model has it

    @property
    def facts(self) -> Model:
        """What is known of the model."""
        return MODELS[self.model]

    @property
    def byte_time_s(self) -> float:
        """How long a byte is on the wire."""
        return self.byte_bits / self.baudrate if self.baudrate else 0.0

    @property
    def physical_bytes(self) -> int:
        """What the buffer holds."""
        known = self.facts.physical_bytes.value or self.facts.buffer_bytes.value or _SPARE_BUFFER
        return self.physical_size or known

    @property
    def logical_bytes(self) -> int:
        """What the buffer says it holds."""
        if self.logical_size or self.physical_size:
            return self.logical_size or self.physical_size
        return self.facts.buffer_bytes.value or self.physical_bytes

    @property
    def acknowledges_equal(self) -> bool:
        """Whether ENQ is acknowledged when exactly the block is free."""
        rule = _of_model(self.ack_compare, self.facts.ack_rule.value)
        return AckRule(rule) is AckRule.AT_LEAST

    @property
    def xon(self) -> XonRule:
        """When Xon is sent."""
        return XonRule(_of_model(self.xon_rule, self.facts.xon_rule.value))

    @property
    def status(self) -> StatusStyle:
        """How ``.O`` answers."""
        return StatusStyle(_of_model(self.status_style, self.facts.status_style.value))

    @property
    def power_on(self) -> str:
        """The handshake after power-on."""
        return str(_of_model(self.power_on_handshake, self.facts.power_on.value))

    @property
    def size_waits(self) -> bool:
        """Whether ``.L`` waits."""
        return (
            bool(self.facts.size_waits_for_empty.value) if self.l_waits_empty == "model" else self.l_waits_empty == "1"
        )

    @property
    def dtr_instruction(self) -> str:
        """What ``.@`` does: ``none``, ``dtr`` or ``size``."""
        if self.dtr_control != "model":
            return self.dtr_control
        return "dtr" if "@" in (self.facts.controls.value or ()) else "none"

    @property
    def letters(self) -> frozenset[str]:
        """Letters of the device control instructions that the machine knows."""
        known = (self.facts.controls.value or frozenset()) - {"@", "A"}
        return known | ({"@"} if self.dtr_instruction != "none" else set()) | ({"A"} if self.model_answer else set())

    @property
    def model_answer(self) -> str:
        """What ``.A`` answers; empty: it is unknown."""
        if self.answer_a == "model":
            return self.facts.model_answer.value or ""
        return "" if self.answer_a == "none" else self.answer_a

    @property
    def identity(self) -> str:
        """What ``OI`` answers."""
        known = self.facts.identity.value or self.model.partition("-")[2]
        return known if self.answer_oi == "model" else self.answer_oi

    @property
    def stops_on_error(self) -> bool:
        """Whether an error in the data ends cutting until power-on."""
        return self.model == "PNC-900" if self.on_data_error == "model" else self.on_data_error == "stop"

    @property
    def speeds_cm_s(self) -> tuple[float, float]:
        """What ``VS`` takes."""
        low, high = self.facts.speeds_cm_s.value or _USUAL_SPEEDS
        return low, max(high, self.speed_cm_s)


def _of_model(value: str, known: Any) -> str:
    return value if value != "model" else known.value
