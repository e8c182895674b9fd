"""Sixty-four drives at once over TCP, every move confirmed by its drive."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any

import pytest
from tests.promises.bench import motions

import compax_aio
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_tcp

DRIVES = 64


@pytest.mark.usefixtures("nothing_left_behind")
async def test_sixty_four_drives_move_at_once_over_tcp_and_every_move_is_confirmed() -> None:
    far_ends = [SimulatedDrive(name=f"axis {number}") for number in range(DRIVES)]
    async with AsyncExitStack() as stack:
        urls = [await stack.enter_async_context(serve_tcp(far)) for far in far_ends]
        group = await stack.enter_async_context(
            compax_aio.DriveGroup.connect({f"a{number}": url for number, url in enumerate(urls)})
        )
        for targets in ([100.0 + number for number in range(DRIVES)], [-50.0] * DRIVES):
            by_axis: dict[str, Any] = {f"a{number}": target for number, target in enumerate(targets)}
            results = await group.move_to(**by_axis)
            assert [results[f"a{number}"].target for number in range(DRIVES)] == targets
            assert {result.confirmed_by for result in results.values()} == {"status"}
            assert [far.position for far in far_ends] == targets
            assert list((await group.positions()).values()) == targets
        assert all(len(motions(far)) == 2 for far in far_ends)
        assert all(drive.stats.timeouts == drive.stats.strays == 0 for drive in group.drives.values())
        # And all are stopped at once.
        far_away: dict[str, Any] = dict.fromkeys(by_axis, 1e5)
        move = group.move_to(**far_away)
        await move.accepted
        await group.stop()
        assert not any(far.moving for far in far_ends)
        await asyncio.wait([move])
        assert isinstance(move.exception(), compax_aio.MoveStoppedError)
