"""
The receiving end of XMODEM, for a control that sends.

It begins with NAK, every ten seconds. EOT, and what is no block, count only when silence is behind them: a block whose
SOH was lost has bytes in it that look like signs. After damage it waits for silence, too, before it asks again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from ...errors import LinkProtocolError
from ..facts.characters import ACK, CAN, EOT, NAK, SUB
from ..facts.xmodem import BLOCK_BYTES, CANCELS_TO_STOP, FRAME_BYTES, NAK_WAIT_S, RETRIES, checksum
from .blocks import CANCEL, has_header, sums_with_eob_as_line_feed
from .failures import Failure, FailureKind

__all__ = ["ReceiverTimes", "XmodemReceiver"]

_STOP: Final = bytes([CAN] * CANCELS_TO_STOP)
_END: Final = bytes([EOT])
_FILL: Final = bytes([SUB])
_DATA: Final = slice(3, -1)
_MOST_NOISE_BYTES: Final = 2 * FRAME_BYTES
"""So much that is no block is thrown away at a time; then it counts as one that was damaged."""
_MOST_STRAY_BYTES: Final = 16
"""Noise is that short, and so is an EOT that was damaged; more is a block of which the rest was lost."""
_MOST_DOUBTFUL: Final = 100
_LINE_FEED_ONLY: Final = b"\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverTimes:
    """
    How long the receiving end waits, in seconds, and how often it asks.

    Attributes:
        nak_every_s: For a block, before it is asked for (again).
        start_s: For the first block: until the operator has pressed SEND.
        character_s: For the rest of a block that has begun; so long must be silence after damage.
        end_s: For what may follow an EOT; if nothing does, it is one.
        retry_limit: So often one block is asked for again, and may come again.
    """

    nak_every_s: float = NAK_WAIT_S
    start_s: float = 120.0
    character_s: float = 1.0
    end_s: float = 0.25
    retry_limit: int = RETRIES


class _State(Enum):
    NEW = "has not begun"
    STARTING = "waits for the first block"
    WAITING = "waits for a block"
    IN_BLOCK = "has a part of a block, or what is none, and waits for more"
    AT_END = "has an EOT, and waits whether that is all"
    OVER = "is over"


class XmodemReceiver:
    """
    Receives one file.

    Whatever it returns is to be written at once; :meth:`time_ran_out` is to be called when :attr:`patience_s` has
    passed since the last call of any of its methods.

    Args:
        times: How long things take.
        eob: What the control sends at the end of each block of a program (Setting 25). If that is not LF, sums are
            accepted as well that were computed as if it were.

    Attributes:
        blocks: How many were received, each once.
        repeats: Blocks that came again after they had been received.
        naks: Sent, the ones before the first block included.
        damaged: Blocks, or what was left of them, that came and could not be read.
        strays: Bytes that belonged to no block.
        doubtful_blocks: Numbers of blocks, counted from 1, behind which a byte too many stood: a byte of them came
            twice, perhaps, and the sum happened to fit. The first hundred.
        sums_as_line_feed: Whether sums were computed as if each end of block were LF; None until a block has shown it.
        failure: Why it is over without success; None otherwise.
    """

    def __init__(self, times: ReceiverTimes | None = None, *, eob: bytes = _LINE_FEED_ONLY) -> None:
        self.blocks = self.repeats = self.naks = self.damaged = self.strays = 0
        self.doubtful_blocks: list[int] = []
        self.failure: Failure | None = None
        self._times = times or ReceiverTimes()
        self._eob = eob
        self._state = _State.NEW
        self._held = bytearray()
        """What has come of a block."""
        self._noise = bytearray()
        """What has come since the last answer and is no block."""
        self._unread = 0
        """Bytes that could not be read since the last block."""
        self._retries = 0
        self._waited_s = 0.0
        self._came_again = 0
        """How often the last block came once more."""
        self._last = b""
        """The data of the last block."""
        self.sums_as_line_feed: bool | None = None
        self._out = bytearray()
        self._fill = 0
        """So many SUB at the end are held back: they may be fill."""

    # What it has come to --------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> bool:
        """Whether nothing is awaited any more."""
        return self._state is _State.OVER

    @property
    def is_between_blocks(self) -> bool:
        """Whether nothing has come that may be a part of a block, or what is left of one."""
        return not (self._held or self._noise)

    @property
    def received_bytes(self) -> int:
        """How much of the file has come, without what may be fill."""
        return self.blocks * BLOCK_BYTES - self._fill

    @property
    def fill_bytes(self) -> int:
        """How many SUB have come at the end, which are no part of the file."""
        return self._fill

    @property
    def patience_s(self) -> float:
        """How long from now until :meth:`time_ran_out` is to be called, if nothing comes."""
        times = self._times
        if self._state is _State.STARTING:
            return min(times.nak_every_s, max(times.start_s - self._waited_s, 0.0))
        if self._state is _State.WAITING:
            return times.nak_every_s
        if self._state is _State.IN_BLOCK:
            return times.character_s
        return times.end_s if self._state is _State.AT_END else 0.0

    def take(self) -> bytes:
        """Take what has come of the file since the last call; SUB at its end is held back."""
        data = bytes(self._out)
        self._out.clear()
        return data

    # Doors ----------------------------------------------------------------------------------------------------------

    def begin(self) -> bytes:
        """Ask for the first block."""
        if self._state is not _State.NEW:
            raise LinkProtocolError("a transfer begins once")
        self._state = _State.STARTING
        return self._nak()

    def receive(self, data: bytes) -> bytes:
        """
        Read what came, a piece of any size.

        Returns:
            What is to be written now. After the end an EOT that is repeated is acknowledged again.
        """
        if self._state is _State.NEW:
            raise LinkProtocolError("a transfer is begun before anything is read")
        if self.is_over:
            is_end_again = self.failure is None and data.strip(bytes([EOT])) == b"" and data
            return bytes([ACK]) if is_end_again else b""
        self._held += data
        answer = b""
        while self._held and not self.is_over and (found := self._next_part()) is not None:
            answer = self._take_block(found) if found else answer
        if len(self._noise) > _MOST_NOISE_BYTES and not self.is_over:
            return self._throw_away()
        return answer

    def time_ran_out(self) -> bytes:
        """Take note that :attr:`patience_s` has passed, and return what is to be written."""
        if self._state is _State.STARTING:
            self._waited_s += self.patience_s
            return self._ask_for_first()
        if self._state is _State.WAITING:
            return self._ask_again(f"nothing has come of block {self.blocks + 1}")
        if self._state is _State.IN_BLOCK:
            self._waited_s += self.patience_s
            return self._throw_away()
        if self._state is _State.AT_END:
            return self._end()
        raise LinkProtocolError("a transfer that is over, or has not begun, has no time to run out")

    def cancel(self) -> bytes:
        """End it here; return what tells the far end."""
        if self.is_over:
            return b""
        has_begun = self._state is not _State.NEW
        return self._fail(FailureKind.CANCELLED_HERE, f"{self.blocks} blocks were received", tells=has_begun)

    # Reading --------------------------------------------------------------------------------------------------------

    def _next_part(self) -> bytes | None:
        """Take a block from what has come, or throw away a byte; None: what has come may yet become something."""
        held = self._held
        if has_header(held):
            if len(held) < FRAME_BYTES:
                self._state = _State.IN_BLOCK
                return None
            frame = bytes(held[:FRAME_BYTES])
            del held[:FRAME_BYTES]
            return frame
        if not self._noise and not held.strip(_END):
            self._state = _State.AT_END
            return None
        if not self._noise and held[0] == CAN and len(held) < CANCELS_TO_STOP:
            self._state = _State.IN_BLOCK
            return None
        if not self._noise and held.startswith(_STOP):
            self._cancelled_there()
            return None
        self._noise.append(held.pop(0))
        self._state = _State.IN_BLOCK
        return b""

    def _take_block(self, frame: bytes) -> bytes:
        data = frame[_DATA]
        if not self._is_sum_of(data, frame[-1]) or self._is_something_behind:
            self._noise += frame
            self._state = _State.IN_BLOCK
            return b""
        stray = bytes(self._noise)
        self.strays += len(stray)
        self._noise.clear()
        if frame[1] == (self.blocks + 1) & 0xFF:
            self._doubt_last(len(stray))
            self.blocks += 1
            self._came_again = 0
            self._last = data
            self._put_out(data)
        elif self.blocks and frame[1] == self.blocks & 0xFF:
            self.repeats += 1
            self._came_again += 1
            if self._came_again > self._times.retry_limit:
                detail = f"block {self.blocks} came {self._came_again} times more, although it was acknowledged"
                return self._fail(FailureKind.TOO_MANY_REPEATS, detail)
            if data != self._last:
                return self._fail(FailureKind.OUT_OF_STEP, f"block {self.blocks} came twice, with other bytes")
        else:
            expected = f"block {self.blocks + 1} was expected, with the number {(self.blocks + 1) & 0xFF}"
            return self._fail(FailureKind.OUT_OF_STEP, f"{expected}; number {frame[1]} came")
        self._retries = self._unread = 0
        self._state = _State.WAITING
        return bytes([ACK])

    @property
    def _is_something_behind(self) -> bool:
        """Whether bytes are there that belong neither to the block nor begin what may follow: one is too many."""
        behind = self._held
        return bool(behind) and not has_header(behind) and behind[0] not in {EOT, CAN}

    def _doubt_last(self, stray_bytes: int) -> None:
        is_first_answer = not self._retries and self.blocks
        if stray_bytes and is_first_answer and len(self.doubtful_blocks) < _MOST_DOUBTFUL:
            self.doubtful_blocks.append(self.blocks)

    def _is_sum_of(self, data: bytes, told: int) -> bool:
        is_plain = checksum(data) == told
        if self._eob == _LINE_FEED_ONLY:
            return is_plain
        is_half = self._last.endswith(self._eob[:1])
        as_line_feed = told in sums_with_eob_as_line_feed(data, self._eob, is_half_before=is_half)
        if self.sums_as_line_feed is None and is_plain != as_line_feed:
            self.sums_as_line_feed = as_line_feed
        return (is_plain and self.sums_as_line_feed is not True) or (
            as_line_feed and self.sums_as_line_feed is not False
        )

    def _put_out(self, data: bytes) -> None:
        body = data.rstrip(_FILL)
        if body:
            self._out += _FILL * self._fill + body
            self._fill = 0
        self._fill += len(data) - len(body)

    # Asking ---------------------------------------------------------------------------------------------------------

    def _throw_away(self) -> bytes:
        """Have what was damaged again, now that there is silence behind it."""
        thrown = bytes(self._noise + self._held)
        self._noise.clear()
        self._held.clear()
        if thrown.endswith(_STOP):
            return self._cancelled_there()
        if len(thrown) <= _MOST_STRAY_BYTES:
            self.strays += len(thrown)
            self._doubt_last(len(thrown) if thrown.endswith(_END) and len(thrown) > 1 else 0)
            if not self.blocks and not self._retries:
                return self._ask_for_first()
        else:
            self.damaged += 1
        self._unread += len(thrown)
        return self._ask_again(f"{len(thrown)} bytes came that are no block {self.blocks + 1}")

    def _ask_for_first(self) -> bytes:
        if self._waited_s >= self._times.start_s:
            return self._fail(FailureKind.NEVER_BEGUN, "no block has come", tells=False)
        self._state = _State.STARTING
        return self._nak()

    def _ask_again(self, why: str) -> bytes:
        self._retries += 1
        if self._retries > self._times.retry_limit:
            kind = FailureKind.TOO_MANY_REPEATS if self._unread else FailureKind.FELL_SILENT
            return self._fail(kind, f"{why}, {self._retries} times")
        self._state = _State.WAITING
        return self._nak()

    def _nak(self) -> bytes:
        self.naks += 1
        return bytes([NAK])

    # Ends -----------------------------------------------------------------------------------------------------------

    def _end(self) -> bytes:
        self._held.clear()
        if self._unread > _MOST_STRAY_BYTES:
            return self._fail(FailureKind.OUT_OF_STEP, f"the end came (EOT) in place of block {self.blocks + 1}")
        self._state = _State.OVER
        return bytes([ACK])

    def _cancelled_there(self) -> bytes:
        return self._fail(FailureKind.CANCELLED_THERE, f"{self.blocks} blocks were received", tells=False)

    def _fail(self, kind: FailureKind, detail: str, *, tells: bool = True) -> bytes:
        self._state = _State.OVER
        self.failure = Failure(kind, detail)
        return CANCEL if tells else b""
