"""
One line: exchanges wait in lanes, one is on the wire, and a time-out never shifts the answers that come after it.

The link knows turns and time, and no device: what bytes mean is told to it by a
:class:`~compax_aio.link.contract.DeviceProtocol`. It never awaits inside: everything happens in callbacks of the
event loop, so a caller that is cancelled leaves nothing half done.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError
from ..transports.registry import open_transport
from .contract import DeviceProtocol, Event, InStep, Lane, LateEnding, MarkerSpent, TurnOver
from .wire import WireHistory

__all__ = ["Link", "LinkStats"]

_log = logging.getLogger(__name__)

_CLOSE_GRACE_S = 0.5
_ABORT_GRACE_S = 1.0


@dataclass(slots=True)
class LinkStats:
    """Counters of one line since it was made."""

    exchanges: int = 0
    """Lines answered in their turn."""
    timeouts: int = 0
    """Lines whose answer did not come in time."""
    resynchronisations: int = 0
    """Times the line was brought back in step, the first after opening included."""
    late_answers: int = 0
    """Answers that came after their time had run out, and were recognised."""
    strays: int = 0
    """Unsolicited texts, messages of the device not counted."""
    bytes_sent: int = 0
    bytes_received: int = 0


@dataclass(slots=True, eq=False)
class _Exchange:
    """One line to be sent, and who waits for its answer."""

    text: str
    settles_late: bool
    on_sent: Callable[[], None] | None
    waiters: list[asyncio.Future[TurnOver]] = field(default_factory=list)

    @property
    def is_wanted(self) -> bool:
        return any(not waiter.done() for waiter in self.waiters)

    def end(self, outcome: TurnOver) -> None:
        for waiter in self.waiters:
            if not waiter.done():
                waiter.set_result(outcome)

    def fail(self, make_error: Callable[[], CompaxError]) -> None:
        for waiter in self.waiters:
            if not waiter.done():
                waiter.set_exception(make_error())


class Link(asyncio.Protocol):
    """
    Runs a device's protocol over a transport.

    Args:
        protocol: The device's end of the line.
        name: For errors and logs.
        answer_timeout_s: How long an answer may take before the line is in doubt.
        resync_attempts: How many markers are tried before the device counts as silent.
        on_event: Called with every event that is not about turns, as soon as it is read.
        on_lost: Called once when an open line goes away.
    """

    def __init__(
        self,
        protocol: DeviceProtocol,
        *,
        name: str,
        answer_timeout_s: float,
        resync_attempts: int,
        on_event: Callable[[Event], None],
        on_lost: Callable[[ConnectionLostError], None],
    ) -> None:
        self.stats = LinkStats()
        self.history = WireHistory()
        self._protocol = protocol
        self._name = name
        self._answer_timeout_s = answer_timeout_s
        self._resync_attempts = resync_attempts
        self._on_event = on_event
        self._on_lost = on_lost
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._closed = self._loop.create_future()
        self._is_closing = False
        self._lanes: tuple[deque[_Exchange], ...] = tuple(deque() for _ in Lane)
        self._shared: dict[str, _Exchange] = {}
        self._outstanding: _Exchange | None = None
        self._doubtful: _Exchange | None = None
        self._doubtful_received: str | None = None
        self._opening: asyncio.Future[None] | None = None
        self._markers_left = 0
        self._is_pursuing = False
        self._may_send_ahead = False
        self._is_reading = False
        self._deadline = 0.0
        self._timer: asyncio.TimerHandle | None = None

    # Opening and closing --------------------------------------------------------------------------------------------

    async def open(self, url: str) -> None:
        """
        Open the line that *url* names and bring it in step.

        Raises:
            TransportError: The line cannot be opened.
            AnswerTimeoutError: Nobody on it answers as this device would.
        """
        self._opening = self._loop.create_future()
        try:
            await open_transport(url, lambda: self)
            await self._opening
        except BaseException:
            await self.close()
            raise
        finally:
            self._opening = None

    async def close(self) -> None:
        """Close the line; what still waits fails with ConnectionLostError. Takes at most a second."""
        self._is_closing = True
        if self._transport is None:
            return
        self._transport.close()
        abort = self._loop.call_later(_CLOSE_GRACE_S, self._abort)
        try:
            await asyncio.wait([self._closed], timeout=_CLOSE_GRACE_S + _ABORT_GRACE_S)
        finally:
            abort.cancel()
            self._abort()
        if not self._closed.done():
            _log.error("%s: the transport did not report its end", self._name)
            self.connection_lost(None)

    def _abort(self) -> None:
        # After connection_lost, asyncio's own transports of CPython 3.11 do not bear it.
        if self._transport is not None:
            self._transport.abort()

    @property
    def is_open(self) -> bool:
        """Whether there is a line."""
        return self._transport is not None and not self._is_closing

    # What clients do ------------------------------------------------------------------------------------------------

    def exchange(
        self,
        text: str,
        lane: Lane,
        *,
        settles_late: bool = False,
        on_sent: Callable[[], None] | None = None,
    ) -> asyncio.Future[TurnOver]:
        """
        Queue one line; if the line is free it is written before this returns.

        Args:
            text: The line without its end sign; checked by the caller.
            lane: What goes first. Identical lines that wait in ``Lane.READ`` share one exchange.
            settles_late: After a time-out, wait until the line is in step again, for the answer may come late.
            on_sent: Called when the line is handed to the transport.

        Returns:
            A future of the protocol's :class:`TurnOver`. It raises AnswerTimeoutError, or ConnectionLostError;
            cancelling it takes the line from the queue, or drops its answer when it is on the wire.
        """
        waiter: asyncio.Future[TurnOver] = self._loop.create_future()
        if not self.is_open:
            waiter.set_exception(self._lost_error(text))
            return waiter
        if lane is Lane.READ:
            if (shared := self._shared.get(text)) is not None:
                shared.waiters.append(waiter)
                return waiter
            exchange = self._shared[text] = _Exchange(text, settles_late, on_sent, [waiter])
        else:
            exchange = _Exchange(text, settles_late, on_sent, [waiter])
        self._lanes[lane].append(exchange)
        self._ensure_doubt_is_pursued()
        self._pump()
        return waiter

    def recent(self) -> tuple[str, ...]:
        """Return the last exchanges of this line, oldest first, readable."""
        return self.history.lines()

    # What asyncio calls ---------------------------------------------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport, and begin to get in step."""
        self._transport = cast("asyncio.Transport", transport)  # uvloop's transports are no subclasses
        if self._is_closing:  # while it was being opened
            self._transport.abort()
            return
        self._protocol.line_opened()
        self._begin_doubt()
        self._pump()

    def data_received(self, data: bytes) -> None:
        """Pass bytes in, events out."""
        self.stats.bytes_received += len(data)
        self.history.received(self._loop.time(), data)
        if _log.isEnabledFor(logging.DEBUG):
            _log.debug("%s ← %r", self._name, data)
        self._protocol.receive(data)
        self._flush()
        # Nothing new is sent until every event is dealt with: a turn that began in between would get their answers.
        self._is_reading = True
        try:
            for event in self._protocol.events():
                self._handle(event)
        finally:
            self._is_reading = False
        self._pump()

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail everything that waits: nobody can say any more what becomes of it."""
        self._transport = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if not self._closed.done():
            self._closed.set_result(None)
        self._markers_left = 0
        self._is_pursuing = False
        self._fail_waiting(lambda text: self._lost_error(text, exc))
        if self._opening is not None and not self._opening.done():
            self._opening.set_exception(self._lost_error(None, exc))
        if not self._is_closing:
            self._on_lost(self._lost_error(None, exc))

    # Turns ----------------------------------------------------------------------------------------------------------

    def _pump(self) -> None:
        """Send what is next, if the line is free."""
        protocol = self._protocol
        while self.is_open and not protocol.is_busy and not self._is_reading:
            if protocol.in_doubt:
                if not self._pursue_doubt():
                    self._give_up()
                    return
            elif (exchange := self._take_next()) is not None:
                self._outstanding = exchange
                protocol.send(exchange.text)
                self._flush()
                self._arm()
                if exchange.on_sent is not None:
                    exchange.on_sent()
            else:
                return

    def _take_next(self) -> _Exchange | None:
        for lane in self._lanes:
            while lane:
                exchange = lane.popleft()
                if lane is self._lanes[Lane.READ]:
                    del self._shared[exchange.text]
                if exchange.is_wanted:
                    return exchange
        return None

    def _flush(self) -> None:
        data = self._protocol.bytes_to_send()
        if data and self._transport is not None:
            self.stats.bytes_sent += len(data)
            self.history.sent(self._loop.time(), data)
            if _log.isEnabledFor(logging.DEBUG):
                _log.debug("%s → %r", self._name, data)
            self._transport.write(data)

    def _handle(self, event: Event) -> None:
        if isinstance(event, TurnOver):
            exchange, self._outstanding = self._outstanding, None
            self.stats.exchanges += 1
            if self._protocol.in_doubt:
                self._begin_doubt()
            if exchange is not None:
                exchange.end(event)
        elif isinstance(event, LateEnding):
            self.stats.late_answers += 1
            _log.info("%s: the answer to %r came late", self._name, event.sent)
            if self._doubtful is not None and self._doubtful.text == event.sent:
                self._doubtful.end(event.outcome)
        elif isinstance(event, InStep):
            self._end_doubt()
        elif not isinstance(event, MarkerSpent):
            self._ensure_doubt_is_pursued()
            self._on_event(event)

    # Doubt ----------------------------------------------------------------------------------------------------------

    def _begin_doubt(self) -> None:
        self._markers_left = self._resync_attempts
        self._is_pursuing = True
        self._may_send_ahead = True

    def _ensure_doubt_is_pursued(self) -> None:
        if not self._is_pursuing and self._protocol.in_doubt and not self._protocol.is_busy and not self._markers_left:
            self._begin_doubt()

    def _pursue_doubt(self) -> bool:
        """Send the next thing that helps to get in step; False when there is nothing left to try."""
        stop = next((exchange for exchange in self._lanes[Lane.STOP] if exchange.is_wanted), None)
        if stop is not None and self._may_send_ahead and self._markers_left:
            # In turn with the markers, for half a line in the device's buffer may spoil either; the exchange itself
            # follows when in step.
            self._may_send_ahead = False
            self._protocol.send_ahead(stop.text)
        elif self._markers_left:
            self._markers_left -= 1
            self._may_send_ahead = True
            self._protocol.send_marker()
        else:
            return False
        self._flush()
        self._arm()
        return True

    def _end_doubt(self) -> None:
        self.stats.resynchronisations += 1
        self._markers_left = 0
        self._is_pursuing = False
        self._fail_doubtful()
        if self._opening is not None and not self._opening.done():
            self._opening.set_result(None)

    def _give_up(self) -> None:
        """Tell everyone who waits that nobody answers. What is asked next begins anew."""
        self._is_pursuing = False
        self._fail_waiting(self._silent_error)
        if self._opening is not None and not self._opening.done():
            self._opening.set_exception(self._silent_error(None))

    def _fail_doubtful(self) -> None:
        if self._doubtful is not None:
            exchange, self._doubtful = self._doubtful, None
            exchange.fail(lambda: self._timeout_error(exchange.text))

    # Time -----------------------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Set the deadline; the timer that is already set wakes early at worst, and sets itself anew."""
        self._deadline = self._loop.time() + self._answer_timeout_s
        if self._timer is None:
            self._timer = self._loop.call_at(self._deadline, self._wake)

    def _wake(self) -> None:
        self._timer = None
        if not self._protocol.is_busy:
            return
        if self._loop.time() < self._deadline:
            self._timer = self._loop.call_at(self._deadline, self._wake)
            return
        self._protocol.time_ran_out()
        if self._outstanding is not None:
            self.stats.timeouts += 1
            exchange, self._outstanding = self._outstanding, None
            _log.warning("%s: no answer to %r within %g s", self._name, exchange.text, self._answer_timeout_s)
            self._doubtful = exchange
            self._doubtful_received = self.history.received_since_sent()
            if not exchange.settles_late:
                self._fail_doubtful()
            self._begin_doubt()
        self._pump()

    # Errors ---------------------------------------------------------------------------------------------------------

    def _fail_waiting(self, make_error: Callable[[str], CompaxError]) -> None:
        waiting = [exchange for lane in self._lanes for exchange in lane]
        waiting += [exchange for exchange in (self._outstanding, self._doubtful) if exchange is not None]
        for lane in self._lanes:
            lane.clear()
        self._shared.clear()
        self._outstanding = self._doubtful = None
        for exchange in waiting:
            exchange.fail(lambda exchange=exchange: make_error(exchange.text))  # type: ignore[misc]

    def _timeout_error(self, text: str) -> AnswerTimeoutError:
        return AnswerTimeoutError(
            f"no answer within {self._answer_timeout_s:g} s",
            device=self._name,
            sent=text,
            received=self._doubtful_received,
            hint="the line is brought back in step before anything else is sent; an answer that still comes is dropped",
            exchanges=self.recent(),
        )

    def _silent_error(self, text: str | None) -> AnswerTimeoutError:
        received = self.history.received_since_sent()
        return AnswerTimeoutError(
            f"no sensible answer to {self._resync_attempts} queries in a row, {self._answer_timeout_s:g} s each",
            device=self._name,
            sent=text,
            received=received,
            hint=(
                "what comes is no answer of this device: check baud rate and parity, and which device this is"
                if received
                else "check power, cable (crossed, not straight), port and baud rate, and the handshake lines"
            ),
            exchanges=self.recent(),
        )

    def _lost_error(self, text: str | None, cause: Exception | None = None) -> ConnectionLostError:
        error = ConnectionLostError(
            "the line is closed" if self._is_closing else "the line was lost" + (f" ({cause})" if cause else ""),
            device=self._name,
            sent=text,
            hint=None if self._is_closing else "a drive that was moving may go on; look at it before you connect again",
            exchanges=self.recent(),
        )
        error.__cause__ = cause
        return error
