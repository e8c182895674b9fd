"""
What can be asked of a control, and its answers as values: as classic controls say them, and as newer ones do.

Most answers name what they answer. ``STATUS, BUSY``, ``UNKNOWN`` and a variable without its number do not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from enum import Enum
from math import isfinite
from types import MappingProxyType
from typing import ClassVar, Final

from ..checked_numbers import check_whole
from ..errors import CommandRejectedError, InvalidCommandError, UnexpectedAnswerError
from ..escaping import shown
from .facts.queries import BUSY, QUERIES, UNKNOWN_REQUEST, WRITE_DONE, WRITE_VARIABLE, AnswerKind, Query

__all__ = [
    "HIGHEST_VARIABLE",
    "Answer",
    "Belongs",
    "Busy",
    "Count",
    "Duration",
    "Mode",
    "ProgramStatus",
    "Request",
    "Text",
    "VariableValue",
    "Written",
    "belonging",
    "decode",
]

HIGHEST_VARIABLE: Final = 99_999
_NOT_UNDERSTOOD: Final = "?"
_REQUEST: Final = re.compile(r"\??\s*Q([0-9]{1,4})(?:\s+([0-9]{1,6}))?", re.IGNORECASE)
_WRITING: Final = re.compile(r"\s*\??\s*E\s*[0-9]", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]{1,20}\.?[0-9]{0,20}|\.[0-9]{1,20})(?:[eE][+-]?[0-9]{1,3})?")
_WHOLE: Final = re.compile(r"[0-9]{1,12}")
_TIME: Final = re.compile(r"([0-9]{1,8}):([0-5]?[0-9]):([0-5]?[0-9])")
_NOTHING: Final = re.compile(r"(?:#0|[+-]?nan(?:\(.*\))?|[+-]?1\.#[a-z]+[0-9]*)?", re.IGNORECASE)
"""How an empty variable, #0, is written."""


@dataclass(frozen=True, slots=True)
class Request:
    """
    One question, checked.

    Attributes:
        command: ``Q600``, or ``E``.
        variable: Its number, if it asks about one.
        value: What E writes, as it is sent.
    """

    command: str
    variable: int | None = None
    value: str | None = None

    @classmethod
    def of(cls, what: str | int) -> Request:
        """
        Read a question as people write it: ``Q100``, 100, ``Q600 3027``, ``?q600 3027``.

        Raises:
            InvalidCommandError: It is none; or it writes.
        """
        if isinstance(what, str) and _WRITING.match(what):
            raise InvalidCommandError(
                f"{shown(what)} writes a variable, and is no question", hint="use write_variable()"
            )
        if isinstance(what, int) and not isinstance(what, bool):
            found = _REQUEST.fullmatch(f"Q{check_whole('the number of a question', what, 0, 9999)}")
        else:
            found = _REQUEST.fullmatch(what.strip()) if isinstance(what, str) else None
        if found is None:
            raise InvalidCommandError(f"{shown(what)} is no question of data collection", hint=_possible())
        command = f"Q{int(found[1]):03d}"
        row = QUERIES.get(command)
        if row is not None and row.takes_variable != (found[2] is not None):
            wants = "needs the number of a variable" if row.takes_variable else "takes no number"
            raise InvalidCommandError(f"{command} {wants}", hint=_possible())
        return cls(command, None if found[2] is None else _checked_variable(int(found[2])))

    @classmethod
    def of_variable(cls, number: int) -> Request:
        """
        Ask for a variable.

        Raises:
            InvalidCommandError: There is none of that number.
        """
        return cls("Q600", _checked_variable(number))

    @classmethod
    def writing(cls, number: int, value: str) -> Request:
        """Write a variable; whether that is allowed is for others to say."""
        return cls(WRITE_VARIABLE, _checked_variable(number), value)

    @property
    def text(self) -> str:
        """As it is sent, without what the profile puts in front and behind."""
        if self.command == WRITE_VARIABLE:
            return f"{self.command}{self.variable} {self.value}"
        return self.command if self.variable is None else f"{self.command} {self.variable}"

    @property
    def row(self) -> Query | None:
        """What is known of it; None: it is none that is known."""
        return QUERIES.get(self.command)

    @property
    def is_writing(self) -> bool:
        """Whether it changes something."""
        return self.command == WRITE_VARIABLE

    @classmethod
    def sent_as(cls, text: str) -> Request:
        """Return the question whose :attr:`text` this is."""
        if text.startswith(WRITE_VARIABLE):
            number, _, value = text[len(WRITE_VARIABLE) :].partition(" ")
            return cls.writing(int(number), value)
        return cls.of(text)


def _checked_variable(number: object) -> int:
    return check_whole("the number of a variable", number, 0, HIGHEST_VARIABLE)


def _possible() -> str:
    plain = [row.command for row in QUERIES.values() if not row.takes_variable]
    return f"known are {', '.join(plain)}, and Q600 with the number of a variable"


# Whose answer it is --------------------------------------------------------------------------------------------------


class Belongs(Enum):
    """Whether an answer can be the one to a question."""

    YES = "it names what it answers, and that is this"
    PERHAPS = "it names nothing: it can answer this, or something else"
    NO = "it names something else"
    UNKNOWN = "it is none of the known answers"


def belonging(request: Request, text: str) -> Belongs:
    """Say whether *text*, what stood in a frame, can be the answer to *request*."""
    fields = _fields(text)
    head = fields[0].upper()
    owners = _OWNERS.get(head)
    if owners is None:
        return _belonging_of_nameless(request, head, fields)
    if request.command not in owners:
        return Belongs.NO
    if request.variable is None:
        return Belongs.YES
    if len(fields) < 3:
        return Belongs.PERHAPS
    return Belongs.YES if _WHOLE.fullmatch(fields[1]) and int(fields[1]) == request.variable else Belongs.NO


def _belonging_of_nameless(request: Request, head: str, fields: tuple[str, ...]) -> Belongs:
    if head == WRITE_DONE:
        return Belongs.PERHAPS if request.is_writing else Belongs.NO
    if head == _NOT_UNDERSTOOD and len(fields) > 1:  # a stand-in server repeats what it does not know
        return Belongs.YES if fields[1].lstrip("?").strip().upper() == request.text else Belongs.NO
    if head == UNKNOWN_REQUEST or _is_busy(fields) or request.is_writing or request.row is None:
        return Belongs.PERHAPS
    return Belongs.UNKNOWN


def _owners() -> dict[str, frozenset[str]]:
    found: dict[str, set[str]] = {}
    for row in QUERIES.values():
        if row.command != WRITE_VARIABLE:
            for head in row.heads:
                found.setdefault(head.upper(), set()).add(row.command)
    return {head: frozenset(commands) for head, commands in found.items()}


_OWNERS: Final = MappingProxyType(_owners())
"""By the first field of an answer: the commands that are answered so."""


def _fields(text: str) -> tuple[str, ...]:
    return tuple(" ".join(field.split()) for field in text.split(","))


def _is_busy(fields: tuple[str, ...]) -> bool:
    return ", ".join(fields[:2]).upper() == BUSY


# Answers -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """
    What a control has answered; one to a question that is not known is this, and no more.

    Attributes:
        text: As it came, without its frame.
        fields: What stands between its commas, without blanks around.
        extra: Of these, what is more than is known of.
    """

    request: Request
    text: str
    fields: tuple[str, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Busy(Answer):
    """The control runs a cycle, and says no more: a state, and no error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Text(Answer):
    """Serial number (Q100), software version (Q101), model (Q102)."""

    value: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode(Answer):
    """The mode (Q104), without the parentheses that classic controls put around it: ``MDI``, ``ZERO RET``."""

    value: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Count(Answer):
    """Tool changes (Q200), the tool in use (Q201), M30 counters (Q402, Q403)."""

    value: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Duration(Answer):
    """Power-on time (Q300), motion time (Q301), last and previous cycle (Q303, Q304)."""

    value: timedelta


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableValue(Answer):
    """
    A variable (Q600).

    Attributes:
        variable: The number that was asked for.
        named: Whether the answer says that number itself.
        value: None: it is empty, #0.
    """

    variable: int
    named: bool
    value: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Written(Answer):
    """What came back for a write: ``!`` over Ethernet. How classic controls answer is not known: read back."""

    says_done: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramStatus(Answer):
    """
    Program, status and parts (Q500); a control that runs a cycle says ``STATUS, BUSY`` and nothing else.

    Attributes:
        is_busy: Whether it said that; the others are None then.
        program: ``O00010``, or ``MDI``.
        status: ``IDLE``, ``FEED HOLD``, ``ALARM ON``, or another word.
        parts: That were counted; None: not said.
    """

    is_busy: bool = False
    program: str | None = None
    status: str | None = None
    parts: int | None = None

    IDLE: ClassVar[str] = "IDLE"
    FEED_HOLD: ClassVar[str] = "FEED HOLD"
    ALARM_ON: ClassVar[str] = "ALARM ON"


def decode(request: Request, text: str) -> Answer:
    """
    Read *text*, what stood in a frame, as the answer to *request*.

    Raises:
        CommandRejectedError: The control does not know the question.
        UnexpectedAnswerError: It is no answer to it.
    """
    fields = _fields(text)
    belongs = belonging(request, text)
    if belongs in {Belongs.NO, Belongs.UNKNOWN}:
        raise UnexpectedAnswerError(
            f"that is no answer to {_called(request)}: {belongs.value}", sent=request.text, received=text
        )
    if fields[0].upper() in {UNKNOWN_REQUEST, _NOT_UNDERSTOOD}:
        raise CommandRejectedError(
            f"the control does not know {_called(request)}",
            sent=request.text,
            received=text,
            hint="older controls know less; so does one with another form of questions: see request_prefix of profiles",
        )
    if request.is_writing:
        return Written(request=request, text=text, fields=fields, says_done=fields[0] == WRITE_DONE)
    if request.row is None:
        return Answer(request=request, text=text, fields=fields, extra=fields)
    if _is_busy(fields):
        if request.command == "Q500":
            return ProgramStatus(request=request, text=text, fields=fields, extra=fields[2:], is_busy=True)
        return Busy(request=request, text=text, fields=fields, extra=fields[2:])
    return _Reader(request, text, fields).read(request.row)


def _called(request: Request) -> str:
    if request.variable is not None:
        return f"variable #{request.variable}"
    return f"{request.command} ({request.row.meaning})" if request.row is not None else request.command


class _Reader:
    """Reads the fields of one answer."""

    def __init__(self, request: Request, text: str, fields: tuple[str, ...]) -> None:
        self._request = request
        self._text = text
        self._fields = fields

    def read(self, row: Query) -> Answer:
        read: Mapping[AnswerKind, Callable[[], Answer]] = {
            AnswerKind.TEXT: self._plain,
            AnswerKind.MODE: self._mode,
            AnswerKind.COUNT: self._count,
            AnswerKind.DURATION: self._duration,
            AnswerKind.PROGRAM: self._program,
            AnswerKind.VARIABLE: self._variable,
        }
        return read[row.answer]()

    def _refuse(self, what: str) -> UnexpectedAnswerError:
        text = f"the answer to {_called(self._request)} is no {what}"
        return UnexpectedAnswerError(text, sent=self._request.text, received=self._text)

    def _only(self) -> tuple[str, tuple[str, ...]]:
        if len(self._fields) < 2:
            raise self._refuse("answer with a value")
        return self._fields[1], self._fields[2:]

    def _whole(self, field: str, what: str) -> int:
        if not _WHOLE.fullmatch(field):
            raise self._refuse(what)
        return int(field)

    def _plain(self) -> Text:
        value, extra = self._only()
        return Text(request=self._request, text=self._text, fields=self._fields, extra=extra, value=value)

    def _mode(self) -> Mode:
        value, extra = self._only()
        if value.startswith("(") and value.endswith(")"):
            value = value[1:-1].strip()
        return Mode(request=self._request, text=self._text, fields=self._fields, extra=extra, value=value)

    def _count(self) -> Count:
        field, extra = self._only()
        value = self._whole(field, "count")
        return Count(request=self._request, text=self._text, fields=self._fields, extra=extra, value=value)

    def _duration(self) -> Duration:
        field, extra = self._only()
        found = _TIME.fullmatch(field)
        if found is None:
            raise self._refuse("time, hours:minutes:seconds")
        value = timedelta(hours=int(found[1]), minutes=int(found[2]), seconds=int(found[3]))
        return Duration(request=self._request, text=self._text, fields=self._fields, extra=extra, value=value)

    def _program(self) -> ProgramStatus:
        fields = self._fields
        if len(fields) < 3:
            raise self._refuse("program, status and parts")
        parts, extra = None, fields[3:]
        if len(fields) > 4 and fields[3].upper() == "PARTS":
            parts, extra = self._whole(fields[4], "number of parts"), fields[5:]
        return ProgramStatus(
            request=self._request,
            text=self._text,
            fields=fields,
            extra=extra,
            program=fields[1],
            status=fields[2],
            parts=parts,
        )

    def _variable(self) -> VariableValue:
        fields, variable = self._fields, self._request.variable
        assert variable is not None  # a request is checked when it is made
        named = len(fields) > 2
        self._only()
        value, extra = (fields[2], fields[3:]) if named else (fields[1], ())
        number: float | None = None
        if not _NOTHING.fullmatch(value):
            number = float(value) if _NUMBER.fullmatch(value) else None
            if number is None or not isfinite(number):
                raise self._refuse("number")
        return VariableValue(
            request=self._request,
            text=self._text,
            fields=fields,
            extra=extra,
            variable=variable,
            named=named,
            value=number,
        )
