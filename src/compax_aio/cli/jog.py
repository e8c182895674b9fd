"""``compax jog``: small steps by the arrow keys."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter
from rich.live import Live
from rich.text import Text

from compax_aio import Drive
from compax_aio.compax.vocabulary import plan_move_by

from .exit_codes import INTERRUPTED, OK
from .interruption import in_motion, say_at_end
from .jogging import KEYS, Jogging
from .keyboard import expect_keyboard, keys_pressed
from .moving import following, note_where_from, written
from .number_words import NUMBER
from .opening import DriveLine, Url
from .outlets import is_held_up
from .printing import Printing, notes_console

__all__ = ["jog"]


async def jog(
    url: Url,
    *,
    step: Annotated[float, NUMBER, Parameter(help="How far one step is at first, in the unit of the axis.")] = 1.0,
    speed: Annotated[float, NUMBER, Parameter(help="In percent of nominal speed.")] = 10.0,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
) -> int:
    """
    Move in small steps by the arrow keys, and see the position.

    One key, one step: while one is on its way, the same key is ignored, and the opposite one stops the axis. The keys
    are arrows left and right for a step, up and down for a longer or shorter one, space to stop, h and then y for
    machine zero, q or Escape to stop and leave, as does Ctrl-C.

    The speed stays in force in the drive for moves that say none.

    ```sh
    compax jog serial:///dev/ttyUSB0 --step 0.1 --speed 5
    ```
    """
    plan_move_by(step, line.drive_settings(), speed_percent=speed)
    expect_keyboard()
    async with line.open(url) as drive:
        await note_where_from(drive, Printing())
        return await _by_keys(drive, step, speed)


async def _by_keys(drive: Drive, step: float, speed: float) -> int:
    jogging = Jogging(drive, abs(step), speed)
    with in_motion(drive.name), Live(console=notes_console(), auto_refresh=False) as live:
        view = JogView(drive, jogging, live)
        jogging.on_change = view.show
        with keys_pressed(jogging.press, jogging.left.set):
            async with following(drive, view):
                try:
                    await jogging.left.wait()
                finally:
                    was_moving = await jogging.end()
                    stands = f"{drive.name} has acknowledged STOP and stands"
                    rests = f"Nothing that was started here moves {drive.name}"
                    say_at_end(f"Interrupted. {stands if was_moving else rests}.")
    where = written(drive, await drive.position())
    said = f"{stands} at {where}" if was_moving else f"{rests}; it is at {where}"
    notes_console().print(f"{said}.", markup=False)
    return INTERRUPTED if jogging.is_interrupted else OK


class JogView:
    """
    What is seen while somebody jogs: position, step, what happened last, and the keys.

    Args:
        drive: What moves.
        jogging: What the keys do to it.
        live: Where it is shown.
    """

    def __init__(self, drive: Drive, jogging: Jogging, live: Live) -> None:
        self._drive = drive
        self._jogging = jogging
        self._live = live
        self._position: float | None = None

    def note_position(self, position: float) -> None:
        """Take note of where the axis was read to be."""
        self._position = position

    def show(self) -> None:
        """Show how it stands now."""
        if is_held_up(self._live.console.file):
            return
        where = "…" if self._position is None else written(self._drive, self._position)
        message = self._jogging.message if self._drive.is_open else "the line is lost; the axis may be moving"
        self._live.update(
            Text.assemble(
                (f"{self._drive.name}  ", ""),
                (f"{where:>16}", "bold"),
                f"   one step: {self._jogging.step:g} {self._drive.unit}\n",
                (message, "yellow"),
                "\n",
                (KEYS, "dim"),
            ),
            refresh=True,
        )
