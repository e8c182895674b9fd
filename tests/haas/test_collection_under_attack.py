"""What callers, slow lines and other hosts do to data collection: no harm, and nothing is told that is not so."""

from __future__ import annotations

import asyncio
import gc
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import pytest
from tests.haas.bench import Bench, bench, ending, now, until

from compax_aio.errors import AnswerTimeoutError, CommandRejectedError, CompaxError
from compax_aio.haas.events import VariableWritten
from compax_aio.haas.pacing import Pacing
from compax_aio.haas.profiles import DATA_COLLECTION, NEXT_GENERATION
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.haas import LogKind

CLASSIC: Final[dict[str, Any]] = {"data_collection": "rs-232", "freeze_after": 1}
NEWER: Final[dict[str, Any]] = {"data_collection": "ethernet", "freeze_after": 1}
SETTINGS: Final = ControlSettings(baud_rate=9600)
WRITING: Final = replace(SETTINGS, writable=(range(100, 200), range(500, 540), range(1000, 1010)))


def requests(table: Bench) -> list[str]:
    return [entry.text.split(" after")[0] for entry in table.far.log if entry.kind is LogKind.REQUEST]


def writes(table: Bench) -> list[str]:
    return [text for text in requests(table) if text.startswith("E")]


# Slow lines ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("baudrate", [50, 110, 300, 1200])
async def test_a_slow_line_is_waited_for(baudrate: Any) -> None:
    async with bench(replace(DATA_COLLECTION, baudrate=baudrate), **CLASSIC) as table:
        assert (await table.control.program_status()).parts == 42
        assert await table.control.model() == "VF2"
        assert not table.far.is_frozen


@pytest.mark.parametrize("baudrate", [50, 110])
async def test_nothing_is_asked_between_two_characters_of_a_line_that_is_printed(baudrate: Any) -> None:
    async with bench(replace(DATA_COLLECTION, baudrate=baudrate), **CLASSIC) as table:
        table.far.dprnt("X*12345.678")
        await asyncio.sleep(3 * 11 / baudrate)
        assert await table.control.model() == "VF2"
        assert table.far.gaps_s[0] >= 0.05


# Many callers --------------------------------------------------------------------------------------------------------


async def test_who_waits_is_left_alone_until_it_is_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = 0
    look = Pacing._block

    def counted(pacing: Pacing) -> Any:
        nonlocal looks
        looks += 1
        return look(pacing)

    monkeypatch.setattr(Pacing, "_block", counted)
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        await asyncio.gather(*(table.control.variable(number) for number in range(500, 700)))
    assert looks < 5 * 200


async def test_all_who_wait_behind_a_transfer_give_up_in_time_and_in_order() -> None:
    both = replace(DATA_COLLECTION, synchronization="dc codes")
    async with bench(both, settings=SETTINGS, **CLASSIC) as table:
        transfer = table.control.receive_program()
        gave_up: list[tuple[int, float]] = []

        async def ask(number: int) -> None:
            await asyncio.sleep(number / 10)
            assert "a transfer is under way" in str(await ending(table.control.variable(number)))
            gave_up.append((number, now()))

        await asyncio.gather(*map(ask, range(100)))
        began_at = gave_up[0][1]
        assert [number for number, _ in gave_up] == list(range(100))
        assert all(at - began_at == pytest.approx(number / 10, abs=0.2) for number, at in gave_up)
        transfer.cancel()
        with suppress(asyncio.CancelledError):
            await transfer


async def test_callers_that_give_up_while_they_wait_leave_the_others_their_turns() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        tasks = [asyncio.ensure_future(table.control.variable(number)) for number in range(500, 560)]
        await asyncio.sleep(0.3)
        for task in tasks[::2]:
            task.cancel()
        results = await asyncio.gather(*tasks, return_exceptions=True)
        assert sum(isinstance(each, asyncio.CancelledError) for each in results) >= 25
        assert not any(isinstance(each, CompaxError) for each in results)
        assert await table.control.model() == "VF2"


async def test_a_question_whose_task_is_cancelled_before_it_begins_keeps_nobody_waiting() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        question = asyncio.ensure_future(table.control.model())
        await asyncio.sleep(0)
        for task in asyncio.all_tasks():
            if task.get_name() == "c: Q102":
                task.cancel()
        with suppress(asyncio.CancelledError):
            await question
        async with asyncio.timeout(10):
            assert await table.control.model() == "VF2"


async def test_thousands_of_watches_of_different_things_get_what_they_want() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        watches = [
            table.control.watch(600, *(500 + bit for bit in range(11) if number >> bit & 1)) for number in range(2000)
        ]
        await asyncio.sleep(1)
        late = table.control.watch(600)
        for number, watch in enumerate(watches):
            assert len((await anext(watch)).values) == 1 + number.bit_count()
        assert (await anext(late)).at >= 1
        for watch in (*watches, late):
            watch.close()


async def test_a_watch_whose_last_question_is_refused_when_the_control_is_closed_ends_quietly() -> None:
    complaints: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        watch = table.control.watch(*range(500, 520))
        await asyncio.sleep(1)
        table.far.power_off()
        silent = [asyncio.ensure_future(ending(table.control.model())) for _ in range(3)]
        await until(lambda: table.control._collecting.pacing._in_vain == 3)
        await table.control.close()
        await asyncio.gather(*silent)
        await asyncio.sleep(20)
        assert len([reading async for reading in watch]) <= 1
        del silent
        gc.collect()
        assert not [task for task in asyncio.all_tasks() if task.get_name() == "c: watch"]
    assert complaints == []


# Writing -------------------------------------------------------------------------------------------------------------


async def test_a_write_that_is_cancelled_while_it_waits_for_its_turn_is_not_sent(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level("INFO", logger="compax_aio.haas.writes"):
        async with bench(DATA_COLLECTION, settings=WRITING, **CLASSIC) as table:
            task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
            others = [asyncio.ensure_future(table.control.variable(number)) for number in range(501, 520)]
            await until(lambda: len(table.far.gaps_s) == 5)
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
            await asyncio.gather(*others)
            assert writes(table) == []
            assert caplog.messages[-1] == "c: #500 = 3.5 was not sent: the caller has given up"
            assert await table.control.write_variable(500, 4.5) == 4.5


async def test_a_write_waits_for_the_one_before_however_often_its_caller_is_cancelled() -> None:
    async with bench(DATA_COLLECTION, settings=WRITING, **CLASSIC) as table:
        first = asyncio.ensure_future(table.control.write_variable(500, 1.5))
        second = asyncio.ensure_future(table.control.write_variable(501, 2.5))
        await until(lambda: len(writes(table)) == 1)
        for _ in range(3):
            first.cancel()
            await asyncio.sleep(0)
        assert await second == 2.5
        asked = requests(table)
        between = asked[asked.index("E500 1.5") + 1 : asked.index("E501 2.5")]
        assert between == ["Q600 500", "Q600 501"]  # the first one is read back, then the second one reads
        assert first.cancelled()


async def test_a_write_that_is_refused_is_none_although_the_variable_reads_so() -> None:
    async with bench(DATA_COLLECTION, settings=WRITING, **CLASSIC) as table:
        events = table.control.events()
        error = await ending(table.control.write_variable(1003, 0))
        assert isinstance(error, CommandRejectedError)
        assert "it reads 0, as before" in str(error)
        await table.control.close()
        assert not [event async for event in events if isinstance(event, VariableWritten)]


# Late, lost, and other hosts' ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("answer_time_s", [0.05, 0.2, 0.45])
async def test_another_hosts_answer_is_found_out_although_ours_takes_its_time(answer_time_s: float) -> None:
    async with bench(NEXT_GENERATION, answer_time_s=answer_time_s, **NEWER) as table:
        table.far.memory.macros[500] = 1.5
        table.far.trouble.foreign_replies.append("MACRO, 77.0")
        assert await table.control.variable(500) == 1.5


async def test_the_first_question_of_a_connection_that_a_newer_control_does_not_take_is_asked_again() -> None:
    async with bench(NEXT_GENERATION, first_request_lost=True, **NEWER) as table:
        assert await table.control.model() == "VF2"
        table.lose_line()
        await asyncio.sleep(5)
        assert await table.control.variable(3027) == 0.0
        assert not table.far.is_frozen


async def test_a_newer_control_that_stays_silent_is_not_asked_twice_each_time() -> None:
    async with bench(NEXT_GENERATION, lose_reply=1.0, **NEWER) as table:
        assert isinstance(await ending(table.control.model()), AnswerTimeoutError)
        asked = len(requests(table))
        assert asked == 2
        await ending(table.control.mode())
        assert len(requests(table)) <= asked + 1
