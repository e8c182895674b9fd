"""A job, in pieces of any size, taken apart into whole instructions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from typing import Final

from ...errors import InvalidCommandError
from ..facts.instructions import CONTROL_INSTRUCTIONS
from ..facts.line import COLON, DOT, ESCAPE, ETX, SEMICOLON
from ..facts.mnemonics import MODE_1, MODE_2, Shape
from .instruction import Instruction, Language

__all__ = ["LONGEST_BYTES", "Tokeniser"]

LONGEST_BYTES: Final = 1 << 20
"""An instruction longer than that is refused: it is no instruction, or its end was lost."""

_LONGEST_BLANK: Final = 4096
"""So many blanks are taken as an instruction of their own, that no job of blanks is held."""

_BLANKS: Final = re.compile(rb"[\s;]*")
_LINE_END: Final = re.compile(rb"\r\n|\r|\n")
_END_OF_NUMBERS: Final = re.compile(rb"[A-Za-z;!^\x1b]")
_END_OF_NUMBERS_OR_LINE: Final = re.compile(rb"[A-Za-z;!^\x1b\r\n]")
_END_OF_LINE: Final = re.compile(rb"[\r\n]")
_BEHIND_A_NAME: Final = frozenset([b"", *(bytes([sign]) for sign in b"0123456789+-.,; \t\r\n")])
_PARAMETERS: Final = re.compile(rb"[0-9; ]{0,%d}" % _LONGEST_BLANK)

# Nearly all of nearly every job is of these two forms; whatever else there is takes the way of _read_head().
_PLAIN_TWO: Final = re.compile(rb"([\s;]{0,%d})([A-Za-z]{2})([^A-Za-z;!^\x1b]*);" % (_LONGEST_BLANK - 1))
_PLAIN_ONE: Final = re.compile(rb"([\s;]{0,%d})([A-Za-z])([^A-Za-z;!^\x1b\r\n]*)[;\r\n]" % (_LONGEST_BLANK - 1))


def _spellings(names: list[str]) -> dict[bytes, str]:
    """Return each name by all the ways to write it, in capitals and small letters."""
    return {
        "".join(letters).encode(): name
        for name in names
        for letters in product(*((letter.upper(), letter.lower()) for letter in name))
    }


_RESETTING: Final = frozenset({"IN", "DF"})
"""They have ETX end labels again, so they take the longer way."""
_PLAIN_NAMES: Final = _spellings(
    [name for name, row in MODE_2.items() if row.shape is Shape.NUMBERS and name not in _RESETTING]
)
_PLAIN_NAMES_IN_MODE_1: Final = {spelt: name for spelt, name in _PLAIN_NAMES.items() if not name.startswith("P")}
_PLAIN_LETTERS: Final = _spellings([name for name, row in MODE_1.items() if row.shape is Shape.NUMBERS])


_Span = tuple[int, int]
"""From where to where in what is held."""
_Marks = tuple[int, int, int]
"""Where name and arguments begin and arguments end, from the first byte of the instruction."""


@dataclass(slots=True)
class _Head:
    """An instruction whose end has not come yet; all places count from its first byte."""

    name: str
    language: Language
    shape: Shape
    begin: int
    first: int
    scanned: int
    """Up to there, no end was found."""
    ends_with_line: bool = False
    in_quotes: bool = False


class Tokeniser:
    """
    Takes a job in pieces of any size and gives whole instructions; how it was cut into pieces changes nothing.

    Two letters that mode 2 has as a name are of mode 2, wherever they stand: letters of mode 1 have no letter behind
    them, but for ``P``, which prints what stands behind it. It is taken so right behind other instructions of mode 1,
    unless what it would print looks like ``PU;`` or ``PA1,2``: how a machine tells these is on no page at hand.
    An instruction of mode 2 ends with ``;`` or where the next one begins; one of mode 1, a common one, and one that
    mode 1 calls with ``^``, at the end of the line too.

    Args:
        language: ``Language.ONE`` or ``Language.TWO``, where a job is known to be in that alone.
        longest_bytes: What is longer is refused.

    ``feed()`` and ``finish()`` raise InvalidCommandError for an instruction that is too long, with its place; nothing
    more can be taken apart then.
    """

    def __init__(self, *, language: Language | None = None, longest_bytes: int = LONGEST_BYTES) -> None:
        self._language = language
        self._longest = longest_bytes
        self._held = bytearray()
        self._at = 0  # in what is held
        self._offset = 0  # of _held[0] in the job
        self._line = 1
        self._line_begins = 0  # offset in the job
        self._after_cr = False
        self._head: _Head | None = None
        self._terminator = ETX
        self._in_mode_1 = language is Language.ONE

    @property
    def held_bytes(self) -> int:
        """How many bytes wait for the end of their instruction."""
        return len(self._held) - self._at

    def feed(self, piece: bytes) -> list[Instruction]:
        """Take more of the job; return the instructions that are whole by now."""
        self._held += piece
        return self._take(is_end=False)

    def finish(self) -> list[Instruction]:
        """Return what is left at the end of the job; of an instruction without its end it is said so."""
        return self._take(is_end=True)

    def _take(self, *, is_end: bool) -> list[Instruction]:
        found: list[Instruction] = []
        while True:
            if self._head is None:
                self._take_plain(found)
            each = self._next(is_end=is_end)
            if each is None:
                break
            found.append(each)
        del self._held[: self._at]
        self._offset += self._at
        self._at = 0
        if self.held_bytes > self._longest:
            raise self._too_long(self._head.begin if self._head else 0)
        return found

    def _take_plain(self, found: list[Instruction]) -> None:
        """Take as many as there are of the two usual forms."""
        at = self._at
        if self._language is not Language.ONE:
            names = _PLAIN_NAMES_IN_MODE_1 if self._in_mode_1 else _PLAIN_NAMES
            at = self._take_rows(found, _PLAIN_TWO, names, Language.TWO)
            self._in_mode_1 = self._in_mode_1 and at == self._at
            self._at = at
        if self._language is not Language.TWO:
            at = self._take_rows(found, _PLAIN_ONE, _PLAIN_LETTERS, Language.ONE)
            self._in_mode_1 = self._in_mode_1 or at != self._at
            self._at = at

    def _take_rows(
        self, found: list[Instruction], pattern: re.Pattern[bytes], names: dict[bytes, str], language: Language
    ) -> int:
        """Take as many as there are of one form; return where the next begins."""
        held, longest, offset = self._held, self._longest, self._offset
        at, line, line_begins = self._at, self._line, self._line_begins
        add, match_at = found.append, pattern.match
        while (match := match_at(held, at)) and (name := names.get(match[2])):
            begin, first = match.span(2)
            last, end = match.end(3), match.end()
            data = match[0]
            if b"\n" in data or b"\r" in data or end - at > longest:
                add(self._cut((at, end), name, language, (begin - at, first - at, last - at)))
                line, line_begins = self._line, self._line_begins
            else:
                column = offset + begin - line_begins + 1
                add(_new((data, name, language, offset + at, line, column, begin - at, first - at, last - at, True)))
                self._after_cr = False
            at = end
        return at

    # One instruction, the longer way --------------------------------------------------------------------------------

    def _next(self, *, is_end: bool) -> Instruction | None:
        head = self._head
        if head is None:
            begin = _BLANKS.match(self._held, self._at).end()  # type: ignore[union-attr]
            if begin == len(self._held) or begin - self._at >= _LONGEST_BLANK:
                return self._blanks(begin, is_end=is_end)
            head = self._read_head(begin, is_end=is_end)
            if head is None:
                return None
            self._head = head
        stops = self._find_end(head)
        if stops is None:
            if not is_end:
                return None
            stops = (len(self._held) - self._at,) * 2
            is_complete = False
        else:
            is_complete = True
        last, end = stops
        self._head = None
        span, marks = (self._at, self._at + end), (head.begin, head.first, last)
        instruction = self._cut(span, head.name, head.language, marks, is_complete=is_complete)
        self._at += end
        self._remember(instruction)
        return instruction

    def _blanks(self, begin: int, *, is_end: bool) -> Instruction | None:
        size = min(begin - self._at, _LONGEST_BLANK)
        if not size or not (is_end or size == _LONGEST_BLANK):
            return None
        instruction = self._cut((self._at, self._at + size), "", Language.BLANK, (0, size, size))
        self._at += size
        return instruction

    def _remember(self, instruction: Instruction) -> None:
        """Heed what changes how the next ones are read."""
        if instruction.name in _RESETTING:
            self._terminator = ETX
        elif instruction.name == "DT":
            sign = instruction.arguments[:1]
            self._terminator = sign[0] if sign else ETX
        if instruction.language in (Language.ONE, Language.TWO):
            is_call = instruction.data[instruction.begin : instruction.begin + 1] == b"^"
            self._in_mode_1 = instruction.language is Language.ONE or (is_call and self._language is not Language.TWO)

    def _read_head(self, begin: int, *, is_end: bool) -> _Head | None:
        """Say what begins at *begin*; None if more must come to say it."""
        held = self._held
        sign, where = chr(held[begin]), begin - self._at
        if held[begin] == ESCAPE:
            return self._read_control(begin, is_end=is_end)
        is_letter = sign.isascii() and sign.isalpha()
        needed = 3 if sign in "!^" or (sign in "Pp" and self._in_mode_1) else 2
        if (is_letter or sign in "!^") and len(held) < begin + needed and not is_end:
            return None
        marks = 0 if is_letter else 1
        letters = bytes(held[begin + marks : begin + marks + 2])
        pair = letters.decode().upper() if len(letters) == 2 and letters.isalpha() else ""
        if is_letter:
            return self._read_letters(sign.upper(), pair, where, bytes(held[begin + 2 : begin + 3]))
        if sign in "!^" and pair:
            row, first = MODE_2.get(pair), where + 3
            shape = row.shape if row and sign == "^" else Shape.NUMBERS
            name, language = (pair, Language.TWO) if sign == "^" else (f"!{pair}", Language.COMMON)
            return _Head(name, language, shape, where, first, first, ends_with_line=True)
        return _Head("", Language.UNKNOWN, Shape.NUMBERS, where, where, where + 1, ends_with_line=self._in_mode_1)

    def _read_letters(self, letter: str, pair: str, where: int, behind: bytes) -> _Head:
        """Tell a letter of mode 1 from a pair of mode 2."""
        single = MODE_1.get(letter)
        prints = letter == "P" and self._in_mode_1
        if prints and self._language is None:
            prints = not (pair in MODE_2 and behind in _BEHIND_A_NAME)
        if self._language is not Language.ONE and pair:
            row = MODE_2.get(pair)
            is_single = row is None and single is not None and (self._in_mode_1 or letter == "H")
            if not (prints or is_single):
                return _Head(pair, Language.TWO, row.shape if row else Shape.NUMBERS, where, where + 2, where + 2)
        if single is None or self._language is Language.TWO or (letter == "P" and not prints):
            return _Head(letter, Language.UNKNOWN, Shape.NUMBERS, where, where + 1, where + 1)
        return _Head(letter, Language.ONE, single.shape, where, where + 1, where + 1, ends_with_line=True)

    def _read_control(self, begin: int, *, is_end: bool) -> _Head | None:
        end = self._end_of_control(begin)
        where = begin - self._at
        if end is None:
            if not is_end:
                return None
            end = len(self._held)
        letter = chr(self._held[begin + 2]) if end - begin > 2 else ""
        # Its end is known already: PACKED would look for ";", so let it be found at once.
        name = f"ESC.{letter}" if letter else "ESC"
        return _Head(name, Language.CONTROL, Shape.PACKED, where, where + min(3, end - begin), end - self._at)

    def _end_of_control(self, begin: int) -> int | None:
        """Return where the device control instruction at *begin* ends; None if that has not come yet."""
        held = self._held
        size = len(held) - begin
        if size > 1 and held[begin + 1] != DOT:
            return begin + 1
        if size < 3:
            return None
        row = CONTROL_INSTRUCTIONS.get(chr(held[begin + 2]))
        if row is None:
            return begin + 3
        stop = begin + 3
        if row.takes_parameters:
            stop = _PARAMETERS.match(held, stop).end()  # type: ignore[union-attr]
        if stop - begin == 3 + _LONGEST_BLANK:
            return stop
        return None if stop == len(held) else stop + (held[stop] == COLON)

    # Ends -----------------------------------------------------------------------------------------------------------

    def _find_end(self, head: _Head) -> tuple[int, int] | None:
        """Return where the arguments and where the instruction end, from its first byte; None if not yet."""
        held, at = self._held, self._at
        if head.language is Language.CONTROL:
            return head.scanned, head.scanned
        if head.shape is Shape.LABEL:
            return self._until(head, held.find(self._terminator, at + head.scanned))
        if head.shape is Shape.PACKED:
            return self._until(head, held.find(SEMICOLON, at + head.scanned))
        if head.shape is Shape.LINE:
            match = _END_OF_LINE.search(held, at + head.scanned)
            return self._until(head, match.start() if match else -1)
        is_there = True
        if head.shape is Shape.SIGN:
            is_there = self._skip_sign(head)
        elif head.shape is Shape.QUOTED:
            is_there = self._skip_quoted(head)
        return self._end_of_numbers(head) if is_there else None

    def _until(self, head: _Head, found: int) -> tuple[int, int] | None:
        if found < 0:
            head.scanned = len(self._held) - self._at
            return None
        return found - self._at, found - self._at + 1

    def _skip_sign(self, head: _Head) -> bool:
        """Go on behind the one character; False if it has not come yet."""
        if head.scanned == head.first:
            if len(self._held) == self._at + head.first:
                return False
            head.scanned += self._held[self._at + head.first] not in (SEMICOLON, ESCAPE)
        return True

    def _skip_quoted(self, head: _Head) -> bool:
        """Go on behind the text in quotation marks, if one stands there; False if its end has not come yet."""
        held, at = self._held, self._at
        if head.scanned == head.first and not head.in_quotes:
            opening = _BLANKS_ONLY.match(held, at + head.first).end()  # type: ignore[union-attr]
            if opening == len(held):
                return False
            if held[opening] == _QUOTE:
                head.in_quotes, head.scanned = True, opening + 1 - at
        if head.in_quotes:
            closing = held.find(_QUOTE, at + head.scanned)
            head.in_quotes = closing < 0
            head.scanned = (len(held) if head.in_quotes else closing + 1) - at
        return not head.in_quotes

    def _end_of_numbers(self, head: _Head) -> tuple[int, int] | None:
        held, at = self._held, self._at
        pattern = _END_OF_NUMBERS_OR_LINE if head.ends_with_line else _END_OF_NUMBERS
        while True:
            match = pattern.search(held, at + head.scanned)
            if match is None:
                head.scanned = len(held) - at
                return None
            stop = match.start()
            sign = held[stop]
            if sign != ESCAPE:
                ends = sign == SEMICOLON or sign in b"\r\n"
                return stop - at, stop - at + ends
            # Device control in the middle of numbers: the machine takes it out, and the numbers go on behind it.
            behind = self._end_of_control(stop)
            if behind is None:
                head.scanned = stop - at
                return None
            head.scanned = behind - at

    # Places ---------------------------------------------------------------------------------------------------------

    def _cut(
        self, span: _Span, name: str, language: Language, marks: _Marks, *, is_complete: bool = True
    ) -> Instruction:
        """Cut out an instruction, and count its lines."""
        at, end = span
        begin, first, last = marks
        if end - at > self._longest:
            raise self._too_long(at + begin)
        data = bytes(self._held[at:end])
        offset = self._offset + at
        if b"\n" not in data and b"\r" not in data:
            self._after_cr = False
            column = offset + begin - self._line_begins + 1
            return Instruction(data, name, language, offset, self._line, column, begin, first, last, is_complete)
        self._count_lines(data[:begin], offset)
        line, column = self._line, offset + begin - self._line_begins + 1
        self._count_lines(data[begin:], offset + begin)
        return Instruction(data, name, language, offset, line, column, begin, first, last, is_complete)

    def _count_lines(self, data: bytes, offset: int) -> None:
        if not data:
            return
        for match in _LINE_END.finditer(data):
            is_rest_of_end = self._after_cr and match.start() == 0 and match[0] == b"\n"
            self._line += not is_rest_of_end
            self._line_begins = offset + match.end()
        self._after_cr = data.endswith(b"\r")

    def _too_long(self, index: int) -> InvalidCommandError:
        """Return what to raise for the instruction whose name is held at *index*."""
        at = min(self._at, index)
        self._count_lines(bytes(self._held[at:index]), self._offset + at)
        line, column = self._line, self._offset + index - self._line_begins + 1
        return InvalidCommandError(
            f"line {line}, column {column}: an instruction of more than {self._longest} bytes",
            hint="is its end missing, or is this no job for a cutter?",
        )


_new: Final = Instruction._make
_QUOTE: Final = 0x22
_BLANKS_ONLY: Final = re.compile(rb"\s*")
