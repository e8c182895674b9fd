"""Looking at one axis: status and position as they are, patiently, and what they say about a reset."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final, TypeVar

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, UnexpectedAnswerError
from ..link.contract import Lane
from .codecs import AxisStatus
from .line import SmcLine
from .vocabulary import set_origin

__all__ = ["Look", "Observer"]

_Value = TypeVar("_Value")

_AGAIN_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class Look:
    """The status of an axis, and then its position."""

    status: AxisStatus
    position: float

    @property
    def as_sent(self) -> str:
        """For errors: what the axis said."""
        return f"^ {self.status.raw}, Z {self.position:g}"


class Observer:
    """
    Looks at one axis, and remembers what tells whether its position means anything.

    Args:
        line: The axis is on it.
        axis: Its name.
        on_lost_reference: Called with its name and the reason when a look shows that its position means nothing.
    """

    def __init__(self, line: SmcLine, axis: str, on_lost_reference: Callable[[str, str], None]) -> None:
        self.line = line
        self.axis = axis
        self._on_lost_reference = on_lost_reference
        self.name = line.called(axis)
        self.last_position: float | None = None
        self._may_move = False
        """Whether something was told since it was known to stand, that may move it."""
        self.standing_at: float | None = None
        """Where it stood when it was last known to stand, and nothing was told since that moves it."""
        self.lost_reference: str | None = None
        """Why the position counts from nobody knows where; None if it is not known to."""
        self.times_lost = 0
        """How often that was noted: positions before and after cannot be compared."""

    async def status(self, lane: Lane = Lane.CONTROL) -> AxisStatus:
        """Read the motion status."""
        return await self.line.status(self.axis, lane)

    async def position(self, lane: Lane = Lane.CONTROL) -> float:
        """Read the position in steps, and remember it."""
        position = await self.line.position(self.axis, lane)
        self.last_position = position
        if not self._may_move:
            self.note_standing(position)
        return position

    async def look(self, lane: Lane = Lane.CONTROL) -> Look:
        """Read status and position, and take note of what they say about a reset."""
        look = Look(await self.status(lane), await self.position(lane))
        if look.status.is_settled:
            self.note_standing(look.position)
        return look

    def note_standing(self, position: float) -> None:
        """Take note of where the axis stands; one that was elsewhere and counts 0 now has been reset, as it seems."""
        self._may_move = False
        before, self.standing_at = self.standing_at, position
        if before is not None and position == 0.0 and not self.is_near(before, 0.0):
            self.find_reference_lost(f"it stood at {self.written(before)} and counts 0 now, as after a reset")

    def note_moving(self) -> None:
        """Take note that it may be anywhere from now on."""
        self._may_move = True
        self.standing_at = None

    def lose_reference(self, why: str) -> None:
        """Take note that nobody knows what the position is counted from; the first reason is kept."""
        self.standing_at = None
        self.times_lost += 1
        self.lost_reference = self.lost_reference or why

    def find_reference_lost(self, why: str) -> None:
        """Take note of the same, and tell it, for nobody has asked for it."""
        was_known = self.lost_reference is None
        self.lose_reference(why)
        if was_known:
            self._on_lost_reference(self.axis, why)

    async def make_origin(self) -> float:
        """
        Make where the axis stands the origin (``O``, DCB p. 24), and return the position that it counts then.

        Raises:
            UnexpectedAnswerError: It counts something else than zero; nobody knows what from.
            CompaxError: The line failed; likewise.
        """
        self.lose_reference("whether its origin was moved is not known")
        await self.line.tell(self.axis, set_origin(self.line.settings.profile))
        position = await self.position()
        if not self.is_near(position, 0.0):
            raise UnexpectedAnswerError(
                f"the axis was told to count from here, and counts {self.written(position)}",
                device=self.name,
                hint="does it stand still, and does this member of the family have the command?",
                exchanges=self.line.link.recent(),
            )
        self.lost_reference, self.standing_at = None, position
        return position

    async def patiently(self, read: Callable[[], Awaitable[_Value]], for_s: float | None = None) -> _Value:
        """
        Read again and again while there is no answer, at most *for_s* or as long as a lost line is waited for.

        Raises:
            CompaxError: The last one that *read* raised.
        """
        loop = asyncio.get_running_loop()
        give_up_at = loop.time() + (self.line.settings.in_doubt_after_s if for_s is None else for_s)
        while True:
            try:
                async with asyncio.timeout_at(give_up_at):
                    return await read()
            except TimeoutError:
                raise self._nothing_heard() from None
            except (AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError):
                if self.line.link.is_over or loop.time() + _AGAIN_S >= give_up_at:
                    raise
                await asyncio.sleep(_AGAIN_S)

    def _nothing_heard(self) -> CompaxError:
        return AnswerTimeoutError(
            "the axis has not said how it stands",
            device=self.name,
            hint="look at the machine; is the line there, and the axis switched on?",
            exchanges=self.line.link.recent(),
        )

    def is_near(self, position: float, target: float) -> bool:
        """Whether two positions are the same but for the last decimal."""
        return abs(position - target) < 0.75 * 10.0**-self.line.settings.profile.decimals

    def written(self, position: float) -> str:
        """Write a position for an error."""
        return f"{position:.{self.line.settings.profile.decimals}f} steps"
