"""Machine data collection: what can be asked, how it is answered, and how fast a control may be asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final

from .sources import COLLECTION_TESTS, MDCMUX, MTCONNECT

__all__ = [
    "BUSY",
    "IDLE_BEFORE_REQUEST_S",
    "QUERIES",
    "SHORTEST_CYCLE_S",
    "STATUS_WORDS",
    "UNKNOWN_REQUEST",
    "WRITE_DONE",
    "WRITE_VARIABLE",
    "AnswerKind",
    "Query",
]

BUSY: Final = "STATUS, BUSY"
"""Answered to Q500 while a cycle runs: a state, and no error (mtconnect/adapter)."""
UNKNOWN_REQUEST: Final = "UNKNOWN"
"""Answered to what is no request."""
WRITE_VARIABLE: Final = "E"
"""Writes a variable: number, blank, value (bobvawter/mdcmux)."""
WRITE_DONE: Final = "!"
"""Answered to it over Ethernet; how over RS-232 is not known."""
STATUS_WORDS: Final = ("IDLE", "FEED HOLD", "ALARM ON")
"""Third field of the answer to Q500 (mtconnect/adapter)."""

IDLE_BEFORE_REQUEST_S: Final = 0.05
"""Behind the ``>`` of an answer the line stays quiet at least so long (inferred; peers wait 20 ms to 1 s)."""
SHORTEST_CYCLE_S: Final = 1.0
"""Between two cycles: a control polled without pause froze, only RESET helped (HaasMTConnect, issue 1)."""


class AnswerKind(Enum):
    """What an answer tells."""

    TEXT = "text"
    MODE = "mode"
    """Words in parentheses on older controls, bare on newer ones."""
    COUNT = "count"
    DURATION = "duration"
    """Hours, minutes, seconds: ``00000:00:00``."""
    PROGRAM = "program"
    """Program, status, parts; or busy."""
    VARIABLE = "variable"
    WRITTEN = "written"


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """One request."""

    command: str
    """As it is sent: ``Q100``; behind Q600 and E stands a number."""
    meaning: str
    classic: str
    """First field of the answer over RS-232."""
    ethernet: str
    """First field of the answer of newer controls."""
    classic_example: str
    ethernet_example: str
    answer: AnswerKind
    takes_variable: bool = False
    source: str

    @property
    def heads(self) -> tuple[str, ...]:
        """What an answer to it can begin with, but for busy and unknown."""
        return (self.classic,) if self.classic == self.ethernet else (self.classic, self.ethernet)


_BOTH: Final = f"{MTCONNECT}; {COLLECTION_TESTS}"


def _same(command: str, meaning: str, head: str, example: str, answer: AnswerKind) -> Query:
    return Query(
        command=command, meaning=meaning, classic=head, ethernet=head, classic_example=f"{head}, {example}",
        ethernet_example=f"{head}, {example}", answer=answer, source=_BOTH,
    )  # fmt: skip


QUERIES: Final[Mapping[str, Query]] = MappingProxyType(
    {
        row.command: row
        for row in (
            Query(
                command="Q100", meaning="serial number", classic="S/N", ethernet="SERIAL NUMBER",
                classic_example="S/N, 1234567", ethernet_example="SERIAL NUMBER, 1234567", answer=AnswerKind.TEXT,
                source=_BOTH,
            ),
            Query(
                command="Q101", meaning="software version", classic="SOFTWARE", ethernet="SOFTWARE VERSION",
                classic_example="SOFTWARE, VER 000.00", ethernet_example="SOFTWARE VERSION, 100.17.000.2037",
                answer=AnswerKind.TEXT, source=_BOTH,
            ),
            Query(
                command="Q102", meaning="model", classic="MODEL", ethernet="MODEL", classic_example="MODEL, VF2",
                ethernet_example="MODEL, CSMD-G2", answer=AnswerKind.TEXT, source=_BOTH,
            ),
            Query(
                command="Q104", meaning="mode", classic="MODE", ethernet="MODE", classic_example="MODE, (MDI)",
                ethernet_example="MODE, ZERO", answer=AnswerKind.MODE, source=_BOTH,
            ),
            _same("Q200", "tool changes since power-on", "TOOL CHANGES", "35", AnswerKind.COUNT),
            _same("Q201", "tool in use", "USING TOOL", "4", AnswerKind.COUNT),
            _same("Q300", "power-on time", "P.O. TIME", "00000:00:00", AnswerKind.DURATION),
            _same("Q301", "motion time", "C.S. TIME", "00000:00:00", AnswerKind.DURATION),
            _same("Q303", "last cycle time", "LAST CYCLE", "00000:00:00", AnswerKind.DURATION),
            _same("Q304", "previous cycle time", "PREV CYCLE", "00000:00:00", AnswerKind.DURATION),
            _same("Q402", "M30 counter 1", "M30 #1", "380", AnswerKind.COUNT),
            _same("Q403", "M30 counter 2", "M30 #2", "380", AnswerKind.COUNT),
            Query(
                command="Q500", meaning="program, status, parts", classic="PROGRAM", ethernet="PROGRAM",
                classic_example="PROGRAM, O00010, IDLE, PARTS, 42", ethernet_example="PROGRAM, MDI, IDLE, PARTS, 380",
                answer=AnswerKind.PROGRAM, source=_BOTH,
            ),
            Query(
                command="Q600", meaning="a macro or system variable", classic="MACRO", ethernet="MACRO",
                classic_example="MACRO, 3027,    0.0000", ethernet_example="MACRO, 0.0", answer=AnswerKind.VARIABLE,
                takes_variable=True, source=_BOTH,
            ),
            Query(
                command=WRITE_VARIABLE, meaning="write a variable", classic=WRITE_DONE, ethernet=WRITE_DONE,
                classic_example=WRITE_DONE, ethernet_example=WRITE_DONE, answer=AnswerKind.WRITTEN, takes_variable=True,
                source=MDCMUX,
            ),
        )
    }
)  # fmt: skip
"""By command. The classic answer to E is not known: that of Ethernet is a placeholder there."""
