"""Work that is carried through although its caller is cancelled."""

from __future__ import annotations

import asyncio

import anyio
import anyio.lowlevel
import pytest

from compax_aio.link.cancellation import despite_cancellation


async def work(done: list[str], fails: bool = False) -> None:
    await asyncio.sleep(1)
    done.append("done")
    if fails:
        raise ValueError("the work failed")


async def test_without_cancellation_it_is_awaited_and_its_error_raised() -> None:
    done: list[str] = []
    await despite_cancellation(work(done))
    assert done == ["done"]
    with pytest.raises(ValueError, match="the work failed"):
        await despite_cancellation(work(done, fails=True))


@pytest.mark.parametrize("times", [1, 3])
async def test_a_cancelled_caller_is_cancelled_after_the_work(times: int) -> None:
    done: list[str] = []
    caller = asyncio.ensure_future(despite_cancellation(work(done)))
    for _ in range(times):
        await asyncio.sleep(0.1)
        caller.cancel()
    with pytest.raises(asyncio.CancelledError):
        await caller
    assert done == ["done"]
    assert asyncio.get_running_loop().time() == pytest.approx(1.0)


async def test_a_time_out_around_it_takes_effect_after_the_work() -> None:
    done: list[str] = []
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.2):
            await despite_cancellation(work(done))
    assert done == ["done"]


async def test_a_cancel_scope_of_anyio_takes_effect_after_the_work() -> None:
    done: list[str] = []
    with anyio.move_on_after(0.2) as scope:
        await despite_cancellation(work(done))
        await anyio.lowlevel.checkpoint()
        done.append("went on")
    assert scope.cancelled_caught
    assert done == ["done"]


async def test_an_error_of_the_work_is_not_swallowed_by_a_cancellation() -> None:
    """The caller ends as cancelled or with the error, never as if all was well."""
    done: list[str] = []
    caller = asyncio.ensure_future(despite_cancellation(work(done, fails=True)))
    await asyncio.sleep(0.1)
    caller.cancel()
    with pytest.raises(ValueError, match="the work failed"):
        await caller
