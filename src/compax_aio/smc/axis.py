"""One axis as callers hold it: moved, stopped, read, set, programmed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from ..errors import InvalidCommandError
from ..link.contract import Lane
from ..motion.events import DriveEvent
from ..motion.moves import OnCancel
from .axis_motion import AxisMotion
from .axis_settings import SettingsOfAxis
from .codecs import AxisStatus, LimitInputs, Port, decode_limits, decode_port
from .facts import ORIGIN, PROGRAM_ENTRY, Reply, command_of
from .line import SmcLine
from .moves import AxisMove
from .observer import Observer
from .own_copy import SettingsCopy
from .profile import Profile
from .program_memory import ProgramMemory
from .vocabulary import (
    check_raw,
    limits_query,
    plan_home,
    plan_move_by,
    plan_move_to,
    plan_run,
    port_query,
    set_outputs,
)

__all__ = ["SmcAxis"]


class SmcAxis:
    """
    One axis on a line; made by :meth:`PartyLine.axis`.

    Positions are in steps from the origin, which is where the axis stood when it was switched on, until
    :meth:`home` or :meth:`set_origin` puts it elsewhere. Every method that asks the axis raises AnswerTimeoutError,
    UnexpectedAnswerError or ConnectionLostError when no sound answer comes, CommandRejectedError when the axis does not
    understand.

    Attributes:
        name: Its one character; empty in single mode.
        settings: Speeds, ramps, currents and the like.
        program: The program in its memory.
    """

    def __init__(
        self,
        line: SmcLine,
        name: str,
        on_lost_reference: Callable[[str, str], None],
        publish: Callable[[DriveEvent], None],
    ) -> None:
        self.name = name
        self._line = line
        self._copy = SettingsCopy()
        self._observer = Observer(line, name, on_lost_reference)
        self._motion = AxisMotion(self._observer, publish)
        self.settings = SettingsOfAxis(self._observer, self._copy)
        self.program = ProgramMemory(self._observer, self._motion, self._copy)

    def __repr__(self) -> str:
        return f"<SmcAxis {self._line.called(self.name)}>"

    # Motion ---------------------------------------------------------------------------------------------------------

    def move_to(
        self, position_steps: float, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop"
    ) -> AxisMove:
        """
        Start a move to a position (``R``, AMS p. 25) as soon as the line is free.

        Status and position are read before: an axis that moves already would hold the line until it stands, and one
        that was reset counts from elsewhere.

        Args:
            position_steps: From the origin; rounded to the decimals of the profile, within ±8,388,607.99.
            timeout_s: A fixed budget for the whole move; None: it may take as long as the axis moves.
            on_cancel: ``"stop"`` stops the axis when the move is cancelled, ``"detach"`` lets it go on.

        Returns:
            An :class:`AxisMove`; awaiting it returns when the axis stands at its target.

        Raises:
            InvalidCommandError: The axis cannot be told this; nothing was sent.
            MoveActiveError: Another motion of this axis is running; nothing was sent.
            MoveInDoubtError: What became of the last one is unknown; see :meth:`reconcile`.
            MoveError: Nobody knows what positions are counted from, after a reset; see :attr:`lost_reference`.

        Awaiting the move raises MoveStoppedError, MoveTimeoutError or MoveInDoubtError for the motion,
        CommandRejectedError, AnswerTimeoutError, UnexpectedAnswerError or ConnectionLostError for the line.
        """
        return self._motion.start(plan_move_to(position_steps, self._profile), timeout_s, on_cancel)

    def move_by(
        self, distance_steps: float, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop"
    ) -> AxisMove:
        """Start a move by a distance from where the axis stands (``+`` and ``-``, DCB p. 26); see :meth:`move_to`."""
        return self._motion.start(plan_move_by(distance_steps, self._profile), timeout_s, on_cancel)

    def run(self, speed_steps_s: int, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop") -> AxisMove:
        """
        Run at constant speed until it is stopped (``M``, gem-controld).

        Awaiting the move raises MoveStoppedError when the axis was stopped, from here or by a limit;
        :meth:`AxisMove.change_speed` changes its speed.

        Args:
            speed_steps_s: Whole steps/s in the range of the profile; below zero toward minus.
            timeout_s: When it is stopped; None: never by itself.
            on_cancel: See :meth:`move_to`.
        """
        return self._motion.start(plan_run(speed_steps_s, self._profile), timeout_s, on_cancel)

    def home(
        self,
        speed_steps_s: int,
        *,
        toward_plus: bool | None = None,
        direction: int | None = None,
        sets_origin: bool = True,
        timeout_s: float | None = None,
        on_cancel: OnCancel = "stop",
    ) -> AxisMove:
        """
        Search for home (``F``, motorIms), and make it the origin.

        That it was found is known by standstill, and by the home input where the profile knows its bit.

        Args:
            speed_steps_s: Whole steps/s in the range of the profile.
            toward_plus: Where the search begins, if the profile knows which direction that is; else
            direction: 0 or 1, as it is sent.
            sets_origin: Count from there on from zero (``O``, DCB p. 24).
            timeout_s: See :meth:`move_to`.
            on_cancel: See :meth:`move_to`.
        """
        plan = plan_home(speed_steps_s, self._profile, toward_plus=toward_plus, direction=direction)
        return self._motion.start(plan, timeout_s, on_cancel, sets_origin=sets_origin)

    async def stop(self) -> None:
        """
        Stop softly, ahead of everything that is queued on the line (``@``), and return at standstill.

        It is repeated until the axis acknowledges it. A move that was running raises MoveStoppedError. Cancelling the
        caller does not take the stop back.

        Raises:
            AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError, ConnectionLostError: It was not
                acknowledged; the axis may move.
            MoveTimeoutError: It was, but the axis has not settled.
        """
        await self._motion.stop()

    async def set_origin(self) -> None:
        """
        Make where the axis stands position zero (``O``, DCB p. 24).

        Raises:
            MoveActiveError, MoveInDoubtError: The axis moves, or may; nothing was sent.
            UnexpectedAnswerError: It does not count from zero afterwards; nobody knows what it counts from.
        """
        await self._motion.refuse_if_moving("the new origin")
        await self._observer.make_origin()

    @property
    def lost_reference(self) -> str | None:
        """Why nobody knows what positions are counted from, as after a reset; None if nothing speaks for that."""
        return self._observer.lost_reference

    async def reconcile(self) -> AxisStatus:
        """Read the status after a move was in doubt, or the reference lost; the axis takes any motion again then."""
        return await self._motion.reconcile()

    # Reading --------------------------------------------------------------------------------------------------------

    async def position(self) -> float:
        """Read the position in steps (``Z``, DCB p. 26)."""
        return await self._observer.position(Lane.READ)

    async def status(self) -> AxisStatus:
        """Read the motion status (``^``, DCB p. 26)."""
        return await self._observer.status(Lane.READ)

    async def limits(self) -> LimitInputs:
        """Read the limit inputs (``]``: motorIms, panther), as the profile tells them apart."""
        profile = self._profile
        return await self._line.read(self.name, limits_query(profile), lambda body: decode_limits(body, profile))

    async def port(self) -> Port:
        """Read inputs and outputs (``A129``, gem-controld)."""
        profile = self._profile
        return await self._line.read(self.name, port_query(profile), lambda body: decode_port(body, profile))

    async def write_outputs(self, value: int) -> None:
        """Set all outputs at once (``A``, gem-controld): the weights of those that are on, added up."""
        await self._line.tell(self.name, set_outputs(value, self._profile))

    async def raw(self, text: str) -> str:
        """
        Send one command, without name and end, and return what the axis answers: nothing, for most.

        A motion that is started so is not watched; leaving the line's block stops the axis all the same. A command of
        which nothing is known counts as a motion, and what it may set is not known any more.

        Raises:
            InvalidCommandError: *text* is not 1 to 12 printable characters, or starts a stream; nothing was sent.
            MoveActiveError, MoveInDoubtError: It may start a motion, and one is running or in doubt; nothing was sent.
        """
        line = check_raw(text)
        command = command_of(line)
        if command.letter == PROGRAM_ENTRY:
            raise InvalidCommandError(
                f"{line!r} begins or ends program entry, in which a stop would be stored and not obeyed",
                hint="program.write() and program.edit() do so safely",
            )
        self._copy.note_raw(line)
        if command.letter == ORIGIN:
            self._observer.note_moving()  # where it stands has another number now
        if command.reply is not Reply.NOTHING:
            return await self._line.ask(self.name, line)
        if command.moves or command.is_action:
            return await self._motion.command(line)
        await self._line.tell(self.name, line)
        return ""

    # What the line does ---------------------------------------------------------------------------------------------

    async def meet(self) -> None:
        """Look at it on a line that was opened."""
        if not self._motion.may_be_in_entry:  # it would store the question
            await self._observer.look(Lane.GREETING)

    async def refuse_if_moving(self, what: str) -> None:
        """Raise MoveActiveError, or MoveInDoubtError, if it moves or may: *what* was not sent."""
        await self._motion.refuse_if_moving(what)

    def begin_stop(self, why: str | None) -> asyncio.Task[None]:
        """Queue a soft stop, which ends at standstill; *why* says what has stopped a move that runs, if not that."""
        return self._motion.begin_stop(None if why is None else self._motion.cut_off(why))

    def withdraw(self, why: str) -> None:
        """Let no motion that waits for its turn be sent; it raises *why*."""
        self._motion.withdraw(why)

    def note_damage(self, holds: tuple[str, ...]) -> None:
        """Take note that it may execute one of *holds*, which is left of a command that was damaged on the line."""
        if self._motion.is_storing:
            return
        for text in holds:
            self._copy.note_raw(text)
            if text.startswith(ORIGIN):
                self._observer.find_reference_lost("a command was damaged on the line and may have moved the origin")
        self._motion.note_damage(holds)

    def note_reset(self, why: str) -> None:
        """Take note that it was reset, or seems to have been."""
        self._observer.lose_reference(why)
        self._copy.note_reset()
        self._motion.note_reset()

    def note_aborted(self) -> None:
        """Take note that ESC or ^C was sent."""
        self._motion.note_aborted()

    def line_lost(self) -> None:
        """Let who watches a move find out."""
        self._motion.look_now()

    def line_restored(self) -> None:
        """Let a move that is under way find its fate."""
        self._motion.line_restored(())

    async def end(self) -> None:
        """Stop what was started here."""
        await self._motion.end()

    @property
    def _profile(self) -> Profile:
        return self._line.settings.profile
