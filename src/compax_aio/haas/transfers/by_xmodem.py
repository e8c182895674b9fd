"""Files in blocks that are checked and repeated: with XMODEM."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from ..facts.characters import TEXT
from ..facts.xmodem import BLOCK_BYTES
from ..xmodem import Failure, FailureKind, ReceiverTimes, SenderTimes, XmodemReceiver, XmodemSender
from .account import Ending, LineAccount, Phase
from .framing import FileEnd, FileStart
from .notes import TransferBegan
from .strategy import Patience, Strategy

__all__ = ["ReceiveByXmodem", "SendByXmodem"]

_ENDINGS: Final[Mapping[FailureKind, Ending]] = MappingProxyType(
    {
        FailureKind.NEVER_BEGUN: Ending.NOT_STARTED,
        FailureKind.FELL_SILENT: Ending.WENT_SILENT,
        FailureKind.TOO_MANY_REPEATS: Ending.GARBLED,
        FailureKind.CANCELLED_THERE: Ending.CANCELLED,
        FailureKind.CANCELLED_HERE: Ending.GIVEN_UP,
        FailureKind.OUT_OF_STEP: Ending.GARBLED,
        FailureKind.END_UNKNOWN: Ending.END_UNANSWERED,
    }
)
_NO_BLOCKS: Final = "a file came, and not in blocks of XMODEM"


class ReceiveByXmodem(Strategy):
    """
    Receives a file with XMODEM; what is handed on is the file byte for byte, without the fill of its last block.

    Text that comes before the first block is what a program prints. If it is a file, the control sends as it is.

    Args:
        label: See :class:`Strategy`.
        patience: See :class:`Strategy`.
        sink: Called with each piece of the file, in order.
        max_bytes: A file that is larger is not received to its end.
        eob: What ends a block in it: with another than LF some controls reckon sums as if it were LF.
    """

    sends = False
    takes_all = True

    def __init__(
        self, label: str, patience: Patience, sink: Callable[[bytes], None], *, max_bytes: int, eob: bytes = b"\n"
    ) -> None:
        super().__init__(label, patience)
        self._sink = sink
        self._max_bytes = max_bytes
        self._eob = eob
        self._engine = XmodemReceiver(
            ReceiverTimes(nak_every_s=patience.block_s, start_s=patience.start_s, retry_limit=patience.most_repeats),
            eob=eob,
        )
        self._bytes = self._line_ends = 0
        self._file_start = FileStart()
        self._is_plain = False
        """Whether a file came that is not in blocks."""
        self._file_end = FileEnd()

    @property
    def pause_s(self) -> float:
        """How long nothing may come."""
        return self._engine.patience_s

    def _begin(self, *, reader_is_on: bool) -> None:  # noqa: ARG002  # the control sends
        self._write(self._engine.begin())
        self._has_moved = True

    def receive(self, data: bytes) -> bytes:
        """Read *data*; return what is printed in front of the first block, and what comes when it is over."""
        if self.ending is not None:
            return data
        if self.phase is Phase.WAIT_START and self._engine.is_between_blocks and not data.translate(None, TEXT):
            self._is_plain |= self._file_start.find(data)[1] is not None
            return data
        self._answer(self._engine.receive(data))
        return b""

    def time_ran_out(self) -> None:
        """Ask for the block again, or take note of the end."""
        if self._is_plain and self.phase is Phase.WAIT_START:
            self._end(Ending.UNLIKE)
        else:
            self._answer(self._engine.time_ran_out())

    def _answer(self, answer: bytes) -> None:
        self._has_moved = True
        if answer:
            self._write(answer)
        self._take(self._engine.take())
        if self._engine.is_over and self.ending is None:
            self._end(_ending_of(self._engine.failure))

    def _take(self, data: bytes) -> None:
        if self.phase is Phase.WAIT_START and self._engine.blocks:
            self._notes.append(TransferBegan(self.label))
            self._enter(Phase.BODY)
        if not data:
            return
        if self._bytes + len(data) > self._max_bytes:
            self._write(self._engine.cancel())
            self._end(Ending.TOO_LARGE)
            return
        self._bytes += len(data)
        self._line_ends += data.count(self._eob[-1:])
        self._file_end.read(data)
        self._sink(data)

    def _farewell(self) -> bytes:
        return self._engine.cancel()

    def account(self) -> LineAccount:
        """Say how much of the file has come."""
        engine = self._engine
        return LineAccount(
            label=self.label,
            sends=False,
            phase=self._ended_in if self.ending is not None else self.phase,
            ending=self.ending,
            bytes=self._bytes,
            lines=self._line_ends // self._eob.count(self._eob[-1:]),
            blocks=engine.blocks,
            repeated_blocks=engine.repeats,
            # A byte came twice in it, perhaps, and its sum happened to fit: where in it, nobody knows.
            damage_offsets=tuple((number - 1) * BLOCK_BYTES for number in engine.doubtful_blocks),
            damaged_bytes=len(engine.doubtful_blocks),
            is_closed=self._file_end.is_closed,
            dropped_bytes=engine.fill_bytes,
            detail=_NO_BLOCKS if self.ending is Ending.UNLIKE else _detail_of(engine.failure),
        )


class SendByXmodem(Strategy):
    """
    Sends a file with XMODEM.

    Args:
        label: See :class:`Strategy`.
        patience: See :class:`Strategy`.
        data: The file, byte for byte.
        eob: What ends a block in it; to count lines.
    """

    sends = True
    takes_all = True

    def __init__(self, label: str, patience: Patience, data: bytes, *, eob: bytes = b"\n") -> None:
        super().__init__(label, patience)
        self._data = data
        self._eob = eob
        self._engine = XmodemSender(
            data,
            SenderTimes(start_s=patience.start_s, answer_s=patience.body_s, retry_limit=patience.most_repeats),
        )
        self._line_ends = self._counted = 0

    @property
    def pause_s(self) -> float:
        """How long the answer to what was written may take, from when it has left."""
        return self._engine.patience_s + self._level.leaves_s()

    def _begin(self, *, reader_is_on: bool) -> None:  # noqa: ARG002  # it asks with NAK
        self._answer(self._engine.begin())

    def receive(self, data: bytes) -> bytes:
        """Read *data*; return what is printed before the control asks for the first block, or comes at the end."""
        if self.ending is not None:
            return data
        was_waiting = self.phase is Phase.WAIT_START
        self._answer(self._engine.receive(data, still_leaving=self._level.unsent() > 0))
        return bytes(byte for byte in data if byte in TEXT) if was_waiting else b""

    def time_ran_out(self) -> None:
        """Write what is next, or take note that no answer came."""
        self._answer(self._engine.time_ran_out())

    def _answer(self, answer: bytes) -> None:
        engine = self._engine
        self._has_moved |= engine.has_begun  # what is printed meanwhile gives the operator no more time
        if self.phase is Phase.WAIT_START and engine.has_begun:
            self._notes.append(TransferBegan(self.label))
            self._enter(Phase.BODY)
        if self.phase is Phase.BODY and engine.blocks == engine.total_blocks:
            self._enter(Phase.TAIL)
        if answer:
            self._write(answer)
        if engine.is_over and self.ending is None:
            ending = _ending_of(engine.failure)
            self._end(ending, "xmodem acknowledged" if ending is Ending.COMPLETE else None)

    def _farewell(self) -> bytes:
        return self._engine.cancel()

    def account(self) -> LineAccount:
        """Say how much of the file was acknowledged."""
        engine = self._engine
        done = engine.acknowledged_bytes
        last = self._eob[-1:]
        self._line_ends += self._data.count(last, self._counted, done)
        self._counted = done
        return LineAccount(
            label=self.label,
            sends=True,
            phase=self._ended_in if self.ending is not None else self.phase,
            ending=self.ending,
            bytes=done,
            written_bytes=engine.sent_bytes,
            total_bytes=len(self._data),
            lines=self._line_ends // self._eob.count(last),
            blocks=engine.blocks,
            repeated_blocks=engine.repeats,
            detail=_detail_of(engine.failure),
        )


def _ending_of(failure: Failure | None) -> Ending:
    return Ending.COMPLETE if failure is None else _ENDINGS[failure.kind]


def _detail_of(failure: Failure | None) -> str:
    return "" if failure is None else str(failure)
