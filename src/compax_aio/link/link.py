"""
One line: exchanges wait in lanes, one is on the wire, and a time-out never shifts the answers that come after it.

The link knows turns and time, and no device: what bytes mean is told to it by a
:class:`~compax_aio.link.contract.DeviceProtocol`. It never awaits inside a turn: everything happens in callbacks of the
event loop, so a caller that is cancelled leaves nothing half done. A line that is lost is opened again, if that is
wanted; what asks something waits for it, what tells something fails and is never sent again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from functools import partial
from typing import cast

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, TransportError
from ..transports.registry import open_transport
from .contract import DeviceProtocol, Event, Hold, HoldOver, InStep, Lane, LateEnding, MarkerSpent, TurnOver
from .deadline import Deadline
from .exchanges import Exchange, ExchangeQueue
from .failures import Failures
from .port import Port
from .reconnecting import Reconnecting
from .stats import LinkStats
from .wire import WireHistory

__all__ = ["Link", "LinkStats"]

_log = logging.getLogger("compax_aio.link")


class Link(asyncio.Protocol):
    """
    Runs a device's protocol over a transport.

    Args:
        protocol: The device's end of the line.
        name: For errors and logs.
        answer_timeout_s: How long an answer may take before the line is in doubt.
        resync_attempts: How many markers are tried before the device counts as silent.
        on_event: Called with every event that is not about turns, as soon as it is read.
        on_lost: Called when an open line goes away for good.
        greet: Awaited on every line that was opened and is in step, before anything goes over it that is less urgent
            than ``Lane.GREETING``: looks who is there, and raises CompaxError if it is not who it should be.
        reconnecting: How a line that was lost is opened again; None: it is not.
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
        greet: Callable[[], Awaitable[None]] | None = None,
        reconnecting: Reconnecting | None = None,
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
        self._greet = greet
        self._reconnecting = reconnecting
        self._loop = asyncio.get_running_loop()
        self._port = Port(name, self.stats, self.history)
        self._url = ""
        self._is_closing = self._is_lost = False
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
        self._silence: AnswerTimeoutError | None = None
        self._is_renewing = False
        self._attempts = 0

    # Opening and closing --------------------------------------------------------------------------------------------

    async def open(self, url: str) -> None:
        """
        Open the line that *url* names, bring it in step, and greet who is there.

        Raises:
            TransportError: The line cannot be opened.
            UnexpectedAnswerError: Another device is at its far end.
            AnswerTimeoutError: Nobody on it answers as this device would, or nothing may be sent (:attr:`held`).
        """
        self._url = url
        try:
            await self._connect()
        except BaseException:
            await self.close()
            raise
        self.admit()

    async def _connect(self) -> None:
        self._queue.is_admitted = False
        self._attempts += 1
        self._opening = self._loop.create_future()
        try:
            await open_transport(self._url, lambda: self)
            await self._opening
        finally:
            self._opening = None
        if self._greet is not None:
            await self._greet()

    async def close(self) -> None:
        """Close the line; what still waits fails with ConnectionLostError. Takes at most a second or two."""
        self._is_closing = True
        if self._reconnecting is not None:
            await self._reconnecting.end()
        await self._close_port()
        self._fail_waiting(self._lost)

    async def _close_port(self) -> None:
        if not await self._port.close():
            self.connection_lost(None)

    @property
    def is_open(self) -> bool:
        """Whether there is a line, and who is on it was looked at."""
        return self._port.is_there and self._queue.is_admitted and not self.is_over

    @property
    def is_over(self) -> bool:
        """Whether the line is closed, or lost and not opened again."""
        return self._is_closing or self._is_lost

    # What getting a lost line back needs ----------------------------------------------------------------------------

    async def reopen(self) -> None:
        """Open the line again, once; raises CompaxError, with nothing left open, if that fails."""
        try:
            await self._close_port()
            self._is_renewing = False
            await self._connect()
        except BaseException as error:
            if isinstance(error, CompaxError) and not isinstance(error, TransportError):
                self._fail_waiting(partial(self._failures.refused, error), but=self._came_during_attempt)
            await self._close_port()
            self._fail_what_tells(error if isinstance(error, CompaxError) else None)
            raise

    def admit(self) -> None:
        """Let everything that waits go over the line."""
        if self._attempts > 1:
            self.stats.reconnects += 1
        self._queue.is_admitted = True
        self._pump()

    def lose_patience(self) -> None:
        """Fail what waits for the lost line."""
        self._fail_waiting(self._lost)

    def give_up(self, error: CompaxError) -> None:
        """Take note that the line is lost for good."""
        self._is_lost = True
        loss = self._lost(None, error)
        self._fail_waiting(lambda exchange: self._lost(exchange, error))
        self._on_lost(loss)

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
        survives_loss: bool = False,
        on_sent: Callable[[], None] | None = None,
    ) -> asyncio.Future[TurnOver]:
        """
        Queue one line; if the line is free it is written before this returns.

        Args:
            text: The line without its end sign; checked by the caller.
            lane: What goes first. Identical lines that wait in ``Lane.READ`` share one exchange.
            settles_late: After a time-out, wait until the line is in step again, for the answer may come late; where
                nothing may be sent to get in step, only as long as an answer may take, once more.
            survives_loss: Wait for a line that is lost, and send it again when it is back; for what does no harm when
                the device gets it twice.
            on_sent: Called when the line is handed to the transport.

        Returns:
            A future of the protocol's :class:`TurnOver`. It raises AnswerTimeoutError, or ConnectionLostError;
            cancelling it takes the line from the queue, or drops its answer when it is on the wire.
        """
        waiter: asyncio.Future[TurnOver] = self._loop.create_future()
        survives_loss &= lane is not Lane.GREETING
        exchange = Exchange(text, lane, settles_late, survives_loss, self._attempts, on_sent, [waiter])
        if not self._takes(exchange):
            waiter.set_exception(self._lost(exchange))
            return waiter
        self._queue.put(exchange)
        if self._silence is not None:
            self._renew(self._silence)
        self._ensure_doubt_is_pursued()
        self._pump()
        return waiter

    def _takes(self, exchange: Exchange) -> bool:
        if self.is_over or self._port.is_there or self._is_renewing:
            return not self.is_over
        return exchange.survives_loss and self._reconnecting is not None and self._reconnecting.is_patient

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
        line = cast("asyncio.Transport", transport)  # uvloop's transports are no subclasses
        self._port.opened(line)
        if self._is_closing:  # while it was being opened
            self._port.hang_up()
            return
        self._protocol.line_opened()
        self._begin_doubt()
        self._pump()

    def data_received(self, data: bytes) -> None:
        """Pass bytes in, events out."""
        if not self._port.is_there:  # any more
            return
        self._port.received(data)
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
        """Fail what tells something: nobody can say any more what becomes of it. What asks may wait for the line."""
        self._port.ended()
        self._deadline.cancel()
        if self._protocol.is_busy:
            self._protocol.time_ran_out()
        self.release_reads()
        if self._is_renewing:
            return
        was_admitted, self._queue.is_admitted = self._queue.is_admitted, False
        self._fail_what_tells(exc)
        if self._is_closing or not was_admitted:
            return
        error = self._lost(None, exc)
        if self._reconnecting is not None:
            _log.warning("%s", error)
            self._reconnecting.begin(self, error, at_once=False)
        else:
            self._is_lost = True
            self._on_lost(error)

    def _fail_what_tells(self, cause: Exception | None) -> None:
        self._fail_waiting(lambda exchange: self._lost(exchange, cause), but=self._waits_for_line)

    def _waits_for_line(self, exchange: Exchange) -> bool:
        return exchange.survives_loss and self._reconnecting is not None and not self.is_over

    def _came_during_attempt(self, exchange: Exchange) -> bool:
        """Whether it was asked on a line that is lost while that was being opened: the next attempt is its first."""
        is_attempt = not self._queue.is_admitted
        return is_attempt and self._waits_for_line(exchange) and exchange.attempt == self._attempts

    # Turns ----------------------------------------------------------------------------------------------------------

    def _pump(self) -> None:
        """Send what is next, if the line is free."""
        protocol = self._protocol
        while self._port.is_there and not (self._is_closing or protocol.is_busy or self._is_reading):
            if protocol.in_doubt:
                if not self._pursue_doubt():
                    if self._grace is None:
                        self._give_up()
                    return
            elif (exchange := self._queue.take_next()) is not None:
                self._outstanding = exchange
                protocol.send(exchange.text)
                exchange.is_on_wire = True
                self._flush()
                self._deadline.put_off()
                if exchange.on_sent is not None:
                    exchange.on_sent()
            else:
                return

    def _flush(self) -> None:
        if data := self._protocol.bytes_to_send():
            self.lines_sent += 1
            self._port.write(data)

    def _handle(self, event: Event) -> None:
        if isinstance(event, TurnOver):
            exchange, self._outstanding = self._outstanding, None
            self.stats.exchanges += 1
            self.stats.answer_times_s.append(self._loop.time() - self._deadline.counted_from)
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
        but = self._came_during_attempt
        if (hold := self._protocol.held) is not None:
            self._fail_waiting(partial(self._failures.hold, hold), but=but)
        elif (stranger := self._protocol.stranger(time_is_over=True)) is not None:
            self._fail_waiting(partial(self._failures.stranger, stranger), but=but)
        else:
            self._note_silence()
            self._fail_waiting(self._failures.silence, but=but)

    def _note_silence(self) -> None:
        """Let a line on which nothing has come for long be opened anew when it is used next: it may lead nowhere."""
        if self._reconnecting is not None and self._queue.is_admitted:
            silent_s = self._loop.time() - self._port.heard_at
            is_long = silent_s >= self._reconnecting.patience_s
            self._silence = self._failures.silence(None) if is_long else None

    def _renew(self, silence: AnswerTimeoutError) -> None:
        assert self._reconnecting is not None
        self._silence = None
        self._is_renewing = True
        self._queue.is_admitted = False
        self._port.hang_up()
        self._reconnecting.begin(self, self._lost(None, silence), at_once=True)

    def _fail_waiting(
        self,
        make_error: Callable[[Exchange | None], CompaxError],
        *,
        but: Callable[[Exchange], bool] = lambda _: False,
    ) -> None:
        """Fail everything that waits, the opening too; those for which *but* holds are queued anew."""
        self._end_grace()
        self._markers_left = 0
        self._is_pursuing = False
        waiting = [exchange for exchange in (self._doubtful, self._outstanding) if exchange is not None]
        waiting += self._queue.take_all()
        self._outstanding = self._doubtful = None
        for exchange in waiting:
            if but(exchange):
                exchange.begin_anew()
                self._queue.put(exchange)
            else:
                exchange.fail(make_error)
        if self._opening is not None and not self._opening.done():
            self._opening.set_exception(make_error(None))

    def _fail_doubtful(self) -> None:
        if self._doubtful is not None:
            exchange, self._doubtful = self._doubtful, None
            hold = self._protocol.held
            exchange.fail(partial(self._failures.hold, hold) if hold else self._failures.timeout)

    def _lost(self, exchange: Exchange | None, cause: Exception | None = None) -> ConnectionLostError:
        comes_back = self._reconnecting is not None and not self.is_over
        return self._failures.loss(
            exchange, cause, is_closing=self._is_closing, comes_back=comes_back, hold=self._protocol.held
        )

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
