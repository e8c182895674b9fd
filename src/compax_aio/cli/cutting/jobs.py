"""Jobs as commands read them: from a file or the standard input, whole, before a line is opened."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter

from compax_aio import InvalidCommandError, camm1

from ...text_file import name_of, open_file
from ..files import reading

__all__ = ["STANDARD_INPUT", "JobFile", "NamedJob", "expect_one_input", "read_job", "read_job_patiently"]

STANDARD_INPUT: Final = "-"
_MOST_BYTES: Final = 64 * 1024 * 1024
"""Of a job that a command reads; the largest that was ever heard of has a tenth of it."""
_PIECE_BYTES: Final = 1 << 16

JobFile = Annotated[
    Path,
    Parameter(name="FILE", allow_leading_hyphen=True, help="Job in CAMM-GL III or HP-GL; - is the standard input."),
]


@dataclass(frozen=True)
class NamedJob:
    """A job, and what it is called."""

    name: str
    data: bytes
    job: camm1.Job


def expect_one_input(paths: tuple[Path, ...]) -> None:
    """Do nothing if there are jobs, and at most one of them is the standard input; raises InvalidCommandError."""
    if not paths:
        raise InvalidCommandError("no job was named", hint="a file, or - for the standard input")
    if sum(str(each) == STANDARD_INPUT for each in paths) > 1:
        raise InvalidCommandError("the standard input can be read once only")


def read_job(path: Path, profile: camm1.Profile) -> NamedJob:
    """
    Read a job.

    Raises:
        InvalidCommandError: It cannot be read, is too large, or can be no job.
    """
    if str(path) == STANDARD_INPUT:
        return _named(
            "standard input", _read(lambda size: os.read(sys.stdin.fileno(), size), "standard input"), profile
        )
    with reading(path), open_file(path) as file:
        return _named(path.name, _read(file.read, name_of(path)), profile)


async def read_job_patiently(path: Path, profile: camm1.Profile) -> NamedJob:
    """Read a job as :func:`read_job` does, but let Ctrl-C be heeded while nobody writes to the standard input."""
    if str(path) != STANDARD_INPUT:
        return read_job(path, profile)
    loop = asyncio.get_running_loop()
    result: asyncio.Future[NamedJob] = loop.create_future()

    def tell(job: NamedJob | None, error: Exception | None) -> None:
        if not result.done():
            result.set_result(job) if job is not None else result.set_exception(error or OSError())

    def read() -> None:
        # A thread that the interpreter does not wait for at its end.
        job, error = None, None
        try:
            job = read_job(path, profile)
        except Exception as problem:  # whatever it is, who waits for the job is told
            error = problem
        with suppress(RuntimeError):  # of a loop that is closed
            loop.call_soon_threadsafe(tell, job, error)

    threading.Thread(target=read, daemon=True, name="reads the standard input").start()
    return await result


def _read(read: Callable[[int], bytes], name: str) -> bytes:
    data = bytearray()
    while piece := read(_PIECE_BYTES):
        data += piece
        if len(data) > _MOST_BYTES:
            raise InvalidCommandError(
                f"{name} is larger than any job: more than {_MOST_BYTES:,} bytes",
                hint="cut it in parts, or let a program stream it with compax_aio.camm1",
            )
    return bytes(data)


def _named(name: str, data: bytes, profile: camm1.Profile) -> NamedJob:
    try:
        return NamedJob(name, data, camm1.parse(data, profile))
    except InvalidCommandError as error:
        error.device = error.device or name
        raise
