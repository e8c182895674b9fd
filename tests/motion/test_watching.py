"""However a device is asked: there is one task from the first who watches to the last, and nobody waits for ever."""

from __future__ import annotations

import asyncio
import gc
from types import SimpleNamespace
from typing import Any, cast

import pytest

from compax_aio.errors import AnswerTimeoutError, ConnectionLostError
from compax_aio.motion.watching import NewestReadings, Watchers


class Asked:
    """A device that says a higher number each second."""

    def __init__(self) -> None:
        self.link = SimpleNamespace(is_over=False)
        self.watchers: Watchers[NewestReadings[int]] = Watchers("x", cast("Any", self.link), self._ask)
        self.number = 0
        self.fails_with: BaseException | None = None

    def watch(self) -> NewestReadings[int]:
        return self.watchers.join(lambda leave, dropped: NewestReadings(1.0, leave, dropped))

    async def _ask(self) -> None:
        loop = asyncio.get_running_loop()
        while self.watchers.is_anybody_there:
            if self.fails_with is not None:
                raise self.fails_with
            self.number += 1
            for watch in self.watchers:
                watch.put(self.number)
            del watch
            await self.watchers.wait_until(loop.time() + 1)


def asking() -> list[asyncio.Task[Any]]:
    return [task for task in asyncio.all_tasks() if task.get_name() == "x: watch"]


async def test_all_see_the_newest_and_the_last_one_ends_the_task() -> None:
    device = Asked()
    with device.watch() as quick, device.watch() as slow:
        assert [await anext(quick) for _ in range(3)] == [1, 2, 3]
        assert await anext(slow) == 3
        assert (quick.skipped, slow.skipped) == (0, 2)
        assert len(asking()) == 1
    await asyncio.sleep(0)
    assert not asking()
    assert len(device.watchers) == 0
    assert [number async for number in quick] == []


async def test_who_joins_is_not_kept_waiting() -> None:
    device = Asked()
    first = device.watch()
    await anext(first)
    await asyncio.sleep(0.1)
    second = device.watch()
    assert await anext(second) == 2
    assert asyncio.get_running_loop().time() < 0.2
    first.close()
    second.close()


async def test_whom_nobody_holds_watches_no_more() -> None:
    device = Asked()
    watch = device.watch()
    await anext(watch)
    del watch
    gc.collect(0)
    await asyncio.sleep(0.1)
    assert not asking()
    number = device.number
    await asyncio.sleep(10)
    assert device.number == number


async def test_a_question_under_way_is_carried_through() -> None:
    device = Asked()
    watch = device.watch()
    await anext(watch)
    device.watchers.is_asking = True
    watch.close()
    await asyncio.sleep(0)
    assert asking()
    device.watchers.is_asking = False
    await asyncio.sleep(2)
    assert not asking()


async def test_a_lost_line_is_an_error_of_its_own_for_each_and_for_those_to_come() -> None:
    device = Asked()
    watches = [device.watch(), device.watch()]
    await anext(watches[0])
    loss = ConnectionLostError("gone")
    loss.__cause__ = OSError("unplugged")
    device.watchers.end(loss)
    assert await anext(watches[1]) == 1, "what was said is seen first"
    errors = []
    for watch in (*watches, device.watch()):
        with pytest.raises(ConnectionLostError, match="gone") as caught:
            await anext(watch)
        errors.append(caught.value)
    assert len({id(error) for error in (loss, *errors)}) == 4
    assert all(error.__cause__ is loss.__cause__ for error in errors)
    device.watchers.end()
    assert [number async for number in device.watch()] == []


async def test_an_error_of_a_line_that_is_over_is_left_to_whoever_tells_of_that() -> None:
    device = Asked()
    device.fails_with, device.link.is_over = AnswerTimeoutError("late"), True
    watch = device.watch()
    await asyncio.sleep(1)
    assert not asking()
    assert not watch.has_ended
    device.watchers.end()
    assert [number async for number in watch] == []


@pytest.mark.parametrize("defect", [ZeroDivisionError("a defect"), AnswerTimeoutError("of a line that is there")])
async def test_a_defect_lets_nobody_wait_for_ever(defect: Exception) -> None:
    device = Asked()
    device.fails_with = defect
    watch = device.watch()
    (task,) = asking()
    async with asyncio.timeout(60):
        with pytest.raises(type(defect)):
            await anext(watch)
    assert task.exception() is defect


async def test_a_task_that_somebody_cancels_ends_all() -> None:
    device = Asked()
    watch = device.watch()
    await anext(watch)
    asking()[0].cancel()
    assert [number async for number in watch] == []
