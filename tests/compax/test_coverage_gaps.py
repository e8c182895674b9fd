"""Rows of the page of coverage that no other test holds: the tables as the manuals have them, and small rules."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from tests.promises.bench import bench, lines
from tests.simulator.compax.terminal import PROMPT, Terminal

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    Dialect,
    DriveSettings,
    InvalidCommandError,
)
from compax_aio.compax.facts.certainty import Certainty
from compax_aio.compax.facts.control_functions import CONTROL_FUNCTIONS
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS
from compax_aio.compax.facts.parameters import PARAMETERS, parameter_decimals
from compax_aio.compax.facts.quantities import quantity
from compax_aio.compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES
from compax_aio.transports.loopback import listen

# Tables ---------------------------------------------------------------------------------------------------------------

PARAMETERS_OF_THE_PAGES: dict[int, tuple[str, str | None, str]] = {
    1: ("real zero", "axis", "UG p. 104"),
    2: ("speed used when no SPEED", "%", "IBS p. 33"),
    6: ("acceleration time used when no ACCEL", "ms", "IBS p. 33"),
    10: ("ramp time of STOP", "ms", "CAN-S p. 28"),
    11: ("limit of the travel", "axis", "UG p. 100"),
    12: ("limit of the travel", "axis", "UG p. 100"),
    14: ("positioning window", "axis", "UG p. 117"),
    19: ("baud rate", None, "UG p. 160"),
    20: ("serial interface", None, "UG p. 166"),
    35: ("mark reference: 1 on, 0 off", None, "UG p. 100"),
    37: ("least travel to the mark", "axis", "UG p. 100"),
    38: ("greatest travel to the mark", "axis", "UG p. 100"),
    39: ("greatest feed without a mark", "axis", "UG p. 100"),
    **dict.fromkeys(range(40, 50), ("control parameter", None, "UG p. 100-101")),
    **dict.fromkeys(range(71, 75), ("D/A monitor", None, "UG p. 124")),
    76: ("D/A monitor channel 2", None, "UG p. 124"),
    77: ("D/A monitor channel 3", None, "UG p. 124"),
    90: ("unit of travel", None, "UG p. 100-101"),
    93: ("operating mode: 1 to 3", None, "UG p. 117, 209"),
    **dict.fromkeys(range(135, 139), ("process data", None, "IBS p. 70")),
    156: ("inputs 1-6", None, "UG p. 140"),
    157: ("inputs 7-12", None, "UG p. 140"),
    158: ("inputs 13-16", None, "UG p. 140"),
    182: ("quantity shown in S15", None, "UG p. 211"),
    190: ("22 is DSP402", None, "CAN-S p. 28"),
    193: ("1 error, 2 position reached, 4 comparator", None, "CAN p. 31"),
    194: ("address", None, "485 p. 6"),
    195: ("baud rate", None, "485 p. 6"),
    196: ("mode", None, "485 p. 6"),
    215: ("unknown", None, "UG p. 104"),
    221: ("bus control word", None, "IBS p. 20"),
    227: ("bit 4", None, "UG p. 117"),
    233: ("quantity shown in S13", None, "UG p. 211"),
    234: ("quantity shown in S14", None, "UG p. 211"),
}


def test_the_parameters_that_pages_explain_are_those_and_say_so() -> None:
    told = {row.number: row for row in PARAMETERS}
    assert set(told) == set(PARAMETERS_OF_THE_PAGES)
    for number, (meaning, unit, source) in PARAMETERS_OF_THE_PAGES.items():
        assert meaning in told[number].meaning, number
        assert told[number].unit == unit, number
        assert told[number].source.startswith(source), number


def test_what_of_a_parameter_is_inferred_or_unknown_says_so() -> None:
    unsure = {row.number: row.certainty for row in PARAMETERS if row.certainty is not Certainty.DOCUMENTED}
    assert unsure == {
        10: Certainty.INFERRED,
        **dict.fromkeys(range(71, 75), Certainty.INFERRED),
        215: Certainty.UNKNOWN,
    }


@pytest.mark.parametrize(
    ("first", "last", "decimals"),
    [
        (1, 5, 3), (6, 10, 0), (11, 16, 3), (17, 20, 0), (21, 22, 6), (23, 29, 0), (30, 34, 3), (35, 36, 6),
        (37, 49, 3), (50, 72, 0), (73, 99, 3), (100, 186, 0), (187, 196, 3), (197, 250, 0),
    ],
)  # fmt: skip
def test_a_parameter_is_stored_as_fine_as_the_page_says(first: int, last: int, decimals: int) -> None:
    """IBS p. 24, CAN p. 33."""
    assert {parameter_decimals(number) for number in range(first, last + 1)} == {decimals}


STATUS_OF_THE_PAGES: dict[int, tuple[str, str | None, str, Certainty]] = {
    1: ("actual position", "axis", "UG p. 104", Certainty.DOCUMENTED),
    2: ("target position", "axis", "IBS p. 12", Certainty.DOCUMENTED),
    3: ("following error", "axis", "IBS p. 38, 70", Certainty.DOCUMENTED),
    4: ("speed", "%", "IBS p. 70", Certainty.INFERRED),
    5: ("motor torque", "%", "IBS p. 70", Certainty.INFERRED),
    6: ("temperature", "°C", "IBS p. 12", Certainty.INFERRED),
    7: ("control voltage", "V", "IBS p. 12", Certainty.INFERRED),
    8: ("intermediate circuit voltage", "V", "IBS p. 12", Certainty.INFERRED),
    9: ("motion cycles", None, "IBS p. 12", Certainty.DOCUMENTED),
    10: ("operating hours", "h", "IBS p. 12", Certainty.INFERRED),
    11: ("loop counter", None, "IBS p. 12", Certainty.DOCUMENTED),
    12: ("absolute value sensor", "axis", "IBS p. 12, UG p. 104", Certainty.DOCUMENTED),
    13: ("P233", None, "UG p. 211", Certainty.DOCUMENTED),
    14: ("P234", None, "UG p. 211", Certainty.DOCUMENTED),
    15: ("P182", None, "UG p. 211", Certainty.DOCUMENTED),
    16: ("status bits", None, "UG p. 209", Certainty.DOCUMENTED),
    17: ("status bits", None, "UG p. 209", Certainty.DOCUMENTED),
    18: ("error history", None, "UG p. 209", Certainty.DOCUMENTED),
    **dict.fromkeys((*range(19, 23), *range(27, 30)), ("unknown", None, "", Certainty.UNKNOWN)),
    **dict.fromkeys(range(23, 27), ("diagnosis", None, "IBS p. 12, CAN p. 69", Certainty.DOCUMENTED)),
    30: ("error message", None, "IBS p. 12", Certainty.DOCUMENTED),
    **dict.fromkeys(range(31, 40), ("identification", None, "IBS p. 12", Certainty.DOCUMENTED)),
}


def test_the_status_values_mean_what_the_pages_say() -> None:
    told = {row.number: row for row in STATUS_VALUES}
    assert set(told) == set(STATUS_OF_THE_PAGES)
    for number, (meaning, *rest) in STATUS_OF_THE_PAGES.items():
        row = told[number]
        assert meaning in row.meaning, number
        assert [row.unit, row.source, row.certainty] == rest, number


def test_the_bits_stand_in_the_order_of_the_page() -> None:
    """UG p. 209, bit 1 first."""
    assert [(row.bit, row.name) for row in S16_BITS] == [
        (1, "no_fault"), (2, "no_warning"), (3, "machine_zero_approached"), (4, "ready_for_start"),
        (5, "position_reached"), (6, "idle_after_stop"), (7, "output_0_is_1"), (8, "output_0_is_2"),
    ]  # fmt: skip
    assert [(row.bit, row.name) for row in S17_BITS] == [
        (1, "password_active"), (2, "service_password_active"), (3, "command_active"), (4, "program_running"),
        (5, "stopped_by_input"), (6, "reserved"), (7, "running"), (8, "unused"),
    ]  # fmt: skip


def test_the_quantities_17_to_32_mean_what_the_page_says() -> None:
    """UG p. 211."""
    meanings = {number: quantity(number).meaning for number in range(17, 33)}
    for number, word in {
        17: "transmission errors", 18: "nominal value", 19: "control word", 20: "status word", 21: "positive",
        22: "negative", 23: "channel 1", 26: "channel 4", 27: "external encoder", 28: "resolver minus external",
        29: "load of the motor", 30: "load of the unit", 31: "pointer", 32: "correction",
    }.items():  # fmt: skip
        assert word in meanings[number], number


def test_the_errors_that_pages_name_mean_what_they_say() -> None:
    told = {row.code: (row.meaning, row.page, row.certainty) for row in DEVICE_ERRORS}
    assert set(told) == {10, 53, 55, 92}
    assert told[53] == ("overload of motor or unit", 211, Certainty.DOCUMENTED)
    assert told[55] == ("emergency stop", 209, Certainty.DOCUMENTED)
    assert told[92] == ("a move is already active", 209, Certainty.DOCUMENTED)


def test_the_words_of_the_control_functions_are_as_sure_as_their_pages() -> None:
    """CAN p. 32 for the functions; where a word is on no page, the row says so."""
    told = {row.number: (row.word, row.certainty) for row in CONTROL_FUNCTIONS}
    assert told == {
        1: ("POSA HOME", Certainty.DOCUMENTED), 2: ("START", Certainty.PLACEHOLDER),
        3: ("STOP", Certainty.PLACEHOLDER), 4: ("BREAK", Certainty.PLACEHOLDER), 5: ("QUIT", Certainty.PLACEHOLDER),
        6: (None, Certainty.UNKNOWN), 7: ("VP", Certainty.INFERRED), 8: ("VC", Certainty.PLACEHOLDER),
        9: ("SPEED SYNC", Certainty.INFERRED), 10: ("OUTPUT O0=0", Certainty.INFERRED),
        11: ("OUTPUT O0=1", Certainty.INFERRED), 12: ("OUTPUT O0=2", Certainty.INFERRED),
        13: ("GOTO EXT", Certainty.DOCUMENTED), 14: ("GOTO 302", Certainty.DOCUMENTED),
        15: ("GOTO 270", Certainty.DOCUMENTED), 16: ("GOTO 620", Certainty.DOCUMENTED),
        17: ("VF", Certainty.PLACEHOLDER), 18: (None, Certainty.UNKNOWN), 19: (None, Certainty.UNKNOWN),
    }  # fmt: skip


# On the line ----------------------------------------------------------------------------------------------------------


async def test_small_letters_of_a_caller_go_out_as_capitals() -> None:
    """IBS p. 23, CAN p. 33."""
    async with bench(lower_case="error") as (drive, far):
        assert await drive.command("sd 50") == ""
        assert await drive.query("s1") == "S001: 0.00"
        assert lines(far)[-2:] == ["SD 50", "S1"]


async def test_s17_is_read_before_s16() -> None:
    """So a move that ends in between shows as ended, and never as under way and reached."""
    async with bench() as (drive, far):
        await drive.status()
        assert lines(far)[-2:] == ["S17", "S16"]


async def test_every_line_ends_with_cr_alone() -> None:
    """UG p. 160."""
    async with bench() as (drive, _):
        with pytest.raises(InvalidCommandError):
            await drive.command("S99\rPA 5")
        told = await drive.command("S1")
        assert told == "S001: 0.00"
        error = await _refused(drive.command("NONSENSE"))
        sent = [line.partition("→ ")[2] for line in error.exchanges if "→" in line]
        assert sent
        assert all(text.endswith("␍") and text.count("␍") == 1 and "␊" not in text for text in sent)


async def test_a_record_goes_out_in_the_style_of_the_listings_unless_the_dialect_says_otherwise() -> None:
    """UG p. 95; the form on RS-232 is inferred."""
    async with bench() as (drive, far):
        await drive.program.write(5, "POSA 250")
        assert "N005: POSA 250" in lines(far)
    bare = DriveSettings(dialect=Dialect(record="N{n} {text}"))
    async with bench("y", settings=bare) as (drive, far):
        await drive.program.write(5, "POSA 250")
        assert "N5 POSA 250" in lines(far)


async def test_a_parameter_written_during_a_move_is_sent_and_leaves_the_move_alone() -> None:
    """Whether a drive takes it then is on no page at hand; it is for the drive to say."""
    async with bench() as (drive, far):
        move = drive.move_to(100)
        await move.accepted
        await drive.parameters.write(40, 1.5)
        assert (await move).target == far.position == 100
        assert await drive.parameters.read(40) == 1.5


async def test_a_quiet_drive_is_told_to_tell_errors_by_its_parameter() -> None:
    """P20 = 3 keeps quiet (UG p. 166); nothing of it is changed unasked, and a new connection takes note."""
    async with bench(p20=3) as (drive, far):
        assert "P20=0" not in lines(far)
        async with drive.parameters.unlocked() as parameters:
            await parameters.write(20, 0)
            await parameters.make_valid()
        assert (await _refused(drive.command("NONSENSE"))).code == 90
    async with bench() as (drive, _):
        assert drive.interface is not None
        assert not drive.interface.errors_suppressed


async def test_another_speed_on_the_way_is_felt() -> None:
    """By the word that is the default of the dialect (inferred, IBS p. 42)."""
    async with bench() as (drive, far):
        move = drive.move_to(400, speed_percent=20)
        await asyncio.sleep(1)
        await move.change_speed(100)
        assert (await move).duration_s < 4
        assert far.prepared_points == 0


async def test_s11_counts_the_passes_of_a_repeat_loop() -> None:
    """IBS p. 12."""
    async with bench() as (drive, _):
        await drive.program.download("N001: REPEAT 5\nN002: V1=S11\nN003: WAIT 1000\nN004: END\nN005: END")
        await drive.program.start(1)
        await _until_variable(drive, 3)
        counter = await drive.read_status(11)
        assert counter.value == 3
        await drive.program.wait_finished()
        assert (await drive.read_status(11)).value == 0


async def _until_variable(drive: Any, value: float) -> None:
    async with asyncio.timeout(100):
        async for reading in drive.watch("V1", interval_s=0.05):
            if reading["V1"] == value:
                return


async def _refused(awaitable: Any) -> Any:
    with pytest.raises(CompaxError) as caught:
        await awaitable
    return caught.value


@pytest.mark.parametrize("line", ["PA 100 $", "PA100$", "PA 100$", "POSA 100 $"])
def test_a_function_sign_may_stand_apart(line: str) -> None:
    """UG p. 160: with a blank or without one."""
    terminal = Terminal()
    assert terminal.say(line) == PROMPT
    assert terminal.wait(10) == b"$" + PROMPT


def test_a_new_real_zero_cancels_what_was_prepared() -> None:
    """UG p. 101."""
    terminal = Terminal()
    terminal.say("PR 10 OT O1=1")
    assert terminal.drive.prepared_points == 1
    terminal.say("REALZERO")
    assert terminal.drive.prepared_points == 0


# What errors say ------------------------------------------------------------------------------------------------------


async def test_a_refused_parameter_says_how_a_protected_one_is_written() -> None:
    async with bench() as (drive, _):
        error = await _refused(drive.parameters.write(10, 200))
        assert (error.sent, error.received) == ("P10=200", "E89")
        assert "unlocked()" in error.hint
        assert "error list" in error.hint


async def test_a_far_end_that_hangs_up_at_once_may_be_taken_by_somebody_else() -> None:
    class HangsUp(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            transport.close()

    with await listen("taken", HangsUp) as listener:
        error = await _refused(compax_aio.connect(listener.url, name="x"))
    assert isinstance(error, ConnectionLostError)
    assert "somebody else" in str(error.hint)


async def test_a_far_end_that_keeps_silent_is_told_with_what_was_asked() -> None:
    with await listen("mute", asyncio.Protocol) as listener:
        error = await _refused(compax_aio.connect(listener.url, name="x"))
    assert isinstance(error, AnswerTimeoutError)
    assert str(error.sent) in {"S17", "S16", "S30"}
    assert error.received is None


@pytest.mark.parametrize("value", [1e7, -1e7, 39_999_999])
async def test_a_value_of_more_than_seven_digits_is_refused_before_a_byte_is_sent(value: float) -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        with pytest.raises(InvalidCommandError, match="7 digits"):
            await drive.parameters.write(40, value)
        assert len(lines(far)) == before


# Settings -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrong",
    [
        {"dialect": "STOP"}, {"dialect": {"stop": "HALT"}}, {"message_form": "PROMPT_FIRST"}, {"unit": 3},
        {"answer_timeout_s": "1"}, {"answer_timeout_s": True}, {"verify_messages": "yes"}, {"binary_settings": 1},
        {"speed_limit_percent": "100"}, {"units": {1: "mm"}}, {"units": 5}, {"units": {"1": None}}, {"travel": 5},
        {"travel": ("a", "b")}, {"error_pattern": 5}, {"resync_attempts": "3"},
    ],
    ids=repr,
)  # fmt: skip
def test_a_setting_of_the_wrong_kind_is_refused_when_the_settings_are_made(wrong: dict[str, Any]) -> None:
    """Not when the word for STOP is wanted."""
    with pytest.raises(InvalidCommandError, match=next(iter(wrong))):
        DriveSettings(**wrong)
