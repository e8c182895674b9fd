"""``compax params``: read with meanings, written after a question, saved and restored, nothing half in silence."""

from __future__ import annotations

import json
import os
import pty
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.fakes.commands import Commands

from compax_aio.cli import confirming
from compax_aio.cli.keyboard import forget_typed
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.compax.parameters import Parameters
from compax_aio.simulator.compax.refusals import SYNTAX, RefusedError

X = "sim://compax?name=x"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs())


@pytest.fixture
def saved(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> Path:
    """Parameters of the drive, changed in P10, P40 and P41."""
    path = tmp_path / "x.toml"
    assert compax("params", "save", X, str(path)).code == 0
    lines = {"P10": "P10 = 333", "P40": "P40 = 1.5", "P41": "P41 = -2.25"}
    text = "\n".join(lines.get(line.split(" ")[0], line) for line in path.read_text().splitlines())
    path.write_text(text)
    return path


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], object]]:
    """A terminal as the input, and somebody who waits for questions, and types at it what is said here."""
    ours, theirs = pty.openpty()
    answers: deque[bytes] = deque()

    def forget_and_answer() -> None:
        forget_typed()
        if answers:
            os.write(ours, answers.popleft())

    monkeypatch.setattr(confirming, "forget_typed", forget_and_answer)
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield answers.append
    os.close(ours)


def when_received(drive: SimulatedDrive, compax: Commands, text: str, do: Callable[[], object]) -> None:
    """Do something as soon as the drive has received *text*."""

    def look() -> None:
        if text in drive.log.texts(LogKind.LINE):
            do()
        else:
            compax.loop.call_later(0.001, look)

    compax.after(0.0, look)


def written(drive: SimulatedDrive) -> list[str]:
    return [line for line in drive.log.texts(LogKind.LINE) if "=" in line or line in {"VP", "GOTO 302", "GOTO 270"}]


# get


def test_values_are_read_with_what_is_known_of_them(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "get", X, "P10", "40-41", "V5")
    assert outcome.code == 0
    assert [line.split() for line in outcome.out.splitlines()] == [
        ["name", "value", "unit", "meaning"],
        ["P10", "100", "ms", "ramp", "time", "of", "STOP"],
        ["P40", "0.000", "control", "parameter", "for", "programs"],
        ["P41", "0.000", "control", "parameter", "for", "programs"],
        ["V5", "0.000"],
    ]


def test_programs_read_meaning_unit_page_and_certainty(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("params", "get", X, "P10", "--json").document == [
        {
            "name": "P10",
            "value": 100.0,
            "meaning": "ramp time of STOP",
            "unit": "ms",
            "source": "CAN-S p. 28",
            "certainty": "inferred",
        }
    ]


def test_without_names_all_are_read(compax: Commands, x: SimulatedDrive) -> None:
    assert len(compax("params", "get", X, "--json").document) == 250
    assert len(compax("params", "get", X, "--variables", "--json").document) == 60
    assert [row["name"] for row in compax("params", "get", X, "5", "--variables", "--json").document] == ["V5"]


def test_what_the_drive_does_not_give_is_told(
    compax: Commands, x: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = Parameters.shown

    def all_but_one(parameters: Parameters, kind: str, number: int) -> float:
        if number == 77:
            raise RefusedError(SYNTAX)
        return shown(parameters, kind, number)

    monkeypatch.setattr(Parameters, "shown", all_but_one)
    outcome = compax("params", "get", X, "--name", "x")
    assert outcome.code == 0
    assert "P77" not in outcome.out
    assert "x does not give 1 of its parameters" in outcome.err
    assert compax("params", "get", X, "P77").code == 5


@pytest.mark.parametrize("name", ["P251", "V40", "Q1", "P5-3", "P", "P1-V3", "--1"])
def test_names_of_nothing_are_refused_before_the_line_is_opened(compax: Commands, x: SimulatedDrive, name: str) -> None:
    assert compax("params", "get", X, name).code == 2
    assert len(x.log) == 0


# set


def test_what_is_set_is_read_back_put_in_force_and_locked_again(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "set", X, "P10=200", "P40=-1.5", "--yes", "--name", "x")
    assert outcome.code == 0
    assert written(x) == ["GOTO 302", "P10=200", "P40=-1.500", "VP", "GOTO 270"]
    assert outcome.out == "x: 2 parameters written and read back\n"
    assert outcome.err.splitlines()[1].split()[:5] == ["P10", "100", "→", "200", "ms"]


def test_control_parameters_and_variables_want_neither_password_nor_vp(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("params", "set", X, "P40=1.5", "--yes").code == 0
    assert compax("params", "set", X, "V5=3", "--yes").code == 0
    assert written(x) == ["P40=1.500", "V5=3.000"]


def test_without_vp_it_is_said_what_is_not_in_force(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "set", X, "P10=200", "P40=1", "--yes", "--no-vp", "--json")
    assert "VP" not in written(x)
    assert outcome.document["pending"] == ["P10"]
    assert outcome.document["changed"] == {"P10": {"old": 100.0, "new": 200.0}, "P40": {"old": 0.0, "new": 1.0}}


def test_what_the_drive_has_already_is_not_written(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "set", X, "P10=100", "--yes")
    assert outcome.code == 0
    assert "nothing was written" in outcome.out
    assert written(x) == []


@pytest.mark.parametrize(
    "words",
    [
        ("P40=1.55555",),
        ("P10=1.5",),
        ("P40=x",),
        ("P40=nan",),
        ("P40=1_0",),
        ("P40",),
        ("P40=1=2",),
        ("P251=1",),
        ("P40=1", "P40=2"),
        ("P40=1", "V5=2"),
        ("P40=12345678",),
        (),
    ],
)
def test_what_cannot_be_set_is_refused_before_the_line_is_opened(
    compax: Commands, x: SimulatedDrive, words: tuple[str, ...]
) -> None:
    assert compax("params", "set", X, *words, "--yes").code == 2
    assert len(x.log) == 0


def test_where_nobody_can_be_asked_nothing_is_opened(
    compax: Commands, x: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Path(os.devnull).open() as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        outcome = compax("params", "set", X, "P40=1")
    assert outcome.code == 2
    assert "say --yes" in outcome.err
    assert len(x.log) == 0


def test_the_line_itself_is_not_changed_without_a_warning(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "set", X, "P20=16", "--yes")
    assert "P20 is handshake and errors of the serial interface: once it is in force, the line may be lost" in (
        outcome.told
    )


def test_a_drive_that_refuses_ends_it_and_the_account_is_told(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("params", "set", X, "P10=200", "P14=-5", "P40=1", "--yes", "--name", "x")
    assert outcome.code == 9
    rows = {line.split()[0]: line for line in outcome.err.splitlines() if line.startswith("P")}
    assert "the new one, read back: 200.0 (it was 100.0)" in rows["P10"]
    assert "what it had before" in rows["P14"]
    assert "what it had before" in rows["P40"]
    assert "P14=-5.000 was not restored: the drive rejected it" in outcome.told
    assert written(x)[-1] == "GOTO 270", "it was left unlocked"


@pytest.mark.parametrize("as_document", [False, True])
def test_what_was_written_is_taken_back_if_that_is_wanted(
    compax: Commands, x: SimulatedDrive, as_document: bool
) -> None:
    more = ("--json",) if as_document else ()
    outcome = compax("params", "set", X, "P10=200", "P14=-5", "--yes", "--roll-back", *more)
    assert outcome.code == 9
    assert written(x) == ["GOTO 302", "P10=200", "P14=-5.000", "P10=100", "GOTO 270"]
    if as_document:
        assert outcome.document["applied"] == {"10": {"old": 100.0, "new": 200.0}}
        assert outcome.document["not_applied"] == [14]
        assert outcome.document["rolled_back"] is True
    else:
        assert "What was written was taken back" in outcome.told


@pytest.mark.parametrize(("said", "is_back"), [(b"y\n", True), (b"n\n", False)])
def test_it_is_asked_whether_to_take_back(
    compax: Commands, x: SimulatedDrive, answer: Callable[[bytes], object], said: bytes, is_back: bool
) -> None:
    answer(b"y\n")
    when_received(x, compax, "P14=-5.000", lambda: answer(said))
    outcome = compax("params", "set", X, "P10=200", "P14=-5", "--name", "x")
    assert outcome.code == 9
    assert "Write back what x had before? [y/N]" in outcome.told
    assert ("P10=100" in written(x)) is is_back


def test_what_cannot_be_taken_back_is_told(compax: Commands, x: SimulatedDrive, saved: Path) -> None:
    when_received(x, compax, "P10=333", lambda: setattr(x, "silent", True))
    outcome = compax("params", "restore", X, str(saved), "--yes", "--roll-back")
    assert outcome.code == 9
    assert "it could not be taken back: " in outcome.told


# save, diff, restore


def test_a_file_that_is_there_is_not_replaced_unless_that_is_said(
    compax: Commands, x: SimulatedDrive, tmp_path: Path
) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("mine")
    outcome = compax("params", "save", X, str(path))
    assert outcome.code == 2
    assert "is there already" in outcome.err
    assert path.read_text() == "mine"
    assert len(x.log) == 0
    assert compax("params", "save", X, str(path), "--force", "--json").document["count"] == 250
    assert path.read_text().startswith("# Parameters of a COMPAX drive")
    assert compax("params", "save", X, str(tmp_path / "no" / "x.toml")).code == 2


def test_diff_exits_as_diff_does(compax: Commands, x: SimulatedDrive, saved: Path) -> None:
    outcome = compax("params", "diff", X, str(saved))
    assert outcome.code == 1
    assert [line.split()[:3] for line in outcome.out.splitlines()[1:]] == [
        ["P10", "333", "100"],
        ["P40", "1.500", "0.000"],
        ["P41", "-2.250", "0.000"],
    ]
    assert [each["name"] for each in compax("params", "diff", X, str(saved), "--json").document] == [
        "P10",
        "P40",
        "P41",
    ]
    assert compax("params", "restore", X, str(saved), "--yes").code == 0
    same = compax("params", "diff", X, str(saved))
    assert same.code == 0
    assert "has all 250 parameters as in" in same.out


@pytest.mark.parametrize("command", ["diff", "restore"])
@pytest.mark.parametrize(
    "text",
    [None, "nonsense", 'kind = "variables"\n[variables]\n', "kind = 'parameters'\n[parameters]\nP40 = 1.55555\n"],
)
def test_a_file_that_cannot_be_used_is_told_before_the_line_is_opened(
    compax: Commands, x: SimulatedDrive, tmp_path: Path, command: str, text: str | None
) -> None:
    path = tmp_path / "bad.toml"
    if text is not None:
        path.write_text(text)
    more = ("--yes",) if command == "restore" else ()
    assert compax("params", command, X, str(path), *more).code == 2
    assert len(x.log) == 0


def test_restore_shows_what_it_will_write_and_writes_no_more(compax: Commands, x: SimulatedDrive, saved: Path) -> None:
    before = len(written(x))
    outcome = compax("params", "restore", X, str(saved), "--yes", "--name", "x")
    assert outcome.code == 0
    assert written(x)[before:] == ["GOTO 302", "P10=333", "P40=1.500", "P41=-2.250", "VP", "GOTO 270"]
    assert outcome.out == "x: 3 parameters written and read back\n"


@pytest.mark.parametrize("said", [b"y\n", b"Yes\n", b"n\n", b"\n", b"\x04"])
def test_only_a_yes_is_a_yes(
    compax: Commands, x: SimulatedDrive, answer: Callable[[bytes], object], said: bytes
) -> None:
    answer(said)
    outcome = compax("params", "set", X, "P40=1", "--name", "x")
    assert outcome.code == 0
    assert "Write 1 parameter of x? [y/N]" in outcome.told
    assert written(x) == (["P40=1.000"] if said.lower().startswith(b"y") else [])
    assert ("Nothing was written." in outcome.out) is not bool(written(x))


def test_ctrl_c_at_the_question_writes_nothing(
    compax: Commands, x: SimulatedDrive, saved: Path, answer: Callable[[bytes], object]
) -> None:
    before = len(written(x))
    compax.after(60.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("params", "restore", X, str(saved))
    assert outcome.code == 130
    assert written(x)[before:] == []
    assert "sets nothing in motion" in outcome.told


def test_a_restore_that_stops_half_way_says_what_the_drive_has(
    compax: Commands, x: SimulatedDrive, saved: Path
) -> None:
    when_received(x, compax, "P10=333", lambda: setattr(x, "silent", True))
    outcome = compax("params", "restore", X, str(saved), "--yes", "--name", "x")
    assert outcome.code == 9
    rows = {line.split()[0]: line for line in outcome.err.splitlines() if line.startswith("P")}
    assert "what it had before" in rows["P41"]
    assert "not known" in rows["P10"] or "the new one" in rows["P10"]
    assert "the parameters may be unprotected still" in outcome.told


def test_ctrl_c_while_it_is_put_in_force_says_that_it_is_written(compax: Commands, x: SimulatedDrive) -> None:
    x.extra_answer_delay_s = 0.05
    when_received(x, compax, "VP", lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("params", "set", X, "P10=333", "--yes", "--name", "x")
    assert outcome.code == 130
    assert (
        "Interrupted. x: 1 parameter written and read back; whether VP has put it in force is not known."
        in outcome.told
    )


def test_ctrl_c_half_way_says_what_the_drive_has(compax: Commands, x: SimulatedDrive, saved: Path) -> None:
    x.extra_answer_delay_s = 0.05
    when_received(x, compax, "P40=1.500", lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("params", "restore", X, str(saved), "--yes", "--name", "x", "--roll-back")
    assert outcome.code == 130
    assert "the new one, read back: 333.0 (it was 100.0)" in outcome.told
    assert "Interrupted. What was written was taken back." in outcome.told
    assert written(x)[-1] == "GOTO 270"
    assert json.loads(compax("params", "get", X, "P10", "--json").out)[0]["value"] == 100.0
