"""A job: its bytes, its instructions, and how it is read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ...errors import InvalidCommandError
from ..profiles import PNC_1610, Profile
from .instruction import Instruction, Language
from .tokeniser import LONGEST_BYTES, Tokeniser

__all__ = ["Job", "as_bytes", "instructions_of", "parse", "tokeniser_for"]

_PIECE_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class Job:
    """A job that is at hand as a whole."""

    instructions: tuple[Instruction, ...]
    """In their order; their bytes, one behind the other, are the job."""

    @property
    def data(self) -> bytes:
        """All of its bytes."""
        return b"".join(each.data for each in self.instructions)

    def __len__(self) -> int:
        """How many bytes it has."""
        if not self.instructions:
            return 0
        last = self.instructions[-1]
        return last.offset + len(last.data)

    def __iter__(self) -> Iterator[Instruction]:
        """Give its instructions."""
        return iter(self.instructions)


def as_bytes(text: str | bytes) -> bytes:
    """
    Return *text* as it goes over the line, a byte for each character.

    Raises:
        InvalidCommandError: A character has no code of 8 bits; its line and column are told.
    """
    if not isinstance(text, str):
        return bytes(text)
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        before = text[: error.start]
        line = before.count("\n") + 1
        column = error.start - before.rfind("\n")
        raise InvalidCommandError(
            f"line {line}, column {column}: {text[error.start]!r} has no code of 8 bits",
            hint="write it with a character that the cutter has, or give the job as bytes",
        ) from None


def tokeniser_for(profile: Profile = PNC_1610, *, longest_bytes: int = LONGEST_BYTES) -> Tokeniser:
    """Return a tokeniser for the languages of that machine: mode 2 alone where it has no mode 1."""
    return Tokeniser(language=None if profile.has_mode_1 else Language.TWO, longest_bytes=longest_bytes)


def instructions_of(pieces: Iterable[str | bytes], profile: Profile = PNC_1610) -> Iterator[Instruction]:
    """Take a job apart as it comes, in pieces of any size; memory is that of a piece and of the longest instruction."""
    tokeniser = tokeniser_for(profile)
    for piece in pieces:
        data = as_bytes(piece)
        for start in range(0, len(data), _PIECE_BYTES):
            yield from tokeniser.feed(data[start : start + _PIECE_BYTES])
    yield from tokeniser.finish()


def parse(job: str | bytes, profile: Profile = PNC_1610) -> Job:
    """
    Take a job apart into instructions; nothing is checked but that it can be.

    Args:
        job: Text or bytes; of a file, read it as bytes.
        profile: The machine, whose languages it is read in.

    Raises:
        InvalidCommandError: A character has no code of 8 bits, or an instruction has more than 1 MiB.
    """
    return Job(tuple(instructions_of((job,), profile)))
