"""What goes wrong beside the line is told to whoever awaits the transfer, and the line can be used again."""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from tests.haas.bench import Bench, bench, ending, outcome, program_of, text_of
from tests.promises.bench import watch_what_is_left_behind

from compax_aio.errors import AnswerTimeoutError, UnexpectedAnswerError
from compax_aio.haas import line, sending
from compax_aio.haas.events import (
    DripFeedHeld,
    Overheard,
    Printed,
    ReaderOff,
    ReaderOn,
    TransferBegun,
    TransferEnded,
    VariableWritten,
)
from compax_aio.haas.profiles import CLASSIC_DC_CODES, CLASSIC_RTS_CTS
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfer import Received, TransferAccount
from compax_aio.transports.line_errors import LineErrors

PROGRAM = program_of(600)


@pytest.fixture(autouse=True)
async def nothing_left_behind() -> AsyncIterator[None]:
    """After the test no task is left over, and asyncio has nothing to complain about."""
    async with watch_what_is_left_behind():
        yield


async def _is_usable(b: Bench) -> bool:
    b.far.press_reset()
    await asyncio.sleep(1)
    b.far.memory.programs["O01234"] = PROGRAM
    received = await outcome(b.control.receive_program(on_operator=b.hand(("send", "O01234"))))
    return isinstance(received, Received) and text_of(received.data) == PROGRAM


# The port counts -----------------------------------------------------------------------------------------------------


def _counting(monkeypatch: pytest.MonkeyPatch, *counts: LineErrors | None) -> None:
    rest: Iterator[LineErrors | None] = iter(counts)
    monkeypatch.setattr(line, "line_errors_of", lambda _: next(rest))


async def test_damage_that_the_port_has_counted_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    async with bench() as b:
        b.far.memory.programs["O01234"] = PROGRAM
        _counting(monkeypatch, LineErrors(parity=3), LineErrors(parity=5, frame=1))
        error = await ending(b.control.receive_program(on_operator=b.hand(("send", "O01234"))))
        assert isinstance(error, UnexpectedAnswerError)
        assert "the port has counted 2 parity errors and 1 framing error" in error.what
        _counting(monkeypatch, LineErrors(parity=5), LineErrors(parity=5))
        received = await b.control.receive_program(on_operator=b.hand(("send", "O01234")))
        assert received.damage is not None
        assert not received.damage
        _counting(monkeypatch, LineErrors(), None)  # it went away
        received = await b.control.receive_program(on_operator=b.hand(("send", "O01234")))
        assert received.damage is None


# The operator --------------------------------------------------------------------------------------------------------


async def test_an_operator_that_fails_is_told() -> None:
    def operator(_: str) -> None:
        raise RuntimeError("no terminal")

    async with bench() as b:
        transfer = b.control.receive_program(on_operator=operator)
        with pytest.raises(RuntimeError, match="no terminal"):
            await transfer
        assert transfer.failure is None
        assert await _is_usable(b)


async def test_an_operator_that_fails_later_fails_what_waits_for_him(caplog: pytest.LogCaptureFixture) -> None:
    async def operator(_: str) -> None:
        await asyncio.sleep(1)
        raise EOFError

    async with bench(CLASSIC_RTS_CTS) as b:
        with pytest.raises(EOFError):
            await b.control.send_program(PROGRAM, on_operator=operator)
        assert b.far.received_bytes == 0
        with caplog.at_level(logging.WARNING, "compax_aio.haas"):
            error = await ending(b.control.receive_program(on_operator=operator, operator_timeout_s=5))
        assert isinstance(error, AnswerTimeoutError)
        assert "on_operator has failed: EOFError()" in caplog.text
        assert await _is_usable(b)


async def test_an_operator_who_is_asked_is_left_alone_when_the_transfer_is_over() -> None:
    was_cancelled = False

    async def operator(_: str) -> None:
        nonlocal was_cancelled
        try:
            await asyncio.Event().wait()
        finally:
            was_cancelled = True

    async with bench(CLASSIC_DC_CODES) as b:
        transfer = b.control.receive_program(on_operator=operator)
        await asyncio.sleep(1)
        b.far.press_send("O00010")
        await transfer
        await asyncio.sleep(0)
        assert was_cancelled


# Defects, and disks --------------------------------------------------------------------------------------------------


async def test_a_defect_here_is_told_and_lets_go_of_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sending, "verified_sent", lambda *_: 1 / 0)
    async with bench(CLASSIC_DC_CODES) as b:
        transfer = b.control.send_program(
            PROGRAM, verify=True, on_operator=b.hand(("recv", "programs"), ("send", "O01234"))
        )
        with pytest.raises(ZeroDivisionError):
            await transfer
        assert await _is_usable(b)


async def test_an_archive_that_cannot_be_closed_is_told_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(_: int) -> None:
        raise OSError(5, "Input/output error")

    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(3000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await asyncio.sleep(3)
        monkeypatch.setattr("compax_aio.haas.archive.Archive.leave", _fails)
        b.far.press_reset()
        error = await ending(transfer)
        assert isinstance(error, AnswerTimeoutError)
        assert "could not be closed" in caplog.text
        transfer_file = b.control._transferring._archive._file  # type: ignore[union-attr]
        assert transfer_file is not None
        transfer_file.close()
    assert os.path.exists(tmp_path / "a.nc.incomplete")  # noqa: ASYNC240, PTH110


async def _fails(_: object) -> None:
    raise OSError(5, "Input/output error")


# Questions that cannot be asked --------------------------------------------------------------------------------------


async def test_a_question_that_is_held_back_is_told() -> None:
    settings = ControlSettings(baud_rate=9600, silence_timeout_s=3)
    async with bench(data_collection="rs-232", settings=settings) as b:
        b.far.inject(b"\x13")
        await asyncio.sleep(1)
        with pytest.raises(AnswerTimeoutError, match="told to send nothing"):
            await b.control._line.ask("Q100")
        assert await b.control._line.ask("Q100") == "S/N, 1234567"


async def test_a_question_behind_one_that_was_not_answered_may_have_none_either() -> None:
    async with bench(data_collection="rs-232") as b:
        b.far.trouble.replies_to_lose = 2
        with pytest.raises(AnswerTimeoutError, match="no answer within"):
            await b.control._line.ask("Q500")
        with pytest.raises(AnswerTimeoutError, match="an earlier question is unanswered, and so is 'Q"):
            await b.control._line.ask("Q500")
        assert (await b.control._line.ask("Q500")).startswith("PROGRAM, ")


async def test_an_answer_that_is_none_is_told() -> None:
    async with bench(data_collection="rs-232") as b:
        b.far.trouble.replies_to_lose = 1
        asking = asyncio.ensure_future(b.control._line.ask("Q100"))
        await asyncio.sleep(0.5)
        b.far.inject(b"\x02WHAT, EVER\x17\r\n>")
        error = await ending(asking)
        assert isinstance(error, UnexpectedAnswerError)
        assert error.received == "WHAT, EVER"


# Events --------------------------------------------------------------------------------------------------------------


def test_every_event_has_a_mark() -> None:
    account = TransferAccount(kind="program", way="send", phase="over")
    marks = [
        event.as_mark()
        for event in (
            Printed("c", 0.0, "X 1.5"),
            Overheard("c", 0.0, "S/N, 1"),
            ReaderOn("c", 0.0),
            ReaderOff("c", 0.0),
            TransferBegun("c", 0.0, "program", "send"),
            TransferEnded("c", 0.0, "program", "send", "reached", account, None),
            TransferEnded("c", 0.0, "program", "send", "failed", account, UnexpectedAnswerError("damaged")),
            DripFeedHeld("c", 0.0, 100, 31.0),
            VariableWritten("c", 0.0, 500, None, 1.5),
        )
    ]
    assert [mark.word for mark in marks] == [
        "printed", "overheard", "reader on", "reader off", "accepted", "reached", "failed", "held", "variable written",
    ]  # fmt: skip
    assert marks[6].text == "damaged"
    assert str(account) == "nothing of the file was sent"
    assert (account.offset, account.line) == (0, 1)
