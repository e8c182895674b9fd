"""One command from its words to its exit code: Ctrl-C stops what moves and says so, errors never show a traceback."""

from __future__ import annotations

import asyncio
import inspect
import logging
import os
import sys
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from typing import Any, Final

from cyclopts import App, CycloptsError

from ..errors import CompaxError
from .exit_codes import INTERRUPTED, OK, USAGE, Interrupted, UsageError, exit_code_of
from .interruption import Interruption
from .outlets import outlets_open, until_written
from .printing import Printing, notes_console, tell_error, tell_warning

__all__ = ["run_words"]

_TRACEBACK_VARIABLE: Final = "COMPAX_TRACEBACK"
"""Set to 1, it lets a defect be seen whole, for a report."""
_LOOP_VARIABLE: Final = "COMPAX_LOOP"
"""Set to ``asyncio``, it keeps to the event loop of Python although uvloop is installed."""


def run_words(app: App, words: Sequence[str], prepare: Callable[[Sequence[str]], None] = lambda _: None) -> int:
    """
    Parse *words*, carry out the command that they name, and return the exit code.

    Args:
        app: That knows the commands.
        words: Of the command line, without the name of the program.
        prepare: Called with them first; what it raises is told like all else.
    """
    as_document = "--json" in words  # as long as nobody could parse them
    try:
        prepare(words)
        # What a command imports may be missing, so that parsing can fail by more than its words.
        command, bound, _ = app.parse_args(list(words), exit_on_error=False, print_error=not as_document)
    except CycloptsError as error:
        if as_document:
            _tell(UsageError(str(error).strip()), as_document=True)
        return USAGE  # it has been printed, with what would be right
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else OK
    except ImportError as error:
        return _told_of(_missing(error), as_document=as_document)
    except (KeyboardInterrupt, Exception) as error:
        return _told_of(error, as_document=as_document)
    as_document = any(isinstance(each, Printing) and each.json for each in bound.arguments.values())
    with ExitStack() as stack:
        stack.enter_context(_warnings_told(as_document=as_document))
        interruption = stack.enter_context(Interruption(command))
        if not interruption.moves_nothing:  # what moves is watched and stopped although nobody takes the output
            stack.enter_context(outlets_open(lambda: interruption.signal is not None))
        try:
            return _told(command, bound, interruption, as_document=as_document)
        except KeyboardInterrupt as impatience:  # all is over, but for last words that nobody takes
            return exit_code_of(impatience)


def _told(
    command: Callable[..., Any], bound: inspect.BoundArguments, interruption: Interruption, *, as_document: bool
) -> int:
    """Carry *command* out; return its exit code, or that of the error that it raises, once that is told."""
    try:
        code = _carry_out(command, bound, interruption)
        _flush()
        if code == INTERRUPTED and interruption.signal is not None:  # one that is meant to end so, by whichever signal
            code = exit_code_of(Interrupted(interruption.signal))
    except KeyboardInterrupt as interrupt:
        if not as_document:
            with suppress(OSError):
                notes_console().print(interruption.text, markup=False)
        return exit_code_of(interrupt)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else OK
    except (Exception, asyncio.CancelledError) as error:
        single = _only_one(error)
        if interruption.note is not None:
            single.add_note(interruption.note)
        return _told_of(single, as_document=as_document)
    return code


def _told_of(error: BaseException, *, as_document: bool) -> int:
    """Tell *error*, and return its exit code; one of our own defects is told as such."""
    if isinstance(error, BrokenPipeError):  # whoever read our output has seen enough
        _write_to_nobody()
        return exit_code_of(error)
    if isinstance(error, KeyboardInterrupt):
        return exit_code_of(error)
    if not _is_foreseen(error):
        if os.environ.get(_TRACEBACK_VARIABLE) == "1":
            raise error
        error.add_note(f"This is a defect of compax. {_TRACEBACK_VARIABLE}=1 shows where, for a report.")
    _tell(error, as_document=as_document)
    with suppress(OSError, ValueError):
        _flush()
    return exit_code_of(error) if isinstance(error, Exception) else 1


def _is_foreseen(error: BaseException) -> bool:
    if isinstance(error, BaseExceptionGroup):
        return all(map(_is_foreseen, error.exceptions))
    return isinstance(error, CompaxError | OSError | UsageError)


def _missing(error: ImportError) -> Exception:
    """Say which library is not installed; what is missing of our own stays a defect."""
    cause: BaseException = error
    while cause.__cause__ is not None:
        cause = cause.__cause__
    name = cause.name if isinstance(cause, ModuleNotFoundError) else None
    if name is None or name.partition(".")[0] == "compax_aio":
        return error
    return UsageError(
        f"this command needs {name}, which is not installed; install compax with its libraries: "
        "pip install 'compax-aio[cli,plot,parquet]'"
    )


def _carry_out(command: Callable[..., Any], bound: inspect.BoundArguments, interruption: Interruption) -> int:
    async def watched() -> Any:
        interruption.watch()
        return await command(*bound.args, **bound.kwargs)

    if inspect.iscoroutinefunction(command):
        try:
            result = _run(watched())
        except asyncio.CancelledError:
            if interruption.signal is None:
                raise
            raise Interrupted(interruption.signal) from None
    else:
        result = command(*bound.args, **bound.kwargs)
    return result if isinstance(result, int) and not isinstance(result, bool) else OK


def _run(work: Coroutine[Any, Any, Any]) -> Any:
    """Run *work* to its end, on uvloop where that is installed: it takes less of the CPU."""
    make_loop = _uvloop() if os.environ.get(_LOOP_VARIABLE) != "asyncio" else None
    if make_loop is None:
        return asyncio.run(work)  # by the name of the module, so that tests can let it run on a virtual clock
    with asyncio.Runner(loop_factory=make_loop) as runner:
        return runner.run(work)


def _uvloop() -> Callable[[], asyncio.AbstractEventLoop] | None:
    """Return what makes event loops of uvloop; None where that is not installed."""
    try:
        make_loop: Callable[[], asyncio.AbstractEventLoop] = import_module("uvloop").new_event_loop
    except ImportError:
        return None
    return make_loop


def _only_one(error: BaseException) -> BaseException:
    """Take the one error out of a group of one, as task groups make them."""
    while isinstance(error, BaseExceptionGroup) and len(error.exceptions) == 1:
        error = error.exceptions[0]
    return error


# What is written ------------------------------------------------------------------------------------------------------


def _tell(error: BaseException, *, as_document: bool) -> None:
    with suppress(OSError):  # of a terminal that is gone
        tell_error(error, as_document=as_document)


def _flush() -> None:
    """Write what waits, while there is still somebody to tell that it cannot be written."""
    try:
        until_written(sys.stdout)
        sys.stdout.flush()
    except OSError:
        _write_to_nobody()  # or Python would complain at its end once more
        raise


def _write_to_nobody() -> None:
    with suppress(OSError, ValueError):
        nobody = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nobody, sys.stdout.fileno())
        os.close(nobody)


class _Warnings(logging.Handler):
    """Tells warnings of the library beside the results, one line each."""

    def __init__(self, *, as_document: bool) -> None:
        super().__init__(logging.WARNING)
        self._as_document = as_document

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError):
            tell_warning(record.getMessage(), as_document=self._as_document)


@contextmanager
def _warnings_told(*, as_document: bool) -> Iterator[None]:
    logger, handler = logging.getLogger("compax_aio"), _Warnings(as_document=as_document)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
