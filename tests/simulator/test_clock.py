"""A virtual clock jumps to the next timer, and never past something that is still under way."""

from __future__ import annotations

import asyncio
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import pytest


async def test_an_hour_passes_at_once() -> None:
    before = time.monotonic()
    await asyncio.sleep(3600)
    assert asyncio.get_running_loop().time() == 3600
    assert time.monotonic() - before < 60


async def test_timers_run_in_the_order_of_their_times() -> None:
    order: list[int] = []
    loop = asyncio.get_running_loop()
    for delay_s in (3, 1, 2):
        loop.call_later(delay_s, order.append, delay_s)
    await asyncio.sleep(4)
    assert order == [1, 2, 3]


async def test_the_clock_stands_still_while_a_thread_works() -> None:
    async with asyncio.timeout(0.001):
        await asyncio.to_thread(time.sleep, 0.02)
    assert asyncio.get_running_loop().time() == 0


async def test_the_clock_stands_still_while_a_thread_works_whose_caller_was_cancelled() -> None:
    working = asyncio.ensure_future(asyncio.to_thread(time.sleep, 0.02))
    await asyncio.sleep(0)
    working.cancel()
    before = time.monotonic()
    await asyncio.sleep(3600)
    assert time.monotonic() - before > 0.01


async def test_a_thread_that_never_began_does_not_hold_the_clock() -> None:
    with ThreadPoolExecutor(max_workers=1) as executor:
        loop = asyncio.get_running_loop()
        first = loop.run_in_executor(executor, time.sleep, 0.02)
        second = loop.run_in_executor(executor, time.sleep, 0)
        second.cancel()
        await first
        await asyncio.sleep(3600)
    assert loop.time() == 3600


async def test_bytes_on_a_real_socket_come_before_the_next_timer() -> None:
    left, right = socket.socketpair()
    reader, writer = await asyncio.open_connection(sock=left)
    _, far_writer = await asyncio.open_connection(sock=right)
    far_writer.write(b"x")
    async with asyncio.timeout(1):
        assert await reader.readexactly(1) == b"x"
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(1):
            await reader.readexactly(1)
    for each in (writer, far_writer):
        each.close()
        await each.wait_closed()
