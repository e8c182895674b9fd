"""A job as the caller holds it: a future of its result, that can be watched, paused, aborted and cancelled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, get_args

from ..errors import InvalidCommandError
from ..motion.moves import fetch_error
from ..motion.under_way import UnderWay, WorkOwner
from .pacing import HANDSHAKES, Handshake

__all__ = [
    "AnyHandshake",
    "Cut",
    "CutAccount",
    "CutOwner",
    "CutProgress",
    "CutResult",
    "CutState",
    "OnCancel",
    "check_manner",
]

OnCancel = Literal["abort", "finish"]
AnyHandshake = Literal["auto", "software", "xonxoff", "enq1", "enq2", "hardwire"]

CutState = Literal[
    "starting", "cutting", "buffer full", "line held", "paused", "operator pause", "finishing", "aborting", "over"
]
"""
``starting``: nothing is sent yet. ``buffer full``, ``line held``: the cutter has no room. ``paused``: from here.
``operator pause``: at the machine. ``finishing``: all is sent. ``aborting``: it is being stopped. ``over``: it has
ended.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutAccount:
    """
    What is known of a job: how much was sent, and how much the cutter had taken out of its buffer when last asked.

    What was taken is cut or being cut; what was sent and not taken is cut only if nothing has stopped the machine.
    """

    bytes_sent: int
    """Up to there, in the job, all was sent."""
    bytes_total: int | None
    """Of the job; None where it has no end that is known."""
    instructions_sent: int
    instructions_taken: int | None
    """Known to have been taken, by the free space that the cutter has told; None: it was not asked."""
    offset: int | None
    """Where the last instruction begins that was sent; None: none was."""
    line: int | None
    column: int | None
    position_steps: tuple[float, float]
    """Where the tool goes by that instruction: an estimate from the job."""

    def __str__(self) -> str:
        """Say it in one clause."""
        if self.offset is None:
            return "nothing of the job was sent"
        of = "" if self.bytes_total is None else f" of {self.bytes_total}"
        taken = "" if self.instructions_taken is None else f", {self.instructions_taken} of them known to be taken"
        x, y = self.position_steps
        return (
            f"sent are {self.bytes_sent}{of} bytes of the job, {self.instructions_sent} instructions{taken}, the last "
            f"one from line {self.line}, column {self.column}, towards ({x:.0f}, {y:.0f}) steps"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CutProgress:
    """How far a job is."""

    state: CutState
    bytes_sent: int
    bytes_total: int | None
    instructions_sent: int
    instructions_total: int | None
    """None unless the job was counted before it was sent (``check=True``, and no iterator)."""
    position_steps: tuple[float, float]
    """Where the tool goes by what was sent last, an estimate; the machine may be as far behind as its buffer holds."""
    free_bytes: int | None
    """Of the cutter's buffer, when it was last asked."""
    elapsed_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CutResult:
    """How a job ended that was cut."""

    cutter: str
    bytes: int
    """Of the job; what was left out of it is in *warnings*."""
    instructions: int
    """As they were sent: long lists of coordinates are several."""
    handshake: Handshake
    handshake_because: str
    """Why that one was used."""
    proved_by: Literal["OA", ".L"]
    """What the cutter answered only after all the others: ``OA;``, or ``.L`` where it waits for an empty buffer."""
    duration_s: float
    warnings: tuple[str, ...] = ()


class CutOwner(WorkOwner[CutProgress, CutAccount], Protocol):
    """Who carries a job out."""

    async def pause(self) -> None:
        """Send no more."""

    def resume(self) -> None:
        """Go on sending."""

    async def abort(self) -> None:
        """Stop it, and return when the machine can be used."""


class Cut(UnderWay[CutResult, CutProgress, CutAccount]):
    """
    A job under way; awaiting it gives a :class:`CutResult`, or raises why it is not cut.

    Cancelling it (also by a time-out around it, a failing task group, leaving the cutter's block, Ctrl-C) aborts the
    job, unless it was made with ``on_cancel="finish"``: then it is cut to its end, and leaving the block waits for it.
    ``.K`` is written before :meth:`cancel` returns, if anything of the job was.

    Attributes:
        description: What is cut, in a few words.
        on_cancel: What cancelling it does.
        failure: The error that it has ended with; None if it has not.
    """

    def __init__(self, owner: CutOwner, description: str, on_cancel: OnCancel) -> None:
        super().__init__(owner, description)
        self.on_cancel = on_cancel
        self._owner: CutOwner = owner
        self._is_aborted_by_caller = False

    async def pause(self) -> None:
        """
        Send no more until :meth:`resume`; what the cutter has in its buffer is cut.

        Returns when the last instruction that was begun is on its way whole. A job that is over is left as it is.
        """
        await self._owner.pause()

    async def resume(self) -> None:
        """Go on sending; harmless when it is not paused."""
        self._owner.resume()

    async def abort(self) -> None:
        """
        Stop the job (``ESC.K``), lift the tool, and return when the cutter takes another job.

        The vector under way is cut to its end (PNC-900 p. 21). The job then raises MoveStoppedError, which says what
        was sent. A job that is over is left as it is.

        Raises:
            CompaxError: The cutter has not shown that it stopped; look at the machine.
        """
        self._is_aborted_by_caller = True
        await self._owner.abort()

    def fail(self, error: BaseException) -> None:
        """Raise *error* in whoever awaits it; whoever has aborted it knows, and need not await it."""
        super().fail(error)
        if self._is_aborted_by_caller:
            fetch_error(self)


def check_manner(handshake: object, on_cancel: object) -> None:
    """
    Check what a job is told about itself.

    Raises:
        InvalidCommandError: It means nothing.
    """
    if handshake not in {"auto", *HANDSHAKES}:
        choices = ", ".join(map(repr, HANDSHAKES))
        raise InvalidCommandError(f"handshake is 'auto' or one of {choices}, not {handshake!r}")
    if on_cancel not in get_args(OnCancel):
        raise InvalidCommandError(f"on_cancel is 'abort' or 'finish', not {on_cancel!r}")
