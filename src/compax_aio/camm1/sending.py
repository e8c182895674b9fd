"""Instructions of a job sent burst by burst: paused and given up between instructions, and never sent twice."""

from __future__ import annotations

import asyncio
from typing import Final

from ..errors import AnswerTimeoutError, ConnectionLostError
from ..link.contract import TurnOver
from .bursting import Burst
from .language.instruction import Instruction
from .ledger import CutLedger
from .line import CutterLine
from .pacing import Pacing
from .protocol_events import BurstOver
from .watching import MachineWatch

__all__ = ["Sending", "burst_bytes"]

_BURST_S: Final = 1.0
"""Other questions wait for no more of a job than what goes out in that time …"""
_LEAST_BURST_BYTES: Final = 512
_MOST_BURST_BYTES: Final = 4096
_WATCH_S: Final = 0.5
"""A burst under way is looked at so often."""


def burst_bytes(bytes_per_s: float | None) -> int:
    """Return how large a burst is on a line of that speed."""
    rate = _LEAST_BURST_BYTES if bytes_per_s is None else bytes_per_s
    return max(_LEAST_BURST_BYTES, min(int(rate * _BURST_S), _MOST_BURST_BYTES))


class Sending:
    """
    Sends the instructions of one job.

    Args:
        description: Of the job.
        line: Of the cutter.
        pacing: When what may be written.
        watch: Looks after the machine.
        ledger: Keeps count.

    Attributes:
        is_begun: Whether something of the job may be in the machine.
    """

    def __init__(
        self, description: str, line: CutterLine, pacing: Pacing, watch: MachineWatch, ledger: CutLedger
    ) -> None:
        self.is_begun = False
        self._description = description
        self._line = line
        self._pacing = pacing
        self._watch = watch
        self._ledger = ledger
        self._loop = asyncio.get_running_loop()
        self._burst: Burst | None = None
        self._may_send = asyncio.Event()
        self._may_send.set()
        self._is_between_bursts = asyncio.Event()
        self._is_between_bursts.set()

    # Pausing --------------------------------------------------------------------------------------------------------

    async def pause(self) -> None:
        """Send no more; return when the burst under way is over, at the end of an instruction."""
        self._may_send.clear()
        self.give_up_burst()
        await self._is_between_bursts.wait()

    def resume(self) -> None:
        """Go on sending, or find out that the job shall not go on."""
        self._may_send.set()
        self._watch.restart()

    def give_up_burst(self) -> None:
        """Write no more of the burst under way."""
        if self._burst is not None:
            self._burst.is_given_up = True

    # Sending --------------------------------------------------------------------------------------------------------

    async def send(self, instructions: list[Instruction], *, is_tail: bool = False) -> None:
        """
        Write instructions as there is room, until all are written.

        Args:
            instructions: Of the job.
            is_tail: They are what is put behind it.

        Raises:
            MoveInDoubtError: The line is lost, or the cutter says nothing any more.
            MoveTimeoutError: The machine takes nothing for too long.
            MoveStoppedError: The operator has ended the job.
        """
        while instructions:
            await self._until_not_paused()
            if not is_tail:
                self._watch.set_state("cutting")
            written, is_full = await self._send_burst(instructions, is_tail=is_tail)
            instructions = instructions[written:]
            self._note_progress()
            self._watch.check()
            if is_full is None:
                await self._watch.status()  # the line gets in step, or what has become of it is told
            elif is_full:
                if not is_tail:
                    self._watch.set_state("buffer full")
                await self._watch.wait_for_room()
            elif not is_tail:
                await self._watch.look(self._pacing.free_bytes if self._pacing.tells_free_space else None)

    async def look_around(self) -> None:
        """
        Look for errors, and at the free space, between two bursts.

        Raises:
            DriveFaultError, MoveInDoubtError: As :class:`MachineWatch`.
        """
        await self._watch.look_for_errors()
        self._pacing.told(await self._watch.free_space())
        self._note_progress()

    async def _until_not_paused(self) -> None:
        while not self._may_send.is_set():
            self._watch.set_state("paused")
            await self._may_send.wait()
            self._watch.check()
        self._watch.check()

    async def _send_burst(self, instructions: list[Instruction], *, is_tail: bool) -> tuple[int, bool | None]:
        """Write one burst; return how many instructions were written, and whether the buffer is full; None: unknown."""
        first, last = instructions[0], instructions[-1]
        which = "end" if is_tail else f"bytes {first.offset}-{last.offset + len(last.data) - 1}"
        self._burst = burst = Burst(f"{which} of {self._description}", [each.data for each in instructions])
        self.is_begun = True
        loss: ConnectionLostError | None = None
        self._is_between_bursts.clear()
        try:
            outcome = await self._watched(burst)
        except AnswerTimeoutError:
            return burst.written, None
        except ConnectionLostError as error:
            loss = error
        finally:
            if not is_tail:
                self._ledger.note_sent(instructions[: burst.written])
            self._burst = None
            self._is_between_bursts.set()
        if loss is not None:
            self._watch.check()
            raise self._watch.reports.lost(loss, self._watch.account()) from loss
        return burst.written, outcome.is_full if isinstance(outcome, BurstOver) else None

    async def _watched(self, burst: Burst) -> TurnOver:
        """Await the end of a burst; one that cannot leave, because the cable holds the line, is told."""
        sending = asyncio.ensure_future(self._line.send_burst(burst))
        held_since = self._loop.time()
        seen = (-1, -1)
        while not sending.done():
            await asyncio.wait([sending], timeout=_WATCH_S)
            now = (burst.written, self._line.link.unsent_bytes)
            if now != seen:
                seen, held_since = now, self._loop.time()
            elif (now[1] or self._pacing.may_hold_line) and not sending.done():
                self._watch.set_state("line held")
                if self._loop.time() - held_since >= self._line.settings.held_timeout_s:
                    burst.is_given_up = True
                    seconds = self._loop.time() - held_since
                    raise self._watch.reports.stalled(seconds, self._watch.account(), is_held=True)
        return sending.result()

    def _note_progress(self) -> None:
        self._watch.note((self._pacing.written_bytes, self._pacing.taken_bytes))
