"""One control as callers hold it: connect, receive, send, drip-feed, ask, close."""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable, Iterable
from functools import partial
from typing import Unpack

from ..errors import ConnectionLostError, InvalidCommandError
from ..escaping import shown
from ..link.contract import Event
from ..motion.events import EventHub, EventStream
from ..motion.open_device import OpenDevice
from .asking import Asking
from .collecting import Collecting
from .events import Overheard, Printed, ReaderOff, ReaderOn
from .facts.data_files import DataKind
from .language.program_file import ProgramFile
from .line import ControlLine
from .line_url import profile_for
from .manners import HowToReceive, HowToSend, Manner, OnOperator, ReceivingManner, check_flag
from .preparing import DataSource, Prepared, ProgramSource, prepare_data, prepare_programs
from .profiles import Profile
from .protocol_events import Overheard as OverheardOnLine
from .protocol_events import Printed as PrintedOnLine
from .protocol_events import ReaderOff as ReaderOffOnLine
from .protocol_events import ReaderOn as ReaderOnOnLine
from .receiving import Receiving
from .reports import TransferReports
from .sending import Sending
from .settings import ControlSettings
from .transfer import Kind, Received, Sent, Transfer
from .transferring import Transferring
from .variables import VariableWriter
from .watching import Watching

__all__ = ["Control"]

_log = logging.getLogger("compax_aio.haas")


class Control(Asking, OpenDevice[ControlLine]):
    """
    One control, open; made by :func:`compax_aio.haas.connect`.

    One transfer at a time goes over its line. It begins with the call, and somebody has to press SEND or RECV at the
    control: what to press, ``transfer.progress()`` and *on_operator* say.

    Attributes:
        name: For errors, logs and results.
        profile: How it is set up.
    """

    def __init__(self, name: str, profile: Profile, settings: ControlSettings, url: str) -> None:
        self.name = name
        self.profile = profile_for(url, profile)
        self._loop = asyncio.get_running_loop()
        self._events = EventHub()
        self._line = ControlLine(name, self.profile, settings, **self._tells)
        self._reports = TransferReports(name, self.profile, self._line.link)
        self._transferring: Transferring[Received] | Transferring[Sent] | None = None
        self._collecting = Collecting(self._line, self._transfer_task)
        self._watching = Watching(self._collecting)
        self._writer = VariableWriter(self._collecting, self._events.publish)

    def __repr__(self) -> str:
        return f"<Control {self.name} {self.profile.name} {'open' if self.is_open else 'closed'}>"

    # Receiving ------------------------------------------------------------------------------------------------------

    def receive_program(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """
        Receive one program: the operator chooses it and presses SEND; it is listened for from now on.

        Args:
            how: ``archive`` keeps what comes, as it comes: in a file, which has ``.incomplete`` at its end until it is
                whole; or in a folder, where it gets a name by its number and the time. ``verify=True`` receives it
                twice, and compares byte for byte: SEND is pressed twice. ``accept_damaged=True`` takes it although it
                is known to be damaged, or lacks its last ``%``. ``on_operator`` is called with what has to be done at
                the control. ``operator_timeout_s`` and ``silence_timeout_s`` stand for those of the settings.

        Returns:
            A :class:`Transfer`; awaiting it gives what :class:`Received`.

        Raises:
            InvalidCommandError: Another transfer is under way, no files go over this line, or an argument is none.

        Awaiting the transfer raises AnswerTimeoutError if nobody presses SEND, or the control falls silent in the
        middle; UnexpectedAnswerError if what came is damaged, or no program; CommandRejectedError if the control
        cancels (XMODEM); ConnectionLostError if the line is lost, for it is never resumed; InvalidCommandError if the
        archive cannot be written. Each has the :class:`TransferAccount` as ``error.transfer``.
        """
        return self._receive("program", how)

    def receive_programs(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """Receive all programs, in one pair of ``%``: ALL is chosen at the control; see :meth:`receive_program`."""
        return self._receive("programs", how)

    def receive_parameters(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """Receive the parameters, with the N0 of the control; see :meth:`receive_program`."""
        return self._receive("parameters", how)

    def receive_settings(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """Receive the settings; see :meth:`receive_program`."""
        return self._receive("settings", how)

    def receive_offsets(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """Receive the offsets; see :meth:`receive_program`."""
        return self._receive("offsets", how)

    def receive_macros(self, **how: Unpack[HowToReceive]) -> Transfer[Received]:
        """Receive the macro variables, with N9999; see :meth:`receive_program`."""
        return self._receive("macros", how)

    # Sending --------------------------------------------------------------------------------------------------------

    def send_program(
        self,
        program: ProgramSource,
        *,
        protected: bool = False,
        semicolons: bool = False,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """
        Send one program, checked before a byte of it goes; the operator presses RECV.

        It is sent with one pair of ``%`` around it, its name in as many digits as the profile says, and the profile's
        ends of blocks. With DC codes and XMODEM the control says that RECV was pressed. Otherwise nobody does: it goes
        at once, or when what *on_operator* returns has been awaited. A control that is not ready for it may lose it.

        Args:
            program: A :class:`ProgramFile`, a program of one, text, bytes, or a :class:`~pathlib.Path`.
            protected: It may have a number that is protected, 8000 to 9999: probing and macros of the vendor.
            semicolons: It may have semicolons, each of which makes a blank line.
            how: ``verify=True`` has the control send it back, and compares: the operator presses SEND then.
                ``on_operator`` is called with what has to be done at the control; what it returns is awaited, if it can
                be. ``operator_timeout_s`` and ``silence_timeout_s`` stand for those of the settings.

        Returns:
            A :class:`Transfer`; awaiting it gives :class:`Sent`, which says what is proved: that it was sent, never
            that it is stored, unless it was read back.

        Raises:
            InvalidCommandError: Another transfer is under way, no files go over this line, or an argument is none.

        Awaiting the transfer raises InvalidCommandError, with all errors in the program, before a byte of it is sent;
        AnswerTimeoutError if nobody presses RECV, or the control takes nothing more; CommandRejectedError if it
        cancels (XMODEM); UnexpectedAnswerError if it damages each repetition of a block, or sends back something else
        than it was sent; ConnectionLostError if the line is lost, for it is never resumed. Each has the
        :class:`TransferAccount` as ``error.transfer``.
        """
        return self._send_programs([program], "program", Manner(**how), protected=protected, semicolons=semicolons)

    def send_programs(
        self,
        programs: Iterable[ProgramSource] | ProgramSource,
        *,
        protected: bool = False,
        semicolons: bool = False,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """Send several programs, in one pair of ``%``, or a file that has several; see :meth:`send_program`."""
        if isinstance(programs, ProgramFile | str | bytes | os.PathLike):
            programs = [programs]
        elif not isinstance(programs, Iterable):
            raise InvalidCommandError(f"programs are several, not {shown(programs)}", hint="give them in a list")
        return self._send_programs(
            list(programs), "programs", Manner(**how), protected=protected, semicolons=semicolons
        )

    def drip_feed(
        self,
        program: ProgramSource,
        *,
        semicolons: bool = False,
        on_operator: OnOperator | None = None,
        operator_timeout_s: float | None = None,
    ) -> Transfer[Sent]:
        """
        Feed a program that the control runs while it comes (DNC): nothing of it is stored, and it needs no name.

        It begins at once, or when what *on_operator* returns has been awaited: the control must wait for it. It goes as
        fast as the machine takes it, which may hold it for long. It is never resumed: if it ends in the middle, the
        machine stops where it is, and the operator restarts.

        Raises and returns as :meth:`send_program`.
        """
        manner = Manner(on_operator=on_operator, operator_timeout_s=operator_timeout_s)
        return self._send_programs([program], "drip feed", manner, protected=True, semicolons=semicolons)

    def send_settings(
        self,
        file: DataSource,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """
        Send settings. A file whose values were changed goes without its N0: :meth:`DataFile.with_values` takes it out.

        Data are loaded even where the control raises an alarm. Settings of the port take effect as well: then this
        line may not be usable any more with this profile. See :meth:`send_program`.
        """
        return self._send_data(file, DataKind.SETTINGS, Manner(**how))

    def send_offsets(
        self,
        file: DataSource,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """Send offsets; as :meth:`send_settings`."""
        return self._send_data(file, DataKind.OFFSETS, Manner(**how))

    def send_macros(
        self,
        file: DataSource,
        *,
        force: bool = False,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """
        Send macro variables; as :meth:`send_settings`.

        Args:
            file: With N9999, without N0.
            force: It may lack N9999.
            how: See :class:`HowToSend`.
        """
        return self._send_data(file, DataKind.MACROS, Manner(**how), force=force)

    def send_parameters(
        self,
        file: DataSource,
        *,
        i_know_it_takes_effect: bool = False,
        **how: Unpack[HowToSend],
    ) -> Transfer[Sent]:
        """
        Send parameters, byte for byte as this very control has sent them, with their N0; as :meth:`send_settings`.

        They are loaded even if the control raises an alarm, for instance because its N0 is wrong; wrong ones can damage
        the machine.

        Args:
            file: As it was received; it cannot be edited.
            i_know_it_takes_effect: Must be said.
            how: See :class:`HowToSend`.
        """
        return self._send_data(file, DataKind.PARAMETERS, Manner(**how), i_know_it_takes_effect=i_know_it_takes_effect)

    @property
    def transfer(self) -> Transfer[Received] | Transfer[Sent] | None:
        """The transfer under way, or the last one; None: there was none."""
        return None if self._transferring is None else self._transferring.transfer

    def reset_was_pressed(self) -> None:
        """
        Say that RESET was pressed at the control, so that it does not wait for the rest of a file any more.

        When a file was not sent to its end, over a line that has no sign for that, the control may still read it, and
        would take a question for a part of the program. So nothing is asked until this is said, or until a file that
        comes, or goes, to its end has shown it. With XMODEM the control is told, and nobody has to say it.
        """
        self._line.may_wait_for_rest = False

    # How transfers are made -----------------------------------------------------------------------------------------

    def _receive(self, kind: Kind, how: HowToReceive) -> Transfer[Received]:
        manner = ReceivingManner(**how)
        after = self._before(f"receiving the {kind}")
        publish = self._events.publish
        self._transferring = receiving = Receiving(self._line, kind, manner, publish=publish, after=after)
        return receiving.transfer

    def _send_programs(
        self, programs: list[ProgramSource], kind: Kind, manner: Manner, *, protected: bool, semicolons: bool
    ) -> Transfer[Sent]:
        prepare = partial(
            prepare_programs,
            programs,
            kind,
            self.profile,
            protected=check_flag("protected", protected),
            semicolons=check_flag("semicolons", semicolons),
            max_bytes=self._line.settings.max_bytes,
        )
        return self._send(kind, prepare, manner)

    def _send_data(
        self,
        file: DataSource,
        kind: DataKind,
        manner: Manner,
        *,
        force: bool = False,
        i_know_it_takes_effect: bool = False,
    ) -> Transfer[Sent]:
        prepare = partial(
            prepare_data,
            file,
            kind,
            self.profile,
            force=check_flag("force", force),
            i_know_it_takes_effect=check_flag("i_know_it_takes_effect", i_know_it_takes_effect),
            max_bytes=self._line.settings.max_bytes,
        )
        return self._send(kind.value, prepare, manner)

    def _send(self, kind: Kind, prepare: Callable[[], Prepared], manner: Manner) -> Transfer[Sent]:
        after = self._before(f"sending the {kind}")
        publish = self._events.publish
        self._transferring = sending = Sending(self._line, kind, manner, prepare=prepare, publish=publish, after=after)
        return sending.transfer

    def _before(self, what: str) -> asyncio.Task[None] | None:
        """Refuse a transfer that cannot be; return what has to end before another one begins."""
        if self.profile.synchronization is None:
            raise self._reports.no_files(what)
        before = self._transferring
        if before is None or before.task.done():
            return None
        if not before.transfer.done():
            raise self._reports.active(what, before.transfer.description)
        return before.task

    # Events and life ------------------------------------------------------------------------------------------------

    def events(self) -> EventStream:
        """Follow what happens from now on: printed text (DPRNT), transfers, lost lines; an asynchronous iterator."""
        return self._events.stream()

    @property
    def settings(self) -> ControlSettings:
        """How long things may take on this line."""
        return self._line.settings

    async def close(self) -> None:
        """
        Cancel the transfer under way, and close the line; harmless when repeated.

        It is carried through even if the caller is cancelled meanwhile.
        """
        await super().close()

    async def _end(self) -> None:
        try:
            if self._transferring is not None and not self._transferring.task.done():
                await self._transferring.end()
        finally:
            self._watching.end()

    async def _open(self, url: str) -> None:
        await self._line.open(url)

    # What the line tells --------------------------------------------------------------------------------------------

    async def _greet(self) -> None:
        """Ask nothing: a control that collects no data answers nothing."""

    def _on_event(self, event: Event) -> None:
        if self._transferring is not None and self._transferring.note(event):
            return
        now = self._loop.time()
        if isinstance(event, PrintedOnLine):
            self._collecting.note_printed()
            self._events.publish(Printed(self.name, now, event.text, event.is_damaged))
        elif isinstance(event, OverheardOnLine):
            self.stats.strays += 1
            self._collecting.note_overheard()
            self._events.publish(Overheard(self.name, now, event.text))
        elif isinstance(event, ReaderOnOnLine):
            self._events.publish(ReaderOn(self.name, now))
        elif isinstance(event, ReaderOffOnLine):
            self._events.publish(ReaderOff(self.name, now))

    def _transfer_task(self) -> asyncio.Task[None] | None:
        return None if self._transferring is None else self._transferring.task

    def _on_lost(self, error: ConnectionLostError) -> None:
        super()._on_lost(error)
        self._watching.end(error)
