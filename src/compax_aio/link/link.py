"""
One line: exchanges wait in lanes, one is on the wire, and a time-out never shifts the answers that come after it.

The link knows turns and time, and no device: what bytes mean is told to it by a
:class:`~compax_aio.link.contract.DeviceProtocol`. It never awaits inside: everything happens in callbacks of the
event loop, so a caller that is cancelled leaves nothing half done.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import cast

from ..errors import CompaxError, ConnectionLostError
from ..transports.registry import open_transport
from .contract import DeviceProtocol, Event, Hold, HoldOver, InStep, Lane, LateEnding, MarkerSpent, TurnOver
from .deadline import Deadline
from .exchanges import Exchange, ExchangeQueue
from .failures import Failures
from .stats import LinkStats
from .wire import WireHistory

__all__ = ["Link", "LinkStats"]

_log = logging.getLogger(__name__)

_CLOSE_GRACE_S = 0.5
_ABORT_GRACE_S = 1.0


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
        self.lines_sent = 0
        """Everything that was written on this line, markers included; compare it, to see whether the line was used."""
        self._protocol = protocol
        self._name = name
        self._answer_timeout_s = answer_timeout_s
        self._resync_attempts = resync_attempts
        self._failures = Failures(name, self.history, answer_timeout_s, resync_attempts)
        self._on_event = on_event
        self._on_lost = on_lost
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._closed = self._loop.create_future()
        self._is_closing = False
        self._queue = ExchangeQueue()
        self._reads_timer: asyncio.TimerHandle | None = None
        self._outstanding: Exchange | None = None
        self._doubtful: Exchange | None = None
        self._opening: asyncio.Future[None] | None = None
        self._markers_left = 0
        self._is_pursuing = False
        self._may_send_ahead = False
        self._is_reading = False
        self._deadline = Deadline(answer_timeout_s, self._time_is_up)
        self._grace: asyncio.TimerHandle | None = None

    # Opening and closing --------------------------------------------------------------------------------------------

    async def open(self, url: str) -> None:
        """
        Open the line that *url* names and bring it in step.

        Raises:
            TransportError: The line cannot be opened.
            UnexpectedAnswerError: Another device is at its far end.
            AnswerTimeoutError: Nobody on it answers as this device would, or nothing may be sent (:attr:`held`).
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

    @property
    def is_free(self) -> bool:
        """Whether a line that is queued now would be written at once, unless it is a read that is held back."""
        return self.is_open and not (self._protocol.is_busy or self._protocol.in_doubt or self._is_reading)

    @property
    def held(self) -> Hold | None:
        """Why nothing but a stop may be sent, until one is answered, or :meth:`resume`; None if it may."""
        return self._protocol.held

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
            settles_late: After a time-out, wait until the line is in step again, for the answer may come late; where
                nothing may be sent to get in step, only as long as an answer may take, once more.
            on_sent: Called when the line is handed to the transport.

        Returns:
            A future of the protocol's :class:`TurnOver`. It raises AnswerTimeoutError, or ConnectionLostError;
            cancelling it takes the line from the queue, or drops its answer when it is on the wire.
        """
        waiter: asyncio.Future[TurnOver] = self._loop.create_future()
        if not self.is_open:
            waiter.set_exception(self._lost(Exchange(text)))
            return waiter
        self._queue.put(Exchange(text, settles_late, on_sent, [waiter]), lane)
        self._ensure_doubt_is_pursued()
        self._pump()
        return waiter

    def hold_reads(self, for_s: float) -> None:
        """Let what waits in ``Lane.READ`` wait on, at most *for_s* from now; what is on the wire goes on."""
        self._queue.reads_are_held = True
        if self._reads_timer is not None:
            self._reads_timer.cancel()
        self._reads_timer = self._loop.call_later(for_s, self.release_reads)

    def release_reads(self) -> None:
        """Let reads go on; harmless when they are not held back."""
        if self._reads_timer is not None:
            self._reads_timer.cancel()
            self._reads_timer = None
            self._queue.reads_are_held = False
            self._pump()

    def resume(self) -> None:
        """Take a person's word that what the line is :attr:`held` for can do no harm, and get in step; else nothing."""
        if self._protocol.held is None:
            return
        self._protocol.resume()
        self._end_grace()
        self._fail_doubtful()
        self._begin_doubt()
        self._pump()

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
        if self._is_pursuing and self._protocol.stranger(time_is_over=False) is not None:
            self._give_up()
        self._pump()

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail everything that waits: nobody can say any more what becomes of it."""
        self._transport = None
        self._deadline.cancel()
        if not self._closed.done():
            self._closed.set_result(None)
        if self._protocol.is_busy:
            self._protocol.time_ran_out()
        self.release_reads()
        self._stop_pursuing(lambda exchange: self._lost(exchange, exc))
        if not self._is_closing:
            self._on_lost(self._lost(None, exc))

    # Turns ----------------------------------------------------------------------------------------------------------

    def _pump(self) -> None:
        """Send what is next, if the line is free."""
        protocol = self._protocol
        while self.is_open and not protocol.is_busy and not self._is_reading:
            if protocol.in_doubt:
                if not self._pursue_doubt():
                    if self._grace is None:
                        self._give_up()
                    return
            elif (exchange := self._queue.take_next()) is not None:
                self._outstanding = exchange
                protocol.send(exchange.text)
                self._flush()
                self._deadline.put_off()
                if exchange.on_sent is not None:
                    exchange.on_sent()
            else:
                return

    def _flush(self) -> None:
        data = self._protocol.bytes_to_send()
        if data and self._transport is not None:
            self.lines_sent += 1
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
        elif isinstance(event, HoldOver):
            self._begin_doubt()
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
        if not self._markers_left:
            return False
        stop = self._queue.first_stop()
        if self._protocol.held is not None:
            if stop is None:
                return False
            self._markers_left -= 1
            self._send_ahead(stop)
        elif stop is not None and self._may_send_ahead:
            # In turn with the markers, for half a line in the device's buffer may spoil either; the exchange itself
            # follows when in step.
            self._may_send_ahead = False
            self._send_ahead(stop)
        else:
            self._markers_left -= 1
            self._may_send_ahead = True
            self._protocol.send_marker()
        self._flush()
        self._deadline.put_off()
        return True

    def _send_ahead(self, stop: Exchange) -> None:
        stop.times_ahead += 1
        self._protocol.send_ahead(stop.text)

    def _end_doubt(self) -> None:
        self.stats.resynchronisations += 1
        self._markers_left = 0
        self._is_pursuing = False
        self._end_grace()
        self._fail_doubtful()
        if self._opening is not None and not self._opening.done():
            self._opening.set_result(None)

    def _give_up(self) -> None:
        """Tell everyone who waits why there is no answer. What is asked next begins anew."""
        if (hold := self._protocol.held) is not None:
            self._stop_pursuing(partial(self._failures.hold, hold))
        elif (stranger := self._protocol.stranger(time_is_over=True)) is not None:
            self._stop_pursuing(partial(self._failures.stranger, stranger))
        else:
            self._stop_pursuing(self._failures.silence)

    def _stop_pursuing(self, make_error: Callable[[Exchange | None], CompaxError]) -> None:
        """Fail everything that waits, the opening too."""
        self._end_grace()
        self._markers_left = 0
        self._is_pursuing = False
        waiting = self._queue.take_all()
        waiting += [exchange for exchange in (self._outstanding, self._doubtful) if exchange is not None]
        self._outstanding = self._doubtful = None
        for exchange in waiting:
            exchange.fail(make_error)
        if self._opening is not None and not self._opening.done():
            self._opening.set_exception(make_error(None))

    def _fail_doubtful(self) -> None:
        if self._doubtful is not None:
            exchange, self._doubtful = self._doubtful, None
            hold = self._protocol.held
            exchange.fail(partial(self._failures.hold, hold) if hold else self._failures.timeout)

    def _lost(self, exchange: Exchange | None, cause: Exception | None = None) -> ConnectionLostError:
        return self._failures.loss(exchange, cause, is_closing=self._is_closing, hold=self._protocol.held)

    # Time -----------------------------------------------------------------------------------------------------------

    def _time_is_up(self) -> None:
        if not self._protocol.is_busy:
            return
        self._protocol.time_ran_out()
        if self._outstanding is not None:
            self.stats.timeouts += 1
            exchange, self._outstanding = self._outstanding, None
            _log.warning("%s: no answer to %r within %g s", self._name, exchange.text, self._answer_timeout_s)
            exchange.is_late = True
            self._doubtful = exchange
            exchange.received = self.history.received_since_sent()
            if not exchange.settles_late:
                self._fail_doubtful()
            self._begin_doubt()
            if self._protocol.held is not None:
                self._grace = self._loop.call_later(self._answer_timeout_s, self._grace_is_over)
        self._pump()

    def _grace_is_over(self) -> None:
        """Where nothing may be sent to get in step, a late answer is waited for no longer."""
        self._end_grace()
        self._pump()

    def _end_grace(self) -> None:
        if self._grace is not None:
            self._grace.cancel()
            self._grace = None
