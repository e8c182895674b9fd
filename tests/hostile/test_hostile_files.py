"""Files that somebody else has made: read in little time and memory, never waited for, and refused in one line."""

from __future__ import annotations

import asyncio
import os
import re
import socket
import stat
import sys
import time
import tracemalloc
from collections.abc import Callable
from itertools import repeat
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.hostile.wicked import refusal
from tests.promises.bench import bench, ending, lines

from compax_aio import DriveSettings
from compax_aio.compax.bounded_pattern import expect_bounded_pattern
from compax_aio.compax.facts.line import ERROR_PATTERN
from compax_aio.compax.program import End
from compax_aio.compax.settings import Dialect
from compax_aio.compax.settings_file import read_settings, settings_text
from compax_aio.compax.value_file import read_file
from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.escaping import escaped, shown
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.compax.state import read_state, read_state_file, write_state_file
from compax_aio.simulator.server import serve_loopback
from compax_aio.text_file import MAX_BYTES, read_text, replace_file

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")

READERS: dict[str, Callable[[Path], object]] = {
    "settings": read_settings,
    "settings as users load them": DriveSettings.load,
    "parameters": lambda path: read_file(path, kind="parameters", letter="P"),
    "variables": lambda path: read_file(path, kind="variables", letter="V"),
    "state": read_state_file,
    "text": lambda path: read_text(path, "listing"),
}
all_readers = pytest.mark.parametrize("read", READERS.values(), ids=READERS)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "file"


@pytest.fixture
def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


@pytest.fixture
def comments(path: Path) -> Path:
    path.write_text("; a comment\n" * 20_000)
    return path


# What is no file ------------------------------------------------------------------------------------------------------


@needs_posix
@all_readers
def test_a_pipe_is_refused_and_not_waited_for(read: Callable[[Path], object], path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises((OSError, InvalidCommandError), match="pipe"):
        read(path)


@needs_posix
@all_readers
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null", "/dev/tty", "/dev/ptmx"])
def test_a_device_is_refused_and_not_opened(read: Callable[[Path], object], path: Path, device: str) -> None:
    for each in (Path(device), path):
        if each is path:
            path.symlink_to(device)
        with pytest.raises((OSError, InvalidCommandError), match="device"):
            read(each)


@needs_posix
@all_readers
def test_a_socket_a_folder_and_a_link_to_nowhere_are_refused(read: Callable[[Path], object], path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        with pytest.raises((OSError, InvalidCommandError), match="socket"):
            read(path)
    path.unlink()
    path.symlink_to(path)
    with pytest.raises(OSError, match="links"):
        read(path)
    with pytest.raises((OSError, InvalidCommandError), match=r"(?i)is a directory"):
        read(path.parent)


@all_readers
@pytest.mark.parametrize("name", ["\0", "a\0b", "\ud800"], ids=repr)
def test_a_name_that_no_file_has_is_refused(read: Callable[[Path], object], name: str) -> None:
    with pytest.raises(ValueError, match="name of a file"):
        read(Path(name))


@needs_posix
async def test_a_drive_waits_for_no_pipe_either(pipe: Path) -> None:
    path = pipe
    async with bench() as (drive, far):
        before = len(lines(far))
        for work in (
            drive.parameters.restore(path),
            drive.parameters.diff(path),
            drive.variables.restore(str(path)),
            drive.program.download(path),
            drive.program.download(str(path), dry_run=True),
        ):
            with pytest.raises(OSError, match="pipe"):
                await work
        assert lines(far)[before:] == []
        with pytest.raises(OSError, match="pipe"):
            await drive.variables.save(path)
    with pytest.raises(TransportError, match="pipe"):
        async with serve_loopback(SimulatedDrive(), "x", state=path):
            raise AssertionError("served")


# What is too much -----------------------------------------------------------------------------------------------------


@all_readers
@pytest.mark.parametrize("size", [MAX_BYTES + 1, 1 << 26, 1 << 40])
def test_a_large_file_is_refused_and_not_read_to_its_end(read: Callable[[Path], object], path: Path, size: int) -> None:
    with path.open("wb") as file:
        file.truncate(size)  # a hole: it needs no room on the disk
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=f"more than {MAX_BYTES} bytes"):
            read(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 8 * MAX_BYTES


BOMBS = {
    "deep lists": "a = " + "[" * 100_000,
    "deep tables": "a = " + "{a = " * 30_000,
    "deep key": ".".join("a" * 100_000) + " = 1",
    "deep quoted key": '."\u2028".'.join("a" * 20_000) + " = 1",
    "deep header": "[" + ".".join("a" * 100_000) + "]",
    "many digits": "resync_attempts = " + "9" * 250_000,
    "many hexadecimal digits": "resync_attempts = 0x" + "f" * 250_000,
    "many digits behind the point": "answer_timeout_s = 1." + "9" * 250_000,
    "large exponent": "answer_timeout_s = 1e" + "9" * 200_000,
    "large number": 'kind = "parameters"\n[parameters]\nP1 = ' + "9" * 4000,
    "long key": "k" * 250_000 + " = 1",
    "many keys": "\n".join(f"k{n} = {n}" for n in range(20_000)),
    "many tables": "\n".join(f"[k{n}]" for n in range(25_000)),
    "arrays of tables": "[[a]]\n" * 40_000,
    "key of a hundred parts": "\n".join(".".join("a" * 100) + f".k{n} = 1" for n in range(1200)),
    "quotes": '"' * 250_000,
    "one quote": '"' + "\\" * 200_000,
    "json lists": "[" * 200_000,
    "json tables": '{"a":' * 40_000,
    "json digits": '{"a": ' + "9" * 200_000 + "}",
    "json twice": "{" + ",".join(f'"k{n}": 1' for n in range(18_000)) + ', "k17999": 1}',
    "blanks": " " * 250_000,
    "line ends": "\n" * 250_000,
}


SAY_LITTLE = frozenset({"blanks", "line ends", "many digits behind the point"})
"""As settings these are right."""


@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_that_means_much_is_refused_in_little_time(path: Path, name: str) -> None:
    path.write_text(BOMBS[name], encoding="utf-8")
    begun_at = time.process_time()
    for kind in ("settings", "parameters", "state"):
        said = refusal(lambda kind=kind: READERS[kind](path))  # type: ignore[misc]
        length = len(said or "")
        assert length < 1500 + len(str(path)), "an error is for people"
        assert length or (kind == "settings" and name in SAY_LITTLE)
    assert time.process_time() - begun_at < 5


@all_readers
@pytest.mark.parametrize("data", [b"\xff\xfe\0", b"\xc3(", b"\xed\xa0\x80", b"a = '\xf4\x90\x80\x80'"], ids=repr)
def test_what_is_no_utf_8_is_refused(read: Callable[[Path], object], path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is no"):
        read(path)


def test_a_byte_order_mark_is_no_part_of_a_file(path: Path) -> None:
    path.write_text(settings_text(DriveSettings(unit="mm")), encoding="utf-8-sig")
    assert read_settings(path).unit == "mm"
    write_state_file(path, SimulatedDrive().save_state())
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_state_file(path)["kind"] == "simulated COMPAX"


@given(data=st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_file_is_read_or_refused_on_one_line(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    for read in READERS.values():
        assert (refusal(lambda read=read: read(path)) or "").isprintable()  # type: ignore[misc]


VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
states = st.recursive(VALUES, lambda each: st.lists(each, max_size=3) | st.dictionaries(st.sampled_from(
    ["kind", "version", "parameters", "variables", "program", "error_history", "error_present", "axis", "cycles",
     "operating_time_s", "P1", "V1", "N1", "position", "machine_zero", "homed", "x"]), each, max_size=11))  # fmt: skip


@given(change=states, name=st.sampled_from([*SimulatedDrive().save_state(), "more"]))
@settings(max_examples=300)
def test_any_state_is_kept_or_refused(change: Any, name: str) -> None:
    state = {**SimulatedDrive().save_state(), name: change}
    said = refusal(lambda: read_state(state))
    assert said == refusal(lambda: SimulatedDrive().load_state(state))
    assert len(said or "") < 300


def test_a_record_in_a_state_is_no_longer_than_a_record() -> None:
    state = SimulatedDrive().save_state()
    with pytest.raises(ValueError, match="is no record"):
        read_state({**state, "program": {"N1": "V1=" + "9" * 400}})


# Settings that would take for ever ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "pattern",
    [r"(a+)+(\d)", r"(?:a|a)*(\d)", r"a*a*a*(\d)", "a?" * 30 + "(x)", "(?:a|a)" * 20 + "(x)", r"(?:a{1,99}){1,99}(b)",
     "a{0,99}a{0,99}a{0,99}(b)", r"(?:a+?)+?(b)", "x" * 300 + "(1)", "(?:a){,200}(b)"],
)  # fmt: skip
def test_a_pattern_that_could_take_for_ever_is_refused_in_a_file(path: Path, pattern: str) -> None:
    path.write_text(f"error_pattern = '{pattern}'\n")
    with pytest.raises(InvalidCommandError, match="for ever"):
        read_settings(path)


def test_a_pattern_that_could_take_for_ever_is_refused_in_code() -> None:
    with pytest.raises(InvalidCommandError, match="for ever"):
        DriveSettings(error_pattern=r"(a+)+(\d)")


@pytest.mark.parametrize(
    "pattern",
    [ERROR_PATTERN, r"E(\d+)", r"ERR(?:OR)?\s*:?\s*(\d{1,3})", r"(?i)^error (\d+)", r"[*+?]{2}(\d)",
     r"^(?:E|F)(\d{1,3})", r"(?<![A-Z])E(?P<code>\d{1,3})", r"\*\*\*(\d)"],
)  # fmt: skip
def test_patterns_that_drives_may_need_are_taken(path: Path, pattern: str) -> None:
    expect_bounded_pattern(pattern)
    path.write_text(f"error_pattern = '{pattern}'\n")
    assert read_settings(path).error_pattern == pattern


PLACES = ["set_pointer = 'GOTO {n:999999999}'", "change_speed = '{percent:99999d}'", f"stop = '{'A' * 200_000}'"]


@pytest.mark.parametrize("word", PLACES, ids=lambda word: word[:30])
def test_a_word_that_would_fill_all_memory_is_refused_before_it_is_made(path: Path, word: str) -> None:
    path.write_text(f"[dialect]\n{word}\n")
    with pytest.raises(InvalidCommandError, match="longer than what can be sent"):
        read_settings(path)


def test_a_word_of_the_dialect_has_no_blanks_around_it() -> None:
    with pytest.raises(InvalidCommandError, match="blanks around it"):
        Dialect(stop="STOP" + " " * 40)


# Listings -------------------------------------------------------------------------------------------------------------


async def test_lines_without_end_are_refused() -> None:
    async with bench() as (drive, _):
        assert "larger" in str(await ending(drive.program.download(repeat("N001: END"))))
        assert "a line of a listing is a text" in str(await ending(drive.program.download(b"N001: END")))  # type: ignore[arg-type]


async def test_records_by_something_else_than_numbers_are_refused() -> None:
    async with bench() as (drive, _):
        for key in ("1", 1.0, None, True):
            assert "whole numbers" in str(await ending(drive.program.download({key: End()})))  # type: ignore[arg-type]


@pytest.mark.real_time
async def test_a_file_is_read_while_the_loop_goes_on(comments: Path) -> None:
    """Sixty thousand lines take a while to read; meanwhile others have moves to watch."""
    longest, last, is_over = 0.0, time.monotonic(), False

    async def watch() -> None:
        nonlocal longest, last
        while not is_over:
            await asyncio.sleep(0)
            now = time.monotonic()
            longest, last = max(longest, now - last), now

    async with bench() as (drive, _):
        watching = asyncio.create_task(watch())
        await ending(drive.program.download(comments))
        is_over = True
        await watching
    assert longest < 1.0


# Writing --------------------------------------------------------------------------------------------------------------


@pytest.fixture
def known_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody knows under which name a file is written first."""
    monkeypatch.setattr("secrets.token_hex", lambda _: "known")


@needs_posix
def test_a_link_that_was_planted_is_not_written_through(path: Path, known_names: None) -> None:
    precious = path.parent / "precious"
    precious.write_text("precious")
    (path.parent / ".file.known").symlink_to(precious)
    with pytest.raises(FileExistsError):
        replace_file(path, "new")
    with pytest.raises(FileExistsError):
        write_state_file(path, SimulatedDrive().save_state())
    assert precious.read_text() == "precious"
    assert not path.exists()


def test_the_name_under_which_a_file_is_written_first_cannot_be_known(path: Path, monkeypatch: Any) -> None:
    names = set()
    real = Path.open

    def open_and_note(self: Path, *args: Any, **more: Any) -> Any:
        names.add(self.name)
        return real(self, *args, **more)

    monkeypatch.setattr(Path, "open", open_and_note)
    for _ in range(5):
        replace_file(path, "new")
    assert len(names) == 5
    assert all(re.fullmatch(r"\.file\.[0-9a-f]{16}", name) for name in names)
    assert [each.name for each in path.parent.iterdir()] == ["file"]


@needs_posix
def test_a_device_is_not_replaced_by_a_file(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(OSError, match="no plain file"):
        replace_file(path, "new")
    assert stat.S_ISFIFO(path.stat().st_mode)
    assert len(list(path.parent.iterdir())) == 1


@needs_posix
def test_a_file_that_cannot_be_written_leaves_nothing_behind(path: Path) -> None:
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError):
        replace_file(path, "\ud800")
    assert path.read_text() == "old"
    assert len(list(path.parent.iterdir())) == 1


# Telling --------------------------------------------------------------------------------------------------------------


@needs_posix
def test_the_name_of_a_file_forges_no_line_of_a_log(tmp_path: Path) -> None:
    path = tmp_path / "x\n2031-01-01 all is well\x1b[2J"
    path.write_text("not [ toml")
    for read in READERS.values():
        assert (refusal(lambda read=read: read(path)) or "").isprintable()  # type: ignore[misc]


class Raising:
    def __repr__(self) -> str:
        raise RuntimeError


def test_whatever_a_value_is_it_can_be_told() -> None:
    assert shown("a\n\x1b") == r"'a\n\x1b'"
    assert shown(10**5000) == "<int>"
    assert shown(Raising()) == "<Raising>"
    assert len(shown("x" * 1000)) == 60
    assert escaped("plain ü") == "plain ü"
    assert escaped("a\nb\x1b\u202e\ud800") == r"a\nb\x1b\u202e\ud800"
    assert escaped("a\nb\x1b", keep="\n") == "a\nb\\x1b"
