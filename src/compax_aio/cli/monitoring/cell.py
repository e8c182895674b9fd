"""All axes of the monitor: stopped all at once, and left so that nothing goes on that was started here."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from compax_aio.link.cancellation import despite_cancellation

from .axis import MonitoredAxis
from .diary import Diary
from .levels import Level
from .orders import Farewell
from .state import StopReport
from .wanted import WantedAxis

__all__ = ["Cell"]


class Cell:
    """
    The axes of the monitor.

    Args:
        wanted: The axes, in the order in which they are shown.
        interval_s: Seconds from one reading to the next.
        jog_percent: Speed of a jog, in % of nominal speed.
    """

    def __init__(self, wanted: Sequence[WantedAxis], *, interval_s: float, jog_percent: float) -> None:
        self.diary = Diary()
        self.axes = tuple(
            MonitoredAxis(
                each.name, each.url, each.settings, interval_s=interval_s, jog_percent=jog_percent, diary=self.diary
            )
            for each in wanted
        )
        self.farewells: tuple[Farewell, ...] = ()
        self._closing: asyncio.Future[None] | None = None

    def start(self) -> None:
        """Open all lines, side by side."""
        for axis in self.axes:
            axis.start()

    def stop_all(self) -> None:
        """Stop all axes; STOP goes to all lines in the next turn of the event loop."""
        self.diary.add("", "STOP ALL", Level.ACTIVE)
        for axis in self.axes:
            axis.orders.stop()

    @property
    def stops(self) -> dict[str, StopReport]:
        """What came of the last stop of each axis, as far as there was one."""
        return {axis.name: axis.state.stop for axis in self.axes if axis.state.stop is not None}

    @property
    def moved_from_here(self) -> tuple[MonitoredAxis, ...]:
        """The axes of which it is not known that all is over that was started here."""
        return tuple(axis for axis in self.axes if axis.orders.may_move_by_us)

    async def close(self) -> None:
        """
        Stop what was started here, all lines at once, and close them; then :attr:`farewells` says what became of them.

        It is carried through even if the caller is cancelled meanwhile; when called again, it waits for the same.
        """
        if self._closing is None:
            self._closing = asyncio.ensure_future(self._close())
        await despite_cancellation(self._until_closed(self._closing))

    async def _close(self) -> None:
        self.farewells = tuple(await asyncio.gather(*(axis.close() for axis in self.axes)))

    @staticmethod
    async def _until_closed(closing: asyncio.Future[None]) -> None:
        await closing
