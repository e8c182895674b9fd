"""One command from its words to its exit code: Ctrl-C stops what moves and says so, errors never show a traceback."""

from __future__ import annotations

import asyncio
import inspect
import logging
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, Final

from cyclopts import App, CycloptsError

from ..errors import CompaxError
from .exit_codes import INTERRUPTED, OK, USAGE, exit_code_of
from .printing import Printing, notes_console, tell_error

__all__ = ["run_words"]

_TRACEBACK_VARIABLE: Final = "COMPAX_TRACEBACK"
"""Set to 1, it lets a defect be seen whole, for a report."""

_log = logging.getLogger("compax_aio.cli")


def run_words(app: App, words: Sequence[str]) -> int:
    """Parse *words*, carry out the command that they name, and return the exit code."""
    try:
        command, bound, _ = app.parse_args(list(words), exit_on_error=False, print_error=True)
    except CycloptsError:
        return USAGE  # it has been printed, with what would be right
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else OK
    as_document = any(isinstance(each, Printing) and each.json for each in bound.arguments.values())
    return _told(lambda: _carry_out(command, *bound.args, **bound.kwargs), as_document=as_document)


def _told(carry_out: Callable[[], int], *, as_document: bool) -> int:
    """Return what *carry_out* returns, or the exit code of the error that it raises, once that is told."""
    try:
        return carry_out()
    except KeyboardInterrupt:
        if not as_document:
            notes_console().print("Interrupted. What this command had set in motion was stopped, and it stands.")
        return INTERRUPTED
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except (CompaxError, OSError, ExceptionGroup) as error:
        single = _only_one(error)
        tell_error(single, as_document=as_document)
        return exit_code_of(single)
    except Exception as defect:
        if os.environ.get(_TRACEBACK_VARIABLE) == "1":
            raise
        defect.add_note(f"This is a defect of compax. {_TRACEBACK_VARIABLE}=1 shows where, for a report.")
        tell_error(defect, as_document=as_document)
        return exit_code_of(defect)


def _carry_out(command: Callable[..., Any], *arguments: Any, **options: Any) -> int:
    # By the name of the module, so that tests can let it run on a virtual clock.
    result = asyncio.run(command(*arguments, **options)) if _is_async(command) else command(*arguments, **options)
    return result if isinstance(result, int) and not isinstance(result, bool) else OK


def _is_async(command: Callable[..., Any]) -> bool:
    return inspect.iscoroutinefunction(command)


def _only_one(error: BaseException) -> BaseException:
    """Take the one error out of a group of one, as task groups make them."""
    while isinstance(error, BaseExceptionGroup) and len(error.exceptions) == 1:
        error = error.exceptions[0]
    return error
