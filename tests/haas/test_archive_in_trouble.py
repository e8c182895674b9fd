"""What a disk does, or does not, in the middle of a transfer: nothing that came is lost, and what is told is so."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.haas.bench import Bench, bench, ending, outcome, program_of, text_of
from tests.promises.bench import watch_what_is_left_behind

from compax_aio.errors import AnswerTimeoutError, InvalidCommandError
from compax_aio.haas.archive import Archive
from compax_aio.haas.transfer import Received, Transfer

PROGRAM = program_of(600)
_A_MOMENT_S = 0.05


@pytest.fixture(autouse=True)
async def nothing_left_behind() -> AsyncIterator[None]:
    """After the test no task is left over, and asyncio has nothing to complain about."""
    async with watch_what_is_left_behind():
        yield


def _files(folder: Path) -> list[Path]:
    return list(folder.iterdir())


def _fails(*_: object) -> None:
    raise OSError(28, "No space left on device")


def _cancel_within(monkeypatch: pytest.MonkeyPatch, work: str, transfer: Callable[[], Transfer[Any]]) -> None:
    """Cancel the transfer while a thread is at *work* for the first time; it goes on a moment later."""
    original = getattr(Archive, work)
    loop = asyncio.get_running_loop()
    was_there = False

    def slow(self: Archive, *args: Any) -> Any:
        nonlocal was_there
        if not was_there:
            was_there = True
            is_cancelled = threading.Event()
            loop.call_soon_threadsafe(lambda: (transfer().cancel(), loop.call_soon(is_cancelled.set)))
            is_cancelled.wait(5)
            threading.Event().wait(_A_MOMENT_S)  # who does not wait for the thread is through by now
        return original(self, *args)

    monkeypatch.setattr(Archive, work, slow)


def _transfer(b: Bench) -> Transfer[Any]:
    assert b.control.transfer is not None
    return b.control.transfer


async def _cancelled(b: Bench, size_bytes: int, place: Path) -> Transfer[Any]:
    b.far.memory.programs["O01234"] = program_of(size_bytes)
    transfer = b.control.receive_program(archive=place, on_operator=b.hand(("send", "O01234")))
    with pytest.raises(asyncio.CancelledError):
        await transfer
    await asyncio.sleep(20)
    return transfer


async def test_who_cancels_while_the_file_gets_its_name_is_told_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with bench() as b:
        _cancel_within(monkeypatch, "_finish", lambda: _transfer(b))
        account = (await _cancelled(b, 600, tmp_path / "a.nc")).account
        assert account.archive == tmp_path / "a.nc"
        assert account.archive.stat().st_size == account.bytes
        assert _files(tmp_path) == [account.archive]


@pytest.mark.parametrize("size_bytes", [600, 6000])
async def test_who_cancels_while_bytes_are_written_loses_none_of_them(
    size_bytes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with bench() as b:
        _cancel_within(monkeypatch, "_append", lambda: _transfer(b))
        account = (await _cancelled(b, size_bytes, tmp_path / "a.nc")).account
        assert account.archive == tmp_path / "a.nc.incomplete"
        assert account.archive.stat().st_size == account.bytes > 500
        assert _files(tmp_path) == [account.archive]


async def test_who_is_cancelled_while_he_waits_for_the_disk_takes_no_bytes_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_go_on = threading.Event()
    original = Archive._append

    def slow(self: Archive, data: bytes) -> None:
        may_go_on.wait(5)
        original(self, data)

    monkeypatch.setattr(Archive, "_append", slow)
    archive = Archive(tmp_path / "a", "program")
    await archive.open()
    archive.write(b"x" * 5000)
    archive.write(b"y" * 10)
    finishing = asyncio.ensure_future(archive.finish(5010))
    await asyncio.sleep(0)
    finishing.cancel()
    await asyncio.wait([finishing])
    may_go_on.set()
    assert await archive.leave() == tmp_path / "a.incomplete"
    assert (tmp_path / "a.incomplete").read_bytes() == b"x" * 5000 + b"y" * 10


async def test_what_a_full_disk_has_no_room_for_comes_with_whatever_error_ends_the_transfer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(Archive, "_append", _fails)
    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(9000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await asyncio.sleep(9)
        assert "is not kept in" in caplog.text  # it is told while the operator is still there
        b.far.press_reset()
        error = await ending(transfer)
        assert isinstance(error, AnswerTimeoutError)
        assert text_of(error.data)[:500] == program_of(9000)[:500]  # type: ignore[attr-defined]
        assert len(error.data) == error.transfer.bytes > 4096  # type: ignore[attr-defined]
        assert error.__notes__[-1].startswith("not all that came is in ")
        assert "what came is in" not in str(error.__notes__)


async def test_a_disk_that_cannot_be_closed_is_told_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.fsync", _fails)
    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(2000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await asyncio.sleep(2)
        b.far.press_reset()
        error = await ending(transfer)
        assert "not all that came is in " in error.__notes__[-1]
        assert len(error.data) == error.transfer.bytes > 500  # type: ignore[attr-defined]


async def test_where_nothing_came_no_file_is_said_to_have_it(tmp_path: Path) -> None:
    async with bench() as b:
        error = await ending(b.control.receive_program(archive=tmp_path / "a.nc", operator_timeout_s=1))
        assert "a.nc" not in str(error.__notes__)
        assert error.transfer.archive is None  # type: ignore[attr-defined]


async def test_what_came_is_said_once_to_be_in_its_file(tmp_path: Path) -> None:
    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(2000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await asyncio.sleep(2)
        b.far.press_reset()
        error = await ending(transfer)
        assert [note.partition(":")[0] for note in error.__notes__] == [
            "transfer",
            f"what came is in {tmp_path / 'a.nc.incomplete'}",
        ]
        assert not hasattr(error, "data")


async def test_what_cannot_be_written_or_read_is_said_with_what_to_do(tmp_path: Path) -> None:
    async with bench() as b:
        (tmp_path / "folder").mkdir()
        name = "x" * 250  # there is no room for ".incomplete" behind it
        error = await ending(b.control.receive_program(archive=tmp_path / name))
        assert isinstance(error, InvalidCommandError)
        assert "the archive cannot be written" in error.what
        assert "may write to" in str(error.hint)
        error = await ending(b.control.receive_program(archive=tmp_path / "no" / "a.nc"))
        assert str(error).startswith("c: there is no folder")
        error = await ending(b.control.send_program(tmp_path / "none.nc"))
        assert isinstance(error, InvalidCommandError)
        assert "what is to be sent cannot be read" in error.what
        assert "nothing was sent" in str(error.hint)


async def test_an_error_of_the_operator_s_own_is_not_taken_for_one_of_the_archive() -> None:
    def operator(_: str) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    async with bench() as b:
        with pytest.raises(BrokenPipeError):
            await b.control.receive_program(on_operator=operator)
        received = await outcome(b.control.receive_program(on_operator=b.hand(("send", "O01234"))))
        assert isinstance(received, Received)


@pytest.mark.real_time
async def test_a_disk_that_does_nothing_is_not_waited_for_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("compax_aio.haas.archive._LONGEST_S", _A_MOMENT_S)
    wakes = threading.Event()

    def hangs(*_: object) -> None:
        wakes.wait(20)

    archive = Archive(tmp_path / "a.nc", "program")
    await archive.open()
    monkeypatch.setattr(Archive, "_append", hangs)
    archive.write(b"x" * 5000)
    try:
        for ends in (archive.finish(5000), archive.leave(), archive.discard()):
            with pytest.raises(TimeoutError, match="has done nothing for"):
                await ends
        assert archive.failure is not None
    finally:
        wakes.set()
    monkeypatch.setattr("compax_aio.haas.archive._LONGEST_S", 20)
    await archive.discard()
    assert _files(tmp_path) == []
