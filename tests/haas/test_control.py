"""A control is connected to without a word, its files go both ways, and what goes wrong is told with its account."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.haas.bench import IN_BYTES, MODES, Bench, bench, ending, now, outcome, program_of, text_of, until
from tests.promises.bench import watch_what_is_left_behind

from compax_aio.errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    TransportError,
    UnexpectedAnswerError,
)
from compax_aio.haas.connecting import connect
from compax_aio.haas.events import (
    ConnectionLost,
    ConnectionRestored,
    Printed,
    ReaderOff,
    ReaderOn,
    TransferBegun,
    TransferEnded,
)
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM, NEXT_GENERATION
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfer import Received, Sent, TransferProgress

PROGRAM = program_of(600)
KINDS = ("parameters", "settings", "offsets", "macros")


@pytest.fixture(autouse=True)
async def nothing_left_behind() -> AsyncIterator[None]:
    """After the test no task is left over, and asyncio has nothing to complain about."""
    async with watch_what_is_left_behind():
        yield


def _receive(b: Bench, kind: str, **how: Any) -> Any:
    return getattr(b.control, f"receive_{kind}")(**how)


async def _received(b: Bench, text: str = PROGRAM, **how: Any) -> Any:
    b.far.memory.programs["O01234"] = text
    return await outcome(b.control.receive_program(on_operator=b.hand(*[("send", "O01234")] * 2), **how))


# Connecting ----------------------------------------------------------------------------------------------------------


async def test_nothing_is_sent_to_connect() -> None:
    async with bench() as b:
        assert b.control.is_open
        assert repr(b.control) == "<Control c classic open>"
        await asyncio.sleep(5)
        assert b.far.received_bytes == 0
    assert repr(b.control) == "<Control c classic closed>"


async def test_a_profile_may_be_named_and_must_be_one() -> None:
    with pytest.raises(InvalidCommandError, match="no profile"):
        connect("sim://haas", profile="fanuc")
    with pytest.raises(InvalidCommandError, match="a profile is one of"):
        connect("sim://haas", profile=7)  # type: ignore[arg-type]
    with pytest.raises(InvalidCommandError, match="settings are ControlSettings"):
        connect("sim://haas", settings={})  # type: ignore[arg-type]
    async with connect("sim://haas", profile="classic-dc-codes") as control:
        assert control.profile is CLASSIC_DC_CODES
        assert control.settings == ControlSettings()
        assert control.name == "sim://haas"
        assert control.transfer is None
    await control.close()


async def test_a_line_that_the_control_cannot_be_on_is_refused_before_it_is_opened() -> None:
    with pytest.raises(InvalidCommandError, match="DC1 and DC3"):
        await connect("serial:///dev/null?xonxoff=1")
    with pytest.raises(TransportError):
        await connect("loop://nobody-there")


async def test_who_enters_a_control_leaves_it_closed() -> None:
    async with await connect("sim://haas") as control:
        assert control.is_open
    assert not control.is_open


# Receiving -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
async def test_a_program_comes_whole(mode: str) -> None:
    async with bench(MODES[mode]) as b:
        received = await _received(b)
        assert isinstance(received, Received)
        assert text_of(received.data) == PROGRAM
        assert bytes(received) == received.data == bytes(received.file)
        assert (received.control, received.kind, received.verified, received.archive) == ("c", "program", None, None)
        assert received.proof == {"dc codes": "DC4 seen", "xmodem": "xmodem EOT"}.get(mode, "silence after %")
        assert received.duration_s > 0


async def test_all_programs_come_in_one_pair_of_percent_signs() -> None:
    async with bench() as b:
        b.far.memory.programs = {"O00001": program_of(100, number=1), "O00002": program_of(100, number=2)}
        received = await b.control.receive_programs(on_operator=b.hand(("send", "ALL")))
        assert received.file.numbers == (1, 2)  # type: ignore[union-attr]
        assert received.warnings == ()
        more = await b.control.receive_program(on_operator=b.hand(("send", "ALL")))
        assert "2 programs came, and one was expected" in more.warnings[0]


async def test_programs_in_pairs_of_their_own_are_told() -> None:
    async with bench(all_in="pairs") as b:
        received = await b.control.receive_programs(on_operator=b.hand(("send", "ALL")))
        assert len(received.file.numbers) == 3  # type: ignore[union-attr]
        assert "several pairs of %" in received.warnings[0]


@pytest.mark.parametrize("kind", KINDS)
async def test_numbered_data_come_as_what_they_are(kind: str) -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        received = await _receive(b, kind, on_operator=b.hand(("send", kind)))
        assert received.file.kind == kind
        assert received.file.had_n0 == (kind != "macros")
        assert received.file.had_n9999 == (kind == "macros")


async def test_what_is_of_another_kind_is_told() -> None:
    async with bench() as b:
        error = await ending(b.control.receive_settings(on_operator=b.hand(("send", "O00010"))))
        assert isinstance(error, UnexpectedAnswerError)
        assert "no file of settings" in error.what
        error = await ending(b.control.receive_program(on_operator=b.hand(("send", "settings"))))
        assert "there is no program with a name in it" in error.what
        error = await ending(b.control.receive_macros(on_operator=b.hand(("send", "settings"))))
        assert "no file of macros" in error.what


async def test_it_is_listened_for_at_once_and_until_the_operator_presses_send() -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(100)
        assert transfer.phase == "waiting for operator"
        b.far.press_send("O01234")
        assert isinstance(await outcome(transfer), Received)


async def test_nobody_presses_send() -> None:
    async with bench() as b:
        started = now()
        error = await ending(b.control.receive_program())
        assert isinstance(error, AnswerTimeoutError)
        assert now() - started == pytest.approx(120, abs=1)
        assert "did not send the program in time" in error.what
        assert error.hint is not None
        assert "press SEND" in error.hint
        assert "14 (synchronization)" in error.hint
        assert error.transfer.phase == "waiting for operator"  # type: ignore[attr-defined]
        assert str(error.transfer) == "nothing of the file came"  # type: ignore[attr-defined]
        started = now()
        await ending(b.control.receive_program(operator_timeout_s=5))
        assert now() - started == pytest.approx(5, abs=1)


async def test_a_control_that_falls_silent_in_the_middle_is_told(tmp_path: Path) -> None:
    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(4000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc")
        await b.press("send", "O01234", after_s=1)
        await asyncio.sleep(2)
        b.far.press_reset()
        error = await ending(transfer)
        assert isinstance(error, AnswerTimeoutError)
        assert "fallen silent in the middle of the program" in error.what
        account = error.transfer  # type: ignore[attr-defined]
        assert 500 < account.bytes < 3000
        assert account.line == account.lines + 1 > 10
        assert account.archive == tmp_path / "a.nc.incomplete"
        assert account.archive.stat().st_size == account.bytes
        assert any("a.nc.incomplete" in note for note in error.__notes__)
        assert not (tmp_path / "a.nc").exists()


async def test_more_than_is_to_be_received_is_not_received(tmp_path: Path) -> None:
    settings = ControlSettings(max_bytes=1000, baud_rate=9600)
    for profile in (CLASSIC, CLASSIC_XMODEM):
        async with bench(profile, settings=settings) as b:
            error = await _received(b, program_of(5000), archive=tmp_path / "a.nc")
            assert isinstance(error, UnexpectedAnswerError)
            assert "more bytes than are to be received" in error.what
            assert error.transfer.archive.stat().st_size <= 1000  # type: ignore[attr-defined]


# Archives ------------------------------------------------------------------------------------------------------------


async def test_what_comes_is_kept(tmp_path: Path) -> None:
    async with bench(CLASSIC_XMODEM) as b:
        received = await _received(b, archive=tmp_path / "part.nc")
        assert received.archive == tmp_path / "part.nc"
        assert received.archive.read_bytes() == received.data
        received = await _received(b, archive=tmp_path)
        assert received.archive.name.startswith("O01234 ")
        assert b.control.transfer is not None
        assert b.control.transfer.account.archive == received.archive


async def test_an_archive_that_cannot_be_is_told_before_anybody_goes_to_the_control(tmp_path: Path) -> None:
    async with bench() as b:
        error = await ending(b.control.receive_program(archive=tmp_path / "no" / "a.nc"))
        assert isinstance(error, InvalidCommandError)
        assert now() < 10
        with pytest.raises(InvalidCommandError, match="archive is the path"):
            b.control.receive_program(archive=7)  # type: ignore[arg-type]
        (tmp_path / "file").touch()
        error = await ending(b.control.receive_program(archive=tmp_path / "file" / "a.nc"))
        assert isinstance(error, InvalidCommandError)


async def test_a_disk_that_is_full_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("compax_aio.haas.archive.Archive._append", full)
    async with bench() as b:
        error = await _received(b, archive=tmp_path / "a.nc")
        assert isinstance(error, InvalidCommandError)
        assert "No space left" in error.what
        assert text_of(error.data) == PROGRAM  # type: ignore[attr-defined]


async def test_no_file_is_left_where_nothing_came(tmp_path: Path) -> None:
    async with bench() as b:
        await ending(b.control.receive_program(archive=tmp_path / "a.nc", operator_timeout_s=1))
    assert os.listdir(tmp_path) == []  # noqa: PTH208


# Sending -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
async def test_a_program_is_sent_whole_and_never_said_to_be_stored(mode: str) -> None:
    profile = MODES[mode]
    async with bench(profile) as b:
        b.far.memory.programs.clear()
        b.far.press_recv()
        sent = await outcome(b.control.send_program(PROGRAM))
        assert isinstance(sent, Sent)
        assert b.far.memory.programs == {"O01234": PROGRAM}
        assert b.far.screen == "RS232 DONE"
        assert sent.proof == {"dc codes": "reader off seen", "xmodem": "xmodem acknowledged"}.get(mode, "left the line")
        assert "RS232 DONE or RS232 ABORT" in sent.only_on_screen
        assert "stored" not in sent.proof
        assert sent.blocks == (5 if mode == "xmodem" else 0)
        assert sent.warnings == ()


async def test_a_program_is_wrapped_and_named_as_the_control_has_it() -> None:
    async with bench(replace(CLASSIC_DC_CODES, o_digits=4), o_digits=4) as b:
        b.far.press_recv()
        sent = await b.control.send_program("%\nO77\nM30\n%\n")
        assert b.far.memory.programs["O00077"] == "O00077\nM30" or "O0077\nM30" in b.far.memory.programs["O00077"]
        assert sent.lines == 5


async def test_several_programs_go_in_one_pair_of_percent_signs(tmp_path: Path) -> None:
    one, two, both = program_of(50, number=1), program_of(50, number=2), tmp_path / "both.nc"
    both.write_text(f"%\n{program_of(50, number=3)}\n{program_of(50, number=4)}\n%\n", encoding="ascii")
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.memory.programs.clear()
        b.far.press_recv()
        await b.control.send_programs([one, two, parse_program_file(both.read_bytes()).programs[0]])
        assert set(b.far.memory.programs) == {"O00001", "O00002", "O00003"}
        b.far.press_recv()
        await b.control.send_programs(both)
        assert set(b.far.memory.programs) == {"O00001", "O00002", "O00003", "O00004"}
        error = await ending(b.control.send_programs([one, one]))
        assert "program 1 is given twice" in error.what
        with pytest.raises(InvalidCommandError, match="programs are several"):
            b.control.send_programs(7)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("program", "what"),
    [
        ("M30", "without the name"),
        ("O8123\nM30", "protected"),
        ("O1234\nG0;X1\nM30", "semicolon"),
        ("O1234\nG0 x1\nM30", "small letter"),
        ("%\nO1234\nM30\n", "does not end with %"),
        ("O1234\n(ä)\nM30", "no 7-bit ASCII"),
        (b"O1234\n(\xe4)\nM30", "no 7-bit ASCII"),
        (b"O1234\n\x13\nM30", "DC3"),
        ("", "no program"),
        ("O1\nM30\nO2\nM30", "use send_programs"),
        (7, "a file, text, bytes or a path"),
        (Path("/no/such/file.nc"), "No such file"),
        (Path("/"), "directory"),
    ],
)
async def test_a_program_with_errors_is_refused_before_a_byte_is_sent(program: Any, what: str) -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        transfer = b.control.send_program(program)
        error = await ending(transfer)
        assert isinstance(error, InvalidCommandError)
        assert what in str(error)
        assert error.transfer.bytes == 0  # type: ignore[attr-defined]
        assert transfer.failure is error
        assert b.far.received_bytes == 0


async def test_what_is_meant_is_sent_all_the_same() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv()
        sent = await b.control.send_program("O8123\nG0;\nM30", protected=True, semicolons=True)
        assert "O08123" in b.far.memory.programs
        assert any("protected" in each for each in sent.warnings)


async def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text(program_of(2000), encoding="ascii")
    async with bench(settings=ControlSettings(max_bytes=1000, baud_rate=9600)) as b:
        for each in (program_of(2000), tmp_path / "a.nc", parse_program_file(program_of(2000))):
            error = await ending(b.control.send_program(each))
            assert "1000" in error.what
        assert b.far.received_bytes == 0


async def test_a_control_that_says_nothing_is_sent_to_when_the_operator_has_said_that_it_is_ready() -> None:
    async with bench(CLASSIC_RTS_CTS) as b:
        b.far.memory.programs.clear()
        told: list[str] = []

        async def operator(what: str) -> None:
            told.append(what)
            await asyncio.sleep(30)
            b.far.press_recv()

        transfer = b.control.send_program(PROGRAM, on_operator=operator)
        await asyncio.sleep(20)
        assert transfer.phase == "waiting for operator"
        assert b.far.received_bytes == 0
        await transfer
        assert told == ["at the control, show the list of programs and press RECV"]
        assert b.far.memory.programs == {"O01234": PROGRAM}


async def test_an_operator_who_never_says_so_is_not_waited_for_for_ever() -> None:
    async with bench(CLASSIC_RTS_CTS) as b:

        async def operator(_: str) -> None:
            await asyncio.Event().wait()

        error = await ending(b.control.send_program(PROGRAM, on_operator=operator, operator_timeout_s=10))
        assert isinstance(error, AnswerTimeoutError)
        assert b.far.received_bytes == 0


async def test_with_xon_the_first_xon_may_be_waited_for() -> None:
    async with bench(replace(CLASSIC, sends_xon=True), xon_at_start=True) as b:
        b.far.memory.programs.clear()
        sent = await b.control.send_program(PROGRAM, on_operator=b.hand(("recv", "programs")))
        assert isinstance(sent, Sent)
        assert b.far.memory.programs == {"O01234": PROGRAM}


async def test_nobody_presses_recv() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        error = await ending(b.control.send_program(PROGRAM))
        assert isinstance(error, AnswerTimeoutError)
        assert "was not ready to read the program in time" in error.what
        assert "press RECV" in str(error)
        assert b.far.received_bytes == 0


async def test_a_control_that_never_goes_on_is_told() -> None:
    async with bench(take_bytes_s=100, hwm=50, lwm=10) as b:
        b.far.press_recv()
        b.far.trouble.xons_to_lose = 1
        error = await ending(b.control.send_program(program_of(2000)))
        assert isinstance(error, AnswerTimeoutError)
        assert "told to stop (Xoff) and never to go on" in error.what
        assert 50 <= error.transfer.bytes < 200  # type: ignore[attr-defined]
        assert error.transfer.hold_offsets  # type: ignore[attr-defined]


async def test_what_leaves_after_xoff_is_counted() -> None:
    async with bench(take_bytes_s=200) as b:
        b.far.memory.programs.clear()
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        seen = [each async for each in transfer.progress()]
        sent = await transfer
        assert sent.held_s > 1
        assert sent.bytes_after_xoff > 0
        assert "left after the control had said stop" in sent.warnings[0]
        assert "held" in {each.phase for each in seen}
        assert b.far.memory.programs["O01234"] == program_of(3000)
        assert not b.far.alarms


async def test_a_dc3_that_does_not_come_is_told() -> None:
    async with bench(CLASSIC_DC_CODES, drop_dc3=True) as b:
        b.far.press_recv()
        sent = await b.control.send_program(PROGRAM)
        assert sent.proof == "left the line"
        assert "has not said that it has read the last % (DC3)" in sent.warnings[0]


async def test_a_control_that_cancels_is_told() -> None:
    async with bench(CLASSIC_XMODEM) as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(5000))
        await until(lambda: transfer.account.blocks > 5)
        b.far.press_reset()
        error = await ending(transfer)
        assert isinstance(error, CommandRejectedError)
        assert "the control has cancelled the transfer (CAN)" in error.what
        assert error.transfer.blocks > 5  # type: ignore[attr-defined]


async def test_wires_that_hold_the_line_for_ever_are_told() -> None:
    async with bench(CLASSIC_RTS_CTS, take_bytes_s=1) as b:
        b.far.press_recv()
        error = await ending(b.control.send_program(program_of(20_000), silence_timeout_s=5))
        assert isinstance(error, AnswerTimeoutError)
        assert "does not leave the line" in error.what


# Numbered data -------------------------------------------------------------------------------------------------------


async def test_parameters_are_sent_byte_for_byte_and_only_if_it_is_said_that_this_is_meant() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        received = await b.control.receive_parameters(on_operator=b.hand(("send", "parameters")))
        error = await ending(b.control.send_parameters(received.data))
        assert isinstance(error, InvalidCommandError)
        assert error.hint is not None
        assert "i_know_it_takes_effect=True" in error.hint
        assert "alarm" in error.hint
        before = dict(b.far.memory.parameters)
        b.far.memory.parameters.clear()
        b.far.memory.parameters.update(dict.fromkeys(before, "0"))
        b.far.press_recv("parameters")
        sent = await b.control.send_parameters(received.file, i_know_it_takes_effect=True)  # type: ignore[arg-type]
        assert b.far.memory.parameters == before
        assert not b.far.alarms
        assert "data are loaded even where there is an alarm" in sent.only_on_screen


async def test_parameters_without_n0_are_refused() -> None:
    async with bench() as b:
        error = await ending(b.control.send_parameters("%\nN1 V100\n%\n", i_know_it_takes_effect=True))
        assert "N0" in error.what
        assert b.far.received_bytes == 0


async def test_edited_settings_go_without_their_n0(tmp_path: Path) -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        received = await b.control.receive_settings(on_operator=b.hand(("send", "settings")))
        edited = received.file.with_values({9: 1})  # type: ignore[union-attr]
        assert not edited.had_n0
        (tmp_path / "settings.txt").write_bytes(bytes(edited))
        for each in (edited, tmp_path / "settings.txt"):
            b.far.memory.settings[9] = "0"
            b.far.press_recv("settings")
            await b.control.send_settings(each)
            assert b.far.memory.settings[9] == "1"
        assert not b.far.alarms


async def test_offsets_and_macros_are_sent() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        b.far.press_recv("offsets")
        await b.control.send_offsets("%\nN1 V0.5\n%")
        assert float(b.far.memory.offsets[1]) == 0.5
        error = await ending(b.control.send_macros("%\nN101 V3.5\n%\n"))
        assert "N9999" in error.what
        b.far.press_recv("macros")
        sent = await b.control.send_macros("%\nN101 V3.5\n%\n", force=True)
        assert any("N9999" in each for each in sent.warnings)
        assert b.far.memory.macros[101] == 3.5


async def test_data_of_another_kind_are_refused() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        received = await b.control.receive_offsets(on_operator=b.hand(("send", "offsets")))
        error = await ending(b.control.send_settings(received.file))  # type: ignore[arg-type]
        assert "a file of offsets, and no file of settings" in error.what
        error = await ending(b.control.send_settings(b"%\n\x12N1 V1\n%\n"))
        assert "12 (hexadecimal)" in error.what


# DNC -----------------------------------------------------------------------------------------------------------------


async def test_a_program_is_fed_while_it_runs() -> None:
    async with bench(dnc_block_s=0.5, look_ahead=3) as b:
        b.far.press_dnc()
        transfer = b.control.drip_feed(program_of(2000))
        seen = [each async for each in transfer.progress()]
        sent = await transfer
        assert (sent.kind, sent.proof) == ("drip feed", "left the line")
        assert "O01234" in b.far.memory.programs  # as before
        assert max(each.held_s for each in seen) > 5
        assert sent.duration_s > 20


async def test_line_numbers_that_crash_a_control_are_not_fed() -> None:
    async with bench() as b:
        error = await ending(b.control.drip_feed("N100001 G0\nM30"))
        assert "100001" in error.what
        assert b.far.received_bytes == 0


async def test_nobody_has_seen_a_drip_feed_with_xmodem() -> None:
    async with bench(CLASSIC_XMODEM) as b:
        error = await ending(b.control.drip_feed("G0\nM30"))
        assert isinstance(error, InvalidCommandError)
        assert "XMODEM" in error.what


# Damage --------------------------------------------------------------------------------------------------------------


async def test_damage_is_found_at_its_place_where_the_parity_bit_is_in_the_bytes(tmp_path: Path) -> None:
    async with bench(IN_BYTES) as b:
        b.far.trouble.spoil_sent_byte(100)
        error = await _received(b, archive=tmp_path / "a.nc")
        assert isinstance(error, UnexpectedAnswerError)
        assert "1 byte cannot be right, at offset 100" in error.what
        assert error.transfer.damage_offsets == (100,)  # type: ignore[attr-defined]
        assert (tmp_path / "a.nc.incomplete").exists()
        received = await _received(b)
        assert received.damage is not None
        assert not received.damage
        assert str(received.damage) == "no damage was seen"


async def test_what_is_damaged_can_be_had_all_the_same() -> None:
    async with bench(IN_BYTES) as b:
        b.far.trouble.spoil_sent_byte(300)
        received = await _received(b, accept_damaged=True)
        assert isinstance(received, Received)
        assert received.damage
        assert received.damage.places == (300,)


async def test_where_nobody_tells_damage_that_is_said_to_be_unknown() -> None:
    async with bench() as b:
        received = await _received(b)
        assert received.damage is None
    async with bench(CLASSIC_XMODEM) as b:
        received = await _received(b)
        assert received.damage is not None


async def test_a_file_without_its_last_percent_sign_is_not_taken_for_whole() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        for accepts in (False, True):
            transfer = b.control.receive_program(accept_damaged=accepts)
            await asyncio.sleep(1)
            b.far.inject(b"\x12%\r\nO1\r\nM30\r\n\x14")
            result = await outcome(transfer)
            assert isinstance(result, Received) is accepts
            if not accepts:
                assert "does not end with %" in result.what


# One at a time, and its end ------------------------------------------------------------------------------------------


async def test_a_second_transfer_is_refused_while_one_is_under_way() -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        with pytest.raises(InvalidCommandError, match="receive program is under way"):
            b.control.send_program(PROGRAM)
        with pytest.raises(InvalidCommandError, match="receiving the settings was not begun"):
            b.control.receive_settings()
        await asyncio.sleep(1)
        b.far.press_send("O01234")
        assert isinstance(await outcome(transfer), Received)


async def test_no_files_go_over_a_line_without_synchronisation() -> None:
    async with bench(NEXT_GENERATION, data_collection="ethernet") as b:
        with pytest.raises(InvalidCommandError, match="no synchronization"):
            b.control.receive_program()


@pytest.mark.parametrize(
    "how",
    [
        {"verify": 1},
        {"accept_damaged": "yes"},
        {"operator_timeout_s": 0},
        {"silence_timeout_s": "1"},
        {"on_operator": "print"},
    ],
)
async def test_what_means_nothing_is_refused_at_once(how: Any) -> None:
    async with bench() as b:
        with pytest.raises(InvalidCommandError, match=next(iter(how))):
            b.control.receive_program(**how)
        with pytest.raises(TypeError):
            b.control.receive_program(speed=1)  # type: ignore[call-arg]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("after_s", [0.0, 0.001, 0.1, 1.2, 2.0])
async def test_who_cancels_a_receive_can_use_the_line_again(mode: str, after_s: float, tmp_path: Path) -> None:
    async with bench(MODES[mode], baudrate=9600) as b:
        b.far.memory.programs["O01234"] = program_of(3000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await asyncio.sleep(after_s)
        assert transfer.cancel()
        assert not transfer.cancel()
        with pytest.raises(asyncio.CancelledError):
            await transfer
        await asyncio.sleep(2)
        b.far.press_reset()
        await asyncio.sleep(1)
        assert transfer.account.bytes < 3000
        assert isinstance(await _received(b), Received)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("after_s", [0.0, 0.001, 0.1, 1.0])
async def test_who_cancels_a_send_can_use_the_line_again(mode: str, after_s: float) -> None:
    async with bench(MODES[mode], baudrate=9600) as b:
        b.far.memory.programs.clear()
        b.far.press_recv()
        transfer = b.control.send_program(program_of(5000))
        await asyncio.sleep(after_s)
        transfer.cancel()
        with pytest.raises(asyncio.CancelledError):
            await transfer
        await asyncio.sleep(0.1)
        came = b.far.received_bytes
        await asyncio.sleep(5)
        assert b.far.received_bytes == came
        assert transfer.account.bytes <= came
        b.far.press_reset()
        await asyncio.sleep(1)
        b.far.press_recv()
        assert isinstance(await outcome(b.control.send_program(PROGRAM)), Sent)
        assert b.far.memory.programs["O01234"] == PROGRAM


@pytest.mark.parametrize("way", ["receive", "send"])
@pytest.mark.parametrize("mode", MODES)
async def test_cancelling_is_safe_at_every_step(mode: str, way: str, tmp_path: Path) -> None:
    text = program_of(60)
    settings = ControlSettings(tail_s=0.1, quiet_s=0.05, block_timeout_s=0.05)
    async with bench(MODES[mode], baudrate=0, settings=settings, nak_every_s=0.05) as b:
        steps, is_through = 0, False
        while not is_through:
            b.far.memory.programs["O01234"] = text
            if way == "receive":
                transfer: Any = b.control.receive_program(archive=tmp_path / "a.nc")
                asyncio.get_running_loop().call_later(0.1, b.far.press_send, "O01234")
            else:
                b.far.press_recv()
                transfer = b.control.send_program(text)
            for _ in range(steps):
                await _one_step()
            is_through = transfer.done()
            transfer.cancel()
            await asyncio.wait([transfer])
            await asyncio.sleep(1)
            b.far.press_reset()
            steps += 1
            await asyncio.sleep(1)
        assert steps > 10
        assert isinstance(await _received(b), Received)


async def _one_step() -> None:
    """Let the event loop run once, or as long as it waits for the next timer."""
    loop = asyncio.get_running_loop()
    before = loop.time()
    await asyncio.sleep(0)
    if loop.time() == before:
        await asyncio.sleep(0.002)


async def test_leaving_the_block_cancels_what_is_under_way() -> None:
    async with bench() as b:
        async with b.control as control:
            transfer = control.receive_program()
            await asyncio.sleep(1)
        assert transfer.cancelled()
        assert not b.control.is_open
        error = await ending(b.control.receive_program())
        assert isinstance(error, ConnectionLostError)


async def test_a_transfer_begins_when_the_one_before_has_let_go_of_its_archive(tmp_path: Path) -> None:
    async with bench() as b:
        for _ in range(3):
            transfer = b.control.receive_program(archive=tmp_path / "a.nc")
            await asyncio.sleep(1)
            assert transfer.account.archive == tmp_path / "a.nc.incomplete"
            transfer.cancel()
        received = await _received(b, archive=tmp_path / "a.nc")
        assert received.archive == tmp_path / "a.nc"
        assert os.listdir(tmp_path) == ["a.nc"]  # noqa: PTH208


async def test_a_loop_that_ends_ends_the_transfer() -> None:
    async with bench() as b:
        transfer = b.control.receive_program()
        await asyncio.sleep(1)
        task = next(each for each in asyncio.all_tasks() if each.get_name() == "c: receive program")
        task.cancel()
        await asyncio.wait([task])
        assert transfer.cancelled()
        await asyncio.sleep(1)
        assert isinstance(await _received(b), Received)


@pytest.mark.parametrize("mode", MODES)
async def test_a_lost_line_ends_the_transfer_and_comes_back(mode: str, tmp_path: Path) -> None:
    async with bench(MODES[mode], baudrate=9600) as b:
        events = b.control.events()
        b.far.memory.programs["O01234"] = program_of(3000)
        transfer = b.control.receive_program(archive=tmp_path / "a.nc", on_operator=b.hand(("send", "O01234")))
        await until(lambda: transfer.account.bytes > 500)
        b.lose_line()
        error = await ending(transfer)
        assert isinstance(error, ConnectionLostError)
        assert "never resumed" in str(error)
        assert 500 < error.transfer.bytes < 3000  # type: ignore[attr-defined]
        assert (tmp_path / "a.nc.incomplete").stat().st_size == error.transfer.bytes  # type: ignore[attr-defined]
        await until(lambda: b.control.is_open)
        b.far.press_reset()
        await asyncio.sleep(5)
        assert isinstance(await _received(b), Received)
        kinds = [type(each) for each in events.take_waiting()]
        for kind in (TransferBegun, ConnectionLost, TransferEnded, ConnectionRestored):
            assert kind in kinds


async def test_a_lost_line_ends_what_is_sent_and_nothing_is_sent_again() -> None:
    async with bench() as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        await asyncio.sleep(1)
        b.lose_line()
        error = await ending(transfer)
        assert isinstance(error, ConnectionLostError)
        await asyncio.sleep(1)
        came = b.far.received_bytes
        await until(lambda: b.control.is_open)
        await asyncio.sleep(10)
        assert b.far.received_bytes == came


async def test_a_line_that_never_falls_silent_is_told() -> None:
    async with bench(CLASSIC_XMODEM, data_collection="rs-232") as b:
        babble = asyncio.ensure_future(_babble(b))
        error = await ending(b.control.send_program(PROGRAM))
        babble.cancel()
        assert isinstance(error, AnswerTimeoutError | UnexpectedAnswerError)
        assert "never stops sending" in error.what or "looks like" in error.what
        assert error.transfer.bytes == 0  # type: ignore[union-attr]


async def _babble(b: Bench) -> None:
    while True:
        b.far.inject(b"NOISE" * 20)
        await asyncio.sleep(0.02)


# Watching ------------------------------------------------------------------------------------------------------------


async def test_progress_tells_what_to_do_and_how_far_it_is() -> None:
    async with bench() as b:
        b.far.memory.programs["O01234"] = program_of(3000)
        transfer = b.control.receive_program(on_operator=b.hand(("send", "O01234")))
        seen: list[TransferProgress] = [each async for each in transfer.progress()]
        received = await transfer
        phases = [each.phase for each in seen]
        assert list(dict.fromkeys(phases)) == ["starting", "waiting for operator", "under way", "ending", "over"]
        assert seen[1].operator == "at the control, choose the program and press SEND"
        assert seen[-1].operator is None
        sizes = [each.bytes for each in seen]
        assert sizes == sorted(sizes)
        assert sizes[-1] == len(received.data)
        assert seen[-1].elapsed_s > 3
        assert len(seen) > 10
        with pytest.raises(InvalidCommandError, match="interval_s"):
            await anext(transfer.progress(interval_s=-1))


async def test_progress_of_what_is_sent_knows_how_much_there_is() -> None:
    async with bench() as b:
        b.far.press_recv()
        transfer = b.control.send_program(program_of(3000))
        seen = [each async for each in transfer.progress(interval_s=0.5)]
        sent = await transfer
        assert {each.total_bytes for each in seen[1:]} == {sent.bytes}
        sizes = [each.bytes for each in seen]
        assert sizes == sorted(sizes)
        assert len(set(sizes)) >= 6  # three and a half seconds
        assert seen[-1].bytes == sent.bytes


async def test_progress_ends_with_a_transfer_that_fails() -> None:
    async with bench() as b:
        transfer = b.control.receive_program(operator_timeout_s=2)
        assert [each.phase async for each in transfer.progress()][-1] == "over"
        assert isinstance(await outcome(transfer), CompaxError)


async def test_what_happens_is_told() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        events = b.control.events()
        b.far.press_recv()
        await asyncio.sleep(1)
        b.far.press_reset()
        b.far.dprnt("X*1.5")
        await asyncio.sleep(1)
        await _received(b)
        await ending(b.control.receive_program(operator_timeout_s=1))
        b.control.receive_program().cancel()
        await asyncio.sleep(1)
        told = events.take_waiting()
        assert [each.text for each in told if isinstance(each, Printed)] == ["X 1.5"]
        assert any(isinstance(each, ReaderOn) for each in told)
        ended = [each for each in told if isinstance(each, TransferEnded)]
        assert [each.outcome for each in ended] == ["reached", "out of time", "cancelled"]
        assert ended[1].error is not None
        assert all(each.as_mark().word for each in told)
        assert ReaderOff("c", 0.0).as_mark().word == "reader off"


# Looking twice -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
async def test_what_was_received_is_received_again_and_compared(mode: str) -> None:
    async with bench(MODES[mode]) as b:
        told: list[str] = []
        hand = b.hand(("send", "O01234"), ("send", "O01234"))
        b.far.memory.programs["O01234"] = PROGRAM

        def operator(what: str) -> None:
            told.append(what)
            hand(what)

        received = await b.control.receive_program(verify=True, on_operator=operator)
        assert received.verified is not None
        assert received.verified.equal == "byte for byte"
        assert told[1].endswith("once more, to be compared")


async def test_what_differs_the_second_time_is_told(tmp_path: Path) -> None:
    async with bench() as b:
        b.far.trouble.spoil_sent_byte(900)
        error = await _received(b, verify=True, archive=tmp_path / "a.nc")
        assert isinstance(error, UnexpectedAnswerError)
        assert "came twice, and not the same" in error.what
        assert not error.verified  # type: ignore[attr-defined]
        assert not (tmp_path / "a.nc").exists()


@pytest.mark.parametrize("mode", MODES)
async def test_what_was_sent_is_read_back_and_compared(mode: str) -> None:
    profile = MODES[mode]
    async with bench(profile) as b:
        b.far.memory.programs.clear()
        transfer = b.control.send_program(PROGRAM, verify=True)
        await b.press("recv", after_s=0.0)
        await until(lambda: transfer.phase == "waiting for operator" and b.far.screen == "RS232 DONE")
        await b.press("send", "O01234", after_s=1)
        sent = await transfer
        assert sent.proof == "read back equal"
        assert sent.verified is not None
        assert sent.verified.equal in {"byte for byte", "in content"}
        assert "stored" not in sent.only_on_screen


async def test_a_control_that_writes_spaces_has_stored_the_same() -> None:
    async with bench(CLASSIC_DC_CODES, add_spaces="on") as b:
        sent = await b.control.send_program(
            PROGRAM, verify=True, on_operator=b.hand(("recv", "programs"), ("send", "O01234"))
        )
        assert sent.verified is not None
        assert sent.verified.equal == "in content"


async def test_what_the_control_has_stored_otherwise_is_told() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        transfer = b.control.send_program(
            PROGRAM, verify=True, on_operator=b.hand(("recv", "programs"), ("send", "O00010"))
        )
        error = await ending(transfer)
        assert isinstance(error, UnexpectedAnswerError)
        assert "not what was sent" in error.what
        assert error.verified.differences  # type: ignore[attr-defined]
        transfer = b.control.send_program(
            PROGRAM, verify=True, on_operator=b.hand(("recv", "programs"), ("send", "settings"))
        )
        assert "no file of program" in (await ending(transfer)).what


async def test_programs_are_found_among_all_that_the_control_has() -> None:
    programs = [program_of(50, number=1), program_of(50, number=2)]
    hands = (("recv", "programs"), ("send", "ALL"))
    async with bench(CLASSIC_DC_CODES) as b:
        sent = await b.control.send_programs(programs, verify=True, on_operator=b.hand(*hands))
        assert len(b.far.memory.programs) > 2
        assert sent.proof == "read back equal"
        b.far.trouble.spoil_sent_byte(100)
        error = await ending(b.control.send_programs(programs, verify=True, on_operator=b.hand(*hands)))
        assert "not what was sent" in error.what


async def test_settings_are_read_back_too() -> None:
    async with bench(CLASSIC_DC_CODES) as b:
        data = "%\r\n" + "".join(f"N{number} V{value}\r\n" for number, value in b.far.memory.settings.items()) + "%\r\n"
        sent = await b.control.send_settings(
            data, verify=True, on_operator=b.hand(("recv", "settings"), ("send", "settings"))
        )
        assert sent.verified is not None
        assert sent.verified.equal == "in content"  # the control has put its N0 in front
        other = data.replace("N9 V0", "N9 V1")
        b.far.trouble.codes_to_lose = set()
        transfer = b.control.send_settings(
            other, verify=True, on_operator=b.hand(("recv", "offsets"), ("send", "settings"))
        )
        error = await ending(transfer)
        assert "N9" in error.what
