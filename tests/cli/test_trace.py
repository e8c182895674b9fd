"""``compax trace``: what is in a recorded conversation, and whether the promises were kept in it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.commands import Commands
from tests.recording.traces import rewritten, write

from compax_aio.link.contract import Lane
from compax_aio.link.taps import Asked, Ended, Lost, Opened, Ready, Received, Sent
from compax_aio.recording.trace_entries import LineMade, Missing, SessionEnded


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def trace(compax: Commands, tmp_path: Path) -> Path:
    path = tmp_path / "trace.jsonl"
    assert compax("move", "sim://compax", "12.5", "--name", "x", "--trace", str(path)).code == 0
    return path


def write_twice(entries: list[dict[str, Any]]) -> None:
    at = next(at for at, entry in enumerate(entries) if entry.get("data") == "PA12.5$\r")
    again = {key: value for key, value in entries[at].items() if key != "number"}
    end = next(at for at, entry in enumerate(entries) if entry["what"] == "let go")
    entries[end:end] = [{**again, "at": entries[end]["at"]}] * 12


# Check ----------------------------------------------------------------------------------------------------------------


def test_a_trace_in_which_the_promises_were_kept_ends_with_0(compax: Commands, trace: Path) -> None:
    outcome = compax("trace", "check", str(trace))
    assert outcome.code == 0
    rows = outcome.out.splitlines()
    assert rows[0] == "session 1, line x"
    assert rows[1].split() == ["P1", "held", *["one", "outstanding", "exchange", "a", "line"]]
    assert rows[-1] == "7 held, 3 cannot be told."
    assert "P7 cannot be told what else the program had to do is not in a trace" in outcome.told


def test_a_broken_promise_is_told_with_its_place_and_ends_with_1(compax: Commands, trace: Path) -> None:
    rewritten(trace, write_twice)
    place = next(
        at for at, line in enumerate(trace.read_text().splitlines(), 1) if "PA12.5$" in line and "number" not in line
    )
    outcome = compax("trace", "check", str(trace))
    assert outcome.code == 1
    assert "P2 broken a motion is written at most once" in outcome.told
    assert f"line {place}, at " in outcome.told
    assert "'PA12.5$' was written 2 times, and asked for 1 times" in outcome.told
    assert "… and 2 more; --json has them all" in outcome.told
    assert "2 broken" in outcome.told.replace("3 broken", "2 broken")


def test_json_has_all_verdicts_and_all_findings(compax: Commands, trace: Path) -> None:
    rewritten(trace, write_twice)
    outcome = compax("trace", "check", str(trace), "--json")
    assert outcome.code == 1
    verdicts = {each["promise"]: each for each in outcome.document}
    assert list(verdicts) == [f"P{number}" for number in range(1, 11)]
    assert verdicts["P2"]["outcome"] == "BROKEN"
    assert len(verdicts["P2"]["findings"]) == 12
    assert verdicts["P2"]["findings"][0]["place"] > 10
    assert verdicts["P9"]["outcome"] == "HELD"


def test_axes_on_one_line_are_checked_by_their_own_handshake(compax: Commands, tmp_path: Path) -> None:
    path = tmp_path / "t"
    assert compax("smc", "move", "sim://smc?axes=A", "A", "500", "--trace", str(path)).code == 0
    outcome = compax("trace", "check", str(path))
    assert outcome.code == 0
    assert "6 held, 4 cannot be told." in outcome.told


def test_a_device_that_nobody_knows_is_told_as_such(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "t", [(0.0, "x", LineMade("plotter")), (0.1, "x", Opened())])
    outcome = compax("trace", "check", str(path))
    assert outcome.code == 0
    assert "P1 cannot be told nobody knows the turns of a device of the kind 'plotter'" in outcome.told
    assert "10 cannot be told." in outcome.told


def test_only_some_lines_or_one_session_are_checked_if_that_is_wanted(compax: Commands, trace: Path) -> None:
    assert compax("move", "sim://compax", "3", "--name", "y", "--trace", str(trace)).code == 0
    assert compax("trace", "check", str(trace), "--line", "y").out.startswith("session 2, line y")
    assert compax("trace", "check", str(trace), "--session", "1").out.startswith("session 1, line x")
    both = compax("trace", "check", str(trace))
    assert "14 held, 6 cannot be told." in both.told
    refused = compax("trace", "check", str(trace), "--line", "z")
    assert refused.code == 2
    assert "there is no such line in the trace" in refused.told


def test_what_cannot_be_checked_is_refused(compax: Commands, tmp_path: Path, trace: Path) -> None:
    assert "cannot be read: No such file" in compax("trace", "check", str(tmp_path / "none")).told
    empty = tmp_path / "empty"
    empty.touch()
    outcome = compax("trace", "check", str(empty))
    assert outcome.code == 2
    assert "there is no line in the trace" in outcome.told
    rewritten(trace, lambda entries: entries[1]["about"]["settings"].update(decimals=7))
    outcome = compax("trace", "check", str(trace))
    assert outcome.code == 2
    assert "line 'x' of session 1 cannot be checked: decimals" in outcome.told


def test_a_trace_with_a_gap_says_how_far_it_was_looked_at(compax: Commands, trace: Path) -> None:
    rewritten(trace, lambda entries: entries.insert(60, {"at": 9.0, "what": "missing", "entries": 3}))
    outcome = compax("trace", "check", str(trace))
    assert outcome.code == 0
    assert "P1 held one outstanding exchange a line (entries are missing from line 61 on)" in outcome.told


# Info -----------------------------------------------------------------------------------------------------------------


def test_info_says_what_is_in_a_trace(compax: Commands, trace: Path) -> None:
    outcome = compax("trace", "info", str(trace))
    assert outcome.code == 0
    assert outcome.out.startswith("session 1, begun 20")
    row = outcome.out.splitlines()[2].split()
    assert row[:2] == ["x", "compax"]
    assert row[-3:] == ["1", "0", "0"]
    assert "cut" not in outcome.told


def test_info_tells_cuts_gaps_losses_and_missing_beginnings(compax: Commands, tmp_path: Path) -> None:
    path = write(
        tmp_path / "t",
        [
            (0.0, "x", LineMade("compax")),
            (0.0, "x", Opened()),
            (0.1, "x", Asked(1, "S1", Lane.READ)),
            (0.1, "x", Sent(b"S1\r", 1)),
            (1.1, "x", Ended(1, "AnswerTimeoutError", "no answer")),
            (1.2, "x", Received(b"12345")),
            (2.0, "x", Lost("unplugged")),
            (3.0, "x", Ready(2)),
            (3.1, "", Missing(7)),
            (9.5, "y", Opened()),
        ],
    )
    rewritten(path, lambda entries: entries[0].update(part=2))
    with path.open("a") as file:
        file.write('{"at":9.9,"li')
    outcome = compax("trace", "info", str(path))
    for words in (
        "9.500 s; cut in the middle of a line, as by a crash: the rest is lost",
        "its beginning is not there: the trace was full",
        "7 entries are missing: the disk was too slow, or full",
        "x compax 1 1 3 5 1 1 1",
        "y unknown 0 0 0 0 1 0 0",
    ):
        assert words in outcome.told
    (session,) = compax("trace", "info", str(path), "--json").document["sessions"]
    assert session["ending"] == "cut"
    assert session["missing"] == 7
    assert session["lines"][0]["times_lost"] == 1


def test_info_tells_a_recording_that_was_not_ended(compax: Commands, tmp_path: Path) -> None:
    path = write(tmp_path / "t", [])
    assert "not ended: the program was killed, or still records" in compax("trace", "info", str(path)).told
    path = write(tmp_path / "t", [(1.0, "", SessionEnded())])
    assert "not ended" not in compax("trace", "info", str(path)).told


@pytest.mark.parametrize("content", ["", '{"at":0.0,"wh'])
def test_info_of_an_empty_trace_says_so(compax: Commands, tmp_path: Path, content: str) -> None:
    path = tmp_path / "t"
    path.write_text(content)
    outcome = compax("trace", "info", str(path))
    assert outcome.code == 0
    assert "nothing is recorded there" in outcome.told


@pytest.mark.parametrize("settings", [{"answer_timeout_s": 10**400}, {"answer_timeout_s": "long"}, {"profile": 3}, []])
@pytest.mark.parametrize("device", ["compax", "smc"])
def test_settings_of_others_are_refused_or_left_alone(
    compax: Commands, tmp_path: Path, device: str, settings: object
) -> None:
    path = write(tmp_path / "t", [(0.0, "x", LineMade(device, about={"mode": "party", "settings": settings}))])
    outcome = compax("trace", "check", str(path))
    assert outcome.code in {0, 2}
    assert "defect" not in outcome.told
