"""``compax camm1 stop``: what a cutter has in its buffer dropped, and the tool lifted."""

from __future__ import annotations

from ..printing import Printing
from .line import CutterLine, CutterUrl, Machine

__all__ = ["stop"]


async def stop(
    url: CutterUrl,
    *,
    machine: Machine = Machine(),  # noqa: B008 - it is frozen
    line: CutterLine = CutterLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Drop what a cutter has in its buffer (`.K`), and lift the tool.

    The vector under way is cut to its end (PNC-900 p. 21). For a cutter that goes on with what somebody else has sent,
    or that holds what a wrong baud rate has made of it. A line that another program holds cannot be opened: interrupt
    that one. It is no emergency stop.

    ```sh
    compax camm1 stop serial:///dev/ttyUSB0
    ```
    """
    async with line.open(url, machine.known()) as cutter:
        status = await cutter.stop()
    when = "when the machine, which is paused, goes on" if status.is_paused else "once the vector under way is cut"
    printing.show(
        {"cutter": cutter.name, "stopped": True, "status": status},
        f"{cutter.name}: its buffer is empty; the tool goes up {when}",
    )
