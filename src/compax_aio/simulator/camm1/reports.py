"""What a simulated cutter answers: to device control instructions at once, to output instructions in their turn."""

from __future__ import annotations

from typing import Final

from compax_aio.camm1.facts.line import MAX_COORDINATE
from compax_aio.camm1.facts.reports import HpGlStatus, HpStatus, StatusStyle, StatusWord

from .interpreter import Interpreter
from .knobs import Knobs
from .machine import Machine

__all__ = ["output", "status"]

_OPTIONS: Final = "0,0,0,0,1,0,0,0"
_OPTIONS_OF_HP: Final = "0,1,0,0,1,0,0,0"


def status(machine: Machine, knobs: Knobs, *, is_empty: bool) -> int:
    """Return the answer to ``.O``, in the style of the model."""
    if knobs.status is StatusStyle.HP:
        held = HpStatus.VIEW if machine.is_viewed or machine.is_paused else HpStatus(0)
        if machine.is_lever_up:
            held = HpStatus.SUSPENDED
        return int(held | (HpStatus.BUFFER_EMPTY if is_empty else 0))
    word = StatusWord.BUFFER_EMPTY if is_empty else StatusWord(0)
    if machine.is_paused:
        word |= StatusWord.PAUSED
    if knobs.status is StatusStyle.WORD:
        word |= StatusWord.ALWAYS
        if machine.has_drawn:
            word |= StatusWord.DRAWN
        if knobs.word_bit5:
            word |= StatusWord.BIT_5
    return int(word)


def output(name: str, machine: Machine, knobs: Knobs, now: float) -> str:
    """Return the answer to an output instruction; what it clears is cleared."""
    tool = machine.interpreter
    edge = (knobs.area_x or MAX_COORDINATE, knobs.area_y or MAX_COORDINATE)
    match name:
        case "OA" | "OD":
            x, y, is_down = machine.position_at(now)
            return f"{round(x)},{round(y)},{int(is_down)}"
        case "OC":
            form = ".4f" if tool.is_scaled else ".0f"
            return f"{tool.user_x:{form}},{tool.user_y:{form}},{int(tool.is_down)}"
        case "OE":
            error, machine.data_error = machine.data_error, 0
            return str(error)
        case "OS":
            answer = str(int(_status_byte(machine, tool)))
            tool.initialised = False
            return answer
        case "OP":
            tool.p_changed = False
            return ",".join(f"{each:.0f}" for each in (*tool.p1, *tool.p2))
        case "OW":
            return ",".join(f"{each:.0f}" for each in tool.window or (0.0, 0.0, *edge))
        case "OH":
            return f"0,0,{edge[0]},{edge[1]}"
        case "OF":
            return "40,40"
        case "OI":
            return knobs.identity
        case _:
            return _OPTIONS_OF_HP if knobs.model.startswith("HP") else _OPTIONS


def _status_byte(machine: Machine, tool: Interpreter) -> HpGlStatus:
    byte = HpGlStatus.READY
    if tool.is_down:
        byte |= HpGlStatus.TOOL_DOWN
    if tool.p_changed:
        byte |= HpGlStatus.SCALING_POINTS_CHANGED
    if tool.initialised:
        byte |= HpGlStatus.INITIALISED
    if machine.data_error:
        byte |= HpGlStatus.ERROR
    return byte
