"""
The sending end of XMODEM, for a control that receives.

The far end begins with NAK, and may send several before it sees the first block: all that have come are answered by
one block. Answers do not say what they answer, so one that came before a block had left answers none of it, and behind
a block that was repeated, which may be answered twice, there is a pause before the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from ...errors import InvalidCommandError, LinkProtocolError
from ..facts.characters import ACK, CAN, EOT, NAK, SUB, TEXT
from ..facts.xmodem import BLOCK_BYTES, CANCELS_TO_STOP, RETRIES
from .blocks import CANCEL, CRC_REQUEST, block, block_count
from .failures import Failure, FailureKind

__all__ = ["SenderTimes", "XmodemSender"]

_MOST_NOISE_BYTES: Final = 512
"""So much that is no sign may come before a sign; more is no receiver of XMODEM."""
_BEHIND_PERCENT: Final = bytes([SUB]) + b"\r\n \0"


@dataclass(frozen=True, slots=True, kw_only=True)
class SenderTimes:
    """
    How long the sending end waits, in seconds, and how often it tries.

    Attributes:
        start_s: For the first NAK: until the operator has pressed RECV.
        answer_s: For the answer to a block.
        end_s: For the answer to EOT, before it is sent again.
        settle_s: For a second answer to a block that went out twice, or to one that had not left at the first one.
        last_settle_s: The same behind the last block. Behind any other the next block shows who is at which; behind
            this one comes the end. Who reads a block that lost a byte notices it by a second of silence.
        retry_limit: So often one block is repeated, and EOT.
        ends_sent: So often EOT is sent while nobody answers.
    """

    start_s: float = 120.0
    answer_s: float = 30.0
    end_s: float = 10.0
    settle_s: float = 0.5
    last_settle_s: float = 3.0
    retry_limit: int = RETRIES
    ends_sent: int = 3


class _State(Enum):
    STARTING = "waits for the first NAK"
    SENDING = "waits for the answer to a block"
    SETTLING = "has what may be the answer, and waits whether another one comes"
    ENDING = "waits for the answer to EOT"
    OVER = "is over"


class XmodemSender:
    """
    Sends one file.

    Whatever it returns is to be written at once and whole; :meth:`time_ran_out` is to be called when
    :attr:`patience_s` has passed since the last call of any of its methods, and since what was written has left.

    Args:
        data: The file, byte for byte.
        times: How long things take.

    Attributes:
        blocks: How many were acknowledged.
        total_blocks: Of all.
        repeats: Blocks that were sent again.
        naks: That have come, the ones before the first block included.
        strays: Bytes that were no sign at all, and signs that came before what they could answer.
        failure: Why it is over without success; None otherwise.
        ended_by: ``"ACK"`` or ``"CAN"``, as the far end has answered EOT; None until then.

    Raises:
        InvalidCommandError: There is nothing to send.
    """

    def __init__(self, data: bytes, times: SenderTimes | None = None) -> None:
        if not data:
            raise InvalidCommandError("there is nothing to send")
        self.blocks = self.repeats = self.naks = self.strays = 0
        self.total_blocks = block_count(len(data))
        self.failure: Failure | None = None
        self.ended_by: str | None = None
        self._data = bytes(data)
        self._times = times or SenderTimes()
        self._state = _State.STARTING
        self._copies = 0
        """How often the block that is under way was written."""
        self._retries = 0
        """Of that block, or of EOT."""
        self._cans = 0
        self._noise = 0
        self._ends_sent = 0
        self._texts: set[int] = set()
        """Characters of text that came before the first NAK: a program prints, or it is asked for a CRC."""

    # What it has come to --------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> bool:
        """Whether nothing is awaited any more."""
        return self._state is _State.OVER

    @property
    def has_begun(self) -> bool:
        """Whether a block was sent."""
        return self._copies > 0 or self.blocks > 0

    @property
    def sent_bytes(self) -> int:
        """How much of the file was written, acknowledged or not."""
        return min((self.blocks + (self._copies > 0)) * BLOCK_BYTES, len(self._data))

    @property
    def acknowledged_bytes(self) -> int:
        """How much of the file was acknowledged."""
        return min(self.blocks * BLOCK_BYTES, len(self._data))

    @property
    def patience_s(self) -> float:
        """How long :meth:`time_ran_out` waits, if nothing comes."""
        times = self._times
        is_last = self.blocks >= self.total_blocks - 1
        return {
            _State.STARTING: times.start_s,
            _State.SENDING: times.answer_s,
            _State.SETTLING: times.last_settle_s if is_last else times.settle_s,
            _State.ENDING: times.end_s,
            _State.OVER: 0.0,
        }[self._state]

    # Doors ----------------------------------------------------------------------------------------------------------

    def begin(self) -> bytes:
        """Begin: nothing is sent before the far end asks for it."""
        return b""

    def receive(self, data: bytes, *, still_leaving: bool = False) -> bytes:
        """
        Read what came, a piece of any size.

        Args:
            data: The piece.
            still_leaving: Whether bytes of what was written last are known to wait yet, here or in the driver: what
                came before they left answers none of it.

        Returns:
            What is to be written now.
        """
        if self.is_over:
            self.strays += len(data)
            return b""
        acks, naks = self._count(data)
        if self._cans >= CANCELS_TO_STOP:
            return self._cancelled_there()
        if self._noise > _MOST_NOISE_BYTES:
            kind = FailureKind.FELL_SILENT if self.has_begun else FailureKind.NEVER_BEGUN
            return self._fail(kind, f"what comes is no XMODEM ({self._noise} bytes without a sign)")
        return self._answered(acks, naks, is_early=still_leaving) if acks or naks else b""

    def time_ran_out(self) -> bytes:
        """Take note that :attr:`patience_s` has passed, and return what is to be written."""
        self._cans = 0
        if self._state is _State.STARTING:
            wants_crc = self._texts == {CRC_REQUEST}
            seen = "it asks for a CRC (C), which this XMODEM has not" if wants_crc else "no NAK has come"
            return self._fail(FailureKind.NEVER_BEGUN, seen, tells=wants_crc)
        if self._state is _State.SENDING:
            return self._fail(FailureKind.FELL_SILENT, f"block {self.blocks + 1} of {self.total_blocks} is unanswered")
        if self._state is _State.SETTLING:
            return self._acknowledged()
        if self._state is _State.ENDING:
            return self._say_end_again()
        raise LinkProtocolError("a transfer that is over has no time to run out")

    def cancel(self) -> bytes:
        """End it here; return what tells the far end, which is nothing before it has begun."""
        if self.is_over:
            return b""
        at = f"{self.blocks} of {self.total_blocks} blocks were acknowledged"
        return self._fail(FailureKind.CANCELLED_HERE, at, tells=self.has_begun)

    # Signs ----------------------------------------------------------------------------------------------------------

    def _count(self, data: bytes) -> tuple[int, int]:
        acks = naks = 0
        for byte in data:
            if byte == CAN:
                self._cans += 1
                if self._cans >= CANCELS_TO_STOP:
                    break
                continue
            self.strays += self._cans  # a single one is noise
            self._cans = 0
            if byte == ACK:
                acks += 1
            elif byte == NAK:
                naks += 1
            elif self._state is _State.STARTING and byte in TEXT:
                self._texts.add(byte)
                self.strays += 1
            else:
                self.strays += 1
                self._noise += 1
        if acks or naks:
            self._noise = 0
        self.naks += naks
        return acks, naks

    def _answered(self, acks: int, naks: int, *, is_early: bool) -> bytes:
        """Go on by an answer: of several that came at once, one acknowledgement counts, and no NAK beside it."""
        if self._state is _State.STARTING:
            self.strays += acks
            return self._send_next() if naks else b""  # one block, whatever number of NAKs is there
        self.strays += acks + naks - 1
        is_settling = self._state is _State.SETTLING
        if is_early or (self._copies > 1 and (acks or is_settling)):
            # It is not known to be the answer, or not known to be the last one. Another one would be the next block's.
            self.strays += is_settling or not acks
            if acks:
                self._state = _State.SETTLING
            return b""
        return self._acknowledged() if acks else self._repeat()

    def _acknowledged(self) -> bytes:
        if self._is_at_end:
            return self._finish("ACK")
        self.blocks += 1
        self._copies = self._retries = 0
        return self._send_next()

    @property
    def _is_at_end(self) -> bool:
        """Whether all blocks are acknowledged, and EOT was sent."""
        return self.blocks == self.total_blocks

    def _send_next(self) -> bytes:
        if self._is_at_end:
            self._state = _State.ENDING
            self._ends_sent = 1
            return bytes([EOT])
        self._state = _State.SENDING
        self._copies = 1
        return block(self._data, self.blocks + 1)

    def _repeat(self) -> bytes:
        self._retries += 1
        if self._retries > self._times.retry_limit:
            what = "the end (EOT)" if self._is_at_end else f"block {self.blocks + 1} of {self.total_blocks}"
            kind = FailureKind.END_UNKNOWN if self._is_at_end else FailureKind.TOO_MANY_REPEATS
            return self._fail(kind, f"{what} was refused (NAK) {self._retries} times")
        if self._is_at_end:
            self._state = _State.ENDING
            return bytes([EOT])
        self._state = _State.SENDING
        self.repeats += 1
        self._copies += 1
        return block(self._data, self.blocks + 1)

    def _say_end_again(self) -> bytes:
        if self._ends_sent >= self._times.ends_sent:
            detail = f"EOT was sent {self._ends_sent} times behind {self.total_blocks} blocks"
            return self._fail(FailureKind.END_UNKNOWN, detail, tells=False)
        self._ends_sent += 1
        return bytes([EOT])

    # Ends -----------------------------------------------------------------------------------------------------------

    def _cancelled_there(self) -> bytes:
        if self._is_at_end and self._has_last_percent:
            return self._finish("CAN")
        where = "instead of acknowledging the end (EOT)"
        if not self._is_at_end:
            where = f"{self.blocks} of {self.total_blocks} blocks were acknowledged"
        return self._fail(FailureKind.CANCELLED_THERE, where, tells=False)

    @property
    def _has_last_percent(self) -> bool:
        """Whether the last ``%`` of the file was in the last block, or only ends of blocks were behind it."""
        last = self._data.rfind(b"%")
        if last < 0:
            return False
        return last >= (self.total_blocks - 1) * BLOCK_BYTES or not self._data[last + 1 :].strip(_BEHIND_PERCENT)

    def _finish(self, by: str) -> bytes:
        self._state = _State.OVER
        self.ended_by = by
        return b""

    def _fail(self, kind: FailureKind, detail: str, *, tells: bool = True) -> bytes:
        self._state = _State.OVER
        self.failure = Failure(kind, detail)
        return CANCEL if tells else b""
