"""The line of a `compax smc` command: its URL, how its axes are switched, and what they are."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from cyclopts import Parameter

from compax_aio import InvalidCommandError, smc
from compax_aio.smc.facts import NO_NAME
from compax_aio.smc.vocabulary import check_name

from ..moving import MovedSettings
from ..number_words import NUMBER
from ..opening import DriveLine, closing

__all__ = ["THE_ONLY", "AxisName", "AxisOnLine", "LineUrl", "SmcLine"]

THE_ONLY: Final = "-"
"""How the axis is called that has no name, in single mode."""

LineUrl = Annotated[
    str,
    Parameter(help="Line of the axes: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001, sim://smc …"),
]
AxisName = Annotated[
    str,
    Parameter(
        allow_leading_hyphen=True, help="Its letter; upper and lower case are different names. In single mode: -"
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SmcLine:
    """How the axes of a line are talked to."""

    mode: Literal["party", "daisy", "single"] = "party"
    """How the axes are switched: the input that each reads at a reset (DCB p. 20)."""
    profile: Literal["dcb-274", "im483i", "panther", "789a-4"] = "dcb-274"
    """Which member of the family they are; all axes of a line are alike."""
    echo_timeout: Annotated[float | None, NUMBER] = None
    """Seconds that the echo of a character may take, for slow adapters; 0.25 if not given."""
    name: str | None = None
    """What the line is called in messages; its URL if not given."""
    trace: Path | None = None
    """Record all that goes over the line to this file, for `compax replay` and `compax trace check`."""

    @property
    def settings(self) -> smc.SmcSettings:
        """What the options say; raises InvalidCommandError where that cannot be meant."""
        profile = smc.PROFILES[self.profile]
        if self.echo_timeout is None:
            return smc.SmcSettings(profile=profile)
        usual = smc.SmcSettings()
        quiet_s = max(usual.quiet_s, self.echo_timeout / 2)
        return smc.SmcSettings(profile=profile, echo_timeout_s=self.echo_timeout, quiet_s=quiet_s)

    def check(self, axis: str) -> str:
        """
        Return the name of an axis as the library takes it.

        Raises:
            InvalidCommandError: It can be no name, or axes have none in this mode.
        """
        if self.mode == "single":
            if axis != THE_ONLY:
                raise InvalidCommandError(
                    f"in single mode there is one axis, and it has no name, so not {axis!r}",
                    hint="write - in its place",
                )
            return NO_NAME
        return check_name(axis, smc.Mode(self.mode))

    @asynccontextmanager
    async def open(self, url: str, axes: Iterable[str] = ()) -> AsyncIterator[smc.PartyLine]:
        """
        Connect to the line, and ask *axes* whether they are there; leaving the block stops what was started.

        A block that fails raises its own error, with a note if an axis could not be stopped as it was left.
        """
        settings = self.settings
        asked = tuple(axes) if self.mode == "party" else ()
        async with DriveLine(trace=self.trace).recorded():
            line = await smc.connect(url, mode=self.mode, axes=asked, name=self.name, settings=settings)
            async with closing(line.close):
                for axis in axes:
                    _expect(line, axis)
                yield line

    @asynccontextmanager
    async def open_axis(self, url: str, axis: str) -> AsyncIterator[AxisOnLine]:
        """Connect to the line, and to one axis, as :meth:`open`."""
        name = self.check(axis)
        async with self.open(url, (name,)) as line:
            yield AxisOnLine(line, line.axis(name))


def _expect(line: smc.PartyLine, axis: str) -> None:
    if axis not in line.axes:
        raise InvalidCommandError(f"there is no axis {axis!r} in the chain", hint=f"there are {', '.join(line.axes)}")


@dataclass(frozen=True)
class _Settings:
    decimals: int
    answer_timeout_s: float


@dataclass(frozen=True)
class AxisOnLine:
    """One axis as views of its motion need it."""

    line: smc.PartyLine
    axis: smc.SmcAxis

    @property
    def name(self) -> str:
        """As errors call it: ``table axis X``."""
        return f"{self.line.name} axis {self.axis.name}" if self.axis.name else self.line.name

    @property
    def unit(self) -> str:
        """Steps, always."""
        return "steps"

    @property
    def is_open(self) -> bool:
        """Whether the line is there."""
        return self.line.is_open

    @property
    def settings(self) -> MovedSettings:
        """How it is talked to."""
        settings = self.line.settings
        return _Settings(settings.profile.decimals, settings.answer_timeout_s)

    async def position(self) -> float:
        """Read where it is, in steps from its origin."""
        return await self.axis.position()

    async def stop(self) -> None:
        """Stop it softly, and return when it stands."""
        await self.axis.stop()
