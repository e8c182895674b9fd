"""`compax sim camm1` serves cutters, and lets somebody press the keys of their panels."""

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
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.far_end import FarEnd
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


def test_cutters_are_served_and_their_panels_played(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("cutter2 pause", "where", "cancel", "lever up", "quit")
    assert app.run(["sim", "camm1", "model=PNC-900", "--json", "--tcp", "0", "--count", "2"]) == 0
    first, *others = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["urls"].keys() == {"cutter1", "cutter2"}
    pressed = [(each["device"], each["text"]) for each in others if each.get("kind") == "panel"]
    assert pressed == [
        ("cutter2", "pause"),
        ("cutter1", "pause"),
        ("cutter1", "cancel"),
        ("cutter2", "cancel"),
        ("cutter1", "lever up"),
        ("cutter2", "lever up"),
    ]
    (where,) = (each["said"] for each in others if "said" in each)
    assert where.splitlines() == [
        "cutter1: at 0,0 steps, tool up, 0 bytes stored, 1024 free, 0 vectors made",
        "cutter2: at 0,0 steps, tool up, 0 bytes stored, 1024 free, 0 vectors made, paused",
    ]


def test_people_are_told_which_command_looks_at_a_cutter(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    typed("quit")
    assert app.run(["sim", "camm1"]) == 0
    assert "Try `compax camm1 info serial:///dev/" in capsys.readouterr().err


def test_the_seed_of_faults_is_that_of_the_cutter(typed: Any) -> None:
    typed("quit")
    assert app.run(["sim", "camm1", "--seed", "7"]) == 0
    typed("quit")
    assert app.run(["sim", "camm1", "seed=5", "--seed", "7"]) == 0


def test_its_knobs_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", "knobs", "camm1"]) == 0
    assert "bare_colon=swallow" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["camm1", "model=PNC-5"], "PNC-1610"),
        (["camm1", "nothing=1"], "no knob 'nothing'"),
        (["camm1", "--fault", "E55@1s"], "cutter has no fault E55"),
    ],
)
def test_what_cannot_be_meant_is_refused(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["sim", *words]) == 2
    assert says in " ".join(capsys.readouterr().err.split())


async def test_keys_do_what_they_do_on_the_machine() -> None:
    cutter = SimulatedCutter(Knobs(time_factor=1000), name="cutter")
    hands = Hands({"cutter": FarEnd(cutter, tcp_outlet(cutter, "127.0.0.1", 0))})
    cutter.receive(b"PD4000,0;PD0,0;PD4000,0;", 0.0)
    assert hands.do("pause") == ""
    assert "paused" in hands.do("where")
    assert hands.do("cancel") == ""
    assert "paused" not in hands.do("where")
    assert cutter.stored_bytes == 0
    hands.do("setup")
    assert "not set up" in hands.do("where")
    hands.do("setup")
    assert cutter.is_ready
    hands.do("view")
    hands.do("lever up")
    hands.do("lever down")
    assert cutter.log.texts(LogKind.PANEL)[-3:] == ["view", "lever up", "lever down"]
    hands.do("sheet")
    assert cutter.cuttings.vectors.total == 0


async def test_what_is_no_key_and_who_has_no_panel_is_told() -> None:
    cutter, drive = SimulatedCutter(), SimulatedDrive()
    hands = Hands({each.name: FarEnd(each, tcp_outlet(each, "127.0.0.1", 0)) for each in (cutter, drive)})
    assert "'lever sideways' is no key" in hands.do("cutter lever sideways")
    assert "drive has no such panel" in hands.do("pause")
    assert not cutter.is_paused
    assert "pause, setup, view" in hands.do("help")
    assert {"pause", "setup", "cancel", "view", "lever", "sheet"} <= set(known_words())


async def test_errors_are_told_where_somebody_asks_how_it_stands() -> None:
    cutter = SimulatedCutter(Knobs(ready=False, physical_size=60), name="cutter")
    hands = Hands({"cutter": FarEnd(cutter, tcp_outlet(cutter, "127.0.0.1", 0))})
    cutter.receive(b"PU1,1;" * 20, 0.0)
    told = hands.do("where")
    assert "not set up" in told
    assert "error 16" in told
    assert "60 bytes lost" in told


def test_people_see_a_few_of_many_instructions_and_how_many_more_there_were(capsys: pytest.CaptureFixture[str]) -> None:
    cutter = SimulatedCutter(name="cutter")
    SimView(Printing(), is_quiet=False, began_at=0.0).watch({"cutter": cutter})
    cutter.receive(b"PU10,10;PU20,20;PU30,30;PU40,40;", 0.0)
    cutter.advance(10.0)
    cutter.receive(b"PU50,50;", 10.0)
    cutter.advance(20.0)
    lines = [line.split(maxsplit=2)[2] for line in capsys.readouterr().out.splitlines()]
    assert lines == ["PU10,10", "… 3 more", "PU50,50"]


def test_programs_see_them_all(capsys: pytest.CaptureFixture[str]) -> None:
    cutter = SimulatedCutter(name="cutter")
    SimView(Printing(json=True), is_quiet=False, began_at=0.0).watch({"cutter": cutter})
    cutter.receive(b"PU10,10;" * 20, 0.0)
    cutter.advance(10.0)
    assert len(capsys.readouterr().out.splitlines()) == 20
