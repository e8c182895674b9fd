"""Simulated drives as a test holds them: the URL for the application, and what the far end testifies afterwards."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping
from contextlib import asynccontextmanager
from typing import Any, Final

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import Knobs, LogEntry, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

from .lines import SCHEME, StagedLine
from .motions import Motion, motions_in

__all__ = ["SimulatedAxis", "SimulatedGroup"]

_LOG_ENTRIES: Final = 500_000
_POLL_S: Final = 0.001
_NAME: Final = re.compile(r"[A-Za-z0-9_.-]{1,40}")
_ABSOLUTE: Final = re.compile(r"(?:PA|POSA) ?([+-]?\d+(?:\.\d*)?)[$,]*")
_TOLD_BY_A_STORY: Final = 40
_LOOKS: Final = re.compile(r"S\d+|P20")


class SimulatedAxis:
    """
    A simulated drive, its axis, and its line, at which the application under test is the other end.

    Attributes:
        name: By which it is known in the test.
        far_end: The drive itself, with its log, inputs, outputs and parameters.
    """

    def __init__(self, name: str, knobs: Knobs) -> None:
        if not _NAME.fullmatch(name):
            raise ValueError(f"a drive is named by letters, digits, and _ . - only, not {name!r}")
        self.name = name
        self.far_end = SimulatedDrive(knobs, name=name, log_entries=_LOG_ENTRIES)
        self.line = StagedLine(self.far_end)
        self._is_off = False

    def __repr__(self) -> str:
        return f"<SimulatedAxis {self.name!r} at {self.position:g}>"

    # For the application

    @property
    def url(self) -> str:
        """What the application opens in this process, in place of ``serial://...``: ``test://x``."""
        return f"{SCHEME}://{self.name}"

    @asynccontextmanager
    async def serve_pty(self) -> AsyncIterator[str]:
        """
        Put the drive on a pseudo-terminal, for other processes and libraries; gives its ``serial://`` URL.

        On the real clock, not in virtual time: nobody can speed up another process. Linux and macOS.
        """
        async with serve_pty(self.far_end) as url:
            yield url

    @asynccontextmanager
    async def serve_tcp(self) -> AsyncIterator[str]:
        """Put the drive on a free TCP port of this computer; gives its ``tcp://`` URL. See :meth:`serve_pty`."""
        async with serve_tcp(self.far_end) as url:
            yield url

    # Power

    def power_down(self) -> None:
        """Take the drive's power away."""
        self.far_end.power_off()
        self._is_off = True

    def power_up(self) -> None:
        """Give the drive's power back, if it has none."""
        if self._is_off:
            self._is_off = False
            self.far_end.power_on()

    # What it testifies

    @property
    def position(self) -> float:
        """Where the axis is now, in its own unit."""
        return self.far_end.position

    @property
    def moving(self) -> bool:
        """Whether the axis moves now, braking included."""
        return self.far_end.moving

    @property
    def connected(self) -> bool:
        """Whether somebody has the line open now."""
        ends = [entry.kind for entry in self.log if entry.kind in {LogKind.CONNECTED, LogKind.DISCONNECTED}]
        return bool(ends) and ends[-1] is LogKind.CONNECTED

    @property
    def lines(self) -> list[str]:
        """Every line that has arrived, oldest first, without its CR."""
        return [entry.text for entry in self.log if entry.kind is LogKind.LINE]

    @property
    def motions(self) -> list[Motion]:
        """Every motion of the axis, oldest first."""
        return motions_in(self.log)

    @property
    def refused(self) -> list[tuple[str, str]]:
        """
        Every line that was answered with an error, oldest first, and that answer: ``[("PA150$", "E93")]``.

        A drive whose knob ``error_style`` keeps errors to itself tells of none.
        """
        refused, line = [], ""
        for entry in self.log:
            if entry.kind is LogKind.LINE:
                line = entry.text
            elif entry.kind is LogKind.ANSWER and re.match(r"E\d\d", entry.text):
                refused.append((line, entry.text))
        return refused

    @property
    def log(self) -> list[LogEntry]:
        """
        All that the drive has done.

        Raises:
            AssertionError: More than it can keep, so that nobody can say what is true of all of it.
        """
        log = self.far_end.log
        if log.maxlen is not None and len(log) >= log.maxlen:
            raise AssertionError(
                f"{self.name} has done more than its log holds, {log.maxlen} entries; test less at once"
            )
        return list(log)

    def story(self, entries: int = _TOLD_BY_A_STORY) -> str:
        """Tell the last things that happened, a line each; what was merely read (S1-S250) is left out."""
        told = list(_told(self.far_end.log))
        left_out = [f"({len(told) - entries} earlier entries)"] if len(told) > entries else []
        return "\n".join(left_out + told[-entries:]) or "nobody has spoken to it"

    # What a test asserts

    def assert_standing(self) -> None:
        """Assert that the axis stands: the application left nothing moving."""
        __tracebackhide__ = True
        if self.moving:
            raise AssertionError(self._said(f"still moves, at {self.position:g}"))

    def assert_stopped(self) -> None:
        """Assert that the last motion was stopped on its way (``STOP`` or ``BREAK``), and that the axis stands."""
        __tracebackhide__ = True
        motions = self.motions
        if not motions:
            raise AssertionError(self._said("was not stopped: it never moved"))
        if motions[-1].ended_by != "stopped":
            raise AssertionError(self._said(f"was not stopped: {str(motions[-1]).strip()}"))

    def assert_never_moved(self) -> None:
        """Assert that the axis has never been set in motion."""
        __tracebackhide__ = True
        if self.motions:
            raise AssertionError(self._said(f"has moved: {str(self.motions[0]).strip()}"))

    def assert_never_commanded_outside(self, lowest: float, highest: float) -> None:
        """
        Assert that no target lay outside *lowest* to *highest*, in the axis's unit.

        It counts every motion that began, however it was commanded, relative ones by where they led, and every
        absolute target that was sent, also where the drive refused it. The search of machine zero counts not.
        """
        __tracebackhide__ = True
        targets = [
            (entry.at, entry.text, float(sent[1]))
            for entry in self.log
            if entry.kind is LogKind.LINE and (sent := _ABSOLUTE.fullmatch(entry.text))
        ]
        targets += [(motion.started_at, motion.command, motion.target) for motion in self.motions if not motion.homing]
        for at, text, target in sorted(targets):
            if not lowest <= target <= highest:
                raise AssertionError(
                    self._said(f"was commanded to {target:g} ({text}) at {at:.3f} s, outside {lowest:g} to {highest:g}")
                )

    def assert_nothing_refused(self) -> None:
        """Assert that the drive has refused no line."""
        __tracebackhide__ = True
        if self.refused:
            raise AssertionError(
                self._said("refused " + ", ".join(f"{line!r} with {why}" for line, why in self.refused))
            )

    # Waiting

    async def until(self, condition: Callable[[SimulatedAxis], object], *, timeout_s: float = 60.0) -> None:
        """
        Wait until *condition* holds of this axis: ``await axis.until(lambda axis: axis.position > 50)``.

        It is looked at every millisecond of the event loop's time.

        Args:
            condition: Called with this axis.
            timeout_s: How long at most, in seconds, above 0.

        Raises:
            AssertionError: It did not hold in time.
        """
        loop = asyncio.get_running_loop()
        give_up_at = loop.time() + timeout_s
        while not condition(self):
            if loop.time() >= give_up_at:
                raise AssertionError(self._said(f"has not come to what was waited for within {timeout_s:g} s"))
            await asyncio.sleep(_POLL_S)

    async def until_moving(self, *, timeout_s: float = 60.0) -> None:
        """Wait until the axis moves; see :meth:`until`."""
        await self.until(lambda axis: axis.moving, timeout_s=timeout_s)

    async def until_standing(self, *, timeout_s: float = 600.0) -> None:
        """Wait until the axis stands; see :meth:`until`."""
        await self.until(lambda axis: not axis.moving, timeout_s=timeout_s)

    def _said(self, what: str) -> str:
        return f"{self.name} {what}"


class SimulatedGroup(Mapping[str, SimulatedAxis]):
    """Simulated drives by name; each has a line of its own, as :class:`compax_aio.DriveGroup` wants it."""

    def __init__(self) -> None:
        self._axes: dict[str, SimulatedAxis] = {}

    def add(self, *names: str, **knobs: Any) -> SimulatedAxis:
        """
        Add drives, and return the last of them.

        Args:
            names: Of the drives.
            knobs: Of :class:`compax_aio.simulator.compax.Knobs`, the same for all of them: ``machine_zero=-40``.

        Raises:
            TransportError: No such knob or value.
            ValueError: There is a drive of that name already, or it can be no name, or there is none.
        """
        if not names:
            raise ValueError("name the drives that are to be added: simulated_group.add('x', 'y')")
        for name in names:
            if name in self._axes:
                raise ValueError(f"there is a drive {name!r} already")
            self._axes[name] = SimulatedAxis(name, made(knobs))
        return self._axes[names[-1]]

    @property
    def urls(self) -> dict[str, str]:
        """The URL of each, for ``DriveGroup.connect``."""
        return {name: axis.url for name, axis in self._axes.items()}

    def __getitem__(self, name: str) -> SimulatedAxis:
        if name not in self._axes:
            raise KeyError(f"no drive {name!r} was added; there are {', '.join(self._axes) or 'none'}")
        return self._axes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._axes)

    def __len__(self) -> int:
        return len(self._axes)

    def assert_standing(self) -> None:
        """Assert that every axis stands: the application left nothing moving."""
        __tracebackhide__ = True
        for axis in self._axes.values():
            axis.assert_standing()

    def assert_nothing_refused(self) -> None:
        """Assert that no drive has refused a line."""
        __tracebackhide__ = True
        for axis in self._axes.values():
            axis.assert_nothing_refused()


def made(knobs: Mapping[str, Any]) -> Knobs:
    """
    Make knobs of their names and values.

    Raises:
        TransportError: There is none of that name, or it does not take that value.
    """
    known = Knobs.__dataclass_fields__
    for name in knobs:
        if name not in known:
            raise TransportError(
                f"a simulated drive has no knob {name!r}", hint=f"there are {', '.join(sorted(known))}"
            )
    return Knobs(**knobs)


def _told(log: Iterable[LogEntry]) -> Iterator[str]:
    """Write what happened; a question that only looks is left out, and its answer."""
    looked = False
    for entry in log:
        if entry.kind is LogKind.LINE:
            looked = _LOOKS.fullmatch(entry.text) is not None
        if not (looked and entry.kind in {LogKind.LINE, LogKind.ANSWER}):
            yield f"{entry.at:9.3f} s  {entry.kind.value.replace('_', ' '):17}{entry.text}".rstrip()
