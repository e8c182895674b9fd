"""The lines of one session are there in the next, for nobody else to read, and never more than are wanted."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from compax_aio.cli.shelling.history import MOST_LINES, LineHistory, history_file


def kept(path: Path) -> list[str]:
    return list(LineHistory(path).load_history_strings())


def test_lines_are_kept_newest_first_and_are_nobody_elses(tmp_path: Path) -> None:
    path = tmp_path / "state" / "compax" / "shell_history"
    history = LineHistory(path)
    for line in ("S1", "move 5"):
        history.store_string(line)
    assert kept(path) == ["move 5", "S1"]
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_the_file_stays_short_however_long_a_session_lasts(tmp_path: Path) -> None:
    path = tmp_path / "history"
    history = LineHistory(path)
    list(history.load_history_strings())
    for number in range(3 * MOST_LINES):
        history.store_string(f"S{number}")
    assert len(path.read_text().splitlines()) <= 2 * MOST_LINES
    assert kept(path)[0] == f"S{3 * MOST_LINES - 1}"
    assert len(path.read_text().splitlines()) <= MOST_LINES
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_what_was_pasted_and_what_is_endless_is_not_kept(tmp_path: Path) -> None:
    path = tmp_path / "history"
    history = LineHistory(path)
    for line in ("S1\nS2", "x" * 1000, "S3"):
        history.store_string(line)
    assert kept(path) == ["S3"]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", None])
def test_a_file_that_cannot_be_used_costs_nothing(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "history"
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    history = LineHistory(path)
    assert list(history.load_history_strings()) == []
    assert history.trouble is not None
    history.store_string("S1")
    assert path.is_dir() or path.read_bytes() == content


def test_a_folder_that_cannot_be_made_costs_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    history = LineHistory(tmp_path / "file" / "history")
    history.store_string("S1")
    assert history.trouble is not None


def test_it_lies_in_the_folder_of_the_users_state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert history_file() == tmp_path / "compax" / "shell_history"
    monkeypatch.setenv("XDG_STATE_HOME", "not/absolute")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert history_file() == tmp_path / ".local" / "state" / "compax" / "shell_history"
