"""The lines typed before: a file of the user's own, readable by nobody else, of bounded length."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from prompt_toolkit.history import History

from ...errors import InvalidCommandError
from ...text_file import read_text, replace_file

__all__ = ["MOST_LINES", "LineHistory", "history_file"]

MOST_LINES: Final = 500
"""That are kept; the file has twice as many at most."""

_LONGEST: Final = 100
"""Characters of a line that is kept; the drive takes 30."""


def history_file() -> Path:
    """Return where the history is kept: ``compax/shell_history`` in the folder of the user's state (XDG)."""
    state = os.environ.get("XDG_STATE_HOME", "")
    # By the specification a path that is not absolute does not count.
    folder = Path(state) if state and Path(state).is_absolute() else Path.home() / ".local" / "state"
    return folder / "compax" / "shell_history"


class LineHistory(History):
    """
    Keeps lines in a file, one a line; a file that cannot be used costs nothing but the memory.

    Attributes:
        trouble: Why the file cannot be used; None while it can.

    Args:
        path: Of the file; it and its folder are made when there is something to keep.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.trouble: str | None = None
        self._path = path
        self._kept = 0
        """How many lines the file has, as far as it is known here."""

    def load_history_strings(self) -> Iterable[str]:
        """Return the lines kept, newest first."""
        try:
            return reversed(self._shortened())
        except FileNotFoundError:
            return []
        except (OSError, InvalidCommandError) as error:
            self.trouble = str(error)
            return []

    def store_string(self, string: str) -> None:
        """Keep one line more."""
        if self.trouble is not None or not string.isprintable() or len(string) > _LONGEST:
            return
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            with os.fdopen(descriptor, "w", encoding="utf-8") as file:
                file.write(f"{string}\n")
            self._kept += 1
            if self._kept > 2 * MOST_LINES:
                self._shortened()
        except (OSError, InvalidCommandError) as error:
            self.trouble = str(error)

    def _shortened(self) -> list[str]:
        """Return the newest lines, oldest first; those that are too many are taken out of the file."""
        lines = read_text(self._path, "history").splitlines()
        if len(lines) > MOST_LINES:
            lines = lines[-MOST_LINES:]
            replace_file(self._path, "".join(f"{line}\n" for line in lines))
        self._kept = len(lines)
        return lines
