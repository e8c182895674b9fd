"""``compax program``: checked before anything is sent, each record read back, and stopped together with its axis."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.fakes.commands import Commands

from compax_aio import DriveSettings
from compax_aio.compax.program_run import ProgramRun
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

X = "sim://compax?name=x"
GOOD = "N001: posa 300\nN002: WAIT 500   ; a pause\nN003: POSA 0\nN004: END\n"
BAD = "N001: REPEAT 3\nN002: GOTO 7\n"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs(homed=True))


@pytest.fixture
def good(tmp_path: Path) -> str:
    path = tmp_path / "good.txt"
    path.write_text(GOOD)
    return str(path)


@pytest.fixture
def bad(tmp_path: Path) -> str:
    path = tmp_path / "bad.txt"
    path.write_text(BAD)
    return str(path)


def written(drive: SimulatedDrive) -> list[str]:
    return [line for line in drive.log.texts(LogKind.LINE) if line.startswith("N") and ":" in line]


def when_received(drive: SimulatedDrive, compax: Commands, text: str, do: Callable[[], object]) -> None:
    """Do something as soon as the drive has received *text*."""

    def look() -> None:
        if text in drive.log.texts(LogKind.LINE):
            do()
        else:
            compax.loop.call_later(0.001, look)

    compax.after(0.0, look)


def go_on(compax: Commands, seconds: float) -> None:
    """Let time go by while nobody is connected."""
    compax.loop.run_until_complete(asyncio.sleep(seconds))


# Without a drive


def test_problems_are_told_with_line_and_column(compax: Commands, bad: str) -> None:
    outcome = compax("program", "check", bad)
    assert outcome.code == 1
    assert [line.partition(";")[0] for line in outcome.out.splitlines()] == [
        f"{bad}:1:7: error: N001: REPEAT without END",
        f"{bad}:2:12: error: N002: GOTO 7, but there is no N007",
    ]
    assert [(each["line"], each["column"]) for each in compax("program", "check", bad, "--json").document] == [
        (1, 7),
        (2, 12),
    ]


def test_a_good_listing_is_called_good(compax: Commands, good: str) -> None:
    outcome = compax("program", "check", good)
    assert outcome.code == 0
    assert "nothing wrong was found" in outcome.out
    assert compax("program", "check", good, "--json").document == []


def test_a_warning_alone_is_no_failure(compax: Commands, tmp_path: Path) -> None:
    path = tmp_path / "gap.txt"
    path.write_text("N001: POSA 1\nN003: END\n")
    outcome = compax("program", "check", str(path))
    assert outcome.code == 0
    assert "warning: " in outcome.out


def test_decimals_are_those_of_the_settings(compax: Commands, tmp_path: Path) -> None:
    path = tmp_path / "inch.txt"
    path.write_text("N001: POSA 1.125\nN002: END\n")
    DriveSettings(decimals=3).save(tmp_path / "inch.toml")
    assert compax("program", "check", str(path)).code == 1
    assert compax("program", "check", str(path), "--settings", str(tmp_path / "inch.toml")).code == 0


def test_a_listing_is_printed_as_the_manual_does(compax: Commands, good: str) -> None:
    assert compax("program", "print", good).out == "N001: POSA 300\nN002: WAIT 500\nN003: POSA 0\nN004: END\n"
    assert compax("program", "print", good, "--wire", "--json").document[1] == "N002: WAIT 500"


@pytest.mark.parametrize("command", ["check", "print"])
def test_a_file_that_is_not_there_is_told(compax: Commands, tmp_path: Path, command: str) -> None:
    outcome = compax("program", command, str(tmp_path / "none.txt"))
    assert outcome.code == 2
    assert "none.txt cannot be read: No such file or directory" in outcome.told


def test_a_listing_that_cannot_be_read_is_not_printed(compax: Commands, tmp_path: Path) -> None:
    path = tmp_path / "odd.txt"
    path.write_text("N001: FLY 3\n")
    outcome = compax("program", "print", str(path))
    assert outcome.code == 2
    assert outcome.out == ""


# Down and up


def test_a_program_goes_down_and_comes_up_again(compax: Commands, x: SimulatedDrive, good: str, tmp_path: Path) -> None:
    outcome = compax("program", "download", X, good, "--yes", "--name", "x")
    assert outcome.code == 0
    assert outcome.out == "x: 3 records written and read back, 1 were there\n"
    assert written(x) == ["N001: POSA 300", "N002: WAIT 500", "N003: POSA 0"]
    assert compax("program", "upload", X).out == "N001: POSA 300\nN002: WAIT 500\nN003: POSA 0\nN004: END\n"
    path = tmp_path / "up.txt"
    assert "4 records of x written to" in compax("program", "upload", X, str(path), "--name", "x").out
    assert compax("program", "upload", X, str(path)).code == 2, "it was written over"
    assert compax("program", "check", str(path)).code == 0
    again = compax("program", "download", X, str(path), "--yes", "--json")
    assert again.document["changed"] == {}
    assert compax("program", "upload", X, "--json").document["records"]["N002"] == "WAIT 500"


def test_what_may_be_cut_is_told(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    path.write_text("N001: POSR 1234567.25 OUTPUT O10=1\nN002: POSA 0\nN003: END\n")
    outcome = compax("program", "download", X, str(path), "--yes")
    assert outcome.code == 0
    assert "may be cut, so not verified: N001" in outcome.out
    assert "N001 cannot be read, or may be cut" in compax("program", "upload", X).err


def test_a_bad_listing_opens_no_line(compax: Commands, x: SimulatedDrive, bad: str) -> None:
    outcome = compax("program", "download", X, bad, "--yes")
    assert outcome.code == 2
    assert "2 errors in the program" in outcome.err
    assert len(x.log) == 0


def test_warnings_are_told_before_it_is_written(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> None:
    path = tmp_path / "gap.txt"
    path.write_text("N001: POSA 1\nN003: END\n")
    outcome = compax("program", "download", X, str(path), "--yes")
    assert outcome.code == 0
    assert "gap.txt:1:7: warning: " in outcome.err


def test_nothing_is_written_unless_somebody_agrees(
    compax: Commands, x: SimulatedDrive, good: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compax("program", "download", X, good).code == 2, "nobody could be asked"
    asked: list[str] = []

    async def no(question: str) -> bool:
        asked.append(question)
        return False

    monkeypatch.setattr("compax_aio.cli.program.expect_somebody", lambda yes: None)
    monkeypatch.setattr("compax_aio.cli.program.confirm", no)
    assert compax("program", "download", X, good, "--name", "x").out == "Nothing was written.\n"
    assert asked == ["Write 3 records of x?"]
    assert written(x) == []


def test_the_rest_is_cleared_if_that_is_said(compax: Commands, x: SimulatedDrive, good: str) -> None:
    x.load_program(["POSA 7", "END"], first=20)
    assert compax("program", "download", X, good, "--yes", "--clear-rest").code == 0
    assert "N020: END" in written(x)


def test_a_download_that_stops_half_way_says_what_the_drive_has(compax: Commands, x: SimulatedDrive, good: str) -> None:
    when_received(x, compax, "N002: WAIT 500", lambda: setattr(x, "silent", True))
    outcome = compax("program", "download", X, good, "--yes")
    assert outcome.code == 9
    rows = {line.split()[0]: line for line in outcome.err.splitlines() if line.startswith("N0")}
    assert "the new one, read back: POSA 300" in outcome.told
    assert "what it had before" in rows["N003"]


def test_an_interrupted_download_is_taken_back_if_that_was_said(compax: Commands, x: SimulatedDrive, good: str) -> None:
    when_received(x, compax, "N002: WAIT 500", lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("program", "download", X, good, "--yes", "--roll-back")
    assert outcome.code == 130
    assert "What was written was taken back." in outcome.told
    assert all(text == "END" for text in x.program.values())


# Running it


@pytest.fixture
def loaded(compax: Commands, x: SimulatedDrive) -> SimulatedDrive:
    x.load_program(["POSA 300", "WAIT 500", "POSA 0", "END"])
    return x


def test_a_program_is_run_to_its_end(compax: Commands, loaded: SimulatedDrive) -> None:
    outcome = compax("program", "run", X, "--from", "1", "--wait", "--name", "x")
    assert outcome.code == 0
    assert outcome.out == "x: the program has ended; the axis stands at 0.00 units\n"
    assert loaded.log.texts(LogKind.MOTION_REACHED) == ["300.00", "0.00"]


def test_without_wait_it_goes_on(compax: Commands, loaded: SimulatedDrive) -> None:
    outcome = compax("program", "run", X, "--name", "x")
    assert outcome.code == 0
    assert "nobody watches it" in outcome.out
    go_on(compax, 1.0)
    assert loaded.moving
    assert "STOP" not in loaded.log.texts(LogKind.LINE)


def test_one_that_was_let_go_on_is_not_said_to_be_stopped(
    compax: Commands, loaded: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_go_on = ProgramRun.let_go_on

    def let_go_on_and_interrupt(program: ProgramRun) -> None:
        let_go_on(program)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgramRun, "let_go_on", let_go_on_and_interrupt)
    outcome = compax("program", "run", X, "--name", "x")
    assert outcome.code == 130
    assert "Interrupted. x runs its program, and nobody watches it." in outcome.told
    assert "was stopped" not in outcome.told
    go_on(compax, 1.0)
    assert loaded.moving


def test_one_that_has_ended_is_not_said_to_be_stopped(
    compax: Commands, x: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    x.load_program(["POSA 10", "END"])

    wait_finished = ProgramRun.wait_finished

    async def wait_until_its_end_and_interrupt(program: ProgramRun, timeout_s: float | None) -> None:
        await wait_finished(program, timeout_s)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgramRun, "wait_finished", wait_until_its_end_and_interrupt)
    outcome = compax("program", "run", X, "--wait", "--name", "x")
    assert outcome.code == 130
    assert outcome.told.endswith("Interrupted. The program of x had ended before.")
    assert "STOP" not in x.log.texts(LogKind.LINE)


def test_ctrl_c_stops_program_and_axis(compax: Commands, loaded: SimulatedDrive) -> None:
    compax.after(1.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("program", "run", X, "--from", "1", "--wait", "--name", "x")
    assert outcome.code == 130
    assert f"x has acknowledged STOP and stands at {loaded.position:.2f} units; its program is stopped" in outcome.told
    assert not loaded.moving
    go_on(compax, 10.0)
    assert loaded.log.texts(LogKind.PROGRAM)[-1].startswith("stopped")


def test_one_that_takes_too_long_is_stopped(compax: Commands, loaded: SimulatedDrive) -> None:
    outcome = compax("program", "run", X, "--wait", "--timeout", "1", "--name", "x")
    assert outcome.code == 7
    assert "x was stopped, and stands; its program is stopped" in outcome.told
    assert not loaded.moving


def test_one_that_takes_too_long_and_cannot_be_stopped_is_not_said_to_stand(
    compax: Commands, loaded: SimulatedDrive
) -> None:
    loaded.load_program(["POSA 4000", "END"])
    when_received(loaded, compax, "STOP", lambda: setattr(loaded, "silent", True))
    outcome = compax("program", "run", X, "--wait", "--timeout", "1", "--name", "x")
    assert outcome.code == 4
    assert "and stands" not in outcome.told


@pytest.mark.parametrize(
    "words", [("--from", "0"), ("--from", "251"), ("--timeout", "5"), ("--wait", "--timeout", "0")]
)
def test_what_cannot_be_run_opens_no_line(compax: Commands, x: SimulatedDrive, words: tuple[str, ...]) -> None:
    assert compax("program", "run", X, *words).code == 2
    assert len(x.log) == 0
