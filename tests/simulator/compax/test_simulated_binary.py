"""Binary transfer as the drive takes it: frames of known length between lines, and what a cut frame does."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import Knobs, LogEntry, LogKind, SimulatedDrive

BYTE_S = 10 / 9600

POSA_360 = bytes.fromhex("88 41 00 00 00 68 01 00")
"""The one frame that the manual prints whole (UG p. 167)."""


def number(value: float) -> bytes:
    """Write a number as UG p. 167 says: 24 bits before the point, 24 behind it, least significant byte first."""
    return round(value * 2**24).to_bytes(6, "little", signed=True)


def posa(value: float) -> bytes:
    return b"\x88A" + number(value)


def posr(value: float) -> bytes:
    return b"\x88R" + number(value)


def speed(value: float) -> bytes:
    return b"\x88S" + number(value)


def accel(value: int) -> bytes:
    return b"\x84L" + value.to_bytes(2, "big")


def decel(value: int) -> bytes:
    return b"\x84D" + value.to_bytes(2, "big")


def output(which: int, level: bytes) -> bytes:
    return b"\x85O" + which.to_bytes(2, "big") + level


def comparator(distance: float, which: int, level: bytes) -> bytes:
    return b"\x8cR" + number(distance) + b"O" + which.to_bytes(2, "big") + level


def speed_step(distance: float, percent: float) -> bytes:
    return b"\x8fR" + number(distance) + b"S" + number(percent)


@pytest.fixture
def terminal() -> Terminal:
    """A terminal on a drive that takes frames and lines: 200 mm/s at 100 %, ramps of 250 ms."""
    return Terminal(p20=16)


# What frames do


@pytest.mark.parametrize(
    ("value", "position"),
    [
        ("00 00 00 0A 00 00", "10.00"),
        ("00 00 00 68 01 00", "360.00"),
        ("00 00 80 C2 01 00", "450.50"),
        ("00 00 00 FF FF FF", "-1.00"),
        ("00 00 80 3D FE FF", "-450.50"),
    ],
)
def test_a_number_is_fixed_point_with_its_least_significant_byte_first(
    terminal: Terminal, value: str, position: str
) -> None:
    """UG p. 167; the last one by the same rule."""
    assert terminal.send(b"\x88A" + bytes.fromhex(value), 10) == PROMPT
    assert terminal.ask("S1") == f"S001: {position}"


def test_the_frame_that_the_manual_prints_moves_the_axis(terminal: Terminal) -> None:
    assert terminal.send(POSA_360, 10) == PROMPT
    assert terminal.motions() == ["motion_started POSA 360.00", "motion_reached 360.00"]


def test_a_relative_frame_moves_from_where_the_axis_stands(terminal: Terminal) -> None:
    terminal.send(posa(100), 10)
    assert terminal.send(bytes.fromhex("88 52 00 00 80 3D FE FF"), 10) == PROMPT
    assert terminal.ask("S1") == "S001: -350.50"


def test_speed_is_that_of_the_next_positioning(terminal: Terminal) -> None:
    assert terminal.send(bytes.fromhex("88 53 00 00 80 0C 00 00")) == PROMPT
    terminal.say("PA 300", 5)
    assert terminal.ask("S4") == "S004: 12.50"


def test_acceleration_and_braking_have_their_own_frames(terminal: Terminal) -> None:
    """A word has its most significant byte first; 200 mm at 200 mm/s take 1 s and half of each ramp."""
    assert terminal.send(bytes.fromhex("84 4C 00 FA")) == PROMPT
    assert terminal.send(bytes.fromhex("84 44 03 E8")) == PROMPT
    started_at = terminal.now + terminal.drive.knobs.answer_time_s
    terminal.send(posa(200), 60)
    ended_at = next(entry.at for entry in terminal.drive.log if entry.kind is LogKind.MOTION_REACHED)
    assert ended_at - started_at == pytest.approx(1 + 0.125 + 0.5)
    terminal.send(bytes.fromhex("84 4C 03 E8"))
    started_at = terminal.now + terminal.drive.knobs.answer_time_s
    terminal.send(posa(0), 60)
    ended_at = [entry.at for entry in terminal.drive.log if entry.kind is LogKind.MOTION_REACHED][-1]
    assert ended_at - started_at == pytest.approx(1 + 0.5 + 0.5)


def test_an_output_is_set_and_reset(terminal: Terminal) -> None:
    """31 is 1 and 30 is 0 (UG p. 167)."""
    assert terminal.send(bytes.fromhex("85 4F 00 09 31")) == PROMPT
    assert terminal.drive.outputs[9]
    assert terminal.send(bytes.fromhex("85 4F 00 09 30")) == PROMPT
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O9=1", "O9=0"]


def test_output_0_is_the_power_stage_in_a_frame_too(terminal: Terminal) -> None:
    assert terminal.send(output(0, b"1")) == PROMPT
    assert terminal.send(posa(5)) == b"E97\r\n>"
    assert terminal.send(output(0, b"0")) == PROMPT
    assert terminal.send(posa(5)) == PROMPT


def test_comparators_of_both_kinds_are_numbered_together(terminal: Terminal) -> None:
    terminal.say("PR 200 OT O9=1")
    assert terminal.send(bytes.fromhex("8C 52 00 00 00 64 00 00 4F 00 0A 31")) == PROMPT
    assert terminal.drive.prepared_points == 2
    assert terminal.say("POSA 1000$", 20) == b"\r\n>2\r\n>1\r\n>$\r\n>"
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O10=1", "O9=1"]


def test_a_speed_step_changes_the_speed_on_the_way(terminal: Terminal) -> None:
    assert terminal.send(bytes.fromhex("8F 52 00 00 00 64 00 00 53 00 00 00 19 00 00")) == PROMPT
    terminal.send(posa(300), 0.5)
    assert terminal.ask("S4") == "S004: 100.00"
    terminal.wait(1)
    assert terminal.ask("S4") == "S004: 25.00"


def test_a_positioning_of_a_frame_reports_nothing_at_its_end(terminal: Terminal) -> None:
    """Frames have no function signs (UG p. 166)."""
    assert terminal.send(posa(100), 60) == PROMPT
    assert terminal.drive.log.texts(LogKind.MESSAGE) == []


def test_frames_and_lines_take_turns(terminal: Terminal) -> None:
    assert terminal.send(speed(50)) == PROMPT
    assert terminal.say("PA 100$", 5) == b"\r\n>$\r\n>"
    assert terminal.send(posr(-40), 5) == PROMPT
    assert terminal.send(b"S1\r\n") == b"S001: 60.00\r\n>"
    assert terminal.send(posa(0) + b"S2\r", 0.01) == PROMPT + b"S002: 0.00\r\n>"


def test_a_frame_is_executed_at_its_last_byte(terminal: Terminal) -> None:
    assert terminal.send(POSA_360[:-1], 100) == b""
    assert terminal.motions() == []
    assert terminal.send(POSA_360[-1:], 0.001) == b""
    assert terminal.wait(0.002) == PROMPT
    assert terminal.motions() == ["motion_started POSA 360.00"]


def test_the_bytes_of_a_frame_take_their_time() -> None:
    terminal = Terminal(p20=16, baudrate=9600, answer_time_s=0.002)
    terminal.drive.receive(POSA_360, 0.0)
    terminal.drive.advance(7.99 * BYTE_S)
    assert list(terminal.drive.log) == []
    terminal.drive.advance(8.01 * BYTE_S)
    assert [entry.at for entry in terminal.drive.log] == [pytest.approx(8 * BYTE_S)]
    begins = 8 * BYTE_S + 0.002
    assert terminal.drive.take_output(begins + 0.99 * BYTE_S) == b""
    assert terminal.drive.take_output(begins + 3.01 * BYTE_S) == PROMPT


def test_the_log_shows_a_frame_and_what_it_means(terminal: Terminal) -> None:
    terminal.send(POSA_360 + accel(250) + comparator(2.5, 9, b"1") + speed_step(3, 50) + b"\x84X\x00\xfa", 1)
    assert terminal.drive.log.texts(LogKind.LINE) == [
        "88 41 00 00 00 68 01 00 (POSA 360.00)",
        "84 4C 00 FA (ACCEL 250)",
        "8C 52 00 00 80 02 00 00 4F 00 09 31 (POSR 2.50 OUTPUT O9=1)",
        "8F 52 00 00 00 03 00 00 53 00 00 00 32 00 00 (POSR 3.00 SPEED 50)",
        "84 58 00 FA",
    ]


# What is refused


@pytest.mark.parametrize(
    "frame",
    [
        "84 58 00 FA", "84 41 00 FA", "88 4C 00 00 00 68 01 00", "88 4F 00 00 00 68 01 00", "86 41 00 00 00 00",
        "8C 41 00 00 00 64 00 00 4F 00 0A 31", "8C 52 00 00 00 64 00 00 53 00 0A 31", "85 4F 00 09 32",
        "85 4F 00 09 01", "85 4C 00 FA 00", "87 0D 0D 0D 0D 0D 0D", "8A 88 88 88 88 88 88 88 88 88",
        "8C 52 00 00 00 64 00 00 4F 00 0A 00", "8F 52 00 00 00 64 00 00 4F 00 00 00 19 00 00",
        "8F 41 00 00 00 64 00 00 53 00 00 00 19 00 00",
    ],
)  # fmt: skip
def test_a_frame_that_means_nothing_is_a_syntax_error(terminal: Terminal, frame: str) -> None:
    """All the bytes that it announced are gone, and the next line is clean."""
    data = bytes.fromhex(frame)
    assert len(data) == data[0] - 0x80
    assert terminal.send(data[:-1], 10) == b""
    assert terminal.send(data[-1:] + b"S1\r", 10) == b"E90\r\n>S001: 0.00\r\n>"
    assert terminal.drive.log.texts(LogKind.LINE) == [frame, "S1"]


@pytest.mark.parametrize(
    "frame",
    [
        posa(4_000_000.25), posr(-4_000_001), posa(8_388_607), posr(-8_388_608), speed(0), speed(600.5), speed(-1),
        accel(65_001), decel(65_535), output(17, b"1"), comparator(0, 1, b"1"), comparator(-5, 1, b"1"),
        comparator(5, 0, b"1"), comparator(5, 17, b"1"), speed_step(5, 0), speed_step(-5, 5), speed_step(5, 601),
        comparator(4_000_001, 1, b"1"), speed(0.0004), speed_step(5, 0.4), comparator(0.004, 1, b"1"),
    ],
)  # fmt: skip
def test_a_number_out_of_range_is_refused(terminal: Terminal, frame: bytes) -> None:
    assert terminal.send(frame) == b"E91\r\n>"
    assert terminal.motions() == []
    assert terminal.drive.prepared_points == 0


@pytest.mark.parametrize("frame", [posa(4_000_000), posr(-4_000_000), speed(600), accel(65_000), decel(0)])
def test_the_largest_numbers_are_taken(terminal: Terminal, frame: bytes) -> None:
    assert terminal.send(frame) == PROMPT


@pytest.mark.parametrize(
    ("decimals", "value", "target"),
    [
        (2, 12.344999, "12.34"), (2, 12.345001, "12.35"), (2, -0.004, "0.00"), (2, 2**-24, "0.00"),
        (3, 12.3454, "12.345"), (3, -12.3456, "-12.346"),
    ],
)  # fmt: skip
def test_a_number_more_exact_than_the_drive_is_rounded(decimals: int, value: float, target: str) -> None:
    terminal = Terminal(p20=16, decimals=decimals)
    assert terminal.send(posa(value), 10) == PROMPT
    assert terminal.motions()[0] == f"motion_started POSA {target}"
    assert terminal.ask("S2") == f"S002: {target}"


def test_a_point_too_near_to_be_told_from_the_start_does_not_change_the_speed_of_the_move_that_runs(
    terminal: Terminal,
) -> None:
    terminal.send(posa(100))
    for distance in (0.004, 2**-24):
        assert terminal.send(speed_step(distance, 50)) == b"E91\r\n>"
    terminal.wait(5)
    assert terminal.motions() == ["motion_started POSA 100.00", "motion_reached 100.00"]


def test_positioning_is_refused_while_the_axis_moves(terminal: Terminal) -> None:
    """UG p. 162 and 209; preparations are not."""
    terminal.send(posa(100))
    for frame in (posa(50), posr(10), output(0, b"1")):
        assert terminal.send(frame) == b"E92\r\n>"
    for frame in (speed(50), accel(100), comparator(5, 1, b"1"), output(2, b"1")):
        assert terminal.send(frame) == PROMPT
    terminal.wait(5)
    assert terminal.motions() == ["motion_started POSA 100.00", "motion_reached 100.00"]


def test_travel_limits_and_faults_refuse_a_frame() -> None:
    terminal = Terminal(p20=16, travel_max=300, travel_min=-10)
    assert terminal.send(POSA_360) == b"E93\r\n>"
    assert terminal.send(posr(-10.5)) == b"E93\r\n>"
    terminal.drive.raise_fault(55)
    assert terminal.send(posa(5)) == b"E94\r\n>"
    assert terminal.motions() == []


def test_at_most_eight_points_are_prepared(terminal: Terminal) -> None:
    for i in range(1, 9):
        assert terminal.send(comparator(i, i, b"1") if i % 2 else speed_step(i, i)) == PROMPT
    assert terminal.send(comparator(9, 9, b"1")) == b"E95\r\n>"
    assert terminal.ask("PR 9 OT O9=1") == "E95"


@pytest.mark.parametrize(
    ("knobs", "answer"),
    [
        ({"p20": 16}, b"E91\r\n>"),
        ({"p20": 16, "error_style": "text"}, b"E91 number out of range\r\n>"),
        ({"p20": 18}, PROMPT),
        ({"p20": 19}, PROMPT),
        ({"p20": 16, "error_style": "prompt_only"}, PROMPT),
        ({"p20": 19, "error_style": "silent"}, b""),
    ],
)
def test_an_error_is_answered_as_p20_wants_it(knobs: dict[str, Any], answer: bytes) -> None:
    """UG p. 166: as in ASCII."""
    terminal = Terminal(**knobs)
    assert terminal.send(speed(0)) == answer
    assert terminal.say("SD 0") == answer


# Where a frame begins and ends


def test_without_bit_4_a_frame_is_text_that_spoils_its_line() -> None:
    terminal = Terminal(p20=3 + 8)
    assert terminal.send(POSA_360, 10) == b""
    assert terminal.say("S1") == PROMPT
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.motions() == []


def test_behind_half_a_line_a_frame_is_text_that_spoils_it(terminal: Terminal) -> None:
    assert terminal.send(b"PA1" + POSA_360, 10) == b""
    assert terminal.send(b"00\r") == b"E90\r\n>"
    assert terminal.motions() == []
    assert terminal.send(POSA_360) == PROMPT


def test_a_line_feed_does_not_make_a_line_too_long(terminal: Terminal) -> None:
    assert terminal.send(b"S1".ljust(30) + b"\n\r") == b"S001: 0.00\r\n>"
    assert terminal.send(b"S1".ljust(31) + b"\n\r") == b"E90\r\n>"


def test_a_line_feed_before_a_frame_means_nothing(terminal: Terminal) -> None:
    assert terminal.send(b"S1\r\n" + POSA_360) == b"S001: 0.00\r\n>\r\n>"
    assert terminal.motions() == ["motion_started POSA 360.00"]


@pytest.mark.parametrize("byte", [0x80, 0x81, 0x82, 0x83, 0x90, 0xC0, 0xFF])
def test_a_byte_that_announces_no_frame_is_a_character(terminal: Terminal, byte: int) -> None:
    assert terminal.send(bytes([byte]) + b"S1\r") == b"E90\r\n>"
    assert terminal.ask("S1") == "S001: 0.00"


@pytest.mark.parametrize("xonxoff", [False, True])
def test_control_characters_inside_a_frame_are_data(xonxoff: bool) -> None:
    """CR, LF, Xon and Xoff; Xon and Xoff also with P20 bit 0, which is a choice."""
    terminal = Terminal(p20=16, xonxoff=xonxoff)
    assert terminal.send(accel(0x0D0A)) == PROMPT
    assert terminal.send(accel(0x1311)) == PROMPT
    assert terminal.send(decel(0x0013)) == PROMPT
    assert terminal.drive.log.texts(LogKind.LINE) == [
        "84 4C 0D 0A (ACCEL 3338)",
        "84 4C 13 11 (ACCEL 4881)",
        "84 44 00 13 (ACCEL- 19)",
    ]


def test_between_frames_xoff_still_holds_the_output() -> None:
    terminal = Terminal(p20=17)
    assert terminal.send(b"\x13" + accel(0x1111), 10) == b""
    assert terminal.send(b"\x11") == PROMPT


def test_a_cut_positioning_swallows_the_marker_and_moves_to_another_target(terminal: Terminal) -> None:
    """Why binary positioning is for lines that lose no bytes: the query gets a prompt, and the axis runs away."""
    terminal.send(POSA_360[:4])
    assert terminal.say("S17") == PROMPT
    assert terminal.motions() == ["motion_started POSA 866097.32"]
    assert terminal.drive.log.texts(LogKind.LINE) == ["88 41 00 00 53 31 37 0D (POSA 866097.32)"]


def test_a_cut_frame_swallows_only_the_beginning_of_a_line(terminal: Terminal) -> None:
    terminal.send(POSA_360[:6])
    assert terminal.say("S17") == b"\r\n>E90\r\n>"
    assert terminal.motions() == ["motion_started POSA 3232616.00"]


def test_a_cut_frame_takes_the_next_frame_apart(terminal: Terminal) -> None:
    """The rest of the second frame begins no frame, and waits for a CR."""
    terminal.send(posa(1.5)[:7])
    assert terminal.send(POSA_360, 10) == b"E91\r\n>"
    assert terminal.ask("S1") == "E90"
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.motions() == []


def test_stop_is_swallowed_by_a_cut_frame(terminal: Terminal) -> None:
    terminal.send(posa(1000), 1)
    terminal.send(POSA_360[:3])
    assert terminal.say("STOP") == b"E92\r\n>"
    assert terminal.drive.moving
    assert terminal.say("STOP", 1) == PROMPT
    assert not terminal.drive.moving


def test_a_stray_byte_swallows_what_follows(terminal: Terminal) -> None:
    assert terminal.send(b"\x8fS17\r", 10) == b""
    assert terminal.say("S17") == b""
    assert terminal.say("S17") == b""
    assert terminal.say("S17") == b"E90\r\n>E90\r\n>"
    assert terminal.ask("S17") == "S017: 00000010"


def test_half_a_frame_of_an_earlier_connection_is_still_there(terminal: Terminal) -> None:
    terminal.drive.connect()
    terminal.send(POSA_360[:4])
    terminal.drive.disconnect()
    terminal.wait(3600)
    terminal.drive.connect()
    assert terminal.say("S17") == PROMPT
    assert terminal.motions() == ["motion_started POSA 866097.32"]


def test_without_power_half_a_frame_is_forgotten(terminal: Terminal) -> None:
    """UG p. 167: switching on again makes the interface begin anew; binary transfer stays on, as P20 is kept."""
    terminal.send(POSA_360[:4])
    terminal.drive.power_cycle()
    assert terminal.ask("S17") == "S017: 00000010"
    assert terminal.motions() == []
    assert terminal.send(POSA_360) == PROMPT


def test_after_half_a_frame_and_a_power_cycle_xoff_is_heeded_again() -> None:
    terminal = Terminal(p20=17)
    terminal.send(POSA_360[:4])
    terminal.drive.power_cycle()
    assert terminal.send(b"\x13S1\r", 10) == b""
    assert terminal.send(b"\x11") == b"S001: 0.00\r\n>"


# P20 changes


def test_vp_lets_frames_in() -> None:
    terminal = Terminal(password="off")
    terminal.ask("P20=16")
    assert terminal.send(accel(250)) == b""
    assert terminal.ask("") == "E90"
    assert terminal.ask("VP") == ""
    assert terminal.send(accel(250)) == PROMPT
    assert terminal.ask("S1") == "S001: 0.00"


def test_vp_shuts_frames_out() -> None:
    terminal = Terminal(p20=16, password="off")
    terminal.ask("P20=0")
    assert terminal.send(accel(250)) == PROMPT
    assert terminal.ask("VP") == ""
    assert terminal.send(accel(250)) == b""
    assert terminal.ask("") == "E90"


def test_a_frame_that_began_before_vp_ends_as_a_frame() -> None:
    terminal = Terminal(p20=16, password="off")
    terminal.ask("P20=0")
    assert terminal.send(b"VP\r" + accel(250)[:3]) == PROMPT
    assert terminal.send(b"\xfaS1\r") == b"\r\n>S001: 0.00\r\n>"
    assert terminal.drive.log.texts(LogKind.LINE)[-2:] == ["84 4C 00 FA (ACCEL 250)", "S1"]


def test_a_line_that_began_before_vp_ends_as_a_line() -> None:
    terminal = Terminal(password="off")
    terminal.ask("P20=16")
    assert terminal.send(b"VP\r" + accel(250)) == PROMPT
    assert terminal.send(accel(250) + b"\r") == b"E90\r\n>"
    assert terminal.send(accel(250)) == PROMPT


def test_a_record_of_the_program_can_let_frames_in() -> None:
    terminal = Terminal(password="off", vp="at_once")
    terminal.drive.load_program(["P20=16", "END"])
    terminal.say("START", 1)
    assert terminal.send(accel(250)) == PROMPT


# Beside other knobs and hooks


def test_one_command_at_a_time_counts_for_frames() -> None:
    terminal = Terminal(p20=16, ready_after_answer=True)
    assert terminal.send(accel(0x0D0D) + accel(100) + b"S1\r", 1) == PROMPT
    assert terminal.drive.log.texts(LogKind.LINE) == ["84 4C 0D 0D (ACCEL 3341)"]
    assert terminal.send(b"S1\r" + accel(100)) == b"S001: 0.00\r\n>"
    assert terminal.send(accel(100)) == PROMPT


def test_a_frame_that_begins_before_the_answer_is_out_loses_its_beginning() -> None:
    terminal = Terminal(p20=16, baudrate=9600, answer_time_s=0.002, ready_after_answer=True)
    terminal.drive.receive(accel(250), 0.0)
    terminal.drive.receive(accel(100), 6 * BYTE_S)
    assert terminal.drive.take_output(1) == PROMPT
    terminal.drive.receive(b"S1\r", 1)
    assert terminal.drive.take_output(2) == b"E90\r\n>"
    assert terminal.drive.log.texts(LogKind.LINE) == ["84 4C 00 FA (ACCEL 250)", "\0dS1"]


def test_a_frame_is_echoed_as_it_came() -> None:
    terminal = Terminal(p20=16, echo=True)
    assert terminal.send(accel(250)) == accel(250) + PROMPT
    assert terminal.say("S1") == b"S1\rS001: 0.00\r\n>"


@pytest.mark.parametrize(("store", "answer"), [("until_executed", ""), ("until_next_line", "E96")])
def test_a_frame_counts_as_a_line_for_what_is_stored(store: str, answer: str) -> None:
    terminal = Terminal(p20=16, store=store)
    terminal.ask("PA 7,")
    assert terminal.send(accel(250)) == PROMPT
    assert terminal.ask("!") == answer


def test_fault_hooks_know_frames(terminal: Terminal) -> None:
    terminal.drive.lose_answers = 1
    assert terminal.send(posa(5), 5) == b""
    assert terminal.ask("S1") == "S001: 5.00"
    terminal.drive.deaf = True
    assert terminal.send(POSA_360[:4]) == b""
    terminal.drive.deaf = False
    assert terminal.ask("S1") == "S001: 5.00"


def test_a_late_answer_to_a_frame_is_ahead_of_what_its_motion_says(terminal: Terminal) -> None:
    terminal.send(comparator(5, 1, b"1"))
    terminal.drive.extra_answer_delay_s = 3
    terminal.send(posa(10), 2)
    terminal.drive.inject(b"|")
    assert terminal.wait(2) == b"|\r\n>1\r\n>"


def test_memory_is_bounded_whatever_frames_arrive() -> None:
    for baudrate in (0, 9600):
        terminal = Terminal(p20=16, baudrate=baudrate)
        for _ in range(5):
            terminal.drive.receive(accel(250) * 20_000, 0.0)
        port = terminal.drive._port
        assert max(len(port._received), port._kept, len(port._arriving)) <= 65_536


def test_what_has_been_answered_makes_room_for_more() -> None:
    terminal = Terminal(p20=16, answer_time_s=0)
    for _ in range(4):
        assert terminal.send(accel(250) * 10_000) == PROMPT * 10_000


# Properties

POSITIONS = st.floats(-9_000, 9_000) | st.floats(-8_388_608, 8_388_607)
DISTANCES = POSITIONS.filter(lambda x: x == 0 or abs(x) >= 0.01)
PERCENTS = st.floats(-1, 700)
WORDS = st.integers(0, 65_535)
OUTPUTS = st.integers(0, 20)
LEVELS = st.sampled_from([b"0", b"1"])


def fixed(value: float, decimals: int) -> str:
    """Write a number as a frame has it, rounded to *decimals*."""
    return f"{round(round(value * 2**24) / 2**24, decimals) + 0.0:.{decimals}f}"


SAME = st.one_of(
    POSITIONS.map(lambda x: (posa(x), f"PA {fixed(x, 2)}")),
    POSITIONS.map(lambda x: (posr(x), f"POSR {fixed(x, 2)}")),
    PERCENTS.map(lambda x: (speed(x), f"SD {fixed(x, 3)}")),
    WORDS.map(lambda x: (accel(x), f"AL {x}")),
    WORDS.map(lambda x: (decel(x), f"AL- {x}")),
    st.builds(lambda o, y: (output(o, y), f"OT O{o}={y.decode()}"), OUTPUTS, LEVELS),
    st.builds(
        lambda d, o, y: (comparator(d, o, y), f"PR {fixed(d, 2)} OT O{o}={y.decode()}"), DISTANCES, OUTPUTS, LEVELS
    ),
    st.builds(lambda d, v: (speed_step(d, v), f"PR {fixed(d, 2)} SD {fixed(v, 0)}"), DISTANCES, PERCENTS),
)
"""A frame and a line that mean the same."""


def told(drive: SimulatedDrive) -> list[LogEntry]:
    return [entry for entry in drive.log if entry.kind is not LogKind.LINE]


@given(st.lists(st.tuples(SAME, st.sampled_from([0.01, 1, 1e6])), max_size=12))
def test_a_frame_does_what_the_line_does_that_says_the_same(script: list[tuple[tuple[bytes, str], float]]) -> None:
    in_frames, in_lines = Terminal(p20=16), Terminal()
    for (frame, line), pause in script:
        assert in_frames.send(frame, pause) == in_lines.say(line, pause)
    assert told(in_frames.drive) == told(in_lines.drive)


PIECES = st.one_of(
    SAME.map(lambda same: same[0]),
    SAME.map(lambda same: same[1].encode() + b"\r\n"),
    st.sampled_from(
        [b"S1\r", b"S17\r", b"STOP\r", b"\x13", b"\x11", b"\r", b"PA 5", POSA_360[:5], b"VP\r", b"P20=0\r"]
    ),
    st.binary(max_size=16),
    st.tuples(st.integers(0x84, 0x8F), st.binary(max_size=16)).map(lambda noise: bytes([noise[0]]) + noise[1]),
)
STREAMS = st.lists(PIECES, max_size=10).map(b"".join)
CUTS = st.lists(st.integers(0, 150), max_size=10).map(sorted)
KNOBS = st.fixed_dictionaries(
    {
        "p20": st.sampled_from([0, 16, 17, 18]),
        "baudrate": st.sampled_from([0, 9600]),
        "ready_after_answer": st.booleans(),
        "echo": st.booleans(),
        "password": st.just("off"),
    }
)


def cut(stream: bytes, cuts: list[int]) -> list[bytes]:
    return [stream[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)]


@given(KNOBS, STREAMS, CUTS)
def test_pieces_of_any_size_give_the_same_log(knobs: dict[str, Any], stream: bytes, cuts: list[int]) -> None:
    whole, in_pieces = SimulatedDrive(Knobs(**knobs)), SimulatedDrive(Knobs(**knobs))
    whole.receive(stream, 0)
    for piece in cut(stream, cuts):
        in_pieces.receive(piece, 0)
    whole.advance(100)
    in_pieces.advance(100)
    assert list(in_pieces.log) == list(whole.log)


@given(st.lists(PIECES.filter(lambda piece: piece not in {b"VP\r", b"P20=0\r"}), max_size=10).map(b"".join), CUTS)
def test_pauses_between_pieces_change_no_command(stream: bytes, cuts: list[int]) -> None:
    whole, in_pieces = Terminal(p20=16), Terminal(p20=16)
    whole.send(stream, 100)
    for piece in cut(stream, cuts):
        in_pieces.send(piece, 100)
    lines = whole.drive.log.texts(LogKind.LINE)
    assert in_pieces.drive.log.texts(LogKind.LINE) == lines


@given(st.binary(max_size=200))
def test_noise_does_no_harm_to_the_drive_itself(noise: bytes) -> None:
    """Whatever a frame becomes of it, 30 CRs end it, and the drive answers again."""
    terminal = Terminal(p20=16)
    terminal.send(noise, 100)
    terminal.send(b"\r" * 30, 100)
    assert terminal.say("S17", 1).startswith(b"S017: ")
