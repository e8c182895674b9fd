"""Event streams: everybody sees everything from now on, nobody holds anybody up, memory is bounded (P8)."""

from __future__ import annotations

import asyncio
import gc
import weakref

import pytest

from compax_aio.compax.events import ComparatorPassed, DriveEvent, EventHub, EventStream, PositionMessage

LIMIT = 1000


def passed(number: int) -> ComparatorPassed:
    return ComparatorPassed("x", 0.0, number)


async def numbers(stream: EventStream) -> list[int]:
    """Read *stream* to its end."""
    return [event.number async for event in stream if isinstance(event, ComparatorPassed)]


async def test_a_stream_gives_every_event_in_order_and_ends_with_the_drive() -> None:
    hub = EventHub()
    stream = hub.stream()
    for number in range(5):
        hub.publish(passed(number))
    hub.end()
    assert await numbers(stream) == [0, 1, 2, 3, 4]
    with pytest.raises(StopAsyncIteration):
        await anext(stream)
    assert stream.lost == 0


async def test_a_consumer_that_waits_is_woken_by_an_event_and_by_the_end() -> None:
    hub = EventHub()
    reading = asyncio.ensure_future(numbers(hub.stream()))
    await asyncio.sleep(1)
    hub.publish(passed(1))
    await asyncio.sleep(1)
    assert not reading.done()
    hub.end()
    assert await reading == [1]


async def test_what_happened_before_is_not_told() -> None:
    hub = EventHub()
    hub.publish(passed(1))
    stream = hub.stream()
    hub.publish(passed(2))
    hub.end()
    assert await numbers(stream) == [2]


async def test_a_stream_begins_when_it_is_made_not_when_it_is_read() -> None:
    hub = EventHub()
    stream = hub.stream()
    hub.publish(passed(1))
    assert await anext(stream) == passed(1)


async def test_a_slow_consumer_loses_the_oldest_events_and_knows_how_many() -> None:
    hub = EventHub()
    stream = hub.stream()
    for number in range(LIMIT + 7):
        hub.publish(passed(number))
    hub.end()
    assert stream.lost == 7
    assert await numbers(stream) == list(range(7, LIMIT + 7))


async def test_a_slow_consumer_holds_nobody_up() -> None:
    hub = EventHub()
    slow, quick = hub.stream(), hub.stream()
    for number in range(3 * LIMIT):
        hub.publish(passed(number))
        assert await anext(quick) == passed(number)
    assert (quick.lost, slow.lost) == (0, 2 * LIMIT)


async def test_several_streams_see_the_same() -> None:
    hub = EventHub()
    readings = [asyncio.ensure_future(numbers(hub.stream())) for _ in range(5)]
    await asyncio.sleep(0)
    for number in range(10):
        hub.publish(passed(number))
    hub.end()
    assert await asyncio.gather(*readings) == [list(range(10))] * 5


async def test_two_readers_of_one_stream_share_its_events_and_both_end() -> None:
    hub = EventHub()
    stream = hub.stream()
    readings = [asyncio.ensure_future(numbers(stream)) for _ in range(2)]
    for number in range(10):
        hub.publish(passed(number))
        await asyncio.sleep(0.1)
    hub.end()
    first, second = await asyncio.gather(*readings)
    assert sorted(first + second) == list(range(10))


async def test_a_reader_that_is_cancelled_loses_no_event() -> None:
    hub = EventHub()
    stream = hub.stream()
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(1):
            await anext(stream)
    hub.publish(passed(1))
    assert await anext(stream) == passed(1)


async def test_a_stream_that_nobody_holds_is_forgotten() -> None:
    hub = EventHub()
    kept, dropped = hub.stream(), hub.stream()
    gone = weakref.ref(dropped)
    del dropped
    gc.collect()
    assert gone() is None
    hub.publish(passed(1))
    assert await anext(kept) == passed(1)


async def test_a_stream_that_is_read_in_a_loop_is_held_by_the_loop() -> None:
    hub = EventHub()

    async def reader() -> list[DriveEvent]:
        return [event async for event in hub.stream()]

    reading = asyncio.ensure_future(reader())
    await asyncio.sleep(0)
    gc.collect()
    hub.publish(PositionMessage("x", 1.5))
    hub.end()
    assert await reading == [PositionMessage("x", 1.5)]


async def test_a_stream_of_a_closed_drive_ends_at_once() -> None:
    hub = EventHub()
    hub.end()
    assert await numbers(hub.stream()) == []
