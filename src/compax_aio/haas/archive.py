"""
What comes from a control, kept in a file while it comes: as ``*.incomplete`` until it is whole, then under its name.

Everything that touches the disk runs in a thread, one thing after the other, and is carried through although whoever
waits for it is cancelled. A file that is there from the beginning is replaced at the end, or left as it is. One that
has come there since, or was changed, is somebody else's: it is left as it is, and what came gets a name beside it. One
that was left incomplete by an earlier transfer is never overwritten.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Final, TypeVar

from ..errors import InvalidCommandError
from ..escaping import escaped, shown
from ..text_file import expect_file

__all__ = ["Archive"]

_log = logging.getLogger("compax_aio.haas")

_ResultT = TypeVar("_ResultT")

_PIECE_BYTES: Final = 4096
"""So much is collected before it is written …"""
_MOST_NAMES: Final = 1000
_LONGEST_S: Final = 30.0
"""A disk that takes longer, as one in a network that is gone, is not waited for."""


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
        self._working: asyncio.Future[Any] | None = None
        """What a thread is at, or was last."""
        self._replaces: _Identity | None = None
        """The file that was there from the beginning; None: there was none."""
        self.avoided: Path | None = None
        """Where it was to be, and is not, because somebody else's file has come there meanwhile."""
        self.place: Path | None = None
        """Where the file is now; None before it is opened."""
        self.failure: OSError | None = None
        """Why not all that came is in the file; None: it is, or will be."""

    # In the event loop ----------------------------------------------------------------------------------------------

    async def open(self) -> None:
        """
        Make the incomplete file: whether that can be done is known before anybody goes to the control.

        Raises:
            InvalidCommandError: *path* can be no name, or there is no such folder.
            OSError: It cannot be made.
        """
        await self._do(self._open)

    def write(self, data: bytes) -> None:
        """Have *data* written soon."""
        self._pending += data
        if len(self._pending) >= _PIECE_BYTES and (self._working is None or self._working.done()):
            self._begin(self._append_or_fail, self._take_pending())

    async def finish(self, size: int, name: str | None = None) -> Path:
        """
        Have all on the disk, and give the file its name.

        Args:
            size: Of the file: what came behind is left out, such as the fill of the last block.
            name: Of what it is, in a folder: ``O01234``; None: its kind.

        Raises:
            OSError: It could not be written; what could is in the incomplete file.
        """
        await self._do(self._append_or_fail, takes_pending=True)
        if self.failure is not None:
            raise self.failure
        return await self._do(self._finish, size, name)

    async def leave(self) -> Path | None:
        """
        Have what came on the disk, as incomplete; one that has its name already keeps it.

        Returns:
            Where it is, or None if there is no file. Whether all of it is there, :attr:`failure` says.

        Raises:
            TimeoutError: The disk does nothing.
        """
        await self._do(self._leave, takes_pending=True)
        return self.place

    async def discard(self) -> None:
        """
        Leave no file: nothing came.

        Raises:
            TimeoutError: The disk does nothing.
        """
        await self._do(self._discard)

    def _take_pending(self) -> bytes:
        data, self._pending = bytes(self._pending), bytearray()
        return data

    async def _do(self, work: Callable[..., _ResultT], *args: object, takes_pending: bool = False) -> _ResultT:
        """Have *work* done when what is under way is done; it goes on although who waits is cancelled meanwhile."""
        try:
            async with asyncio.timeout(_LONGEST_S):
                while self._working is not None and not self._working.done():
                    await asyncio.wait([self._working])
                if takes_pending:
                    args = (self._take_pending(), *args)
                return await asyncio.shield(self._begin(work, *args))
        except TimeoutError:
            why = f"The disk has done nothing for {_LONGEST_S:g} s"
            error = TimeoutError(errno.ETIMEDOUT, why, str(self.place or self._path))
            self.failure = self.failure or error
            raise error from None

    def _begin(self, work: Callable[..., _ResultT], *args: object) -> asyncio.Future[_ResultT]:
        self._working = working = asyncio.get_running_loop().run_in_executor(None, partial(work, *args))
        return working

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
                self._replaces = _identity_of(path)
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

    def _append_or_fail(self, data: bytes) -> None:
        """Write *data*; that it fails is told at the end, for it is in memory as well."""
        if not data or self.failure is not None or self._file is None:
            return
        try:
            self._append(data)
        except OSError as error:
            self.failure = error
            _log.warning("what comes is not kept in %s any more: %s", escaped(str(self.place)), error)

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
        if self._folder is not None:
            suffix = ".nc" if self._kind.startswith("program") else ".txt"
            target = self._take_free_name(self._folder, f"{name or self._kind} {self._when}", suffix)
        elif self._replaces is not None and _identity_of(self._path) == self._replaces:
            target = self._path
            with suppress(OSError):  # it is another's
                self.place.chmod(target.stat().st_mode)
            self.place.replace(target)
        else:
            target = self._take_free_name(self._path.parent, self._path.stem, self._path.suffix)
            self.avoided = None if target == self._path else self._path
        self.place = target
        _sync_folder(target.parent)
        return target

    def _leave(self, data: bytes) -> None:
        self._append_or_fail(data)
        try:
            self._close()
        except OSError as error:
            self.failure = self.failure or error

    def _take_free_name(self, folder: Path, stem: str, suffix: str) -> Path:
        """Give the file a name that nothing in the folder has."""
        assert self.place is not None
        for count in range(1, _MOST_NAMES):
            target = folder / f"{stem}{'' if count == 1 else f' {count}'}{suffix}"
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
        raise FileExistsError(errno.EEXIST, f"There are {_MOST_NAMES - 1} files of that name", str(folder / stem))

    def _discard(self) -> None:
        self._close()
        if self.place is not None:
            with suppress(OSError):
                self.place.unlink()
            self.place = None


_Identity = tuple[int, int, int, int]


def _identity_of(path: Path) -> _Identity | None:
    """Return what tells a file from any other, and from itself when it was changed; None: none is there."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _sync_folder(folder: Path) -> None:
    """Have the new name on the disk, where a folder can be synchronised."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
