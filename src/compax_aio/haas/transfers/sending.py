"""Files sent as they are, a few bytes at a time, so that the control can say stop: RTS/CTS, Xon/Xoff, DC codes."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

from ..facts.characters import DC1, DC3, NAK, PERCENT
from .account import Ending, LineAccount, Phase, Proof
from .notes import TransferBegan, TransferHeld, TransferStillHeld, TransferWentOn
from .strategy import Patience, Strategy

__all__ = ["SendByDcCodes", "SendByWires", "SendFile"]

_MOST_AT_ONCE_BYTES: Final = 16
_SHORTEST_PAUSE_S: Final = 0.001
_LONGEST_LOOK_S: Final = 0.1
"""What does not leave is looked at so often, at least."""
_SETTLE_S: Final = 0.5
"""An Xon that comes so soon behind the last DC3 shows that this was an Xoff."""
_MOST_SETTLES: Final = 64
"""So often a control whose reader goes on and off at the end is waited for."""
_MOST_OFFSETS: Final = 100
_FEWEST_NAKS: Final = 2
_ASKS_FOR_BLOCKS: Final = "it has sent NAK again and again, as with XMODEM (Setting 14)"


class SendFile(Strategy):
    """
    Sends a file a few bytes at a time, and never more than may wait to leave: all of that goes out after an Xoff.

    This is Xon/Xoff: DC3 holds it, DC1 lets it go on.

    Args:
        label: See :class:`Strategy`.
        patience: See :class:`Strategy`.
        data: The file, byte for byte; its last ``%`` with what is behind it.
        eob: What ends a block in it; to count lines.
        most_unsent_bytes: So much may wait to leave; None: as is usual with this synchronisation.
        waits_for_start: Whether nothing is sent before a first DC1; None: as is usual.
        drips: Whether the control runs it while it comes (DNC). It may hold the line for long then, which is told
            again and again; what has left is never sent a second time.
    """

    sends = True
    heeds_signs = True
    """Whether DC1 and DC3 that come are meant for it."""
    usual_unsent_bytes = _MOST_AT_ONCE_BYTES
    usually_waits = False

    def __init__(
        self,
        label: str,
        patience: Patience,
        data: bytes,
        *,
        eob: bytes = b"\r\n",
        most_unsent_bytes: int | None = None,
        waits_for_start: bool | None = None,
        drips: bool = False,
    ) -> None:
        super().__init__(label, patience)
        self._data = data
        self._eob = eob
        self._most_unsent_bytes = self.usual_unsent_bytes if most_unsent_bytes is None else most_unsent_bytes
        self._waits_for_start = self.heeds_signs and (
            self.usually_waits if waits_for_start is None else waits_for_start
        )
        self._longest_hold_s = patience.drip_held_s if drips else patience.body_s
        self._held_s = self._told_s = 0.0
        """For so long the control holds the line with Xoff; and how much of any hold was told."""
        self._written = 0
        self._is_held = False
        self._holds = self._held_bytes = self._most_held_bytes = 0
        self._hold_offsets: deque[int] = deque(maxlen=_MOST_OFFSETS)
        self._pause_s = 0.0
        self._seen_unsent = 0
        self._stuck_s = 0.0
        """For so long nothing has left of what was written."""
        self._naks = 0
        self._lines = self._counted = 0
        """Ends of blocks among the bytes that were counted."""

    # What differs ---------------------------------------------------------------------------------------------------

    def _all_has_left(self) -> None:
        """Take note that the last byte has left."""
        self._pause_s = self.patience.tail_s

    def _end_tail(self) -> None:
        """Take note that the pause behind the last byte is over."""
        self._end(Ending.COMPLETE, "left the line")

    # Doors ----------------------------------------------------------------------------------------------------------

    @property
    def pause_s(self) -> float:
        """How long nothing happens unless something comes."""
        return self._pause_s

    @property
    def left_bytes(self) -> int:
        """How much of the file has left, as far as can be told."""
        return max(0, self._written - self._level.unsent())

    def _begin(self, *, reader_is_on: bool) -> None:
        if reader_is_on or not self._waits_for_start:
            self._start()
        else:
            self._pause_s = self.patience.start_s
            self._has_moved = True

    def _start(self) -> None:
        self._notes.append(TransferBegan(self.label))
        self._enter(Phase.BODY)
        self._go_on()

    def receive(self, data: bytes) -> bytes:
        """Heed the signs in *data*; return the rest."""
        self._naks += data.count(NAK)
        if not self.heeds_signs:
            return data
        for byte in data:
            if byte == DC3:
                self._off()
            elif byte == DC1:
                self._on()
        return data.translate(None, bytes((DC1, DC3)))

    def _off(self) -> None:
        if self.phase in {Phase.BODY, Phase.TAIL} and not self._is_held:
            self._hold()

    def _hold(self) -> None:
        """Write no more until Xon; what was written leaves all the same."""
        unsent = min(self._level.unsent(), self._written)
        self._is_held = True
        self._holds += 1
        self._held_bytes += unsent
        self._most_held_bytes = max(self._most_held_bytes, unsent)
        self._hold_offsets.append(self._written - unsent)
        self._notes.append(TransferHeld(self.label, self._written - unsent, unsent))
        if self.phase is Phase.BODY:
            self._held_s = self._told_s = 0.0
            self._stay_held()

    def _stay_held(self) -> None:
        self._pause_s = min(self.patience.body_s, self._longest_hold_s - self._held_s)
        self._has_moved = True

    def _on(self) -> None:
        if self.phase is Phase.WAIT_START:
            self._start()
        elif self.phase is not Phase.DONE and self._is_held:
            self._is_held = False
            self._notes.append(TransferWentOn(self.label, self.left_bytes))
            if self.phase is Phase.BODY:
                self._go_on()

    def time_ran_out(self) -> None:
        """Write more, or take note that the control does not go on."""
        if self.phase is Phase.WAIT_START:
            self._end(Ending.NOT_STARTED)
        elif self.phase is Phase.TAIL and not self._is_leaving:
            self._end_tail()
        elif self.phase is Phase.BODY and self._is_held:
            self._held_s += self._pause_s
            if self._held_s >= self._longest_hold_s:
                self._end(Ending.HELD_TOO_LONG)
            else:
                self._tell_hold(self._held_s)
                self._stay_held()
        else:
            self._go_on(self._pause_s)

    def _tell_hold(self, held_s: float) -> None:
        self._told_s = held_s
        self._notes.append(TransferStillHeld(self.label, self.left_bytes, held_s))

    # Writing --------------------------------------------------------------------------------------------------------

    _is_leaving = False
    """Whether all is written, and not all has left."""

    def _go_on(self, waited_s: float = 0.0) -> None:
        """Write what may be written; then it is a pause until less of that waits to leave."""
        unsent = self._level.unsent()
        self._note_standstill(unsent, waited_s)
        if self.ending is not None:
            return
        self._has_moved = True
        size = min(self._most_unsent_bytes - unsent, _MOST_AT_ONCE_BYTES, len(self._data) - self._written)
        if size > 0:
            self._write(self._data[self._written : self._written + size])
            self._written += size
            unsent += size
        self._seen_unsent = unsent
        if self._written < len(self._data):
            self._pause_s = self._until_unsent_s(unsent, self._most_unsent_bytes // 2)
            return
        if self.phase is Phase.BODY:
            self._enter(Phase.TAIL)
            self._is_leaving = True
        if unsent:
            self._pause_s = self._until_unsent_s(unsent, 0)
        else:
            self._is_leaving = False
            self._all_has_left()

    def _note_standstill(self, unsent: int, waited_s: float) -> None:
        """Reckon for how long nothing has left, although nobody has said stop: the wires hold it, or the network."""
        if not unsent or unsent < self._seen_unsent:
            self._stuck_s = self._told_s = 0.0
            return
        self._stuck_s += waited_s
        if self._stuck_s >= self._longest_hold_s:
            self._end(Ending.STUCK)
        elif self._stuck_s >= self._told_s + self.patience.body_s:
            self._tell_hold(self._stuck_s)

    def _until_unsent_s(self, unsent: int, wanted: int) -> float:
        rate = self._level.bytes_per_s
        pause_s = max((unsent - wanted) / rate if rate else 0.0, _SHORTEST_PAUSE_S)
        # While nothing leaves, ever more rarely.
        return max(pause_s, min(self._stuck_s, _LONGEST_LOOK_S))

    # Telling --------------------------------------------------------------------------------------------------------

    def account(self) -> LineAccount:
        """Say how much of the file has left."""
        left = self.left_bytes
        last = self._eob[-1:]
        if left > self._counted:
            self._lines += self._data.count(last, self._counted, left)
            self._counted = left
        return LineAccount(
            label=self.label,
            sends=True,
            phase=self._ended_in if self.ending is not None else self.phase,
            ending=self.ending,
            bytes=left,
            written_bytes=self._written,
            total_bytes=len(self._data),
            lines=self._lines // max(1, self._eob.count(last)),
            is_held=self._is_held,
            holds=self._holds,
            hold_offsets=tuple(self._hold_offsets),
            held_bytes=self._held_bytes,
            most_held_bytes=self._most_held_bytes,
            detail=_ASKS_FOR_BLOCKS if self._naks >= _FEWEST_NAKS else "",
        )


class SendByWires(SendFile):
    """Sends with RTS/CTS: the port heeds the wires by itself, and that nothing leaves is all that is seen here."""

    heeds_signs = False
    usual_unsent_bytes = 64
    """The port stops between two bytes: more may wait, and none is lost."""


class SendByDcCodes(SendFile):
    """
    Sends with DC codes: DC1 lets it begin, and a DC3 behind the last ``%`` says that the control has read it.

    In between they are Xon and Xoff. So a DC3 behind the end is the last one only if no DC1 follows it.
    """

    usually_waits = True

    def __init__(self, label: str, patience: Patience, data: bytes, **more: Any) -> None:
        super().__init__(label, patience, data, **more)
        self._behind_percent = len(data) - 1 - data.rfind(PERCENT)
        self._is_reader_off = False
        self._settles = 0

    def _off(self) -> None:
        # The end of the block with the last % may be still to be written then: it follows all the same.
        if self.phase in {Phase.BODY, Phase.TAIL} and self.left_bytes >= len(self._data) - self._behind_percent:
            self._is_reader_off = True
            self._settle(self._settle_s)
        else:
            super()._off()

    @property
    def _has_all_but_the_end(self) -> bool:
        """Whether nothing is left to write but the end of the block with the last ``%``."""
        return self._written >= len(self._data) - self._behind_percent

    def _stay_held(self) -> None:
        super()._stay_held()
        if self._has_all_but_the_end:
            self._pause_s = min(self._pause_s, self._settle_s)

    def time_ran_out(self) -> None:
        """
        Write more, or take note that the control does not go on.

        Where the line is faster than is known here, the last DC3 comes before the ``%`` is reckoned to have left, and
        looks like an Xoff that no Xon follows. The end of the block is written then, and nothing is proved.
        """
        if self.phase is Phase.BODY and self._is_held and self._has_all_but_the_end:
            self._on()
        else:
            super().time_ran_out()

    def _on(self) -> None:
        if self._is_reader_off and self.phase is not Phase.DONE:
            self._is_reader_off = False
            self._settle(self.patience.reader_off_s)
        else:
            super()._on()

    @property
    def _settle_s(self) -> float:
        """How long no DC1 must come: one that has held the line before may take its time until it goes on."""
        longest_s = self.patience.reader_off_s if self._holds else self.patience.tail_s
        return max(_SETTLE_S, longest_s)

    def _settle(self, pause_s: float) -> None:
        """Wait so long, if all has left."""
        if self.phase is Phase.TAIL and not self._is_leaving and self._settles < _MOST_SETTLES:
            self._settles += 1
            self._pause_s = pause_s
            self._has_moved = True

    def _all_has_left(self) -> None:
        self._pause_s = self._settle_s if self._is_reader_off else self.patience.reader_off_s

    def _end_tail(self) -> None:
        proof: Proof = "reader off seen" if self._is_reader_off else "left the line"
        self._end(Ending.COMPLETE, proof)
