"""Output that nobody takes: it holds up nothing, is bounded, and comes whole and in order when somebody does."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from compax_aio.cli import outlets
from compax_aio.cli.outlets import Outlet, is_held_up, outlets_open, until_written

pytestmark = pytest.mark.real_time

MANY = "x" * (1024 * 1024 - 10)
"""More than any pipe takes at once."""


class Pipe:
    """A pipe in the place of a stream of this process."""

    def __init__(self) -> None:
        self.reading, writing = os.pipe()
        self.stream = io.TextIOWrapper(os.fdopen(writing, "wb", buffering=0), "utf-8", write_through=True)
        self._reader: threading.Thread | None = None

    def all_read(self) -> str:
        """Let somebody read it to its end."""
        self.stream.close()
        with os.fdopen(os.dup(self.reading), encoding="utf-8") as there:
            return there.read()

    def is_read(self) -> None:
        """Let somebody read on, and look at nothing."""
        there = os.fdopen(os.dup(self.reading), "rb", buffering=0)

        def read() -> None:
            with there:
                while there.read(65536):
                    pass

        self._reader = threading.Thread(target=read)
        self._reader.start()

    def close(self) -> None:
        """Let nobody write any more, and then nobody read."""
        self.stream.close()
        if self._reader is None:
            self.is_read()
        assert self._reader is not None
        self._reader.join()
        os.close(self.reading)


@pytest.fixture
def out() -> Iterator[Pipe]:
    pipe = Pipe()
    yield pipe
    pipe.close()


@contextlib.contextmanager
def leading_to(*streams: str, stdout: Any, hurried: bool = False) -> Iterator[None]:
    """Let standard output, and other *streams*, lead to *stdout* in a block where they hold up nothing."""
    names = ("stdout", *streams)
    before = {name: getattr(sys, name) for name in names}
    for name in names:
        setattr(sys, name, stdout)
    try:
        with outlets_open(lambda: hurried):
            yield
        assert all(getattr(sys, name) is stdout for name in names)
    finally:
        for name, stream in before.items():
            setattr(sys, name, stream)


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")


def test_what_nobody_takes_holds_up_nothing_and_is_bounded(out: Pipe) -> None:
    with leading_to(stdout=out.stream, hurried=True):
        assert not is_held_up(sys.stdout)
        say(MANY)
        assert is_held_up(sys.stdout)
        with pytest.raises(OSError, match="nobody takes what is written here"):
            say(MANY)


def test_all_that_was_taken_is_written_at_the_end(out: Pipe) -> None:
    out.is_read()
    with leading_to(stdout=out.stream):
        say(MANY)
        outlet = sys.stdout
    assert not is_held_up(outlet)


def test_lines_come_in_their_order_from_both_streams_of_one_place(out: Pipe) -> None:
    with leading_to("stderr", stdout=out.stream):
        for number in range(100):
            (sys.stderr if number % 2 else sys.stdout).write(f"{number}\n")
    assert out.all_read().split() == [str(number) for number in range(100)]


def test_a_pipe_that_does_not_wait_is_written_whole(out: Pipe) -> None:
    os.set_blocking(out.stream.fileno(), False)
    out.is_read()
    with leading_to(stdout=out.stream):
        say(MANY)
        until_written(sys.stdout)
        sys.stdout.flush()


def test_who_reads_no_more_is_told_of_at_the_next_line(out: Pipe) -> None:
    reading, out.reading = out.reading, os.open(os.devnull, os.O_RDONLY)
    os.close(reading)
    with leading_to(stdout=out.stream):
        say("nobody reads this")
        until_written(sys.stdout)
        with pytest.raises(BrokenPipeError):
            say("nor this")
        with pytest.raises(BrokenPipeError):
            sys.stdout.flush()
        until_written(sys.stdout)


def test_characters_are_written_as_the_stream_would(out: Pipe) -> None:
    out.stream.reconfigure(encoding="ascii", errors="backslashreplace")
    with leading_to(stdout=out.stream):
        say("→ 3°")
        assert (sys.stdout.encoding, sys.stdout.errors) == ("ascii", "backslashreplace")
        assert sys.stdout.writable()
        assert not sys.stdout.isatty()
        assert sys.stdout.fileno() == out.stream.fileno()
    assert out.all_read() == "\\u2192 3\\xb0\n"


def test_a_file_and_the_empty_device_take_what_they_get(tmp_path: Path) -> None:
    for path in (tmp_path / "file", Path(os.devnull)):
        with path.open("w") as file, leading_to(stdout=file):
            assert sys.stdout is file
            until_written(sys.stdout)


def test_the_screen_of_a_library_goes_the_same_way(out: Pipe) -> None:
    with leading_to("stderr", "__stderr__", stdout=out.stream):
        assert isinstance(sys.__stderr__, Outlet)


def test_whoever_cannot_wait_for_the_last_words_interrupts(out: Pipe) -> None:
    def interrupt() -> None:
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, interrupt)
    with leading_to(stdout=out.stream):
        say(MANY)
        timer.start()
    timer.join()


def test_one_who_is_in_a_hurry_waits_for_a_moment(out: Pipe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outlets, "_LAST_WORDS_S", 0.05)
    with leading_to(stdout=out.stream, hurried=True):
        say(MANY)
