"""`compax camm1 cut`, `info` and `stop`: jobs cut on simulated cutters, and what is said where that goes wrong."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import sys
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import IO, Any

import pytest

from compax_aio import UnexpectedAnswerError
from compax_aio.camm1.cutter import Cutter
from compax_aio.cli import app
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.server import cutter_named

SQUARE = "IN;PA;VS10;\nPU400,400;PD800,400,800,800,400,800,400,400;\nPU0,0;\n"
CUTTER = "sim://camm1?name=cutter&baudrate=9600"


def long_job(vectors: int = 2000) -> str:
    """Return a job that takes a minute or so."""
    return "IN;VS10;PU0,0;\n" + "\n".join(f"PD{x % 9000},{x % 700};" for x in range(0, vectors * 37, 37)) + "\nPU0,0;\n"


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def terminated() -> None:
    signal.raise_signal(signal.SIGTERM)


Deed = Callable[[SimulatedCutter], object]
Plan = Callable[[float, Callable[..., object]], None]
Compax = Callable[..., tuple[int, str]]


@pytest.fixture
def cutters() -> list[SimulatedCutter]:
    """The cutter of each command that was carried out."""
    return []


@pytest.fixture(autouse=True)
def on_stage(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cutters: list[SimulatedCutter]
) -> Callable[[float, Callable[..., object]], None]:
    """Let commands run in virtual time; something may be done to the cutter of each at a time."""
    monkeypatch.chdir(tmp_path)
    Path("square.plt").write_text(SQUARE)
    Path("long.plt").write_text(long_job())
    deeds: list[tuple[float, Callable[..., object]]] = []

    def plan(at_s: float, deed: Callable[..., object]) -> None:
        deeds.append((at_s, deed))

    def run(coroutine: Coroutine[Any, Any, Any]) -> Any:
        async def played() -> Any:
            cutter = cutter_named("cutter", Knobs(baudrate=9600))
            cutters.append(cutter)
            loop = asyncio.get_running_loop()
            for at_s, deed in deeds:
                is_signal = deed in {ctrl_c, terminated}
                loop.call_later(at_s, *((deed,) if is_signal else (deed, cutter)))
            return await coroutine

        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(played())

    monkeypatch.setattr(asyncio, "run", run)
    return plan


@pytest.fixture
def compax(capsys: pytest.CaptureFixture[str]) -> Compax:
    """Carry out a command; gives its exit code, and all that it says."""

    def carry_out(*words: str) -> tuple[int, str]:
        code = app.run(["camm1", *words])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return carry_out


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Let a command find something on its standard input."""
    files: list[IO[str]] = []

    def give(data: bytes) -> None:
        read_end, write_end = os.pipe()
        os.write(write_end, data)
        os.close(write_end)
        files.append(os.fdopen(read_end))
        monkeypatch.setattr(sys, "stdin", files[-1])

    yield give
    for file in files:
        file.close()


def corners_cut(cutter: SimulatedCutter) -> list[tuple[int, int]]:
    return [(each.x1, each.y1) for each in cutter.cuttings.cut]


# Cut ----------------------------------------------------------------------------------------------------------------


def test_a_job_is_cut_and_its_proof_told(compax: Compax, cutters: list[SimulatedCutter]) -> None:
    code, text = compax("cut", CUTTER, "square.plt", "--yes")
    assert code == 0
    assert corners_cut(cutters[0]) == [(800, 400), (800, 800), (400, 800), (400, 400)]
    assert "square.plt: cut in" in text
    assert "proved by OA; 64 bytes, 6 instructions, software handshake: the cutter answers" in text
    assert "10.00 by 10.00 mm, from (10.00, 10.00) to (20.00, 20.00) mm" in text


@pytest.mark.parametrize("handshake", ["software", "xonxoff", "enq1", "enq2", "hardwire"])
def test_each_handshake_can_be_asked_for(compax: Compax, cutters: list[SimulatedCutter], handshake: str) -> None:
    code, text = compax("cut", CUTTER, "square.plt", "--yes", "--handshake", handshake)
    assert code == 0
    assert f"{handshake} handshake" in text
    assert len(corners_cut(cutters[0])) == 4


def test_several_jobs_are_cut_one_after_the_other(compax: Compax, cutters: list[SimulatedCutter]) -> None:
    Path("other.plt").write_text("PU0,0;PD40,0;PU;")
    code, text = compax("cut", CUTTER, "square.plt", "other.plt", "--yes")
    assert code == 0
    assert corners_cut(cutters[0])[-1] == (40, 0)
    assert text.index("square.plt: cut in") < text.index("other.plt: cut in")


def test_a_job_comes_from_the_standard_input(
    compax: Compax, given: Callable[[bytes], None], cutters: list[SimulatedCutter]
) -> None:
    given(SQUARE.encode())
    code, text = compax("cut", CUTTER, "-", "--yes")
    assert code == 0
    assert "standard input: cut in" in text
    assert len(corners_cut(cutters[0])) == 4


def test_programs_read_results(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["camm1", "cut", CUTTER, "square.plt", "--yes", "--json"]) == 0
    captured = capsys.readouterr()
    (document,) = map(json.loads, captured.out.splitlines())
    assert document["job"] == "square.plt"
    assert document["result"]["handshake"] == "software"
    assert document["result"]["proved_by"] == "OA"
    assert document["outline"]["cuts"] == 1
    assert document["problems"] == []
    assert captured.err == ""


def test_speed_and_force_take_the_place_of_those_of_the_job(compax: Compax, on_stage: Plan) -> None:
    obeyed: list[str] = []
    on_stage(1.0, lambda _: obeyed.extend(cutter_named("gs").log.texts(LogKind.INSTRUCTION)))
    words = ("--yes", "--profile", "gs-24", "--speed", "5", "--force", "80")
    code, text = compax("cut", "sim://camm1?name=gs&model=GS-24", "square.plt", *words)
    assert code == 0
    assert "at 5 cm/s" in text
    assert obeyed[:5] == ["VS5", "!FS80", "IN", "VS5", "!FS80"]
    assert "VS10" not in obeyed


def test_a_speed_that_the_machine_may_not_have_is_refused(compax: Compax) -> None:
    code, text = compax("cut", CUTTER, "square.plt", "--yes", "--speed", "5")
    assert code == 2
    assert "speeds_cm_s of PNC-1610 are not known" in text


def test_what_the_job_leaves_out_is_told(compax: Compax) -> None:
    Path("asking.plt").write_text("IN;OI;PU0,0;PD40,0;PU;")
    code, text = compax("cut", CUTTER, "asking.plt", "--yes")
    assert code == 0
    assert "asking.plt:1:4: warning: OI has the machine answer; it is taken out before the job is sent" in text


def test_many_warnings_are_not_all_told(compax: Compax) -> None:
    Path("outside.plt").write_text("IN;" + "PU-1,0;" * 30)
    code, text = compax("cut", CUTTER, "outside.plt", "--yes")
    assert code == 0
    assert "and 11 more, which `compax camm1 check` tells" in text


def test_a_long_conversation_is_recorded(compax: Compax) -> None:
    assert compax("cut", CUTTER, "square.plt", "--yes", "--trace", "trace.jsonl")[0] == 0
    assert Path("trace.jsonl").stat().st_size > 0


# Refused ------------------------------------------------------------------------------------------------------------


def test_a_job_with_an_error_is_not_sent(compax: Compax, cutters: list[SimulatedCutter]) -> None:
    Path("wrong.plt").write_text("IN;\nQQ5;\nPD40,0;PU;")
    code, text = compax("cut", CUTTER, "wrong.plt", "--yes")
    assert code == 2
    assert "wrong.plt: there is an error in the job: 2:1: 'QQ5;' is no instruction" in text
    assert "--no-check sends it all the same" in text
    assert not cutters[0].log.texts(LogKind.INSTRUCTION)


def test_of_very_many_errors_the_first_are_told(compax: Compax) -> None:
    Path("wrong.plt").write_text("QQ5;\n" * 15)
    text = compax("cut", CUTTER, "wrong.plt", "--yes")[1]
    assert "there are 15 errors in the job" in text
    assert "and 5 more" in text


def test_a_job_with_an_error_is_sent_if_that_is_said(compax: Compax, cutters: list[SimulatedCutter]) -> None:
    Path("wrong.plt").write_text("IN;QQ5;PD40,0;PU;")
    code, text = compax("cut", CUTTER, "wrong.plt", "--yes", "--no-check")
    assert "--no-check: it is sent with the errors in it" in text
    assert code == 7
    assert "DriveFaultError" in text
    assert "error 1 of OE" in text or "error 2 of OE" in text
    assert corners_cut(cutters[0]) == [(40, 0)]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "no job was named"),
        (["-", "-", "--yes"], "the standard input can be read once only"),
        (["none.plt", "--yes"], "none.plt cannot be read"),
        (["square.plt", "--yes", "--profile", "x"], "no profile 'x'"),
        (["square.plt", "--yes", "--handshake", "none"], "Invalid value"),
        (["square.plt", "--yes", "--sheet", "15x15"], "outside of the sheet"),
        (["square.plt", "--yes", "--force", "80"], "no"),
        (["square.plt", "--yes", "--answer-timeout", "0"], "answer_timeout_s is a time above 0"),
        (["square.plt"], "nobody is at a terminal; say --yes"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    compax: Compax, given: Callable[[bytes], None], words: list[str], says: str
) -> None:
    given(b"")
    code, text = compax("cut", CUTTER, *words)
    assert code == 2
    assert says in text


def test_a_cutter_with_something_in_its_buffer_is_left_alone(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda cutter: cutter.receive(b"PU12", 0.0))
    code, text = compax("cut", CUTTER, "square.plt", "--yes")
    assert code == 2
    assert "the cutter still has data in its buffer, which nobody here has sent" in text
    assert "`compax camm1 stop` drops it" in text


# Interrupted --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("deed", "code"), [(ctrl_c, 130), (terminated, 143)])
def test_an_interruption_aborts_the_job_and_says_how_far_it_was(
    compax: Compax, on_stage: Plan, cutters: list[SimulatedCutter], deed: Callable[[], None], code: int
) -> None:
    on_stage(10.0, deed)
    ended, text = compax("cut", CUTTER, "long.plt", "square.plt", "--yes")
    assert ended == code
    assert "Stopping sim://camm1" in text
    assert "Interrupted. long.plt: the job was aborted; the vector under way is cut to its end" in text
    assert "What is known: sent are" in text
    assert "known to be taken" in text
    assert "Not begun: square.plt." in text
    (cutter,) = cutters
    cutter.advance(1000.0)
    assert not cutter.position(1000.0)[2]
    assert not cutter.stored_bytes
    assert cutter.log.texts(LogKind.CLEARED)[-1].startswith("K ")


def test_programs_read_how_far_an_interrupted_job_was(capsys: pytest.CaptureFixture[str], on_stage: Plan) -> None:
    on_stage(10.0, ctrl_c)
    assert app.run(["camm1", "cut", CUTTER, "long.plt", "--yes", "--json"]) == 130
    (document,) = map(json.loads, capsys.readouterr().out.splitlines())
    assert document["aborted"] is True
    assert 0 < document["account"]["bytes_sent"] < document["account"]["bytes_total"]
    assert document["account"]["line"] > 1


def test_an_abort_that_nobody_confirms_is_told_as_such(compax: Compax, on_stage: Plan) -> None:
    on_stage(10.0, lambda cutter: cutter.power_off())
    on_stage(10.1, ctrl_c)
    code, text = compax("cut", CUTTER, "long.plt", "--yes")
    assert code != 0
    assert "may still be cutting: look at it, and use its switch if it is" in text
    assert "It came while SIGINT was ending this command" in text


# While it is cut ----------------------------------------------------------------------------------------------------


def test_a_pause_at_the_panel_is_told_and_waited_for(compax: Compax, on_stage: Plan) -> None:
    on_stage(5.0, lambda cutter: cutter.press_pause())
    on_stage(70.0, lambda cutter: cutter.press_pause())
    code, text = compax("cut", CUTTER, "long.plt", "--yes")
    assert code == 0
    assert "long.plt: cutting long.plt: paused at the panel long.plt: cutting" in text


def test_a_job_that_is_ended_at_the_panel_is_told_as_such(compax: Compax, on_stage: Plan) -> None:
    on_stage(5.0, lambda cutter: cutter.press_pause())
    on_stage(20.0, lambda cutter: cutter.press_setup())
    code, text = compax("cut", CUTTER, "long.plt", "square.plt", "--yes")
    assert code in {7, 8}  # whether its data was deleted may be seen, or not
    assert "as PAUSE and SETUP at the machine do" in text
    assert "not begun: square.plt" in text


def test_a_cutter_that_takes_nothing_is_told_as_stalled(compax: Compax, on_stage: Plan) -> None:
    on_stage(5.0, lambda cutter: cutter.press_setup())
    code, text = compax("cut", CUTTER, "long.plt", "--yes", "--stall-timeout", "20")
    assert code == 7
    assert re.search(r"for 20[.0-9]* s the cutter has taken nothing, and it is not paused", text)
    assert text.count("long.plt: cutting") == 1
    assert "is its SETUP lamp lit" in text


def test_power_that_goes_and_comes_leaves_a_doubt(compax: Compax, on_stage: Plan) -> None:
    on_stage(5.0, lambda cutter: cutter.power_cycle())
    code, text = compax("cut", CUTTER, "long.plt", "--yes")
    assert code == 8
    assert "MoveInDoubtError" in text
    assert "`compax camm1 stop` drops what is left in its buffer" in text
    assert text.count("bytes of the job") == 1


def test_programs_read_what_is_known_of_a_job_that_failed(capsys: pytest.CaptureFixture[str], on_stage: Plan) -> None:
    on_stage(5.0, lambda cutter: cutter.power_cycle())
    assert app.run(["camm1", "cut", CUTTER, "long.plt", "--yes", "--json"]) == 8
    documents = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    (error,) = (each["error"] for each in documents if "error" in each)
    assert error["job"]["bytes_sent"] > 0
    assert error["job"]["bytes_total"] == Path("long.plt").stat().st_size


# Looked at, and stopped ---------------------------------------------------------------------------------------------


def test_a_cutter_says_who_it_is_and_how_it_stands(compax: Compax) -> None:
    code, text = compax("info", CUTTER)
    assert code == 0
    assert "says it is '1610'; talked to as PNC-1610" in text
    assert "nothing to cut (.O = 264)" in text
    assert "1,024 bytes free, it says it holds 1,024" in text
    assert "errors none (.E)" in text
    assert "none between jobs" in text


def test_a_cutter_with_data_that_is_paused_is_told_so(compax: Compax, on_stage: Plan) -> None:
    def pause_at_work(cutter: SimulatedCutter) -> None:
        cutter.press_pause()
        cutter.receive(b"PD40,0;PU;", 0.0)

    on_stage(0.0, pause_at_work)
    code, text = compax("info", CUTTER)
    assert code == 0
    assert "data in its buffer, paused at the panel (.O = 272)" in text
    assert "it says it holds" not in text


def test_errors_that_were_there_before_are_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda cutter: cutter.receive(b"\x1b.q", 0.0))
    assert "11: bad byte behind ESC ." in compax("info", CUTTER)[1]


def test_programs_read_who_a_cutter_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["camm1", "info", CUTTER, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["identity"] == "1610"
    assert document["free_bytes"] == document["buffer_bytes"] == document["capacity_bytes"] == 1024
    assert document["status"]["buffer_is_empty"] is True


def test_another_machine_than_expected_is_told(compax: Compax) -> None:
    code, text = compax("info", "sim://camm1?answer_a=1900")
    assert code == 6
    assert "the machine says it is '1900', not '1610'" in text


def test_a_machine_that_has_another_control_is_told(compax: Compax) -> None:
    code, text = compax("info", "sim://camm1", "--profile", "pnc-900")
    assert code == 5
    assert "is it a PNC-900?" in text


def test_a_silent_cutter_is_told(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda cutter: cutter.power_off())
    code, text = compax("info", CUTTER)
    assert code == 4
    assert "check power, cable (a PC needs a crossed one), port, baud rate" in text


def test_what_is_not_said_is_told_as_such(compax: Compax, monkeypatch: pytest.MonkeyPatch) -> None:
    async def nothing(_: Cutter) -> int:
        raise UnexpectedAnswerError("that is no number")

    monkeypatch.setattr(Cutter, "free_space", nothing)
    monkeypatch.setattr(Cutter, "status", nothing)
    code, text = compax("info", CUTTER)
    assert code == 0
    assert "status not given" in text
    assert "free space not given" in text
    assert "free space (.B) was not said: that is no number" in text


def test_a_cutter_is_stopped(compax: Compax, on_stage: Plan, cutters: list[SimulatedCutter]) -> None:
    on_stage(0.0, lambda cutter: cutter.receive(b"PU0,0;PD4000,0,0,0;PD4000,0,0,0;PU0,0;", 0.0))
    code, text = compax("stop", CUTTER)
    assert code == 0
    assert text == "sim://camm1: its buffer is empty; the tool goes up once the vector under way is cut"
    assert not cutters[0].position(1000.0)[2]
    assert len(corners_cut(cutters[0])) == 2


def test_a_paused_cutter_lifts_its_tool_later(compax: Compax, on_stage: Plan) -> None:
    on_stage(0.0, lambda cutter: cutter.press_pause())
    code, text = compax("stop", CUTTER)
    assert code == 0
    assert "the tool goes up when the machine, which is paused, goes on" in text


def test_programs_read_that_it_was_stopped(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["camm1", "stop", CUTTER, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["stopped"] is True
