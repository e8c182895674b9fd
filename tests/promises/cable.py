"""A cable between a client and a simulated drive that can be pulled, and plugged in again, or into another drive."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from typing import Any

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = ["Cable", "connected", "outage", "outcome"]

_SOON_S = 100.0
"""Longer than anything may take that is awaited, with the settings' defaults."""


class End(Connection):
    """The drive's end of one connection."""

    def __init__(self, line: DeviceLine, connections: set[Connection], cable: Cable) -> None:
        super().__init__(line, connections)
        self._cable = cable

    @property
    def _half_open(self) -> set[Connection]:
        return self._cable.forgotten

    def data_received(self, data: bytes) -> None:
        if not (self._cable.half_open or self in self._half_open):
            super().data_received(data)

    def _send(self, data: bytes) -> None:
        if not self._cable.half_open:
            super()._send(data)

    def connection_lost(self, exc: Exception | None) -> None:
        if self in self._half_open:
            self._transport = None
            self._connections.discard(self)
        else:
            super().connection_lost(exc)


class Cable:
    """
    Serves a drive as ``loop://<name>`` while it is plugged in.

    Attributes:
        half_open: While set, all bytes vanish in both directions, and nobody is told.
        forgotten: Connections whose bytes vanish for good.
        opened: How often somebody has connected, or tried to while it was plugged in.
    """

    def __init__(self, name: str = "cable") -> None:
        self.url = f"loop://{name}"
        self.opened = 0
        self._name = name
        self._listener: LoopbackListener | None = None
        self._connections: set[Connection] = set()
        self.half_open = False
        self.forgotten: set[Connection] = set()

    async def plug(self, far: SimulatedDrive) -> None:
        """Lead to *far* from now on."""
        line = DeviceLine.of(far)

        def connected() -> End:
            self.opened += 1
            return End(line, self._connections, self)

        self._listener = await listen(self._name, connected)

    def go_half_open(self) -> None:
        """Let all bytes of those who are connected vanish, and tell nobody; who comes anew is served."""
        for connection in self._connections:
            self.forgotten.add(connection)
            connection._line.disconnect()

    @property
    def is_plugged(self) -> bool:
        """Whether it leads to a drive."""
        return self._listener is not None

    async def pull(self) -> None:
        """Lose the line, and let nobody connect."""
        assert self._listener is not None
        with self._listener:
            pass
        self._listener = None
        for connection in tuple(self._connections):
            connection.abort()
        await asyncio.sleep(0)
        await asyncio.sleep(0)


@asynccontextmanager
async def connected(
    settings: DriveSettings | None = None, *, may_fail_to_close: bool = False, **knobs: Any
) -> AsyncIterator[tuple[Drive, SimulatedDrive, Cable]]:
    """Connect to a simulated drive over a cable; *may_fail_to_close* where the test leaves it in trouble."""
    far, cable = SimulatedDrive(Knobs(**knobs), name="x"), Cable()
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x", settings=settings)
    try:
        yield drive, far, cable
    finally:
        try:
            await drive.close()
        except CompaxError:
            if not may_fail_to_close:
                raise
        if cable.is_plugged or not may_fail_to_close:
            await cable.pull()


async def outage(cable: Cable, far: SimulatedDrive, seconds: float, *, power_cycle: bool = False) -> None:
    """Pull the cable for so long, and perhaps switch the drive off and on meanwhile."""
    await cable.pull()
    await asyncio.sleep(seconds)
    if power_cycle:
        far.power_cycle()
    await cable.plug(far)


async def outcome(work: Awaitable[Any], at_most_s: float = _SOON_S) -> Any:
    """Return the result of *work*, or the CompaxError that it ends with; it must end in time."""
    async with asyncio.timeout(at_most_s):
        try:
            return await work
        except CompaxError as error:
            return error
