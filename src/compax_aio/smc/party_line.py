"""One line with its axes as callers hold it: connect, find axes, stop all of them, close."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

from ..errors import CompaxError, ConnectionLostError, InvalidCommandError, UnexpectedAnswerError
from ..link.cancellation import despite_cancellation
from ..link.contract import Event, Lane
from ..link.reconnecting import Restored
from ..motion.events import EventHub, EventStream, UnexpectedText
from ..motion.open_device import OpenDevice
from .axis import SmcAxis
from .events import AxesReset, CommandDamaged
from .facts import ESCAPE, MAX_AXES, NO_NAME, POSSIBLE_NAMES, RESET, Mode
from .line import SmcLine
from .naming import name_single_axis, names_between, names_of_chain
from .protocol_events import Damaged, NamesDealt, Stray
from .settings import SmcSettings
from .vocabulary import check_name

__all__ = ["PartyLine"]

_log = logging.getLogger("compax_aio.smc")


class PartyLine(OpenDevice[SmcLine]):
    """
    One line with one or more axes, open; made by :func:`compax_aio.smc.connect`.

    The axes share it: one command is on its way at a time, character by character. Those of different axes take turns;
    a stop goes before everything.
    """

    def __init__(self, name: str, mode: Mode, axes: str, settings: SmcSettings) -> None:
        self.name = name
        self._events = EventHub()
        self._loop = asyncio.get_running_loop()
        self._line = SmcLine(name, mode, settings, **self._tells)
        self._axes: dict[str, SmcAxis] = {}
        self._was_open = False
        self._own_resets = 0
        self._returned: str | None = None
        """The name that a daisy chain gave back when its controllers took theirs just now."""
        self._knows_chain = bool(axes)
        if mode is Mode.DAISY and not axes:
            axes = POSSIBLE_NAMES[0]
        self._line.protocol.names.extend(axes)
        for axis in axes:
            self.axis(axis)
        if not mode.has_names:
            self.axis()

    def __repr__(self) -> str:
        return f"<PartyLine {self.name} {''.join(self._axes)!r} {'open' if self.is_open else 'closed'}>"

    # Axes -----------------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> Mapping[str, SmcAxis]:
        """The axes that were named here or found, by name."""
        return MappingProxyType(self._axes)

    def axis(self, name: str = NO_NAME) -> SmcAxis:
        """
        Return the axis of that name, always the same object; whether it is there shows when it is first told something.

        Args:
            name: One character, A to Z or a to z; nothing in single mode, where there is one axis.

        Raises:
            InvalidCommandError: It can be no name (DCB p. 23).
        """
        name = check_name(name, self._line.mode)
        if name not in self._axes:
            if len(self._axes) >= MAX_AXES:
                raise InvalidCommandError(f"a line has at most {MAX_AXES} axes (DCB p. 17)", device=self.name)
            self._axes[name] = SmcAxis(self._line, name, self._on_lost_reference, self._events.publish)
        return self._axes[name]

    async def scan(
        self, names: Iterable[str] = POSSIBLE_NAMES, *, on_each: Callable[[str, bool], None] | None = None
    ) -> tuple[str, ...]:
        """
        Ask one name after the other who is there (DCB p. 26), all of them, for a gap in the letters hides nobody.

        Args:
            names: A to Z and then a to z, if nothing else is given. Each is asked twice if need be; one that nobody
                has takes about 0.6 s.
            on_each: Called with each name, and whether an axis answered to it.

        Returns:
            The names of the axes that are there; :attr:`axes` has them from now on.

        Raises:
            InvalidCommandError: One can be no name, or there are no names in single mode; nothing was sent.
            ConnectionLostError: The line went away.
        """
        asked = [check_name(name, self._line.mode) for name in names]
        if not self._line.mode.has_names:
            raise InvalidCommandError("in single mode there is one axis, and it has no name", device=self.name)
        found = []
        for name in asked:
            is_there = await self._is_there(name)
            if is_there:
                self.axis(name)
                found.append(name)
            if on_each is not None:
                on_each(name, is_there)
        return tuple(found)

    async def _is_there(self, name: str, lane: Lane = Lane.READ) -> bool:
        try:
            await self._line.status(name, lane)
        except ConnectionLostError:
            raise
        except CompaxError:
            return False  # in a daisy chain everything comes back, but nobody answers
        return True

    async def name_axis(self, name: str) -> None:
        """
        Give the axis in single mode a name, by which it is known on a party line, and store it (DCB p. 23).

        It is reset twice, so its position counts from elsewhere afterwards. Nothing is stored unless it shows the name.

        Raises:
            InvalidCommandError: It can be no name, or this is no single mode; nothing was sent.
            MoveActiveError: The axis moves; nothing was sent.
            UnexpectedAnswerError: It shows another name; nothing was stored, and it was reset.
        """
        if self._line.mode is not Mode.SINGLE:
            raise InvalidCommandError(
                f"an axis is named in single mode, not in {self._line.mode.value} mode",
                device=self.name,
                hint="connect it alone, with its party line input off (DCB p. 20, 23)",
            )
        check_name(name, Mode.PARTY)
        axis = self.axis()
        await axis.refuse_if_moving(f"the name {name!r}")
        axis.note_reset("it was reset to be named (^C)")
        with self._own_reset("it was reset to be named"):
            await despite_cancellation(name_single_axis(self._line, name))

    # Stopping -------------------------------------------------------------------------------------------------------

    async def stop(self) -> None:
        """
        Stop all known axes softly, each as soon as the line is free, and return when all of them stand.

        Raises:
            CompaxError: Of the first axis that may not have stopped; the others were stopped all the same.
        """
        await self._until_standing(None)

    async def abort_all(self) -> None:
        """
        Stop every axis of the line at once and without a ramp (ESC, AMS p. 25), also those that nobody here knows.

        It is sent at once, even in the middle of a command; then each known axis is stopped softly as well, and looked
        at until it stands. A motor that was fast may have lost steps: its position may be wrong, and nothing shows it.

        Raises:
            CompaxError: ESC could not be sent, or an axis may not have stopped.
        """
        await self._preempt(ESCAPE, "every axis was stopped without a ramp (ESC)", SmcAxis.note_aborted)

    async def reset(self) -> None:
        """
        Reset every axis of the line (^C, AMS p. 25), as if it was switched off and on, also those nobody here knows.

        Motions end without a ramp; positions count from where the axes stand (gem-controld); settings are those that
        were stored. Moves to a position are refused until :meth:`SmcAxis.home`, :meth:`SmcAxis.set_origin` or
        :meth:`SmcAxis.reconcile` was called. In a daisy chain names are dealt anew.

        Raises:
            CompaxError: ^C could not be sent, or an axis does not answer afterwards.
        """

        def take_note(axis: SmcAxis) -> None:
            axis.note_reset("the axes were reset (^C)")
            axis.note_aborted()

        with self._own_reset("^C was sent"):
            await self._preempt(RESET, "every axis was reset (^C)", take_note)

    async def _preempt(self, key: int, what: str, take_note: Callable[[SmcAxis], None]) -> None:
        try:
            in_step = self._line.link.preempt(chr(key))
        except ConnectionLostError:
            await self._until_standing(None)  # what moves is stopped when the line is back, if it is soon enough
            raise
        for axis in self._axes.values():
            take_note(axis)
        await self._until_standing(what)
        if not self._axes:
            await asyncio.shield(in_step)  # nobody else shows that it has gone out

    async def _until_standing(self, why: str | None) -> None:
        stops = [axis.begin_stop(why) for axis in self._axes.values()]
        outcomes = await asyncio.gather(*map(asyncio.shield, stops), return_exceptions=True)
        for outcome in outcomes:
            if isinstance(outcome, BaseException):
                raise outcome

    # Events and life ------------------------------------------------------------------------------------------------

    def events(self) -> EventStream:
        """Follow what happens from now on: lost lines, resets, unexpected text; an asynchronous iterator."""
        return self._events.stream()

    @property
    def settings(self) -> SmcSettings:
        """What is known of the axes and of this line."""
        return self._line.settings

    @property
    def mode(self) -> Mode:
        """How the axes take their commands."""
        return self._line.mode

    async def close(self) -> None:
        """
        Stop what was started here, and close the line; harmless when repeated.

        It is carried through even if the caller is cancelled meanwhile.

        Raises:
            CompaxError: An axis may not have stopped.
        """
        await super().close()

    async def _end(self) -> None:
        if not self._line.link.is_over:
            outcomes = await asyncio.gather(*(axis.end() for axis in self._axes.values()), return_exceptions=True)
            self._raise_unless_lost(outcomes)

    def _raise_unless_lost(self, outcomes: Iterable[object]) -> None:
        """Raise the first error; that the line was lost for good, whoever awaited a move has been told."""
        for outcome in outcomes:
            is_told = isinstance(outcome, ConnectionLostError) and self._line.link.is_over
            if isinstance(outcome, BaseException) and not is_told:
                raise outcome

    async def _open(self, url: str) -> None:
        await self._line.link.open(url)

    # What the line tells --------------------------------------------------------------------------------------------

    async def _greet(self) -> None:
        """Look at every axis on a line that was opened: the first time all must be there."""
        if self._line.mode is Mode.DAISY:
            await self._meet_chain()
        for axis in tuple(self._axes.values()):
            try:
                await axis.meet()
            except ConnectionLostError:
                raise
            except CompaxError as error:
                if not self._was_open:
                    raise
                _log.warning("%s does not answer on the line that came back: %s", self._line.called(axis.name), error)
        self._was_open = True

    async def _meet_chain(self) -> None:
        """Find out how many controllers there are: names were dealt just now, or are asked one after the other."""
        returned, self._returned = self._returned, None
        expected = "".join(self._axes)
        if returned is not None:
            names = names_between(expected[0], returned)
        elif self._knows_chain:
            return
        else:
            names = ""
            for name in names_of_chain(expected[0], MAX_AXES):
                if not await self._is_there(name, Lane.GREETING):
                    break
                names += name
        if self._knows_chain and names != expected:
            raise UnexpectedAnswerError(
                f"the chain has taken the names {names!r}, not {expected!r}",
                device=self.name,
                hint="one controller may have been reset alone, or be missing; reset() deals the names anew",
                exchanges=self._line.link.recent(),
            )
        for name in names:
            self.axis(name)
        self._knows_chain = True

    def _on_event(self, event: Event) -> None:
        if isinstance(event, NamesDealt):
            self._note_names_dealt(event)
        elif isinstance(event, Damaged):
            self._events.publish(CommandDamaged(self.name, self._loop.time(), event.axis, event.holds))
            self.axis(event.axis).note_damage(event.holds)
        elif isinstance(event, Stray):
            self.stats.strays += 1
            self._events.publish(UnexpectedText(self.name, self._loop.time(), event.text))
            if any(mark in event.text for mark in self.settings.profile.sign_on_marks):
                self._lose_references(f"{event.text!r} came, as after a reset")

    def _note_names_dealt(self, event: NamesDealt) -> None:
        self._returned = event.returned
        if not self._was_open:
            return
        names, expected = names_between(event.offered, event.returned), "".join(self._axes)
        self._line.wrong_names = "" if names == expected else f"the chain has taken {names!r}, not {expected!r}"
        why = "the names of the chain were dealt anew, as after a reset"
        self._lose_references(why)
        if not self._own_resets:
            for axis in self._axes.values():
                axis.withdraw(why)  # what waits to be sent was meant for another place, or another controller

    def _on_lost_reference(self, axis: str, why: str) -> None:
        self._events.publish(AxesReset(self.name, self._loop.time(), axis, why))

    def _lose_references(self, why: str) -> None:
        """Take note of a reset that shows; not of switching on before the line was opened, nor of our own."""
        if self._was_open and not self._own_resets:
            for axis in self._axes.values():
                axis.note_reset(why)
            self._publish_reset(why)

    @contextmanager
    def _own_reset(self, why: str) -> Iterator[None]:
        self._own_resets += 1
        try:
            yield
            self._publish_reset(why)
        finally:
            self._own_resets -= 1

    def _publish_reset(self, why: str) -> None:
        self._events.publish(AxesReset(self.name, self._loop.time(), "".join(self._axes), why))

    def _on_down(self, error: ConnectionLostError) -> None:
        super()._on_down(error)
        for axis in self._axes.values():
            axis.line_lost()

    def _on_restored(self, restored: Restored) -> None:
        signs = tuple(f"{axis.name}: {axis.lost_reference}" for axis in self._axes.values() if axis.lost_reference)
        self._tell_restored(restored, signs)
        for axis in self._axes.values():
            axis.line_restored()
