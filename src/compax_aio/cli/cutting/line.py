"""The line of a `compax camm1` command: its URL, which cutter it is, and how it is talked to."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from compax_aio import CompaxError, camm1
from compax_aio.camm1.connecting import connect
from compax_aio.camm1.cutter import Cutter
from compax_aio.camm1.settings import CutterSettings

from ..number_words import NUMBER, WHOLE
from ..opening import DriveLine

__all__ = ["CutterLine", "CutterUrl", "Machine"]

CutterUrl = Annotated[
    str,
    Parameter(help="Line of the cutter: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001, sim://camm1 …"),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Machine:
    """Which machine a job is for."""

    profile: str = "PNC-1610"
    """Model of the cutter or plotter, as in pnc-900 or hp7475a; what is not known of it is asked, or refused."""

    def known(self) -> camm1.Profile:
        """Return what is known of it; raises InvalidCommandError if there is no such model."""
        return camm1.profile_named(self.profile)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CutterLine:
    """How a cutter is talked to."""

    baud_rate: Annotated[int | None, WHOLE] = None
    """Of the line, where the URL does not say it, as behind a terminal server; so stops stay quick."""
    answer_timeout: Annotated[float | None, NUMBER] = None
    """Seconds that a reply may take; 2 if not given."""
    stall_timeout: Annotated[float | None, NUMBER] = None
    """Seconds for which a cutter may take nothing, unless it is paused, before a job is given up; 60 if not given."""
    name: str | None = None
    """What the cutter is called in messages; its URL if not given."""
    trace: Path | None = None
    """Record all that goes over the line to this file, for `compax replay` and `compax trace check`."""

    @property
    def settings(self) -> CutterSettings:
        """What the options say; raises InvalidCommandError where that cannot be meant."""
        told: dict[str, Any] = {
            "baud_rate": self.baud_rate,
            "answer_timeout_s": self.answer_timeout,
            "stall_timeout_s": self.stall_timeout,
        }
        return CutterSettings(**{name: value for name, value in told.items() if value is not None})

    @asynccontextmanager
    async def open(self, url: str, profile: camm1.Profile) -> AsyncIterator[Cutter]:
        """
        Connect to the cutter; leaving the block aborts a job that is on its way, and closes the line.

        A block that fails raises its own error, with a note if the cutter could not be left as it should be.
        """
        settings = self.settings
        async with DriveLine(trace=self.trace).recorded():
            cutter = await connect(url, profile=profile, name=self.name, settings=settings)
            try:
                yield cutter
            except CompaxError as error:
                try:
                    await cutter.close()
                except CompaxError as on_leaving:
                    error.add_note(f"as the line was closed: {on_leaving}")
                raise
            finally:
                await cutter.close()
