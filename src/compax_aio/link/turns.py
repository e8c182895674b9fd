"""
Turns on one line: exchanges wait in lanes, one is on the wire, and a time-out never shifts the answers that follow.

What bytes mean is told by a :class:`~compax_aio.link.contract.DeviceProtocol`. Nothing here awaits: everything happens
in callbacks of the event loop, so a caller that is cancelled leaves nothing half done.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import Final

from ..errors import CompaxError
from .contract import (
    DeviceProtocol,
    Event,
    GoesOn,
    HoldOver,
    InStep,
    Lane,
    LateEnding,
    MarkerSpent,
    TurnLost,
    TurnOver,
)
from .deadline import Deadline
from .doubt import Doubt
from .exchanges import Exchange, ExchangeQueue
from .failures import Failures
from .port import Port
from .seldom import Seldom
from .stats import LinkStats
from .taps import Noticed, Sent, Way
from .telling import Telling
from .wire import WireHistory

__all__ = ["Turns"]

# What each exchange needs: to find a member in its enum costs CPython 3.11 as much as some twenty steps.
_TURN: Final = Way.TURN
_GOES_ON: Final = Way.GOES_ON
_STOP: Final = Lane.STOP


class Turns:
    """
    Runs a device's protocol over a port: says what is sent next, and whose answer came.

    Args:
        protocol: The device's end of the line.
        name: For logs.
        port: Bytes go out there.
        stats: What is counted.
        failures: Make the errors of the line.
        history: The last bytes of the line.
        answer_timeout_s: How long an answer may take before the line is in doubt.
        resync_attempts: How many markers are tried before the device counts as silent.
        on_event: Called with every event that is not about turns, as soon as it is read.
        on_silence: Called when nobody has answered any marker.
        spares: Says what goes on waiting although there is no answer to what was sent until now.
        telling: Tells what is written and noticed.
    """

    def __init__(
        self,
        protocol: DeviceProtocol,
        *,
        name: str,
        port: Port,
        stats: LinkStats,
        failures: Failures,
        history: WireHistory,
        answer_timeout_s: float,
        resync_attempts: int,
        on_event: Callable[[Event], None],
        on_silence: Callable[[], None],
        spares: Callable[[Exchange], bool],
        telling: Telling,
    ) -> None:
        self.lines_sent = 0
        self.queue = ExchangeQueue()
        self._protocol = protocol
        self._log = Seldom(logging.getLogger("compax_aio.link"), name)
        self._port = port
        self._stats = stats
        self._failures = failures
        self._history = history
        self._answer_timeout_s = answer_timeout_s
        self._on_event = on_event
        self._on_silence = on_silence
        self._spares = spares
        self._telling = telling
        self._loop = asyncio.get_running_loop()
        self._reads_hold = Deadline(self.release_reads)
        self._outstanding: Exchange | None = None
        self._unproved: list[tuple[Exchange, TurnOver]] = []
        """Stops that were acknowledged before it was known by whom."""
        self._doubtful: Exchange | None = None
        self._in_step: asyncio.Future[None] | None = None
        self._doubt = Doubt(resync_attempts)
        self._is_reading = False
        self._is_ended = False
        self._deadline = Deadline(self._time_is_up)
        self._began_at = 0.0
        self._patience_s = answer_timeout_s
        self._grace = Deadline(self.pump)
        """So long is waited on for a late answer where nothing may be sent to get in step."""

    # What the link does ---------------------------------------------------------------------------------------------

    @property
    def is_free(self) -> bool:
        """Whether a line that is queued now would be written at once, unless it is a read that is held back."""
        return not (self._protocol.is_busy or self._protocol.in_doubt or self._is_reading)

    def put(self, exchange: Exchange) -> None:
        """Queue *exchange*, and write it if the line is free; what need not wait is not queued at all."""
        if self.is_free and self.queue.lets_pass and self._port.transport is not None and not self._is_ended:
            self._begin(exchange, exchange.queued_at)
            if self._protocol.is_busy:
                return
        else:
            self.queue.put(exchange)
            self._ensure_doubt_is_pursued()
        self.pump()

    def say_ahead(self, stop: Exchange) -> None:
        """Write *stop*, which waits for the next line, on one that is about to be let go of."""
        if (
            self._port.transport is not None
            and self._protocol.in_doubt
            and not self._protocol.is_busy
            and not self._port.is_stuck
        ):
            self._send_ahead(stop, self._loop.time())

    def until_in_step(self) -> asyncio.Future[None]:
        """Return a future that is done when the line is in step, or fails with all else that waits."""
        self._in_step = self._loop.create_future()
        return self._in_step

    def line_opened(self) -> None:
        """Begin to get in step on a new line."""
        self._protocol.line_opened()
        self._doubt.begin()
        self.pump()

    def receive(self, data: bytes, now: float) -> None:
        """Pass bytes in, events out."""
        self._protocol.receive(data)
        self._flush(_GOES_ON, now)
        self._take_events(now)
        if self._doubt.is_pursued and self._protocol.stranger(time_is_over=False) is not None:
            self._give_up()
        self.pump()

    def line_lost(self) -> None:
        """Give up what is outstanding: nobody will answer it on this line."""
        self._deadline.cancel()
        self._protocol.line_lost()
        self._take_events(self._loop.time())
        self.release_reads()

    def admit(self) -> None:
        """Let everything that waits go: it is known who is there."""
        self.queue.is_admitted = True
        for exchange, outcome in self._unproved:
            exchange.end(outcome)
        self._unproved.clear()
        self.pump()

    def preempt(self, text: str) -> asyncio.Future[None]:
        """Write *text*, which the device heeds at any time; done when the line is in step again, or nobody answers."""
        now = self._loop.time()
        self._protocol.preempt(text)
        self._flush(Way.PREEMPT, now)
        self._take_events(now)
        self._doubt.begin()
        self._give_time(now)
        if self._in_step is None or self._in_step.done():
            self._in_step = self.until_in_step()
            self._in_step.add_done_callback(lambda each: each.cancelled() or each.exception())  # if nobody asks
        return self._in_step

    def end(self) -> None:
        """Send nothing any more."""
        self._is_ended = True

    def hold_reads(self, for_s: float) -> None:
        """Let what waits in ``Lane.READ`` wait on, at most *for_s* from now; what is on the wire goes on."""
        self.queue.reads_are_held = True
        self._reads_hold.put_off(for_s)

    def release_reads(self) -> None:
        """Let reads go on; harmless when they are not held back."""
        if self.queue.reads_are_held:
            self._reads_hold.cancel()
            self.queue.reads_are_held = False
            self.pump()

    def resume(self) -> None:
        """Take a person's word that what the line is :attr:`held` for can do no harm, and get in step; else nothing."""
        if self._protocol.held is None:
            return
        self._protocol.resume()
        self._grace.cancel()
        self._fail_doubtful()
        self._doubt.begin()
        self.pump()

    # Turns ----------------------------------------------------------------------------------------------------------

    def pump(self) -> None:
        """Send what is next, if the line is free."""
        protocol = self._protocol
        while self._port.transport is not None and not (self._is_ended or protocol.is_busy or self._is_reading):
            if protocol.in_doubt:
                if not self._pursue_doubt():
                    if not self._grace.is_running:
                        self._give_up()
                    return
            elif (exchange := self.queue.take_next()) is not None:
                self._begin(exchange, self._loop.time())
            else:
                return

    def _begin(self, exchange: Exchange, now: float) -> None:
        """Send *exchange* in its turn."""
        self._outstanding = exchange
        self._protocol.send(exchange.text)
        exchange.is_on_wire = True
        self._flush(_TURN, now, exchange)
        self._began_at = now
        self._give_time(now)
        if exchange.on_sent is not None:
            exchange.on_sent()

    def _flush(self, way: Way, now: float, exchange: Exchange | None = None) -> None:
        if data := self._protocol.bytes_to_send():
            goes_on = way is _GOES_ON
            self.lines_sent += not goes_on
            if self._telling.is_heard and self._port.transport is not None:
                self._telling.tell(Sent(data, exchange.number if exchange is not None else None, way))
            self._port.write(data, now, goes_on=goes_on)

    def _give_time(self, begin: float) -> None:
        patience_s = self._protocol.patience_s
        self._patience_s = self._answer_timeout_s if patience_s is None else patience_s
        self._deadline.put_off_to(begin + self._patience_s)

    def _take_events(self, now: float) -> None:
        # Nothing new is sent until every event is dealt with: a turn that began in between would get their answers.
        self._is_reading = True
        try:
            for event in self._protocol.events():
                if self._telling.is_heard and not isinstance(event, GoesOn):
                    self._telling.tell(Noticed.of(event))
                if isinstance(event, TurnOver):
                    self._turn_is_over(event, now)
                else:
                    self._handle(event, now)
        finally:
            self._is_reading = False

    def _handle(self, event: Event, now: float) -> None:
        if isinstance(event, GoesOn):
            self._give_time(now)
        elif isinstance(event, LateEnding):
            self._stats.late_answers += 1
            self._log.tell(logging.INFO, "the answer to %r came late", event.sent)
            self._doubt.late_answer_came()
            if self._doubtful is not None and self._doubtful.text == event.sent:
                self._end(self._doubtful, event.outcome)
        elif isinstance(event, InStep):
            self._end_doubt()
        elif isinstance(event, HoldOver):
            self._doubt.begin()
        elif not isinstance(event, MarkerSpent):
            self._ensure_doubt_is_pursued()
            self._on_event(event)

    def _turn_is_over(self, outcome: TurnOver, now: float) -> None:
        exchange, self._outstanding = self._outstanding, None
        if isinstance(outcome, TurnLost):
            self._stats.lost_turns += 1
        else:
            self._stats.answered(now - self._began_at)
        if self._protocol.in_doubt:
            self._doubt.begin()
        if exchange is not None:
            self._doubt.exchange_ended()
            self._end(exchange, outcome)

    def _end(self, exchange: Exchange, outcome: TurnOver) -> None:
        if exchange.lane is _STOP and not self.queue.is_admitted:
            self._unproved.append((exchange, outcome))
        else:
            exchange.end(outcome)

    # Doubt ----------------------------------------------------------------------------------------------------------

    def _ensure_doubt_is_pursued(self) -> None:
        doubt = self._doubt
        is_needed = self._protocol.in_doubt and not (doubt.is_pursued or doubt.markers_left or doubt.is_babble)
        if is_needed and not self._protocol.is_busy:
            doubt.begin()

    def _pursue_doubt(self) -> bool:
        """Send the next thing that helps to get in step; False when there is nothing left to try."""
        doubt, stop, now = self._doubt, self.queue.first_stop(), self._loop.time()
        if stop is not None and not stop.times_ahead:
            doubt.stop_waits()
        if not doubt.markers_left or self._port.is_stuck:
            return False
        if self._protocol.held is not None:
            if stop is None:
                return False
            doubt.marker_goes()
            self._send_ahead(stop, now)
        elif stop is not None and doubt.may_send_ahead:
            # In turn with the markers, for half a line in the device's buffer may spoil either; the exchange itself
            # follows when in step.
            doubt.stop_goes_ahead()
            self._send_ahead(stop, now)
        else:
            doubt.marker_goes()
            self._protocol.send_marker()
            self._flush(Way.MARKER, now)
        self._give_time(now)
        return True

    def _send_ahead(self, stop: Exchange, now: float) -> None:
        stop.times_ahead += 1
        self._protocol.send_ahead(stop.text)
        self._flush(Way.AHEAD, now, stop)

    def _end_doubt(self) -> None:
        self._stats.resynchronisations += 1
        self._doubt.end()
        self._grace.cancel()
        self._fail_doubtful()
        if self._in_step is not None and not self._in_step.done():
            self._in_step.set_result(None)

    def _give_up(self) -> None:
        """Tell everyone who waits why there is no answer. What is asked next begins anew."""
        if (hold := self._protocol.held) is not None:
            self.fail_waiting(partial(self._failures.hold, hold), but=self._spares)
        elif (stranger := self._protocol.stranger(time_is_over=True)) is not None:
            self.fail_waiting(partial(self._failures.stranger, stranger), but=self._spares)
        elif self._doubt.is_babble:
            self.fail_waiting(partial(self._failures.babble, self._doubt.times_in_vain), but=self._spares)
        else:
            self._on_silence()
            self.fail_waiting(self._failures.silence, but=self._spares)

    def fail_waiting(
        self,
        make_error: Callable[[Exchange | None], CompaxError],
        *,
        but: Callable[[Exchange], bool] = lambda _: False,
    ) -> None:
        """Fail everything that waits, the opening too; those for which *but* holds are queued anew."""
        self._grace.cancel()
        self._doubt.give_up()
        waiting = [exchange for exchange in (self._doubtful, self._outstanding) if exchange is not None]
        waiting += [exchange for exchange, _ in self._unproved] + self.queue.take_all()
        self._outstanding = self._doubtful = None
        self._unproved.clear()
        for exchange in waiting:
            if but(exchange):
                exchange.begin_anew()
                self.queue.put(exchange)
            else:
                exchange.fail(make_error)
        if self._in_step is not None and not self._in_step.done():
            self._in_step.set_exception(make_error(None))

    def _fail_doubtful(self) -> None:
        if self._doubtful is not None:
            exchange, self._doubtful = self._doubtful, None
            hold = self._protocol.held
            exchange.fail(partial(self._failures.hold, hold) if hold else self._failures.timeout)

    # Time -----------------------------------------------------------------------------------------------------------

    def _time_is_up(self) -> None:
        was_busy = self._protocol.is_busy
        if not was_busy:
            return
        now = self._loop.time()
        self._protocol.time_ran_out()
        self._flush(_GOES_ON, now)
        self._take_events(now)
        if self._protocol.is_busy:  # that was a pause, and it goes on
            self._give_time(now)
        elif self._outstanding is not None:
            self._give_outstanding_up(self._outstanding)
        self.pump()

    def _give_outstanding_up(self, exchange: Exchange) -> None:
        """Give up waiting for the answer to *exchange*: from now on it is late."""
        self._stats.timeouts += 1
        self._outstanding = None
        self._log.tell(logging.WARNING, "no answer to %r within %.3g s", exchange.text, self._patience_s)
        exchange.is_late, exchange.patience_s = True, self._patience_s
        self._doubtful = exchange
        exchange.received = self._history.received_since_sent()
        if not exchange.settles_late:
            self._fail_doubtful()
        self._doubt.begin()
        if self._protocol.held is not None:
            self._grace.put_off(self._answer_timeout_s)
