"""What comes is on the disk while it comes: incomplete until it is whole, and nothing that was there is lost."""

from __future__ import annotations

import asyncio
import os
import stat
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.archive import Archive


def _noon() -> datetime:
    return datetime(2026, 5, 4, 12, 30, 15, tzinfo=UTC)


def _names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


async def test_a_file_has_its_name_only_when_it_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "O01234.nc"
    archive = Archive(target, "program")
    await archive.open()
    assert archive.place == tmp_path / "O01234.nc.incomplete"
    archive.write(b"%\n")
    archive.write(b"O01234\n%\n")
    assert not target.exists()
    assert await archive.finish(11) == target
    assert target.read_bytes() == b"%\nO01234\n%\n"
    assert _names(tmp_path) == ["O01234.nc"]


async def test_it_is_written_while_it_comes(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "a", "program")
    await archive.open()
    for _ in range(10):
        archive.write(b"x" * 1000)
        await asyncio.sleep(0.1)
    assert archive.place is not None
    while archive.place.stat().st_size < 8000:  # noqa: ASYNC110 - a thread is at it
        await asyncio.sleep(0.1)
    assert await archive.leave() == archive.place
    assert archive.place.read_bytes() == b"x" * 10_000


async def test_what_fills_the_last_block_is_left_out(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "a", "program")
    await archive.open()
    archive.write(b"%\nO1\n%\n" + b"\x1a" * 100)
    await archive.finish(7)
    assert (tmp_path / "a").read_bytes() == b"%\nO1\n%\n"


async def test_a_transfer_that_failed_leaves_what_came_and_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "a.nc"
    target.write_bytes(b"before")
    archive = Archive(target, "program")
    await archive.open()
    archive.write(b"half")
    assert await archive.leave() == tmp_path / "a.nc.incomplete"
    assert (tmp_path / "a.nc.incomplete").read_bytes() == b"half"
    assert target.read_bytes() == b"before"


async def test_an_incomplete_file_is_never_overwritten(tmp_path: Path) -> None:
    for count in range(3):
        archive = Archive(tmp_path / "a", "program")
        await archive.open()
        archive.write(b"%d" % count)
        await archive.leave()
    assert _names(tmp_path) == ["a.2.incomplete", "a.3.incomplete", "a.incomplete"]
    assert [(tmp_path / name).read_bytes() for name in _names(tmp_path)] == [b"1", b"2", b"0"]


async def test_nothing_is_left_where_nothing_came(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "a", "program")
    await archive.open()
    await archive.discard()
    assert _names(tmp_path) == []
    assert archive.place is None
    never_opened = Archive(tmp_path / "a", "program")
    await never_opened.discard()
    assert await never_opened.leave() is None


async def test_a_file_keeps_its_permissions_and_a_link_stays_one(tmp_path: Path) -> None:
    real, link = tmp_path / "real.nc", tmp_path / "link.nc"
    real.write_bytes(b"old")
    real.chmod(0o600)
    link.symlink_to(real)
    archive = Archive(str(link), "program")
    await archive.open()
    archive.write(b"new")
    assert await archive.finish(3) == real
    assert link.is_symlink()
    assert (real.read_bytes(), stat.S_IMODE(real.stat().st_mode)) == (b"new", 0o600)


# Folders -------------------------------------------------------------------------------------------------------------


async def _kept(folder: Path, name: str | None) -> Path:
    archive = Archive(folder, "program", now=_noon)
    await archive.open()
    archive.write(b"x")
    return await archive.finish(1, name)


async def test_data_are_no_programs(tmp_path: Path) -> None:
    archive = Archive(tmp_path, "settings", now=_noon)
    await archive.open()
    assert (await archive.finish(0)).name == "settings 2026-05-04 12-30-15.txt"


async def test_a_folder_gets_names_by_what_it_is_and_the_time(tmp_path: Path) -> None:
    assert (await _kept(tmp_path, "O01234")).name == "O01234 2026-05-04 12-30-15.nc"
    assert (await _kept(tmp_path, "O01234")).name == "O01234 2026-05-04 12-30-15 2.nc"
    assert (await _kept(tmp_path, None)).name == "program 2026-05-04 12-30-15.nc"
    assert len(_names(tmp_path)) == 3


async def test_a_file_system_without_hard_links_will_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def link(source: object, target: object) -> None:
        raise OSError("no links here")

    monkeypatch.setattr(os, "link", link)
    assert (await _kept(tmp_path, "O1")).name == "O1 2026-05-04 12-30-15.nc"
    assert (await _kept(tmp_path, "O1")).name == "O1 2026-05-04 12-30-15 2.nc"
    assert len(_names(tmp_path)) == 2


async def test_the_time_is_that_of_the_clock_on_the_wall(tmp_path: Path) -> None:
    archive = Archive(tmp_path, "settings")
    await archive.open()
    await archive.leave()
    assert _names(tmp_path)[0].startswith(f"settings {datetime.now().astimezone():%Y-}")


# What cannot be ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["no/such/folder/a.nc", "a\0b"])
async def test_a_place_that_cannot_be_is_refused_before_anybody_goes_to_the_control(tmp_path: Path, path: str) -> None:
    archive = Archive(tmp_path / path, "program")
    with pytest.raises(InvalidCommandError):
        await archive.open()


async def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="no plain file"):
        await Archive(tmp_path / "pipe", "program").open()


@pytest.mark.parametrize("path", [7, b"a", None])
def test_a_path_is_a_path(path: Any) -> None:
    with pytest.raises(InvalidCommandError, match="archive is the path"):
        Archive(path, "program")


class _FullDisk:
    def __init__(self, file: Any) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        self._file.close()


async def test_a_full_disk_is_told_at_the_end(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "a", "program")
    await archive.open()
    archive._file = _FullDisk(archive._file)  # type: ignore[assignment]
    archive.write(b"x" * 5000)
    archive.write(b"x")
    with pytest.raises(OSError, match="No space"):
        await archive.finish(5001)
    assert await archive.leave() == tmp_path / "a.incomplete"
    assert not (tmp_path / "a").exists()


async def test_names_come_to_an_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compax_aio.haas.archive._MOST_NAMES", 2)
    await _kept(tmp_path, "O1")
    with pytest.raises(FileExistsError):
        await _kept(tmp_path, "O1")
    (tmp_path / "a.incomplete").touch()
    with pytest.raises(InvalidCommandError, match="incomplete files"):
        await Archive(tmp_path / "a", "program").open()


async def test_who_is_cancelled_while_it_is_opened_leaves_no_file(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "a", "program")
    opening = asyncio.ensure_future(archive.open())
    await asyncio.sleep(0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    await archive.discard()
    assert _names(tmp_path) == []
