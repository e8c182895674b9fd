"""A person at the prompt: lines go out one by one, what the drive does unasked is told above what is being typed."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from io import StringIO
from typing import Final

from prompt_toolkit import PromptSession
from prompt_toolkit.formatted_text import ANSI, AnyFormattedText
from prompt_toolkit.input.typeahead import clear_typeahead
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.shortcuts import print_formatted_text
from rich.console import Console
from rich.text import Text

from ...compax.drive import Drive
from ...compax.events import ConnectionLost, ConnectionRestored, Fault
from ...compax.moves import Move
from ...errors import CompaxError, ConnectionLostError, InvalidCommandError
from ..in_doubt import may_go_on
from ..keyboard import forget_typed
from ..unasked import UnaskedText
from .completion import LineCompleter
from .language import Language, Order
from .replies import Reply, told_error, told_event, told_move
from .toolbar import Standing, toolbar
from .turns import Turns
from .underway import Underway
from .warned import Warnings
from .watching import Watching

__all__ = ["Session"]

_LEAVE: Final = frozenset({"exit"})
_YES: Final = frozenset({"y", "yes"})
_NO: Final = frozenset({"n", "no"})
_YELLOW: Final = "bold yellow"
_QUESTION: Final = (
    "Is everybody clear of it, and the hardware stop within reach? yes sends it, and asks no more in this session."
)
_HOW_TO_LEAVE: Final = "nothing runs that was started here; Ctrl-D or exit leaves"


class Session:
    """
    One conversation at a terminal.

    Args:
        drive: Which is talked to.
        prompt: Reads what is typed; its input and output are those of the terminal.
        title: What stands before the cursor.
        poll_s: Seconds between two looks at position and status; None: only when asked.
        may_move: Whether motion was allowed beforehand, so that the first one needs no yes.
    """

    def __init__(
        self, drive: Drive, prompt: PromptSession[str], *, title: str, poll_s: float | None, may_move: bool
    ) -> None:
        self._drive = drive
        self._prompt = prompt
        self._title = title
        self._poll_s = poll_s
        self._may_move = may_move
        self._underway = Underway()
        self._unasked = UnaskedText()
        self._language = Language(drive, self._underway)
        self._standing = Standing(is_open=drive.is_open)
        self._turns = Turns(self._replied, self._failed, self._dropped)
        self._watching = Watching(drive, self._tell)
        self._warnings = Warnings(self._tell)
        self._asked: list[Order] = []
        self._stop: asyncio.Task[None] | None = None
        self._tasks: asyncio.TaskGroup

    async def run(self) -> None:
        """Talk until the person leaves, then stop what was started here."""
        with self._interrupts_heeded(), self._warnings.instead_of_others():
            async with asyncio.TaskGroup() as tasks:
                self._tasks = tasks
                background = [
                    tasks.create_task(self._tell_events()),
                    tasks.create_task(self._turns.run()),
                    tasks.create_task(self._watching.run()),
                ]
                if self._poll_s is not None:
                    background.append(tasks.create_task(self._poll(self._poll_s)))
                try:
                    await self._read_lines()
                    await self._before_leaving()
                finally:
                    for task in background:
                        task.cancel()

    # Typing ---------------------------------------------------------------------------------------------------------

    async def _read_lines(self) -> None:
        completer, bindings = LineCompleter(self._language.vocabulary), self._bindings()
        while True:
            try:
                text = await self._prompt.prompt_async(
                    self._message,
                    completer=completer,
                    complete_while_typing=True,
                    key_bindings=bindings,
                    bottom_toolbar=self._toolbar,
                    handle_sigint=False,  # see _interrupts_heeded
                )
            except (EOFError, KeyboardInterrupt):
                return
            if not self._heed(text.strip()):
                return

    def _message(self) -> AnyFormattedText:
        return [("bold", f"{self._title}: move? yes/no> " if self._asked else f"{self._title}> ")]

    def _heed(self, text: str) -> bool:
        """Deal with what was typed, or with several lines that were pasted; returns whether there may be more."""
        asked, self._asked = self._asked, []
        if asked and text.lower() in _YES:
            self._may_move = True
            self._take(asked)
            return True
        for order in asked:
            self._dropped(order, "you did not say yes")
        if text.lower() in _LEAVE:
            return False
        if not asked or text.lower() not in _NO:
            self._take_lines([line for line in text.splitlines() if line.strip()])
        return True

    def _take_lines(self, lines: list[str]) -> None:
        """Take *lines* if all of them are understood, and if none moves the axis before that is allowed."""
        orders = []
        for line in lines:
            try:
                orders.append(self._understand(line))
            except InvalidCommandError as error:
                self._tell(told_error(error))
                if len(lines) > 1:
                    self._tell(Text("nothing of what was pasted was sent", "yellow"))
                return
        moving = [order.text for order in orders if order.can_move]
        if moving and not self._may_move:
            self._asked = orders
            self._forget_typed()
            self._tell(
                Text.assemble((f"{', '.join(moving)} can move the axis; nothing was sent. ", _YELLOW), _QUESTION)
            )
        else:
            self._take(orders)

    def _forget_typed(self) -> None:
        """Hear no answer to a question that nobody has seen: the rest of a paste, or what was typed ahead."""
        clear_typeahead(self._prompt.app.input)
        forget_typed()

    def _understand(self, line: str) -> Order:
        word, *words = line.split()
        if word.lower() != "watch":
            return self._language.understand(line)
        return Order(text=line.strip(), carry_out=partial(self._watching.order, words), is_said=False)

    def _take(self, orders: list[Order]) -> None:
        for order in orders:
            if order.is_stop:
                self._begin_stop()
            elif order.can_move and not self._drive.is_open:
                self._dropped(order, "the line to the drive is lost")
            elif order.is_said:
                self._turns.add(order)
            else:
                self._tasks.create_task(self._carry_out_here(order))
        self._redraw()

    async def _carry_out_here(self, order: Order) -> None:
        try:
            self._replied(order, await order.carry_out())
        except CompaxError as error:
            self._failed(order, error)

    def _bindings(self) -> KeyBindings:
        bindings = KeyBindings()

        @bindings.add("c-x", eager=True)
        def _(event: KeyPressEvent) -> None:  # noqa: ARG001
            self._begin_stop()

        @bindings.add("c-c", eager=True)
        def _(event: KeyPressEvent) -> None:  # noqa: ARG001
            self._interrupted()

        return bindings

    def _interrupted(self) -> None:
        """Do what Ctrl-C says: stop what moves because of us, else clear what is typed, else wait no longer."""
        buffer = self._prompt.default_buffer
        if self._underway:
            buffer.reset()
            self._begin_stop()
        elif buffer.text or self._asked:
            buffer.reset()
            self._drop_asked("you did not say yes")
        elif (given_up := self._turns.give_up()) is not None:
            self._tell(Text(f"{given_up.text}: no longer waited for; it may have been sent", "yellow"))
        elif self._stop is None:
            self._tell(Text(_HOW_TO_LEAVE, "dim"))
        self._redraw()

    # Carrying out ---------------------------------------------------------------------------------------------------

    def _replied(self, order: Order, reply: Reply) -> None:  # noqa: ARG002
        if reply.people is not None:
            self._tell(reply.people)
        if reply.move is not None:
            self._tasks.create_task(self._follow(reply.move))
        self._redraw()

    def _failed(self, order: Order, error: CompaxError) -> None:  # noqa: ARG002
        self._tell(told_error(error))

    def _drop_asked(self, why: str) -> None:
        asked, self._asked = self._asked, []
        for order in asked:
            self._dropped(order, why)

    def _dropped(self, order: Order, why: str) -> None:
        self._tell(Text(f"not sent: {order.text}; {why}", "yellow"))

    async def _follow(self, move: Move) -> None:
        """Tell how *move* ends."""
        try:
            reply = told_move(await move, self._drive.settings)
        except CompaxError as error:
            if may_go_on(move, line_is_there=self._drive.is_open):
                self._underway.note_unseen(move.description, asyncio.get_running_loop().time())
            self._tell(told_error(error))
        else:
            self._tell(reply.people or Text())
        self._redraw()

    def _begin_stop(self) -> None:
        self._turns.drop("a stop came first")
        self._drop_asked("a stop came first")
        if self._stop is None:
            self._stop = self._tasks.create_task(self._carry_out_stop())
            self._stop.add_done_callback(self._stop_done)
            self._redraw()

    async def _carry_out_stop(self) -> None:
        try:
            await self._language.stop()
        except CompaxError as error:
            self._tell(told_error(error))
            self._tell(Text("THE AXIS MAY STILL BE MOVING: use the stop in hardware", "bold red"))
        else:
            # Aside: what is pressed from now on is a stop of its own, though nobody says yet where the axis stands.
            self._tasks.create_task(self._tell_stopped())

    async def _tell_stopped(self) -> None:
        self._tell((await self._language.stopped()).people or Text())

    def _stop_done(self, task: asyncio.Task[None]) -> None:  # noqa: ARG002
        self._stop = None
        self._redraw()

    async def _before_leaving(self) -> None:
        """Stop what was started here, and say so, while there is still somebody to be told."""
        self._turns.drop("the shell was left")
        self._turns.give_up()
        if self._underway:
            self._tell(Text(f"leaving: {self._underway}, so it is stopped", "yellow"))
            self._begin_stop()
        if self._stop is not None:
            await asyncio.wait([self._stop])

    # What happens unasked -------------------------------------------------------------------------------------------

    async def _tell_events(self) -> None:
        async for event in self._drive.events():
            if isinstance(event, ConnectionLost):
                self._warnings.note_told(event.reason)
                self._standing.position = self._standing.status = None
                self._turns.drop("the line to the drive was lost", lambda order: order.can_move)
            if isinstance(event, Fault):
                self._standing.error = event.error
            if isinstance(event, ConnectionLost | ConnectionRestored):
                self._standing.is_open = isinstance(event, ConnectionRestored)
            if (text := told_event(event, self._unasked)) is not None:
                self._tell(text)
            self._redraw()

    async def _poll(self, interval_s: float) -> None:
        """Look at position and status now and then; the poller lets everybody else go first."""
        begun_at = asyncio.get_running_loop().time()
        with suppress(ConnectionLostError):  # it is told as an event
            async for reading in self._drive.watch("position", "status", interval_s=interval_s):
                settings = self._drive.settings
                position, status = reading.values.get("position"), reading.values.get("status")
                self._standing.position = (
                    None if position is None else f"{position:.{settings.decimals}f} {settings.unit}"
                )
                self._standing.status = status
                if status is not None:
                    # It was asked for at some time since the last reading, and may be older than a motion since then.
                    self._underway.note_status(status, begun_at)
                begun_at = reading.at
                self._redraw()

    # Telling --------------------------------------------------------------------------------------------------------

    def _tell(self, text: Text) -> None:
        """Print *text* above what is being typed."""
        output = self._prompt.app.output
        console = Console(
            file=StringIO(),
            force_terminal=True,
            color_system="standard",
            width=output.get_size().columns,
            highlight=False,
        )
        console.print(text, end="")
        assert isinstance(console.file, StringIO)
        with suppress(OSError):  # the terminal may be gone, and with it whoever could read this
            print_formatted_text(ANSI(console.file.getvalue()), output=output)

    def _toolbar(self) -> AnyFormattedText:
        self._standing.underway = str(self._underway)
        self._standing.is_stopping = self._stop is not None
        current = self._turns.current
        self._standing.waiting_for = None if current is None else current.text
        self._standing.lines_behind = self._turns.behind
        return toolbar(self._standing)

    def _redraw(self) -> None:
        self._prompt.app.invalidate()

    @contextmanager
    def _interrupts_heeded(self) -> Iterator[None]:
        """Heed Ctrl-C also while something is printed, when the terminal makes a signal of it and no key."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        loop = asyncio.get_running_loop()
        before = signal.signal(signal.SIGINT, lambda *_: loop.call_soon_threadsafe(self._interrupted))
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
