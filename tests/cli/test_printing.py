"""What a command prints: documents for programs, text for people, errors beside them."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.table import Table

from compax_aio import MessageForm, errors
from compax_aio.cli import __main__ as entry
from compax_aio.cli.opening import DriveLine
from compax_aio.cli.printing import Printing, as_json, tell_error
from compax_aio.transports.serial import PortInfo


@pytest.mark.parametrize(
    ("value", "document"),
    [
        (None, None),
        (True, True),
        (1, 1),
        (1.5, 1.5),
        (float("nan"), "nan"),
        (float("inf"), "inf"),
        ("text", "text"),
        (Path("a/b"), "a/b"),
        (MessageForm.UNKNOWN, "UNKNOWN"),
        ({1: (2, 3)}, {"1": [2, 3]}),
        (b"\x01", "b'\\x01'"),
        (
            PortInfo(device="COM3", description="n/a", manufacturer=None, serial_number="1"),
            {"device": "COM3", "description": "n/a", "manufacturer": None, "serial_number": "1"},
        ),
    ],
)
def test_values_as_json_has_them(value: Any, document: Any) -> None:
    assert as_json(value) == document
    json.dumps(as_json(value), allow_nan=False)


def test_errors_in_data_say_all_they_know() -> None:
    document = as_json({"x": errors.AnswerTimeoutError("silence", hint="look")})
    assert document["x"]["kind"] == "AnswerTimeoutError"
    assert document["x"]["hint"] == "look"


def test_people_and_programs_are_shown_the_same_data(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("axis")
    table.add_row("[bold]x")
    Printing().show({"axis": "x"}, table)
    assert "[bold]x" in capsys.readouterr().out
    Printing(json=True).show({"axis": "x"}, table)
    assert capsys.readouterr().out == '{"axis": "x"}\n'
    Printing().show({"axis": "x"})
    assert capsys.readouterr().out == ""


def test_notes_are_for_people_and_beside_the_results(capsys: pytest.CaptureFixture[str]) -> None:
    Printing().note("moving to [5]")
    Printing(json=True).note("nothing")
    assert capsys.readouterr() == ("", "moving to [5]\n")


def test_a_long_line_is_not_cut(capsys: pytest.CaptureFixture[str]) -> None:
    Printing().show(None, "word " * 100)
    assert len(capsys.readouterr().out.splitlines()) == 1


@pytest.mark.parametrize("columns", ["0", "1", "x", ""])
def test_a_terminal_without_a_width_is_written_to_all_the_same(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    table = Table("axis", "position")
    table.add_row("x", "1.5")
    Printing().show(None, table)
    tell_error(errors.CompaxError("no", exchanges=("1 → S1",)), as_document=False)
    assert capsys.readouterr().out


def test_the_last_exchanges_are_told_and_notes_too(capsys: pytest.CaptureFixture[str]) -> None:
    error = errors.AnswerTimeoutError("silence", exchanges=tuple(f"{n} → S{n}" for n in range(10)))
    error.add_note("at 9600 baud: nothing came")
    tell_error(error, as_document=False)
    told = capsys.readouterr().err
    assert "AnswerTimeoutError: silence" in told
    assert "at 9600 baud" in told
    assert "9 → S9" in told
    assert "0 → S0" not in told


def test_an_error_of_the_system_is_told_by_what_it_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    tell_error(FileNotFoundError(2, "No such file or directory", "x.toml"), as_document=False)
    assert capsys.readouterr().err == "x.toml: No such file or directory\n"
    tell_error(FileNotFoundError(2, "No such file or directory", "x.toml"), as_document=True)
    assert json.loads(capsys.readouterr().err)["error"]["file"] == "x.toml"
    tell_error(OSError(), as_document=False)
    assert capsys.readouterr().err == "OSError\n"


@pytest.mark.parametrize(("encoding", "text"), [("ascii", '"\\u00b0\\udcff"'), ("utf-8", '"°\\udcff"')])
def test_a_document_fits_any_stream_and_stays_json(encoding: str, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding, errors="strict"))
    entry._mend_streams()
    Printing(json=True).show("°\udcff")
    assert raw.getvalue().decode(encoding).strip() == text
    assert json.loads(text) == "°\udcff"


def test_a_stream_that_the_shell_has_closed_is_no_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stdin", None)
    entry._mend_streams()
    Printing().show(None, "to nobody")
    assert sys.stdin.read() == ""
    for stream in (sys.stdout, sys.stdin):
        stream.close()


# What the options of a line say ---------------------------------------------------------------------------------------


def test_a_settings_file_that_cannot_be_read_is_refused_with_how_to_get_one(tmp_path: Path) -> None:
    with pytest.raises(errors.InvalidCommandError, match=r"cannot be read: No such file.*compax probe"):
        DriveLine(settings=tmp_path / "no.toml").drive_settings()
    (tmp_path / "bad.toml").write_text("unit = 5")
    with pytest.raises(errors.InvalidCommandError, match="unit"):
        DriveLine(settings=tmp_path / "bad.toml").drive_settings()
    (tmp_path / "good.toml").write_text('unit = "mm"')
    assert DriveLine(settings=tmp_path / "good.toml").drive_settings().unit == "mm"
    assert DriveLine().drive_settings().unit == "units"


# The program ----------------------------------------------------------------------------------------------------------


def hide(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let the import of the commands fail."""

    class Finder:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "compax_aio.cli.app":
                raise error

    monkeypatch.delitem(sys.modules, "compax_aio.cli.app", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Finder(), *sys.meta_path])


def test_without_its_libraries_the_command_says_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hide(monkeypatch, ModuleNotFoundError("No module named 'cyclopts'", name="cyclopts"))
    assert entry.main() == 2
    assert "pip install 'compax-aio[cli]'" in capsys.readouterr().err


def test_ctrl_c_while_it_is_still_importing_shows_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    hide(monkeypatch, KeyboardInterrupt())
    assert entry.main() == 130


def test_a_module_of_ours_that_is_missing_is_not_explained_away(monkeypatch: pytest.MonkeyPatch) -> None:
    hide(monkeypatch, ModuleNotFoundError("No module named 'compax_aio.x'", name="compax_aio.x"))
    with pytest.raises(ModuleNotFoundError):
        entry.main()


def test_the_words_of_the_command_line_are_carried_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["compax", "--version"])
    assert entry.main() == 0
    assert capsys.readouterr().out.strip()
