"""A control's line as the client uses it: a transfer or a question in, what became of it out; damage is counted."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Final, Unpack

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, UnexpectedAnswerError
from ..link.contract import Lane
from ..link.device_link import LineTells, device_link
from ..link.level import LineLevel
from ..link.taps import plain
from ..transports.line_errors import LineErrors, line_errors_of
from .line_url import bytes_per_s, completed
from .profiles import Profile
from .protocol import HaasProtocol
from .protocol_events import Answered, HeldBack, NobodyAnswers, TransferOver, Unreadable
from .settings import ControlSettings
from .transfer import Kind
from .transfers.account import Ending, LineAccount
from .transfers.choosing import drip_feed, receive_file, send_file
from .transfers.strategy import Patience, Strategy

__all__ = ["NO_ANSWER", "ControlLine"]

_ADVICE: Final = (
    "check power, cable (a PC needs one with 2 and 3 crossed, and 4 and 5), port, and whether Settings 11 to 14 and 37 "
    "of the control are those of the profile"
)


NO_ANSWER: Final = (
    "is Setting 143 (machine data collection) ON at the control? If it has frozen, RESET brings it back; ask less often"
)


class ControlLine:
    """
    A link that speaks to a control.

    Args:
        name: Of the control.
        profile: How it is set up.
        settings: How long things take.
        tells: See :class:`~compax_aio.link.device_link.LineTells`.

    Attributes:
        counted: What the port has counted during the last transfer; None: it does not count.
        may_wait_for_rest: Whether a file was not sent to its end, so that the control takes what comes next for the
            rest of it, unless RESET was pressed there. With XMODEM it is told.
    """

    def __init__(self, name: str, profile: Profile, settings: ControlSettings, **tells: Unpack[LineTells]) -> None:
        self.name = name
        self.profile = profile
        self.settings = settings
        self.counted: LineErrors | None = None
        self.may_wait_for_rest = False
        self._turn: Strategy | None = None
        """The transfer that is the turn of the line."""
        self.protocol = HaasProtocol(profile, settings)
        self.link = device_link(
            self.protocol,
            name,
            settings,
            tells,
            advice_on_silence=_ADVICE,
            about=lambda: {"device": "haas", "profile": plain(profile), "settings": plain(settings)},
        )

    async def open(self, url: str) -> None:
        """Open the line as the profile has it; how fast it is, the settings say, the URL, or the profile."""
        url = completed(url, self.profile)
        self.link.bytes_per_s = rate = bytes_per_s(url, self.profile, self.settings.baud_rate)
        self.protocol.level = LineLevel(rate, lambda: self.link.unsent_bytes)
        await self.link.open(url)

    # Transfers ------------------------------------------------------------------------------------------------------

    def patience(self, operator_timeout_s: float | None = None, silence_timeout_s: float | None = None) -> Patience:
        """Say how long each phase of a transfer may take; None: as the settings have it."""
        settings = self.settings
        return Patience(
            start_s=settings.operator_timeout_s if operator_timeout_s is None else operator_timeout_s,
            body_s=settings.silence_timeout_s if silence_timeout_s is None else silence_timeout_s,
            tail_s=settings.tail_s,
            reader_off_s=settings.reader_off_timeout_s,
            block_s=settings.block_timeout_s,
            most_repeats=settings.most_blocks_repeated,
            drip_held_s=settings.drip_held_timeout_s,
        )

    def receiver(self, label: str, sink: Callable[[bytes], None], patience: Patience) -> Strategy:
        """Return what receives a file, and gives its pieces to *sink*."""
        profile = self.profile
        assert profile.synchronization is not None  # it is refused before
        return receive_file(
            profile.synchronization,
            label,
            sink,
            patience=patience,
            max_bytes=self.settings.max_bytes,
            eob=profile.eob_bytes,
        )

    def sender(self, label: str, data: bytes, patience: Patience, kind: Kind) -> Strategy:
        """Return what sends a file."""
        profile = self.profile
        assert profile.synchronization is not None  # it is refused before
        send = drip_feed if kind == "drip feed" else send_file
        heeds_signs = profile.synchronization != "rts/cts"  # with wires the port stops between two bytes
        return send(
            profile.synchronization,
            label,
            data,
            patience=patience,
            eob=profile.eob_bytes,
            most_unsent_bytes=self.settings.most_unsent_bytes if heeds_signs else None,
            waits_for_start=profile.says_when_ready,
        )

    @property
    def tells_damage(self) -> bool:
        """Whether chance damage of what comes is found on this line, whatever the port counts."""
        return self.profile.parity_in == "bytes" or self.profile.synchronization == "xmodem"

    async def transfer(self, strategy: Strategy) -> LineAccount:
        """
        Have a file go over the line, in its turn.

        Returns:
            How far it came, and how it ended.

        Raises:
            AnswerTimeoutError: The line does not get in step, or the control holds it: nothing was begun.
            UnexpectedAnswerError: Something never stops sending.
            ConnectionLostError: There is no line.
        """
        port = self.link.extra_info("serial")
        before = line_errors_of(port)
        self.protocol.load(strategy)
        self._turn = None
        try:
            outcome = await self.link.exchange(strategy.label, Lane.CONTROL, on_sent=lambda: self._take_turn(strategy))
        except asyncio.CancelledError:
            self.give_up(strategy)
            raise
        finally:
            self._turn = None
            after = line_errors_of(port)
            self.counted = None if before is None or after is None else after.since(before)
            self._note_rest(strategy)
        if isinstance(outcome, TransferOver):
            return outcome.account
        assert isinstance(outcome, HeldBack), outcome
        raise self.held_back(outcome)

    def _note_rest(self, strategy: Strategy) -> None:
        if strategy.ending is Ending.COMPLETE:
            self.may_wait_for_rest = False
        elif strategy.sends and not strategy.takes_all and strategy.account().written_bytes:
            self.may_wait_for_rest = True

    def _take_turn(self, strategy: Strategy) -> None:
        self._turn = strategy

    def give_up(self, strategy: Strategy) -> None:
        """Write no more of a transfer, and tell the control where its synchronisation has a way; harmless when over."""
        if self._turn is strategy and strategy.ending is None:
            with suppress(ConnectionLostError):
                self.link.preempt(strategy.label)

    # Questions ------------------------------------------------------------------------------------------------------

    async def ask(self, text: str, lane: Lane = Lane.READ) -> str:
        """
        Send a question, and return what its answer says; one that waits for a lost line is asked on the next one.

        Raises:
            UnexpectedAnswerError: What came is no answer.
            AnswerTimeoutError, ConnectionLostError: None came.
        """
        outcome = await self.link.exchange(text, lane, survives_loss=lane is Lane.READ)
        if isinstance(outcome, Answered):
            return outcome.text
        if isinstance(outcome, HeldBack):
            raise self.held_back(outcome)
        if isinstance(outcome, NobodyAnswers):
            raise AnswerTimeoutError(
                f"{text!r} was not sent: an earlier question is unanswered, and so is {outcome.asked!r}",
                device=self.name,
                hint=NO_ANSWER,
                exchanges=self.link.recent(),
            )
        received = outcome.text if isinstance(outcome, Unreadable) else None
        raise UnexpectedAnswerError(
            "that is no answer to what was sent" if received is not None else "a transfer came in between",
            device=self.name,
            sent=text,
            received=received,
            hint="does a program print in the middle of answers, or is the line disturbed? Ask again",
            exchanges=self.link.recent(),
        )

    def held_back(self, outcome: HeldBack) -> CompaxError:
        """Report what was not sent because the line was not free."""
        if outcome.by_xoff:
            what = "the control has told to send nothing (Xoff), and not to go on"
            hint = "press RESET at the control, and try again: the next time it is sent all the same"
        else:
            what = "the control never stops sending something else"
            hint = "a running program prints, or sends a file; wait until it is done"
        return AnswerTimeoutError(
            f"{outcome.sent!r} was not sent: {what}", device=self.name, hint=hint, exchanges=self.link.recent()
        )
