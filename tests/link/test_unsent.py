"""What was written and has not left: as the transport tells it, and as the line's rate has it."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from tests.link.lines import connected

from compax_aio.errors import AnswerTimeoutError
from compax_aio.link.contract import Lane


async def test_where_the_rate_is_unknown_only_the_transport_tells() -> None:
    line = await connected()
    assert line.link.bytes_per_s is None
    line.ask("S1")
    assert line.link.unsent_bytes == 3  # the loop has not turned yet
    await asyncio.sleep(0.1)
    assert line.link.unsent_bytes == 0


async def test_at_a_known_rate_bytes_leave_one_after_the_other() -> None:
    line = await connected()
    line.link.bytes_per_s = 100.0
    line.ask("S1")
    seen = []
    for _ in range(5):
        await asyncio.sleep(0.01)
        seen.append(line.link.unsent_bytes)
    assert seen == [2, 1, 0, 0, 0]


async def test_what_was_written_long_ago_does_not_count() -> None:
    line = await connected()
    line.link.bytes_per_s = 100.0
    await asyncio.sleep(10)
    line.ask("S1")
    await asyncio.sleep(0.001)
    assert line.link.unsent_bytes == 3


async def test_what_the_far_end_does_not_take_counts_for_as_long_as_it_waits() -> None:
    line = await connected()
    line.link.bytes_per_s = 1000.0
    line.far.transport.pause_reading()
    line.ask("S1")
    await asyncio.sleep(0.5)
    assert line.link.unsent_bytes == 3
    line.far.transport.resume_reading()
    await asyncio.sleep(0.1)
    assert line.link.unsent_bytes == 0


@pytest.mark.parametrize(
    ("driver", "unsent"),
    [
        (SimpleNamespace(out_waiting=7), 7),
        (SimpleNamespace(), 0),
    ],
)
async def test_the_driver_of_a_serial_port_tells_what_waits_with_it(
    driver: Any, unsent: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = await connected()
    monkeypatch.setattr(line.link._port.transport, "get_extra_info", lambda name: driver if name == "serial" else None)
    assert line.link.unsent_bytes == unsent


async def test_a_port_that_went_away_has_nothing_unsent(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone:
        @property
        def out_waiting(self) -> int:
            raise OSError("it was unplugged")

    line = await connected()
    monkeypatch.setattr(line.link._port.transport, "get_extra_info", lambda _: Gone())
    assert line.link.unsent_bytes == 0
    await line.link.close()
    assert line.link.unsent_bytes == 0


async def test_a_time_out_says_how_long_it_was_waited_for() -> None:
    line = await connected()
    line.far.transport.pause_reading()
    with pytest.raises(AnswerTimeoutError, match="no answer within 1 s"):
        await line.link.exchange("S1", Lane.READ)
