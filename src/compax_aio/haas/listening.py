"""What comes over a control's line and is no file: answers, pieces of them, lines that a program prints, leftovers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from ..link.contract import Event
from ..link.level import LineLevel
from .frames import Broken, Echo, FrameSplitter, Line, Part, PrintReader
from .profiles import Profile
from .protocol_events import LeftOver, Printed

__all__ = ["Listener", "Pause", "on_the_wire_s"]

_MOST_WHILE_QUIET_BYTES: Final = 4096
"""So much comes in four seconds at 9600 baud: whatever it is, it does not end soon."""
_MOST_PUT_OFFS: Final = 256
"""And so often a pause begins anew."""
_SILENT_CHARACTERS: Final = 16
"""A pause is none in which not even so many could have come: a UART may hand over as many at once, and no sooner."""


class Listener:
    """
    Tells answers from what stands between them.

    Args:
        profile: How the control is set up.

    Attributes:
        drops_file: Whether what comes is what is left of a file that is not wanted any more.
    """

    def __init__(self, profile: Profile) -> None:
        self.drops_file = False
        self._splitter = FrameSplitter(profile.data_collection or "rs-232")
        self._prints = PrintReader()

    @property
    def awaits_prompt(self) -> bool:
        """Whether what follows an answer is still to come."""
        return self._splitter.awaits_prompt

    def split(self, data: bytes, *, is_damaged: bool) -> Iterable[Part]:
        """Take *data* apart: answers, what began like one and is none, and what stands outside."""
        if is_damaged:
            self._splitter.note_damage()
        return self._splitter.feed(data)

    def expect_echo(self, text: str, *, earlier_may_come: bool) -> None:
        """Take note that *text* is asked, and may come back."""
        self._prints.expect_echo(text, earlier_may_come=earlier_may_come)

    def outside(self, data: bytes, *, is_damaged: bool) -> list[Event]:
        """Say what stands outside of answers."""
        if self.drops_file:
            return [LeftOver(len(data))]
        return list(_printed(self._prints.feed(data, is_damaged=is_damaged)))

    def answer_begins(self) -> list[Event]:
        """Say what was printed in front of an answer, and has no end of its own."""
        return list(_printed(self._prints.answer_begins()))

    def forget_answer(self) -> list[str]:
        """Expect no more of an answer of which only the beginning has come; return that."""
        return [part.data.decode("latin-1") for part in self._splitter.give_up() if isinstance(part, Broken)]

    def forget_print(self) -> list[Event]:
        """Expect no more of a line of which only the beginning has come, nor of a file; say what that is."""
        self.drops_file = False
        return list(_printed(self._prints.give_up()))


def _printed(lines: Iterable[Line | Echo]) -> Iterator[Event]:
    return (Printed(line.text, line.is_damaged) for line in lines if isinstance(line, Line) and line.text.strip())


class Pause:
    """A time in which nothing shall come: what comes all the same has it begin anew, but not for ever."""

    def __init__(self) -> None:
        self._came_bytes = self._put_offs = 0

    @staticmethod
    def lasts_s(at_least_s: float, level: LineLevel) -> float:
        """Return how long one is."""
        return max(at_least_s, on_the_wire_s(_SILENT_CHARACTERS, level))

    def begin(self) -> None:
        """Begin another one."""
        self._came_bytes = self._put_offs = 0

    def put_off(self, came_bytes: int) -> bool:
        """Take note that so much has come; return whether it may begin anew: what never ends does not have it so."""
        self._came_bytes += came_bytes
        self._put_offs += 1
        return self._came_bytes <= _MOST_WHILE_QUIET_BYTES and self._put_offs <= _MOST_PUT_OFFS


def on_the_wire_s(count: int, level: LineLevel) -> float:
    """Return how long so many bytes are on the wire; 0 where nobody knows how fast it is."""
    return count / level.bytes_per_s if level.bytes_per_s else 0.0
