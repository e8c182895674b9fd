"""The line of a `compax haas` command: its URL, how the control is set up, and how long things may take."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from compax_aio.haas.connecting import connect
from compax_aio.haas.control import Control
from compax_aio.haas.profiles import EndOfBlock, ParityIn, Profile, profile_named
from compax_aio.haas.settings import ControlSettings

from ..number_words import NUMBER
from ..opening import DriveLine, closing

__all__ = ["ControlLine", "ControlUrl", "SetUp"]

ControlUrl = Annotated[
    str,
    Parameter(help="Line of the control: serial:///dev/ttyUSB0, tcp://192.168.1.50:4001, sim://haas …"),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SetUp:
    """How the control is set up: both ends must agree."""

    profile: str = "classic"
    """classic (9600 7E2, Xon/Xoff), classic-dc-codes, classic-rts-cts, classic-xmodem, data-collection,
    data-collection-19200, data-collection-115200 or next-generation; the URL of a port says more."""
    eob: EndOfBlock | None = None
    """What ends a block that is sent (Setting 25), in place of the profile's."""
    parity_in: ParityIn | None = None
    """bytes: the parity bit is made and checked here, so that damage is found at its place, over any line."""

    def known(self) -> Profile:
        """Return what that says; raises InvalidCommandError where it cannot be meant."""
        told: dict[str, Any] = {"eob": self.eob, "parity_in": self.parity_in}
        return replace(
            profile_named(self.profile), **{name: value for name, value in told.items() if value is not None}
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ControlLine:
    """How a control is talked to."""

    operator_timeout: Annotated[float | None, NUMBER] = None
    """Seconds that somebody may take to press SEND or RECV; 120 if not given."""
    silence_timeout: Annotated[float | None, NUMBER] = None
    """Seconds for which nothing may come, or the control may hold the line, in a file; 30 if not given."""
    answer_timeout: Annotated[float | None, NUMBER] = None
    """Seconds that an answer to a question may take; 2 if not given."""
    name: str | None = None
    """What the control is called in messages; its URL if not given."""
    trace: Path | None = None
    """Record all that goes over the line to this file, for `compax replay` and `compax trace check`."""

    @property
    def settings(self) -> ControlSettings:
        """What the options say; raises InvalidCommandError where that cannot be meant."""
        told: dict[str, Any] = {
            "operator_timeout_s": self.operator_timeout,
            "silence_timeout_s": self.silence_timeout,
            "answer_timeout_s": self.answer_timeout,
        }
        return ControlSettings(**{name: value for name, value in told.items() if value is not None})

    @asynccontextmanager
    async def open(self, url: str, profile: Profile) -> AsyncIterator[Control]:
        """Open the line, which sends nothing; leaving the block cancels a transfer on its way, and closes the line."""
        settings = self.settings
        async with DriveLine(trace=self.trace).recorded():
            control = await connect(url, profile=profile, name=self.name, settings=settings)
            async with closing(control.close):
                yield control
