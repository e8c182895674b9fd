"""Whatever takes long is awaited, watched and cancelled alike."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

import pytest

from compax_aio.errors import AnswerTimeoutError, InvalidCommandError
from compax_aio.motion.under_way import UnderWay


class Owner:
    def __init__(self) -> None:
        self.done = 0
        self.times_abandoned = 0

    def snapshot(self) -> int:
        return self.done

    def account(self) -> str:
        return f"{self.done} of 3"

    def abandon(self) -> None:
        self.times_abandoned += 1


Work = UnderWay[str, int, str]


class LookedAt(UnderWay[str, int, str]):
    """Work whose owner tells of no change."""

    _look_s = 0.25

    def _is_news(self, now: int, told: int) -> bool:
        return now != told


def step(work: Work, owner: Owner) -> None:
    owner.done += 1
    work.note_change()


async def test_each_change_is_told_and_the_end_once() -> None:
    owner = Owner()
    work = Work(owner, "it")
    loop = asyncio.get_running_loop()
    for at in (1, 2):
        loop.call_later(at, step, work, owner)
    loop.call_later(3, work.finish, "good")
    assert [state async for state in work.progress()] == [0, 1, 2, 2]
    assert await work == "good"
    assert work.failure is None


async def test_what_nobody_tells_of_is_looked_at_and_told_when_it_is_news() -> None:
    owner = Owner()
    work = LookedAt(owner, "it")
    loop = asyncio.get_running_loop()
    loop.call_later(1, setattr, owner, "done", 1)
    loop.call_later(2, work.finish, "good")
    times = [(state, round(loop.time(), 1)) async for state in work.progress(interval_s=0)]
    assert times == [(0, 0.0), (1, 1.0), (1, 2.0)]


async def test_cancelling_it_is_told_to_its_owner_once() -> None:
    owner = Owner()
    work = Work(owner, "it")
    assert work.cancel()
    assert not work.cancel()
    assert owner.times_abandoned == 1
    work.finish("too late")
    work.fail(AnswerTimeoutError("too late"))
    with pytest.raises(asyncio.CancelledError):
        await work


async def test_an_error_is_raised_in_whoever_awaits_it_and_not_in_whoever_watches() -> None:
    owner = Owner()
    work = Work(owner, "it")
    error = AnswerTimeoutError("nobody answers")
    asyncio.get_running_loop().call_later(1, work.fail, error)
    assert [state async for state in work.progress()] == [0, 0]
    assert work.failure is error
    assert work.account == "0 of 3"
    with pytest.raises(AnswerTimeoutError, match="nobody answers"):
        await work


@pytest.mark.parametrize("interval", [-1, "x", float("nan")])
async def test_an_interval_that_is_none_is_refused(interval: Any) -> None:
    work = Work(Owner(), "it")
    with pytest.raises(InvalidCommandError, match="interval_s"):
        await anext(aiter(work.progress(interval_s=interval)))
    work.cancel()
    with suppress(asyncio.CancelledError):
        await work
