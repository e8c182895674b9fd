"""Questions go one after the other, however many ask, and a control is never asked so fast that it freezes."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise
from random import Random
from typing import Any, Final

import pytest
from tests.haas.bench import Bench, bench, ending, now, outcome

from compax_aio.errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    UnexpectedAnswerError,
)
from compax_aio.haas.answers import Count, Text
from compax_aio.haas.events import Overheard, Printed
from compax_aio.haas.profiles import CLASSIC_DC_CODES, DATA_COLLECTION, NEXT_GENERATION
from compax_aio.haas.settings import ControlSettings

CLASSIC: Final[dict[str, Any]] = {"data_collection": "rs-232", "freeze_after": 1}
"""One question without a pause in front of it freezes it."""
NEWER: Final[dict[str, Any]] = {"data_collection": "ethernet", "freeze_after": 1}
SETTINGS: Final = ControlSettings(baud_rate=9600)
BOTH_WAYS: Final = replace(CLASSIC_DC_CODES, data_collection="rs-232")


def is_well(table: Bench) -> bool:
    """Whether the control lives, and was never asked too soon."""
    return not table.far.is_frozen and min(table.far.gaps_s) >= 0.05 - 1e-9


async def test_everything_that_is_known_is_read() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        control = table.control
        assert await control.serial_number() == "1234567"
        assert await control.software_version() == "VER 000.00"
        assert await control.model() == "VF2"
        assert await control.mode() == "MEM"
        assert await control.tool_changes() == 35
        assert await control.tool_in_use() == 4
        assert await control.power_on_time() == timedelta(0)
        assert await control.motion_time() == timedelta(0)
        assert await control.last_cycle() == timedelta(0)
        assert await control.previous_cycle() == timedelta(0)
        assert await control.m30_count() == await control.m30_count(2) == 380
        assert (await control.program_status()).status == "IDLE"
        table.far.memory.macros[500] = 1.25
        assert await control.variable(500) == 1.25
        assert await control.variable(20_000) is None
        assert await control.variable(100) is None or await control.variable(100) == 0.0
        assert is_well(table)


async def test_the_same_over_ethernet() -> None:
    async with bench(NEXT_GENERATION, **NEWER) as table:
        assert await table.control.serial_number() == "1234567"
        assert await table.control.variable(3027) == 0.0
        assert (await table.control.program_status()).program == "O00010"
        assert is_well(table)


async def test_a_question_is_asked_by_name_or_number() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        assert isinstance(await table.control.query("Q100"), Text)
        assert isinstance(await table.control.query(200), Count)
        with pytest.raises(InvalidCommandError, match=r"variable\(\)"):
            await table.control.query(3027)
        with pytest.raises(InvalidCommandError, match="1 and 2"):
            await table.control.m30_count(3)
        with pytest.raises(CommandRejectedError, match="does not know Q505") as error:
            await table.control.query("Q505")
        assert error.value.device == "c"
        assert error.value.exchanges


async def test_a_control_that_collects_no_data_is_not_asked() -> None:
    async with bench(replace(CLASSIC_DC_CODES, data_collection=None)) as table:
        assert "collects no data" in str(await ending(table.control.query("Q100")))
        assert table.far.received_bytes == 0


@pytest.mark.parametrize("everything", [False, True])
async def test_a_busy_control_is_a_state(everything: bool) -> None:
    async with bench(
        DATA_COLLECTION, settings=SETTINGS, busy_answers="all" if everything else "q500", **CLASSIC
    ) as table:
        table.far.cycle_start()
        assert (await table.control.program_status()).is_busy
        if everything:
            assert "busy" in str(await ending(table.control.tool_changes()))
        else:
            assert await table.control.tool_changes() > 0


async def test_fifty_who_ask_at_once_are_answered_one_after_the_other() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        table.far.memory.macros.update({number: float(number) for number in range(500, 550)})
        values = await asyncio.gather(*(table.control.variable(number) for number in range(500, 550)))
        assert values == [float(number) for number in range(500, 550)]
        assert is_well(table)


async def test_questions_wait_until_a_program_is_through_with_printing() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        events = table.control.events()
        table.far.dprnt("Z*1.25")
        await asyncio.sleep(0.5)
        began_at = now()
        assert await table.control.model() == "VF2"
        assert now() - began_at > 0.5
        printed = await anext(events)
        assert isinstance(printed, Printed)
        assert printed.text == "Z 1.25"


async def test_a_question_waits_no_longer_than_it_may_for_a_program_that_prints_on_and_on() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, dprnt="X", dprnt_every_s=0.5, **CLASSIC) as table:
        await asyncio.sleep(2)
        error = await ending(table.control.model())
        assert isinstance(error, AnswerTimeoutError)
        assert "'Q102' was not sent: a program prints" in str(error)


async def test_text_within_an_answer_is_no_answer_and_the_next_one_is() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, dprnt_inside=True, **CLASSIC) as table:
        table.far.dprnt("HELLO")
        assert isinstance(await ending(table.control.model()), UnexpectedAnswerError)
        assert await table.control.model() == "VF2"
        assert is_well(table)


async def test_questions_wait_for_the_end_of_a_transfer() -> None:
    async with bench(BOTH_WAYS, settings=SETTINGS, **CLASSIC) as table:
        transfer = table.control.receive_program()
        question = asyncio.ensure_future(table.control.model())
        await table.press("send", "O00010", after_s=2)
        received = await transfer
        assert not question.done()
        assert await question == "VF2"
        assert received.data
        assert is_well(table)


async def test_a_question_waits_no_longer_than_it_may_for_a_transfer() -> None:
    async with bench(BOTH_WAYS, settings=SETTINGS, **CLASSIC) as table:
        transfer = table.control.receive_program()
        began_at = now()
        error = await ending(table.control.model())
        assert "'Q102' was not sent: a transfer is under way" in str(error)
        assert now() - began_at == pytest.approx(SETTINGS.in_doubt_after_s)
        assert table.far.received_bytes == 0
        transfer.cancel()
        with suppress(asyncio.CancelledError):
            await transfer


# A control that does not answer --------------------------------------------------------------------------------------


async def test_a_silent_control_is_asked_ever_more_rarely() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="off") as table:
        asked_at = []
        seen = 0
        while now() < 400:
            await outcome(table.control.model())
            if table.far.received_bytes > seen:
                seen = table.far.received_bytes
                asked_at.append(now())
        pauses = [round(later - earlier, 3) for earlier, later in pairwise(asked_at)]
        assert pauses[0] < 3
        assert pauses[-1] > 60
        assert sorted(pauses[1:]) == pauses[1:]


async def test_fifty_who_ask_a_silent_control_all_know_it_soon() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="off") as table:
        began_at = now()
        results = await asyncio.gather(
            *(table.control.variable(number) for number in range(500, 550)), return_exceptions=True
        )
        assert all(isinstance(each, AnswerTimeoutError) for each in results)
        assert sum("was not sent" in str(each) for each in results) > 40
        assert now() - began_at < 20


async def test_a_control_that_answers_again_is_asked_as_before() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        table.far.power_off()
        for _ in range(4):
            await ending(table.control.model())
        table.far.power_on()
        async with asyncio.timeout(100):
            while not isinstance(await outcome(table.control.model()), str):
                pass
        began_at = now()
        assert await table.control.model() == "VF2"
        assert now() - began_at < 0.5


async def test_who_gives_up_soon_and_asks_again_does_not_hurry_a_silent_control() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="off") as table:
        while now() < 60:
            with suppress(TimeoutError, CompaxError):
                async with asyncio.timeout(0.05):
                    await table.control.model()
        assert table.far.received_bytes < 20 * len(b"Q102\r\n")


async def test_a_late_answer_is_no_others() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="rs-232") as table:
        table.far.memory.macros.update({500: 1.0, 501: 2.0})
        table.far.trouble.replies_to_delay_s.append(2.5)
        assert isinstance(await ending(table.control.variable(500)), AnswerTimeoutError)
        assert await table.control.variable(501) == 2.0
        assert table.control.stats.late_answers == 1


async def test_a_late_state_that_names_nothing_is_no_others() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, data_collection="rs-232") as table:
        table.far.cycle_start()
        table.far.trouble.replies_to_delay_s.append(2.5)
        assert isinstance(await ending(table.control.program_status()), AnswerTimeoutError)
        assert await table.control.tool_in_use() > 0
        assert (await table.control.program_status()).is_busy


async def test_a_lost_line_fails_what_is_asked_if_it_does_not_come_back() -> None:
    settings = replace(SETTINGS, reconnect=False)
    async with bench(DATA_COLLECTION, settings=settings, **CLASSIC) as table:
        question = asyncio.ensure_future(table.control.model())
        await asyncio.sleep(0.06)
        table.lose_line()
        assert isinstance(await ending(question), ConnectionLostError)
        assert isinstance(await ending(table.control.model()), ConnectionLostError)


async def test_a_question_that_was_under_way_is_asked_on_the_line_that_came_back() -> None:
    async with bench(DATA_COLLECTION, settings=SETTINGS, **CLASSIC) as table:
        question = asyncio.ensure_future(table.control.model())
        await asyncio.sleep(0.06)
        table.lose_line()
        assert await question == "VF2"


# A connection that is shared -----------------------------------------------------------------------------------------


async def test_an_answer_to_another_host_is_told_and_no_one_gets_it() -> None:
    async with bench(NEXT_GENERATION, **NEWER) as table:
        events = table.control.events()
        assert await table.control.model() == "VF2"
        table.far.overhear("MACRO, 77.0")
        await asyncio.sleep(0.1)
        overheard = await anext(events)
        assert isinstance(overheard, Overheard)
        assert overheard.text == "MACRO, 77.0"
        assert await table.control.variable(3027) == 0.0


async def test_an_answer_to_another_host_that_comes_in_place_of_ours_is_found_out() -> None:
    async with bench(NEXT_GENERATION, answer_time_s=0.05, **NEWER) as table:
        table.far.memory.macros[500] = 1.5
        table.far.trouble.foreign_replies.append("MACRO, 77.0")
        assert await table.control.variable(500) == 1.5
        assert len(table.far.gaps_s) == 3


async def test_an_answer_is_not_taken_while_another_host_never_stops_asking() -> None:
    async with bench(NEXT_GENERATION, answer_time_s=0.05, foreign_reply=1.0, **NEWER) as table:
        error = await ending(table.control.variable(500))
        assert isinstance(error, UnexpectedAnswerError)
        assert "another host" in str(error)


async def test_an_answer_that_names_its_question_is_asked_for_once() -> None:
    async with bench(NEXT_GENERATION, **NEWER) as table:
        table.far.overhear("MACRO, 77.0")
        await asyncio.sleep(0.1)
        await table.control.model()
        assert len(table.far.gaps_s) == 1


# Whatever callers do -------------------------------------------------------------------------------------------------


async def ask_something(table: Bench, random: Random) -> None:
    control = table.control
    what = random.randrange(6)
    if what == 0:
        await asyncio.gather(*(control.variable(random.randrange(500, 600)) for _ in range(12)), return_exceptions=True)
    elif what == 1:
        with control.watch("Q500", 3027, only_changes=random.random() < 0.5) as watch:
            await anext(watch)
    elif what == 2:
        async with asyncio.timeout(random.random()):
            await asyncio.gather(control.query("Q100"), control.mode())
    elif what == 3 and not (control.transfer is not None and not control.transfer.done()):
        transfer = control.receive_program(operator_timeout_s=random.choice([0.5, 20.0]))
        await table.press("send", "O00010", after_s=random.random())
        await transfer
    elif what == 4:
        await control.write_variable(500, random.randrange(1000) / 8)
    else:
        table.far.dprnt("X")
        await control.program_status()


@pytest.mark.parametrize("seed", range(6))
async def test_nothing_that_callers_do_freezes_a_control(seed: int) -> None:
    settings = replace(SETTINGS, writable=(range(500, 600),))
    async with bench(
        BOTH_WAYS, settings=settings, seed=seed, lose_reply=0.1, garble_reply=0.05, late_reply=0.05, **CLASSIC
    ) as table:
        randoms = [Random(100 * seed + number) for number in range(5)]

        async def user(random: Random) -> None:
            for _ in range(8):
                with suppress(CompaxError, TimeoutError):
                    await ask_something(table, random)

        async with asyncio.timeout(5000):
            await asyncio.gather(*map(user, randoms))
        assert is_well(table)
        assert len(table.far.gaps_s) > 30
