"""One cutter as callers hold it: connect, ask, cut, stop, close."""

from __future__ import annotations

import asyncio
import logging

from ..errors import (
    ConnectionLostError,
    InvalidCommandError,
    MoveInDoubtError,
)
from ..escaping import shown
from ..link.contract import Event, Lane
from ..motion.events import (
    DriveEvent,
    EventHub,
    EventStream,
    Stopped,
    UnexpectedText,
)
from ..motion.open_device import OpenDevice
from .aborting import Aborting
from .checking import Sheet
from .cut import AnyHandshake, Cut, OnCancel, check_manner
from .cutting import Cutting, Order
from .events import CutterReset
from .facts.reports import OUTPUT_INSTRUCTIONS
from .feed import JobSource, as_source
from .greeting import Greeting
from .instructions import AskBufferSize, encode
from .line import CutterLine
from .profiles import Profile
from .protocol_events import SettingsLost, Stray
from .replies import CutterStatus, decode_bytes
from .reports import CutReports
from .settings import CutterSettings
from .words import reset_words

__all__ = ["Cutter"]

_log = logging.getLogger("compax_aio.camm1")


class Cutter(OpenDevice[CutterLine]):
    """
    One cutter, open; made by :func:`compax_aio.camm1.connect`.

    Attributes:
        name: For errors, logs and results.
        profile: Which machine it is.
    """

    def __init__(self, name: str, profile: Profile, settings: CutterSettings) -> None:
        self.name = name
        self.profile = profile
        self._events = EventHub()
        self._loop = asyncio.get_running_loop()
        self._line = CutterLine(name, profile, settings, **self._tells)
        self._greeting = Greeting(self._line)
        self._reports = CutReports(self._line)
        self._cutting: Cutting | None = None
        self._doubt: str | None = None

    def __repr__(self) -> str:
        return f"<Cutter {self.name} {self.profile.name} {'open' if self.is_open else 'closed'}>"

    # Cutting --------------------------------------------------------------------------------------------------------

    def cut(
        self,
        job: JobSource,
        *,
        handshake: AnyHandshake = "auto",
        check: bool = True,
        sheet: Sheet | None = None,
        on_cancel: OnCancel = "abort",
    ) -> Cut:
        """
        Cut a job, streamed through the cutter's buffer; it is on its way at once.

        Device control in the job (``ESC``) and instructions that answer (``OA`` and so on) are left out and told; long
        lists of coordinates are sent as several that cut the same line; the tool is lifted at the end.

        Args:
            job: Text, bytes, a :class:`~pathlib.Path`, or an asynchronous iterator of pieces of any size, which may
                have no end.
            handshake: How the buffer is kept from overflowing: ``"software"`` (``.B``), ``"xonxoff"``, ``"enq1"``,
                ``"enq2"``, ``"hardwire"``; ``"auto"`` takes ``"software"``, for a cutter that is connected answers.
            check: Refuse a job with errors before a byte of it is sent; of an iterator each piece before it is sent.
            sheet: What lies in the machine, for the check.
            on_cancel: What cancelling the job does: ``"abort"``, or ``"finish"``: it is cut all the same.

        Returns:
            A :class:`Cut`; awaiting it returns when the job is proved to be cut.

        Raises:
            InvalidCommandError: That is no job, or not how one is cut; nothing was sent.
            MoveActiveError: Another job is under way.
            MoveInDoubtError: What became of an earlier job is not known; :meth:`reconcile` first.

        Awaiting the job raises InvalidCommandError if it has errors, MoveActiveError if the cutter has data in its
        buffer already, CommandRejectedError if it does not take the handshake, MoveStoppedError if it was aborted here
        or at the machine, MoveTimeoutError if the machine takes nothing for ``stall_timeout_s`` and is not paused,
        DriveFaultError if the machine tells an error that ruins the job, and MoveInDoubtError if nobody knows what was
        cut. Each has the :class:`CutAccount` of the job as ``error.job``.
        """
        check_manner(handshake, on_cancel)
        if type(check) is not bool:
            raise InvalidCommandError(f"check is True or False, not {shown(check)}")
        source = as_source(job)
        if self._doubt is not None:
            raise self._reports.refused(source.name, self._doubt)
        before = self._cutting
        if before is not None and before.is_under_way and not before.cut.done():
            raise self._reports.active(source.name)
        order = Order(
            source=source,
            description=source.name,
            handshake=handshake,
            check=check,
            sheet=sheet,
            on_cancel=on_cancel,
        )
        after = None if before is None or before.task.done() else asyncio.wait([before.task])
        self._cutting = Cutting(self._line, order, publish=self._publish, on_doubt=self._take_doubt, after=after)
        return self._cutting.cut

    async def stop(self) -> CutterStatus:
        """
        Stop the machine (``ESC.K``): what its buffer holds is dropped, the vector under way is cut, the tool lifted.

        A job of this end is aborted by it. Nothing is in doubt afterwards.

        Returns:
            The status, with an empty buffer.

        Raises:
            CompaxError: The cutter has not shown that it stopped; look at the machine.
        """
        if (cutting := self._cutting) is not None and cutting.is_under_way:
            await cutting.cut.abort()
            status = await self._line.status(Lane.STOP)
        else:
            status = await Aborting(self._line).carry_through()
        self._doubt = None
        self._events.publish(Stopped(self.name, self._loop.time()))
        return status

    async def reconcile(self) -> CutterStatus:
        """
        Take the machine as it is after a job of which nobody knows what was cut: look at the sheet first.

        Nothing of that job is sent again. The cutter must have cut what it had left; the tool is lifted.

        Returns:
            The status, with an empty buffer.

        Raises:
            MoveInDoubtError: It still has data in its buffer: wait until it is cut, or :meth:`stop` it.
            CompaxError: It does not answer.
        """
        if self._cutting is not None and not self._cutting.task.done():
            await asyncio.wait([self._cutting.task])
        status = await self._line.status(Lane.CONTROL)
        if not status.buffer_is_empty:
            raise MoveInDoubtError(
                "the cutter still has data in its buffer",
                device=self.name,
                received=str(status.number),
                hint="wait until it is cut; or stop(), which drops it and lifts the tool",
                exchanges=self._line.link.recent(),
            )
        status = await self._line.say(";PU;")
        await self._line.errors(Lane.CONTROL)
        self._doubt = None
        return status

    async def reset(self) -> None:
        """
        Reset what device control has set (``ESC.R``), and set up the line anew; data and errors stay (PNC-900 p. 21).

        Raises:
            MoveActiveError: A job is under way; nothing was sent.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: It may not be done.
        """
        self._refuse_in_job("ESC.R")
        await self._line.tell(reset_words(self.profile), what="the reset")

    @property
    def in_doubt(self) -> str | None:
        """Why nobody knows what was cut of an earlier job; None: that is known."""
        return self._doubt

    @property
    def job(self) -> Cut | None:
        """The job under way, or the last one; None: there was none."""
        return self._cutting.cut if self._cutting is not None else None

    # What is known of it --------------------------------------------------------------------------------------------

    @property
    def capacity_bytes(self) -> int | None:
        """Of its buffer: the most that it has said to be free; None until it was empty when asked."""
        return self._greeting.capacity_bytes

    @property
    def identity(self) -> str | None:
        """What it answers when it is asked who it is; None: it does not, or was not asked."""
        return self._greeting.identity

    @property
    def errors_found(self) -> tuple[int, ...]:
        """Errors of the line (``.E``) that it told when the line was opened, which has cleared them."""
        return self._greeting.errors_found

    # Asking ---------------------------------------------------------------------------------------------------------

    async def free_space(self) -> int:
        """
        Read how many bytes of the buffer are free (``.B``, PNC-1610 p. 28).

        Raises:
            UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: It was not told.
        """
        return await self._line.free_space()

    async def status(self) -> CutterStatus:
        """Read whether data is left, and whether it is paused (``.O``, PNC-1610 p. 29); raises as any query."""
        return await self._line.status()

    async def error(self) -> int:
        """
        Read the error of the line, 0 or 10 to 18, which clears it (``.E``, PNC-900 p. 21); raises as any query.

        Raises:
            MoveActiveError: A job is under way, which has to learn of errors itself.
        """
        self._refuse_in_job("ESC.E")
        return await self._line.error()

    async def buffer_size(self) -> int:
        """
        Read the size of the buffer (``.L``, PNC-900 p. 21); some machines answer only when it is empty.

        Raises:
            MoveActiveError: A job is under way, for which the answer would have to wait.
            UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: It was not told.
        """
        self._refuse_in_job("ESC.L")
        return await self._line.read(encode(AskBufferSize(), self.profile).decode(), decode_bytes)

    async def output(self, name: str) -> str:
        """
        Read what an output instruction answers, ``"OA"`` or another of :data:`OUTPUT_INSTRUCTIONS`, as it came.

        It waits in the buffer behind all data, and is answered when it is reached.

        Raises:
            InvalidCommandError: There is no such instruction; nothing was sent.
            MoveActiveError: A job is under way; nothing was sent.
            UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: It was not answered.
        """
        text = name.strip().rstrip(";").upper() if isinstance(name, str) else ""
        if text not in OUTPUT_INSTRUCTIONS:
            raise InvalidCommandError(
                f"{shown(name)} is no output instruction", hint=f"there are {', '.join(OUTPUT_INSTRUCTIONS)}"
            )
        self._refuse_in_job(f"{text};")
        return await self._line.ask(f"{text};", repeats=False)

    async def identify(self) -> str | None:
        """
        Ask the cutter who it is: ``.A`` if it has that (PNC-1610 p. 29), else ``OI;`` if its buffer is empty.

        Returns:
            What it answers; None if it has neither, or cannot be asked now.

        Raises:
            MoveActiveError: A job is under way.
            UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: It was not told.
        """
        self._refuse_in_job("the question who it is")
        self._greeting.identity = await self._greeting.ask_identity(Lane.READ) or self.identity
        return self.identity

    def _refuse_in_job(self, what: str) -> None:
        if self._cutting is not None and self._cutting.is_under_way:
            raise self._reports.active(what)

    # Events and life ------------------------------------------------------------------------------------------------

    def events(self) -> EventStream:
        """Follow what happens from now on: jobs, pauses, errors, lost lines; an asynchronous iterator."""
        return self._events.stream()

    @property
    def settings(self) -> CutterSettings:
        """What is known of this line."""
        return self._line.settings

    async def close(self) -> None:
        """
        Abort the job under way, or wait for it (``on_cancel="finish"``), and close the line; harmless when repeated.

        It is carried through even if the caller is cancelled meanwhile.

        Raises:
            CompaxError: The machine may not have stopped.
        """
        await super().close()

    async def _end(self) -> None:
        if (cutting := self._cutting) is not None and not cutting.task.done():
            await cutting.end()

    async def _open(self, url: str) -> None:
        await self._line.open(url)

    # What the line tells --------------------------------------------------------------------------------------------

    async def _greet(self) -> None:
        await self._greeting.meet()

    def _publish(self, event: DriveEvent) -> None:
        self._events.publish(event)

    def _take_doubt(self, why: str) -> None:
        self._doubt = why

    def _on_event(self, event: Event) -> None:
        now = self._loop.time()
        if isinstance(event, SettingsLost):
            reason = f"{event.text!r} came without its sign: it was switched off and on, or reset by somebody else"
            self._events.publish(CutterReset(self.name, now, reason))
            if self._cutting is not None:
                self._cutting.note_reset()
        elif isinstance(event, Stray):
            self.stats.strays += 1
            self._events.publish(UnexpectedText(self.name, now, event.text))

    def _on_down(self, error: ConnectionLostError) -> None:
        super()._on_down(error)
        if self._cutting is not None:
            self._cutting.note_lost(error)
