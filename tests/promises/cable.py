"""A cable between a client and a simulated drive that can be pulled, and plugged in again, or into another drive."""

from __future__ import annotations

import asyncio

from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = ["Cable"]


class Cable:
    """
    Serves a drive as ``loop://<name>`` while it is plugged in.

    Attributes:
        half_open: While set, bytes vanish in both directions, and nobody is told: a connection that is half open.
        opened: How often somebody has connected, or tried to while it was plugged in.
    """

    def __init__(self, name: str = "cable") -> None:
        self.url = f"loop://{name}"
        self.half_open = False
        self.opened = 0
        self._name = name
        self._listener: LoopbackListener | None = None
        self._connections: set[Connection] = set()

    async def plug(self, far: SimulatedDrive) -> None:
        """Lead to *far* from now on."""
        cable, line = self, DeviceLine.of(far)

        class End(Connection):
            def data_received(self, data: bytes) -> None:
                if not cable.half_open:
                    super().data_received(data)

            def _send(self, data: bytes) -> None:
                if not cable.half_open:
                    super()._send(data)

        def connected() -> End:
            self.opened += 1
            return End(line, self._connections)

        self._listener = await listen(self._name, connected)

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
