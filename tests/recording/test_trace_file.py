"""The file of a trace among all that may befall files: taken away, emptied, full, forked, raced for, forgotten."""

# ruff: noqa: ASYNC240 - files of tests are small, and nothing else runs meanwhile
from __future__ import annotations

import asyncio
import contextlib
import errno
import gc
import os
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from tests.recording.traces import BEGUN, facts, record_move

import compax_aio
from compax_aio.errors import InvalidCommandError
from compax_aio.link.taps import TAPS, Fact, Opened, Received
from compax_aio.recording import conversations, read_trace, record_trace, trace_writing
from compax_aio.recording.own_thread import OwnThread
from compax_aio.recording.trace_entries import LineMade, Missing, SessionBegun, SessionEnded, encoded
from compax_aio.recording.trace_file import SMALLEST_TRACE, TraceFile, older_file

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="Windows lets nobody take a file that is open")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "trace.jsonl"


async def written() -> None:
    """Wait until what was told so far is in the file."""
    await asyncio.sleep(0.5)


def received(path: Path) -> list[bytes]:
    return [fact.data for fact in facts(path, Received) if isinstance(fact, Received)]


def told(*data: bytes) -> list[tuple[float, str, Fact]]:
    return [(0.0, "x", Received(each)) for each in data]


# Taken away -----------------------------------------------------------------------------------------------------------


@posix_only
async def test_a_file_that_is_removed_is_begun_anew(path: Path) -> None:
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        tell(Received(b"1"))
        await written()
        path.unlink()
        tell(Received(b"2"))
        await written()
        tell(Received(b"3"))
    assert recorder.missing == 0
    assert received(path) == [b"2", b"3"]
    begun, made = facts(path)[:2]
    assert isinstance(begun, SessionBegun)
    assert begun.part == 2, "it says that something was before"
    assert made == LineMade()


@posix_only
@pytest.mark.parametrize("there", [None, ""])
async def test_a_file_that_is_rotated_away_is_left_to_who_took_it(path: Path, there: str | None) -> None:
    kept = path.with_name("kept")
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        tell(Received(b"1"))
        await written()
        path.rename(kept)
        if there is not None:
            path.touch()
        tell(Received(b"2"))
    assert received(kept) == [b"1"]
    assert received(path) == [b"2"]


async def test_a_file_that_is_emptied_is_a_trace_all_the_same(path: Path) -> None:
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        tell(Received(b"1"))
        await written()
        os.truncate(path, 0)
        tell(Received(b"2"))
    assert received(path) == [b"2"]


@posix_only
async def test_a_folder_that_is_removed_loses_entries_until_it_is_back(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    path = folder / "trace.jsonl"
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        await written()
        path.unlink()
        folder.rmdir()
        tell(Received(b"1"))
        await written()
        assert isinstance(recorder.error, FileNotFoundError)
        folder.mkdir()
        tell(Received(b"2"))
    assert recorder.missing == 1
    assert facts(path, Missing) == [Missing(1)]
    assert received(path) == [b"2"]


@posix_only
async def test_what_is_put_in_its_place_and_is_no_trace_is_left_alone(path: Path) -> None:
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        await written()
        path.unlink()
        path.write_text("mine\n")
        tell(Received(b"1"))
        await written()
        assert recorder.error is not None
    assert path.read_text() == "mine\n"
    assert recorder.missing == 2, "its end is missing, too"


@posix_only
def test_a_full_file_that_is_gone_when_it_should_become_the_older_half_costs_nothing(path: Path) -> None:
    file = TraceFile(path, SMALLEST_TRACE, BEGUN)
    file.open()

    def entries() -> Any:
        for number in range(1000):
            if number == 500:
                path.unlink()
            yield 0.0, "x", Received(b"%04d" % number * 15)

    file.write(entries())
    file.close()
    assert file.taken == 1000
    assert received(path)[-1][:4] == b"0999"


# What is there --------------------------------------------------------------------------------------------------------


async def test_a_file_that_is_no_trace_is_not_replaced_by_the_older_half(path: Path) -> None:
    older_file(path).write_text("mine\n")
    with pytest.raises(InvalidCommandError, match=r"trace\.jsonl\.1 is there, and is no trace"):
        await record_move(path)
    assert older_file(path).read_text() == "mine\n"
    assert not path.exists()
    older_file(path).unlink()
    older_file(path).mkdir()
    with pytest.raises(IsADirectoryError):
        await record_move(path)


async def test_a_session_that_begins_in_a_full_file_has_its_beginning(path: Path) -> None:
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        for _ in range(1000):
            tell(Received(b"x" * 30))
    async with record_trace(path, max_bytes=SMALLEST_TRACE) as recorder:
        recorder.line("y", {})
    begun = [(entry.session, entry.fact.part) for entry in read_trace(path) if isinstance(entry.fact, SessionBegun)]
    assert begun == [(1, 1), (2, 1), (2, 2)]
    assert [each.line for each in conversations(path)] == ["x", "y"]


@pytest.mark.parametrize("there", [b"", b'{"at":0.0,"what":"sess', None])
async def test_the_older_half_is_read_although_the_newer_was_hardly_begun(path: Path, there: bytes | None) -> None:
    await record_move(older_file(path))
    if there is not None:
        path.write_bytes(there)
    assert len(list(conversations(path))) == 1
    assert all(entry.is_older for entry in read_trace(path) if isinstance(entry.fact, Opened))


def test_a_first_line_without_end_that_is_too_long_is_no_trace(path: Path) -> None:
    path.write_text('{"at":0.0,"what":"session"' + "x" * 300_000)
    with pytest.raises(InvalidCommandError, match="is no trace"):
        TraceFile(path, SMALLEST_TRACE, BEGUN).open()


def test_an_entry_that_nobody_would_read_is_told_as_missing() -> None:
    assert [*encoded(1.0, "x" * 300_000, Opened())] == ['{"at":1.0,"what":"missing","entries":1}']


# Others ---------------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nobody forks there")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_that_was_forked_meanwhile_does_not_keep_others_out(path: Path) -> None:
    file = TraceFile(path, SMALLEST_TRACE, BEGUN)
    file.open()
    to_child, from_parent = os.pipe()
    child = os.fork()
    if not child:
        os.close(from_parent)
        os.read(to_child, 1)
        os._exit(0)
    try:
        file.close()
        again = TraceFile(path, SMALLEST_TRACE, BEGUN)
        again.open()
        again.close()
    finally:
        os.close(from_parent)
        os.close(to_child)
        os.waitpid(child, 0)


@posix_only
def test_a_file_that_was_moved_while_it_was_opened_is_not_written_to(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    really = os.open

    def moved(*args: Any) -> int:
        descriptor = really(*args)
        path.rename(older_file(path))
        path.write_bytes(b"")
        return descriptor

    monkeypatch.setattr(os, "open", moved)
    with pytest.raises(OSError, match="somebody else records to it"):
        TraceFile(path, SMALLEST_TRACE, BEGUN).open()
    assert older_file(path).read_bytes() == b""


async def test_whoever_records_next_finds_the_file_free(path: Path) -> None:
    for _ in range(5):
        async with record_trace(path):
            pass
    assert len(facts(path, SessionEnded)) == 5


# Disks in trouble -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("room", [0, 1, 60, 61, 62, 130, 10_000])
def test_what_stands_in_the_file_is_counted_although_the_disk_was_full(
    path: Path, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    file = TraceFile(path, SMALLEST_TRACE, BEGUN)
    file.open()
    really = os.write
    left = room

    def write(descriptor: int, data: Any) -> int:
        nonlocal left
        if not left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = really(descriptor, data[:left])
        left -= count
        return count

    with monkeypatch.context() as context:
        context.setattr(os, "write", write)
        try:
            file.write(told(b"1", b"2", b"3" * 3000, b"4"))
        except OSError as error:
            assert error.errno == errno.ENOSPC  # noqa: PT017 - only where there is no room
    whole = path.read_bytes().splitlines(keepends=True)
    data = b"".join(line for line in whole if line.endswith(b"\n")).count(b'"what":"received"')
    assert file.taken == (data if data < 3 else 2 if data < 5 else data - 2)
    file.close()


@pytest.mark.parametrize("room", [*range(0, 400, 23), 400])
def test_a_disk_with_hardly_any_room_leaves_a_trace_that_can_be_read_however_often_it_is_tried(
    path: Path, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    really = os.write
    left = 1 << 20

    def write(descriptor: int, data: Any) -> int:
        nonlocal left
        if not left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = really(descriptor, data[:left])
        left -= count
        return count

    monkeypatch.setattr(os, "write", write)
    file = TraceFile(path, SMALLEST_TRACE, BEGUN)
    file.open()
    file.write([(0.0, "x", LineMade())])
    taken = 0
    for attempt in range(8):
        left = room
        with contextlib.suppress(OSError):
            file.write(told(b"%d" % attempt, b"1" * 60))
        taken += file.taken
    left = 1 << 20
    file.write(told(b"end"))
    file.close()
    assert received(path)[-1] == b"end"
    assert len(received(path)) == taken + 1
    assert {entry.session for entry in read_trace(path)} == {1}


async def test_only_what_is_not_in_the_file_is_told_as_missing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    really = os.write
    room = 40

    def write(descriptor: int, data: Any) -> int:
        nonlocal room
        if not room:
            room = 1 << 20
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = really(descriptor, data[:room])
        room -= count
        return count

    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        await written()
        monkeypatch.setattr(os, "write", write)
        room = 120
        for data in (b"1", b"2", b"3", b"4"):
            tell(Received(data))
        await written()
    assert recorder.missing == 2
    assert received(path) == [b"1", b"2"]
    assert facts(path, Missing) == [Missing(2)]


@pytest.mark.real_time
async def test_a_disk_that_does_not_open_the_file_is_not_waited_for_long(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_go = threading.Event()
    monkeypatch.setattr(TraceFile, "open", lambda _: may_go.wait(20))
    monkeypatch.setattr(trace_writing, "_OPENING_S", 0.05)
    try:
        with pytest.raises(OSError, match="the disk has not opened it within"):
            await record_move(path)
    finally:
        may_go.set()


# Forgotten ------------------------------------------------------------------------------------------------------------


def threads() -> list[str]:
    return [each.name for each in threading.enumerate() if each.name.startswith("compax_aio")]


@pytest.mark.real_time
def test_a_recording_that_everybody_has_forgotten_leaves_no_thread_and_no_file(path: Path) -> None:
    async def forgetful() -> None:
        block = record_trace(path)
        recorder = await block.__aenter__()
        recorder.line("x", {})(Received(b"1"))
        await asyncio.sleep(0.3)
        asyncio.get_running_loop()._asyncgens.clear()  # type: ignore[attr-defined]

    before = threads()
    for _ in range(3):
        path.unlink(missing_ok=True)
        loop = asyncio.new_event_loop()
        loop.set_debug(False)
        task = loop.create_task(forgetful())
        loop.run_until_complete(task)
        del task
        loop.close()
        del loop
    deadline = 200
    while threads() != before and deadline:
        gc.collect()
        threading.Event().wait(0.02)
        deadline -= 1
    assert threads() == before


@pytest.mark.real_time
def test_an_executor_that_nobody_knows_any_more_ends_its_thread() -> None:
    executor = OwnThread("compax_aio forgotten")
    assert executor.submit(lambda: 5).result(5) == 5
    (thread,) = (each for each in threading.enumerate() if each.name == "compax_aio forgotten")
    del executor
    gc.collect()
    thread.join(5)
    assert not thread.is_alive()


# Taps -----------------------------------------------------------------------------------------------------------------


async def test_recordings_may_be_ended_in_another_order_than_they_were_begun(path: Path, tmp_path: Path) -> None:
    first, second = record_trace(tmp_path / "first"), record_trace(path)
    await first.__aenter__()
    await second.__aenter__()
    await first.__aexit__(None, None, None)
    async with compax_aio.connect("sim://compax", name="x") as x:
        await x.position()
    await second.__aexit__(None, None, None)
    assert Opened() in facts(path)
    assert Opened() not in facts(tmp_path / "first")
    assert TAPS.get() == ()


async def test_a_task_that_outlives_the_recording_opens_its_lines_unrecorded(path: Path) -> None:
    may_go = asyncio.Event()

    async def later() -> float | None:
        await may_go.wait()
        async with compax_aio.connect("sim://compax", name="x") as x:
            return await x.position()

    async with record_trace(path) as recorder:
        task = asyncio.ensure_future(later())
        await asyncio.sleep(0)
    may_go.set()
    assert await task == 0
    assert len(facts(path)) == 2
    assert recorder.missing == 0


async def test_every_line_has_a_name_of_its_own(path: Path) -> None:
    async with record_trace(path) as recorder:
        for name in ("x", "x (2)", "x", "x", ""):
            recorder.line(name, {})
    assert [each.line for each in conversations(path)] == ["x", "x (2)", "x (3)", "x (4)", "unnamed"]
