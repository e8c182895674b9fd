"""A thread of one's own for what may get stuck, such as a disk: it holds up nobody, not even the end of the program."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from queue import SimpleQueue
from threading import Thread
from typing import ParamSpec, TypeVar
from weakref import finalize

__all__ = ["OwnThread"]

_T = TypeVar("_T")
_P = ParamSpec("_P")


class OwnThread(Executor):
    """
    An executor of one daemon thread, which does one thing after the other; it ends with the executor, if not before.

    Args:
        name: Of the thread.
    """

    def __init__(self, name: str) -> None:
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        # The thread knows its jobs and not the executor: one that everybody has forgotten holds no thread.
        Thread(target=_work, args=(self._jobs,), name=name, daemon=True).start()
        finalize(self, self._jobs.put, None)

    def submit(self, fn: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> Future[_T]:
        """Let the thread call *fn*, when it has done all that came before."""
        future: Future[_T] = Future()

        def job() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(fn(*args, **kwargs))
            except BaseException as error:  # it is for whoever waits
                future.set_exception(error)

        self._jobs.put(job)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Let the thread end when it has done what it was told; nobody waits for that."""
        self._jobs.put(None)


def _work(jobs: SimpleQueue[Callable[[], None] | None]) -> None:
    while (job := jobs.get()) is not None:
        job()
        del job  # or it would be held, with all that it knows, until the next one comes
