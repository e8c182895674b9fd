"""How a simulated cutter keeps its host from sending too much: ENQ and ACK, Xon and Xoff, and DTR."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Final

from compax_aio.camm1.facts.handshakes import OutputKind, xon_when_stored
from compax_aio.camm1.facts.instructions import DEFAULT_BLOCK_SIZE
from compax_aio.camm1.facts.line import ACK, DC1, DC3, ENQ

from ..wire import Wire
from .buffer import Buffer
from .log import LogKind
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Handshakes", "string_of"]

_SMALL_BUFFER_PART: Final = 4


@dataclass(frozen=True, slots=True)
class _Rule:
    """What ``.H`` or ``.I`` has set."""

    mode: str = "dummy"
    """``enq1``, ``enq2``, ``xon`` or ``dummy``."""
    block: int = DEFAULT_BLOCK_SIZE
    enquiry: int = ENQ
    answer: bytes = bytes([ACK])


class Handshakes:
    """
    All handshakes of one cutter; what is stored and free is its buffer's.

    Args:
        around: Of the cutter.
        buffer: Its data buffer.
        wire: From the host; stopped and let go by DTR, if that is wired.
        transmitter: To the host.
        trouble: Which Xon are lost.

    Attributes:
        logical_bytes: What the buffer says it holds; ``.@`` may set it.
        string: Xoff, or the immediate response (``.N``).
        dtr_follows: Whether DTR follows the free space.
        is_dtr_high: Whether DTR says that there is room.
        is_stopped: Whether Xoff was sent, and no Xon since.
        owes_ack: Whether an ENQ waits for room.
    """

    def __init__(
        self, around: Surroundings, buffer: Buffer, wire: Wire, transmitter: Transmitter, trouble: Trouble
    ) -> None:
        self._around = around
        self._knobs = knobs = around.knobs
        self._buffer = buffer
        self._wire = wire
        self._transmitter = transmitter
        self._trouble = trouble
        self.logical_bytes = knobs.logical_bytes
        self.is_dtr_high = True
        self.power_on()

    def power_on(self) -> None:
        """Let rule what rules after power-on."""
        self._rule = _Rule()
        self._has_set_block = False
        self.string = b""
        self.logical_bytes = self._knobs.logical_bytes
        self.is_stopped = self.owes_ack = False
        self._since_xoff = 0
        self.dtr_follows = self._knobs.power_on == "hardwire"
        if self._knobs.power_on == "xonxoff":
            self._rule = _Rule("xon", answer=bytes([DC1]))
            self.string = bytes([DC3])

    # What is set

    def set_rule(self, letter: str, block: int, enquiry: int, answer: bytes, now: float, *, is_bare: bool) -> None:
        """Take ``.H`` or ``.I``; the last one rules."""
        self._has_set_block = not is_bare
        if enquiry:
            self._rule = _Rule("enq1" if letter == "H" else "enq2", block, enquiry, answer)
        elif letter == "I" and answer:
            self._rule = _Rule("xon", block, 0, answer)
        else:
            self._rule = _Rule(block=block)
        self.owes_ack = self.is_stopped = False
        self.look(now)

    def set_string(self, string: bytes, now: float) -> None:
        """Take the string of ``.N``."""
        self.string = string
        self.is_stopped = self.is_stopped and bool(string)
        self.look(now)

    def set_dtr(self, follows: bool, logical_bytes: int | None, now: float) -> None:
        """Take ``.@``."""
        self.dtr_follows = follows
        if logical_bytes is not None and self._knobs.dtr_instruction == "size":
            self.logical_bytes = max(1, min(logical_bytes, self._buffer.size))
        self.look(now)

    def abort(self) -> None:
        """Owe no ACK any more (``.J``)."""
        self.owes_ack = False

    # What is free

    @property
    def free(self) -> int:
        """Bytes for which there is room, as far as the buffer says it goes."""
        return min(self.logical_bytes, self._buffer.room)

    @property
    def told_free(self) -> int:
        """What ``.B`` answers."""
        return max(0, self.free + self._knobs.hidden_slack)

    @property
    def enquiry(self) -> bytes:
        """The character that asks for room; empty: none does."""
        return bytes([self._rule.enquiry]) if self._rule.enquiry else b""

    @property
    def _is_xon(self) -> bool:
        return self._rule.mode == "xon" and bool(self.string)

    @property
    def _dtr_low_below(self) -> int:
        if self._knobs.dtr_low_below or self._has_set_block:
            return self._knobs.dtr_low_below or self._rule.block
        return min(self._rule.block, self._buffer.size // _SMALL_BUFFER_PART)

    @property
    def headroom(self) -> int:
        """So many bytes can be stored before anything has to be said or is lost."""
        room = self._buffer.room
        headroom: float = room
        if self._is_xon:
            headroom = min(headroom, self._until_repeat() if self.is_stopped else room - self._rule.block)
        if self.dtr_follows and self.is_dtr_high:
            headroom = min(headroom, room - self._dtr_low_below)
        return max(0, int(headroom))

    @property
    def until_told(self) -> int | None:
        """So many bytes can be stored before the host has to be told something; None: it need not be."""
        if (self._is_xon and (not self.is_stopped or self._knobs.xoff_repeat_every)) or (
            self.dtr_follows and self.is_dtr_high and self._knobs.dtr_wired
        ):
            return self.headroom
        return None

    @property
    def waits_for_room(self) -> bool:
        """Whether the host is told as soon as there is room."""
        return self.is_stopped or self.owes_ack or not self.is_dtr_high

    def _until_repeat(self) -> float:
        return self._knobs.xoff_repeat_every - 1 - self._since_xoff if self._knobs.xoff_repeat_every else inf

    # What happens

    def stored(self, count: int, now: float) -> None:
        """Take note of bytes that were stored."""
        if self.is_stopped:
            self._since_xoff += count
        self.look(now)

    def look(self, now: float) -> None:
        """Stop the host if too little is free."""
        if self._is_xon:
            is_due = not self.is_stopped and self.free < self._rule.block
            if is_due or (self.is_stopped and self._until_repeat() < 0):
                self.is_stopped = True
                self._since_xoff = 0
                self._around.note(LogKind.HANDSHAKE, "Xoff", now)
                self._transmitter.send(self.string, OutputKind.XON_XOFF, now)
        if self.is_dtr_high:
            if self.dtr_follows and self.free < self._dtr_low_below:
                self._set_line(False, now)
        elif not self.dtr_follows:
            self._set_line(True, now)

    def freed(self, now: float) -> bool:
        """Let the host go on if enough is free; whether that was by DTR, so that it sends at once."""
        if self.is_stopped:
            stored = self.logical_bytes - self.free
            if stored <= xon_when_stored(self._knobs.xon, self.logical_bytes, self._rule.block):
                self.is_stopped = False
                if not self._trouble.loses_xon():
                    self._around.note(LogKind.HANDSHAKE, "Xon", now)
                    self._transmitter.send(self._rule.answer, OutputKind.XON_XOFF, now, turns=self._knobs.delay_on_xon)
        if self.owes_ack and self._has_room:
            self.owes_ack = False
            self._acknowledge(now)
        if not self.is_dtr_high and self.free >= max(self._knobs.dtr_high_at, self._dtr_low_below):
            self._set_line(True, now)
            return self._knobs.dtr_wired
        return False

    def asked(self, now: float) -> None:
        """Take an ENQ."""
        rule = self._rule
        if rule.mode == "dummy":
            self._around.note(LogKind.ENQUIRY, "answered", now)
            self._transmitter.send(rule.answer, OutputKind.DUMMY_ACK, now)
            return
        if self.owes_ack or self._transmitter.is_busy(now):
            self._around.fail(10)
            return
        if self.string:
            self._around.note(LogKind.HANDSHAKE, "immediate", now)
            self._transmitter.send(self.string, self._kind, now)
        has_room = self._has_room
        self._around.note(LogKind.ENQUIRY, "answered" if has_room else "pending", now)
        if has_room:
            self._acknowledge(now)
        else:
            self.owes_ack = True

    @property
    def _kind(self) -> OutputKind:
        return OutputKind.ACK_MODE_1 if self._rule.mode == "enq1" else OutputKind.ACK_MODE_2

    @property
    def _has_room(self) -> bool:
        block = self._rule.block
        return self.free >= block if self._knobs.acknowledges_equal else self.free > block

    def _acknowledge(self, now: float) -> None:
        self._around.note(LogKind.HANDSHAKE, "ACK", now)
        self._transmitter.send(self._rule.answer, self._kind, now)

    def _set_line(self, is_high: bool, now: float) -> None:
        self.is_dtr_high = is_high
        self._around.note(LogKind.HANDSHAKE, "DTR high" if is_high else "DTR low", now)
        if not self._knobs.dtr_wired:
            return
        if is_high:
            self._wire.go_on(now)
        else:
            self._wire.stop(now)


def string_of(codes: Sequence[int]) -> bytes:
    """Return the characters of parameters; a 0 ends them."""
    end = codes.index(0) if 0 in codes else len(codes)
    return bytes(codes[:end])
