"""Recording a trace: what goes over lines is written, beside the event loop, whole up to any byte, and bounded."""

# ruff: noqa: ASYNC240 - files of tests are small, and nothing else runs meanwhile
from __future__ import annotations

import asyncio
import errno
import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.recording.traces import facts, lines_of, record_move

import compax_aio
from compax_aio import smc
from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.link.contract import Lane
from compax_aio.link.taps import TAPS, Asked, Ended, Lost, Noticed, Opened, Opening, Ready, Received, Refused, Sent, Way
from compax_aio.recording import conversations, read_trace, record_trace, trace_writing
from compax_aio.recording.own_thread import OwnThread
from compax_aio.recording.trace_entries import LineMade, Missing, SessionBegun, SessionEnded
from compax_aio.recording.trace_file import TraceFile, older_file
from compax_aio.recording.trace_writing import TraceRecorder


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "trace.jsonl"


# What is recorded -----------------------------------------------------------------------------------------------------


async def test_a_move_is_recorded_from_opening_to_closing(path: Path) -> None:
    await record_move(path)
    told = facts(path)
    assert isinstance(told[0], SessionBegun)
    assert told[2:4] == [Opening("sim://compax"), Opened()]
    assert Ready(1) in told
    motion = next(fact for fact in told if isinstance(fact, Asked) and fact.text == "PA12.5$")
    assert motion.lane is Lane.MOTION
    assert Sent(b"PA12.5$\r", motion.number) in told
    assert Ended(motion.number, "Acknowledged") in told
    assert Received(b"$\r\n>") in told
    assert Noticed("PositionReached") in told
    assert told[-1] == SessionEnded()


async def test_a_session_says_what_is_needed_to_talk_to_the_drive_in_the_same_way(path: Path) -> None:
    await record_move(path, settings=compax_aio.DriveSettings(answer_timeout_s=0.5, decimals=3))
    (made,) = facts(path, LineMade)
    assert isinstance(made, LineMade)
    assert made.device == "compax"
    assert made.about is not None
    assert made.about["settings"]["decimals"] == 3
    assert made.about["settings"]["answer_timeout_s"] == 0.5
    assert made.about["settings"]["dialect"]["stop"] == "STOP"


async def test_every_line_that_is_made_in_the_block_is_recorded_whatever_the_device(path: Path) -> None:
    async def drive(name: str) -> None:
        async with compax_aio.connect("sim://compax", name=name) as x:
            await x.position()

    async with record_trace(path):
        await asyncio.gather(drive("x"), drive("x"), drive("y"))
        async with smc.connect("sim://smc?axes=A", axes="A", name="steppers") as line:
            await line.axis("A").position()
    assert {each.line for each in conversations(path)} == {"x", "x (2)", "y", "steppers"}
    spoken = b"".join(
        entry.fact.data for entry in read_trace(path) if isinstance(entry.fact, Sent) and entry.line == "steppers"
    )
    assert b"AZ\n" in spoken


async def test_lines_that_are_made_outside_the_block_are_not_recorded(path: Path) -> None:
    async with compax_aio.connect("sim://compax", name="before") as before:
        async with record_trace(path) as recorder:
            await before.position()
        assert TAPS.get() == ()
        async with compax_aio.connect("sim://compax", name="after") as after:
            await after.position()
    assert [type(fact) for fact in facts(path)] == [SessionBegun, SessionEnded]
    assert recorder.missing == 0


async def test_a_line_that_outlives_the_recording_goes_on_without_it(path: Path) -> None:
    async with record_trace(path):
        drive = await compax_aio.connect("sim://compax", name="x")
    await drive.position()
    await drive.close()
    assert facts(path)[-1] == SessionEnded()


async def test_two_recordings_of_one_block_both_hear_all(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    async with record_trace(other):
        await record_move(path)
    mine = [entry.fact for entry in read_trace(path) if entry.line]
    assert [entry.fact for entry in read_trace(other) if entry.line] == mine


async def test_what_fails_is_recorded_with_its_reason(path: Path) -> None:
    async with record_trace(path):
        with pytest.raises(TransportError):
            await compax_aio.connect("loop://nobody", name="x")
        async with compax_aio.connect("sim://compax", name="y") as y:
            with pytest.raises(compax_aio.CommandRejectedError):
                await y.query("P999")
            asking = asyncio.ensure_future(y.query("S1"))
            await asyncio.sleep(0)
            asking.cancel()
    told = facts(path)
    assert any(isinstance(fact, Refused) and "nobody listens" in fact.why for fact in told)
    assert any(isinstance(fact, Ended) and fact.how == "Rejected" for fact in told)
    assert any(isinstance(fact, Ended) and fact.how == "cancelled" for fact in told)


async def test_time_outs_markers_and_stops_ahead_can_be_told_apart(path: Path) -> None:
    settings = compax_aio.DriveSettings(answer_timeout_s=0.3)
    async with record_trace(path), compax_aio.connect("sim://compax?name=x", name="x", settings=settings) as drive:
        far = compax_aio.simulator.server.drive_named("x")
        far.lose_answers = 1
        with pytest.raises(compax_aio.AnswerTimeoutError):
            await drive.query("S4")
        far.lose_answers = 1
        waiting = asyncio.ensure_future(drive.query("S4"))
        await asyncio.sleep(0.301)
        waiting.cancel()
        await drive.position()
    told = facts(path)
    assert any(isinstance(fact, Ended) and fact.how == "AnswerTimeoutError" for fact in told)
    assert any(isinstance(fact, Sent) and fact.way is Way.MARKER for fact in told)


async def test_bytes_of_all_values_are_readable_and_come_back_unchanged(path: Path) -> None:
    data = bytes(range(256)) * 20
    recorder = TraceRecorder(TraceFile(path, 1 << 20, SessionBegun("now", "test")))
    await recorder.open()
    tell = recorder.line("x", {"device": "any"})
    tell(Received(data))
    tell(Sent(data, 1, Way.PREEMPT))
    await recorder.close()
    received = [fact.data for fact in facts(path, Received) if isinstance(fact, Received)]
    sent = [fact for fact in facts(path, Sent) if isinstance(fact, Sent)]
    assert b"".join(received) == data
    assert b"".join(fact.data for fact in sent) == data
    assert [fact.number for fact in sent] == [1, None, None, None, None]
    assert path.read_bytes().isascii()
    assert max(map(len, path.read_text().splitlines())) < 10_000


# Appending, cutting, size ---------------------------------------------------------------------------------------------


async def test_a_second_session_is_appended(path: Path) -> None:
    await record_move(path)
    before = path.read_bytes()
    await record_move(path)
    assert path.read_bytes().startswith(before)
    assert [entry.session for entry in read_trace(path) if isinstance(entry.fact, SessionBegun)] == [1, 2]


async def test_a_session_is_appended_behind_a_line_that_was_cut(path: Path) -> None:
    await record_move(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    await record_move(path)
    assert len(list(conversations(path))) == 2
    assert sum(isinstance(fact, SessionBegun) for fact in facts(path)) == 2


@pytest.mark.parametrize("begins", [b"", b"{", b'{"at":0.0,"what":"sess', b'{"at":0.0,"what":"session","begun":"20'])
async def test_a_file_that_was_cut_in_its_first_line_is_appended_to(path: Path, begins: bytes) -> None:
    path.write_bytes(begins)
    await record_move(path)
    assert len(list(conversations(path))) == 1


@pytest.mark.parametrize(
    "content",
    [b"answer_timeout_s = 0.5\n", b"[]\n", b'{"at":0.0,"what":"opened"}\n', b"\xff\xfe", b"a,b\n1,2", b"\n"],
)
async def test_a_file_that_is_no_trace_is_left_alone(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(InvalidCommandError, match="is no trace"):
        await record_move(path)
    assert path.read_bytes() == content


async def test_a_trace_of_a_newer_version_is_left_alone(path: Path) -> None:
    path.write_text('{"at":0.0,"what":"session","begun":"x","by":"y","format":"compax-aio trace","version":2}\n')
    with pytest.raises(InvalidCommandError, match="of version 2"):
        await record_move(path)


async def test_a_trace_has_at_most_the_size_that_it_may_have(path: Path) -> None:
    async def read_often(drive: compax_aio.Drive) -> None:
        for _ in range(800):
            await drive.position()

    most = 128 * 1024
    async with record_trace(path, max_bytes=most), compax_aio.connect("sim://compax", name="x") as drive:
        await read_often(drive)
    assert path.stat().st_size <= most // 2
    assert most // 4 < older_file(path).stat().st_size <= most // 2
    entries = list(read_trace(path))
    assert {entry.session for entry in entries} == {1}
    assert entries[0].is_older
    assert not entries[-1].is_older
    first = lines_of(path)
    assert first[0]["part"] > 1
    assert first[1]["what"] == "line"
    assert first[1]["is_open"] is True, "the newer half can be read without the other"


async def test_a_full_trace_that_is_appended_to_becomes_the_older_half(path: Path) -> None:
    await record_move(path)
    path.write_bytes(path.read_bytes() * 8)
    assert path.stat().st_size > 32 * 1024
    async with record_trace(path, max_bytes=64 * 1024):
        pass
    assert older_file(path).stat().st_size > 32 * 1024
    assert path.stat().st_size < 1000
    assert len(lines_of(path)) == 2


@pytest.mark.parametrize("most", [0, 65_535, True, 1e6, None])
async def test_a_size_that_is_too_small_is_refused(path: Path, most: Any) -> None:
    with pytest.raises(InvalidCommandError, match="max_bytes"):
        async with record_trace(path, max_bytes=most):
            raise AssertionError("recorded")
    assert not path.exists()


# Files that are none --------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")
@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "no folder", "no name"])
async def test_what_is_no_file_is_refused_before_anything_is_opened(path: Path, kind: str) -> None:
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case "device":
            path.symlink_to("/dev/null")
        case "no folder":
            path = path / "deeper"
        case "no name":
            path = Path("a\0b")
    with pytest.raises((OSError, InvalidCommandError)):
        await record_move(path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps nobody from it")
async def test_two_recordings_to_one_file_do_not_mix(path: Path) -> None:
    async with record_trace(path):
        with pytest.raises(OSError, match="somebody else records to it"):
            await record_move(path)
    await record_move(path)
    assert len(list(conversations(path))) == 1


async def test_a_link_is_followed(path: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(path)
    async with record_trace(link) as recorder:
        pass
    assert recorder.path == path
    assert link.is_symlink()
    assert facts(path)


# Disks in trouble -----------------------------------------------------------------------------------------------------


class Disk:
    """Stands between a recorder and the real disk; can be full or stuck."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_full = False
        self.may_go = threading.Event()
        self.may_go.set()
        really = TraceFile.write
        monkeypatch.setattr(TraceFile, "write", lambda file, entries: self._write(lambda: really(file, entries), file))

    def _write(self, write: Callable[[], None], file: TraceFile) -> None:
        assert self.may_go.wait(20)
        if self.is_full:
            file.taken = 0
            file.close()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


async def test_a_disk_that_is_full_for_a_while_loses_entries_and_says_how_many(
    path: Path, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    async with record_trace(path) as recorder, compax_aio.connect("sim://compax", name="x") as drive:
        await asyncio.sleep(0.5)
        disk.is_full = True
        await drive.position()
        await asyncio.sleep(0.5)
        failed = recorder.error
        await drive.position()
        await asyncio.sleep(0.5)
        disk.is_full = False
        assert await drive.position() == 0
        await asyncio.sleep(0.5)
    assert isinstance(failed, OSError)
    assert recorder.error is None, "it works again"
    (missing,) = facts(path, Missing)
    assert isinstance(missing, Missing)
    assert missing.entries == recorder.missing == 10
    assert [record.levelno for record in caplog.records].count(logging.ERROR) == 2
    assert "cannot be written: " in caplog.text
    assert "10 entries are missing" in caplog.text
    assert {entry.session for entry in read_trace(path)} == {1}, "the session goes on where it was broken off"
    assert facts(path)[-1] == SessionEnded()


async def test_a_disk_that_stays_full_ends_nothing_but_the_trace(path: Path, disk: Disk) -> None:
    async with record_trace(path) as recorder, compax_aio.connect("sim://compax", name="x") as drive:
        disk.is_full = True
        assert (await drive.move_to(5)).target == 5
    assert recorder.missing > 50
    assert isinstance(recorder.error, OSError)
    assert [type(fact) for fact in facts(path)] == [SessionBegun]


@pytest.mark.real_time
async def test_a_disk_that_is_stuck_delays_no_line_and_is_not_waited_for_long(
    path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_writing, "_MOST_WAITING", 50)
    monkeypatch.setattr(trace_writing, "_MANY", 10)
    monkeypatch.setattr(trace_writing, "_ENDING_S", 0.05)
    loop = asyncio.get_running_loop()
    disk.may_go.clear()
    try:
        async with record_trace(path) as recorder, compax_aio.connect("sim://compax", name="x") as drive:
            for _ in range(20):
                await drive.position()
            begun_at = loop.time()
        assert loop.time() - begun_at < 5
        assert recorder.missing > 20
    finally:
        disk.may_go.set()


async def test_memory_is_bounded_by_bytes_too(path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_writing, "_MOST_BYTES_WAITING", 3000)
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        for _ in range(10):
            tell(Received(b"x" * 1000))
        await asyncio.sleep(1)
        tell(Received(b"y"))
        tell(Noticed("Stray", details={"text": "y"}))
    assert recorder.missing == 8
    assert [type(fact) for fact in facts(path)] == [
        SessionBegun, LineMade, Received, Received, Missing, Received, Noticed, SessionEnded,
    ]  # fmt: skip


async def test_many_entries_are_written_before_their_time(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_writing, "_MANY", 5)
    async with record_trace(path) as recorder:
        tell = recorder.line("x", {})
        for _ in range(23):
            tell(Opened())
        tell(Lost(None))
    assert recorder.missing == 0
    assert len(facts(path, Opened)) == 23


async def test_a_recording_that_is_cancelled_as_it_ends_is_written_all_the_same(path: Path) -> None:
    async def recorded() -> None:
        async with record_trace(path):
            await asyncio.get_running_loop().create_future()

    task = asyncio.ensure_future(recorded())
    while not path.exists() or not path.stat().st_size:  # noqa: ASYNC110 - a thread makes it
        await asyncio.sleep(0.01)
    task.cancel()
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert facts(path)[-1] == SessionEnded()


async def test_a_recording_may_be_closed_twice_and_left_in_another_context(path: Path) -> None:
    block = record_trace(path)
    recorder = await asyncio.ensure_future(block.__aenter__())
    await recorder.close()
    await block.__aexit__(None, None, None)
    assert facts(path)[-1] == SessionEnded()


async def test_lines_of_another_event_loop_are_not_recorded_and_that_is_said(
    path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with record_trace(path):
        await asyncio.to_thread(asyncio.run, read_position())
    assert "x is not recorded" in caplog.text
    assert len(facts(path)) == 2


async def read_position() -> None:
    async with compax_aio.connect("sim://compax", name="x") as drive:
        await drive.position()


def test_a_job_that_is_cancelled_before_its_turn_is_not_done() -> None:
    thread = OwnThread("test")
    go = threading.Event()
    first = thread.submit(go.wait, 20)
    done: list[int] = []
    second = thread.submit(done.append, 1)
    second.cancel()
    go.set()
    failing = thread.submit(divmod, 1, 0)
    assert first.result(20)
    assert isinstance(failing.exception(20), ZeroDivisionError)
    thread.shutdown()
    assert not done


def test_a_disk_that_takes_half_of_a_batch_is_written_to_again_from_a_new_line(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = TraceFile(path, 1 << 20, SessionBegun("now", "test"))
    file.open()
    file.write([(0.0, "x", LineMade("compax")), (0.1, "x", Opened())])
    really = os.write

    def half(descriptor: int, data: memoryview) -> int:
        really(descriptor, data[:10])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", half)
    with pytest.raises(OSError, match="space"):
        file.write([(0.2, "x", Lost())])
    monkeypatch.setattr(os, "write", really)
    file.write([(0.3, "x", Opened())])
    file.close()
    assert [type(fact) for fact in facts(path)] == [
        SessionBegun, LineMade, Opened, SessionBegun, LineMade, Opened,
    ]  # fmt: skip
    (told,) = conversations(path)
    assert told.session == 1


KILLED = """
import asyncio, os, signal, sys
import compax_aio
from compax_aio.recording import record_trace

async def main():
    async with record_trace(sys.argv[1]), compax_aio.connect("sim://compax", name="x") as drive:
        for _ in range(200):
            await drive.position()
        await asyncio.sleep(0.5)
        await drive.position()
        os.kill(os.getpid(), signal.SIGKILL)

asyncio.run(main())
"""


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_program_that_is_killed_leaves_all_but_its_last_tenth_of_a_second(path: Path) -> None:
    ended = subprocess.run([sys.executable, "-c", KILLED, path], check=False, timeout=60)
    assert ended.returncode == -signal.SIGKILL
    asked = [fact for fact in facts(path, Asked) if isinstance(fact, Asked) and fact.text == "S1"]
    assert len(asked) >= 200
    (told,) = conversations(path)
    assert not told.is_ended
