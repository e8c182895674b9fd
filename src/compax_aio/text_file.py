"""Small text files: read without waiting for anything that is no file, and written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final

from .errors import InvalidCommandError
from .escaping import escaped, shown

__all__ = ["MAX_BYTES", "expect_file", "name_of", "open_file", "read_text", "replace_file"]

MAX_BYTES: Final = 256 * 1024
"""Of a file; no more is ever read. A full one of parameters, records or settings has a tenth of it."""

_HOW_TO_READ: Final = (
    os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)
)
"""Without waiting: of a pipe nobody may ever open the other end."""


def name_of(path: Path) -> str:
    """Write the name of a file, for errors: on one line, whatever it is."""
    return escaped(str(path))


def read_text(path: Path, what: str) -> str:
    """
    Read a file of UTF-8, with or without a byte order mark, of at most ``MAX_BYTES``.

    Args:
        path: Of the file; a link is followed.
        what: What is expected there, for errors: ``listing``.

    Raises:
        InvalidCommandError: It is too large, or no text, or *path* can be no name.
        OSError: It cannot be read.
    """
    with open_file(path) as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise InvalidCommandError(f"{name_of(path)} is larger than any {what}: more than {MAX_BYTES} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidCommandError(f"{name_of(path)} is no {what}: {error}") from error


def open_file(path: Path) -> BinaryIO:
    """
    Open a plain file to be read; a link is followed.

    Takes no longer than the disk does: a pipe, a device or a folder is refused, and before it is opened, for opening
    a serial port may switch what is connected to it.

    Raises:
        InvalidCommandError: *path* can be no name.
        OSError: It cannot be opened.
    """
    try:
        expect_file(path, path.stat())
        descriptor = os.open(path, _HOW_TO_READ)
    except ValueError:
        raise InvalidCommandError(f"{shown(str(path))} can be no name of a file") from None
    file = os.fdopen(descriptor, "rb")
    try:
        expect_file(path, os.fstat(descriptor))  # it may have been replaced since
    except BaseException:
        file.close()
        raise
    return file


def replace_file(path: Path, text: str) -> None:
    """
    Write *text* to *path*; a file that is there is replaced at the end, or left as it is.

    It keeps its permissions, and a link stays one: the file that it leads to is replaced. A pipe or a device is not.
    What is written first lies beside it, under a name that nobody can know before.

    Raises:
        InvalidCommandError: *path* can be no name.
        OSError: The file cannot be written.
    """
    try:
        path = Path(os.path.realpath(path))
        with suppress(FileNotFoundError):
            expect_file(path, path.stat())
    except ValueError:
        raise InvalidCommandError(f"{shown(str(path))} can be no name of a file") from None
    new = path.parent / f".{path.name[:32]}.{secrets.token_hex(8)}"
    with new.open("x", encoding="utf-8") as file:
        try:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
            with suppress(OSError):  # there is none, or it is another's
                new.chmod(path.stat().st_mode)
        except BaseException:
            new.unlink()
            raise
    try:
        new.replace(path)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise


def expect_file(path: Path, status: os.stat_result) -> None:
    """Raise OSError unless *status*, that of *path*, is of a plain file."""
    if not stat.S_ISREG(status.st_mode):
        if stat.S_ISDIR(status.st_mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise OSError(errno.EINVAL, "It is a pipe, a socket or a device, and no plain file", str(path))
