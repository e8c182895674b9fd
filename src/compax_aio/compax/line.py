"""One drive's line as the client uses it: a text in, a checked answer or an error that tells the story out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from math import inf
from typing import Any, Final, TypeVar, Unpack

from ..errors import AnswerTimeoutError, CommandRejectedError, ConnectionLostError, UnexpectedAnswerError
from ..link.contract import Lane, TurnOver
from ..link.device_link import LineTells, device_link
from ..link.taps import plain
from .codecs import DriveStatus, decode_number, shows_active
from .facts.device_errors import device_error
from .protocol import Acknowledged, Answered, CompaxProtocol, Rejected, UnexpectedAnswer
from .settings import DriveSettings
from .transfer import Transfer

__all__ = ["DriveLine"]

_MOTION: Final = Lane.MOTION
"""What each question is compared with; to find a member in its enum costs CPython 3.11 as much as some twenty steps."""

_Value = TypeVar("_Value")


class DriveLine:
    """
    A link that speaks COMPAX, with answers turned into values and errors.

    Args:
        name: Of the drive.
        settings: Time-outs and what is known of the drive's ways.
        tells: See :class:`~compax_aio.link.device_link.LineTells`.
    """

    __slots__ = ("active_seen_at", "last_position", "link", "name", "protocol", "settings", "transfer")

    def __init__(self, name: str, settings: DriveSettings, **tells: Unpack[LineTells]) -> None:
        self.name = name
        self.settings = settings
        self.protocol = CompaxProtocol(settings.message_form, error_pattern=settings.error_pattern)
        self.link = device_link(
            self.protocol,
            name,
            settings,
            tells,
            advice_on_silence=(
                "check power, cable (crossed, not straight), port and baud rate, and the handshake lines; a device "
                "that takes longer to answer wants more answer_timeout_s"
            ),
            about=lambda: {"device": "compax", "settings": plain(settings)},
        )
        self.last_position: float | None = None
        self.active_seen_at = -inf
        """Loop time at which the drive last said that a positioning runs."""
        self.transfer = Transfer(self)

    async def query(self, text: str, lane: Lane = Lane.READ) -> str:
        """
        Ask, and return the answer as it came.

        Raises:
            CommandRejectedError: The drive answered with an error.
            UnexpectedAnswerError: It acknowledged a question instead of answering it.
            AnswerTimeoutError, ConnectionLostError: No answer came.
        """
        return self._answer(text, await self._ask(text, lane))

    def _ask(self, text: str, lane: Lane) -> asyncio.Future[TurnOver]:
        # What is asked in order to move does not wait for a line: a person who plugs in a cable expects no motion.
        return self.link.exchange(text, lane, survives_loss=lane is not _MOTION)

    def _answer(self, text: str, outcome: TurnOver) -> str:
        if isinstance(outcome, Answered):
            return outcome.text
        raise self.error_of(text, outcome)

    async def ask_freely(self, text: str) -> str:
        """Ask something whose answer has no known beginning; whatever text comes is the answer."""
        outcome = await self.link.exchange(text, Lane.CONTROL)
        if isinstance(outcome, Answered | UnexpectedAnswer):
            return outcome.text
        raise self.error_of(text, outcome)

    async def command(self, text: str, lane: Lane = Lane.CONTROL, on_sent: Callable[[], None] | None = None) -> None:
        """
        Tell, and return when the drive has acknowledged it; *on_sent* is called when it is written.

        After a time-out the line is brought back in step first, for the acknowledgement may come late.

        Raises:
            CommandRejectedError: The drive answered with an error.
            UnexpectedAnswerError: It answered something else; whether it was accepted is unknown.
            AnswerTimeoutError, ConnectionLostError: Whether it was accepted is unknown.
        """
        wire = self.protocol.encode(text)
        is_written = False

        def written() -> None:
            nonlocal is_written
            is_written = True
            self.transfer.note_sent(text)
            if on_sent is not None:
                on_sent()

        try:
            outcome = await self.exchange(text, lane, written)
        except (AnswerTimeoutError, ConnectionLostError):
            if is_written:
                self.transfer.note_lost(text, wire)
            raise
        if not isinstance(outcome, Acknowledged):
            raise self.error_of(text, outcome)
        self.transfer.note_taken(text)
        if text == self.settings.dialect.make_valid and self.transfer.interface is None:
            await self.transfer.read_interface(Lane.CONTROL)

    async def read(self, text: str, decode: Callable[[str], _Value], lane: Lane = Lane.READ) -> _Value:
        """Ask, and decode the answer; an answer that cannot be decoded is told with the drive and its exchanges."""
        return self._decoded(decode, self._answer(text, await self._ask(text, lane)))

    def number(self, number: int, lane: Lane = Lane.READ) -> Coroutine[Any, Any, float]:
        """Read the status value ``S<number>``; see :meth:`query` for errors."""
        return self.read(f"S{number}", decode_number, lane)

    async def position(self, lane: Lane = Lane.READ) -> float:
        """Read S1, the actual position (UG p. 104), and remember it."""
        # Not through :meth:`read`: of all that is asked, this is asked most, and each coroutine costs.
        self.last_position = self._decoded(decode_number, self._answer("S1", await self._ask("S1", lane)))
        return self.last_position

    async def status(self, lane: Lane = Lane.READ) -> DriveStatus:
        """Read S17, then S16: a move that ends in between shows as ended."""
        s17 = await self.query("S17", lane)
        if shows_active(s17):  # to be remembered also if no answer to S16 comes
            self.active_seen_at = asyncio.get_running_loop().time()
        s16 = await self.query("S16", lane)
        return self._decoded(lambda answer: DriveStatus.decode(answer, s17), s16)

    def exchange(self, text: str, lane: Lane, on_sent: Callable[[], None] | None = None) -> asyncio.Future[TurnOver]:
        """Queue *text*, written at once if the line is free; only a stop waits for one that is lost."""
        return self.link.exchange(text, lane, settles_late=True, survives_loss=lane is Lane.STOP, on_sent=on_sent)

    def error_of(self, text: str, outcome: TurnOver) -> CommandRejectedError | UnexpectedAnswerError:
        """Turn an answer that is no success into the error that says so."""
        if isinstance(outcome, Rejected):
            error = device_error(outcome.code)
            return CommandRejectedError(
                f"the drive rejected it with E{error.code}, {error.meaning}",
                device=self.name,
                sent=text,
                received=outcome.text,
                hint=error.remedy,
                code=error.code,
                exchanges=self.link.recent(),
            )
        received = outcome.text if isinstance(outcome, Answered | UnexpectedAnswer) else "a bare prompt"
        return UnexpectedAnswerError(
            "that is no answer to what was sent",
            device=self.name,
            sent=text,
            received=received,
            hint="look at the last exchanges of this error; is it a COMPAX, and does nobody else use the line?",
            exchanges=self.link.recent(),
        )

    def _decoded(self, decode: Callable[[str], _Value], answer: str) -> _Value:
        try:
            return decode(answer)
        except UnexpectedAnswerError as error:
            error.device = self.name
            error.exchanges = self.link.recent()
            raise
