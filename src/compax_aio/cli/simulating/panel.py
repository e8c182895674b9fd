"""The panel of a simulated cutter, at which a person presses keys by words; and how the cutter stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from compax_aio.errors import InvalidCommandError
from compax_aio.simulator.camm1 import SimulatedCutter
from compax_aio.simulator.line import SimulatedDevice

__all__ = ["HELP", "PANEL_WORDS", "at_panel", "how_it_stands"]


def _cancel(cutter: SimulatedCutter) -> None:
    """End the job as a person does: PAUSE, then SETUP (PNC-900 p. 16)."""
    if not cutter.is_paused:
        cutter.press_pause()
    cutter.press_setup()


_KEYS: Final[Mapping[tuple[str, ...], Callable[[SimulatedCutter], None]]] = {
    ("pause",): SimulatedCutter.press_pause,
    ("setup",): SimulatedCutter.press_setup,
    ("cancel",): _cancel,
    ("view",): SimulatedCutter.press_view,
    ("lever", "up"): SimulatedCutter.raise_lever,
    ("lever", "down"): SimulatedCutter.lower_lever,
    ("sheet",): SimulatedCutter.new_sheet,
}
PANEL_WORDS: Final = tuple(dict.fromkeys(words[0] for words in _KEYS))

HELP: Final = """\
pause, setup, view         keys of a cutter: once more is the other way round; `lever up`, `lever down`
cancel                     PAUSE, then SETUP: what it has received is deleted, and the job is over
sheet                      a new sheet: what was cut is taken away"""


def at_panel(devices: Sequence[SimulatedDevice], words: Sequence[str]) -> bool:
    """
    Press the key that *words* name; returns whether they name one.

    Raises:
        InvalidCommandError: They do, and a device has no such panel.
    """
    if not words or words[0] not in PANEL_WORDS:
        return False
    key = _KEYS.get(tuple(words))
    if key is None:
        raise InvalidCommandError(f"{' '.join(words)!r} is no key", hint="`help` lists them")
    for each in devices:
        if not isinstance(each, SimulatedCutter):
            raise InvalidCommandError(f"{each.name} has no such panel", hint="only cutters have")
    for each in devices:
        if isinstance(each, SimulatedCutter):
            key(each)
    return True


def how_it_stands(cutter: SimulatedCutter) -> str:
    """Say where the tool is, what is stored, and what holds it."""
    x, y, is_down = cutter.position()
    told = [
        f"at {x:.0f},{y:.0f} steps, tool {'down' if is_down else 'up'}",
        f"{cutter.stored_bytes} bytes stored, {cutter.free_bytes} free",
        f"{cutter.cuttings.vectors.total} vectors made",
    ]
    told += ["paused"] if cutter.is_paused else []
    told += [] if cutter.is_ready else ["not set up"]
    told += [f"error {cutter.io_error}"] if cutter.io_error else []
    told += [f"{cutter.lost_bytes} bytes lost"] if cutter.lost_bytes else []
    told += [f"data error {cutter.data_error}"] if cutter.data_error else []
    return f"{cutter.name}: {', '.join(told)}"
