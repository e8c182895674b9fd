"""A job of any source as whole instructions that get through: streamed, stripped, and long lists parted."""

from __future__ import annotations

import asyncio
import os
from collections import deque
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import BinaryIO, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import open_file
from .facts.line import DC1, DC3, ENQ
from .facts.mnemonics import Shape, mnemonic_of
from .language.instruction import Instruction, Language
from .language.job import as_bytes, tokeniser_for
from .language.splitting import split_long
from .language.stripping import stripped
from .profiles import Profile

__all__ = ["Feed", "JobSource", "Source", "as_source"]

JobSource = str | bytes | os.PathLike[str] | AsyncIterator[bytes | str]
"""A job: text, bytes, a path, or what comes piece by piece."""

_PIECE_BYTES: Final = 8192

_LINE_SIGNS: Final = bytes((DC1, DC3, ENQ))
_TEXTS: Final = frozenset({Shape.LABEL, Shape.QUOTED})


class Source:
    """
    Where the bytes of a job come from, in pieces.

    Attributes:
        name: For people.
        total_bytes: How many there are; None if nobody knows.
        is_whole: Whether it can be read twice: once to check it, and once to send it.
    """

    name: str = "job"
    total_bytes: int | None = None
    is_whole = True

    def begin(self) -> AsyncIterator[bytes]:
        """Read it, from its beginning."""
        raise NotImplementedError

    async def close(self) -> None:
        """Let go of it."""


class _Bytes(Source):
    def __init__(self, data: bytes) -> None:
        self.total_bytes = len(data)
        self._data = data

    async def begin(self) -> AsyncIterator[bytes]:
        for start in range(0, len(self._data), _PIECE_BYTES):
            yield self._data[start : start + _PIECE_BYTES]


class _File(Source):
    """A file; read in a thread, for a disk may take its time."""

    def __init__(self, path: os.PathLike[str]) -> None:
        self._path = Path(path)
        self.name = self._path.name
        self._file: BinaryIO | None = None

    async def begin(self) -> AsyncIterator[bytes]:
        await self.close()
        self._file = await asyncio.to_thread(self._open)
        while data := await asyncio.to_thread(self._file.read, _PIECE_BYTES):
            yield data

    def _open(self) -> BinaryIO:
        file = open_file(self._path)  # a pipe cannot be read twice, and may never begin
        self.total_bytes = os.fstat(file.fileno()).st_size
        return file

    async def close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.close()


class _Pieces(Source):
    is_whole = False

    def __init__(self, pieces: AsyncIterator[bytes | str]) -> None:
        self._pieces = pieces

    async def begin(self) -> AsyncIterator[bytes]:
        async for piece in self._pieces:
            data = as_bytes(piece)
            for start in range(0, len(data), _PIECE_BYTES):
                yield data[start : start + _PIECE_BYTES]


def as_source(job: JobSource) -> Source:
    """
    Take a job of any kind.

    Raises:
        InvalidCommandError: It is none, or a character of it has no code of 8 bits.
    """
    if isinstance(job, str | bytes | bytearray | memoryview):
        return _Bytes(as_bytes(job if isinstance(job, str) else bytes(job)))
    if isinstance(job, os.PathLike):
        return _File(job)
    if isinstance(job, AsyncIterator):
        return _Pieces(job)
    raise InvalidCommandError(
        f"a job is text, bytes, a path or an asynchronous iterator of pieces, not {shown(job)}",
        hint="a text is a job itself; of a file, give pathlib.Path(name)",
    )


class Feed:
    """
    Gives the instructions of a job, in bursts.

    Args:
        source: Of its bytes.
        profile: Of the machine, whose languages it is read in.
        longest_bytes: Long lists of coordinates are parted into instructions of so many bytes.
        most_bytes: A longer instruction is refused.
        examine: Is shown each instruction before it goes; raises what it does not like.

    Attributes:
        left_out: How many instructions were none for the cutter: device control, and instructions that answer.
    """

    def __init__(
        self,
        source: Source,
        profile: Profile,
        longest_bytes: int,
        most_bytes: int,
        examine: Callable[[Instruction], None] = lambda _: None,
    ) -> None:
        self.left_out = 0
        self._longest_bytes = longest_bytes
        self._most_bytes = most_bytes
        self._examine = examine
        self._source = source
        self._pieces = source.begin()
        self._tokeniser = tokeniser_for(profile)
        self._waiting: deque[Instruction] = deque()
        self._waiting_bytes = 0
        self._is_read = False

    async def take(self, most_bytes: int) -> list[Instruction]:
        """
        Return the next instructions, one at least and not much more than *most_bytes*; none at the end.

        Raises:
            InvalidCommandError: An instruction is too long, or *examine* does not like one; those before it are given
                first.
        """
        # What comes piece by piece may come slowly: what is there goes before more is waited for.
        while not self._is_read and self._waiting_bytes < (most_bytes if self._source.is_whole else 1):
            await self._read_more()
        taken: list[Instruction] = []
        size = 0
        while self._waiting and (not taken or size + len(self._waiting[0].data) <= most_bytes):
            each = self._waiting[0]
            try:
                self._check(each)
            except InvalidCommandError:
                if taken:
                    return taken
                raise
            self._waiting.popleft()
            self._waiting_bytes -= len(each.data)
            size += len(each.data)
            taken.append(each)
        return taken

    def put_back(self, rest: list[Instruction]) -> None:
        """Take back what could not be sent yet."""
        self._waiting.extendleft(reversed(rest))
        self._waiting_bytes += sum(len(each.data) for each in rest)

    async def close(self) -> None:
        """Let go of the source."""
        await self._source.close()

    async def _read_more(self) -> None:
        piece = await anext(self._pieces, None)
        self._is_read = piece is None
        found = self._tokeniser.finish() if piece is None else self._tokeniser.feed(piece)
        for each in found:
            self._put(each)

    def _put(self, instruction: Instruction) -> None:
        if instruction.language is Language.BLANK and not instruction.data.strip():
            return
        clean = stripped(instruction)
        if clean is None:
            self.left_out += 1
            return
        self.left_out += clean is not instruction
        for part in split_long(clean, self._longest_bytes):
            self._waiting.append(part)
            self._waiting_bytes += len(part.data)

    def _check(self, instruction: Instruction) -> None:
        self._examine(instruction)
        if instruction.data.translate(None, _LINE_SIGNS) != instruction.data:
            raise InvalidCommandError(
                f"{instruction} has DC1, DC3 or ENQ in it, which the line takes for signs of a handshake",
                hint="take them out of the job",
            )
        row = None if instruction.is_complete else mnemonic_of(instruction.name)
        if row is not None and row.shape in _TEXTS:
            raise InvalidCommandError(
                f"{instruction} has no end, so that whatever follows would be part of it",
                hint="a label ends with ETX (03 hex), unless DT has set another sign",
            )
        if len(instruction.data) > self._most_bytes:
            raise InvalidCommandError(
                f"{instruction} has {len(instruction.data)} bytes, and no more than {self._most_bytes} get through the "
                "cutter's buffer with this handshake",
                hint="write it in several instructions; lists of coordinates are parted by themselves",
            )
