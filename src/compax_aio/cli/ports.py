"""``compax ports``: the serial ports of this computer."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import quote

from rich.table import Table
from rich.text import Text

from ..transports.serial import PortInfo, list_ports
from .interruption import moves_nothing
from .printing import Printing

__all__ = ["Port", "ports"]


@dataclass(frozen=True, kw_only=True)
class Port:
    """One serial port, with the URLs that open it."""

    url: str
    url_by_serial_number: str | None
    """That goes with the adapter, wherever it is plugged in; None where it has no serial number of its own."""
    device: str
    description: str
    manufacturer: str | None
    serial_number: str | None


@moves_nothing
async def ports(*, printing: Printing = Printing()) -> None:  # noqa: B008 - it is frozen
    """
    List the serial ports of this computer, each with the URL that opens it.

    A port whose USB adapter has a serial number can be named by that, too: such a URL stays the same wherever the
    adapter is plugged in.

    ```sh
    compax ports
    compax ports --json
    ```
    """
    found = _told(await list_ports())
    table = Table(box=None, pad_edge=False)
    for heading in ("URL", "description", "maker", "URL by serial number"):
        table.add_column(heading, overflow="fold")
    for port in found:
        table.add_row(*(Text(each or "") for each in _row(port)))
    printing.show(found, table if found else None)
    if found:
        printing.note("Next: compax probe URL")
    else:
        printing.note(
            "This computer shows no serial port: is the adapter plugged in, and its driver there? A drive behind a "
            "terminal server is reached by tcp://host:port, a simulated one by sim://compax."
        )


def _told(infos: list[PortInfo]) -> list[Port]:
    numbers = [info.serial_number for info in infos]
    return [
        Port(
            url=info.url,
            url_by_serial_number=(
                f"serial://?serial_number={quote(info.serial_number)}"
                if info.serial_number and numbers.count(info.serial_number) == 1
                else None
            ),
            device=info.device,
            description=info.description,
            manufacturer=info.manufacturer,
            serial_number=info.serial_number,
        )
        for info in infos
    ]


def _row(port: Port) -> tuple[str | None, ...]:
    return port.url, port.description, port.manufacturer, port.url_by_serial_number
