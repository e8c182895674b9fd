"""The errors of one line: what did not work, what came instead, and what to do."""

from __future__ import annotations

from copy import copy

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, UnexpectedAnswerError
from .contract import Hold, Stranger
from .exchanges import Exchange
from .wire import WireHistory

__all__ = ["Failures"]


class Failures:
    """
    Makes the errors of one line.

    Args:
        name: Of the line.
        history: Its last bytes, told in every error.
        answer_timeout_s: How long an answer may take.
        resync_attempts: How many markers are tried.
        marker_timeout_s: How long each of them takes.
        advice_on_silence: What to look at when nothing comes at all.
    """

    def __init__(
        self,
        name: str,
        history: WireHistory,
        *,
        answer_timeout_s: float,
        resync_attempts: int,
        marker_timeout_s: float,
        advice_on_silence: str,
    ) -> None:
        self._name = name
        self._history = history
        self._answer_timeout_s = answer_timeout_s
        self._resync_attempts = resync_attempts
        self._marker_timeout_s = marker_timeout_s
        self._advice_on_silence = advice_on_silence

    def timeout(self, exchange: Exchange) -> AnswerTimeoutError:
        """Say that one line was not answered in time."""
        return AnswerTimeoutError(
            self._not_in_time(exchange),
            device=self._name,
            sent=exchange.text,
            received=exchange.received,
            hint="the line is brought back in step before anything else is sent; an answer that still comes is dropped",
            exchanges=self._history.lines(),
        )

    def silence(self, exchange: Exchange | None) -> AnswerTimeoutError:
        """Say that nobody answers as this device would."""
        received = self._history.received_since_sent()
        return AnswerTimeoutError(
            f"no sensible answer to {self._resync_attempts} queries in a row, {self._marker_timeout_s:g} s each",
            device=self._name,
            sent=exchange.text if exchange else self._history.last_sent(),
            received=received,
            hint=(
                "what comes is no answer of this device: check baud rate and parity, and which device this is"
                if received
                else self._advice_on_silence
            ),
            exchanges=self._history.lines(),
        )

    def hold(self, hold: Hold, exchange: Exchange | None) -> AnswerTimeoutError:
        """Say why nothing may be sent, and what that means for *exchange*."""
        sent = received = None
        if exchange is None:
            what = "nothing was sent"
        elif exchange.is_late:
            what, sent, received = self._not_in_time(exchange), exchange.text, exchange.received
        elif exchange.times_ahead:
            what = f"sent {exchange.times_ahead} times, and nothing shows whether it was understood"
            sent, received = exchange.text, self._history.received_since_sent()
        else:
            what = f"{exchange.text!r} was not sent"
        return AnswerTimeoutError(
            f"{what}: {hold.why}",
            device=self._name,
            sent=sent,
            received=received,
            hint=hold.remedy,
            exchanges=self._history.lines(),
        )

    def stranger(self, stranger: Stranger, exchange: Exchange | None) -> UnexpectedAnswerError:
        """Say that another device is at the far end."""
        return UnexpectedAnswerError(
            f"the far end looks like {stranger.name}",
            device=self._name,
            sent=exchange.text if exchange else self._history.last_sent(),
            received=self._history.received_since_sent(),
            hint=stranger.remedy,
            exchanges=self._history.lines(),
        )

    def babble(self, times: int, exchange: Exchange | None) -> UnexpectedAnswerError:
        """Say that the line never stays in step: with each answer comes something that answers nothing."""
        return UnexpectedAnswerError(
            f"the line was brought in step {times} times, and each time something else came with the answer",
            device=self._name,
            sent=exchange.text if exchange else self._history.last_sent(),
            received=self._history.received_since_sent(),
            hint="are two devices on this line, or does somebody else use it? An adapter or server may double what it "
            "receives",
            exchanges=self._history.lines(),
        )

    def refused(self, error: CompaxError, exchange: Exchange | None) -> CompaxError:
        """Say why a line that came back is not used; each who waits gets an error of its own."""
        mine = copy(error)
        mine.__cause__ = error
        if exchange is not None:
            mine.what = f"{exchange.text!r} was not sent on the line that came back: {error.what}"
        return mine

    def loss(
        self,
        exchange: Exchange | None,
        cause: Exception | None,
        *,
        is_closing: bool,
        comes_back: bool,
        hold: Hold | None,
    ) -> ConnectionLostError:
        """Say that the line is gone."""
        sent = None
        what = "the line is closed" if is_closing else "the line was lost" + (f" ({_reason(cause)})" if cause else "")
        hint = None if is_closing else "a drive that was moving may go on; look at it before you connect again"
        if exchange is not None and (exchange.is_on_wire or exchange.times_ahead):
            sent = exchange.text
        elif exchange is not None:
            what += f", and {exchange.text!r} was not sent"
        if hint is not None and comes_back:
            hint = (
                "the line is tried again while it is open; a drive that was moving may go on, and shows it when it is "
                "back"
            )
        if hint is not None and isinstance(cause, CompaxError) and cause.hint:
            hint = f"{cause.hint}{'' if cause.hint.endswith('?') else ';'} {hint}"
        elif hint is not None and not self._history.has_received:
            hint = f"it has said nothing yet: is somebody else connected to that port already? {hint}"
        if hold is not None:
            hint = f"{hold.why}: look at the machine, and switch the device off and on before you connect again"
        error = ConnectionLostError(what, device=self._name, sent=sent, hint=hint, exchanges=self._history.lines())
        error.__cause__ = cause
        return error

    def _not_in_time(self, exchange: Exchange) -> str:
        patience_s = self._answer_timeout_s if exchange.patience_s is None else exchange.patience_s
        return f"no answer within {patience_s:.3g} s"


def _reason(cause: Exception) -> str:
    return cause.what if isinstance(cause, CompaxError) else str(cause)
