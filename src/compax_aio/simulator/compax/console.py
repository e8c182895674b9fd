"""What a received line or frame does: function signs, the intermediate memory, queries and commands."""

from __future__ import annotations

from .binary import line_of
from .instructions import ExecuteStored, MoveBy, MoveHome, MoveTo, Query, Start, Statement
from .language import parse
from .machine import Machine
from .port import Received, ReceivedFrame
from .readings import reading
from .refusals import STORE_EMPTY, SYNTAX, RefusedError

__all__ = ["Console"]


class Console:
    """Carries out one line after the other."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._knobs = machine.knobs
        self.forget()

    def forget(self) -> None:
        """Forget what waits in the intermediate memory, as without power."""
        self._stored: Statement | None = None
        self.began_motion = False
        """The last line may have set the axis in motion."""

    def respond(self, received: Received, now: float) -> str | None:
        """
        Carry out a line or a frame; return the answer, None for none.

        A frame is carried out as the line that says the same, so that it is refused for the same reasons. It has no
        function signs (UG p. 166).

        Raises:
            RefusedError: It is not possible.
        """
        self.began_motion = False
        stored = self._stored
        if self._knobs.store == "until_next_line":
            self._stored = None
        text = self._text(received)
        statement = parse(text.upper() if self._knobs.lower_case == "folded" else text, self._machine.context())
        if statement.stores:
            self._stored = statement
            return text if statement.echoes else ""
        if isinstance(statement.instruction, ExecuteStored):
            if stored is None:
                raise RefusedError(STORE_EMPTY)
            self._stored = None
            statement = stored
        if not statement.echoes:
            return self._carry_out(statement, now)
        # Whether an echoed line also answers is open (row 11): here the echo is the answer, unless it is refused.
        if self._knobs.echo_sign == "echo_and_execute":
            self._carry_out(statement, now)
        return text

    def _text(self, received: Received) -> str:
        text: str | None
        if isinstance(received, ReceivedFrame):
            text = line_of(received.raw, self._machine.decimals)
        else:
            text = None if received.too_long else received.text
        if text is None:
            raise RefusedError(SYNTAX)
        return text

    def _carry_out(self, statement: Statement, now: float) -> str | None:
        instruction = statement.instruction
        if isinstance(instruction, Query):
            return reading(self._machine, instruction.kind, instruction.number, now)
        self._machine.execute(instruction, statement.reports, now)
        self.began_motion = isinstance(instruction, MoveTo | MoveBy | MoveHome | Start)
        if statement.reports and self._knobs.position_reached == "final_only":
            return None
        return ""
