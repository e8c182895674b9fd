"""`compax sim` serves what is asked for, shows what the far end sees, and lets somebody play the machine."""

from __future__ import annotations

import asyncio
import io
import json
import os
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import IO, Any

import pexpect
import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

import compax_aio
from compax_aio import AnswerTimeoutError, DriveSettings, smc
from compax_aio.cli import app
from compax_aio.cli.simulating.hands import Hands
from compax_aio.cli.simulating.prompt import listen, pasted_above_prompt
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.outlet import Outlet
from compax_aio.simulator.server import serve_loopback
from compax_aio.simulator.smc import Knobs as SmcKnobs
from compax_aio.simulator.smc import SimulatedPartyLine

LIMIT_S = 60.0
"""Generous: a busy machine takes its time to start a process."""


# In this process ----------------------------------------------------------------------------------------------------


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Let a command find lines on its standard input, and virtual time."""
    files: list[IO[str]] = []

    def type_lines(*lines: str, ends_last: bool = True) -> None:
        read_end, write_end = os.pipe()
        os.write(write_end, ("\n".join(lines) + "\n" * ends_last).encode())
        os.close(write_end)
        files.append(os.fdopen(read_end))
        monkeypatch.setattr(sys, "stdin", files[-1])

    def run(coroutine: Coroutine[Any, Any, Any]) -> Any:
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(coroutine)

    monkeypatch.setattr(asyncio, "run", run)
    yield type_lines
    for file in files:
        file.close()


def told(capsys: pytest.CaptureFixture[str]) -> str:
    captured = capsys.readouterr()
    return " ".join((captured.out + captured.err).split())


def test_service_ends_by_a_word(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("quit")
    assert app.run(["sim", "compax"]) == 0
    text = told(capsys)
    assert re.search(r"drive serial:///dev/\S+", text)
    assert "No device is served any more." in text


def test_a_last_line_without_an_end_counts(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("where", "quit", ends_last=False)
    assert app.run(["sim", "compax"]) == 0
    assert "drive: 0.000 mm, standing" in told(capsys)


def test_programs_read_the_urls_first(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("x2 silent", "estop", "where", "urls", "exit")
    assert app.run(["sim", "compax", "--json", "--tcp", "0", "--count", "2", "--name", "x", "--fault", "late"]) == 0
    first, *others = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["urls"].keys() == {"x1", "x2"}
    assert all(url.startswith("tcp://127.0.0.1:") for url in first["urls"].values())
    befell = [(each["device"], each["kind"], each["text"]) for each in others if "kind" in each]
    assert befell == [("x2", "befell", "silent"), ("x1", "fault", "E55"), ("x2", "fault", "E55")]
    said = [each["said"] for each in others if "said" in each]
    assert said[0].splitlines() == [f"x{n}: 0.000 mm, standing, not homed, fault 55" for n in (1, 2)]
    assert said[1].splitlines() == [f"{name}  {url}" for name, url in first["urls"].items()]


def test_who_wants_quiet_has_it(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("estop", "cut", "quit")
    assert app.run(["sim", "compax", "--quiet", "--json"]) == 0
    (only,) = capsys.readouterr().out.splitlines()
    assert "urls" in json.loads(only)


def test_an_address_for_everybody_is_warned_of(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("quit")
    assert app.run(["sim", "smc", "axes=AB", "--tcp", "0", "--host", "0.0.0.0"]) == 0
    assert "there is no password on such a line" in told(capsys)


def test_what_is_kept_without_power_is_kept(typed: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        typed("quit")
        assert app.run(["sim", "compax", "--state", str(tmp_path / "x.json")]) == 0
        typed("quit")
        assert app.run(["sim", "compax", "--state", str(tmp_path / "all"), "--count", "2"]) == 0
    assert (tmp_path / "x.json").exists()
    assert {each.name for each in (tmp_path / "all").iterdir()} == {"drive1.json", "drive2.json"}
    assert "The state is in" in told(capsys)


def test_a_link_is_made_for_each(typed: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    typed("quit")
    assert app.run(["sim", "compax", "--json", "--link", str(tmp_path / "x"), "--count", "2"]) == 0
    urls = json.loads(capsys.readouterr().out.splitlines()[0])["urls"]
    assert list(urls.values()) == [f"serial://{tmp_path}/x1", f"serial://{tmp_path}/x2"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["compax", "foo=1"], "no knob 'foo'"),
        (["compax", "decimals=4"], "allowed: 2, 3"),
        (["compax", "decimals"], "sets no knob"),
        (["compax", "echo=1", "echo=0"], "set twice"),
        (["compax", "--fault", "noisy=1"], "there is no fault 'noisy'"),
        (["smc", "--fault", "E55@1s"], "line has no fault E55"),
        (["compax", "--pty", "--tcp", "0"], "not both"),
        (["compax", "--link", "/tmp/x", "--tcp", "0"], "--tcp makes none"),
        (["compax", "--tcp", "65535", "--count", "2"], "--tcp is 0 to 65535"),
        (["compax", "--count", "0"], "--count is 1 to 64"),
        (["compax", "--name", "a b"], "is no name"),
        (["knobs", "lathe"], "there are compax, smc"),
    ],
)
def test_what_cannot_be_meant_is_refused(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", *words]) == 2
    assert says in told(capsys)


def test_a_port_that_is_taken_is_told(typed: Any, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    taken = tmp_path / "mine"
    taken.write_text("mine")
    assert app.run(["sim", "compax", "--link", str(taken)]) == 3
    assert "is there already" in told(capsys)
    assert taken.read_text() == "mine"


def test_systems_without_pseudo_terminals_want_tcp(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("compax_aio.cli.simulating.devices.os.name", "nt")
    assert app.run(["sim", "compax"]) == 2
    assert "say --tcp 4001" in told(capsys)


@pytest.mark.parametrize("kind", ["compax", "smc"])
def test_knobs_are_listed(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", "knobs", kind]) == 0
    assert "baudrate=0" in told(capsys)
    assert app.run(["sim", "knobs", kind, "--json"]) == 0
    knobs = json.loads(capsys.readouterr().out)
    assert {"name", "values", "default", "meaning"} == set(knobs[0])


def test_faults_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", "faults"]) == 0
    assert "as after Xoff" in told(capsys)
    assert app.run(["sim", "faults", "--json"]) == 0
    assert "unplug" in [each["name"] for each in json.loads(capsys.readouterr().out)]


# Hands --------------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def played(*devices: SimulatedDrive | SimulatedPartyLine) -> AsyncIterator[tuple[Hands, list[str]]]:
    said: list[str] = []
    far_ends = {}
    for device in devices:
        outlet = Outlet(lambda _, device=device: serve_loopback(device, device.name))  # type: ignore[misc]
        far_ends[device.name] = FarEnd(device, outlet, say=said.append)
        await outlet.plug()
    yield Hands(far_ends), said
    for far_end in far_ends.values():
        await far_end.outlet.unplug()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("silent 5s", "silent for 5 s"),
        ("silent", "silent"),
        ("power", "power for 1 s"),
        ("power off", "power"),
        ("power 3", "power for 3 s"),
        ("late 300ms", "late by 0.3 s"),
        ("split", "split by 0.005 s"),
        ("garbled 0.01", "garbled: 0.01 of all bytes"),
        ("garbled off", "garbled: 0 of all bytes"),
        ("held", "held"),
        ("cut", "cut"),
        ("heal", "healed"),
        ("unplug 2s", "unplug for 2 s"),
    ],
)
async def test_words_do_what_they_say(words: str, said: str) -> None:
    async with played(SimulatedDrive(name="x")) as (hands, heard):
        assert hands.do(words) == ""
        assert said in heard


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        ("", ""),
        ("x", ""),
        ("dance", "'dance' is no word that is known here; `help` lists them"),
        ("silent soon", "'soon' is no time; times are written 5s, 300ms, 2min or 5, in seconds"),
        ("silent 5 s", "silent takes one word more, not 2; `help` lists them"),
        ("garbled", "garbled takes a chance from 0 to 1 for each byte; garbled 0.01"),
        ("lost 7", "lost takes a chance from 0 to 1 for each byte; lost 0.01"),
        ("cut 5s", "cut happens once, and takes no word; `help` lists them"),
        ("fault 99", "there is no fault 'E99'"),
        ("bus fault 55", "bus has no fault E55; only COMPAX drives have"),
    ],
)
async def test_words_that_mean_nothing_are_answered(words: str, answer: str) -> None:
    drive = SimulatedDrive(name="x")
    async with played(drive, SimulatedPartyLine(name="bus")) as (hands, heard):
        assert hands.do(words).startswith(answer)
        assert heard == []
    assert drive.fault is None


async def test_opposites_end_what_was_begun() -> None:
    async with played(SimulatedDrive(name="x")) as (hands, heard):
        for words in ("silent", "speak", "unplug", "plug", "held", "release", "power off", "power on"):
            assert hands.do(words) == ""
            await asyncio.sleep(0.1)
        assert heard == [
            "silent", "it is heard again", "unplug", "plugged in: loop://x", "held",
            "what the host writes is taken again", "power", "the power is back",
        ]  # fmt: skip


async def test_questions_are_answered() -> None:
    drive, line = SimulatedDrive(name="x"), SimulatedPartyLine(SmcKnobs(axes="AB"), name="bus")
    async with played(drive, line) as (hands, _):
        assert "estop" in hands.do("help")
        assert hands.do("x fault 55") == ""
        assert hands.do("where").splitlines() == [
            "x: 0.000 mm, standing, not homed, fault 55",
            "bus: A 0 standing, B 0 standing",
        ]
        hands.do("bus unplug")
        await asyncio.sleep(0.1)
        assert hands.do("urls").splitlines() == ["x  loop://x", "bus  loop://bus  (unplugged)"]
        assert not hands.wants_end
        hands.do("quit")
        assert hands.wants_end


# In processes of their own ------------------------------------------------------------------------------------------


@asynccontextmanager
async def served(*words: str) -> AsyncIterator[tuple[str, asyncio.subprocess.Process]]:
    """Run `compax sim` with --json; gives the URL of its first device."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "compax_aio.cli", "sim", *words, "--json",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        async with asyncio.timeout(LIMIT_S):
            urls = json.loads(await process.stdout.readline())["urls"]
        yield next(iter(urls.values())), process
    finally:
        if process.returncode is None:
            process.terminate()
        await process.communicate()


async def said_by(process: asyncio.subprocess.Process, text: str) -> None:
    """Wait until a served device has said *text*."""
    assert process.stdout is not None
    async with asyncio.timeout(LIMIT_S):
        while json.loads(await process.stdout.readline()).get("text") != text:
            pass


def types(process: asyncio.subprocess.Process, line: str) -> None:
    assert process.stdin is not None
    process.stdin.write(f"{line}\n".encode())


@pytest.mark.real_time
async def test_a_client_in_another_process_moves_a_served_drive(tmp_path: Path) -> None:
    link = tmp_path / "x"
    async with served("compax", "--link", str(link), "baudrate=9600") as (url, process):
        async with compax_aio.connect(url) as drive:
            result = await drive.move_to(5)
            assert result.target == 5
        await said_by(process, "5.00")
        process.terminate()
        assert await process.wait() == 0
    assert not link.is_symlink()


@pytest.mark.real_time
async def test_a_client_at_the_wrong_rate_gets_no_answer() -> None:
    async with served("compax", "baudrate=9600") as (url, _):
        with pytest.raises(AnswerTimeoutError, match="baud rate"):
            await compax_aio.connect(f"{url}?baudrate=4800", settings=DriveSettings(answer_timeout_s=0.2))


@pytest.mark.real_time
async def test_a_client_comes_back_to_a_cable_that_was_pulled_out(tmp_path: Path) -> None:
    settings = DriveSettings(reconnect_first_s=0.1)
    async with (
        served("compax", "--link", str(tmp_path / "x"), "position=7") as (url, process),
        compax_aio.connect(url, settings=settings) as drive,
    ):
        events = drive.events()
        types(process, "unplug 300ms")
        async with asyncio.timeout(LIMIT_S):
            async for event in events:
                if type(event).__name__ == "ConnectionRestored":
                    break
        assert await drive.position() == 7


@pytest.mark.real_time
async def test_steppers_are_served_as_well() -> None:
    async with (
        served("smc", "axes=XY", "--tcp", "0") as (url, _),
        smc.connect(url, axes="XY", name="table") as line,
    ):
        assert (await line.axis("X").move_to(300)).target == 300


@pytest.mark.real_time
def test_who_reads_what_is_shown_may_go_away() -> None:
    child = subprocess.Popen(
        [sys.executable, "-m", "compax_aio.cli", "sim", "compax", "--json", "--tcp", "0"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    json.loads(child.stdout.readline())
    child.stdout.close()
    _, told = child.communicate("estop\n", LIMIT_S)
    assert (child.returncode, told) == (141, "")


@pytest.mark.real_time
@pytest.mark.skipif(not hasattr(os, "tcgetpgrp"), reason="there are no groups of processes here")
@pytest.mark.parametrize("redirection", ["", " > served.txt"])
def test_in_the_background_of_a_shell_devices_are_served_as_well(redirection: str, tmp_path: Path) -> None:
    shell = pexpect.spawn("/bin/sh", ["-m", "-i"], env={**os.environ, "PS1": "$ "}, encoding="utf-8", timeout=LIMIT_S)
    try:
        link = tmp_path / "x"
        shell.sendline(f"cd {tmp_path}; {sys.executable} -m compax_aio.cli sim compax --link {link}{redirection} &")
        shell.expect_exact("Try `compax status")
        shell.sendline(f"{sys.executable} -m compax_aio.cli status serial://{link} --json; echo ended with $?")
        shell.expect_exact("ended with 0")
        shell.sendline("kill -INT %1; wait %1; echo gone with $?")
        shell.expect("gone with [0-9]+")
        assert shell.after == "gone with 0"
        assert not link.is_symlink()
    finally:
        shell.close(force=True)


@pytest.mark.real_time
async def test_a_person_plays_the_machine_at_a_prompt() -> None:
    child = pexpect.spawn(
        sys.executable,
        ["-m", "compax_aio.cli", "sim", "compax", "--tcp", "0"],
        env={**os.environ, "TERM": "xterm", "NO_COLOR": "1"},
        encoding="utf-8",
        dimensions=(30, 120),
        timeout=LIMIT_S,
    )

    async def sees(pattern: str) -> str:
        await asyncio.to_thread(child.expect, pattern)
        return str(child.after)

    url = await sees(r"tcp://127\.0\.0\.1:\d+")
    await sees("sim>")
    child.send("estop\r")
    await sees("fault E55")
    async with compax_aio.connect(url) as drive:
        error = await drive.error()
        assert error is not None
        assert error.code == 55
    child.send("where\r")
    await sees("fault 55")
    child.sendcontrol("c")
    await sees("No device is served any more")
    await asyncio.to_thread(child.expect, pexpect.EOF)
    await asyncio.to_thread(child.wait)
    assert child.exitstatus == 0
    child.close()


# The prompt ---------------------------------------------------------------------------------------------------------


async def test_what_is_typed_is_done_until_the_last_word() -> None:
    drive = SimulatedDrive(name="x")
    answers: list[str] = []
    async with played(drive) as (hands, _):
        with create_pipe_input() as keyboard, create_app_session(input=keyboard, output=DummyOutput()):
            keyboard.send_text("estop\rwhere\rquit\r")
            await listen(hands, answers.append, is_conversation=True)
    assert drive.fault == 55
    assert answers == ["x: 0.000 mm, standing, not homed, fault 55"]


@pytest.mark.parametrize("key", ["\x03", "\x04"])
async def test_ctrl_c_and_ctrl_d_end_the_conversation(key: str) -> None:
    async with played(SimulatedDrive(name="x")) as (hands, _):
        with create_pipe_input() as keyboard, create_app_session(input=keyboard, output=DummyOutput()):
            keyboard.send_text(key)
            await listen(hands, print, is_conversation=True)
        assert hands.wants_end


async def test_nobody_can_type_where_there_is_no_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    async with played(SimulatedDrive(name="x")) as (hands, _):
        await listen(hands, print, is_conversation=False)
        assert not hands.wants_end


def test_a_conversation_wants_a_terminal_at_both_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, "stdin", Terminal())
    with pasted_above_prompt(wanted=True) as is_conversation:
        assert not is_conversation
    monkeypatch.setattr(sys, "stdout", Terminal())
    with pasted_above_prompt(wanted=False) as is_conversation:
        assert not is_conversation
    with create_app_session(output=DummyOutput()), pasted_above_prompt(wanted=True) as is_conversation:
        assert is_conversation
