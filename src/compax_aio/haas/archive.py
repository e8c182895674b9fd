"""
What comes from a control, kept in a file while it comes: as ``*.incomplete`` until it is whole, then under its name.

Everything that touches the disk runs in a thread, one thing after the other. A file that is there is replaced at the
end, or left as it is; one that was left incomplete by an earlier transfer is never overwritten.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import BinaryIO, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import expect_file

__all__ = ["Archive"]

_PIECE_BYTES: Final = 4096
"""So much is collected before it is written …"""
_MOST_NAMES: Final = 1000


class Archive:
    """
    One file, or one in a folder.

    Args:
        path: Of the file; or of a folder that there is, in which it gets a name by what it is and the time.
        kind: What it is, for that name.
        now: Tells the time.
    """

    def __init__(
        self,
        path: os.PathLike[str] | str,
        kind: str,
        *,
        now: Callable[[], datetime] = lambda: datetime.now().astimezone(),
    ) -> None:
        if not isinstance(path, str | os.PathLike):
            raise InvalidCommandError(f"archive is the path of a file or folder, not {shown(path)}")
        self._path = Path(path)
        self._kind = kind
        self._now = now
        self._file: BinaryIO | None = None
        self._folder: Path | None = None
        self._when = ""
        self._pending = bytearray()
        self._written = 0
        self._working: asyncio.Task[None] | None = None
        self._failure: OSError | None = None
        self.place: Path | None = None
        """Where the file is now; None before it is opened."""

    # In the event loop ----------------------------------------------------------------------------------------------

    async def open(self) -> None:
        """
        Make the incomplete file: whether that can be done is known before anybody goes to the control.

        Raises:
            InvalidCommandError: *path* can be no name, or there is no such folder.
            OSError: It cannot be made.
        """
        self._working = asyncio.get_running_loop().create_task(asyncio.to_thread(self._open))
        await asyncio.shield(self._working)  # whoever is cancelled meanwhile finds it at the end

    def write(self, data: bytes) -> None:
        """Have *data* written soon."""
        self._pending += data
        if len(self._pending) >= _PIECE_BYTES and (self._working is None or self._working.done()):
            self._working = asyncio.get_running_loop().create_task(self._flush())

    async def finish(self, size: int, name: str | None = None) -> Path:
        """
        Have all on the disk, and give the file its name.

        Args:
            size: Of the file: what came behind is left out, such as the fill of the last block.
            name: Of what it is, in a folder: ``O01234``; None: its kind.

        Raises:
            OSError: It could not be written; what could is in the incomplete file.
        """
        await self._flush_all()
        if self._failure is not None:
            raise self._failure
        self.place = await asyncio.to_thread(self._finish, size, name)
        return self.place

    async def leave(self) -> Path | None:
        """Have what came on the disk, as incomplete; return where it is, or None if there is no file."""
        await self._flush_all()
        with suppress(OSError):
            await asyncio.to_thread(self._close)
        return self.place

    async def discard(self) -> None:
        """Leave no file: nothing came."""
        await self._flush_all()
        await asyncio.to_thread(self._discard)
        self.place = None

    async def _flush_all(self) -> None:
        while self._working is not None and not self._working.done():
            await asyncio.wait([self._working])
        if self._file is not None:
            await self._flush()

    async def _flush(self) -> None:
        data, self._pending = bytes(self._pending), bytearray()
        if data and self._failure is None:
            try:
                await asyncio.to_thread(self._append, data)
            except OSError as error:  # told at the end: what comes is in memory as well
                self._failure = error

    # In a thread ----------------------------------------------------------------------------------------------------

    def _open(self) -> None:
        try:
            path = Path(os.path.realpath(self._path))
            is_folder = path.is_dir()
            if is_folder:
                self._when = f"{self._now():%Y-%m-%d %H-%M-%S}"
                self._folder = path
                path = path / f"{self._kind} {self._when}"
            elif path.exists():
                expect_file(path, path.stat())
            self._path = path
        except ValueError:
            raise InvalidCommandError(f"{shown(str(self._path))} can be no name of a file") from None
        if not path.parent.is_dir():
            raise InvalidCommandError(
                f"there is no folder {shown(str(path.parent))} for the archive", hint="make it first"
            )
        for count in range(1, _MOST_NAMES):
            place = path.with_name(f"{path.name}{'' if count == 1 else f'.{count}'}.incomplete")
            with suppress(FileExistsError):
                self._file = place.open("xb", buffering=0)
                self.place = place
                return
        raise InvalidCommandError(f"there are {_MOST_NAMES - 1} incomplete files beside {shown(str(path))}")

    def _append(self, data: bytes) -> None:
        assert self._file is not None
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._written += len(data)

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            with file:
                os.fsync(file.fileno())

    def _finish(self, size: int, name: str | None) -> Path:
        assert self._file is not None
        assert self.place is not None
        if size < self._written:
            self._file.truncate(size)
        self._close()
        target = self._path
        if self._folder is None:
            with suppress(OSError):  # there is none, or it is another's
                self.place.chmod(target.stat().st_mode)
            self.place.replace(target)
        else:
            target = self._place_in_folder(self._folder, name or self._kind)
        _sync_folder(target.parent)
        return target

    def _place_in_folder(self, folder: Path, name: str) -> Path:
        """Give the file a name that nothing in the folder has."""
        assert self.place is not None
        suffix = ".nc" if self._kind.startswith("program") else ".txt"
        for count in range(1, _MOST_NAMES):
            target = folder / f"{name} {self._when}{'' if count == 1 else f' {count}'}{suffix}"
            try:
                os.link(self.place, target)  # does not replace, as a renaming would
            except FileExistsError:
                continue
            except OSError:  # a file system without hard links
                if target.exists():
                    continue
                self.place.replace(target)
            else:
                self.place.unlink()
            return target
        raise FileExistsError(f"there are {_MOST_NAMES - 1} files of that name in {folder}")

    def _discard(self) -> None:
        self._close()
        if self.place is not None:
            with suppress(OSError):
                self.place.unlink()


def _sync_folder(folder: Path) -> None:
    """Have the new name on the disk, where a folder can be synchronised."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
