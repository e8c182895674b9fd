"""A cable between a client and a simulated drive that can be pulled, and plugged in again, or into another drive."""

from __future__ import annotations

import asyncio

from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = ["Cable"]


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
