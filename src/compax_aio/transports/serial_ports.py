"""Which serial ports this computer has."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from urllib.parse import quote

from serial.tools import list_ports as pyserial_list_ports

from compax_aio.errors import TransportError

__all__ = ["PortInfo", "list_ports", "list_ports_blocking", "port_with_serial_number"]


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


def port_with_serial_number(serial_number: str) -> str:
    """
    Return the name of the one port whose USB adapter has *serial_number*; for use in a thread.

    Raises:
        TransportError: No port has it, or several have (an adapter with several ports, or makers who give all the
            same one).
    """
    ports = list_ports_blocking()
    found = [port.device for port in ports if port.serial_number == serial_number]
    if len(found) == 1:
        return found[0]
    if found:
        raise TransportError(
            f"{len(found)} ports have the serial number {serial_number!r}: {', '.join(found)}",
            hint="name one by its path; those in /dev/serial/by-id tell the ports of one adapter apart",
        )
    there = ", ".join(f"{port.device} ({port.serial_number or 'no serial number'})" for port in ports)
    raise TransportError(
        f"no port has the serial number {serial_number!r}",
        hint=f"ports of this computer: {there}" if there else "this computer has no serial port; is it plugged in?",
    )
