"""A test of the link that waits for what never comes is cancelled, after hours of virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

_PATIENCE_S = 10_000.0


@pytest.fixture(autouse=True)
async def watchdog() -> AsyncIterator[None]:
    """Without it, a loop on which nothing is left to happen would wait in real time."""

    def bite() -> None:
        for task in asyncio.all_tasks():
            task.cancel("nothing came in hours")

    timer = asyncio.get_running_loop().call_later(_PATIENCE_S, bite)
    yield
    timer.cancel()
