"""Which serial ports this computer has."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from urllib.parse import quote

from serial.tools import list_ports as pyserial_list_ports

__all__ = ["PortInfo", "list_ports", "list_ports_blocking"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PortInfo:
    """
    One serial port.

    Attributes:
        device: What it is opened by: ``/dev/ttyUSB0``, ``COM3``.
        description: What the system says about it; ``n/a`` if nothing.
        manufacturer: Maker of a USB adapter, or None.
        serial_number: Serial number of a USB adapter, or None: what tells two equal ones apart.
    """

    device: str
    description: str
    manufacturer: str | None
    serial_number: str | None

    @property
    def url(self) -> str:
        """The URL that opens this port with its default settings."""
        return f"serial://{quote(self.device)}"


async def list_ports() -> list[PortInfo]:
    """Return the serial ports of this computer, by name; the search runs in a thread."""
    return await asyncio.to_thread(list_ports_blocking)


def list_ports_blocking() -> list[PortInfo]:
    """Return the serial ports of this computer, by name; for use in a thread."""
    return [
        PortInfo(
            device=port.device,
            description=port.description or "n/a",
            manufacturer=port.manufacturer,
            serial_number=port.serial_number,
        )
        for port in sorted(pyserial_list_ports.comports(), key=lambda port: port.device)
    ]
