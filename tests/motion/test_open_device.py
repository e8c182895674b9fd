"""All devices are closed alike, and tell alike of a line that is lost and comes back."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from compax_aio.errors import ConnectionLostError, MoveTimeoutError
from compax_aio.link.contract import Event
from compax_aio.link.reconnecting import Restored
from compax_aio.motion.events import ConnectionLost, ConnectionRestored, EventHub
from compax_aio.motion.open_device import OpenDevice


class Device(OpenDevice[Any]):
    def __init__(self) -> None:
        self.name = "x"
        self.calls: list[str] = []
        self.may_end = asyncio.Event()
        self.fails_with: Exception | None = None
        self._events = EventHub()
        self._loop = asyncio.get_running_loop()
        self._line = SimpleNamespace(link=SimpleNamespace(close=self._close_line, is_open=True, stats="counters"))

    async def _close_line(self) -> None:
        self.calls.append("line closed")

    async def _end(self) -> None:
        await self.may_end.wait()
        self.calls.append("ended")
        if self.fails_with is not None:
            raise self.fails_with

    async def _greet(self) -> None:
        self.calls.append("greeted")

    def _on_event(self, event: Event) -> None:
        self.calls.append("event")


async def test_what_was_started_is_ended_before_the_line_is_closed_although_the_caller_is_cancelled() -> None:
    device = Device()
    stream = device._events.stream()

    async def use() -> None:
        async with device:
            pass

    using = asyncio.create_task(use())
    await asyncio.sleep(1)
    using.cancel()
    await asyncio.sleep(1)
    assert device.calls == []
    device.may_end.set()
    with pytest.raises(asyncio.CancelledError):
        await using
    assert device.calls == ["ended", "line closed"]
    assert [event async for event in stream] == []


async def test_the_line_is_closed_although_what_was_started_may_go_on() -> None:
    device = Device()
    device.may_end.set()
    device.fails_with = MoveTimeoutError("it may be moving")
    with pytest.raises(MoveTimeoutError):
        await device.close()
    assert device.calls == ["ended", "line closed"]


async def test_a_line_that_is_lost_and_comes_back_is_told() -> None:
    device = Device()
    assert device.is_open
    assert str(device.stats) == "counters"
    stream = device._events.stream()
    tells = device._tells
    tells["on_down"](ConnectionLostError("gone"))
    tells["on_restored"](Restored(2.0, 3))
    tells["on_lost"](ConnectionLostError("for good"))
    down, back, lost = stream.take_waiting()
    assert isinstance(down, ConnectionLost)
    assert "gone" in down.reason
    assert back == ConnectionRestored("x", back.at, 2.0, 3, ())
    assert isinstance(lost, ConnectionLost)
    assert "for good" in lost.reason
    await tells["greet"]()
    tells["on_event"](Event())
    assert device.calls == ["greeted", "event"]
