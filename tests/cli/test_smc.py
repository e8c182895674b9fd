"""`compax smc` finds, moves, stops and programs axes on a simulated line, and says what is true of them."""

from __future__ import annotations

import asyncio
import io
import json
import os
import signal
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pexpect
import pytest
from rich.console import Console

from compax_aio import AnswerTimeoutError
from compax_aio.cli import app
from compax_aio.cli.stepping.line import AxisOnLine
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.server import line_named, serve_pty, serve_tcp
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine
from compax_aio.simulator.smc.language import Instruction
from compax_aio.simulator.smc.log import Ending, LogEntry
from compax_aio.smc import SmcAxis

LIMIT_S = 60.0
"""Generous: a busy machine takes its time to start a process."""

PROGRAM = "O0\nR1000\nW0\nR-1000 ; back\n"


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def _do(deed: Callable[[SimulatedPartyLine], object]) -> None:
    deed(line_named("bus", Knobs(axes="XYZ")))  # as BUS has it, whoever comes first


@pytest.fixture
def on_stage(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let commands run in virtual time; something may be done to the line `bus` of each at a time."""
    deeds: list[tuple[float, Callable[..., object]]] = []

    def plan(at_s: float, deed: Callable[..., object]) -> None:
        deeds.append((at_s, deed))

    def run(coroutine: Coroutine[Any, Any, Any]) -> Any:
        async def played() -> Any:
            loop = asyncio.get_running_loop()
            for at_s, deed in deeds:
                loop.call_later(at_s, *((deed,) if deed is ctrl_c else (_do, deed)))
            return await coroutine

        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(played())

    monkeypatch.setattr(asyncio, "run", run)
    return plan


pytestmark = pytest.mark.usefixtures("on_stage")

BUS = "sim://smc?axes=XYZ&name=bus"
ALONE = "sim://smc?mode=single&name=bus"


@pytest.fixture
def compax(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Carry out a command; gives its exit code, and all that it says."""

    def carry_out(*words: str) -> tuple[int, str]:
        code = app.run(["smc", *words])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return carry_out


@pytest.fixture
def document(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Carry out a command that succeeds; gives the one document that it prints."""

    def carry_out(*words: str) -> Any:
        assert app.run(["smc", *words, "--json"]) == 0
        (line,) = capsys.readouterr().out.splitlines()
        return json.loads(line)

    return carry_out


Compax = Callable[..., tuple[int, str]]
Document = Callable[..., Any]
Plan = Callable[[float, Callable[..., object]], None]


# Looking ------------------------------------------------------------------------------------------------------------


def test_axes_are_found(compax: Compax, document: Document) -> None:
    code, text = compax("scan", BUS)
    assert code == 0
    assert "X 0 steps stands Y 0 steps stands Z 0 steps stands" in text
    assert [each["axis"] for each in document("scan", BUS, "--names", "AXZ")] == ["X", "Z"]


def test_a_chain_says_who_is_there(document: Document) -> None:
    found = document("scan", "sim://smc?mode=daisy&axes=ABC", "--mode", "daisy")
    assert [each["axis"] for each in found] == ["A", "B", "C"]


def test_nobody_there_is_told(compax: Compax) -> None:
    code, text = compax("scan", BUS, "--names", "AB")
    assert code == 4
    assert "no axis answers" in text
    assert "the baud rate, and the mode" in text


def test_each_axis_says_how_it_stands(compax: Compax, document: Document, on_stage: Plan) -> None:
    on_stage(0.01, lambda bus: bus.axes["Y"].jog(50_000))
    code, text = compax("status", BUS, "X", "Y")
    assert code == 0
    assert "X 0 steps stands" in text
    assert "steps moving" in text
    standings = document("status", BUS)
    assert [each["axis"] for each in standings] == ["X", "Y", "Z"]
    assert standings[0]["status"]["moving"] is False


def test_an_axis_alone_has_no_name(compax: Compax) -> None:
    assert compax("status", ALONE, "-", "--mode", "single") == (0, "axis position status - 0 steps stands")
    code, text = compax("status", ALONE, "X", "--mode", "single")
    assert code == 2
    assert "write - in its place" in text
    assert compax("scan", ALONE, "--mode", "single")[0] == 2


def test_a_silent_axis_is_told(compax: Compax) -> None:
    code, text = compax("status", BUS, "Q")
    assert code == 4
    assert "AnswerTimeoutError" in text


def test_an_axis_is_watched_through_silence_until_ctrl_c(capsys: pytest.CaptureFixture[str], on_stage: Plan) -> None:
    on_stage(2.0, lambda bus: bus.power_off())
    on_stage(30.0, lambda bus: bus.power_on())
    on_stage(40.0, ctrl_c)
    assert app.run(["smc", "status", BUS, "X", "--watch", "--interval", "0.5"]) == 130
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "X  0 steps, stands"
    assert any("no " in line for line in lines)
    assert lines[-1] == "X  0 steps, stands"


def test_a_lost_line_is_shown_where_it_was(
    capsys: pytest.CaptureFixture[str], on_stage: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(
        "compax_aio.cli.stepping.looking.results_console", lambda: Console(file=screen, force_terminal=True, width=200)
    )
    on_stage(2.0, lambda bus: bus.power_off())
    on_stage(20.0, ctrl_c)
    assert app.run(["smc", "status", BUS, "X", "--watch"]) == 130
    assert "0 steps" in screen.getvalue()
    assert "no sensible answer" in screen.getvalue()


def test_a_lost_origin_is_shown(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda bus: bus.axes["X"].jog(500))
    on_stage(5.0, lambda bus: bus.axes["X"].reset())
    on_stage(9.0, ctrl_c)
    code, text = compax("status", BUS, "X", "--watch", "--json")
    assert code == 130
    assert '"lost_reference": "' in text


# Moving -------------------------------------------------------------------------------------------------------------


def test_an_axis_is_moved_and_stands_where_it_should(compax: Compax, document: Document) -> None:
    code, text = compax("move", BUS, "X", "2000")
    assert code == 0
    assert "X: 2000.00 steps reached in" in text
    assert "it stands at 2000.00 steps" in text
    moved = document("move", BUS, "X", "-300", "--by")
    assert (moved["target"], moved["position"], moved["unit"]) == (-300, -300, "steps")


def test_an_axis_in_a_chain_and_one_alone_are_moved(document: Document) -> None:
    assert document("move", "sim://smc?mode=daisy&axes=AB", "B", "10", "--mode", "daisy")["position"] == 10
    assert document("move", ALONE, "-", "10", "--mode", "single")["position"] == 10


def test_an_axis_that_is_not_in_the_chain_is_told(compax: Compax) -> None:
    code, text = compax("move", "sim://smc?mode=daisy&axes=AB", "C", "10", "--mode", "daisy")
    assert code == 2
    assert "there are A, B" in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["move", "X", "1e9"], "8,388,607.99"),
        (["move", "X", "nan"], "no number"),
        (["move", "XY", "10"], "name"),
        (["move", "X", "10", "--timeout", "-1"], "timeout_s"),
        (["move", "X", "10", "--echo-timeout", "0"], "echo_timeout_s"),
        (["home", "X", "--speed", "400"], "direction"),
        (["run", "X", "800.5"], "no whole number"),
        (["run", "X", "5"], "20 to 20000"),
        (["program", "run", "X", "-1"], "address"),
        (["program", "edit", "X", "0", "?"], "is not known to stand in a program"),
        (["program", "list", "X", "--profile", "panther"], "'Q'"),
        (["program", "edit", "X", "0", "R1", "--profile", "im483i"], "--no-verify"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_a_line_is_opened(words: list[str], says: str, compax: Compax) -> None:
    place = 2 if words[0] == "program" else 1
    code, text = compax(*words[:place], "serial:///dev/nowhere", *words[place:])
    assert code == 2
    assert says in text


def test_a_move_that_a_limit_ends_is_told(compax: Compax) -> None:
    code, text = compax("move", f"{BUS}&limit_max=500", "X", "1000")
    assert code == 7
    assert "ended at 500.00 steps, and nobody here has stopped it" in text


def test_a_move_that_takes_too_long_is_stopped(compax: Compax) -> None:
    code, text = compax("move", BUS, "X", "900000", "--timeout", "2")
    assert code == 7
    assert "MoveTimeoutError" in text


def test_ctrl_c_stops_the_axis_and_says_where(compax: Compax, on_stage: Plan) -> None:
    on_stage(2.0, ctrl_c)
    code, text = compax("move", BUS, "X", "900000")
    assert code == 130
    assert "sim://smc axis X has acknowledged STOP and stands at" in text


def test_home_is_found(compax: Compax) -> None:
    code, text = compax("home", f"{BUS}&home=-300", "X", "--speed", "400", "--direction", "1")
    assert code == 0
    assert "X: home reached in" in text
    assert "it stands at 0.00 steps" in text
    code, text = compax(
        "home", f"{BUS}&home=-300", "X", "--speed", "400", "--toward", "minus", "--profile", "im483i", "--no-origin"
    )
    assert "it stands at 0.00" not in text


def test_an_axis_runs_for_a_time(compax: Compax, document: Document) -> None:
    code, text = compax("run", BUS, "X", "-800", "--for", "1")
    assert code == 0
    assert "was stopped, and stands at -" in text
    assert document("run", BUS, "X", "800", "--for", "1")["speed_steps_s"] == 800


def test_a_run_ends_by_ctrl_c(compax: Compax, on_stage: Plan) -> None:
    on_stage(2.0, ctrl_c)
    code, text = compax("run", BUS, "X", "800")
    assert code == 130
    assert "has acknowledged STOP and stands at" in text


def test_a_run_that_a_limit_ends_is_told(compax: Compax) -> None:
    code, text = compax("run", f"{BUS}&limit_max=500", "X", "800", "--for", "30")
    assert code == 7
    assert "nobody here has stopped it" in text


# Stopping -----------------------------------------------------------------------------------------------------------


def jogged(bus: SimulatedPartyLine) -> None:
    for axis in bus.axes.values():
        axis.jog(100_000)


def _note_ending(endings: list[str], entry: LogEntry) -> None:
    if entry.kind is LogKind.MOTION_ENDED:
        endings.append(entry.text)


def test_named_axes_are_stopped(compax: Compax, document: Document, on_stage: Plan) -> None:
    on_stage(0.0, jogged)
    code, text = compax("stop", BUS, "X", "Z")
    assert code == 0
    assert "axis X has acknowledged the stop, and stands at" in text
    assert "axis Z has acknowledged the stop, and stands at" in text
    assert document("stop", BUS, "X") == [{"axis": "X", "stopped": True}]


def test_all_that_are_found_are_stopped(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, jogged)
    code, text = compax("stop", BUS)
    assert code == 0
    assert text.count("has acknowledged the stop") == 3


def test_one_that_is_missing_keeps_no_other_from_being_stopped(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, jogged)
    code, text = compax("stop", BUS, "Q", "X")
    assert code == 4
    assert "axis X has acknowledged the stop" in text
    assert "AnswerTimeoutError" in text


def test_stops_that_are_interrupted_come_to_their_end(compax: Compax, on_stage: Plan) -> None:
    for name in "XZ":
        on_stage(0.0, lambda bus, name=name: bus.axes[name].jog(20_000))
    on_stage(0.3, ctrl_c)
    code, text = compax("stop", BUS, "X", "Z")
    assert code == 130
    assert "Interrupted. Acknowledged the stop, and stand: axis X, axis Z." in text


def test_a_search_that_is_interrupted_says_whom_it_has_stopped(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda bus: bus.axes["X"].jog(20_000))
    on_stage(14.5, ctrl_c)
    code, text = compax("stop", BUS)
    assert code == 130
    stand = "Acknowledged the stop, and stand: axis X, axis Y, axis Z."
    assert f"Interrupted. {stand} Not every name had been asked." in text


def test_a_search_that_is_interrupted_before_it_finds_any_says_so(compax: Compax, on_stage: Plan) -> None:
    on_stage(1.0, ctrl_c)
    code, text = compax("stop", BUS)
    assert code == 130
    assert "Interrupted. No axis was stopped. Not every name had been asked." in text


def test_a_stop_that_is_interrupted_and_never_acknowledged_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda bus: bus.power_off())
    on_stage(0.5, ctrl_c)
    code, text = compax("stop", BUS, "X")
    assert code == 4
    assert "the soft stop was not acknowledged" in text
    assert "look whether the machine stands" in text


def test_a_stop_that_fails_is_told_once_with_what_to_check(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda bus: bus.power_off())
    code, text = compax("stop", BUS, "X")
    assert code == 4
    assert text.count("AnswerTimeoutError") == 1
    assert "Check power, cable, baud rate and parity, and the mode." in text


def test_an_axis_that_has_stopped_and_does_not_say_where_is_stopped_all_the_same(
    compax: Compax, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def position(_: SmcAxis) -> float:
        raise AnswerTimeoutError("no answer")

    monkeypatch.setattr(SmcAxis, "position", position)
    assert compax("stop", BUS, "X") == (0, "axis X has acknowledged the stop, and stands")


def test_ctrl_c_after_the_end_says_how_it_had_ended(
    compax: Compax, on_stage: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def position(_: AxisOnLine) -> float:
        ctrl_c()
        await asyncio.sleep(1)
        return 0.0

    monkeypatch.setattr("compax_aio.cli.stepping.line.AxisOnLine.position", position)
    monkeypatch.setattr("compax_aio.cli.moving._follow", _no_readings)
    code, text = compax("move", BUS, "X", "200")
    assert code == 130
    assert "Interrupted. sim://smc axis X: 200.00 steps reached before." in text
    code, text = compax("run", BUS, "X", "200", "--for", "1")
    assert code == 130
    assert "Interrupted. sim://smc axis X had been stopped before, and stands." in text


async def _no_readings(*_: object) -> None:
    pass


def test_one_alone_is_stopped(compax: Compax) -> None:
    assert compax("stop", ALONE, "--mode", "single") == (0, "the axis has acknowledged the stop, and stands at 0 steps")


def test_an_abort_is_heard_by_all(compax: Compax, document: Document, on_stage: Plan) -> None:
    endings: list[str] = []
    on_stage(0.0, lambda bus: bus.log.clear())
    on_stage(0.0, jogged)
    on_stage(0.0, lambda bus: setattr(bus.log, "on_entry", lambda entry: _note_ending(endings, entry)))
    code, text = compax("stop", BUS, "X", "--abort")
    assert endings == [Ending.ABORT] * 3
    assert code == 0
    assert "ESC was sent to every axis of the line; axis X stands" in text
    code, text = compax("stop", BUS, "--abort")
    assert "whether the axes stand was not looked at" in text
    assert document("stop", BUS, "X", "Y", "--abort") == {"aborted": True, "standing": ["X", "Y"]}


def test_nobody_to_stop_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda bus: bus.power_off())
    assert compax("stop", BUS) == (4, "no axis answers, so none was stopped")


# Programs and names -------------------------------------------------------------------------------------------------


@pytest.fixture
def cycle(tmp_path: Path) -> Path:
    file = tmp_path / "cycle.txt"
    file.write_text(PROGRAM)
    return file


def test_a_program_is_checked_without_an_axis(cycle: Path, compax: Compax, document: Document) -> None:
    assert compax("program", "check", str(cycle)) == (0, "0: O0 1: R1000 6: W0 9: R-1000")
    assert document("program", "check", str(cycle), "--at", "100")[1] == {"address": 101, "text": "R1000"}
    cycle.write_text("R1000\nJ99 3\nFOO\n")
    code, text = compax("program", "check", str(cycle))
    assert code == 2
    assert "line 3, column 1" in text
    code, text = compax("program", "check", str(cycle.with_name("none")))
    assert code == 2
    assert "cannot be read" in text


def test_a_program_is_written_and_listed(cycle: Path, compax: Compax, document: Document) -> None:
    code, text = compax("program", "write", BUS, "X", str(cycle))
    assert code == 0
    assert "0: O0 1: R1000 6: W0 9: R-1000" in text
    assert "lists it so" in text
    code, text = compax("program", "write", BUS, "X", str(cycle), "--no-verify")
    assert "has acknowledged each; nothing was compared" in text


def programmed(bus: SimulatedPartyLine) -> None:
    """Have `R1000`, `W0`, `R-1000` in the memory of X, as somebody has written it before."""
    memory, address = bus._controllers["X"].machine.memory, 0
    for letter, numbers in (("R", (1000,)), ("W", (0,)), ("R", (-1000,))):
        address = memory.write(address, Instruction(letter, numbers)) or 0


def test_a_program_that_is_there_is_listed(compax: Compax, document: Document, on_stage: Plan, tmp_path: Path) -> None:
    on_stage(0.0, programmed)
    assert compax("program", "list", BUS, "X") == (0, "0: R1000 5: W0 8: R-1000")
    assert document("program", "list", BUS, "X", "-o", str(tmp_path / "x.txt"))["instructions"] == 3
    assert (tmp_path / "x.txt").read_text().split() == ["0:", "R1000", "5:", "W0", "8:", "R-1000"]
    assert compax("program", "list", BUS, "X", "-o", str(tmp_path / "x.txt"))[0] == 2
    assert compax("program", "list", BUS, "X", "-o", str(tmp_path / "x.txt"), "--force")[0] == 0


def test_a_program_that_is_there_is_edited_and_run(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, programmed)
    assert compax("program", "edit", BUS, "X", "8", "R-50") == (0, "0: R1000 5: W0 8: R-50")
    code, text = compax("program", "run", BUS, "X", "--timeout", "60")
    assert code == 0
    assert "X: the program at 0 is over in" in text
    assert "it stands at -1000.00 steps" in text


def test_a_program_that_is_interrupted_is_stopped(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, programmed)
    on_stage(0.3, ctrl_c)
    code, text = compax("program", "run", BUS, "X")
    assert code == 130
    assert "X has acknowledged STOP and stands at" in text


def test_writing_that_is_interrupted_says_what_is_written(compax: Compax, on_stage: Plan, cycle: Path) -> None:
    cycle.write_text("R1000\nW0\n" * 50)
    on_stage(1.0, ctrl_c)
    code, text = compax("program", "write", f"{BUS}&baudrate=9600", "X", str(cycle))
    assert code == 130
    assert "its writing was ended" in text


@pytest.mark.real_time
async def test_what_is_stored_is_listed_edited_and_run(cycle: Path, tmp_path: Path) -> None:
    far_end = SimulatedPartyLine(Knobs(axes="XY"), name="bus")
    listing = tmp_path / "listing.txt"
    async with serve_tcp(far_end) as url:
        assert (await in_a_process("program", "write", url, "X", str(cycle)))[0] == 0
        assert (await in_a_process("program", "list", url, "X", "-o", str(listing)))[0] == 0
        code, text = await in_a_process("program", "list", url, "X", "-o", str(listing))
        assert code == 2
        assert "--force" in text
        code, text = await in_a_process("program", "edit", url, "X", "9", "R-50")
        assert code == 0
        assert "9: R-50" in text
        code, text = await in_a_process("program", "run", url, "X", "--timeout", "30")
        assert code == 0
        assert "the program at 0 is over in" in text
        assert (await in_a_process("program", "list", url, "Y"))[1].endswith("the program is empty")
    assert listing.read_text().split() == ["0:", "O0", "1:", "R1000", "6:", "W0", "9:", "R-1000"]
    assert far_end.axes["X"].position == -50


def test_an_axis_gets_its_name(compax: Compax, on_stage: Plan) -> None:
    code, text = compax("name", ALONE, "Q")
    assert code == 0
    assert "the axis is called Q now" in text
    assert compax("name", ALONE, "QQ")[0] == 2


def test_what_goes_over_the_line_is_recorded(compax: Compax, tmp_path: Path) -> None:
    trace = tmp_path / "trace.jsonl"
    assert compax("move", BUS, "X", "100", "--trace", str(trace), "--name", "table", "--echo-timeout", "1")[0] == 0
    assert trace.stat().st_size > 0


# In a terminal ------------------------------------------------------------------------------------------------------


async def in_a_process(*words: str) -> tuple[int, str]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "compax_aio.cli", "smc", *words,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    async with asyncio.timeout(LIMIT_S):
        output, _ = await process.communicate()
    assert process.returncode is not None
    return process.returncode, " ".join(output.decode().split())


def in_a_terminal(*words: str) -> Any:
    return pexpect.spawn(
        sys.executable,
        ["-m", "compax_aio.cli", "smc", *words],
        env={**os.environ, "TERM": "xterm", "NO_COLOR": "1"},
        encoding="utf-8",
        dimensions=(30, 160),
        timeout=LIMIT_S,
    )


@pytest.mark.real_time
async def test_a_bar_shows_the_way_and_ctrl_c_stops_it() -> None:
    far_end = SimulatedPartyLine(Knobs(axes="X", baudrate=9600))
    async with serve_pty(far_end) as url:
        child = in_a_terminal("move", url, "X", "900000")
        await asyncio.to_thread(child.expect, "XR900000 is on its way")
        child.sendcontrol("c")
        await asyncio.to_thread(child.expect, "has acknowledged STOP and stands at")
        await asyncio.to_thread(child.expect, pexpect.EOF)
        await asyncio.to_thread(child.wait)
        child.close()
        assert child.exitstatus == 130
        assert not far_end.axes["X"].moving


@pytest.mark.real_time
async def test_a_wrong_baud_rate_is_among_what_is_to_be_checked() -> None:
    async with serve_pty(SimulatedPartyLine(Knobs(axes="X", baudrate=9600))) as url:
        code, text = await in_a_process("status", f"{url}?baudrate=4800", "X")
    assert code == 4
    assert "baud rate" in text


@pytest.mark.real_time
async def test_a_port_that_is_not_there_is_told() -> None:
    code, text = await in_a_process("status", "serial:///dev/nowhere", "X")
    assert code == 3
    assert "/dev/nowhere" in text


@pytest.mark.real_time
async def test_axes_are_watched_on_a_screen() -> None:
    async with serve_pty(SimulatedPartyLine(Knobs(axes="XY"))) as url:
        child = in_a_terminal("status", url, "X", "Y", "--watch")
        await asyncio.to_thread(child.expect, "position")
        await asyncio.to_thread(child.expect, "stands")
        child.sendcontrol("c")
        await asyncio.to_thread(child.expect, pexpect.EOF)
        await asyncio.to_thread(child.wait)
        child.close()
        assert child.exitstatus == 130
