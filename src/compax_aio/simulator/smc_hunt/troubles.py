"""What can befall a party line, its axes and the event loop: how each kind is drawn, and how it is done."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Final

from compax_aio.simulator.smc.line import SimulatedPartyLine

from ..hunt.line_troubles import Arguments, cut, half_open, hold, nothing, one_of, other_host, slow_line, stall, tamper
from ..hunt.scenario import Trouble
from ..hunt.troubled_line import TroubledLine

__all__ = ["LASTS_S", "LONGEST_DELAY_S", "TROUBLES", "FarLine", "TroubleKind", "befall"]

LASTS_S: Final = (0.0, 0.003, 0.02, 0.06, 0.2, 0.4, 0.7, 1.5, 5.0)
_NOISE: Final = (b"\x00", b"\n", b"\n\n", b"A", b"1", b"0\n", b"\xff\xfe", b"Z 5\n", b"#\r\n", b"   1342 ADVANCED")
_DELAYS_S: Final = (0.001, 0.01, 0.06, 0.11, 0.26, 0.45, 1.1)
LONGEST_DELAY_S: Final = max(_DELAYS_S)


@dataclass(frozen=True, slots=True)
class FarLine:
    """What a trouble is done to."""

    party: SimulatedPartyLine
    line: TroubledLine
    axis: str


@dataclass(frozen=True, slots=True)
class TroubleKind:
    """One kind of trouble."""

    weight: float
    draw: Callable[[Random], Arguments]
    do: Callable[[FarLine, Trouble], Awaitable[None]]
    of_axis: bool = False
    reconnecting: float = 0.0
    """What is added to the weight where the client opens a lost line again."""


async def befall(trouble: Trouble, far: FarLine) -> None:
    """Do it, and take it back when it is over."""
    far.line.note(f"{trouble.kind} begins")
    await TROUBLES[trouble.kind].do(far, trouble)
    far.line.note(f"{trouble.kind} is over")


# The line ---------------------------------------------------------------------------------------------------------


def _draw_tamper(random: Random) -> Arguments:
    return {
        "direction": random.choice(("to_drive", "to_host")),
        "kind": random.choice(("lose", "lose", "garble", "flip", "flip", "double", "cut")),
        "skip": random.choice((0, 0, 1, 2, 3, 4, 5, 8, 12, 20)),
        "count": random.choice((1, 1, 1, 2, 5)),
    }


async def _blackout(far: FarLine, trouble: Trouble) -> None:
    """Let the power of line and axes fail, the line's a little before or after."""
    far.line.refused = True
    far.line.cut()
    await asyncio.sleep(trouble.arguments["later_s"])
    far.party.power_off()
    await asyncio.sleep(trouble.arguments["off_s"])
    far.party.power_on()
    far.line.refused = False


async def _noise(far: FarLine, trouble: Trouble) -> None:
    far.line.note("noise to_host")
    far.party.inject(trouble.arguments["data"])


async def _flood(far: FarLine, trouble: Trouble) -> None:
    far.line.note("noise to_host")
    for _ in range(trouble.arguments["pieces"]):
        far.party.inject(trouble.arguments["data"] * 100)
        await asyncio.sleep(0.002)


# The axes ---------------------------------------------------------------------------------------------------------


async def _lose_echo(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.party.lose_next_echo(far.axis, trouble.arguments["count"])


async def _garble_echo(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.line.note("echo to_host")
    far.party.garble_next_echo(far.axis, trouble.arguments["count"])


async def _lose_character(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.party.lose_next_character(trouble.arguments["count"])


async def _flip_character(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.line.note("flip to_drive")
    far.party.flip_next_character(trouble.arguments["bit"])


async def _late_answer(far: FarLine, trouble: Trouble) -> None:
    far.party.delay_next_answer(far.axis, trouble.arguments["delay_s"])


async def _stick(far: FarLine, trouble: Trouble) -> None:
    far.line.note("lose to_host")
    far.party.stick(trouble.lasts_s)


async def _reset(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.party.axes[far.axis].reset()


async def _jog(far: FarLine, trouble: Trouble) -> None:
    await asyncio.sleep(trouble.arguments["after_s"])
    far.party.axes[far.axis].jog(trouble.arguments["distance"])


async def _power(far: FarLine, trouble: Trouble) -> None:
    far.party.power_off()
    await asyncio.sleep(trouble.lasts_s)
    far.party.power_on()


_SOON_S: Final = (0.0, 0.0, 0.0007, 0.0013, 0.0031, 0.011, 0.04, 0.3)

TROUBLES: Final[Mapping[str, TroubleKind]] = {
    "tamper": TroubleKind(7, _draw_tamper, tamper),
    "slow line": TroubleKind(2, one_of(direction=("to_drive", "to_host"), delay_s=_DELAYS_S), slow_line),
    "hold": TroubleKind(1, nothing, hold),
    "cut": TroubleKind(1, nothing, cut, reconnecting=4),
    "half open": TroubleKind(1, one_of(is_cut=(False, True)), half_open, reconnecting=1),
    "blackout": TroubleKind(
        0, one_of(later_s=(0.0, 0.05, 0.3), off_s=(0.0, 0.05, 0.3, 4.0)), _blackout, reconnecting=1.5
    ),
    "noise": TroubleKind(2, one_of(data=_NOISE), _noise),
    "flood": TroubleKind(0.2, one_of(pieces=(3, 20, 200), data=(b"\x55", b"1", b"\r\n", b"A")), _flood),
    "other host": TroubleKind(0.7, one_of(data=(b"\n", b"\nA", b"R5", b"\nQ", b"1")), other_host),
    "lose echo": TroubleKind(4, one_of(count=(1, 1, 1, 2, 5), after_s=_SOON_S), _lose_echo, of_axis=True),
    "garble echo": TroubleKind(2, one_of(count=(1, 1, 2), after_s=_SOON_S), _garble_echo, of_axis=True),
    "lose character": TroubleKind(3, one_of(count=(1, 1, 1, 2, 4), after_s=_SOON_S), _lose_character),
    "flip character": TroubleKind(3, one_of(bit=tuple(range(8)), after_s=_SOON_S), _flip_character),
    "late answer": TroubleKind(2, one_of(delay_s=_DELAYS_S), _late_answer, of_axis=True),
    "stick": TroubleKind(2, nothing, _stick),
    "reset": TroubleKind(4, one_of(after_s=_SOON_S), _reset, of_axis=True),
    "jog": TroubleKind(1.5, one_of(after_s=_SOON_S, distance=(30.0, -700.0)), _jog, of_axis=True),
    "power": TroubleKind(1, nothing, _power),
    "stall": TroubleKind(1, one_of(stall_s=(0.01, 0.15, 0.5, 2.5)), stall),
}
"""By name."""
