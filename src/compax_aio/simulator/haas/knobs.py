"""What can be set on a simulated control: its settings, what no source at hand says, trouble, and hands for demos."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.facts.port_settings import Parity, Synchronization

from ..knob_fields import Range, impossible
from ..knobs import DeviceKnobs, Probability, Seconds
from .presses import KeyWords
from .sets import SETS

__all__ = ["Knobs"]

_MOST_BYTES: Final = 1_000_000


class _Word:
    """A word of several; ``_`` stands for a blank, which is a nuisance in URLs and shells."""

    def __init__(self, *words: str) -> None:
        self._words = words

    def __str__(self) -> str:
        return ", ".join(each.replace(" ", "_") for each in self._words)

    def allows(self, value: str) -> bool:
        return value.replace("_", " ") in self._words


class _Text:
    def __init__(self, longest: int) -> None:
        self._longest = longest

    def __str__(self) -> str:
        return f"up to {self._longest} printable characters of ASCII"

    def allows(self, value: str) -> bool:
        return len(value) <= self._longest and value.isascii() and (not value or value.isprintable())


_PROFILE: Final = "profile"
_Bytes = Annotated[int, Range(0, _MOST_BYTES)]
_Rate = Annotated[float, Range(0, 1e9)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs(DeviceKnobs):
    """
    How one simulated control is set, behaves where no source at hand says it, and fails.

    ``profile`` as a value of a setting means: as that set of settings has it.

    Raises:
        TransportError: A value is not possible; says which are.
    """

    device: ClassVar[str] = "Haas control"

    profile: Annotated[str, _Word(*SETS)] = "classic"
    """Set of settings; it decides all of them that are left at ``profile``. The baud rate is a knob of its own."""

    # Settings

    baudrate: Literal[0, 50, 110, 200, 300, 600, 1200, 2400, 4800, 7200, 9600, 19200, 38400, 115200] = 0
    """Setting 11: byte timing of both directions; 0: bytes take no time, so that no host can stop what is sent."""
    parity: Annotated[str, _Word(_PROFILE, *Parity)] = _PROFILE
    """Setting 12."""
    stop_bits: Literal["profile", 1, 2] = "profile"
    """Setting 13."""
    synchronization: Annotated[str, _Word(_PROFILE, *Synchronization)] = _PROFILE
    """Setting 14."""
    leader: Literal["none", "blank", "nul"] = "none"
    """Setting 24: what is sent in front of data; blank: spaces."""
    eob: Annotated[str, _Word(_PROFILE, *EobPattern)] = _PROFILE
    """Setting 25: what is sent for each end of block."""
    data_bits: Literal["profile", 7, 8] = "profile"
    """Setting 37; with 7, bytes that arrive lose their eighth bit unless ``parity_in_bytes`` is on."""
    add_spaces: Literal["profile", "on", "off"] = "profile"
    """Setting 41: spaces between the words of a block that is sent."""
    data_collection: Literal["profile", "off", "rs-232", "ethernet"] = "profile"
    """Setting 143: requests are answered, and in which form; ethernet: as newer controls do."""
    echo: Literal["profile", "on", "off"] = "profile"
    """Setting 187: a request is sent back in front of its answer."""

    # The line

    parity_in_bytes: bool = False
    """The eighth bit on the line is the parity bit, both ways, as if both ends were 8N1; a wrong one is seen."""
    host_queue: Annotated[int, Range(1, _MOST_BYTES)] = 4096
    """Bytes that the driver of the host takes before it holds the program up."""
    lost_on_close: bool = False
    """What the driver of the host has not sent when the program closes the port is lost."""
    rts_overshoot: Annotated[int, Range(0, 4096)] = 0
    """So many bytes still come when pin 4 falls, besides the one under way: the FIFO of the host's UART."""
    xoff_latency: Annotated[int, Range(0, 4096)] = 0
    """So many bytes still leave the control when the host stops it, besides the one under way."""
    pin4_idle: Literal["high", "low"] = "high"
    """Pin 4 while nothing is received and no requests are awaited: high as on real machines, so that bytes are lost."""

    # The receive buffer

    hwm: Annotated[int, Range(1, 65_536)] = 192
    """Bytes in the buffer at which the host is told to stop."""
    lwm: Annotated[int, Range(0, 65_536)] = 64
    """Bytes at which it is told to go on."""
    slack: Annotated[int, Range(0, 65_536)] = 64
    """So many bytes more than ``hwm`` find room, 256 in all; the next one is lost, with alarm 414."""
    take_bytes_s: _Rate = 0.0
    """Bytes that are taken out of the buffer in a second; 0: all as they come, so that it never fills."""
    overflow_stops: bool = True
    """Alarm 414 ends the receive operation; otherwise it goes on with what is left."""

    # Synchronization

    xon_at_start: bool = False
    """With Xon and Xoff, a receive operation begins with Xon."""
    drop_dc1: bool = False
    """DC1 (reader on) does not come."""
    drop_dc2: bool = False
    """DC2 (punch on) does not come."""
    drop_dc3: bool = False
    """DC3 (reader off) does not come."""
    drop_dc4: bool = False
    """DC4 (punch off) does not come."""
    dc1_delay_s: Seconds = 0.0
    """DC1 comes so late."""
    dc2_delay_s: Seconds = 0.0
    """DC2 comes so late, and the data behind it."""
    dc3_delay_s: Seconds = 0.0
    """DC3 comes so late."""
    dc4_delay_s: Seconds = 0.0
    """DC4 comes so long after the data."""
    nak_every_s: Annotated[float, Range(0.01, 3600)] = 1.0
    """Spacing of the NAK with which a receive operation by XMODEM begins."""
    end_answer: Literal["cancel", "ack"] = "cancel"
    """What answers EOT: CAN CAN CAN, as seen on a machine, or ACK."""
    repeated_block: Literal["ack", "ignore"] = "ack"
    """A block that was taken already is acknowledged again, or not answered."""
    block_wait_s: Annotated[float, Range(0.01, 3600)] = 10.0
    """An answer or a block that does not come for so long has been lost; a block that stops in the middle, 1 s."""
    block_retries: Annotated[int, Range(1, 1000)] = 10
    """So often a block is tried again."""
    sum_as_if_lf: bool = False
    """The sum of a block is that of a block whose ends of block are LF, whatever travels."""

    # Files

    o_digits: Literal[4, 5] = 5
    """Digits of a program's name as it is sent; a longer name that comes is alarm 405."""
    lead_in: bool = True
    """An end of block precedes the first % of programs."""
    blank_before_end: bool = True
    """An empty block precedes the last % of programs."""
    all_in: Literal["one_pair", "pairs"] = "one_pair"
    """ALL is sent within one pair of %, or each program within its own."""
    end_of_receive: Literal["percent", "eob", "silence"] = "percent"
    """What ends a receive operation: the second %, its end of block, or silence behind it, so that more may follow."""
    silence_s: Seconds = 1.0
    """How long that silence is."""
    input_timeout_s: Seconds = 0.0
    """A receive operation in which nothing comes for so long ends with alarm 412; 0: it waits for RESET."""
    garbled_as_comment: bool = True
    """A block that is none is stored as a comment, with an alarm; otherwise it is stored as it came."""
    keeps_partial: bool = True
    """What has come of a program before an abort is stored."""
    memory_bytes: Annotated[int, Range(1, 64 * 1024 * 1024)] = 16 * 1024 * 1024
    """Room for programs; more is alarm 413."""
    max_programs: Annotated[int, Range(1, 100_000)] = 500
    """More is alarm 403."""
    v_digits: Annotated[int, Range(0, 12)] = 0
    """Whole V values are sent with so many digits, zeros in front; 0: as many as they have."""
    needs_n9999: bool = True
    """Macro variables without N9999 are an alarm."""
    parameters_without_n0: Literal["refuse", "load"] = "refuse"
    """Parameters without N0 are not loaded, or loaded with an alarm."""

    # DNC

    dnc_block_s: Seconds = 0.0
    """How long the execution of a block lasts."""
    look_ahead: Annotated[int, Range(1, 10_000)] = 15
    """Blocks that are read and not begun; then no more is taken out of the buffer."""
    dnc_ends: Literal["percent", "never"] = "percent"
    """The second % ends DNC, or RESET alone."""
    dnc_crash_above_n: Annotated[int, Range(0, 10**9)] = 0
    """A line number above that freezes the control, as 100 000 did a VF-2; 0: none does."""

    # Data collection

    serial_number: Annotated[str, _Text(20)] = "1234567"
    """What Q100 answers."""
    software: Annotated[str, _Text(30)] = "VER 000.00"
    """What Q101 answers."""
    model: Annotated[str, _Text(20)] = "VF2"
    """What Q102 answers."""
    answer_time_s: Seconds = 0.0
    """From the end of a request to the begin of its answer."""
    value_width: Annotated[int, Range(1, 30)] = 10
    """Blanks fill the value of a variable up to so many characters."""
    busy_answers: Literal["q500", "all"] = "q500"
    """What is answered by STATUS, BUSY while a cycle runs."""
    write_answer: Literal["frame", "bare", "none"] = "frame"
    """How ! comes when a variable was written: in a frame, alone, or not at all."""
    first_request_lost: bool = False
    """The first request of a connection is not answered, as on newer controls."""
    freeze_after: Annotated[int, Range(0, 1_000_000)] = 0
    """So many requests too close to each other freeze the control; 0: it never freezes."""
    freeze_gap_s: Seconds = 0.05
    """A request is too close to the answer before it if the line was quiet for less."""
    freeze_ends: Literal["reset", "power"] = "reset"
    """What ends that."""
    dprnt: Annotated[str, _Text(200)] = ""
    """A program prints this line, again and again; * is a space."""
    dprnt_every_s: Annotated[float, Range(0.01, 3600)] = 5.0
    """How often."""
    dprnt_inside: bool = False
    """What is printed comes inside the next answer, not between answers."""
    cycle_s: Seconds = 0.0
    """Cycles of so long run by themselves, with a pause as long as one between them; 0: none does."""

    # Trouble, by chance

    seed: Annotated[int, Range(0, 2**32)] = 0
    """Of all chance."""
    parity_fault: Probability = 0.0
    """For each byte of a file that comes: its parity is wrong."""
    framing_fault: Probability = 0.0
    """For each byte of a file that comes: its stop bit is."""
    spoil_sent: Probability = 0.0
    """For each byte that the control sends: one of its bits is another."""
    lose_xon: Probability = 0.0
    """For each Xon: it does not come."""
    lose_xoff: Probability = 0.0
    """For each Xoff: it does not come."""
    refuse_block: Probability = 0.0
    """For each good block of XMODEM: it is answered by NAK."""
    lose_reply: Probability = 0.0
    """For each answer of data collection: it does not come."""
    garble_reply: Probability = 0.0
    """For each answer: one character of it is another."""
    double_reply: Probability = 0.0
    """For each answer: it comes twice."""
    late_reply: Probability = 0.0
    """For each answer: it comes ``late_s`` later."""
    late_s: Seconds = 1.0
    """How much later."""
    foreign_reply: Probability = 0.0
    """For each request: an answer to another host comes first, as over Ethernet."""

    # Hands

    press: Annotated[str, KeyWords()] = ""
    """Keys that press themselves, each after the operation before is over: recv, recv:settings, send:O00010, send:ALL,
    send:last, dnc, cycle; several with commas."""
    press_after_s: Seconds = 1.0
    """From the first connection to the first key; recv and dnc come at once where no sign tells the host to begin."""
    press_pause_s: Seconds = 3.0
    """From the end of an operation to the next key."""
    press_again: bool = False
    """After the last key the first one follows."""
    program_blocks: Annotated[int, Range(1, 1_000_000)] = 12
    """Blocks of the program O00010 that is in memory."""

    def _check_together(self) -> None:
        if self.lwm >= self.hwm:
            raise impossible(self.device, "lwm", self.lwm, f"less than hwm, which is {self.hwm}")
        if self.mode is Synchronization.XMODEM and self.bits == 7:
            raise impossible(self.device, "data_bits", 7, "8 with XMODEM, whose first block has a byte FE already")
        if self.parity_in_bytes and (self.bits == 8 or self.parity_bit is Parity.NONE):
            raise impossible(self.device, "parity_in_bytes", 1, "0, unless there are 7 data bits and a parity")

    @classmethod
    def named(cls, profile: str, **others: Any) -> Self:
        """
        Return the knobs of a set of settings that was seen at work, at its baud rate.

        Args:
            profile: As the knob.
            others: Knobs that are otherwise.

        Raises:
            TransportError: There is none of that name, or no such knob value.
        """
        known = SETS.get(profile.replace("_", " "))
        return cls(**{"profile": profile, "baudrate": 0 if known is None else known.baudrate, **others})

    # As the set of settings has it

    def _setting(self, value: Any, name: str) -> Any:
        return getattr(SETS[self.profile.replace("_", " ")], name) if value == _PROFILE else value

    @property
    def mode(self) -> Synchronization:
        """Setting 14."""
        return Synchronization(self._setting(self.synchronization, "synchronization").replace("_", " "))

    @property
    def parity_bit(self) -> Parity:
        """Setting 12."""
        return Parity(self._setting(self.parity, "parity"))

    @property
    def bits(self) -> int:
        """Setting 37."""
        return int(self._setting(self.data_bits, "data_bits"))

    @property
    def eob_pattern(self) -> EobPattern:
        """Setting 25."""
        return EobPattern(self._setting(self.eob, "eob").replace("_", " "))

    @property
    def spaces(self) -> bool:
        """Setting 41."""
        return bool(self._setting(self.add_spaces, "add_spaces") in {"on", True})

    @property
    def collection(self) -> str:
        """Setting 143: ``off``, ``rs-232`` or ``ethernet``."""
        return str(self._setting(self.data_collection, "data_collection"))

    @property
    def echoes(self) -> bool:
        """Setting 187."""
        return bool(self._setting(self.echo, "echo") in {"on", True})

    @property
    def stop_bit_count(self) -> int:
        """Setting 13."""
        return int(self._setting(self.stop_bits, "stop_bits"))

    @property
    def byte_bits(self) -> int:
        """Bits of a byte on the wire, with start, parity and stop bits."""
        return 1 + self.bits + (self.parity_bit is not Parity.NONE) + self.stop_bit_count

    @property
    def byte_time_s(self) -> float:
        """How long a byte is on the wire."""
        return self.byte_bits / self.baudrate if self.baudrate else 0.0
