"""However many watch, each question is asked once a cycle, and cycles leave the control alone between."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import pytest
from tests.haas.bench import Bench, bench, now

from compax_aio.errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    InvalidCommandError,
)
from compax_aio.haas.profiles import CLASSIC_DC_CODES, DATA_COLLECTION
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.haas import LogKind

KNOBS: Final[dict[str, Any]] = {"data_collection": "rs-232", "freeze_after": 1}
SETTINGS: Final = ControlSettings(baud_rate=9600)
SPINDLE: Final = 3027


def asked(table: Bench) -> Iterator[str]:
    return (entry.text.split(" after")[0] for entry in table.far.log if entry.kind is LogKind.REQUEST)


async def test_a_reading_has_all_that_is_watched() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        with table.control.watch("Q500", SPINDLE, "Q104") as watch:
            reading = await anext(watch)
        assert reading["Q500"].status == "IDLE"
        assert reading[SPINDLE] == 0.0
        assert reading["q104"] == "MEM"
        assert SPINDLE in reading
        assert reading.control == "c"
        assert not reading.errors
        with pytest.raises(InvalidCommandError, match="not watched here; watched: Q500, 3027, Q104"):
            reading["Q100"]


async def test_a_variable_is_the_same_by_number_and_by_question() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        with table.control.watch("Q600 3027", SPINDLE) as watch:
            assert watch.quantities == (SPINDLE,)


async def test_cycles_are_a_second_apart_and_each_question_is_asked_once_for_all() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        watches = [table.control.watch("Q500", SPINDLE) for _ in range(10)]
        watches += [table.control.watch(SPINDLE, "Q104") for _ in range(10)]
        await asyncio.sleep(10.5)
        counts = {text: list(asked(table)).count(text) for text in asked(table)}
        assert set(counts) == {"Q500", "Q600 3027", "Q104"}
        assert all(10 <= each <= 11 for each in counts.values())
        for watch in watches:
            assert watch.skipped in {9, 10}
            assert (await anext(watch)).at > 9
            watch.close()
        assert min(table.far.gaps_s) >= 0.05


async def test_who_wants_readings_more_rarely_gets_them_more_rarely() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        with table.control.watch(SPINDLE, interval_s=5) as slow, table.control.watch("Q500") as quick:
            times = [(await anext(slow)).at for _ in range(3)]
            assert times[2] - times[0] == pytest.approx(10, abs=1)
            assert quick.skipped > 8


async def test_only_changes_are_told_to_who_wants_only_these() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        table.far.memory.macros[500] = 1.0
        async with table.control.watch(500, only_changes=True) as watch:
            assert (await anext(watch))[500] == 1.0
            following = asyncio.ensure_future(anext(watch))
            await asyncio.sleep(5)
            assert not following.done()
            table.far.memory.macros[500] = 2.0
            assert (await following)[500] == 2.0


async def test_what_is_not_said_is_told_with_its_reason() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, busy_answers="all", **KNOBS) as table:
        table.far.cycle_start()
        with table.control.watch("Q500", SPINDLE, "Q999") as watch:
            reading = await anext(watch)
            assert reading["Q500"].is_busy
            assert SPINDLE not in reading
            with pytest.raises(CommandRejectedError, match="busy"):
                reading[SPINDLE]
            table.far.cycle_stop()
            reading = await anext(watch)
            assert reading[SPINDLE] is not None
            with pytest.raises(CommandRejectedError, match="does not know"):
                reading["Q999"]


async def test_a_silent_control_is_not_asked_for_all_that_is_watched() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="off") as table:
        with table.control.watch(*range(500, 520)) as watch:
            reading = await anext(watch)
            assert len(reading.errors) == 20
            assert all(isinstance(each, AnswerTimeoutError) for each in reading.errors.values())
            assert table.far.received_bytes < 60
            began_at = now()
            await anext(watch)
            assert now() - began_at > 2


async def test_there_are_no_readings_during_a_transfer() -> None:
    both = replace(CLASSIC_DC_CODES, data_collection="rs-232")
    async with bench(both, settings=SETTINGS, **KNOBS) as table:
        with table.control.watch("Q500") as watch:
            await anext(watch)
            transfer = table.control.receive_program()
            await asyncio.sleep(3)
            asked_before = list(asked(table))
            await table.press("send", "O00010", after_s=30)
            await transfer
            assert list(asked(table)) == asked_before
            ended_at = now()
            while (await anext(watch)).at < ended_at:
                pass


async def test_nothing_is_asked_when_nobody_watches_any_more() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        watch = table.control.watch("Q500")
        await anext(watch)
        watch.close()
        watch.close()
        with pytest.raises(StopAsyncIteration):
            await anext(watch)
        count = len(list(asked(table)))
        await asyncio.sleep(10)
        assert len(list(asked(table))) == count
        with table.control.watch("Q500") as again:
            await anext(again)


async def test_a_watch_that_nobody_holds_any_more_is_over() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        watch = table.control.watch("Q500")
        await anext(watch)
        del watch
        gc.collect()
        await asyncio.sleep(1.5)
        count = len(list(asked(table)))
        await asyncio.sleep(10)
        assert len(list(asked(table))) == count


async def test_a_consumer_that_is_cancelled_leaves_the_others_alone() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:

        async def follow() -> None:
            async for _ in table.control.watch("Q500"):
                pass

        task = asyncio.ensure_future(follow())
        with table.control.watch("Q500") as watch:
            await anext(watch)
            await asyncio.sleep(0.1)
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
            assert (await anext(watch))["Q500"].status == "IDLE"


async def test_watches_end_with_the_control() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        watch = table.control.watch("Q500")
        await table.control.close()
        with suppress(StopAsyncIteration):
            await anext(watch)
        with pytest.raises(StopAsyncIteration):
            await anext(watch)
        with pytest.raises(StopAsyncIteration):
            await anext(table.control.watch("Q500"))


async def test_watches_tell_that_the_line_is_lost_for_good() -> None:
    async with bench(DATA_COLLECTION, settings=replace(SETTINGS, reconnect=False), **KNOBS) as table:
        watches = [table.control.watch("Q500"), table.control.watch(SPINDLE)]
        await asyncio.sleep(1.5)
        table.lose_line()
        for watch in watches:
            with suppress(StopAsyncIteration):
                await anext(watch)  # what was read before
            with pytest.raises(ConnectionLostError):
                await anext(watch)
        with pytest.raises(ConnectionLostError):
            await anext(table.control.watch("Q500"))


async def test_watches_go_on_when_the_line_is_back() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        with table.control.watch("Q500") as watch:
            await anext(watch)
            table.lose_line()
            assert (await anext(watch)).at > 0
            assert (await anext(watch))["Q500"].status == "IDLE"


@pytest.mark.parametrize(
    ("quantities", "more", "why"),
    [
        ((), {}, "from 1 to 64"),
        (tuple(range(100)), {}, "from 1 to 64"),
        (("position",), {}, "no question"),
        ((True,), {}, "cannot be watched"),
        ((1.5,), {}, "cannot be watched"),
        ((-1,), {}, "number of a variable"),
        (("E500 1",), {}, "writes"),
        (("Q500",), {"interval_s": 0.5}, "1 s at least"),
        (("Q500",), {"interval_s": "x"}, "interval_s"),
    ],
)
async def test_what_cannot_be_watched_is_refused(quantities: Any, more: Any, why: str) -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **KNOBS) as table:
        with pytest.raises(InvalidCommandError, match=why):
            table.control.watch(*quantities, **more)
        assert table.far.received_bytes == 0
