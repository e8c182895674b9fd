"""Files of commands: read before a line is opened, and never written over one that is there, unless that is said."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from compax_aio import InvalidCommandError

__all__ = ["Force", "expect_free", "reading"]

Force = Annotated[bool, Parameter(negative=(), help="Replace a file that is there already.")]


def expect_free(path: Path, *, force: bool) -> None:
    """
    Do nothing if *path* may be written; to be asked before a line is opened.

    Raises:
        InvalidCommandError: A file is there already, and *force* was not said; or its folder is not there.
    """
    if not force and (path.exists() or path.is_symlink()):
        raise InvalidCommandError(f"{path} is there already", hint="take another name, or say --force to replace it")
    if not path.parent.is_dir():
        raise InvalidCommandError(f"{path} cannot be written: there is no folder {path.parent}")


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """
    Read *path* in a block, before anything is sent.

    Raises:
        InvalidCommandError: It cannot be read.
    """
    try:
        yield
    except OSError as error:
        raise InvalidCommandError(f"{path} cannot be read: {error.strerror or error}") from error
