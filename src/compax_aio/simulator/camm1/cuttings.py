"""What was cut: every vector with the state of the tool, and what else the machine was told to do, in its place."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, overload

__all__ = ["MAX_MARKS", "MAX_VECTORS", "Cuttings", "Mark", "Vector", "Vectors"]

MAX_VECTORS: Final = 2_000_000
MAX_MARKS: Final = 50_000

_DOWN: Final = 1
_LIFTED_THERE: Final = 2
_TOOL_BIT: Final = 2


class Vector(NamedTuple):
    """One straight line, in steps."""

    x0: int
    y0: int
    x1: int
    y1: int
    is_down: bool
    """Whether it was cut."""
    tool: int = 0
    """Of ``!ST`` or ``SP``."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Something else that was done at a place."""

    at_vector: int
    """How many vectors had been made before."""
    name: str
    """Of the instruction: ``LB``, ``!PG``, ``VS``, ``RA`` ..."""
    text: str
    """Its arguments, or its text."""
    x: int
    y: int


class Vectors(Sequence[Vector]):
    """
    The last vectors, oldest first; those of a job of megabytes take a few bytes each.

    Args:
        most: How many are kept at least; half as many more fall off together.

    Attributes:
        total: How many there were, with those that are not kept any more.
    """

    def __init__(self, most: int = MAX_VECTORS) -> None:
        self._most = most
        self._xy = array("i", (0, 0))
        self._state = bytearray()
        self.total = 0

    def move(self, x: int, y: int, state: int) -> None:
        """Add a vector from where the last one ended; *state*: 1 if it is cut, and four times the tool."""
        self._xy.append(x)
        self._xy.append(y)
        self._state.append(state)
        self.total += 1
        if len(self._state) > self._most + self._most // 2:
            self._drop(len(self._state) - self._most)

    def carry(self, x: int, y: int) -> None:
        """Let the next vector begin elsewhere: without power the tool is where it is put."""
        self._xy.append(x)
        self._xy.append(y)
        self._state.append(_LIFTED_THERE)

    def take_back_to(self, total: int) -> None:
        """Take back the last vectors, which were not made after all, so that there were *total*."""
        count = self.total - total
        if count:
            del self._xy[-2 * count :]
            del self._state[-count:]
            self.total = total

    def clear(self) -> None:
        """Begin a new sheet."""
        del self._xy[:-2]
        self._state.clear()
        self.total = 0

    def __len__(self) -> int:
        return len(self._state) - self._state.count(_LIFTED_THERE)

    def __iter__(self) -> Iterator[Vector]:
        xy = self._xy
        for place, state in enumerate(self._state):
            if state != _LIFTED_THERE:
                at = 2 * place
                yield Vector(xy[at], xy[at + 1], xy[at + 2], xy[at + 3], bool(state & _DOWN), state >> _TOOL_BIT)

    @overload
    def __getitem__(self, place: int) -> Vector: ...
    @overload
    def __getitem__(self, place: slice) -> list[Vector]: ...
    def __getitem__(self, place: int | slice) -> Vector | list[Vector]:
        return list(self)[place]

    def _drop(self, count: int) -> None:
        del self._state[:count]
        del self._xy[: 2 * count]


class Cuttings:
    """
    What lies on the machine.

    Attributes:
        vectors: Of tool up and down, in their order.
        marks: What else was done; the last ones.
    """

    def __init__(self, most_vectors: int = MAX_VECTORS) -> None:
        self.vectors = Vectors(most_vectors)
        self.marks: list[Mark] = []

    @property
    def cut(self) -> list[Vector]:
        """The vectors that were cut."""
        return [each for each in self.vectors if each.is_down]

    def mark(self, name: str, text: str, x: float, y: float) -> None:
        """Add something else that was done."""
        if len(self.marks) >= MAX_MARKS:
            del self.marks[: MAX_MARKS // 2]
        self.marks.append(Mark(self.vectors.total, name, text, round(x), round(y)))

    def clear(self) -> None:
        """Begin a new sheet."""
        self.vectors.clear()
        self.marks.clear()
