"""Who is on a line that was opened: the drive that was there before, and whether it was switched off meanwhile."""

from __future__ import annotations

import logging
from typing import Final

from ..errors import AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError
from ..link.contract import Lane
from .codecs import decode_codes, value_text
from .facts.device_errors import HISTORY_POWERED_ON
from .motion import Motion
from .observer import Observer

__all__ = ["Identity", "has_power_on_mark"]

_log = logging.getLogger("compax_aio.compax")

_IDENTIFICATION: Final = range(31, 40)
"""Nine values, of which nobody at hand says what they are (IBS p. 12): together they are compared as they are sent."""


class Identity:
    """
    What a drive says of itself, remembered from the first time to the next.

    Args:
        observer: Of the drive.
        motion: Of the same drive.
    """

    def __init__(self, observer: Observer, motion: Motion) -> None:
        self._line = observer.line
        self._observer = observer
        self._motion = motion
        self._values: dict[int, str] | None = None
        self._history: tuple[int, ...] | None = None
        self._signs_of_restart: dict[str, None] = {}

    async def greet(self) -> None:
        """
        Look who is there and how it stands, on a line that was opened; the first time, remember it.

        Raises:
            UnexpectedAnswerError: It is another drive.
            AnswerTimeoutError, ConnectionLostError: It does not say.
        """
        if self._line.settings.reconnect and await self._check():
            self._signs_of_restart["the error history has a new power-on mark (S18)"] = None
        was_homed, is_homing = self._observer.is_homed, self._motion.is_homing
        status = await self._motion.look_around()
        if status is not None and was_homed and not status.machine_zero_approached and not is_homing:
            self._signs_of_restart["machine zero is not approached any more (S16 bit 3)"] = None
        await self._line.transfer.read_interface(Lane.GREETING)

    def take_signs_of_restart(self) -> tuple[str, ...]:
        """Take what has shown since the last time that the drive was switched off, in greetings that were cut too."""
        signs, self._signs_of_restart = tuple(self._signs_of_restart), {}
        return signs

    async def _check(self) -> bool:
        """Raise unless it is the drive of the last time; return whether it has a new mark of power-on."""
        if self._values is None:
            self._values = await self._learn()
        else:
            for number, known in self._values.items():
                await self._compare(number, known)
        before, self._history = self._history, await self._read_history()
        return before is not None and self._history is not None and has_power_on_mark(before, self._history)

    async def _learn(self) -> dict[int, str] | None:
        values: dict[int, str] = {}
        for number in _IDENTIFICATION:
            try:
                values[number] = await self._read_twice(number)
            except (AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError) as error:
                _log.info("%s does not say who it is (S%d): %s", self._line.name, number, error)
                is_known = bool(values) or not isinstance(error, AnswerTimeoutError)
                return values if is_known else None  # it is asked again the next time
        return values

    async def _compare(self, number: int, known: str) -> None:
        try:
            value = await self._read(number)
        except CommandRejectedError as error:
            value = error.received or "an error"
        if value != known:
            raise UnexpectedAnswerError(
                f"another drive is on the line: its identification S{number} is {value!r}, and was {known!r}",
                device=self._line.name,
                sent=f"S{number}",
                received=value,
                hint="were cables or adapters swapped? Name an adapter by its serial number, which goes with it: "
                "serial://?serial_number=…",
                exchanges=self._line.link.recent(),
            )

    async def _read_twice(self, number: int) -> str:
        """Read once more if no answer comes: a drive of which nothing is known could not be told from another."""
        try:
            return await self._read(number)
        except AnswerTimeoutError:
            return await self._read(number)

    async def _read(self, number: int) -> str:
        return value_text(await self._line.query(f"S{number}", Lane.GREETING))

    async def _read_history(self) -> tuple[int, ...] | None:
        try:
            return await self._line.read("S18", decode_codes, Lane.GREETING)
        except (AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError):
            return self._history


def has_power_on_mark(before: tuple[int, ...], now: tuple[int, ...]) -> bool:
    """Whether a power-on mark is among what has come to an error history, newest first, since it was *before*."""
    new = next((count for count in range(len(now)) if now[count:] == before[: len(now) - count]), len(now))
    return HISTORY_POWERED_ON in now[:new]
