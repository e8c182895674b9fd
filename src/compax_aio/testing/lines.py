"""The line between an application under test and a simulated drive, ``test://x``, and what can befall it."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, Final
from weakref import WeakKeyDictionary

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.hunt.troubled_line import TroubledLine
from compax_aio.simulator.line import DeviceLine
from compax_aio.transports.registry import ProtocolFactory

__all__ = ["SCHEME", "StagedLine"]

SCHEME: Final = "test"

_WIRE_ENTRIES: Final = 1_000
_TURNS_UNTIL_GIVEN_BACK: Final = 2


class StagedLine:
    """
    The line of one simulated drive, in whatever event loop it is opened.

    Args:
        far_end: The drive.
    """

    def __init__(self, far_end: SimulatedDrive) -> None:
        self._far_end = far_end
        self._lines: WeakKeyDictionary[asyncio.AbstractEventLoop, TroubledLine] = WeakKeyDictionary()

    def here(self) -> TroubledLine:
        """Return the line in the running event loop."""
        loop = asyncio.get_running_loop()
        line = self._lines.get(loop)
        if line is None:
            wire: Any = deque(maxlen=_WIRE_ENTRIES)
            line = self._lines[loop] = TroubledLine(f"{SCHEME}-{self._far_end.name}", self._far_end, wire)
        return line

    async def open(self, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        """
        Connect an application.

        Raises:
            TransportError: Somebody else is connected, or a fault lets nobody connect.
        """
        line, device = self.here(), DeviceLine.of(self._far_end)
        # A connection that has just been lost at this end is given back in the next turns of the loop.
        for _ in range(_TURNS_UNTIL_GIVEN_BACK):
            if device.occupied:
                await asyncio.sleep(0)
        if line.refused:
            raise TransportError(
                f"{SCHEME}://{self._far_end.name} refuses the connection: a fault of this test has cut it"
            )
        if device.occupied and not line.vanishing:
            raise TransportError(
                f"somebody else is connected to {SCHEME}://{self._far_end.name}",
                hint="close that connection first; a serial line has two ends",
            )
        return line.connect(protocol_factory())

    def heal(self) -> None:
        """End all troubles of the line; a connection that was cut stays cut."""
        for loop, line in list(self._lines.items()):
            if not loop.is_closed():
                line.vanishing = False
                line.heal()

    def close(self) -> None:
        """Take the line away, and hang up on whoever has left it open."""
        for loop, line in list(self._lines.items()):
            line.close()
            if not loop.is_closed():
                line.cut()
        self._lines.clear()
