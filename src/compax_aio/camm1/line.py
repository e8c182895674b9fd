"""A cutter's line as the client uses it: a question in, a checked answer or an error with its story out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar, Unpack

from ..errors import CommandRejectedError, CompaxError, TransportError, UnexpectedAnswerError
from ..link.contract import Event, Lane, TurnOver
from ..link.device_link import LineTells, device_link
from ..link.level import LineLevel
from ..link.taps import plain
from ..transports.line_settings import LineSettings
from ..transports.url import TransportURL
from .bursting import Burst
from .facts.line import BITS_PER_CHARACTER_8N1, bits_per_character
from .facts.reports import IO_ERRORS, NO_ERROR
from .instructions import AbortCutting, AskError, AskFreeSpace, AskModel, AskStatus, encode
from .profiles import Profile
from .protocol import CutterProtocol
from .protocol_events import Answered, BurstOver, CutShort, SettingsLost, StatusSeen, Unreadable
from .replies import CutterStatus, decode_bytes, decode_error, decode_status
from .room import Room
from .settings import CutterSettings

__all__ = ["CutterLine", "meaning_of"]

_Value = TypeVar("_Value")

_LEAST_WINDOW_BYTES: Final = 48
_MOST_WINDOW_BYTES: Final = 256
_MOST_ERRORS: Final = 3
"""So often the line's error is read until there is none: of several one is kept (which, is not known)."""


class CutterLine:
    """
    A link that speaks to a cutter, with answers turned into values and errors.

    Args:
        name: Of the cutter.
        profile: Which machine it is.
        settings: How long things take.
        tells: See :class:`~compax_aio.link.device_link.LineTells`.
    """

    def __init__(self, name: str, profile: Profile, settings: CutterSettings, **tells: Unpack[LineTells]) -> None:
        self.name = name
        self.profile = profile
        self.settings = settings
        self.unread_errors = 0
        """How often an answer to ``.E`` did not come whole: reading clears, so an error may have gone with it."""
        self.resets_seen = 0
        """How often the cutter was found to have forgotten its settings."""
        self.on_status: Callable[[CutterStatus], None] = lambda _: None
        """Called with the status that was told when the line got in step."""
        self._status_text = encode(AskStatus(), profile).decode()
        self._free_text = encode(AskFreeSpace(), profile).decode()
        self._error_text = encode(AskError(), profile).decode()
        self.abort_text = encode(AbortCutting(), profile).decode()
        self.protocol = CutterProtocol(settings, status_query=self._status_text, free_space_query=self._free_text)
        self._on_event = tells["on_event"]
        self.link = device_link(
            self.protocol,
            name,
            settings,
            {**tells, "on_event": self._take_event},
            answer_timeout_s=settings.answered_after_s,
            advice_on_silence=(
                "check power, cable (a PC needs a crossed one), port, baud rate and frame of the cutter; one that "
                "holds its replies back wants RTS and DTR of the host at its CTS and DSR"
            ),
            about=lambda: {"device": "camm1", "profile": profile.name, "settings": plain(settings)},
        )

    async def open(self, url: str) -> None:
        """Open the line; how fast it is, the settings say, or the URL."""
        self.link.bytes_per_s = rate = self._bytes_per_s(url)
        self.protocol.level = LineLevel(rate, lambda: self.link.unsent_bytes)
        await self.link.open(url)

    def _bytes_per_s(self, url: str) -> float | None:
        if self.settings.baud_rate is not None:
            return self.settings.baud_rate / BITS_PER_CHARACTER_8N1
        parsed = TransportURL.parse(url)
        if parsed.scheme != "serial" and "baudrate" not in parsed.query:
            return None
        try:
            line = LineSettings.of(parsed)
        except TransportError:
            return None  # whoever opens it says what is wrong
        bits = bits_per_character(line.bytesize, line.parity != "N", line.stopbits)
        return line.baudrate / bits

    @property
    def free_space_query(self) -> bytes:
        """What asks for free space, as this machine has it."""
        return self._free_text.encode()

    def room_of(self, capacity_bytes: int) -> Room:
        """Say what a job has to get through, with a buffer of that size."""
        rate = self.link.bytes_per_s
        window = _MOST_WINDOW_BYTES if rate is None else int(rate * self.settings.window_s)
        window = max(_LEAST_WINDOW_BYTES, min(window, _MOST_WINDOW_BYTES))
        return Room.of(capacity_bytes, self.settings.reserve_bytes, window)

    # Asking ---------------------------------------------------------------------------------------------------------

    async def ask(self, text: str, lane: Lane = Lane.READ, *, repeats: bool = True) -> str:
        """
        Send *text*, of which the last instruction answers; asked once more if the answer did not come whole.

        Raises:
            UnexpectedAnswerError: What came is no answer.
            AnswerTimeoutError, ConnectionLostError: No answer came.
        """
        survives_loss = lane in {Lane.READ, Lane.STOP}
        outcome = await self.link.exchange(text, lane, survives_loss=survives_loss)
        if repeats and not isinstance(outcome, Answered):
            outcome = await self.link.exchange(text, lane, survives_loss=survives_loss)
        if isinstance(outcome, Answered):
            return outcome.text
        raise self._error_of(text, outcome)

    async def free_space(self, lane: Lane = Lane.READ) -> int:
        """Read how many bytes of the buffer are free (``.B``, PNC-1610 p. 28)."""
        return await self.read(self._free_text, decode_bytes, lane)

    async def status(self, lane: Lane = Lane.READ) -> CutterStatus:
        """Read the status (``.O``, PNC-1610 p. 29)."""
        return await self.read(self._status_text, self._decode_status, lane)

    def _decode_status(self, text: str) -> CutterStatus:
        return decode_status(text, self.profile.status_style)

    async def error(self, lane: Lane = Lane.READ) -> int:
        """Read the error of the line, which clears it (``.E``, PNC-900 p. 21); never asked twice for one answer."""
        return await self._told_error(self._error_text, lane)

    async def errors(self, lane: Lane = Lane.READ) -> tuple[int, ...]:
        """Read errors until there is none, three at most; the first one first."""
        found: list[int] = []
        while len(found) < _MOST_ERRORS and (code := await self.error(lane)) != NO_ERROR:
            found.append(code)
        return tuple(found)

    async def tell(self, text: str, lane: Lane = Lane.CONTROL, *, what: str = "") -> None:
        """
        Send device control, which answers nothing, and read the error that comes of it.

        Raises:
            CommandRejectedError: The cutter does not take it.
        """
        code = await self._told_error(text + self._error_text, lane)
        error = IO_ERRORS.get(code)
        if error is None:  # a digit of it is damaged, perhaps
            self.unread_errors += 1
            raise UnexpectedAnswerError(
                f"the cutter has told {meaning_of(code)}",
                device=self.name,
                sent=text,
                received=str(code),
                exchanges=self.link.recent(),
            )
        if error.refuses_control:
            raise CommandRejectedError(
                f"the cutter has not taken {what or 'it'}: {meaning_of(code)}",
                device=self.name,
                sent=text,
                code=code,
                hint=f"is it a {self.profile.name}? Its profile says which device control it has",
                exchanges=self.link.recent(),
            )

    async def model(self, lane: Lane = Lane.READ) -> str:
        """Read the model (``.A``, PNC-1610 p. 29)."""
        return await self.ask(encode(AskModel(), self.profile).decode(), lane)

    async def _told_error(self, text: str, lane: Lane) -> int:
        try:
            return await self.read(text, decode_error, lane, repeats=False)
        except CompaxError:
            self.unread_errors += 1
            raise

    async def read(
        self, text: str, decode: Callable[[str], _Value], lane: Lane = Lane.READ, *, repeats: bool = True
    ) -> _Value:
        """Ask, and decode the answer; one that cannot be decoded is told with the cutter and its exchanges."""
        answer = await self.ask(text, lane, repeats=repeats)
        try:
            return decode(answer)
        except UnexpectedAnswerError as error:
            error.device, error.sent, error.exchanges = self.name, text, self.link.recent()
            raise

    # Bursts and stops -----------------------------------------------------------------------------------------------

    async def send_burst(self, burst: Burst) -> TurnOver:
        """
        Write a burst of a job; how much of it was written, the burst says, whatever comes of it.

        Returns:
            :class:`BurstOver`, or what came in between: :class:`CutShort`, :class:`Unreadable`.

        Raises:
            AnswerTimeoutError, ConnectionLostError: What became of it is unknown.
        """
        self.protocol.load(burst)
        outcome = await self.link.exchange(burst.label, Lane.MOTION, party="job")
        assert isinstance(outcome, BurstOver | CutShort | Unreadable)
        return outcome

    def abort(self) -> asyncio.Future[None]:
        """Send ``.K`` at once; done when the line is in step again. Raises ConnectionLostError if there is no line."""
        return self.link.preempt(self.abort_text)

    async def abort_in_turn(self) -> None:
        """Send ``.K`` as soon as there is a line that is in step, and see that it answers."""
        await self.ask(self.abort_text + self._status_text, Lane.STOP)

    async def say(self, data: str, lane: Lane = Lane.CONTROL) -> CutterStatus:
        """Send a few cutting instructions, for which there must be room, and read the status."""
        return await self.read(data + self._status_text, self._decode_status, lane, repeats=False)

    # What comes unasked ---------------------------------------------------------------------------------------------

    def _take_event(self, event: Event) -> None:
        if isinstance(event, StatusSeen):
            with suppress(UnexpectedAnswerError):
                self.on_status(self._decode_status(event.text))
            return
        if isinstance(event, SettingsLost):
            self.resets_seen += 1
        self._on_event(event)

    def _error_of(self, text: str, outcome: TurnOver) -> CompaxError:
        if isinstance(outcome, CutShort):
            what, received, hint = "the job was aborted (ESC.K) while it was under way", None, "ask again"
        else:
            assert isinstance(outcome, Unreadable)
            what, received = "that is no answer to what was sent", outcome.text
            hint = (
                "is the line disturbed, or are its baud rate and frame wrong? Look at the last exchanges of this error"
            )
        return UnexpectedAnswerError(
            what, device=self.name, sent=text, received=received, hint=hint, exchanges=self.link.recent()
        )


def meaning_of(code: int) -> str:
    """Say what an answer to ``.E`` means."""
    error = IO_ERRORS.get(code)
    return f"error {code}, {error.meaning}" if error is not None else f"error {code}, which no manual at hand has"
