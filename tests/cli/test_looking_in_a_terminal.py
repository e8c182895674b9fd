"""The commands that look, in a real terminal on real ports: each trouble has a message that helps, and its code."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pexpect
import pytest

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

pytestmark = pytest.mark.real_time

LIMIT_S = 30
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
PROGRAM = (sys.executable, "-m", "compax_aio.cli")


def at_terminal(*words: str, talk: Callable[[Any], None] | None = None, **env: str) -> tuple[int, str]:
    """Run the command in a terminal of its own; give its exit code, 128 + n for a signal, and what stood there."""
    child = pexpect.spawn(
        PROGRAM[0],
        [*PROGRAM[1:], *words],
        encoding="utf-8",
        timeout=LIMIT_S,
        dimensions=(50, 140),
        env={**os.environ, "TERM": "xterm-256color", **env},
    )
    shown = []
    child.logfile_read = type("Log", (), {"write": lambda _, text: shown.append(text), "flush": lambda _: None})()
    if talk is not None:
        talk(child)
    child.expect(pexpect.EOF)
    child.close()
    code = 128 + child.signalstatus if child.signalstatus is not None else child.exitstatus
    assert code is not None
    text = "".join(shown)
    assert "Traceback" not in text
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h"), "the cursor is left as it was"
    return code, " ".join(ESCAPE.sub("", text).split())


async def looked(*words: str, talk: Callable[[Any], None] | None = None, **env: str) -> tuple[int, str]:
    return await asyncio.to_thread(lambda: at_terminal(*words, talk=talk, **env))


def quick(tmp_path: Path) -> tuple[str, str]:
    """Give the options that let silence be known soon."""
    path = tmp_path / "quick.toml"
    path.write_text("answer_timeout_s = 0.3\n")
    return "--settings", str(path)


def assert_only_asked(drive: SimulatedDrive) -> None:
    """Whatever was understood was a question; what was heard at the wrong rate was understood as nothing."""
    lines = [re.sub(r"^\^.*(?=S)", "", line) for line in drive.log.texts(LogKind.LINE)]
    assert [line for line in lines if not re.fullmatch(r"[SP]\d+", line)] == []
    assert drive.log.texts(LogKind.MOTION_STARTED, LogKind.OUTPUT, LogKind.PROGRAM) == []


# All is well ----------------------------------------------------------------------------------------------------------


async def test_a_drive_at_the_other_baud_rate_is_found_written_down_and_used(tmp_path: Path) -> None:
    drive = SimulatedDrive(Knobs(baudrate=4800, travel_min=-10, travel_max=500))
    written = tmp_path / "drive.toml"
    async with serve_pty(drive) as url:
        port = url.partition("?")[0]
        code, told = await looked("probe", port, "-o", str(written))
        assert code == 0
        assert "at 9600 baud: nothing came" in told
        assert "baud rate 4800 baud seen" in told
        assert f"compax info '{port}?baudrate=4800' --settings {written}" in told
        code, told = await looked("info", f"{port}?baudrate=4800", "--settings", str(written))
        assert code == 0
        assert "travel: -10 to 500 units" in told
        code, told = await looked("status", f"{port}?baudrate=4800")
        assert code == 0
        assert "no fault" in told
    assert_only_asked(drive)


async def test_ports_are_listed() -> None:
    code, told = await looked("ports")
    assert code == 0
    assert "serial" in told


# Trouble --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["probe", "info", "status"])
async def test_the_wrong_port(command: str) -> None:
    code, told = await looked(command, "serial:///dev/no-such-port")
    assert code == 3
    assert "there is no serial port /dev/no-such-port" in told
    assert "ports of this computer" in told or "plugged in" in told


@pytest.mark.parametrize("command", ["probe", "info", "status"])
async def test_a_tcp_port_where_nobody_listens(command: str) -> None:
    async with serve_tcp(SimulatedDrive()) as url:
        pass
    code, told = await looked(command, url)
    assert code == 3
    assert f"127.0.0.1 port {url.rpartition(':')[2]} refused the connection" in told
    assert "device server" in told


@pytest.mark.parametrize("command", ["info", "status"])
async def test_the_wrong_baud_rate(command: str, tmp_path: Path) -> None:
    drive = SimulatedDrive(Knobs(baudrate=9600))
    async with serve_pty(drive) as url:
        code, told = await looked(command, f"{url.partition('?')[0]}?baudrate=4800", *quick(tmp_path))
    assert code == 4
    assert "baud rate" in told
    assert_only_asked(drive)


@pytest.mark.parametrize("command", ["probe", "info", "status"])
async def test_a_drive_that_keeps_silent(command: str, tmp_path: Path) -> None:
    drive = SimulatedDrive()
    drive.silent = True
    async with serve_pty(drive) as url:
        code, told = await looked(command, url, *quick(tmp_path))
    assert code == 4
    assert "power" in told
    assert "crossed" in told


async def test_a_cable_that_is_pulled_while_the_probe_asks(tmp_path: Path) -> None:
    drive = SimulatedDrive(Knobs(answer_time_s=0.15))
    async with serve_pty(drive) as url:
        probing = asyncio.ensure_future(looked("probe", url))
        while "S33" not in drive.log.texts(LogKind.LINE):
            await asyncio.sleep(0.01)
            assert not probing.done()
    code, told = await probing
    assert code == 3
    assert "the line was lost" in told
    assert "went away" in told


async def test_a_cable_that_is_pulled_while_somebody_watches() -> None:
    drive = SimulatedDrive()
    async with serve_tcp(drive) as url:
        port = int(url.rpartition(":")[2])

        def talk(child: Any) -> None:
            child.expect("actual|position")
            seen.set()
            child.expect("The line was lost")
            lost.set()
            child.expect("The line is back")
            child.sendintr()

        loop = asyncio.get_running_loop()
        seen, lost = _Flag(loop), _Flag(loop)
        watching = asyncio.ensure_future(looked("status", url, "--watch", "--interval", "0.1", talk=talk))
        await seen.wait()
    await lost.wait()
    async with serve_tcp(drive, port=port):
        code, told = await watching
    assert code == 130
    assert "Interrupted" not in told, "a watch is meant to end so"


class _Flag:
    """An event that another thread sets."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._event = asyncio.Event()

    def set(self) -> None:
        self._loop.call_soon_threadsafe(self._event.set)

    async def wait(self) -> None:
        async with asyncio.timeout(LIMIT_S):
            await self._event.wait()


async def test_a_drive_that_falls_silent_is_not_shown_as_if_it_stood(tmp_path: Path) -> None:
    drive = SimulatedDrive(Knobs(position=12.5))

    def talk(child: Any) -> None:
        child.expect("12.500")
        drive.silent = True
        child.expect(r"No answer for \d+ s: what is above is OLD")
        drive.silent = False
        child.expect("12.500")
        child.sendintr()

    async with serve_tcp(drive) as url:
        code, _ = await looked("status", url, "--watch", "--interval", "0.2", talk=talk)
    assert code == 130


@pytest.mark.parametrize("command", ["probe", "info"])
async def test_ctrl_c_while_nobody_answers(command: str) -> None:
    drive = SimulatedDrive()
    drive.silent = True
    async with serve_pty(drive) as url:
        asked = threading.Event()

        def talk(child: Any) -> None:
            assert asked.wait(LIMIT_S)
            child.sendintr()

        running = asyncio.ensure_future(looked(command, url, talk=talk))
        while not drive.log.texts(LogKind.LINE):
            await asyncio.sleep(0.01)
            assert not running.done()
        asked.set()
        code, told = await running
    assert code == 130
    assert "Interrupted. This command sets nothing in motion." in told
    assert_only_asked(drive)


async def test_ctrl_c_ends_a_watch_in_place_quietly() -> None:
    drive = SimulatedDrive()
    async with serve_pty(drive) as url:

        def talk(child: Any) -> None:
            child.expect("Ctrl-C ends this")
            child.sendintr()

        code, told = await looked("status", url, "--watch", talk=talk)
    assert code == 130
    assert "Interrupted" not in told
    assert "programmed nominal position reached" in told
    assert_only_asked(drive)


async def test_a_terminal_that_is_closed_ends_a_watch() -> None:
    drive = SimulatedDrive()
    async with serve_pty(drive) as url:

        def talk(child: Any) -> None:
            child.expect("Ctrl-C ends this")
            child.kill(signal.SIGHUP)

        code, _ = await looked("status", url, "--watch", talk=talk)
    assert code == 129


# Where there is no terminal -------------------------------------------------------------------------------------------


def in_shell(script: str, *arguments: bytes | str, **env: str) -> subprocess.CompletedProcess[bytes]:
    shell = shutil.which("bash")
    assert shell is not None
    done = subprocess.run(
        [shell, "-c", script, "bash", *PROGRAM, *arguments],
        capture_output=True,
        timeout=LIMIT_S,
        env={**os.environ, **env},
        check=False,
    )
    assert b"Traceback" not in done.stderr
    assert b"Exception ignored" not in done.stderr
    return done


def test_an_output_that_nobody_reads_to_its_end_is_no_noise() -> None:
    done = in_shell('"$@" | (exec 0<&-; sleep 1); exit ${PIPESTATUS[0]}', "status", "sim://compax")
    assert done.returncode == 141
    assert done.stderr == b""


def test_a_full_disk_is_told() -> None:
    done = in_shell('"$@" > /dev/full', "status", "sim://compax")
    assert done.returncode == 1
    assert b"No space left on device" in done.stderr


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_is_no_matter(closed: str) -> None:
    done = in_shell(f'"$@" {closed}', "status", "sim://compax")
    assert done.returncode == 0
    assert (b"no fault" in done.stdout) is (">&-" not in closed.replace("2>&-", ""))


@pytest.mark.parametrize("option", [b"--json", b"--name=x"])
def test_words_that_are_no_text_are_told(option: bytes) -> None:
    done = in_shell('"$@"', "status", b"tcp://\xff\xfe", option)
    assert done.returncode in {2, 3}
    assert b"\\udcff" in done.stderr


def test_a_settings_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    done = in_shell('"$@"', "status", "sim://compax", COMPAX_SETTINGS=str(tmp_path))
    assert done.returncode == 2
    assert b"cannot be read" in done.stderr


@pytest.mark.parametrize("env", [{"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, {}])
def test_a_terminal_that_knows_no_degree_sign_gets_what_it_can_show(env: dict[str, str]) -> None:
    assert in_shell('"$@"', "info", "sim://compax", **env).returncode == 0
    assert in_shell('"$@"', "info", "sim://compax", "--json", **env).returncode == 0


# Completion -----------------------------------------------------------------------------------------------------------


def test_completion_is_installed_for_bash_and_works(tmp_path: Path) -> None:
    done = in_shell('"$@"', "--install-completion", "--shell", "bash", HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr
    (script,) = (path for path in tmp_path.rglob("*") if path.is_file() and path.name.startswith("compax"))
    completed = in_shell(
        f"source {script}; COMP_WORDS=(compax pro); COMP_CWORD=1; COMP_LINE='compax pro'; COMP_POINT=10; "
        'complete -p compax; $(complete -p compax | sed "s/.*-F \\([^ ]*\\).*/\\1/") compax pro compax; '
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    assert sorted(completed.stdout.split()[-2:]) == [b"probe", b"program"]
