"""What can be asked of a control, as its methods: a question each, a typed answer or an error with its story."""

from __future__ import annotations

from datetime import timedelta
from typing import cast

from ..errors import InvalidCommandError
from .answers import Answer, ProgramStatus, Request
from .collecting import Collecting, value_of
from .facts.queries import QUERIES
from .variables import VariableWriter
from .watching import Quantity, Watch, Watching

__all__ = ["Asking"]


class Asking:
    """
    Data collection of a control (Setting 143), for :class:`Control`.

    Any number of callers may ask at once: questions go one after the other, with a pause between them, ever more
    rarely while the control is silent, and not while a transfer is under way or a program prints; nor, until
    :meth:`Control.reset_was_pressed`, behind a file that was not sent to its end.

    All of these raise InvalidCommandError if the profile says that the control collects no data; AnswerTimeoutError if
    it does not answer, or cannot be asked now; CommandRejectedError if it does not know the question, or is busy and
    says no more; UnexpectedAnswerError if what came is no answer; ConnectionLostError without a line.
    """

    _collecting: Collecting
    _watching: Watching
    _writer: VariableWriter

    async def query(self, question: str | int) -> Answer:
        """
        Ask by the question's name, and return the answer with all its fields: ``await control.query("Q104")``.

        Args:
            question: ``"Q100"``, ``"Q600 3027"``, or the number of a known one: 100. One that is not known here is
                sent all the same, and answered by a plain :class:`Answer`.
        """
        if isinstance(question, int) and f"Q{question}" not in QUERIES:
            raise InvalidCommandError(
                f"there is no question Q{question} that is known", hint="variable() reads a variable by its number"
            )
        return await self._collecting.ask(Request.of(question))

    async def variable(self, number: int) -> float | None:
        """
        Read a macro or system variable (Q600): ``await control.variable(3027)`` is the spindle's speed.

        Returns:
            Its value; None: it is empty, #0.
        """
        return cast("float | None", value_of(await self._collecting.ask(Request.of_variable(number))))

    async def serial_number(self) -> str:
        """Read the serial number (Q100)."""
        return await self._text("Q100")

    async def software_version(self) -> str:
        """Read the version of the control's software (Q101)."""
        return await self._text("Q101")

    async def model(self) -> str:
        """Read the model (Q102)."""
        return await self._text("Q102")

    async def mode(self) -> str:
        """Read the mode (Q104), ``MDI``, ``ZERO RET``, without the parentheses of classic controls."""
        return await self._text("Q104")

    async def tool_changes(self) -> int:
        """Read how often the tool was changed (Q200)."""
        return await self._count("Q200")

    async def tool_in_use(self) -> int:
        """Read which tool is in use (Q201)."""
        return await self._count("Q201")

    async def power_on_time(self) -> timedelta:
        """Read for how long the control has been on (Q300)."""
        return await self._time("Q300")

    async def motion_time(self) -> timedelta:
        """Read for how long its axes have moved (Q301)."""
        return await self._time("Q301")

    async def last_cycle(self) -> timedelta:
        """Read how long the last cycle took (Q303)."""
        return await self._time("Q303")

    async def previous_cycle(self) -> timedelta:
        """Read how long the cycle before took (Q304)."""
        return await self._time("Q304")

    async def m30_count(self, counter: int = 1) -> int:
        """Read an M30 counter (Q402, Q403), 1 or 2: how many programs have ended."""
        if counter not in (1, 2):
            raise InvalidCommandError(f"the M30 counters are 1 and 2, not {counter!r}")
        return await self._count(f"Q40{counter + 1}")

    async def program_status(self) -> ProgramStatus:
        """
        Read program, status and parts (Q500).

        A control that runs a cycle says that it is busy, and nothing else: that is a state, ``is_busy``, and no error.
        """
        return cast("ProgramStatus", value_of(await self._collecting.ask(Request.of("Q500"))))

    def watch(self, *quantities: Quantity, interval_s: float | None = None, only_changes: bool = False) -> Watch:
        """
        Follow questions and variables: ``async for reading in control.watch("Q500", 3027)``.

        However many watch, each question is asked once a cycle. While a transfer is under way there are no readings.

        Args:
            quantities: ``"Q500"``; or the number of a variable.
            interval_s: From one reading to the next; at least the settings' ``cycle_s``, which is the default.
            only_changes: Leave out readings that say the same as the one before.

        Raises:
            InvalidCommandError: One of them cannot be watched, or not that often.
        """
        return self._watching.watch(quantities, interval_s, only_changes=only_changes)

    async def write_variable(self, number: int, value: float) -> float:
        """
        Write a variable (E), and read it back; off by default.

        It is sent once at most, whatever happens; if it was sent it is carried through and goes on record, in the log
        ``compax_aio.haas.writes``, although the caller is cancelled.

        Args:
            number: Among ``writable`` of :class:`ControlSettings`, and not protected: values of probes never are.
            value: Within ±``largest_value``, with no more decimals than the control shows, 4, or 6 over Ethernet.

        Returns:
            What it reads afterwards.

        Raises:
            InvalidCommandError: It may not be written; nothing was sent.
            CommandRejectedError: The control does not take it; it reads as before.
            UnexpectedAnswerError: It reads something else afterwards.
            AnswerTimeoutError, ConnectionLostError: Nothing was written if it could not be read before; else whether it
                was written is in doubt, and the error says so.
        """
        return await self._writer.write(number, value)

    async def _text(self, command: str) -> str:
        return cast("str", value_of(await self._collecting.ask(Request.of(command))))

    async def _count(self, command: str) -> int:
        return cast("int", value_of(await self._collecting.ask(Request.of(command))))

    async def _time(self, command: str) -> timedelta:
        return cast("timedelta", value_of(await self._collecting.ask(Request.of(command))))
