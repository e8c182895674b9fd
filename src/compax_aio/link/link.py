"""
One line from its opening to its end: greeted before it is used, opened again when it is lost.

The link knows no device: what bytes mean is told to it by a :class:`~compax_aio.link.contract.DeviceProtocol`. What
waits on a line that is lost, if it asks something, waits on; if it tells something, it fails and is never sent again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any, Final, cast

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, TransportError
from .attempts import Attempts
from .contract import DeviceProtocol, Event, Hold, Lane, TurnOver
from .exchanges import Exchange
from .failures import Failures
from .patience import Patience
from .port import Port
from .reconnecting import Reconnecting
from .seldom import Seldom
from .silence import Silence
from .stats import LinkStats
from .taps import Closed, Lost, Ready, Resumed
from .telling import Telling
from .turns import Turns
from .wire import WireHistory

__all__ = ["Link", "LinkStats"]

_GREETING: Final = Lane.GREETING
"""What each exchange is compared with; to find a member in its enum costs CPython 3.11 as much as some twenty steps."""


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
        marker_timeout_s: How long a marker takes that is not answered; None: as long as an answer may.
        advice_on_silence: What a person should look at when nobody answers at all.
        about: Says what device is there, and how it is talked to, for those who record the line.
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
        marker_timeout_s: float | None = None,
        advice_on_silence: str = "check power, cable, port, baud rate and handshake",
        about: Callable[[], Mapping[str, object]] | None = None,
    ) -> None:
        self.stats = LinkStats()
        self.history = WireHistory()
        self._protocol = protocol
        self._log = Seldom(logging.getLogger("compax_aio.link"), name)
        self._failures = Failures(
            name,
            self.history,
            answer_timeout_s=answer_timeout_s,
            resync_attempts=resync_attempts,
            marker_timeout_s=answer_timeout_s if marker_timeout_s is None else marker_timeout_s,
            advice_on_silence=advice_on_silence,
        )
        self._on_lost = on_lost
        self._reconnecting = reconnecting
        self._loop = asyncio.get_running_loop()
        self._telling = Telling(name, about)
        self._port = Port(name, self.stats, self.history, self._telling)
        self._silence = Silence(self._port, reconnecting, self._failures)
        self._turns = Turns(
            protocol,
            name=name,
            port=self._port,
            stats=self.stats,
            failures=self._failures,
            history=self.history,
            answer_timeout_s=answer_timeout_s,
            resync_attempts=resync_attempts,
            on_event=on_event,
            on_silence=self._note_silence,
            spares=self._came_during_attempt,
            telling=self._telling,
        )
        self._url = ""
        self._is_closing = self._is_lost = False
        self._attempts = Attempts(
            self,
            turns=self._turns,
            stats=self.stats,
            telling=self._telling,
            reconnecting=reconnecting,
            greet=greet,
        )
        self._patience = Patience(reconnecting, self._attempts)

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
        await self._attempts.make(self._url, self._check_there)

    def _check_there(self) -> None:
        if self._port.transport is None:
            raise self._lost(None)

    async def close(self) -> None:
        """Close the line; what still waits fails with ConnectionLostError. Takes at most a second or two."""
        self._is_closing = True
        self._turns.end()
        if self._reconnecting is not None:
            await self._reconnecting.end()
        await self._close_port()
        self._turns.fail_waiting(self._lost)
        self._telling.tell(Closed())

    async def _close_port(self) -> None:
        if not await self._port.close():
            self.connection_lost(None)

    @property
    def is_open(self) -> bool:
        """Whether there is a line, and who is on it was looked at."""
        return self._port.transport is not None and self._turns.queue.is_admitted and not self.is_over

    @property
    def is_over(self) -> bool:
        """Whether the line is closed, or lost and not opened again."""
        return self._is_closing or self._is_lost

    # What getting a lost line back needs ----------------------------------------------------------------------------

    async def reopen(self) -> None:
        """Open the line again, once; raises CompaxError, with nothing left open, if that fails."""
        try:
            await self._close_port()
            await self._connect()
        except BaseException as error:
            if isinstance(error, CompaxError) and not isinstance(error, TransportError):
                self._turns.fail_waiting(partial(self._failures.refused, error), but=self._came_during_attempt)
            await self._close_port()
            self._fail_what_tells(error if isinstance(error, CompaxError) else None)
            raise

    def admit(self) -> None:
        """Let everything that waits go over the line."""
        if self._attempts.count > 1:
            self.stats.reconnects += 1
        self._telling.tell(Ready(self._attempts.count))
        self._turns.admit()

    def lose_patience(self) -> None:
        """Fail what waits for the lost line, but for what was asked since the last attempt: it waits for the next."""
        self._turns.fail_waiting(self._lost, but=self._waits_for_line)

    def give_up(self, error: CompaxError) -> None:
        """Take note that the line is lost for good."""
        self._is_lost = True
        loss = self._lost(None, error)
        self._turns.fail_waiting(lambda exchange: self._lost(exchange, error))
        self._telling.tell(Closed())
        self._on_lost(loss)

    @property
    def lines_sent(self) -> int:
        """Everything that was written on this line, markers included; compare it, to see whether the line was used."""
        return self._turns.lines_sent

    @property
    def times_opened(self) -> int:
        """How often the line has been opened, or tried to: tell it to :meth:`check_not_lost` later."""
        return self._attempts.count

    def check_not_lost(self, since: int) -> None:
        """Raise ConnectionLostError if there is no line, or another one than when it was opened *since* times."""
        if self.is_over or self._port.transport is None or self._attempts.count != since:
            raise self._lost(None)

    @property
    def is_free(self) -> bool:
        """Whether a line that is queued now would be written at once, unless it is a read that is held back."""
        return self.is_open and self._turns.is_free

    @property
    def unsent_bytes(self) -> int:
        """How many bytes that were written have not left yet, as far as can be told."""
        return self._port.unsent_bytes

    @property
    def bytes_per_s(self) -> float | None:
        """How fast the line sends, where that is known; set it before it is asked what is unsent."""
        return self._port.bytes_per_s

    @bytes_per_s.setter
    def bytes_per_s(self, value: float | None) -> None:
        self._port.bytes_per_s = value

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
        party: str = "",
        settles_late: bool = False,
        survives_loss: bool = False,
        on_sent: Callable[[], None] | None = None,
    ) -> asyncio.Future[TurnOver]:
        """
        Queue one line; if the line is free it is written before this returns.

        Args:
            text: The line without its end sign; checked by the caller.
            lane: What goes first. Identical lines that wait in ``Lane.READ`` share one exchange.
            party: Whose it is, where several share the line: they take turns.
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
        survives_loss = survives_loss and lane is not _GREETING
        attempt, now = self._attempts.count, self._loop.time()
        exchange = Exchange(text, lane, settles_late, survives_loss, attempt, now, on_sent, party, [waiter])
        if self._telling.is_heard:
            self._telling.asked(exchange, waiter)
        if self._silence.error is not None and not self.is_over:
            if lane is Lane.STOP:
                self._turns.say_ahead(exchange)  # it may be heard, although nothing comes back
            self._renew(self._silence.error)
        waits_for_line = survives_loss and self._reconnecting is not None
        if (waits_for_line or self._port.transport is not None) and not self.is_over:
            self._turns.put(exchange)
        else:
            waiter.set_exception(self._lost(exchange))
        return waiter

    def preempt(self, text: str) -> asyncio.Future[None]:
        """
        Write *text*, which the device heeds at any time, at once; what is outstanding is over by it.

        Returns:
            A future that is done when the line is in step again; it raises CompaxError if that fails.

        Raises:
            ConnectionLostError: There is no line; nothing was sent.
        """
        if self._port.transport is None or self.is_over:
            raise self._lost(None)
        return self._turns.preempt(text)

    def hold_reads(self, for_s: float) -> None:
        """Let what waits in ``Lane.READ`` wait on, at most *for_s* from now; what is on the wire goes on."""
        self._turns.hold_reads(for_s)

    def hold(self, party: str) -> None:
        """Let what *party* has to say wait on, stops too, until :meth:`release`; what is on the wire goes on."""
        self._turns.queue.held.add(party)

    def release(self, party: str) -> None:
        """Let what *party* has to say go on; harmless when it is not held."""
        self._turns.queue.held.discard(party)
        self._turns.pump()

    def release_reads(self) -> None:
        """Let reads go on; harmless when they are not held back."""
        self._turns.release_reads()

    def resume(self) -> None:
        """Take a person's word that what the line is :attr:`held` for can do no harm, and get in step; else nothing."""
        self._telling.tell(Resumed())
        self._turns.resume()

    def extra_info(self, name: str) -> Any:
        """Return what the transport says of itself, as ``serial``, its port; None if it says nothing of it."""
        return self._port.extra_info(name)

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
        self._turns.line_opened()

    def data_received(self, data: bytes) -> None:
        """Pass bytes in, events out."""
        if self._port.transport is None:  # any more
            return
        self._port.received(data, self._turns.receive)

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail what tells something: nobody can say any more what becomes of it. What asks may wait for the line."""
        self._port.ended()
        self._telling.tell(Lost(None if exc is None else str(exc) or type(exc).__name__))
        self._silence.forget()
        self._turns.line_lost()
        was_admitted, self._turns.queue.is_admitted = self._turns.queue.is_admitted, False
        self._fail_what_tells(exc)
        if self._is_closing or not was_admitted:
            return
        error = self._lost(None, exc)
        if self._reconnecting is not None:
            self._log.tell(logging.WARNING, "%s", error.what)
            self._reconnecting.begin(self, error, at_once=False)
        else:
            self._is_lost = True
            self._on_lost(error)

    def _fail_what_tells(self, cause: Exception | None) -> None:
        self._turns.fail_waiting(lambda exchange: self._lost(exchange, cause), but=self._waits_for_line)

    def _waits_for_line(self, exchange: Exchange) -> bool:
        return not self.is_over and self._patience.has(exchange)

    def _came_during_attempt(self, exchange: Exchange) -> bool:
        """Whether it was asked on a line that is lost while that was being opened: the next attempt is its first."""
        is_attempt = not self._turns.queue.is_admitted
        return is_attempt and self._waits_for_line(exchange) and self._patience.is_new(exchange)

    def _note_silence(self) -> None:
        if self._turns.queue.is_admitted:
            self._silence.note()

    def _renew(self, silence: AnswerTimeoutError) -> None:
        """Open the line anew, which may lead nowhere."""
        assert self._reconnecting is not None
        self._silence.forget()
        self._turns.queue.is_admitted = False
        self._port.let_go()
        self._reconnecting.begin(self, self._lost(None, silence), at_once=True)

    def _lost(self, exchange: Exchange | None, cause: Exception | None = None) -> ConnectionLostError:
        comes_back = self._reconnecting is not None and not self.is_over
        return self._failures.loss(
            exchange, cause, is_closing=self._is_closing, comes_back=comes_back, hold=self._protocol.held
        )
