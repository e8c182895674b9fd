"""What the exit code of ``compax`` says, for scripts."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import Final

from .. import errors

__all__ = ["EXIT_CODES", "INTERRUPTED", "OK", "USAGE", "ExitCode", "Interrupted", "UsageError", "exit_code_of"]

OK: Final = 0
USAGE: Final = 2
INTERRUPTED: Final = 130
"""128 and the number of SIGINT, as shells have it."""

_TERMINATED: Final = 143
_HUNG_UP: Final = 129
_NOBODY_READS: Final = 141
"""What a shell tells of a program that SIGPIPE has ended."""


class Interrupted(KeyboardInterrupt):
    """A signal has ended the command; what it had set in motion was stopped."""

    def __init__(self, by: signal.Signals = signal.SIGINT) -> None:
        super().__init__(by.name)
        self.signal = by


class UsageError(Exception):
    """The words of the command are not understood."""


@dataclass(frozen=True, slots=True)
class ExitCode:
    """What one exit code says, and which errors end in it."""

    code: int
    meaning: str
    kinds: tuple[type[BaseException], ...] = ()


EXIT_CODES: Final = (
    ExitCode(OK, "done, and confirmed by the device"),
    ExitCode(
        USAGE, "refused before a byte was sent: wrong words, numbers, files", (errors.InvalidCommandError, UsageError)
    ),
    ExitCode(8, "a move is in doubt: nobody can say what became of it", (errors.MoveInDoubtError,)),
    ExitCode(7, "a move did not end at its target: stopped, fault, time", (errors.MoveError,)),
    ExitCode(3, "the line could not be opened, or was lost", (errors.TransportError,)),
    ExitCode(4, "the device did not answer in time", (errors.AnswerTimeoutError,)),
    ExitCode(5, "the device answered with an error", (errors.CommandRejectedError,)),
    ExitCode(6, "the device answered something else, or another device is there", (errors.UnexpectedAnswerError,)),
    ExitCode(9, "a restore or download stopped half way; what was applied is said", (errors.RestoreIncompleteError,)),
    ExitCode(_NOBODY_READS, "whoever read the output went away; what moved was stopped", (BrokenPipeError,)),
    ExitCode(1, "anything else went wrong", (Exception,)),
    ExitCode(_HUNG_UP, "ended by SIGHUP, as by closing the terminal; what moved was stopped"),
    ExitCode(_TERMINATED, "ended by SIGTERM; what moved was stopped"),
    ExitCode(INTERRUPTED, "interrupted by Ctrl-C; what moved was stopped", (KeyboardInterrupt,)),
)
"""The first that fits counts: a move that is refused because another one runs was refused before a byte was sent."""


def exit_code_of(error: BaseException) -> int:
    """Return the exit code that tells of *error*."""
    if isinstance(error, Interrupted):
        return 128 + error.signal
    return next(each.code for each in EXIT_CODES if isinstance(error, each.kinds))
