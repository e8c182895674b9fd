"""One poller a control: asks each question once for all who watch it, in cycles with pauses between."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, TracebackType
from typing import Any, Final, Self
from weakref import WeakSet

from ..checked_numbers import check_number
from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, InvalidCommandError
from ..escaping import shown
from ..motion.watching import NewestReadings, Watchers
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
    """By question or number of variable. Each is a text, a number, a time, a ProgramStatus, or None if it is empty."""
    errors: Mapping[Quantity, CompaxError]
    """By the same. Each is an AnswerTimeoutError, CommandRejectedError or UnexpectedAnswerError."""

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


class Watch(NewestReadings[Reading]):
    """
    The readings of one control from now on, the newest only; made by :meth:`Control.watch`.

    Iterating ends when the control is closed, and raises ConnectionLostError when its line is lost for good. The
    control is asked as long as somebody holds this object: :meth:`close` it, or use it in a ``with`` block.

    Attributes:
        quantities: What is watched.
        interval_s: Seconds from one reading to the next, if the line can do it.
        skipped: Readings that this consumer was too slow to see.
    """

    def __init__(
        self,
        quantities: Mapping[Quantity, Request],
        interval_s: float,
        leave: Callable[[], None],
        dropped: Callable[[], None],
        *,
        only_changes: bool,
    ) -> None:
        super().__init__(interval_s, leave, dropped)
        self.quantities = tuple(quantities)
        self.requests = quantities
        self._only_changes = only_changes
        self._said: tuple[dict[Quantity, Any], dict[Quantity, str]] | None = None

    def put(self, reading: Reading) -> None:
        """Let *reading* be the newest, unless it says the same as the last one and only changes are wanted."""
        said = (dict(reading.values), {key: error.what for key, error in reading.errors.items()})
        if self._only_changes and said == self._said:
            return
        self._said = said
        super().put(reading)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


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
        self._watchers: Watchers[Watch] = Watchers(self._name, collecting.line.link, self._poll)
        self._next_cycle_at = self._loop.time()

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
        return self._watchers.join(partial(Watch, requests, interval_s, only_changes=only_changes))

    def end(self, error: ConnectionLostError | None = None) -> None:
        """Let all who watch finish, and those to come; or raise *error* in them."""
        self._watchers.end(error)

    # Polling --------------------------------------------------------------------------------------------------------

    async def _poll(self) -> None:
        while self._watchers.is_anybody_there:
            await self._collecting.pacing.until_free()
            due_at = max(self._next_cycle_at, min((watch.due_at for watch in self._watchers), default=0.0))
            if due_at > self._loop.time():
                await self._watchers.wait_until(due_at)
            else:
                await self._cycle()

    async def _cycle(self) -> None:
        """Ask for all who are due, once each, and give them their readings."""
        now = self._loop.time()
        self._next_cycle_at = now + self._cycle_s
        due, requests = self._take_due(now)
        values, errors = await self._answers(requests)
        for watch in self._watchers:
            if watch in due:
                watch.put(self._reading(watch, now, values, errors))

    def _take_due(self, now: float) -> tuple[WeakSet[Watch], dict[Quantity, Request]]:
        """Return whose readings are due, without holding them, and what is to be asked for them."""
        due = [watch for watch in self._watchers if watch.due_at <= now + _SAME_TIME_S]
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
        self._watchers.is_asking = True
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
            self._watchers.is_asking = False
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
