"""One line with its axes, as the client uses it: a command in, a checked answer or an error with its story out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TypeVar, Unpack

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, UnexpectedAnswerError
from ..link.contract import Lane, TurnOver
from ..link.device_link import LineTells, device_link
from ..link.taps import plain
from .codecs import AxisStatus, decode_number, decode_status
from .facts import ESCAPE, Mode, Reply, command_of
from .protocol import SmcProtocol
from .protocol_events import Answered, CutShort, EntryFailed, Unreadable
from .settings import SmcSettings
from .vocabulary import position_query, status_query

__all__ = ["SmcLine"]

_Value = TypeVar("_Value")


class SmcLine:
    """
    A link that speaks to SMC axes, with answers turned into values and errors.

    Args:
        name: Of the line.
        mode: How the axes take their commands.
        settings: How long things take, and which member of the family this is.
        tells: See :class:`~compax_aio.link.device_link.LineTells`.
    """

    def __init__(self, name: str, mode: Mode, settings: SmcSettings, **tells: Unpack[LineTells]) -> None:
        self.name = name
        self.mode = mode
        self.settings = settings
        self.wrong_names = ""
        """Why nobody knows which controller of a chain has which name; empty: they have those that were dealt."""
        self.protocol = SmcProtocol(mode, settings)
        self.link = device_link(
            self.protocol,
            name,
            settings,
            tells,
            marker_timeout_s=settings.quiet_s + settings.echo_timeout_s,
            advice_on_silence=(
                "check power, cable, port and baud rate, the mode that the axes were switched to, and their names; "
                "a line with a slow echo (USB, a terminal server) wants more echo_timeout_s"
            ),
            about=lambda: {"device": "smc", "mode": mode.value, "settings": plain(settings)},
        )

    # Asking and telling ---------------------------------------------------------------------------------------------

    async def ask(self, axis: str, text: str, lane: Lane = Lane.READ) -> str:
        """
        Ask *axis*, and return what stood between the question and its end; asked once more if it was not heard whole.

        Raises:
            CommandRejectedError: The axis did not understand it.
            UnexpectedAnswerError: What came is no answer.
            AnswerTimeoutError, ConnectionLostError: No answer came.
        """
        if lane in {Lane.MOTION, Lane.READ}:
            self._refuse_wrong_names(axis, text)
        survives_loss = lane not in {Lane.MOTION, Lane.GREETING}
        outcome = await self.link.exchange(axis + text, lane, party=axis, survives_loss=survives_loss)
        if isinstance(outcome, EntryFailed):
            outcome = await self.link.exchange(axis + text, lane, party=axis, survives_loss=survives_loss)
        if lane in {Lane.MOTION, Lane.READ}:  # they may have been dealt anew while it waited, or was tried
            self._refuse_wrong_names(axis, text, "was answered by nobody knows whom")
        if isinstance(outcome, Answered) and outcome.text not in self.settings.profile.refusals:
            return outcome.text
        raise self.error_of(axis, text, outcome)

    async def tell(self, axis: str, text: str, lane: Lane = Lane.CONTROL) -> None:
        """
        Tell *axis* something that does no harm when it comes twice; told once more if it was not heard whole.

        A terminator that came back says that the command was taken, and no more: what an axis does not like it may
        ignore in silence.

        Raises:
            CommandRejectedError: The axis did not understand it.
            UnexpectedAnswerError: It answered something.
            AnswerTimeoutError, ConnectionLostError: Whether it was taken is unknown.
        """
        outcome = await self.start(axis, text, lane)
        if isinstance(outcome, EntryFailed):
            outcome = await self.start(axis, text, lane)
        if (error := self.refusal(axis, text, outcome)) is not None:
            raise error

    def start(
        self, axis: str, text: str, lane: Lane, on_sent: Callable[[], None] | None = None
    ) -> asyncio.Future[TurnOver]:
        """Queue *text* for *axis*, to be sent at most once; only a stop waits for a line that is lost."""
        if lane is not Lane.STOP:
            self._refuse_wrong_names(axis, text)
        return self.link.exchange(
            axis + text,
            lane,
            party=axis,
            settles_late=True,
            survives_loss=lane is Lane.STOP,
            on_sent=on_sent,
        )

    def _refuse_wrong_names(self, axis: str, text: str, what: str = "was not sent") -> None:
        """Raise UnexpectedAnswerError if another controller may feel addressed."""
        if self.wrong_names:
            raise UnexpectedAnswerError(
                f"{axis + text!r} {what}, for the names of the chain are not those they should be: {self.wrong_names}",
                device=self.called(axis),
                hint="reset() deals them anew; positions are lost by it",
                exchanges=self.link.recent(),
            )

    async def position(self, axis: str, lane: Lane = Lane.READ) -> float:
        """Read the position in steps from the origin (``Z``, DCB p. 26)."""
        return await self.read(axis, position_query(self.settings.profile), decode_number, lane)

    async def status(self, axis: str, lane: Lane = Lane.READ) -> AxisStatus:
        """Read the motion status (``^``, DCB p. 26)."""
        return await self.read(axis, status_query(self.settings.profile), decode_status, lane)

    async def read(self, axis: str, text: str, decode: Callable[[str], _Value], lane: Lane = Lane.READ) -> _Value:
        """Ask, and decode the answer; one that cannot be decoded is told with the axis and its exchanges."""
        answer = await self.ask(axis, text, lane)
        try:
            value = decode(answer)
        except UnexpectedAnswerError as error:
            error.device, error.sent, error.exchanges = self.called(axis), axis + text, self.link.recent()
            raise
        if axis and axis not in self.protocol.names:
            self.protocol.names.append(axis)  # it is there, and can be asked when the line gets in step
        return value

    # Errors ---------------------------------------------------------------------------------------------------------

    def called(self, axis: str) -> str:
        """Name an axis for people."""
        return f"{self.name} axis {axis}" if axis else self.name

    def refusal(self, axis: str, text: str, outcome: TurnOver) -> CompaxError | None:
        """Return the error that *outcome* is for a command that has no answer; None if it was taken."""
        if isinstance(outcome, Answered) and not outcome.text:
            return None
        return self.error_of(axis, text, outcome)

    def error_of(self, axis: str, text: str, outcome: TurnOver) -> CompaxError:
        """Turn what is no success into the error that says so."""
        error = self._plain_error(text, outcome)
        error.device, error.sent, error.exchanges = self.called(axis), axis + text, self.link.recent()
        return error

    def _plain_error(self, text: str, outcome: TurnOver) -> CompaxError:
        if isinstance(outcome, EntryFailed):
            return self._entry_error(outcome)
        if isinstance(outcome, CutShort):
            key = "ESC" if outcome.by == chr(ESCAPE) else "^C"
            return UnexpectedAnswerError(
                f"{key} was sent while it was under way, which every axis obeys",
                hint="send it again, if it is still wanted",
            )
        received = ""
        if isinstance(outcome, Answered | Unreadable):
            received = outcome.text
        if received in self.settings.profile.refusals:
            return CommandRejectedError(
                "the axis did not understand it",
                received=received,
                hint="does this member of the family have the command, and is its value in range?",
            )
        wants_answer = command_of(text).reply is not Reply.NOTHING
        return UnexpectedAnswerError(
            "that is no answer to what was sent" if wants_answer or received else "nothing was answered",
            received=received,
            hint="look at the last exchanges of this error; is it one of these controllers, in this mode?",
        )

    def _entry_error(self, failed: EntryFailed) -> CompaxError:
        where = f"character {failed.echoed + 1} of {failed.sent!r}, {failed.expected!r}"
        hint = "the line was cleared, and the command not sent again"
        if not failed.was_begun and not failed.received:
            hint = "is there an axis of that name, and is it switched on? Upper and lower case are different names"
        if not failed.received:
            return AnswerTimeoutError(f"no echo of {where}, within {self.settings.echo_timeout_s:g} s", hint=hint)
        return UnexpectedAnswerError(f"a wrong echo of {where}", received=failed.received, hint=hint)
