"""What could go wrong without a word: questions in a program, lines left out, errors in no lines, files lost."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path

import pytest
from tests.haas.bench import bench, ending, program_of, until

from compax_aio.errors import AnswerTimeoutError, CommandRejectedError, InvalidCommandError
from compax_aio.haas.checking import check_bare_program
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM, Profile
from compax_aio.haas.receiving import read_file
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfer import Kind

# A program that was given up -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS])
async def test_no_question_goes_into_a_program_that_was_given_up(profile: Profile) -> None:
    async with bench(profile, settings=ControlSettings(writable=(range(500, 550),)), data_collection="rs-232") as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await asyncio.sleep(0.5)
        transfer.cancel()
        await asyncio.sleep(5)
        went = b.far.received_bytes
        with pytest.raises(AnswerTimeoutError, match="may take a question for the rest of it") as caught:
            await b.control.query("Q100")
        assert "reset_was_pressed()" in (caught.value.hint or "")
        with pytest.raises(AnswerTimeoutError, match="was not sent"):
            await b.control.write_variable(500, 1.0)
        async with b.control.watch("Q500", 3027, interval_s=2) as readings:
            reading = await anext(readings)
        assert {key: error.what.partition(":")[0] for key, error in reading.errors.items()} == {
            "Q500": "'Q500' was not sent",
            3027: "'Q600 3027' was not sent",
        }
        assert b.far.received_bytes == went
        b.far.press_reset()
        b.control.reset_was_pressed()
        assert await b.control.serial_number() == "1234567"


async def test_a_control_that_was_told_that_it_is_over_is_asked_at_once() -> None:
    async with bench(CLASSIC_XMODEM, data_collection="rs-232") as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(30_000))
        await until(lambda: transfer.account.bytes > 5000)
        transfer.cancel()
        with suppress(CommandRejectedError):  # the control may have taken the last CAN for the beginning of it
            await b.control.serial_number()
        assert await b.control.serial_number() == "1234567"


# What is given as bare text ------------------------------------------------------------------------------------------


async def test_errors_in_a_bare_text_are_told_by_its_own_lines() -> None:
    async with bench() as b:
        error = await ending(b.control.send_program("O01234\nG0 x1\nM30"))
        assert "line 2, column 4: error: 'x' is a small letter" in str(error)
        error = await ending(b.control.send_programs(["O01234\nM30", "O01235\nM30\nG0;"]))
        assert "line 3, column 3: error: a semicolon" in str(error)


async def test_errors_in_a_program_of_a_file_are_told_by_the_lines_of_that_file() -> None:
    file = parse_program_file("%\nO01234\nM30\nO01235\nG0 x1\nM30\n%\n")
    async with bench() as b:
        error = await ending(b.control.send_program(file.programs[1]))
        assert "line 5, column 4: error: 'x' is a small letter" in str(error)
    found = check_bare_program(file.programs[1], CLASSIC, for_dnc=False, protected=False, semicolons=False)
    assert [file.data[each.offset : each.offset + 1] for each in found] == [b"x"]


@pytest.mark.parametrize("text", ["%\nO01234\nM30\n%\nO01235\nM30\n", "%\nO01234\nM30\n%\n(LAST)"])
async def test_what_would_not_be_sent_because_it_stands_behind_the_last_percent_is_refused(text: str) -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        error = await ending(b.control.send_program(text))
        assert isinstance(error, InvalidCommandError)
        assert "behind the last %; they would not be sent" in str(error)
        error = await ending(b.control.send_offsets("%\nN1 V5\n%\nN2 V6\n"))
        assert isinstance(error, InvalidCommandError)
        assert "line 4, column 1: error: 6 bytes behind the last %" in str(error)
        assert b.far.received_bytes == 0


@pytest.mark.parametrize(
    ("kind", "data"),
    [("program", b"%\r\nO01234\r\nM30\r\n%\r\nHELLO\r\n"), ("offsets", b"%\r\nN1 V5\r\n%\r\nN2 V6\r\n")],
)
def test_what_came_behind_the_last_percent_is_told(kind: Kind, data: bytes) -> None:
    _, warnings = read_file(data, kind, CLASSIC)
    assert warnings == ("7 bytes came behind the last %, and are no part of it: to send it back, take them out",)


# Somebody else's file ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("was_there", [False, True])
async def test_a_file_that_comes_where_the_archive_was_to_be_is_left_as_it_is(tmp_path: Path, was_there: bool) -> None:
    place = tmp_path / "O00010.nc"
    if was_there:
        place.write_bytes(b"of yesterday")
    async with bench(CLASSIC_DC_CODES) as b:
        transfer = b.control.receive_program(archive=place)
        await asyncio.sleep(1)
        place.write_bytes(b"somebody else's")
        b.far.press_send("O00010")
        received = await transfer
    assert place.read_bytes() == b"somebody else's"
    assert received.archive == tmp_path / "O00010 2.nc"
    assert received.archive.read_bytes() == received.data
    (warning,) = received.warnings
    assert "meanwhile, and was left as it is: what was received is in" in warning


# The second look -----------------------------------------------------------------------------------------------------


async def test_of_a_program_that_is_not_sent_back_it_is_not_said_that_it_was_not_read() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        error = await ending(b.control.send_program("O01234\nM30", verify=True, operator_timeout_s=5))
        text = str(error)
        assert "did not send the program in time, when it was to send back what it had stored" in text
        assert "it was sent to its end before; 21 of 21 bytes have left" in text
        assert "press SEND" in text
        assert "RECV" not in text


async def test_of_a_program_that_does_not_come_twice_it_is_said_that_it_came_once() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        transfer = b.control.receive_program(verify=True, operator_timeout_s=5)
        await b.press("send", "O00010", after_s=1)
        assert "came to its end the first time" in str(await ending(transfer))


async def test_of_a_line_that_is_lost_at_the_second_look_it_is_said_that_all_was_sent() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        transfer = b.control.send_program("O01234\nM30", verify=True)
        await until(lambda: transfer.account.bytes == 21)
        await asyncio.sleep(10)
        b.lose_line()
        text = str(await ending(transfer))
        assert "it was sent to its end before" in text
        assert "waits for the rest" not in text
        assert not b.control._line.may_wait_for_rest


async def test_of_a_line_that_is_lost_in_the_middle_it_is_said_to_press_reset() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await until(lambda: transfer.account.bytes > 500)
        b.lose_line()
        assert "press RESET at the control, which waits for the rest" in str(await ending(transfer))
