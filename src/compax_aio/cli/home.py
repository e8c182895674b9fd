"""``compax home``: the search for machine zero."""

from __future__ import annotations

from compax_aio.compax.moves import check_manner

from .moving import TimeoutS, carry_out
from .opening import DriveLine, Url
from .printing import Printing

__all__ = ["home"]


async def home(
    url: Url,
    *,
    timeout_s: TimeoutS = None,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Find machine zero, and wait until it is found.

    How far and how fast the axis goes, and in which direction, is set in the drive. Ctrl-C stops it.

    ```sh
    compax home serial:///dev/ttyUSB0 --timeout 60
    ```
    """
    line.drive_settings()
    check_manner(timeout_s, "stop")
    async with line.open(url) as drive:
        await carry_out(drive, drive.home(timeout_s=timeout_s), printing)
