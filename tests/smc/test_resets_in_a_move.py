"""A reset that falls into a move: what an axis counts afterwards is not taken for where it stands."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress

import pytest

from compax_aio import smc
from compax_aio.errors import CompaxError, MoveError
from compax_aio.simulator.server import serve_loopback
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine


class Bench:
    """A line with axis A, connected."""

    def __init__(self, far: SimulatedPartyLine, line: smc.PartyLine) -> None:
        self.far = far
        self.line = line
        self.axis = line.axis("A")

    def executed(self) -> list[str]:
        return [each for each in self.far.log.texts(LogKind.COMMAND) if each[0] in "R+-MFG"]


@pytest.fixture
async def bench(request: pytest.FixtureRequest) -> AsyncIterator[Bench]:
    far = SimulatedPartyLine(Knobs(position=getattr(request, "param", 0.0)))
    settings = smc.SmcSettings(echo_timeout_s=0.1)
    async with serve_loopback(far, "bench") as url, smc.connect(url, axes="A", settings=settings) as line:
        yield Bench(far, line)


async def test_a_move_that_left_zero_and_counts_zero_shows_a_reset(bench: Bench) -> None:
    move = bench.axis.move_to(3000)
    await move.accepted
    await asyncio.sleep(0.5)
    bench.far.axes["A"].reset()
    with pytest.raises(CompaxError):
        await move
    assert bench.axis.lost_reference is not None
    with pytest.raises(MoveError, match="means nothing"):
        await bench.axis.move_to(100)


@pytest.mark.parametrize("bench", [500.0], indirect=True)
async def test_a_name_that_stays_unechoed_because_of_a_reset_is_followed_by_a_new_look(bench: Bench) -> None:
    move = bench.axis.move_to(2000)
    while not move.is_on_wire:  # noqa: ASYNC110  # nobody tells
        await asyncio.sleep(0.0001)
    bench.far.axes["A"].reset()
    with pytest.raises(MoveError, match="means nothing"):
        await move
    assert bench.executed() == []


@pytest.mark.parametrize("bench", [500.0], indirect=True)
async def test_a_name_whose_echo_is_lost_is_said_once_more_and_the_motion_once(bench: Bench) -> None:
    move = bench.axis.move_to(2000)
    while not move.is_on_wire:  # noqa: ASYNC110  # nobody tells
        await asyncio.sleep(0.0001)
    bench.far.lose_next_echo("A")
    result = await move
    assert result.target == bench.far.axes["A"].position == 2000
    assert bench.executed() == ["R2000"]
    with suppress(CompaxError):
        await bench.axis.stop()
