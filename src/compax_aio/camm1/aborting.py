"""Stopping a cutter: its buffer dropped, the vector under way cut to its end, the tool lifted, all of it seen."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import Final

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, MoveTimeoutError
from ..link.contract import Lane
from .line import CutterLine
from .replies import CutterStatus, Position, decode_position

__all__ = ["Aborting"]

_log = logging.getLogger("compax_aio.camm1")

_PAUSE_S: Final = 0.05
_LIFT: Final = ";PU;"
"""Half an instruction may be left in front of it (row 16 of what manuals leave open)."""


class Aborting:
    """
    One stop of one cutter; ``.K`` is written when this is made, if there is a line.

    Args:
        line: Of the cutter.
    """

    def __init__(self, line: CutterLine) -> None:
        self._line = line
        self._loop = asyncio.get_running_loop()
        self._give_up_at = self._loop.time() + line.settings.stop_timeout_s
        self._in_step: asyncio.Future[None] | None = None
        with suppress(ConnectionLostError):  # then it waits for the line
            self._in_step = line.abort()

    async def carry_through(self, *, lifts_with_call: bool = False) -> CutterStatus:
        """
        Return when the buffer is empty, and the tool was told to go up.

        Args:
            lifts_with_call: The machine is in mode 1: instructions of mode 2 are called with ``^``.

        Raises:
            CompaxError: It was not seen to be so within ``stop_timeout_s``.
        """
        await self._until_heard()
        await self._until_empty()
        status = await self._lift(";^PU;" if lifts_with_call else _LIFT)
        if not status.is_paused:  # else it goes up when somebody lets the machine go on
            await self._until_empty()
            await self._until_up("^" if lifts_with_call else "")
        await self._line.errors(Lane.CONTROL)
        return await self._line.status(Lane.STOP)

    async def _until_heard(self) -> None:
        """Repeat ``.K`` until the line is in step after it: it does no harm when it comes twice."""
        if self._in_step is None:
            _log.warning("%s: the abort waits for the line, which is lost", self._line.name)
        while True:
            try:
                async with asyncio.timeout_at(self._give_up_at):
                    if self._in_step is not None:
                        await asyncio.shield(self._in_step)
                    else:
                        await self._line.abort_in_turn()
            except TimeoutError:
                raise self._not_heard() from None
            except CompaxError:
                if self._line.link.is_over or self._loop.time() >= self._give_up_at:
                    raise
            else:
                return
            self._in_step = None
            await asyncio.sleep(_PAUSE_S)

    async def _until_empty(self) -> CutterStatus:
        while True:
            try:
                status = await self._line.status(Lane.STOP)
            except CompaxError:
                # One answer lost is no reason to give up an abort that was heard.
                if self._line.link.is_over or self._loop.time() >= self._give_up_at:
                    raise
                await asyncio.sleep(_PAUSE_S)
                continue
            if status.buffer_is_empty:
                return status
            if self._loop.time() >= self._give_up_at:
                raise MoveTimeoutError(
                    f"ESC.K was heard, but within {self._line.settings.stop_timeout_s:g} s the buffer was not empty",
                    device=self._line.name,
                    received=str(status.number),
                    hint="is the machine paused, or its SETUP lamp off? Look at it, then stop() again",
                    exchanges=self._line.link.recent(),
                )
            await asyncio.sleep(_PAUSE_S)

    async def _lift(self, text: str) -> CutterStatus:
        """Lift the tool: that may be said twice."""
        while True:
            try:
                return await self._line.say(text, Lane.STOP)
            except CompaxError:
                if self._line.link.is_over or self._loop.time() >= self._give_up_at:
                    raise
            await asyncio.sleep(_PAUSE_S)

    async def _until_up(self, call: str) -> None:
        """Wait until the tool is up and where it was before: an empty buffer is no vector that has come to its end."""
        if "OA" not in self._line.profile.mnemonics:
            return
        before: Position | None = None
        while True:
            try:
                async with asyncio.timeout_at(self._give_up_at):
                    now = await self._line.read(f"{call}OA;", decode_position, Lane.STOP, repeats=False)
            except TimeoutError:
                raise self._not_up() from None
            except CompaxError:
                if self._line.link.is_over or self._loop.time() >= self._give_up_at:
                    raise
                now = None
            if now is not None and now == before and not now.tool_is_down:
                return
            if self._loop.time() >= self._give_up_at:
                raise self._not_up()
            before = now
            await asyncio.sleep(_PAUSE_S)

    def _not_up(self) -> MoveTimeoutError:
        return MoveTimeoutError(
            f"ESC.K was heard, but within {self._line.settings.stop_timeout_s:g} s the tool was not up and at rest",
            device=self._line.name,
            hint="the vector under way is cut to its end; is the machine paused? Look at it, then stop() again",
            exchanges=self._line.link.recent(),
        )

    def _not_heard(self) -> AnswerTimeoutError:
        return AnswerTimeoutError(
            f"ESC.K was not heard for {self._line.settings.stop_timeout_s:g} s",
            device=self._line.name,
            sent=self._line.abort_text,
            hint="is the line held (hardwire handshake with a paused machine)? Stop it at the machine",
            exchanges=self._line.link.recent(),
        )
