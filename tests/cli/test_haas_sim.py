"""`compax sim haas` serves controls, and lets somebody press their keys."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import Coroutine, Iterator
from typing import IO, Any

import pytest

from compax_aio.cli import app
from compax_aio.cli.printing import Printing
from compax_aio.cli.simulating.hands import Hands, known_words
from compax_aio.cli.simulating.view import SimView
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl
from compax_aio.simulator.outlet import tcp_outlet


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Let a command find lines on its standard input, and virtual time."""
    files: list[IO[str]] = []

    def type_lines(*lines: str) -> None:
        read_end, write_end = os.pipe()
        os.write(write_end, "".join(f"{line}\n" for line in lines).encode())
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


@pytest.mark.parametrize("words", [["sim", "haas"], ["haas", "sim"]])
def test_controls_are_served_and_their_keys_pressed(
    typed: Any, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    typed("control2 recv settings", "where", "reset", "quit")
    assert app.run([*words, "profile=dc_codes", "--json", "--tcp", "0", "--count", "2"]) == 0
    first, *others = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["urls"].keys() == {"control1", "control2"}
    pressed = [(each["device"], each["text"]) for each in others if each.get("kind") == "key"]
    assert pressed == [("control2", "recv settings"), ("control1", "reset"), ("control2", "reset")]
    (where,) = (each["said"] for each in others if "said" in each)
    assert where.splitlines() == [
        "control1: at rest, screen empty, no cycle runs, 42 parts, 3 programs, no alarms",
        "control2: receiving settings, screen empty, no cycle runs, 42 parts, 3 programs, no alarms",
    ]


def test_people_are_told_which_command_looks_at_a_control(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("quit")
    assert app.run(["sim", "haas"]) == 0
    assert "Try `compax haas query serial:///dev/" in capsys.readouterr().err


def test_the_seed_of_faults_is_that_of_the_control(typed: Any) -> None:
    typed("quit")
    assert app.run(["sim", "haas", "--seed", "7"]) == 0
    typed("quit")
    assert app.run(["sim", "haas", "seed=5", "--seed", "7"]) == 0


def test_its_knobs_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", "knobs", "haas"]) == 0
    assert "dnc_ends=percent" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["haas", "profile=best"], "classic"),
        (["haas", "nothing=1"], "no knob 'nothing'"),
        (["haas", "--fault", "E55@1s"], "control has no fault E55"),
        (["haas", "--tcp", "0", "--state", "state.json"], "has no state to keep"),
    ],
)
def test_what_cannot_be_meant_is_refused(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", *words]) in {2, 3}
    assert says in " ".join(capsys.readouterr().err.split())


@pytest.fixture
async def control() -> SimulatedControl:
    return SimulatedControl(Knobs(), name="control")


@pytest.fixture
async def hands(control: SimulatedControl) -> Hands:
    return Hands({"control": FarEnd(control, tcp_outlet(control, "127.0.0.1", 0))})


async def test_keys_do_what_they_do_on_the_machine(control: SimulatedControl, hands: Hands) -> None:
    for words in ("send", "reset", "send O00010", "reset", "send settings", "reset", "recv", "reset", "dnc", "reset"):
        assert hands.do(words) == ""
    pressed = [each for each in control.log.texts(LogKind.KEY) if each != "reset"]
    assert pressed == ["send ALL", "send O00010", "send settings", "recv programs", "dnc"]
    hands.do("cycle start")
    assert "a cycle runs" in hands.do("where")
    hands.do("feed hold")
    assert "a cycle is held" in hands.do("where")
    hands.do("cycle start 5s")
    control.advance(6.0)
    assert "43 parts" in hands.do("where")
    hands.do("cycle start")
    hands.do("cycle stop")
    assert "44 parts" in hands.do("where")
    hands.do("dprnt PART*1 OK")
    assert control.log.texts(LogKind.PRINTED)


async def test_a_control_that_is_frozen_answers_nothing_until_it_is_reset(
    control: SimulatedControl, hands: Hands
) -> None:
    assert hands.do("freeze") == ""
    hands.do("freeze")
    assert "frozen" in hands.do("where")
    control.receive(b"Q100\r\n", 1.0)
    assert control.take_output(2.0) == b""
    hands.do("reset")
    control.receive(b"Q100\r\n", 3.0)
    assert b"S/N, 1234567" in control.take_output(4.0)
    assert control.log.texts(LogKind.FROZEN) == ["by hand", "over"]


async def test_what_only_its_screen_shows_can_be_seen(control: SimulatedControl, hands: Hands) -> None:
    assert hands.do("alarms") == "control: no alarms"
    hands.do("recv")
    control.receive(b"%\r\nG0 X1.\r\n%\r\n", 1.0)
    control.advance(5.0)
    assert "control: 1 alarm\n  404 RS-232 NO PROG NAME" in hands.do("alarms")
    assert "1 alarms" in hands.do("where")
    assert "O00010, " in hands.do("memory")
    assert "62 settings" in hands.do("memory")
    control.receive(b"garbage", 6.0)
    control.advance(7.0)
    assert "RS232 ABORT" in hands.do("where") or "RS232 DONE" in hands.do("where")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("cycle", "'cycle' is no key"),
        ("cycle backwards", "is no key"),
        ("feed", "is no key"),
        ("recv nothing", "'recv nothing' is no key"),
        ("recv settings offsets", "is no key"),
        ("send O00007", "there is no program"),
        ("reset twice", "'twice' means nothing behind it"),
        ("cycle start soon", "soon"),
    ],
)
async def test_what_is_no_key_is_told(hands: Hands, control: SimulatedControl, words: str, says: str) -> None:
    assert says in hands.do(words)
    assert control.log.texts(LogKind.KEY) == []


async def test_who_has_no_such_key_is_told_and_nothing_is_pressed(control: SimulatedControl) -> None:
    drive = SimulatedDrive()
    hands = Hands({each.name: FarEnd(each, tcp_outlet(each, "127.0.0.1", 0)) for each in (control, drive)})
    assert "drive has no such key" in hands.do("recv")
    assert control.doing == "nothing"
    assert "recv settings" in hands.do("help")
    assert {"send", "recv", "dnc", "cycle", "memory", "alarms"} <= set(known_words())


def test_people_see_a_few_of_many_blocks_and_programs_all(capsys: pytest.CaptureFixture[str]) -> None:
    for is_json in (False, True):
        control = SimulatedControl(Knobs(profile="dc_codes"), name="control")
        SimView(Printing(json=is_json), is_quiet=False, began_at=0.0).watch({"control": control})
        control.press_dnc(0.0)
        control.receive(b"%\r\nG0\r\nG1\r\nG2\r\nG3\r\n%\r\n", 0.1)
        control.advance(10.0)
        lines = capsys.readouterr().out.splitlines()
        assert sum('"executed"' in each for each in lines) == (4 if is_json else 0)
        assert sum("executed" in each for each in lines) == (4 if is_json else 1)
