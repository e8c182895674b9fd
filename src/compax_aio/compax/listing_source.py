"""Where a listing comes from: a file, a text, lines, or records by number."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final, TypeAlias

from ..errors import InvalidCommandError
from .program.records import Record

__all__ = ["ListingSource", "load_listing"]

ListingSource: TypeAlias = Path | str | Mapping[int, Record] | Iterable[str]
"""A file or its name; a listing; its lines; or records by number."""

_MAX_BYTES: Final = 256 * 1024
"""Of a file; so many characters may a text have."""

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
    if isinstance(source, str) and _LISTING.match(source.removeprefix(_BYTE_ORDER_MARK)):
        return _as_text(source)
    if isinstance(source, str | Path):
        return await asyncio.get_running_loop().run_in_executor(None, _read_file, Path(source))
    return _as_text("\n".join(source))


def _as_text(text: str) -> str:
    if len(text) > _MAX_BYTES:
        raise InvalidCommandError(f"the text is larger than any listing: more than {_MAX_BYTES} characters")
    return text.removeprefix(_BYTE_ORDER_MARK)


def _read_file(path: Path) -> str:
    if "\0" in str(path):
        raise InvalidCommandError(f"{str(path)!r:.60} is neither a listing nor the name of a file")
    with path.open("rb") as file:
        data = file.read(_MAX_BYTES + 1)
    if len(data) > _MAX_BYTES:
        raise InvalidCommandError(f"{path} is larger than any listing: more than {_MAX_BYTES} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidCommandError(f"{path} is no listing: {error}") from error
