"""
What a cutter sends: replies in whatever frame ``.M`` and ``.N`` have set, with its handshake signs taken out.

And what its replies say, as values; what is no such reply is none.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ..errors import InvalidCommandError, UnexpectedAnswerError
from ..escaping import shown
from .facts.reports import BUFFER_EMPTY, PAUSED, HpGlStatus, HpStatus, StatusStyle, StatusWord
from .instructions import BlockHandshake, EnqAckMode1, ReplyFormat, SignFormat

__all__ = [
    "CutterStatus",
    "Framing",
    "Noise",
    "Position",
    "Received",
    "Reply",
    "ReplyReader",
    "Sign",
    "SignSeen",
    "decode_bytes",
    "decode_error",
    "decode_hp_gl_status",
    "decode_numbers",
    "decode_position",
    "decode_status",
]

_LONGEST_REPLY: Final = 256
"""The longest known has 4 numbers."""
_SEVEN_BITS: Final = 0x7F


class Sign(Enum):
    """What a cutter sends besides replies, anywhere between or within them."""

    XON = "Xon"
    XOFF = "Xoff"
    ACKNOWLEDGED = "ACK"
    HEARD = "immediate response"


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply without its frame."""

    text: str


@dataclass(frozen=True, slots=True)
class SignSeen:
    """A handshake sign."""

    sign: Sign


@dataclass(frozen=True, slots=True)
class Noise:
    """What is no part of a reply: it stood in front of an initiator, or it was too long for one."""

    data: bytes


Received = Reply | SignSeen | Noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Framing:
    """
    How a cutter that was told these dresses what it sends.

    Attributes:
        reply: What was sent with ``.M``.
        xon: The Xon string, of ``.I`` without ENQ.
        xoff: The Xoff string, of ``.N``.
        ack: The acknowledgement, of ``.H`` or of ``.I`` with ENQ.
        heard: The immediate response, of ``.N``.
        ack_is_ended: ENQ/ACK mode 1: the terminator comes behind *ack* and *heard* (HP7470 p. 10-29).
        data_bits: 8, or 7: then the eighth bit is none of the character.
    """

    reply: ReplyFormat = ReplyFormat()  # noqa: RUF009  # frozen
    xon: bytes = b""
    xoff: bytes = b""
    ack: bytes = b""
    heard: bytes = b""
    ack_is_ended: bool = False
    data_bits: int = 8

    def __post_init__(self) -> None:
        """Refuse what could not be told apart."""
        if self.data_bits not in (7, 8):
            raise InvalidCommandError(f"a character has 7 or 8 data bits, not {shown(self.data_bits)}")
        if not self.reply.terminator and not self.reply.second_terminator:
            raise InvalidCommandError(
                "replies need a terminator: nobody knows where one ends", hint="P4 of ESC.M is 13 by default"
            )
        signs = [sign for _, sign in self.signs]
        frame = {*self.terminator, self.reply.initiator} - {0}
        if len(set(signs)) < len(signs) or any(frame & {*sign} or sign[-1:].isalnum() for sign in signs):
            raise InvalidCommandError(
                "a handshake sign is no other sign, ends with no letter or digit, and has no character of the frame",
                hint="use DC1 and DC3 for Xon and Xoff, ENQ and ACK for the others",
            )

    @classmethod
    def of(
        cls,
        reply: ReplyFormat,
        signs: SignFormat | None = None,
        handshake: BlockHandshake | EnqAckMode1 | None = None,
        *,
        data_bits: int = 8,
    ) -> Framing:
        """Return the framing after these were sent."""
        second = signs.signs if signs else b""
        first = handshake.signs if handshake else b""
        if handshake is None or not handshake.enquiry:
            return cls(reply=reply, xon=first, xoff=second if first else b"", data_bits=data_bits)
        is_mode_1 = isinstance(handshake, EnqAckMode1)
        return cls(reply=reply, ack=first, heard=second, ack_is_ended=is_mode_1, data_bits=data_bits)

    @property
    def terminator(self) -> bytes:
        """What ends a reply."""
        return bytes(filter(None, (self.reply.terminator, self.reply.second_terminator)))

    @property
    def signs(self) -> tuple[tuple[Sign, bytes], ...]:
        """All signs that were agreed on, longer ones first."""
        each = ((Sign.XON, self.xon), (Sign.XOFF, self.xoff), (Sign.ACKNOWLEDGED, self.ack), (Sign.HEARD, self.heard))
        return tuple(sorted(((sign, text) for sign, text in each if text), key=lambda pair: -len(pair[1])))

    @property
    def behind_request(self) -> bytes:
        """What the host sends behind a request: the trigger, without which no reply comes (Automove p. 6-12)."""
        return bytes(filter(None, (self.reply.trigger,)))

    @property
    def behind_reply(self) -> bytes:
        """What the host sends behind a reply, or its next data is dropped: the echo terminator (HP7470 p. 10-15)."""
        return bytes(filter(None, (self.reply.echo_terminator,)))


class ReplyReader:
    """Takes what a cutter sends, in pieces of any size, apart into replies, handshake signs and noise."""

    def __init__(self, framing: Framing | None = None) -> None:
        self._framing = framing or Framing()
        self._held = bytearray()
        self._is_begun = False
        self._ends_sign = 0

    def reframe(self, framing: Framing) -> None:
        """Go by another framing from now on; what is held of an unfinished reply is dropped."""
        self.__init__(framing)  # type: ignore[misc]

    def feed(self, piece: bytes) -> list[Received]:
        """Return what *piece* completes."""
        found: list[Received] = []
        for byte in piece:
            self._take(byte & _SEVEN_BITS if self._framing.data_bits == 7 else byte, found)
        return found

    def _take(self, byte: int, found: list[Received]) -> None:
        held, framing = self._held, self._framing
        if self._ends_sign:
            # Mode 1 ends its signs like replies; no more than that is swallowed.
            expected = framing.terminator[-self._ends_sign]
            self._ends_sign = self._ends_sign - 1 if byte == expected else 0
            if byte == expected:
                return
        held.append(byte)
        for sign, text in framing.signs:
            if held.endswith(text):
                del held[-len(text) :]
                found.append(SignSeen(sign))
                is_ended = framing.ack_is_ended and sign in (Sign.ACKNOWLEDGED, Sign.HEARD)
                self._ends_sign = len(framing.terminator) if is_ended else 0
                return
        if framing.reply.initiator and not self._is_begun:
            self._await_initiator(byte, found)
        elif held.endswith(framing.terminator):
            found.append(Reply(held[: -len(framing.terminator)].decode("latin-1")))
            self._clear()
        elif len(held) > _LONGEST_REPLY:
            found.append(Noise(bytes(held)))
            self._clear()

    def _await_initiator(self, byte: int, found: list[Received]) -> None:
        is_there = byte == self._framing.reply.initiator
        if is_there:
            self._held.pop()
            self._is_begun = True
        if self._held and (is_there or len(self._held) > _LONGEST_REPLY):
            found.append(Noise(bytes(self._held)))
            self._held.clear()

    def _clear(self) -> None:
        self._held.clear()
        self._is_begun = False


# What replies say ----------------------------------------------------------------------------------------------------

_WHOLE: Final = re.compile(r"[0-9]{1,9}")
_NUMBER: Final = re.compile(r"[+-]?[0-9]{1,12}(?:\.[0-9]{0,6})?")


def decode_bytes(text: str, *, of: str = "free space") -> int:
    """
    Read a number of bytes, the reply to ``.B`` and ``.L``.

    Raises:
        UnexpectedAnswerError: It is none.
    """
    if not _WHOLE.fullmatch(text.strip()):
        raise UnexpectedAnswerError(f"the answer is no number of bytes ({of})", received=text)
    return int(text)


def decode_error(text: str) -> int:
    """
    Read the reply to ``.E`` or ``OE;``; an empty one is 0, as some HP units answer (djipco/hpgl).

    Raises:
        UnexpectedAnswerError: It is no error number.
    """
    text = text.strip()
    if not text:
        return 0
    if not _WHOLE.fullmatch(text) or int(text) > 999:
        raise UnexpectedAnswerError("the answer is no error number", received=text)
    return int(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutterStatus:
    """
    The reply to ``.O``. No encoding says that motion is finished: an empty buffer is no blade that stands.

    Attributes:
        number: As it came.
        buffer_is_empty: Whether no data is left.
        is_paused: By the operator; VIEW on an HP plotter too.
        is_suspended: HP: paper lever or pinch wheels are up; None where the encoding does not say it.
        has_drawn: Whether something was drawn; None where the encoding does not say it.
    """

    number: int
    buffer_is_empty: bool
    is_paused: bool
    is_suspended: bool | None = None
    has_drawn: bool | None = None


def decode_status(text: str, style: StatusStyle | None = None) -> CutterStatus:
    """
    Read the reply to ``.O``; without a *style*, what all encodings have in common.

    Raises:
        UnexpectedAnswerError: It is no status.
    """
    text = text.strip()
    if not _WHOLE.fullmatch(text) or int(text) > 0xFFFF:
        raise UnexpectedAnswerError("the answer is no status", received=text)
    number = int(text)
    return CutterStatus(
        number=number,
        buffer_is_empty=bool(number & BUFFER_EMPTY),
        is_paused=bool(number & PAUSED),
        is_suspended=bool(number & HpStatus.SUSPENDED) if style is StatusStyle.HP else None,
        has_drawn=bool(number & StatusWord.DRAWN) if style is StatusStyle.WORD else None,
    )


def decode_numbers(text: str, count: int) -> tuple[float, ...]:
    """
    Read *count* numbers with commas between them: the reply to ``OP;``, ``OW;``, ``OH;``, ``OF;``.

    Raises:
        UnexpectedAnswerError: They are not so many, or not numbers.
    """
    texts = [each.strip() for each in text.split(",")]
    if len(texts) != count or not all(map(_NUMBER.fullmatch, texts)):
        raise UnexpectedAnswerError(f"the answer is not {count} numbers", received=text)
    return tuple(map(float, texts))


@dataclass(frozen=True, slots=True)
class Position:
    """The reply to ``OA;`` or ``OC;``, in steps, or in user units when the machine was told to scale."""

    x: float
    y: float
    tool_is_down: bool


def decode_position(text: str) -> Position:
    """
    Read the reply to ``OA;`` or ``OC;``: X, Y and 1 for a tool that is down.

    Raises:
        UnexpectedAnswerError: It is no position.
    """
    x, y, tool = decode_numbers(text, 3)
    if tool not in (0, 1):
        raise UnexpectedAnswerError("the answer is no position: the tool is neither up nor down", received=text)
    return Position(x, y, bool(tool))


def decode_hp_gl_status(text: str) -> HpGlStatus:
    """
    Read the reply to ``OS;``.

    Raises:
        UnexpectedAnswerError: It is no status byte.
    """
    if not _WHOLE.fullmatch(text.strip()) or int(text) > 0xFF:
        raise UnexpectedAnswerError("the answer is no status byte", received=text)
    return HpGlStatus(int(text))
