"""``compax ports``: the serial ports of this computer."""

from __future__ import annotations

from rich.table import Table

from ..transports.serial import list_ports
from .printing import Printing

__all__ = ["ports"]


async def ports(*, printing: Printing = Printing()) -> None:  # noqa: B008 - it is frozen
    """List the serial ports of this computer, each with the URL that opens it."""
    found = await list_ports()
    table = Table(box=None)
    for heading in ("URL", "description", "serial number"):
        table.add_column(heading)
    for port in found:
        table.add_row(port.url, port.description, getattr(port, "serial_number", None) or "")
    printing.show(found, table)
