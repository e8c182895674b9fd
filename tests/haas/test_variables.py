"""A variable is written only where that is allowed, once at most, and what it reads afterwards decides."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import pytest
from tests.haas.bench import Bench, bench, ending, until

from compax_aio.errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    InvalidCommandError,
    UnexpectedAnswerError,
)
from compax_aio.haas.events import VariableWritten
from compax_aio.haas.profiles import CLASSIC_DC_CODES, DATA_COLLECTION, NEXT_GENERATION, Profile
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.haas import LogKind

ALLOWED: Final = ControlSettings(baud_rate=9600, writable=(range(100, 200), range(500, 540), range(3000, 3100)))
KNOBS: Final[dict[str, Any]] = {"data_collection": "rs-232"}


def writes(table: Bench) -> list[str]:
    return [entry.text for entry in table.far.log if entry.kind is LogKind.REQUEST and entry.text.lstrip("?")[0] == "E"]


@pytest.fixture
def record(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    """The log of writes."""
    with caplog.at_level(logging.INFO, logger="compax_aio.haas.writes"):
        yield caplog


def lines(record: pytest.LogCaptureFixture) -> list[str]:
    return [each.getMessage() for each in record.records if each.name == "compax_aio.haas.writes"]


@pytest.mark.parametrize(("profile", "form"), [(DATA_COLLECTION, "rs-232"), (NEXT_GENERATION, "ethernet")])
async def test_a_variable_is_written_read_back_and_put_on_record(
    profile: Profile, form: str, record: pytest.LogCaptureFixture
) -> None:
    async with bench(profile, settings=ALLOWED, data_collection=form, freeze_after=1) as table:
        events = table.control.events()
        table.far.memory.macros[500] = 1.0
        assert await table.control.write_variable(500, -2.5) == -2.5
        assert table.far.memory.macros[500] == -2.5
        written = await anext(events)
        assert isinstance(written, VariableWritten)
        assert (written.variable, written.before, written.value) == (500, 1.0, -2.5)
        assert lines(record) == ["c: #500 = -2.5 is written; it was 1", "c: #500 = -2.5 reads back so"]
        assert not table.far.is_frozen


async def test_a_whole_number_is_written_with_a_point() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        await table.control.write_variable(101, 7)
        assert [each.split(" after")[0] for each in writes(table)] == ["E101 7."]


async def test_nothing_is_written_by_default() -> None:
    async with bench(DATA_COLLECTION, settings=ControlSettings(baud_rate=9600), **KNOBS) as table:
        error = await ending(table.control.write_variable(500, 1))
        assert isinstance(error, InvalidCommandError)
        assert "none is, by default" in str(error)
        assert table.far.received_bytes == 0


@pytest.mark.parametrize(
    ("number", "value", "why"),
    [
        (540, 1, "allowed are 100 to 199, 500 to 539"),
        (150, 1, "protected"),
        (3000, 1, "protected"),
        (3027, 1, "can only be read"),
        (0, 1, "from 1 to"),
        ("x", 1, "number"),
        (500, "x", "must be a number"),
        (500, float("nan"), "finite"),
        (500, 1e7, "beyond"),
        (500, 1.00001, "round it: 1"),
    ],
)
async def test_what_may_not_be_written_is_refused_before_anything_is_sent(number: Any, value: Any, why: str) -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        error = await ending(table.control.write_variable(number, value))
        assert isinstance(error, InvalidCommandError)
        assert why in str(error)
        assert table.far.received_bytes == 0


async def test_what_cannot_be_read_before_is_not_written() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        table.far.trouble.replies_to_lose = 1
        assert isinstance(await ending(table.control.write_variable(500, 1)), AnswerTimeoutError)
        assert writes(table) == []


@pytest.mark.parametrize("answer", ["bare", "none"])
async def test_a_write_that_is_not_answered_is_decided_by_what_it_reads(
    answer: str, record: pytest.LogCaptureFixture
) -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, write_answer=answer, **KNOBS) as table:
        assert await table.control.write_variable(500, 3.5) == 3.5
        assert len(writes(table)) == 1
        assert "no answer within" in lines(record)[1]


async def test_a_write_whose_answer_is_lost_goes_out_once() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: len(table.far.gaps_s) == 1)
        await asyncio.sleep(0.04)
        table.far.trouble.replies_to_lose = 1
        assert await task == 3.5
        assert len(writes(table)) == 1


async def test_a_write_that_cannot_be_read_back_is_in_doubt(record: pytest.LogCaptureFixture) -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: bool(writes(table)))
        table.far.power_off()
        error = await ending(task)
        assert isinstance(error, AnswerTimeoutError)
        assert "whether variable #500 is 3.5 is in doubt: it was sent once" in str(error)
        assert "in doubt" in lines(record)[-1]


async def test_a_write_is_in_doubt_when_the_line_is_lost_for_good() -> None:
    async with bench(DATA_COLLECTION, settings=replace(ALLOWED, reconnect=False), **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: bool(writes(table)))
        table.lose_line()
        error = await ending(task)
        assert isinstance(error, ConnectionLostError | AnswerTimeoutError)
        assert "in doubt" in str(error)


async def test_a_write_that_was_under_way_when_the_line_was_lost_is_decided_on_the_next_one() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: bool(writes(table)))
        table.lose_line()
        assert await task == 3.5
        assert len(writes(table)) == 1


async def test_a_variable_that_the_control_does_not_let_be_written_is_told() -> None:
    settings = replace(ALLOWED, writable=(range(1000, 1010),))
    async with bench(DATA_COLLECTION, settings=settings, **KNOBS) as table:
        error = await ending(table.control.write_variable(1003, 3.5))
        assert isinstance(error, CommandRejectedError)
        assert "it reads 0, not 3.5" in str(error)


async def test_a_variable_that_reads_something_else_afterwards_is_told() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: bool(writes(table)))
        table.far.memory.macros[500] = 9.0
        error = await ending(task)
        assert isinstance(error, UnexpectedAnswerError)
        assert "it reads 9, not 3.5" in str(error)


async def test_a_write_that_a_garbled_answer_follows_is_decided_by_what_it_reads() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: len(table.far.gaps_s) == 1)
        await asyncio.sleep(0.04)
        table.far.trouble.replies_to_garble = 1
        assert await task == 3.5


async def test_a_write_that_could_not_be_sent_is_not_in_doubt(record: pytest.LogCaptureFixture) -> None:
    both = replace(CLASSIC_DC_CODES, data_collection="rs-232")
    async with bench(both, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: len(table.far.gaps_s) == 1)
        transfer = table.control.receive_program()
        error = await ending(task)
        assert "'E500 3.5' was not sent: a transfer is under way" in str(error)
        assert "was not sent" in lines(record)[-1]
        assert writes(table) == []
        transfer.cancel()
        with suppress(asyncio.CancelledError):
            await transfer


async def test_a_write_that_was_sent_is_carried_through_although_the_caller_is_cancelled(
    record: pytest.LogCaptureFixture,
) -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await until(lambda: len(table.far.gaps_s) == 1)
        await asyncio.sleep(0.06)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert table.far.memory.macros[500] == 3.5
        assert lines(record)[-1] == "c: #500 = 3.5 reads back so"


async def test_a_write_that_is_cancelled_before_it_is_sent_is_none(record: pytest.LogCaptureFixture) -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, **KNOBS) as table:
        task = asyncio.ensure_future(table.control.write_variable(500, 3.5))
        await asyncio.sleep(0.01)
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        await asyncio.sleep(5)
        assert writes(table) == []
        assert lines(record) == []


async def test_writes_go_one_after_the_other() -> None:
    async with bench(DATA_COLLECTION, settings=ALLOWED, freeze_after=1, **KNOBS) as table:
        results = await asyncio.gather(*(table.control.write_variable(500, float(value)) for value in range(6)))
        assert results == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
        assert not table.far.is_frozen
