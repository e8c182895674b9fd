"""
How fast simulated drives live: on a virtual clock nothing is waited for, so time costs no more than what happens in it.

One drive moves to and fro, 500 mm at 200 mm/s. It is moved by a few bytes; by the same bytes over ``sim://`` on the
virtual clock; and by the client, which looks how the move stands several times a second and has to be answered each
time. Seconds are those of the CPU, so that what else the machine does counts little.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import cycle
from typing import Any, Final

import compax_aio
from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.hunt.hunting import try_seed
from compax_aio.simulator.hunt.quarry import COMPAX
from compax_aio.simulator.smc_hunt.quarry import SMC
from compax_aio.transports import TransportURL, open_transport

from ..measuring import Effort, Figure, Machine, Measured, Row, at_least, interleaved

__all__ = ["measure"]

ALONE: Final = "the simulated drive alone, told by bytes"
OVER_SIM: Final = "over sim://, told by a bare asyncio.Protocol"
CLIENT: Final = "over sim://, moved by compax_aio as by default"
SELDOM: Final = "over sim://, moved by compax_aio that polls every 5 s"
MANY: Final = "many drives, moved by compax_aio as by default"

_SPEED: Final = "simulated s / s"
_DRIVES: Final = "drives"
_TARGET: Final = at_least(10_000)
_TARGETS_MM: Final = (500, 0)
_MESSAGE: Final = b"$"
_SEEDS: Final = "seeds"
_THOUSANDS: Final = at_least(2000, "thousands")

_SEED: Final = 1000
"""The first one that is tried; all runs try the same."""


def _alone(moves: int) -> float:
    drive, now = SimulatedDrive(), 0.0
    for target, _ in zip(cycle(_TARGETS_MM), range(moves), strict=False):
        drive.receive(b"POSA %d$\r" % target, now)
        said = b""
        while _MESSAGE not in said:
            now = drive.next_event_at() or now
            said += drive.take_output(now)
    return now


class _Teller(asyncio.Protocol):
    """Sends a move when the last one has arrived, as often as it is told."""

    def __init__(self, moves: int) -> None:
        self._moves = moves
        self._targets = cycle(_TARGETS_MM)
        self._transport: Any = None
        self.done = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        self._tell()

    def _tell(self) -> None:
        self._moves -= 1
        self._transport.write(b"POSA %d$\r" % next(self._targets))

    def data_received(self, data: bytes) -> None:
        if _MESSAGE not in data:
            return
        if self._moves:
            self._tell()
        else:
            self.done.set_result(None)


async def _over_sim(moves: int) -> float:
    loop = asyncio.get_running_loop()
    begun_at, teller = loop.time(), _Teller(moves)
    transport = await open_transport(TransportURL.parse("sim://compax"), lambda: teller)
    try:
        await teller.done
    finally:
        transport.close()
    return loop.time() - begun_at


async def _to_and_fro(moves: int, settings: DriveSettings) -> None:
    async with compax_aio.connect("sim://compax", settings=settings) as drive:
        for target, _ in zip(cycle(_TARGETS_MM), range(moves), strict=False):
            await drive.move_to(target)


async def _client(moves: int, drives: int = 1, settings: DriveSettings | None = None) -> float:
    loop = asyncio.get_running_loop()
    begun_at = loop.time()
    await asyncio.gather(*(_to_and_fro(moves, settings or DriveSettings()) for _ in range(drives)))
    return loop.time() - begun_at


def _on_virtual_clock(run: Callable[[], Any]) -> float:
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        lasted_s: float = runner.run(run())
        return lasted_s


def _timed(run: Callable[[], float], drives: int = 1) -> Measured:
    cpu = time.process_time()
    lasted_s = run()
    speed = lasted_s / (time.process_time() - cpu)
    return {_SPEED: speed, _DRIVES: speed * drives}


def _hunted(quarry: Any, seeds: int) -> Measured:
    cpu = time.process_time()
    for seed in range(_SEED, _SEED + seeds):
        try_seed(seed, quarry)
    return {_SEEDS: 60 * seeds / (time.process_time() - cpu)}


def measure(effort: Effort) -> Sequence[Figure]:
    """Measure one drive, many drives, and the hunt."""
    moves = effort.pick(2, 40, 200)
    many = effort.pick(3, 50, 200)
    slow = DriveSettings(poll_first_s=1.0, poll_slowest_s=5.0)
    results = interleaved(
        effort,
        {
            ALONE: partial(_timed, partial(_alone, moves * 5)),
            OVER_SIM: partial(_timed, partial(_on_virtual_clock, partial(_over_sim, moves * 5))),
            CLIENT: partial(_timed, partial(_on_virtual_clock, partial(_client, moves))),
            SELDOM: partial(_timed, partial(_on_virtual_clock, partial(_client, moves, settings=slow))),
            MANY: partial(_timed, partial(_on_virtual_clock, partial(_client, effort.pick(1, 2, 5), many)), many),
        },
    )
    seeds = effort.pick(1, 10, 50)
    hunts = {quarry.device: partial(_hunted, quarry, seeds) for quarry in (COMPAX, SMC)}
    hunted = interleaved(effort, hunts)
    cores = Machine.here().cores
    return [
        Figure(
            name="simulated time against CPU time, one drive moving",
            value=results.median(OVER_SIM, _SPEED),
            unit=": 1",
            target=_TARGET,
            spread=results.spread(OVER_SIM, _SPEED),
            rows=[
                Row(name=each, value=results.median(each, _SPEED), unit=": 1", spread=results.spread(each, _SPEED))
                for each in (ALONE, OVER_SIM, CLIENT, SELDOM)
            ],
            notes=["what compax_aio adds is its looking: each look at a move is two or three exchanges, at both ends"],
        ),
        Figure(
            name=f"simulated drives that one core moves in real time, measured with {many}",
            value=results.median(MANY, _DRIVES),
            unit="drives",
            spread=results.spread(MANY, _DRIVES),
        ),
        *(
            Figure(
                name=f"seeds of the hunt a minute, {device}, on {cores} cores",
                value=cores * hunted.median(device, _SEEDS),
                unit=_SEEDS,
                target=_THOUSANDS,
                spread=hunted.spread(device, _SEEDS),
                rows=[Row(name="on each core, measured on one", value=hunted.median(device, _SEEDS), unit=_SEEDS)],
            )
            for device in hunts
        ),
    ]
