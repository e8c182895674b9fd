"""One instruction of a job: its bytes as they stand there, its name, where it stands."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from ..facts.line import ESCAPE

__all__ = ["Instruction", "Language"]


class Language(Enum):
    """What an instruction belongs to."""

    ONE = "mode 1"
    TWO = "mode 2"
    COMMON = "both modes"
    """``!`` and two letters."""
    CONTROL = "device control"
    """``ESC .`` and a letter: it is none of the job, whoever sends the job says such things."""
    BLANK = "nothing"
    """Blanks, line ends and ``;`` that belong to no instruction."""
    UNKNOWN = "unknown"
    """It begins like no instruction of any language."""


class Instruction(NamedTuple):
    """
    One instruction of a job, with the blanks in front of it and with what ends it.

    The bytes of all instructions of a job, one behind the other, are the job.

    A tuple, because a job has hundreds of thousands of them, and a frozen dataclass takes four times as long to make.

    Attributes:
        data: Its bytes.
        name: ``PD``, ``D``, ``!FS``, ``ESC.B``; empty for blanks and for what begins like no instruction. In capitals,
            however it is written, and without the ``^`` of a call.
        language: What it belongs to.
        offset: Of its first byte in the job, from 0.
        line: Of its name, from 1; LF, CR LF and CR end a line.
        column: Of its name, from 1, in bytes.
        begin: Where in *data* its name begins.
        first: Where in *data* its arguments begin.
        last: Where in *data* its arguments have ended.
        is_complete: False at the end of a job, if what ends it is missing.
    """

    data: bytes
    name: str
    language: Language
    offset: int
    line: int
    column: int
    begin: int
    first: int
    last: int
    is_complete: bool = True

    @property
    def arguments(self) -> bytes:
        """What stands between name and end: numbers, or the text of a label."""
        return self.data[self.first : self.last]

    @property
    def place(self) -> int:
        """Offset of its name in the job."""
        return self.offset + self.begin

    @property
    def holds_control(self) -> bool:
        """Whether there is an ``ESC`` in it: it is device control, or has some within."""
        return ESCAPE in self.data

    @property
    def size_bytes(self) -> int:
        """How many bytes it takes on the line and in the buffer."""
        return len(self.data)

    def __str__(self) -> str:
        """Write ``PD at line 3, column 7``."""
        return f"{self.name or self.language.value} at line {self.line}, column {self.column}"
