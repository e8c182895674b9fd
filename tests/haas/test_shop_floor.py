"""What people do at a control, programs print and lines do meanwhile: it is told as what it is, and it ends."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import Any

import pytest
from tests.haas.bench import MODES, bench, ending, now, outcome, program_of, text_of, until
from tests.promises.bench import watch_what_is_left_behind

from compax_aio.errors import AnswerTimeoutError, UnexpectedAnswerError
from compax_aio.haas.events import Printed
from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfer import Received, Sent
from compax_aio.simulator.haas import SimulatedControl

PROGRAM = program_of(600)
LINE = "COUNT 12 X1.2345 Y2.3456 Z3.4567"


@pytest.fixture(autouse=True)
async def nothing_left_behind() -> AsyncIterator[None]:
    """After the test no task is left over, and asyncio has nothing to complain about."""
    async with watch_what_is_left_behind():
        yield


def _printed(events: Any) -> list[str]:
    return [each.text for each in events.take_waiting() if isinstance(each, Printed)]


# Programs that print -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
async def test_a_program_that_prints_while_send_is_waited_for_is_told_and_does_no_harm(mode: str) -> None:
    async with bench(MODES[mode]) as b:
        events = b.control.events()
        b.far.memory.programs["O01234"] = PROGRAM
        transfer = b.control.receive_program()
        for _ in range(20):
            await asyncio.sleep(3)
            b.far.dprnt(LINE)
        b.far.press_send("O01234")
        received = await outcome(transfer)
        assert isinstance(received, Received)
        assert text_of(received.data) == PROGRAM
        assert _printed(events) == [LINE] * 20


@pytest.mark.parametrize("mode", ["dc codes", "xmodem"])
async def test_a_program_that_prints_while_recv_is_waited_for_is_told_and_does_no_harm(mode: str) -> None:
    async with bench(MODES[mode]) as b:
        events = b.control.events()
        b.far.memory.programs.clear()
        transfer = b.control.send_program(PROGRAM)
        for _ in range(20):
            await asyncio.sleep(3)
            b.far.dprnt(LINE)
        b.far.press_recv()
        assert isinstance(await outcome(transfer), Sent)
        assert b.far.memory.programs["O01234"] == PROGRAM
        assert _printed(events) == [LINE] * 20


@pytest.mark.parametrize("profile", [CLASSIC, CLASSIC_DC_CODES])
async def test_what_a_program_prints_between_popen_and_pclos_is_no_file_that_fell_silent(profile: Any) -> None:
    async with bench(profile) as b:
        b.far.memory.programs["O01234"] = PROGRAM
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        b.far.popen()
        for _ in range(60):
            await asyncio.sleep(1)
            b.far.dprnt(LINE)
        b.far.pclos()
        assert not transfer.done()
        b.far.press_send("O01234")
        assert isinstance(await outcome(transfer), Received)


async def test_who_prints_again_and_again_does_not_put_off_the_end_of_the_wait_for_ever() -> None:
    async with bench() as b:
        begun_at = now()
        transfer = b.control.receive_program()
        while not transfer.done() and now() - begun_at < 10_000:
            await asyncio.sleep(20)
            b.far.popen()
            b.far.dprnt(LINE)
            b.far.pclos()
        error = await ending(transfer)
        assert isinstance(error, AnswerTimeoutError)
        assert "did not send the program in time" in error.what
        assert now() - begun_at < 600


async def test_signs_of_xmodem_behind_a_file_are_not_printed_by_the_next_program() -> None:
    async with bench(CLASSIC_XMODEM, baudrate=9600) as b:  # it asks twice, and ends with three CAN
        events = b.control.events()
        b.far.press_recv()
        assert isinstance(await outcome(b.control.send_program(PROGRAM)), Sent)
        b.far.inject(b"\x18\x15\x06\x04")
        b.far.dprnt(LINE)
        await asyncio.sleep(5)
        assert _printed(events) == [LINE]


# Another Setting 14 --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["rts/cts", "xon/xoff", "dc codes"])
async def test_a_control_that_sends_as_it_is_is_told_to_one_who_waits_for_xmodem(mode: str) -> None:
    async with bench(CLASSIC_XMODEM, synchronization=mode) as b:
        b.far.memory.programs["O01234"] = PROGRAM
        error = await ending(b.control.receive_program(on_operator=b.hand(("send", "O01234"))))
        assert isinstance(error, UnexpectedAnswerError)
        assert "by another synchronization than the profile 'classic xmodem' has" in error.what
        assert "Setting 14" in str(error.hint)
        assert now() < 30


@pytest.mark.parametrize("profile", [CLASSIC, CLASSIC_RTS_CTS])
async def test_a_control_that_waits_for_blocks_is_told_to_one_who_sends_as_it_is(profile: Any) -> None:
    async with bench(profile, synchronization="xmodem", data_bits=8, parity="none") as b:
        b.far.press_recv()
        sent = await b.control.send_program(program_of(3000))
        assert sent.proof == "left the line"
        assert any("NAK" in each and "XMODEM" in each for each in sent.warnings)


async def test_a_control_that_asks_for_blocks_and_never_says_reader_on_is_told() -> None:
    async with bench(CLASSIC_DC_CODES, synchronization="xmodem", data_bits=8, parity="none") as b:
        b.far.press_recv()
        error = await ending(b.control.send_program(PROGRAM))
        assert "as with XMODEM (Setting 14)" in error.what


# SEND too early ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [CLASSIC, CLASSIC_DC_CODES])
async def test_send_pressed_before_anybody_listened_is_told_from_a_control_that_fell_silent(profile: Any) -> None:
    async with bench(profile) as b:
        b.far.memory.programs["O01234"] = PROGRAM
        b.far.press_send("O01234")
        await asyncio.sleep(0.2)
        error = await ending(b.control.receive_program())
        assert "was SEND pressed before this listened" in error.what


# Signs in the middle -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [b"\x11", b"\x13", b"\x12", b"\x14", b"\0", b"\x7f"])
async def test_a_sign_in_the_middle_of_a_file_may_have_been_a_character_and_is_told(sign: bytes) -> None:
    file = b"%\r\nO01234\r\nG1 X" + sign + b".5\r\nM30\r\n%\r\n"
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        b.far.inject(file)
        received = await transfer
        assert received.data == file.replace(sign, b"")
        assert received.warnings[0].startswith("1 sign (NUL, DEL, DC1 to DC4) came inside the file, first at offset 15")


async def test_leader_around_a_file_is_no_sign_in_its_middle() -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        b.far.inject(b"\0" * 50 + b"\x7f\r\n%\r\nO01234\r\nM30\r\n%\r\n" + b"\0" * 50)
        assert (await transfer).warnings == ()


@pytest.mark.parametrize("odd", [b"\x02", b"\x17", b"\x07"])
async def test_bytes_that_no_program_has_are_told(odd: bytes) -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        b.far.inject(b"%\r\nO01234\r\nG1 X" + odd + b".5\r\nM30\r\n%\r\n")
        assert f"1 bytes in it are no text of a program: {odd.hex().upper()}" in (await transfer).warnings[0]


# Signs that are missing, or never end --------------------------------------------------------------------------------


async def test_a_dc4_that_does_not_come_is_told() -> None:
    async with bench(CLASSIC_DC_CODES, drop_dc4=True) as b:
        received = await b.control.receive_program(on_operator=b.hand(("send", "O00010")))
        assert received.proof == "silence after %"
        assert "has not said that this was all (DC4)" in received.warnings[0]


async def test_a_reader_that_goes_on_and_off_for_ever_is_not_waited_for_for_ever() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        transfer = b.control.send_program(PROGRAM)
        begun_at = now()
        while not transfer.done() and now() - begun_at < 1000:
            await asyncio.sleep(0.2)
            b.far.inject(b"\x13")
            await asyncio.sleep(0.2)
            b.far.inject(b"\x11")
        assert isinstance(await outcome(transfer), Sent)
        assert now() - begun_at < 100


@pytest.mark.parametrize(("takes_bytes_s", "room_at_the_end"), [(25, 0), (15, 18), (8, 18)])
async def test_a_stop_at_the_very_end_is_not_taken_for_the_sign_that_the_end_was_read(
    takes_bytes_s: int, room_at_the_end: int
) -> None:
    program = "O1\nG0X1.\n(A COMMENT)\n(ANOTHER COMMENT)\nM30"
    size = len(f"\n%\n{program}\n%\n".replace("\n", "\r\n"))
    slow: dict[str, Any] = {"take_bytes_s": takes_bytes_s, "hwm": size - room_at_the_end, "lwm": size // 2}
    async with bench(CLASSIC_DC_CODES, drop_dc3=True, **slow) as b:
        b.far.press_recv()
        sent = await b.control.send_program(program)
        assert sent.proof == "left the line"


async def test_blank_tape_without_end_behind_a_file_is_not_waited_for() -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        b.far.inject(b"%\r\nO01234\r\nM30\r\n%\r\n")
        begun_at = now()
        while not transfer.done() and now() - begun_at < 1000:
            await asyncio.sleep(0.5)
            b.far.inject(b"\r\n" * 100)
        assert isinstance(await outcome(transfer), Received)
        assert now() - begun_at < 100


async def test_blocks_that_are_all_taken_and_an_end_that_is_not_answered_are_told_as_that() -> None:
    settings = ControlSettings(baud_rate=9600)
    async with bench(replace(CLASSIC_XMODEM, baudrate=9600), settings=settings) as b:
        b.far.press_recv()
        transfer = b.control.send_program(PROGRAM)
        _drop_everything_when(b.far, lambda: transfer.account.blocks == 5)
        error = await ending(transfer)
        assert isinstance(error, AnswerTimeoutError)
        assert "has taken all of the program, and not acknowledged its end" in error.what
        assert "whether it is stored is not known" in str(error.hint)


def _drop_everything_when(far: SimulatedControl, condition: Any) -> None:
    """Take the power away as soon as *condition* holds."""
    loop = asyncio.get_running_loop()

    def look() -> None:
        if condition():
            far.power_off()
        else:
            loop.call_later(0.0005, look)

    look()


# A file that was not sent to its end ----------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [CLASSIC, CLASSIC_RTS_CTS])
async def test_who_sends_behind_a_file_that_was_given_up_is_told_that_the_control_may_take_it_for_the_rest(
    profile: Any,
) -> None:
    told: list[str] = []
    async with bench(profile) as b:
        b.far.memory.programs.clear()
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await asyncio.sleep(0.5)
        transfer.cancel()
        await asyncio.sleep(2)
        sent = await b.control.send_program(PROGRAM, on_operator=told.append)
        assert b.far.memory.programs["O01234"] != PROGRAM  # although its screen says RS232 DONE
        assert any("was not sent to its end" in each for each in sent.warnings)
        assert "press RESET first" in told[0]
        b.far.press_recv()
        sent = await b.control.send_program(PROGRAM, on_operator=told.append)
        assert b.far.memory.programs["O01234"] == PROGRAM
        assert sent.warnings == ()
        assert "RESET" not in told[1]


async def test_a_line_that_is_lost_and_a_file_that_comes_count_too() -> None:
    async with bench() as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await asyncio.sleep(0.5)
        b.lose_line()
        await ending(transfer)
        await until(lambda: b.control.is_open)
        b.far.press_reset()
        await asyncio.sleep(1)
        assert b.control._line.may_wait_for_rest
        await b.control.receive_program(on_operator=b.hand(("send", "O00010")))
        assert not b.control._line.may_wait_for_rest  # who sends does not wait


async def test_who_was_told_by_xmodem_waits_for_no_rest() -> None:
    async with bench(CLASSIC_XMODEM, baudrate=9600) as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await until(lambda: transfer.account.blocks > 2)
        transfer.cancel()
        await asyncio.sleep(2)
        b.far.press_recv()
        assert (await b.control.send_program(PROGRAM)).warnings == ()


# Wires ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("profile", "least", "most"), [(CLASSIC_RTS_CTS, 17, 64), (CLASSIC, 1, 16)])
async def test_with_wires_more_may_wait_to_leave_for_the_port_stops_between_two_bytes(
    profile: Any, least: int, most: int
) -> None:
    async with bench(profile) as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(2000))
        await until(lambda: transfer.account.bytes > 0)
        unsent = 0
        for _ in range(500):
            await asyncio.sleep(0.001)
            unsent = max(unsent, b.control._line.link.unsent_bytes)
        assert least <= unsent <= most
        assert isinstance(await outcome(transfer), Sent)
