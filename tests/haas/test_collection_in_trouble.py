"""Whatever befalls the line, the control and the callers: no answer is another's, and no write goes out twice."""

from __future__ import annotations

import asyncio
import gc
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from random import Random
from typing import Any, Final

import pytest
from tests.haas.bench import Bench, bench

from compax_aio.errors import CompaxError
from compax_aio.haas.profiles import CLASSIC_DC_CODES, NEXT_GENERATION
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.haas import LogKind

PROFILES: Final = {"rs-232": replace(CLASSIC_DC_CODES, data_collection="rs-232"), "ethernet": NEXT_GENERATION}
SETTINGS: Final = ControlSettings(
    baud_rate=9600,
    writable=(range(600, 700),),
    answer_timeout_s=0.5,
    back_off_first_s=0.5,
    back_off_slowest_s=2,
    operator_timeout_s=3,
)


async def ask(table: Bench, random: Random) -> None:
    """Ask something at random; each readable variable has its own number as its value."""
    control = table.control
    what = random.randrange(6)
    if what < 2:
        number = random.randrange(500, 600)
        assert await control.variable(number) == number
    elif what == 2:
        assert await control.model() == "VF2"
    elif what == 3:
        number = random.randrange(600, 700)
        value = len(table.far.log) + number / 8  # no two are the same
        assert await control.write_variable(number, value) == value
    elif what == 4:
        with control.watch("Q500", 500, 501) as watch:
            reading = await anext(watch)
            assert all(reading[number] == number for number in (500, 501) if number in reading)
    elif control.profile.synchronization is not None and (control.transfer is None or control.transfer.done()):
        transfer = control.receive_program()
        transfer.add_done_callback(lambda done: done.cancelled() or done.exception())
        if random.random() < 0.6:
            await table.press("send", "O00010", after_s=random.random())
        await transfer


async def use(table: Bench, random: Random) -> None:
    for _ in range(12):
        await asyncio.sleep(2 * random.random())
        with suppress(CompaxError, TimeoutError):
            async with asyncio.timeout(random.choice([0.2, 1, 10, 100])):
                await ask(table, random)


async def disturb(table: Bench, random: Random) -> None:
    far = table.far
    deeds: list[Callable[[], object]] = [
        table.lose_line,
        far.press_reset,
        far.cycle_start,
        far.cycle_stop,
        lambda: far.dprnt("Q100"),
        far.power_off,
    ]
    for _ in range(12):
        await asyncio.sleep(4 * random.random())
        deed = random.choice(deeds)
        deed()
        if deed == far.power_off:
            await asyncio.sleep(3 * random.random())
            far.power_on()


@pytest.mark.parametrize("form", PROFILES)
@pytest.mark.parametrize("seed", range(6))
async def test_no_answer_is_anothers_and_no_write_goes_out_twice(seed: int, form: str) -> None:
    complaints: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
    random = Random(seed)
    async with bench(
        PROFILES[form],
        settings=SETTINGS,
        seed=seed,
        data_collection=form,
        echo=random.choice(["on", "off"]) if form == "rs-232" else "off",
        write_answer=random.choice(["frame", "bare", "none"]),
        busy_answers=random.choice(["all", "q500"]),
        answer_time_s=random.choice([0, 0.05, 0.2]),
        late_s=random.choice([0.3, 0.7, 2.0]),
        first_request_lost=random.random() < 0.3,
        lose_reply=0.1,
        late_reply=0.15,
        double_reply=0.05,
    ) as table:
        table.far.memory.macros.update({number: float(number) for number in range(500, 700)})
        async with asyncio.timeout(5000):
            await asyncio.gather(disturb(table, random), *(use(table, Random(100 * seed + each)) for each in range(6)))
        asked = [entry.text.split(" after")[0].lstrip("?") for entry in table.far.log if entry.kind is LogKind.REQUEST]
        assert len(asked) > 20
        assert set(Counter(text for text in asked if text.startswith("E")).values()) <= {1}
    gc.collect()
    await asyncio.sleep(1)
    assert complaints == []
    assert asyncio.all_tasks() == {asyncio.current_task()}
