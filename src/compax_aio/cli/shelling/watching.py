"""Values that are printed above the prompt whenever they change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any, Final

from rich.text import Text

from ...compax.codecs import DriveStatus, StatusValue
from ...compax.drive import Drive
from ...compax.watch import Watch
from ...errors import ConnectionLostError, InvalidCommandError
from .decoding import error_note
from .replies import Reply

__all__ = ["Watching"]

_INTERVAL_S: Final = 0.5


class Watching:
    """
    Watches what it is told to.

    Args:
        drive: Whose values.
        tell: Called with what is to be printed.
    """

    def __init__(self, drive: Drive, tell: Callable[[Text], None]) -> None:
        self._drive = drive
        self._tell = tell
        self._watch: Watch | None = None
        self._begun = asyncio.Event()

    async def order(self, words: Sequence[str]) -> Reply:
        """
        Watch the quantities named, in place of those watched before; ``off`` watches nothing.

        Raises:
            InvalidCommandError: There is no such quantity.
        """
        names = [word.upper() if word[1:].isdigit() else word.lower() for word in words]
        if not names:
            raise InvalidCommandError("watch what?", hint="watch position, watch torque S6 P40, watch off")
        watch = None if names == ["off"] else self._drive.watch(*names, interval_s=_INTERVAL_S)
        if self._watch is not None:
            self._watch.close()
        self._watch = watch
        self._begun.set()
        return Reply()

    async def run(self) -> None:
        """Tell what changes; until cancelled."""
        try:
            while True:
                await self._begun.wait()
                self._begun.clear()
                if self._watch is not None:
                    await self._follow(self._watch)
        finally:
            if self._watch is not None:
                self._watch.close()

    async def _follow(self, watch: Watch) -> None:
        told: dict[str, str] = {}
        try:
            async for reading in watch:
                for name in watch.quantities:
                    text = _written(reading.values[name], self._drive) if name in reading else None
                    said = text if text is not None else f"no value: {reading.errors[name].what}"
                    if told.get(name) != said:
                        told[name] = said
                        self._tell(Text.assemble((f"{name}  ", "cyan"), said))
        except ConnectionLostError:
            return  # it is told as an event


def _written(value: Any, drive: Drive) -> str:
    if isinstance(value, DriveStatus):
        return value.as_sent
    if isinstance(value, StatusValue):
        return f"{value.raw}{f' {value.unit}' if value.unit else ''}"
    if isinstance(value, float):
        return f"{value:.{drive.settings.decimals}f}"
    return error_note(value).plain
