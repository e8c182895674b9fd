"""One poller a control: asks each question once for all who watch it, in cycles with pauses between."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from functools import partial
from itertools import count
from types import MappingProxyType, TracebackType
from typing import Any, Final, Self
from weakref import WeakSet, WeakValueDictionary

from ..checked_numbers import check_number
from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, InvalidCommandError
from ..escaping import shown
from .answers import Request
from .collecting import Collecting, value_of

__all__ = ["Reading", "Watch", "Watching"]

_MOST_QUANTITIES: Final = 64
_SAME_TIME_S: Final = 1e-6

Quantity = str | int
"""``"Q500"``, or the number of a variable."""


@dataclass(frozen=True, slots=True)
class Reading:
    """
    What a control has said in one cycle of all that is watched; ``reading["Q500"]`` or ``reading[3027]`` is one of it.

    Nothing is carried over from the cycle before: what the control did not say is not in *values*, and *errors* says
    why.
    """

    control: str
    """The control's name."""
    at: float
    """The event loop's time, in seconds, when the cycle began."""
    values: Mapping[Quantity, Any]
    """By question, or number of variable: a text, a number, a time, None for an empty variable, a ProgramStatus."""
    errors: Mapping[Quantity, CompaxError]
    """The same: AnswerTimeoutError, CommandRejectedError or UnexpectedAnswerError."""

    def __getitem__(self, quantity: Quantity) -> Any:
        """
        Return the value of *quantity*.

        Raises:
            AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError: It was asked, and not said.
            InvalidCommandError: It is not watched here.
        """
        key, _ = _parsed(quantity)
        if key in self.values:
            return self.values[key]
        if key in self.errors:
            raise self.errors[key].with_traceback(None)
        watched = ", ".join(map(str, [*self.values, *self.errors]))
        raise InvalidCommandError(f"{key} is not watched here; watched: {watched}", device=self.control)

    def __contains__(self, quantity: object) -> bool:
        """Whether *quantity* has a value."""
        return quantity in self.values


class Watch(AsyncIterator[Reading]):
    """
    The readings of one control from now on, the newest only; made by :meth:`Control.watch`.

    Iterating ends when the control is closed, and raises ConnectionLostError when its line is lost for good. The
    control is asked as long as somebody holds this object: :meth:`close` it, or use it in a ``with`` block.

    Attributes:
        quantities: What is watched.
        interval_s: Seconds from one reading to the next, if the line can do it.
        skipped: Readings that this consumer was too slow to see.
    """

    has_ended = True  # until it is made

    def __init__(
        self,
        quantities: Mapping[Quantity, Request],
        interval_s: float,
        *,
        only_changes: bool,
        leave: Callable[[], None],
        dropped: Callable[[], None],
    ) -> None:
        self.quantities = tuple(quantities)
        self.interval_s = interval_s
        self.skipped = 0
        self.requests = quantities
        self.due_at = asyncio.get_running_loop().time()
        self.error: BaseException | None = None
        self.has_ended = False
        self._only_changes = only_changes
        self._said: tuple[dict[Quantity, Any], dict[Quantity, str]] | None = None
        self._newest: Reading | None = None
        self._news = asyncio.Event()
        self._leave = leave
        self._dropped = dropped

    def put(self, reading: Reading) -> None:
        """Let *reading* be the newest, unless it says the same as the last one and only changes are wanted."""
        said = (dict(reading.values), {key: error.what for key, error in reading.errors.items()})
        if self._only_changes and said == self._said:
            return
        self._said = said
        self.skipped += self._newest is not None
        self._newest = reading
        self._news.set()

    def end(self, error: BaseException | None = None) -> None:
        """Let the consumer finish, or raise *error*, when it has seen the newest reading."""
        if not self.has_ended:
            self.has_ended = True
            self.error = error
            self._news.set()

    def close(self) -> None:
        """Watch no longer: iterating ends, and the control is not asked on this one's behalf. Harmless if repeated."""
        self.end()
        self._newest = self.error = None
        self._leave()

    def __aiter__(self) -> Watch:
        return self

    async def __anext__(self) -> Reading:
        while self._newest is None:
            if self.error is not None:
                raise self.error
            if self.has_ended:
                raise StopAsyncIteration
            self._news.clear()
            try:
                await self._news.wait()
            except asyncio.CancelledError:
                del self  # whoever keeps the cancelled task, and its traceback, does not go on watching
                raise
        reading, self._newest = self._newest, None
        return reading

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if not self.has_ended:
            self._dropped()


class Watching:
    """
    Asks one control for all who watch it: one task, from the first watch to the last.

    A cycle begins no sooner than the settings' ``cycle_s`` after the one before, and asks each question once. While a
    transfer is under way, or a program prints, there is none.

    Args:
        collecting: Of the control.
    """

    def __init__(self, collecting: Collecting) -> None:
        self._collecting = collecting
        self._name = collecting.line.name
        self._cycle_s = collecting.line.settings.cycle_s
        self._loop = asyncio.get_running_loop()
        self._watches: WeakValueDictionary[int, Watch] = WeakValueDictionary()
        self._numbers = count()
        self._task: asyncio.Task[None] | None = None
        self._is_asking = False
        self._joined = asyncio.Event()
        self._next_cycle_at = self._loop.time()
        self._is_over = False
        self._lost: ConnectionLostError | None = None

    # Joining and leaving --------------------------------------------------------------------------------------------

    def watch(self, quantities: tuple[Quantity, ...], interval_s: float | None, *, only_changes: bool) -> Watch:
        """Let somebody watch from now on; see :meth:`Control.watch`."""
        if not 1 <= len(quantities) <= _MOST_QUANTITIES:
            raise InvalidCommandError(
                f"from 1 to {_MOST_QUANTITIES} questions and variables can be watched, not {len(quantities)}",
                device=self._name,
            )
        interval_s = self._cycle_s if interval_s is None else check_number("interval_s", interval_s)
        if interval_s < self._cycle_s:
            raise InvalidCommandError(
                f"interval_s is {self._cycle_s:g} s at least, as the settings' cycle_s, not {interval_s:g}",
                device=self._name,
                hint="controls that were polled without pause have frozen",
            )
        requests = dict(map(_parsed, quantities))
        number = next(self._numbers)
        watch = Watch(
            requests,
            interval_s,
            only_changes=only_changes,
            leave=partial(self._leave, number),
            dropped=self._dropped,
        )
        if self._is_over:
            watch.end(self._loss())
            return watch
        self._watches[number] = watch
        self._joined.set()
        if self._task is None:
            self._task = self._loop.create_task(self._poll(), name=f"{self._name}: watch")
        return watch

    def end(self, error: ConnectionLostError | None = None) -> None:
        """Let all who watch finish, and those to come; or raise *error* in them."""
        self._lost = error
        self._is_over = True
        for watch in list(self._watches.values()):
            watch.end(self._loss())
        self._look_after()

    def _loss(self) -> ConnectionLostError | None:
        """Make an error of its own for each consumer: they are raised at different places."""
        if self._lost is None:
            return None
        error = copy(self._lost)
        error.__cause__ = self._lost.__cause__
        return error

    def _leave(self, number: int) -> None:
        self._watches.pop(number, None)
        self._look_after()

    def _dropped(self) -> None:
        # Whichever thread collects garbage; and the event loop may have ended long ago.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._look_after)

    def _look_after(self) -> None:
        """End the task if nobody watches any more; a question that is under way is carried through first."""
        if self._task is not None and not self._is_asking and not self._watched:
            task, self._task = self._task, None
            task.cancel()

    @property
    def _watched(self) -> list[Watch]:
        return [watch for watch in list(self._watches.values()) if not watch.has_ended]

    # Polling --------------------------------------------------------------------------------------------------------

    async def _poll(self) -> None:
        try:
            while self._watched:
                await self._collecting.pacing.until_free()
                due_at = max(self._next_cycle_at, min((watch.due_at for watch in self._watched), default=0.0))
                if due_at > self._loop.time():
                    await self._wait_until(due_at)
                else:
                    await self._cycle()
        except CompaxError:
            # The line is over, whatever the last question failed by: the control tells all who watch, or has done so.
            if not self._collecting.line.link.is_over:
                raise
        except BaseException as error:
            # A defect, or somebody who cancels every task there is: nobody shall wait for ever.
            if self._task is asyncio.current_task():
                for watch in self._watched:
                    watch.end(error if isinstance(error, Exception) else None)
            raise
        finally:
            if self._task is asyncio.current_task():
                self._task = None

    async def _wait_until(self, due_at: float) -> None:
        """Wait until *due_at*, or until somebody joins."""
        self._joined.clear()
        with suppress(TimeoutError):
            async with asyncio.timeout_at(due_at):
                await self._joined.wait()

    async def _cycle(self) -> None:
        """Ask for all who are due, once each, and give them their readings."""
        now = self._loop.time()
        self._next_cycle_at = now + self._cycle_s
        due, requests = self._take_due(now)
        values, errors = await self._answers(requests)
        for watch in list(due):
            if not watch.has_ended:
                watch.put(self._reading(watch, now, values, errors))

    def _take_due(self, now: float) -> tuple[WeakSet[Watch], dict[Quantity, Request]]:
        """Return whose readings are due, without holding them, and what is to be asked for them."""
        due = [watch for watch in self._watched if watch.due_at <= now + _SAME_TIME_S]
        requests: dict[Quantity, Request] = {}
        for watch in due:
            watch.due_at = now + watch.interval_s
            requests.update(watch.requests)
        return WeakSet(due), requests

    async def _answers(
        self, requests: Mapping[Quantity, Request]
    ) -> tuple[dict[Quantity, Any], dict[Quantity, CompaxError]]:
        values: dict[Quantity, Any] = {}
        errors: dict[Quantity, CompaxError] = {}
        silence: AnswerTimeoutError | None = None
        self._is_asking = True
        try:
            for key, request in requests.items():
                if silence is not None and self._collecting.pacing.is_silent:
                    errors[key] = silence
                    continue
                try:
                    values[key] = value_of(await self._collecting.ask(request))
                except CompaxError as error:
                    if self._collecting.line.link.is_over:
                        raise
                    errors[key] = error.with_traceback(None)
                    silence = error if isinstance(error, AnswerTimeoutError) else silence
        finally:
            self._is_asking = False
        return values, errors

    def _reading(
        self, watch: Watch, at: float, values: Mapping[Quantity, Any], errors: Mapping[Quantity, CompaxError]
    ) -> Reading:
        return Reading(
            self._name,
            at,
            MappingProxyType({key: values[key] for key in watch.quantities if key in values}),
            MappingProxyType({key: errors[key] for key in watch.quantities if key in errors}),
        )


def _parsed(quantity: Quantity) -> tuple[Quantity, Request]:
    """Return how *quantity* is called, and what asks for it."""
    if isinstance(quantity, bool) or not isinstance(quantity, str | int):
        raise InvalidCommandError(
            f"{shown(quantity)} cannot be watched", hint="give 'Q500', or the number of a variable"
        )
    request = Request.of(quantity) if isinstance(quantity, str) else Request.of_variable(quantity)
    return (request.text if request.command != "Q600" or request.variable is None else request.variable), request
