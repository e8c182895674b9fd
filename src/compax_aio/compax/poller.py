"""One poller a drive: reads each quantity once for all who watch it, and leaves the line to everybody else first."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from math import floor, inf
from types import MappingProxyType
from typing import Any, Final

from ..checked_numbers import check_number
from ..errors import CommandRejectedError, CompaxError, ConnectionLostError, InvalidCommandError
from ..motion.watching import Watchers
from .line import DriveLine
from .parameters import NumberedValues
from .readings import MAX_STATUS, Readings
from .value_tables import PARAMETER_TABLE, VARIABLE_TABLE
from .watch import Reading, Watch

__all__ = ["Poller"]

_log = logging.getLogger("compax_aio.compax")

_NAMED: Final = (
    "position",
    "target",
    "following_error",
    "speed",
    "torque",
    "status",
    "error",
    "error_history",
)
"""What can be watched by name: each is the method of the same name of a drive."""

_NUMBERED: Final = re.compile(r"([SPV])([1-9][0-9]{0,2})")

_SHORTEST_INTERVAL_S: Final = 0.001
_SAME_TIME_S: Final = 1e-6
"""Clocks and products of fractions are no more exact than that."""
_PATIENCE: Final = 10
"""While others use the line, the poller waits so many times as long as its last reading took ..."""
_LONGEST_PATIENCE_S: Final = 1.0
"""... or so long, if that is less: watchers are slowed down, but not forgotten."""
_REFUSED_AGAIN_S: Final = 5.0
"""What the drive refuses is asked again so rarely: most of it will be refused for ever."""


@dataclass(slots=True, eq=False)
class _Quantity:
    """One thing that is asked, and what came of it the last time."""

    name: str
    read: Callable[[], Awaitable[Any]]
    interval_s: float
    due_at: float
    value: Any = None
    error: CompaxError | None = None
    at: float = -inf

    @property
    def is_refused(self) -> bool:
        return isinstance(self.error, CommandRejectedError)


class Poller:
    """
    Asks one drive for all who watch it: one task, from the first watch to the last, each quantity once for all.

    It has at most one reading queued, in the lane that goes last, and after each it leaves the line to others for at
    least as long as that took. So it takes half of an idle line at most, and nobody waits for more than the exchange
    in flight.

    Args:
        line: Of the drive.
        readings: Of the drive; read by name, or by the number of a status value.
        parameters: Of the drive.
        variables: Of the drive.
    """

    def __init__(
        self, line: DriveLine, readings: Readings, parameters: NumberedValues, variables: NumberedValues
    ) -> None:
        self._name = line.name
        self._link = line.link
        self._stats = line.link.stats
        self._readings = readings
        self._parameters = parameters
        self._variables = variables
        self._loop = asyncio.get_running_loop()
        self._watches: Watchers[Watch] = Watchers(line.name, line.link, self._poll)
        self._quantities: dict[str, _Quantity] = {}

    def watch(self, quantities: tuple[str, ...], interval_s: float) -> Watch:
        """Let somebody watch from now on; see :meth:`Drive.watch`."""
        if not quantities:
            raise InvalidCommandError("nothing was named, so nothing is watched", hint=_possible())
        if not check_number("interval_s", interval_s) > 0:
            raise InvalidCommandError(f"interval_s must be above 0, not {interval_s!r}")
        readers = {name: self._reader(name) for name in quantities}

        def begin(leave: Callable[[], None], dropped: Callable[[], None]) -> Watch:
            watch = Watch(tuple(readers), max(float(interval_s), _SHORTEST_INTERVAL_S), leave, dropped)
            for name, read in readers.items():
                quantity = self._quantities.setdefault(name, _Quantity(name, read, watch.interval_s, watch.due_at))
                quantity.due_at = min(quantity.due_at, watch.due_at)
            return watch

        return self._watches.join(begin)

    def end(self, error: ConnectionLostError | None = None) -> None:
        """Let all who watch finish, and those to come; or raise *error* in them."""
        self._watches.end(error)

    def _reader(self, name: object) -> Callable[[], Awaitable[Any]]:
        if isinstance(name, str):
            if name in _NAMED:
                reader: Callable[[], Awaitable[Any]] = getattr(self._readings, name)
                return reader
            if found := _NUMBERED.fullmatch(name):
                letter, number = found[1], int(found[2])
                if letter == "S" and number <= MAX_STATUS:
                    return partial(self._readings.read_status, number)
                if letter == "P" and number in PARAMETER_TABLE.decimals:
                    return partial(self._parameters.read, number)
                if letter == "V" and number in VARIABLE_TABLE.decimals:
                    return partial(self._variables.read, number)
        raise InvalidCommandError(f"{name!r} cannot be watched", device=self._name, hint=_possible())

    # Polling --------------------------------------------------------------------------------------------------------

    async def _poll(self) -> None:
        while (quantity := self._next_quantity()) is not None:
            if quantity.due_at > self._loop.time():
                await self._watches.wait_until(quantity.due_at)
            else:
                begun_at = self._loop.time()
                await self._read(quantity)
                self._serve(quantity)
                if self._watches.is_anybody_there:
                    await self._give_way(self._loop.time() - begun_at)

    def _next_quantity(self) -> _Quantity | None:
        """Find what is due first, of what is watched now; it is due as often as the quickest wants it."""
        intervals: dict[str, float] = {}
        for watch in self._watches:
            for name in watch.quantities:
                intervals[name] = min(watch.interval_s, intervals.get(name, inf))
        self._quantities = {name: self._quantities[name] for name in intervals}
        for name, interval_s in intervals.items():
            self._quantities[name].interval_s = interval_s
        return min(self._quantities.values(), key=lambda quantity: quantity.due_at, default=None)

    async def _read(self, quantity: _Quantity) -> None:
        error: CompaxError | None = None
        value = None
        self._watches.is_asking = True
        try:
            value = await quantity.read()
        except CompaxError as failure:
            if self._link.is_over:
                raise
            error = failure.with_traceback(None)
            if quantity.error is None:
                _log.warning("%s: %s cannot be read: %s", self._name, quantity.name, error)
        finally:
            self._watches.is_asking = False
        quantity.value, quantity.error = value, error
        quantity.at = self._loop.time()
        quantity.due_at = _next_beat(quantity.at, quantity.interval_s)
        if quantity.is_refused:
            quantity.due_at = max(quantity.due_at, quantity.at + _REFUSED_AGAIN_S)

    def _serve(self, quantity: _Quantity) -> None:
        """Give a reading to all for whom *quantity* was the last that was missing."""
        made: dict[tuple[str, ...], Reading] = {}
        for watch in self._watches:
            if quantity.name in watch.quantities:
                parts = [self._quantities[name] for name in watch.quantities]
                times = [part.at for part in parts if not part.is_refused] or [quantity.at]
                if min(times) >= watch.due_at - _SAME_TIME_S:
                    if watch.quantities not in made:
                        made[watch.quantities] = self._reading(parts, min(times))
                    watch.put(made[watch.quantities])
                    watch.due_at = _next_beat(max(times), watch.interval_s)

    def _reading(self, parts: list[_Quantity], at: float) -> Reading:
        values = {part.name: part.value for part in parts if part.error is None}
        errors = {part.name: part.error for part in parts if part.error is not None}
        return Reading(self._name, at, MappingProxyType(values), MappingProxyType(errors))

    async def _give_way(self, took_s: float) -> None:
        """Leave the line to others: for as long as the last reading took, and on while they use it, within patience."""
        patient_until = self._loop.time() + min(_PATIENCE * took_s, _LONGEST_PATIENCE_S)
        while True:
            traffic = self._traffic
            await asyncio.sleep(took_s)
            if self._traffic == traffic or self._loop.time() >= patient_until:
                return

    @property
    def _traffic(self) -> int:
        return self._stats.bytes_sent + self._stats.bytes_received


def _next_beat(at: float, interval_s: float) -> float:
    """
    Return the next whole multiple of *interval_s*, on the loop's clock.

    So all who want something equally often want it at the same time, and the axes of a group are read together.
    """
    return (floor((at + _SAME_TIME_S) / interval_s) + 1) * interval_s


def _possible() -> str:
    ranges = f"S1-S{MAX_STATUS}, P1-P{max(PARAMETER_TABLE.decimals)}, V1-V39, V50-V70"
    return f"possible are {', '.join(_NAMED)}, and by number {ranges}"
