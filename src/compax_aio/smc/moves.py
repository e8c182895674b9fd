"""A motion of one axis: what any move can do, and another speed for a run."""

from __future__ import annotations

from typing import Protocol

from ..motion.moves import MoveFuture, MoveOwner, OnCancel
from .vocabulary import MotionPlan

__all__ = ["AxisMove", "AxisOfMove"]


class AxisOfMove(MoveOwner, Protocol):
    """What a move needs of the axis it runs on."""

    async def change_speed(self, move: AxisMove, speed_steps_s: int) -> None:
        """Let *move*, which must be a run under way, go on at another speed."""


class AxisMove(MoveFuture):
    """
    A motion under way; awaiting it gives a :class:`MoveResult`, or raises why the target was not reached.

    Cancelling it (also by a time-out around it, a failing task group, Ctrl-C) stops the axis softly, unless it was
    made with ``on_cancel="detach"``; then the axis goes on, unwatched, also when the line's block is left.

    The axis does not say when it has arrived: its status is polled (``^``, DCB p. 26), and its position compared.

    Attributes:
        accepted: A future that is done when the line feed that ended the command came back: started, not done.
        target: In steps from the origin, as rounded; None as long as only the axis knows it.
        plan: What is said to the axis.
        sent: The command as it was written, with the axis's name; None until then.
    """

    def __init__(self, owner: AxisOfMove, plan: MotionPlan, on_cancel: OnCancel) -> None:
        super().__init__(owner, plan.description, plan.target, on_cancel)
        self.plan = plan
        self._axis = owner

    async def change_speed(self, speed_steps_s: int) -> None:
        """
        Let a run go on at another speed (``M``), as soon as the ramp before is over (DCB p. 27).

        Args:
            speed_steps_s: Whole steps/s; below zero toward minus. The profile has the range.

        Raises:
            InvalidCommandError: The axis cannot be told this; nothing was sent.
            MoveError: This is no run, or it does not run any more.
        """
        await self._axis.change_speed(self, speed_steps_s)
