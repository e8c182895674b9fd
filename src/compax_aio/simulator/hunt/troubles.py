"""What can befall a drive and its line: how each kind is drawn, and how it is done."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from random import Random
from typing import Final

from compax_aio.compax.facts.line import PROMPT
from compax_aio.simulator.cable import Tamper
from compax_aio.simulator.compax.drive import SimulatedDrive
from compax_aio.simulator.compax.instructions import MoveTo, Stop
from compax_aio.simulator.compax.knobs import Knobs
from compax_aio.simulator.compax.refusals import RefusedError

from .line_troubles import Arguments, cut, half_open, hold, nothing, one_of, other_host, slow_line, stall, tamper
from .scenario import Trouble
from .troubled_line import TroubledLine

__all__ = ["LASTS_S", "PANEL_TARGET", "TROUBLES", "Far", "TroubleKind", "befall"]

PANEL_TARGET: Final = 777.0
"""Where a drive goes that is moved at its own panel."""

_STRANGER_SAYS_EVERY_S: Final = 0.01
LASTS_S: Final = (0.0, 0.003, 0.02, 0.05, 0.2, 0.4, 0.7, 1.5, 6.0)
_HALF_LINES: Final = (b"PA5", b"POSR 1", b"PA17.5$", b"S1", b"P40=", b"GOTO", b"SD 1", b"?", b"S0", b"PR3 SD")
_NOISE: Final = (b"\x00\xff", b"\xa5?", b"?\r\n", b"S0", b"\r\n", b">", b"\xc1\xc1\xc1", b"\x13", b"\x11", PROMPT, b"E")


@dataclass(frozen=True, slots=True)
class Far:
    """What a trouble is done to."""

    drive: SimulatedDrive
    line: TroubledLine


@dataclass(frozen=True, slots=True)
class TroubleKind:
    """One kind of trouble."""

    weight: float
    draw: Callable[[Random], Arguments]
    do: Callable[[Far, Trouble], Awaitable[None]]
    reconnecting: float = 0.0
    """What is added to the weight where the client opens a lost line again."""
    forges: bool = False
    """It may turn what one end says into something else that makes sense to the other."""


async def befall(trouble: Trouble, far: Far) -> None:
    """Do it, and take it back when it is over."""
    far.line.note(f"{trouble.kind} begins")
    await TROUBLES[trouble.kind].do(far, trouble)
    far.line.note(f"{trouble.kind} is over")


# The line ---------------------------------------------------------------------------------------------------------


def _draw_tamper(random: Random) -> Arguments:
    kind = random.choice(("lose", "lose", "garble", "flip", "double", "cut"))
    return {
        "direction": random.choice(("to_drive", "to_host")),
        "kind": kind,
        "skip": random.choice((0, 0, 1, 2, 3, 4, 5, 8, 12, 20, 40)),
        "count": random.choice((1, 1, 2, 3, 7, 20)),
    }


async def _lose_end(far: Far, _: Trouble) -> None:
    far.line.add(Tamper("to_drive", "lose_end"))


async def _pieces(far: Far, trouble: Trouble) -> None:
    far.line.piece = trouble.arguments["size"]
    await asyncio.sleep(trouble.lasts_s)
    far.line.piece = None


async def _repeat(far: Far, _: Trouble) -> None:
    far.line.repeat()


async def _flapping(far: Far, trouble: Trouble) -> None:
    for _ in range(trouble.arguments["times"]):
        far.line.cut()
        await asyncio.sleep(trouble.arguments["every_s"])


async def _blackout(far: Far, trouble: Trouble) -> None:
    """Let the power of drive and device server fail, the server's a little before or after."""
    far.line.refused = True
    far.line.cut()
    await asyncio.sleep(trouble.arguments["later_s"])
    far.drive.power_off()
    await asyncio.sleep(trouble.arguments["off_s"])
    far.drive.power_on()
    far.line.refused = False


async def _stranger(far: Far, trouble: Trouble) -> None:
    stranger = SimulatedDrive(Knobs(position=trouble.arguments["position"]), name="stranger")
    far.line.stranger(stranger)
    if trouble.arguments.get("fault"):
        stranger.raise_fault(trouble.arguments["fault"])
    far.line.cut()
    begun_at = asyncio.get_running_loop().time()
    while trouble.arguments.get("says") and asyncio.get_running_loop().time() < begun_at + trouble.lasts_s:
        await asyncio.sleep(_STRANGER_SAYS_EVERY_S)
        stranger.inject(trouble.arguments["says"])
    await asyncio.sleep(max(0.0, begun_at + trouble.lasts_s - asyncio.get_running_loop().time()))
    far.line.exchange_device(far.drive)
    far.line.cut()


# The drive --------------------------------------------------------------------------------------------------------


async def _silent(far: Far, trouble: Trouble) -> None:
    far.drive.silent = True
    await asyncio.sleep(trouble.lasts_s)
    far.drive.silent = False


async def _deaf(far: Far, trouble: Trouble) -> None:
    far.drive.deaf = True
    await asyncio.sleep(trouble.lasts_s)
    far.drive.deaf = False


async def _slow(far: Far, trouble: Trouble) -> None:
    far.drive.extra_answer_delay_s = trouble.arguments["delay_s"]
    await asyncio.sleep(trouble.lasts_s)
    far.drive.extra_answer_delay_s = 0.0


async def _lose_answers(far: Far, trouble: Trouble) -> None:
    far.drive.lose_answers += trouble.arguments["count"]


async def _lose_message(far: Far, _: Trouble) -> None:
    far.drive.lose_position_reached += 1


async def _late_message(far: Far, trouble: Trouble) -> None:
    far.drive.delay_position_reached_s = trouble.arguments["delay_s"]
    await asyncio.sleep(trouble.lasts_s)
    far.drive.delay_position_reached_s = 0.0


async def _fault(far: Far, trouble: Trouble) -> None:
    far.drive.raise_fault(trouble.arguments["code"])


async def _power(far: Far, trouble: Trouble) -> None:
    far.drive.power_off()
    await asyncio.sleep(trouble.lasts_s)
    far.drive.power_on()


async def _noise(far: Far, trouble: Trouble) -> None:
    far.drive.inject(trouble.arguments["data"])


async def _flood(far: Far, trouble: Trouble) -> None:
    for _ in range(trouble.arguments["pieces"]):
        far.drive.inject(trouble.arguments["data"] * 100)
        await asyncio.sleep(0.002)


async def _panel(far: Far, _: Trouble) -> None:
    drive = far.drive
    with suppress(RefusedError):  # its answer is not on this line
        drive._machine.execute(MoveTo(PANEL_TARGET), False, asyncio.get_running_loop().time())  # noqa: SLF001
    far.line.note("moved at its panel")
    if drive.served_by is not None:
        drive.served_by.changed()


async def _panel_stop(far: Far, _: Trouble) -> None:
    drive = far.drive
    with suppress(RefusedError):
        drive._machine.execute(Stop(), False, asyncio.get_running_loop().time())  # noqa: SLF001
    far.line.note("stopped at its panel")
    if drive.served_by is not None:
        drive.served_by.changed()


_DELAYS_S: Final = (0.001, 0.01, 0.05, 0.25, 0.31, 0.35, 0.8)

TROUBLES: Final[Mapping[str, TroubleKind]] = {
    "tamper": TroubleKind(6, _draw_tamper, tamper, forges=True),
    "lose end": TroubleKind(1.5, nothing, _lose_end),
    "slow line": TroubleKind(3, one_of(direction=("to_drive", "to_host"), delay_s=_DELAYS_S), slow_line),
    "pieces": TroubleKind(2, one_of(size=(1, 2, 3, 5)), _pieces),
    "repeat": TroubleKind(1.5, nothing, _repeat, forges=True),
    "hold": TroubleKind(1.5, nothing, hold),
    "cut": TroubleKind(2, one_of(keeps=(False, False, True)), cut, reconnecting=4),
    "flapping": TroubleKind(0, one_of(times=(2, 3, 8), every_s=(0.01, 0.06, 0.3, 0.7)), _flapping, reconnecting=1),
    "half open": TroubleKind(1, one_of(is_cut=(False, True)), half_open, reconnecting=1.5),
    "blackout": TroubleKind(
        0, one_of(later_s=(0.0, 0.05, 0.3), off_s=(0.0, 0.05, 0.3, 4.0)), _blackout, reconnecting=2
    ),
    "stranger": TroubleKind(
        0,
        one_of(position=(4321.0, 8765.0), fault=(None, None, 20), says=(b"", b"$\r\n>", b"$\r\n>", b"1\r\n>")),
        _stranger,
        reconnecting=3,
    ),
    "other host": TroubleKind(1, one_of(data=_HALF_LINES), other_host, forges=True),
    "silent": TroubleKind(2, nothing, _silent),
    "deaf": TroubleKind(2, nothing, _deaf),
    "slow": TroubleKind(3, one_of(delay_s=_DELAYS_S), _slow),
    "lose answers": TroubleKind(3, one_of(count=(1, 1, 2, 3)), _lose_answers),
    "lose message": TroubleKind(1.5, nothing, _lose_message),
    "late message": TroubleKind(1.5, one_of(delay_s=_DELAYS_S), _late_message),
    "fault": TroubleKind(1.5, one_of(code=(20, 55, 53, 70)), _fault),
    "power": TroubleKind(1, nothing, _power),
    "noise": TroubleKind(1.5, one_of(data=_NOISE), _noise, forges=True),
    "flood": TroubleKind(0.3, one_of(pieces=(3, 20, 300), data=(b"\x55", b"S001", b"\r\n")), _flood, forges=True),
    "panel": TroubleKind(0.7, nothing, _panel),
    "panel stop": TroubleKind(1, nothing, _panel_stop),
    "stall": TroubleKind(1, one_of(stall_s=(0.01, 0.2, 0.5, 3.0)), stall),
}
"""By name. What forges may excuse that a value, or a motion, is not what its sender meant."""
