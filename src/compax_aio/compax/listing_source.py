"""Where a listing comes from: a file, a text, lines, or records by number."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final, NoReturn, TypeAlias

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import MAX_BYTES, read_text
from .program.records import Record

__all__ = ["ListingSource", "load_listing"]

ListingSource: TypeAlias = Path | str | Mapping[int, Record] | Iterable[str]
"""A file or its name; a listing; its lines; or records by number."""

_BYTE_ORDER_MARK: Final = "\ufeff"
_LISTING: Final = re.compile(r"\s*[Nn]\s*[0-9]|.*[\r\n]|\s*$")
"""A text that begins so is a listing; another one names its file."""


async def load_listing(source: ListingSource) -> str | Mapping[int, Record]:
    """
    Return the text of a listing, or the records that *source* is.

    A text is a listing if it has a line break, begins with a record number, or is empty; else it names a file.

    Raises:
        InvalidCommandError: The file or text is too large, or the file is no text, or its name none.
        OSError: It cannot be read.
    """
    if isinstance(source, Mapping):
        return source
    if isinstance(source, str):
        source = str.__str__(source)
        if _LISTING.match(source.removeprefix(_BYTE_ORDER_MARK)):
            return _as_text(source)
    if isinstance(source, str | Path):
        return await asyncio.get_running_loop().run_in_executor(None, read_text, Path(source), "listing")
    return _as_text("\n".join(_bounded(source)))


def _bounded(lines: Iterable[str]) -> Iterator[str]:
    """Take *lines* one by one: somebody's own may have no end."""
    length = 0
    for line in lines:
        if not isinstance(line, str):
            raise InvalidCommandError(f"a line of a listing is a text, not {shown(line)}")
        yield str.__str__(line)
        length += len(line) + 1
        if length > MAX_BYTES:
            _refuse_length()


def _as_text(text: str) -> str:
    if len(text) > MAX_BYTES:
        _refuse_length()
    return text.removeprefix(_BYTE_ORDER_MARK)


def _refuse_length() -> NoReturn:
    raise InvalidCommandError(f"the text is larger than any listing: more than {MAX_BYTES} characters")
