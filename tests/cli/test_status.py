"""``compax status``: how a drive stands, once or again and again, through lost lines, until Ctrl-C."""

from __future__ import annotations

import io
import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console
from tests.fakes.commands import Commands

from compax_aio.cli.standing import Standing, as_line, as_table
from compax_aio.compax.codecs import DriveStatus
from compax_aio.compax.facts.device_errors import device_error
from compax_aio.compax.facts.status import S16_BITS, S17_BITS
from compax_aio.simulator.compax import Knobs, LogKind


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def printed(standing: Standing) -> str:
    console = Console(file=io.StringIO(), width=160)
    console.print(as_table(standing))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def standing(**changes: object) -> Standing:
    values: dict[str, object] = {
        "drive": "x",
        "unit": "mm",
        "status": DriveStatus.decode("S016: 11010000", "S017: 00000010"),
        "error": None,
        "position": 1.5,
        "target": 2.0,
        "following_error": 0.001,
        "speed": 50.0,
        "torque": 3.0,
    }
    return Standing(**(values | changes))  # type: ignore[arg-type]


# Once -----------------------------------------------------------------------------------------------------------------


def test_every_bit_is_shown_with_its_meaning(compax: Commands) -> None:
    drive = compax.drive("x", Knobs(position=12.5))
    outcome = compax("status", "sim://compax?name=x")
    assert outcome.code == 0
    for bit in (*S16_BITS, *S17_BITS):
        assert bit.meaning_when_set in outcome.told
    assert "position 12.500 units" in outcome.told
    assert "No error is present" in outcome.out
    assert drive.log.texts(LogKind.MOTION_STARTED) == []
    assert "STOP" not in drive.log.texts(LogKind.LINE)


def test_a_fault_is_shown_with_cause_and_remedy(compax: Commands) -> None:
    drive = compax.drive("x")
    compax.after(0.0, lambda: drive.raise_fault(53))
    told = compax("status", "sim://compax?name=x").told
    assert "not so: no fault" in told
    assert "E53: overload of motor or unit cause: the effective load" in told
    assert "remedy: reduce load" in told


def test_json_has_every_bit_by_name(compax: Commands) -> None:
    compax.drive("x", Knobs(homed=True))
    document = compax("status", "sim://compax?name=x", "--name", "axis", "--json").document
    assert document["drive"] == "axis"
    assert document["status"]["machine_zero_approached"] is True
    assert document["position"] == 0.0
    assert document["error"] is None
    assert document["refused"] == {}


def test_what_was_not_said_is_told_as_such() -> None:
    told = printed(standing(target=None, status=None, refused={"target": "E90", "error": "no"}))
    assert "not said" in told
    assert "does not say its status" in told
    assert "target was not said: E90" in told
    assert "No error is present" not in told


@pytest.mark.parametrize(
    ("s17", "s16", "word"),
    [("00100010", "11010000", "moving"), ("00000010", "11011000", "position reached"), ("0" * 8, "0" * 8, "standing")],
)
def test_one_line_says_in_a_word_how_it_stands(s17: str, s16: str, word: str) -> None:
    assert word in as_line(standing(status=DriveStatus.decode(s16, s17)))


def test_one_line_tells_an_error_and_what_is_not_known() -> None:
    line = as_line(standing(error=device_error(55), status=None, position=None))
    assert "E55: emergency stop" in line
    assert "position not said" in line
    assert "status not said" in line


def test_a_stop_by_input_stands_out() -> None:
    assert "stopped by input I6" in printed(standing(status=DriveStatus.decode("11010100", "00001010")))


# Again and again ------------------------------------------------------------------------------------------------------


def test_watching_prints_a_line_each_time_where_there_is_no_terminal_and_ends_quietly(compax: Commands) -> None:
    compax.drive("x")
    compax.after(2.2, interrupt)
    outcome = compax("status", "sim://compax?name=x", "--watch")
    assert outcome.code == 130
    assert outcome.err == ""
    lines = outcome.out.splitlines()
    assert 4 <= len(lines) <= 6
    assert all("position 0.000 units" in line for line in lines)


def test_watching_ends_in_143_by_sigterm(compax: Commands) -> None:
    compax.drive("x")
    compax.after(1.0, lambda: signal.raise_signal(signal.SIGTERM))
    assert compax("status", "sim://compax?name=x", "--watch").code == 143


def test_watching_in_json_is_one_document_a_line_and_sees_it_move(compax: Commands) -> None:
    drive = compax.drive("x")
    compax.after(0.5, lambda: drive.receive(b"PA50\r", compax.loop.time()))
    compax.after(2.0, interrupt)
    outcome = compax("status", "sim://compax?name=x", "--watch", "--json", "--interval", "0.1")
    assert outcome.code == 130
    positions = [each["position"] for each in outcome.documents]
    assert len(positions) > 10
    assert positions[0] == 0
    assert positions[-1] == 50
    assert any(each["status"]["command_active"] for each in outcome.documents)


def test_a_line_that_is_lost_and_back_is_told_and_survived(compax: Commands) -> None:
    drive = compax.drive("x")

    def pull() -> None:
        drive.served_by._write.__self__.abort()  # type: ignore[union-attr]

    compax.after(1.1, pull)
    compax.after(4.0, interrupt)
    outcome = compax("status", "sim://compax?name=x", "--watch", "--json")
    events = [each["event"] for each in outcome.documents if "event" in each]
    assert events == ["connection_lost", "connection_restored"]
    kinds = ["event" in each for each in outcome.documents]
    assert not kinds[0]
    assert not kinds[-1], "it goes on after that"
    assert outcome.code == 130


def test_of_a_drive_that_falls_silent_nothing_is_told_that_it_did_not_say(compax: Commands) -> None:
    drive = compax.drive("x")
    compax.after(1.1, lambda: setattr(drive, "silent", True))
    compax.after(20.0, lambda: setattr(drive, "silent", False))
    compax.after(30.0, interrupt)
    outcome = compax("status", "sim://compax?name=x", "--watch", "--json")
    readings = [each for each in outcome.documents if "event" not in each]
    silent = [each for each in readings if each["position"] is None]
    assert silent, "a program is told that nothing came"
    assert all(each["refused"]["position"].startswith("no ") for each in silent)
    assert readings[-1]["position"] == 0.0


def test_a_line_that_is_given_up_ends_the_watch(compax: Commands, tmp_path: Path) -> None:
    drive = compax.drive("x")
    settings = tmp_path / "x.toml"
    settings.write_text("reconnect = false\n")

    def pull() -> None:
        drive.served_by._write.__self__.abort()  # type: ignore[union-attr]

    compax.after(1.1, pull)
    outcome = compax("status", "sim://compax?name=x", "--watch", "--settings", str(settings))
    assert outcome.code == 3
    assert "the line was lost" in outcome.told


def test_an_interval_that_means_nothing_is_refused(compax: Commands) -> None:
    drive = compax.drive("x")
    for interval in ("0", "-1", "nan", "x"):
        assert compax("status", "sim://compax?name=x", "--watch", "--interval", interval).code == 2
    assert drive.log.texts(LogKind.LINE) == []


def test_a_reading_of_which_something_is_missing_says_so(compax: Commands, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.fakes.scripted import ScriptedFarEnd  # noqa: PLC0415

    from compax_aio.transports.loopback import listen  # noqa: PLC0415

    def script(text: str) -> bytes:
        if text == "S2":
            return b"E90\r\n>"
        return f"{text[0]}{int(text[1:]):03d}: 00000000\r\n>".encode()

    async def listening() -> object:
        return await listen("refuses", lambda: ScriptedFarEnd(script))

    listener = compax.loop.run_until_complete(listening())
    with listener:  # type: ignore[attr-defined]
        once = compax("status", "loop://refuses")
        compax.after(1.0, interrupt)
        watched = compax("status", "loop://refuses", "--watch", "--json")
    assert "target was not said" in once.told
    first = json.loads(watched.out.splitlines()[0])
    assert first["target"] is None
    assert "E90" in first["refused"]["target"]


def test_on_a_terminal_the_display_is_kept_up_to_date_in_place(
    compax: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # which makes it one
    monkeypatch.setenv("TERM", "xterm-256color")
    drive = compax.drive("x")

    def pull() -> None:
        drive.served_by._write.__self__.abort()  # type: ignore[union-attr]

    compax.after(1.1, pull)
    compax.after(4.0, interrupt)
    outcome = compax("status", "sim://compax?name=x", "--watch")
    assert outcome.code == 130
    assert outcome.out.count("no warning") > 4
    assert "The line was lost, and is tried again all the while" in outcome.told
    assert "The line is back after" in outcome.told
    assert outcome.out.count("\x1b[?25l") == outcome.out.count("\x1b[?25h") == 1


def test_the_conversation_is_recorded_where_that_is_wanted(compax: Commands, tmp_path: Path) -> None:
    drive = compax.drive("x")
    trace = tmp_path / "x.trace"
    assert compax("status", "sim://compax?name=x", "--trace", str(trace)).code == 0
    assert "S17" in trace.read_text()
    asked = len(drive.log)
    outcome = compax("status", "sim://compax?name=x", "--trace", str(tmp_path / "no" / "x.trace"))
    assert outcome.code == 2
    assert "cannot be written: No such file or directory" in outcome.told
    assert len(drive.log) == asked, "nothing was sent"
