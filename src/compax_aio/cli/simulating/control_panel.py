"""The keys of a simulated Haas control, pressed by words; and what only its screen shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from compax_aio.errors import InvalidCommandError
from compax_aio.simulator.haas import SimulatedControl
from compax_aio.simulator.haas.presses import PROGRAMS
from compax_aio.simulator.line import SimulatedDevice
from compax_aio.simulator.planned_faults import duration_s

__all__ = ["HELP", "KEY_WORDS", "at_control", "how_it_stands"]

HELP: Final = """\
send O00010, send ALL      keys of a Haas control; also `send settings`, parameters, offsets, macros
recv, recv settings        what comes is stored: programs, or numbered data
dnc, reset                 blocks that come are executed; what it is at ends, and alarms go
cycle start, cycle stop    `cycle start 10s` ends by itself; `feed hold`
dprnt PART*1               a program prints that line; * is a space
freeze                     nothing is answered until `reset`
memory, alarms             what only its screen shows"""


def _send(control: SimulatedControl, words: Sequence[str]) -> None:
    try:
        control.press_send(" ".join(words) or "ALL")
    except ValueError as error:
        raise InvalidCommandError(str(error), hint="`memory` lists what there is") from error


def _receive(control: SimulatedControl, words: Sequence[str]) -> None:
    if len(words) > 1:
        raise _no_key(["recv", *words])
    try:
        control.press_recv(words[0] if words else PROGRAMS)
    except ValueError:
        raise _no_key(["recv", *words]) from None


def _cycle(control: SimulatedControl, words: Sequence[str]) -> None:
    match words:
        case ["start"]:
            control.cycle_start()
        case ["start", lasts]:
            control.cycle_start(lasts_s=duration_s(lasts))
        case ["stop"]:
            control.cycle_stop()
        case _:
            raise _no_key(["cycle", *words])


def _feed(control: SimulatedControl, words: Sequence[str]) -> None:
    if list(words) != ["hold"]:
        raise _no_key(["feed", *words])
    control.feed_hold()


def _print(control: SimulatedControl, words: Sequence[str]) -> None:
    control.dprnt(" ".join(words))


def _single(press: Callable[[SimulatedControl], None]) -> Callable[[SimulatedControl, Sequence[str]], None]:
    """Return what carries out a word that takes no other behind it."""

    def carry_out(control: SimulatedControl, words: Sequence[str]) -> None:
        if words:
            raise InvalidCommandError(f"{' '.join(words)!r} means nothing behind it", hint="`help` lists the words")
        press(control)

    return carry_out


_KEYS: Final[Mapping[str, Callable[[SimulatedControl, Sequence[str]], None]]] = {
    "send": _send,
    "recv": _receive,
    "dnc": _single(SimulatedControl.press_dnc),
    "reset": _single(SimulatedControl.press_reset),
    "cycle": _cycle,
    "feed": _feed,
    "dprnt": _print,
    "freeze": _single(SimulatedControl.freeze),
}


def _memory(control: SimulatedControl) -> str:
    memory = control.memory
    programs = (f"{name}, {len(text)} bytes" for name, text in sorted(memory.programs.items()))
    tables = (("parameters", memory.parameters), ("settings", memory.settings), ("offsets", memory.offsets))
    return "\n".join([f"{control.name}:", *programs, *(f"{len(table)} {name}" for name, table in tables)])


def _alarms(control: SimulatedControl) -> str:
    shown = [
        f"  {'' if each.number is None else f'{each.number} '}{each.text}{f': {each.detail}' if each.detail else ''}"
        for each in control.alarms
    ]
    return "\n".join([f"{control.name}: {len(shown) or 'no'} alarm{'s' * (len(shown) != 1)}", *shown])


_SCREENS: Final[Mapping[str, Callable[[SimulatedControl], str]]] = {"memory": _memory, "alarms": _alarms}
KEY_WORDS: Final = (*_KEYS, *_SCREENS)


def _no_key(words: Sequence[str]) -> InvalidCommandError:
    return InvalidCommandError(f"{' '.join(words)!r} is no key", hint="`help` lists them")


def at_control(devices: Sequence[SimulatedDevice], words: Sequence[str]) -> str | None:
    """
    Press the key, or show the screen, that *words* name.

    Returns:
        What there is to say about it; None: they name nothing here.

    Raises:
        InvalidCommandError: They do, and cannot be meant; or a device is no Haas control.
    """
    if not words or words[0] not in KEY_WORDS:
        return None
    for each in devices:
        if not isinstance(each, SimulatedControl):
            raise InvalidCommandError(f"{each.name} has no such key", hint="only Haas controls have")
    controls = [each for each in devices if isinstance(each, SimulatedControl)]
    if (screen := _SCREENS.get(words[0])) is not None:
        return "\n".join(map(screen, controls))
    for each in controls:
        _KEYS[words[0]](each, words[1:])
    return ""


def how_it_stands(control: SimulatedControl) -> str:
    """Say what it is at, and what its screen shows."""
    running = control.running
    cycle = "a cycle runs" if running.is_cycling else "a cycle is held" if running.is_held else "no cycle runs"
    told = [
        "at rest" if control.doing == "nothing" else control.doing,
        f"screen {control.screen or 'empty'}",
        cycle,
        f"{running.parts} parts",
        f"{len(control.memory.programs)} programs",
        f"{len(control.alarms) or 'no'} alarms",
    ]
    told += [f"{control.lost_bytes} bytes lost"] if control.lost_bytes else []
    return f"{control.name}: {', '.join(told)}"
