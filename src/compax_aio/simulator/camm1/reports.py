"""What a simulated cutter answers: to device control instructions at once, to output instructions in their turn."""

from __future__ import annotations

from typing import Final

from compax_aio.camm1.facts.line import MAX_COORDINATE
from compax_aio.camm1.facts.reports import HpGlStatus, HpStatus, StatusStyle, StatusWord

from .knobs import Knobs
from .machine import Machine
from .tool import Tool

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
        if machine.blade.has_drawn:
            word |= StatusWord.DRAWN
        if knobs.word_bit5:
            word |= StatusWord.BIT_5
    return int(word)


def output(name: str, machine: Machine, knobs: Knobs, now: float) -> str:
    """Return the answer to an output instruction; what it clears is cleared."""
    tool = machine.tool
    edge = (knobs.area_x or MAX_COORDINATE, knobs.area_y or MAX_COORDINATE)
    if name == "OE":
        error, machine.data_error = machine.data_error, 0
        return str(error)
    if name == "OS":
        byte = int(_status_byte(machine, tool))
        tool.initialised = False
        return str(byte)
    if name == "OP":
        tool.p_changed = False
        return _numbers(*tool.p1, *tool.p2)
    if name == "OC":
        x, y = tool.user_position
        return _numbers(x, y, form=".0f" if tool.scale is None else ".4f") + f",{tool.is_down:d}"
    if name in {"OA", "OD"}:
        x, y, is_down = machine.position_at(now)
        return _numbers(x, y, is_down)
    options = _OPTIONS_OF_HP if knobs.model.startswith("HP") else _OPTIONS
    window = tool.window or (0, 0, *edge)
    return {"OF": "40,40", "OI": knobs.identity, "OH": _numbers(0, 0, *edge), "OW": _numbers(*window)}.get(
        name, options
    )


def _numbers(*values: float, form: str = ".0f") -> str:
    return ",".join(f"{each:{form}}" for each in values)


def _status_byte(machine: Machine, tool: Tool) -> HpGlStatus:
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
