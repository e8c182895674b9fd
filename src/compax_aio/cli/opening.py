"""The line that a command works on: its URL, and the options that all commands with a line have."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings, InvalidCommandError

__all__ = ["DriveLine", "Url", "closing"]

Url = Annotated[
    str,
    Parameter(
        help="Line of the drive: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001, sim://compax …",
    ),
]


@asynccontextmanager
async def closing(close: Callable[[], Awaitable[None]]) -> AsyncIterator[None]:
    """
    Call *close*, which stops and closes, as the block is left.

    A block that fails raises its own error, with a note if something could not be stopped as it was left.
    """
    try:
        yield
    except CompaxError as error:
        try:
            await close()
        except CompaxError as on_leaving:
            error.add_note(f"as the line was closed: {on_leaving}")
        raise
    except BaseException:
        await close()
        raise
    else:
        await close()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DriveLine:
    """How a drive is talked to."""

    name: str | None = None
    """What the drive is called in messages; its URL if not given."""
    settings: Annotated[Path | None, Parameter(env_var="COMPAX_SETTINGS")] = None
    """TOML file with the settings of the drive, as `compax probe` writes it."""
    trace: Path | None = None
    """Record all that goes over the line to this file, for `compax replay` and `compax trace check`."""

    @asynccontextmanager
    async def open(self, url: str) -> AsyncIterator[Drive]:
        """
        Connect to the drive; leaving the block stops what was started and closes the line.

        A block that fails raises its own error, with a note if the drive could not be stopped as it was left.
        """
        settings = self.drive_settings()
        async with self.recorded():
            drive = await compax_aio.connect(url, name=self.name, settings=settings)
            async with closing(drive.close):
                yield drive

    @asynccontextmanager
    async def recorded(self) -> AsyncIterator[None]:
        """
        Record what goes over lines that are opened in this block, if that is wanted.

        Raises:
            InvalidCommandError: The file cannot be written.
        """
        async with AsyncExitStack() as stack:
            if self.trace is not None:
                from compax_aio.recording import record_trace  # noqa: PLC0415 - few need it

                try:
                    await stack.enter_async_context(record_trace(self.trace))
                except OSError as error:
                    raise InvalidCommandError(
                        f"the trace {self.trace} cannot be written: {error.strerror or error}"
                    ) from error
            yield

    def drive_settings(self) -> DriveSettings:
        """
        Return the settings of the file, or the defaults without one.

        Raises:
            InvalidCommandError: The file cannot be read, or says something that cannot be meant.
        """
        if self.settings is None:
            return DriveSettings()
        try:
            return DriveSettings.load(self.settings)
        except OSError as error:
            raise InvalidCommandError(
                f"the settings file {self.settings} cannot be read: {error.strerror or error}",
                hint="`compax probe URL -o FILE` writes one",
            ) from error
