"""What a person, or a script, does to devices that are served: words that make trouble, end it, and ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from compax_aio.errors import CompaxError, InvalidCommandError
from compax_aio.simulator.camm1 import SimulatedCutter
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.haas import SimulatedControl
from compax_aio.simulator.planned_faults import FAULT_KINDS, FaultKind, duration_s, kind_named

from . import control_panel, panel

__all__ = ["HELP", "Hands", "known_words"]

_ENDS: Final = ("off", "over")
_END_OF_SERVICE: Final = frozenset({"quit", "exit"})
_SHORT_FORMS: Final[Mapping[str, str]] = {
    "estop": "E55",
    "speak": "silent off",
    "plug": "unplug off",
    "release": "held off",
}

HELP: Final = f"""\
silent, held, unplug       until you say otherwise; with a time, as in `silent 5s`, for so long
speak, release, plug       their ends; `silent off` and so on are the same
power                      off and on again after a second; `power off`, `power on`, `power 5s`
late 300ms, split 5ms      answers come so much later, or byte by byte; `late off`
garbled 0.01               one byte of a hundred is wrong; `lost 0.01`, `doubled 0.01`, `garbled off`
cut                        the line is cut, and is there again at once
fault 55, E55, estop       the drive has a fault; 55 is the emergency stop
heal                       ends all of that; a fault of the drive is for QUIT to acknowledge
{panel.HELP}
{control_panel.HELP}
where                      how every device stands
urls                       where programs find them
quit                       ends service, as Ctrl-C does
A name in front, as in `x2 silent`, means that device alone."""


def known_words() -> tuple[str, ...]:
    """Return the words that begin a command."""
    kinds = (kind.name for kind in FAULT_KINDS)
    return (
        *kinds,
        *_SHORT_FORMS,
        *panel.PANEL_WORDS,
        *control_panel.KEY_WORDS,
        "fault",
        "heal",
        "where",
        "urls",
        "help",
        "quit",
    )


class Hands:
    """
    Carries out words.

    Args:
        far_ends: The devices, by name.

    Attributes:
        wants_end: Whether service shall end.
    """

    def __init__(self, far_ends: Mapping[str, FarEnd]) -> None:
        self._far_ends = far_ends
        self.wants_end = False

    def do(self, text: str) -> str:
        """Carry out one line; returns what there is to say about it, an error as well, or nothing."""
        try:
            return self._do(text.split())
        except CompaxError as error:
            return str(error)

    def _do(self, words: Sequence[str]) -> str:
        far_ends = list(self._far_ends.values())
        if words and words[0] in self._far_ends:
            far_ends = [self._far_ends[words[0]]]
            words = words[1:]
        if not words:
            return ""
        words = [*_SHORT_FORMS.get(words[0], words[0]).split(), *words[1:]]
        if words[0] in _END_OF_SERVICE:
            self.wants_end = True
            return ""
        match words:
            case ["help" | "?"]:
                return HELP
            case ["where"]:
                return "\n".join(map(_where, far_ends))
            case ["urls"]:
                return "\n".join(_url(each) for each in far_ends)
            case _:
                return _befall(far_ends, words)


def _befall(far_ends: Sequence[FarEnd], words: Sequence[str]) -> str:
    """Press a key of the panel, let a fault happen, or end it; returns what there is to say about it."""
    match words:
        case ["heal"]:
            for each in far_ends:
                _heal(each)
            return ""
        case ["fault", code]:
            _begin(far_ends, kind_named(f"E{code.upper().removeprefix('E')}"), [])
            return ""
    devices = [each.device for each in far_ends]
    said = control_panel.at_control(devices, words)
    if said is None and not panel.at_panel(devices, words):
        _begin(far_ends, _kind(words[0]), words[1:])
    return said or ""


def _kind(word: str) -> FaultKind:
    try:
        return kind_named(word)
    except InvalidCommandError:
        raise InvalidCommandError(f"{word!r} is no word that is known here", hint="`help` lists them") from None


def _begin(far_ends: Sequence[FarEnd], kind: FaultKind, words: Sequence[str]) -> None:
    """Let *kind* happen as *words* say, or be over; all words are read before anything is done."""
    if len(words) > 1:
        raise InvalidCommandError(f"{kind.name} takes one word more, not {len(words)}", hint="`help` lists them")
    word = words[0] if words else None
    for each in far_ends:
        each.expect_possible(kind)
    is_end = word == "on" if kind.name == "power" else word in _ENDS
    if kind.nature == "noise":
        chance = 0.0 if is_end else _chance(kind, word)
        for each in far_ends:
            each.set_noise(kind, chance)
    elif is_end:
        for each in far_ends:
            each.end(kind)
    else:
        lasts_s, amount_s = _times(kind, word)
        for each in far_ends:
            each.begin(kind, lasts_s, amount_s)


def _times(kind: FaultKind, word: str | None) -> tuple[float | None, float | None]:
    """Return how long it lasts, and by how much answers are changed."""
    if kind.nature == "moment" and word is not None:
        raise InvalidCommandError(f"{kind.name} happens once, and takes no word", hint="`help` lists them")
    if kind.nature == "answering":
        return None, None if word is None else duration_s(word)
    if kind.name == "power":
        return (None if word == "off" else kind.amount_s if word is None else duration_s(word)), None
    return (None if word is None else duration_s(word)), None


def _chance(kind: FaultKind, word: str | None) -> float:
    try:
        chance = float(word or "")
    except ValueError:
        chance = -1.0
    if not 0 <= chance <= 1:
        raise InvalidCommandError(f"{kind.name} takes a chance from 0 to 1 for each byte", hint=f"{kind.name} 0.01")
    return chance


def _heal(far_end: FarEnd) -> None:
    for kind in FAULT_KINDS:
        if kind.nature != "noise":
            far_end.end(kind)
    far_end.heal()


def _where(far_end: FarEnd) -> str:
    device = far_end.device
    if isinstance(device, SimulatedCutter):
        return panel.how_it_stands(device)
    if isinstance(device, SimulatedControl):
        return control_panel.how_it_stands(device)
    if isinstance(device, SimulatedDrive):
        moving = "moving" if device.moving else "standing"
        homed = "homed" if device.homed else "not homed"
        fault = "no fault" if device.fault is None else f"fault {device.fault}"
        return f"{device.name}: {device.position:.3f} {device.knobs.unit}, {moving}, {homed}, {fault}"
    axes = getattr(device, "axes", {})
    each = (f"{letter} {axis.position:g} {'moving' if axis.moving else 'standing'}" for letter, axis in axes.items())
    return f"{device.name}: {', '.join(each)}"


def _url(far_end: FarEnd) -> str:
    gone = "" if far_end.outlet.is_plugged else "  (unplugged)"
    return f"{far_end.device.name}  {far_end.outlet.url}{gone}"
