"""Files that commands write: never over one that is there already, unless that is said."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from compax_aio import InvalidCommandError

__all__ = ["Force", "expect_free"]

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
