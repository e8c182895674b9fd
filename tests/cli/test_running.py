"""A command from its words to its exit code: what is said, what is not, and no traceback ever."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from cyclopts import App

from compax_aio import errors
from compax_aio.cli import app as the_app
from compax_aio.cli import interruption as interruptions
from compax_aio.cli.exit_codes import EXIT_CODES, Interrupted, UsageError, exit_code_of
from compax_aio.cli.interruption import in_motion, moves_nothing, say_at_end
from compax_aio.cli.printing import Printing
from compax_aio.cli.running import run_words
from compax_aio.simulator.clock import VirtualClockLoop


@pytest.fixture(autouse=True)
def virtual_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(work: Any) -> Any:
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(work)

    monkeypatch.setattr(asyncio, "run", run)


def carried_out(command: Callable[..., Any], *words: str) -> int:
    app = App(name="compax")
    app.command(command, name="do")
    return run_words(app, ("do", *words))


def raising(error: BaseException, *, mark: bool = False) -> Callable[..., Any]:
    async def command(*, printing: Printing = Printing()) -> None:  # noqa: B008
        raise error

    return moves_nothing(command) if mark else command


# Event loops ----------------------------------------------------------------------------------------------------------


class LoopOfUvloop(VirtualClockLoop):
    """What stands for it here, where it need not be installed."""


@pytest.mark.parametrize(
    ("uvloop", "wanted", "expected"),
    [
        (SimpleNamespace(new_event_loop=LoopOfUvloop), None, LoopOfUvloop),
        (SimpleNamespace(new_event_loop=LoopOfUvloop), "uvloop", LoopOfUvloop),
        (SimpleNamespace(new_event_loop=LoopOfUvloop), "asyncio", VirtualClockLoop),
        (None, None, VirtualClockLoop),
    ],
    ids=["installed", "wanted", "not wanted", "not installed"],
)
def test_a_command_runs_on_uvloop_where_that_is_installed_and_nobody_says_otherwise(
    uvloop: object, wanted: str | None, expected: type[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    loops: list[asyncio.AbstractEventLoop] = []

    async def command() -> None:
        loops.append(asyncio.get_running_loop())

    monkeypatch.setitem(sys.modules, "uvloop", uvloop)
    monkeypatch.delenv("COMPAX_LOOP", raising=False)
    if wanted is not None:
        monkeypatch.setenv("COMPAX_LOOP", wanted)
    assert carried_out(command) == 0
    assert [type(loop) for loop in loops] == [expected]


# Exit codes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.InvalidCommandError("no"), 2),
        (errors.MoveActiveError("no"), 2),
        (errors.ConnectionLostError("no"), 3),
        (errors.AnswerTimeoutError("no"), 4),
        (errors.CommandRejectedError("no"), 5),
        (errors.UnexpectedAnswerError("no"), 6),
        (errors.MoveStoppedError("no"), 7),
        (errors.MoveInDoubtError("no"), 8),
        (errors.RestoreIncompleteError("no"), 9),
        (errors.CompaxError("no"), 1),
        (FileNotFoundError(2, "No such file", "x.toml"), 1),
        (ExceptionGroup("several", [errors.AnswerTimeoutError("no")]), 4),
        (ExceptionGroup("several", [errors.AnswerTimeoutError("a"), errors.AnswerTimeoutError("b")]), 1),
    ],
)
def test_every_error_has_its_exit_code_and_is_told_without_a_traceback(
    error: BaseException, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert carried_out(raising(error)) == code
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.strip()
    assert "Traceback" not in told.err
    assert "defect" not in told.err


def test_exit_codes_are_told_apart() -> None:
    codes = [each.code for each in EXIT_CODES]
    assert len(set(codes)) == len(codes)
    assert exit_code_of(Interrupted(signal.SIGTERM)) in codes
    assert exit_code_of(Interrupted(signal.SIGHUP)) in codes
    assert exit_code_of(KeyboardInterrupt()) == 130
    assert exit_code_of(UsageError("what")) == 2


def test_a_command_may_say_its_exit_code_itself() -> None:
    def command() -> int:
        return 7

    assert carried_out(command) == 7


@pytest.mark.parametrize("result", [None, True, False, "done"])
def test_what_else_a_command_returns_is_success(result: object) -> None:
    async def command() -> object:
        return result

    assert carried_out(command) == 0


def test_a_command_that_ends_the_program_has_its_own_exit_code() -> None:
    assert carried_out(raising(SystemExit(4))) == 4


def test_a_defect_is_told_as_one_with_how_to_see_it_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COMPAX_TRACEBACK", raising=False)
    assert carried_out(raising(ZeroDivisionError("by nothing"))) == 1
    told = capsys.readouterr().err
    assert "ZeroDivisionError: by nothing" in told
    assert "COMPAX_TRACEBACK=1" in told
    monkeypatch.setenv("COMPAX_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        carried_out(raising(ZeroDivisionError("by nothing")))


def test_a_cancellation_from_nowhere_is_a_defect_and_no_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert carried_out(raising(asyncio.CancelledError())) == 1
    assert "CancelledError" in capsys.readouterr().err


# Words ----------------------------------------------------------------------------------------------------------------


def test_wrong_words_are_told_with_what_would_be_right(capsys: pytest.CaptureFixture[str]) -> None:
    assert the_app.run(["status", "sim://compax", "--intervall", "1"]) == 2
    told = capsys.readouterr()
    assert "--interval" in told.out + told.err


def test_wrong_words_are_a_document_where_one_is_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    assert the_app.run(["status", "--json"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    error = json.loads(told.err)["error"]
    assert error["kind"] == "UsageError"
    assert error["exit_code"] == 2
    assert "url" in error["text"].lower()


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert the_app.run(["--version"]) == 0
    assert capsys.readouterr().out.strip()


def test_every_command_is_listed_without_importing_any() -> None:
    """In a process of its own: in this one, other tests have called some."""
    code = "import sys\nfrom compax_aio.cli.app import run\nrun([])\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, encoding="utf-8", timeout=60, check=True
    )
    told, modules = " ".join(done.stdout.replace("│", " ").split()), done.stdout.split()
    for _, name, place, text in the_app._COMMANDS:
        assert name in told
        assert text.split(",")[0].split(":")[0] in told
        assert f"compax_aio.cli.{place.partition(':')[0]}" not in modules


@pytest.mark.parametrize("name", ["ports", "probe", "info", "status"])
def test_the_help_of_a_command_teaches_by_examples(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert the_app.run([name, "--help"]) == 0
    assert f"compax {name}" in capsys.readouterr().out.split("Parameters")[0].split("Usage")[1].split("\n", 1)[1]


def test_a_library_that_is_missing_is_told_with_how_to_install_it(capsys: pytest.CaptureFixture[str]) -> None:
    def prepare(words: object) -> None:
        missing = ModuleNotFoundError("No module named 'textual.app'", name="textual.app")
        raise ImportError("Cannot import module") from missing

    assert run_words(App(name="compax"), ["monitor"], prepare) == 2
    told = capsys.readouterr().err
    assert "needs textual.app" in told
    assert "pip install" in told


def test_a_module_of_ours_that_is_missing_is_a_defect(capsys: pytest.CaptureFixture[str]) -> None:
    def prepare(words: object) -> None:
        raise ModuleNotFoundError("No module named 'compax_aio.x'", name="compax_aio.x")

    assert run_words(App(name="compax"), ["monitor"], prepare) == 1
    assert "defect" in capsys.readouterr().err


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt(), 130), (SystemExit(3), 3), (SystemExit("no"), 0)])
def test_what_ends_a_program_while_it_is_read_has_its_exit_code(error: BaseException, code: int) -> None:
    def prepare(words: object) -> None:
        raise error

    assert run_words(App(name="compax"), [], prepare) == code


# Interruptions --------------------------------------------------------------------------------------------------------


def interrupted(number: signal.Signals = signal.SIGINT, *, after_s: float = 1.0) -> None:
    asyncio.get_running_loop().call_later(after_s, signal.raise_signal, number)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)], ids=str
)
def test_a_signal_ends_the_command_after_what_it_does_last(
    number: signal.Signals, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    stopped = []

    async def command() -> None:
        interrupted(number)
        try:
            await asyncio.sleep(100)
        finally:
            await asyncio.sleep(1)
            stopped.append("axis")

    before = signal.getsignal(number)
    assert carried_out(command) == code
    assert stopped == ["axis"]
    assert "nothing goes on that this command had set in motion" in capsys.readouterr().err.lower()
    assert signal.getsignal(number) is before


def test_a_command_that_moves_nothing_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    @moves_nothing
    async def command() -> None:
        interrupted()
        await asyncio.sleep(100)

    assert carried_out(command) == 130
    assert capsys.readouterr().err.strip() == "Interrupted. This command sets nothing in motion."


def test_axes_in_motion_are_named_before_and_after(capsys: pytest.CaptureFixture[str]) -> None:
    async def command() -> None:
        with in_motion("z"):
            await asyncio.sleep(0.5)
        interrupted()
        with in_motion("x", "y"):
            await asyncio.sleep(100)

    assert carried_out(command) == 130
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["Stopping x, y …", "Interrupted. Stopped: x, y; each stands."]


def test_what_a_command_knows_to_be_true_is_said_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    async def command() -> None:
        interrupted()
        try:
            await asyncio.sleep(100)
        finally:
            say_at_end("Interrupted. x stands at 12.")

    assert carried_out(command) == 130
    assert capsys.readouterr().err.strip() == "Interrupted. x stands at 12."


def test_a_move_that_fails_is_not_named_when_a_signal_comes_later(capsys: pytest.CaptureFixture[str]) -> None:
    async def command() -> None:
        with pytest.raises(errors.MoveError), in_motion("x"):
            raise errors.MoveError("it did not arrive")
        interrupted()
        await asyncio.sleep(100)

    assert carried_out(command) == 130
    assert "x" not in capsys.readouterr().err.replace("axis", "")


def test_outside_of_a_command_nothing_is_noted() -> None:
    with in_motion("x"):
        pass
    say_at_end("nobody asks")


def test_a_stop_that_fails_is_told_with_what_to_look_at(capsys: pytest.CaptureFixture[str]) -> None:
    async def command() -> None:
        interrupted()
        try:
            await asyncio.sleep(100)
        finally:
            raise errors.AnswerTimeoutError("STOP was not acknowledged")

    assert carried_out(command) == 4
    told = capsys.readouterr().err
    assert "STOP was not acknowledged" in told
    assert "SIGINT" in told
    assert "look whether the machine stands" in told


def test_a_second_signal_does_not_lose_the_stop(capsys: pytest.CaptureFixture[str]) -> None:
    stopped = []

    async def command() -> None:
        interrupted()
        interrupted(after_s=1.5)
        try:
            await asyncio.sleep(100)
        finally:
            await asyncio.sleep(1)
            stopped.append("axis")

    assert carried_out(command) == 130
    assert stopped == ["axis"]
    assert "Once more gives up" in capsys.readouterr().err


def test_the_third_signal_gives_up_and_says_what_that_means(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    killed: list[Any] = []
    monkeypatch.setattr(os, "kill", lambda *how: killed.append(how))

    async def command() -> None:
        for after_s in (1, 1.5, 2):
            interrupted(after_s=after_s)
        try:
            await asyncio.sleep(100)
        finally:
            await asyncio.sleep(2)

    carried_out(command)
    assert killed == [(os.getpid(), signal.SIGINT)]
    assert "whether what moved was stopped is not known" in capsys.readouterr().err


def test_a_signal_before_the_command_has_begun_ends_it() -> None:
    interruption = interruptions.Interruption(lambda: None)
    with interruption, pytest.raises(Interrupted):
        signal.raise_signal(signal.SIGINT)
    assert interruption.note is not None


def test_a_command_that_does_not_await_is_interrupted_at_once() -> None:
    def command() -> None:
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it goes on")

    assert carried_out(command) == 130


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    async def command() -> int:
        signal.raise_signal(signal.SIGHUP)
        await asyncio.sleep(1)
        return 0

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert carried_out(command) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_interrupted_command_that_prints_documents_is_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    async def command(*, printing: Printing = Printing()) -> None:  # noqa: B008
        interrupted()
        await asyncio.sleep(100)

    assert carried_out(command, "--json") == 130
    assert capsys.readouterr() == ("", "")


# What is written ------------------------------------------------------------------------------------------------------


def test_errors_are_documents_where_documents_are_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    error = errors.CommandRejectedError(
        "no", device="x", sent="VP", received="E90", hint="look", code=90, exchanges=("a", "b")
    )
    assert carried_out(raising(error), "--json") == 5
    told = capsys.readouterr()
    assert told.out == ""
    document = json.loads(told.err)["error"]
    assert document["kind"] == "CommandRejectedError"
    assert document["device"] == "x"
    assert document["code"] == 90
    assert document["exchanges"] == ["a", "b"]
    assert document["exit_code"] == 5


def test_warnings_of_the_library_are_told_and_nothing_of_it_is_left(capsys: pytest.CaptureFixture[str]) -> None:
    async def command(*, printing: Printing = Printing()) -> None:  # noqa: B008
        logging.getLogger("compax_aio.link").warning("the line was %s", "lost")

    before = list(logging.getLogger("compax_aio").handlers)
    carried_out(command)
    assert "warning: the line was lost" in capsys.readouterr().err
    carried_out(command, "--json")
    assert json.loads(capsys.readouterr().err) == {"warning": "the line was lost"}
    assert logging.getLogger("compax_aio").handlers == before


class Pipe:
    """A standard output that nobody reads any more, or that is full."""

    encoding = "utf-8"

    def __init__(self, error: OSError, descriptor: int) -> None:
        self._error = error
        self._descriptor = descriptor

    def write(self, text: str) -> int:
        return len(text)

    def fileno(self) -> int:
        return self._descriptor

    def isatty(self) -> bool:
        return False

    def flush(self) -> None:
        raise self._error


@pytest.mark.parametrize(
    ("error", "code", "says"), [(BrokenPipeError(), 141, ""), (OSError(28, "No space left on device"), 1, "No space")]
)
def test_an_output_that_cannot_be_written_is_no_success(
    error: OSError, code: int, says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    read, write = os.pipe()
    monkeypatch.setattr(sys, "stdout", Pipe(error, write))
    try:
        assert carried_out(lambda: None) == code
    finally:
        os.close(read)
        os.close(write)
    assert says in capsys.readouterr().err
