"""Those who share a line have their turns one after the other, whatever they want; stops go before everybody's."""

from __future__ import annotations

import asyncio

from compax_aio.link.contract import Lane
from compax_aio.link.exchanges import Exchange, ExchangeQueue


def exchange(party: str, lane: Lane, number: int = 0) -> Exchange:
    waiter = asyncio.get_running_loop().create_future()
    return Exchange(f"{party}{lane.name}{number}", lane, party=party, waiters=[waiter])


def taken(queue: ExchangeQueue) -> list[str]:
    texts = []
    while (each := queue.take_next()) is not None:
        texts.append(each.text)
    return texts


async def test_a_busy_axis_does_not_keep_another_from_moving() -> None:
    queue = ExchangeQueue()
    for number in range(3):
        queue.put(exchange("B", Lane.CONTROL, number))
    queue.put(exchange("A", Lane.MOTION))
    queue.put(exchange("C", Lane.READ))
    assert taken(queue) == ["BCONTROL0", "AMOTION0", "CREAD0", "BCONTROL1", "BCONTROL2"]


async def test_of_one_axis_the_most_urgent_goes_first() -> None:
    queue = ExchangeQueue()
    for lane in reversed(Lane):
        queue.put(exchange("A", lane))
    assert taken(queue) == ["ASTOP0", "AGREETING0", "ACONTROL0", "AMOTION0", "AREAD0"]


async def test_stops_of_all_go_before_everything_of_anybody() -> None:
    queue = ExchangeQueue()
    for party in "ABC":
        queue.put(exchange(party, Lane.CONTROL))
        queue.put(exchange(party, Lane.STOP))
    assert taken(queue)[:3] == ["ASTOP0", "BSTOP0", "CSTOP0"]


async def test_who_comes_later_waits_for_one_turn_of_each_other() -> None:
    queue = ExchangeQueue()
    for party in "AB":
        for number in range(5):
            queue.put(exchange(party, Lane.READ, number))
    first = queue.take_next()
    assert first is not None
    queue.put(exchange("C", Lane.READ))
    assert taken(queue)[:4] == ["BREAD0", "AREAD1", "CREAD0", "BREAD1"]


async def test_who_is_held_keeps_its_stop_and_holds_up_nobody() -> None:
    queue = ExchangeQueue()
    queue.held.add("A")
    for party in "AB":
        queue.put(exchange(party, Lane.STOP))
        queue.put(exchange(party, Lane.READ))
    first = queue.first_stop()
    assert first is not None
    assert first.party == "B"
    assert taken(queue) == ["BSTOP0", "BREAD0"]
    queue.held.clear()
    assert taken(queue) == ["ASTOP0", "AREAD0"]


async def test_reads_that_are_held_back_hold_up_nothing_else() -> None:
    queue = ExchangeQueue()
    queue.reads_are_held = True
    queue.put(exchange("A", Lane.READ))
    queue.put(exchange("B", Lane.MOTION))
    assert taken(queue) == ["BMOTION0"]
    queue.reads_are_held = False
    assert taken(queue) == ["AREAD0"]


async def test_what_nobody_waits_for_costs_nobody_a_turn() -> None:
    queue = ExchangeQueue()
    given_up = exchange("A", Lane.READ)
    queue.put(given_up)
    queue.put(exchange("A", Lane.READ, 1))
    queue.put(exchange("B", Lane.READ))
    given_up.waiters[0].cancel()
    assert taken(queue) == ["AREAD1", "BREAD0"]
