"""Several drives as one: started together, all accepted or all stopped, and one that fails stops the others."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterable, Mapping
from contextlib import asynccontextmanager
from typing import Any, TypeVar

from ..errors import InvalidCommandError, MoveStoppedError
from ..link.cancellation import despite_cancellation
from ..motion.connecting import Connecting
from .connecting import connect
from .drive import Drive
from .moves import Move, MoveResult, PreparedMove, fetch_error
from .settings import DriveSettings
from .vocabulary import MovePlan, plan_home, plan_move_to
from .watch import GroupWatch

__all__ = ["DriveGroup", "GroupMove"]

_Result = TypeVar("_Result")


class GroupMove(asyncio.Future[dict[str, MoveResult]]):
    """
    Moves of several drives under way; awaiting it gives each axis's result, when all have reached their targets.

    If one is not accepted, or fails, the others are stopped and awaiting raises the first error; notes on it say how
    the others ended. Cancelling stops every drive.

    Attributes:
        moves: Each axis's own :class:`Move`.
        accepted: A future that is done when every drive's prompt came back.
    """

    def __init__(self, moves: Mapping[str, PreparedMove]) -> None:
        super().__init__()
        self.moves = dict(moves)
        self.accepted: asyncio.Future[None] = self.get_loop().create_future()
        self.accepted.add_done_callback(fetch_error)
        self._watcher = self.get_loop().create_task(self._watch())

    def cancel(self, msg: Any = None) -> bool:
        """Give all moves up; STOP goes to all lines before this returns."""
        if not super().cancel(msg):
            return False
        self.accepted.cancel(msg)
        for move in self.moves.values():
            move.cancel(msg)
        return True

    async def stop(self) -> None:
        """Stop all drives of this move at once, and return at their standstill; see :meth:`Move.stop`."""
        await _all_at_once({axis: move.stop() for axis, move in self.moves.items()})

    async def _watch(self) -> None:
        try:
            if await self._start_together():
                if not self.accepted.done():
                    self.accepted.set_result(None)
                await _all_succeed(list(self.moves.values()))
            # A stop that fails is told by its move.
            await asyncio.gather(*(move.stop() for move in self.moves.values()), return_exceptions=True)
            await asyncio.wait(self.moves.values())
        except asyncio.CancelledError:
            self.cancel()
            raise
        self._report()

    async def _start_together(self) -> bool:
        """Let every drive hold its move ready; then send nothing but the triggers, to all lines in one go."""
        if not await _all_succeed([move.readiness for move in self.moves.values()]):
            return False
        if any(move.done() for move in self.moves.values()):  # stopped, or failed, since it was ready
            return False
        for move in self.moves.values():
            if not move.triggered.is_set():  # by hand
                move.trigger()
        return await _all_succeed([move.acceptance for move in self.moves.values()])

    def _report(self) -> None:
        errors = {axis: move.exception() for axis, move in self.moves.items() if not move.cancelled()}
        # Who was stopped here was stopped because of somebody else.
        culprit = next(
            (error for error in errors.values() if error and not isinstance(error, MoveStoppedError)),
            next((error for error in errors.values() if error), None),
        )
        if self.done():
            return
        if culprit is not None:
            for axis, move in self.moves.items():
                if errors.get(axis) is not culprit:
                    culprit.add_note(_outcome(axis, move))
            if not self.accepted.done():
                self.accepted.set_exception(culprit)
            if isinstance(culprit, MoveStoppedError):
                # None has failed, all were stopped: whoever did that knows.
                self.add_done_callback(fetch_error)
            self.set_exception(culprit)
        elif len(errors) < len(self.moves):
            self.cancel()
        else:
            self.set_result({axis: move.result() for axis, move in self.moves.items()})


class DriveGroup:
    """
    Several drives, each on its own line, under the names of their axes.

    Args:
        drives: The drives by axis: ``DriveGroup(x=x, y=y)``.
    """

    def __init__(self, **drives: Drive) -> None:
        if not drives:
            raise InvalidCommandError("a group has at least one drive")
        if len(set(map(id, drives.values()))) < len(drives):
            raise InvalidCommandError(
                f"each axis of a group has a drive of its own, not {', '.join(drives)} the same one"
            )
        self.drives = drives

    @staticmethod
    @asynccontextmanager
    async def connect(
        urls: Mapping[str, str], *, settings: DriveSettings | Mapping[str, DriveSettings] | None = None
    ) -> AsyncIterator[DriveGroup]:
        """
        Connect to all drives at once: ``async with DriveGroup.connect({"x": url, "y": url}) as group``.

        If one cannot be reached, the others are closed and its error is raised. Leaving the block stops all drives
        at once, as far as they move, and closes their lines.

        Args:
            urls: The line of each axis; see :func:`compax_aio.connect`.
            settings: For all drives, or by axis.
        """
        by_axis = settings if isinstance(settings, Mapping) else dict.fromkeys(urls, settings)
        opening = {
            axis: asyncio.ensure_future(_open(connect(url, name=axis, settings=by_axis.get(axis))))
            for axis, url in urls.items()
        }
        try:
            await asyncio.gather(*opening.values())
            yield DriveGroup(**{axis: task.result() for axis, task in opening.items()})
        finally:
            for task in opening.values():
                task.cancel()
            await despite_cancellation(_close_all(opening))

    def __getitem__(self, axis: str) -> Drive:
        return self.drives[axis]

    def move_to(
        self,
        *,
        speed_percent: float | None = None,
        acceleration_ms: int | None = None,
        deceleration_ms: int | None = None,
        timeout_s: float | None = None,
        **targets: float,
    ) -> GroupMove:
        """
        Start absolute moves of the axes named, ``move_to(x=10, y=20)``, together; the settings go to all of them.

        Every target is checked, and every drive free, before a byte is sent to any. Then each drive is told its move to
        hold it ready, and when all do, the triggers are sent (``,`` and ``!``, UG p. 160).

        Raises:
            InvalidCommandError: An axis is unknown, or a target cannot be said to its drive; nothing was sent.
            MoveActiveError, MoveInDoubtError: A drive takes no move; nothing was sent.
        """
        plans = {
            axis: plan_move_to(
                target,
                self._drive(axis).settings,
                speed_percent=speed_percent,
                acceleration_ms=acceleration_ms,
                deceleration_ms=deceleration_ms,
            )
            for axis, target in targets.items()
        }
        return self._start(plans, timeout_s)

    def home(self, *axes: str, timeout_s: float | None = None) -> GroupMove:
        """Find machine zero with the axes named, or with all; see :meth:`move_to`."""
        return self._start({axis: plan_home(self._drive(axis).settings) for axis in axes or self.drives}, timeout_s)

    async def stop(self) -> None:
        """
        Stop all drives at once, and return when all stand still.

        It goes on when one of them fails, and then raises the first error; notes on it tell the others.
        """
        await _all_at_once({axis: drive.stop() for axis, drive in self.drives.items()})

    async def positions(self) -> dict[str, float]:
        """Read the actual position of every axis, all lines at once."""
        return await _all_at_once({axis: drive.position() for axis, drive in self.drives.items()})

    def watch(self, *quantities: str, interval_s: float = 0.2) -> GroupWatch:
        """
        Read quantities of every axis again and again; an asynchronous iterator of readings by axis.

        ``async for reading in group.watch("position"): print(reading["x"]["position"])``; see :meth:`Drive.watch`.
        """
        return GroupWatch(
            {axis: drive.watch(*quantities, interval_s=interval_s) for axis, drive in self.drives.items()}
        )

    async def close(self) -> None:
        """Stop what moves, all lines at once, and close them; see :meth:`Drive.close`."""
        await _all_at_once({axis: drive.close() for axis, drive in self.drives.items()})

    def _drive(self, axis: str) -> Drive:
        try:
            return self.drives[axis]
        except KeyError:
            known = ", ".join(self.drives)
            raise InvalidCommandError(f"there is no axis {axis!r} in this group; there are {known}") from None

    def _start(self, plans: Mapping[str, MovePlan], timeout_s: float | None) -> GroupMove:
        if not plans:
            raise InvalidCommandError("no axis was named, so nothing moves")
        for axis, plan in plans.items():
            self.drives[axis].check(plan)
        return GroupMove({axis: self.drives[axis].prepare(plan, timeout_s=timeout_s) for axis, plan in plans.items()})


async def _open(connecting: Connecting[Drive]) -> Drive:
    return await connecting


async def _close_all(opening: Mapping[str, asyncio.Future[Drive]]) -> None:
    await asyncio.wait(opening.values())
    opened = {axis: task.result() for axis, task in opening.items() if not task.cancelled() and not task.exception()}
    await _all_at_once({axis: drive.close() for axis, drive in opened.items()})


async def _all_succeed(futures: Iterable[asyncio.Future[Any]]) -> bool:
    """Wait until all are done, or one has failed."""
    pending = set(futures)
    while pending:
        done, pending = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        if any(future.cancelled() or future.exception() is not None for future in done):
            return False
    return True


async def _all_at_once(work: Mapping[str, Coroutine[Any, Any, _Result]]) -> dict[str, _Result]:
    """Do all of *work* side by side to its end; then raise the first error, with notes on the others."""
    results = await asyncio.gather(*work.values(), return_exceptions=True)
    by_axis = dict(zip(work, results, strict=True))
    errors = {axis: result for axis, result in by_axis.items() if isinstance(result, BaseException)}
    if errors:
        (_, first), *others = errors.items()
        for axis, error in others:
            first.add_note(_told(axis, error))
        raise first
    return {axis: result for axis, result in by_axis.items() if not isinstance(result, BaseException)}


def _outcome(axis: str, move: Move) -> str:
    if move.cancelled():
        return f"{axis}: cancelled"
    if (error := move.exception()) is not None:
        return _told(axis, error)
    return f"{axis}: reached its target"


def _told(axis: str, error: BaseException) -> str:
    """Say who failed and how; our own errors may begin with the name already."""
    return str(error) if getattr(error, "device", None) == axis else f"{axis}: {error}"
