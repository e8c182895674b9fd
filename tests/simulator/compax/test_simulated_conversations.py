"""Byte for byte, the conversations that the manuals print, and what follows from their rules."""

from __future__ import annotations

import pytest
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import LogKind


@pytest.fixture
def terminal() -> Terminal:
    """A terminal on a drive as it comes: 200 mm/s at 100 %, ramps of 250 ms."""
    return Terminal()


def test_comparators_speak_with_their_number_in_the_order_of_travel(terminal: Terminal) -> None:
    """UG p. 162: numbered as programmed, passed in the order of the path."""
    assert terminal.say("PR 200 OT O9=1") == PROMPT
    assert terminal.say("PR 100 OT O10=1") == PROMPT
    assert terminal.say("POSA1000$") == PROMPT
    assert terminal.wait(20) == b"2\r\n>1\r\n>$\r\n>"
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O10=1", "O9=1"]
    assert terminal.drive.outputs[9]
    assert terminal.drive.outputs[10]


def test_the_minimal_conversation(terminal: Terminal) -> None:
    """A minimal conversation; the position on the way is a matter of time."""
    assert terminal.say("S17") == b"S017: 00000010\r\n>"
    assert terminal.say("GOTO 302") == PROMPT
    assert terminal.say("SD 50") == PROMPT
    assert terminal.say("AL 250") == PROMPT
    assert terminal.say("PA 1000$") == PROMPT
    # 100 mm/s after a ramp of 125 ms, which costs half of its time, and 1 ms behind.
    terminal.wait(4.1872 - 0.01)
    assert terminal.say("S1") == b"S001: 412.37\r\n>"
    assert terminal.wait(20) == b"$\r\n>"
    assert terminal.say("S1") == b"S001: 1000.00\r\n>"


def test_the_documented_error_history(terminal: Terminal) -> None:
    """UG p. 209: E53 acknowledged, E10 not acknowledged when E55 came, another E10 closed by power-on."""
    drive = terminal.drive
    drive.raise_fault(20)
    terminal.say("QUIT")
    drive.raise_fault(10)
    drive.power_cycle()
    drive.raise_fault(53)
    terminal.say("QUIT")
    drive.raise_fault(10)
    drive.raise_fault(55)
    terminal.say("QUIT")
    assert terminal.send(b"S18\r\n") == b"S018: 99 55 10 99 53 98 10 99\r\n>"


@pytest.mark.parametrize(
    "line",
    ["POSA 12.5", "PA12.5", "P A 1 2 . 5", "POSA +12.50", "posa 12.5", "PA 12.500", "POSR 12.5", "PR12.5", "PA012.5"],
)
def test_a_command_has_many_forms(terminal: Terminal, line: str) -> None:
    assert terminal.say(line) == PROMPT
    terminal.wait(5)
    assert terminal.ask("S1") == "S001: 12.50"


@pytest.mark.parametrize("query", ["S1", "S01", "S001", " S 1", "s1"])
def test_leading_zeros_and_blanks_of_a_query_are_not_needed(terminal: Terminal, query: str) -> None:
    assert terminal.ask(query) == "S001: 0.00"


@pytest.mark.parametrize(
    "line",
    [
        "PA", "PA x", "PA 1e3", "PA 1,5", "PA nan", "PAPA 1", "XY", "S", "S99", "P251", "S1$", "SD 50$", "PA 1$$", "!?",
        "PA 1!", "STOPS", "STOP 1", "OT O0", "OT O1", "OT 1=1", "GOTO X", "PR 5 OT O1=2", "PR 5 SD", "PH 5", "$", "?",
        "PR 5 OT O1=1$", "AL", "\x01S1", "S1\x7f", ">",
    ],
)  # fmt: skip
def test_what_means_nothing_is_a_syntax_error(terminal: Terminal, line: str) -> None:
    assert terminal.ask(line) == "E90"
    assert terminal.motions() == []


@pytest.mark.parametrize(
    "line",
    [
        "PA 1.005", "PA 4000000.01", "PR -4000001", "SD 0", "SD 601", "SD 1.0005", "AL +65001", "AL 65001", "AL 1.5",
        "AL- 65001", "PR 5 SD 1.5", "PR 5 SD 0", "PR -5 SD 50", "PR 0 OT O1=1", "PR 5 OT O17=1", "PR 5 OT O0=1",
        "OT O17=1", "OT O16=11", "OT O1=2", "OT O0=3", "ACCEL-- 5",
    ],
)  # fmt: skip
def test_a_number_out_of_range_is_refused(terminal: Terminal, line: str) -> None:
    assert terminal.ask(line) == "E91"


def test_blanks_mean_so_little_that_a_negative_acceleration_is_a_deceleration(terminal: Terminal) -> None:
    """``AL -500`` without its blank is ``AL-500``, and that is ``AL- 500``."""
    terminal.say("AL -500")
    terminal.say("PA 200", 60)
    ended_at = next(entry.at for entry in terminal.drive.log if entry.kind is LogKind.MOTION_REACHED)
    assert ended_at == pytest.approx(0.012 + 1 + 0.125 + 0.25)


def test_bytes_of_eight_bits_spoil_their_line_only(terminal: Terminal) -> None:
    assert terminal.send(b"\x88\xffPA 5\r") == b"E90\r\n>"
    assert terminal.ask("S1") == "S001: 0.00"


def test_an_empty_line_gets_a_prompt(terminal: Terminal) -> None:
    assert terminal.send(b"\r\n") == PROMPT


def test_positioning_is_refused_while_the_axis_moves(terminal: Terminal) -> None:
    """UG p. 162 and 209."""
    terminal.say("PA 100$")
    for line in ("PA 50", "PR 10", "PH", "POSA HOME", "PA HOME", "OT O0=1"):
        assert terminal.ask(line) == "E92"
    assert terminal.wait(5) == b"$\r\n>"
    assert terminal.motions() == ["motion_started POSA 100.00", "motion_reached 100.00"]
    assert terminal.say("PA 50") == PROMPT


def test_preparations_during_a_move_are_for_the_next_one(terminal: Terminal) -> None:
    terminal.say("PA 100")
    assert terminal.say("PR 10 OT O1=1") == PROMPT
    assert terminal.say("SD 10") == PROMPT
    assert terminal.wait(2) == b""
    assert terminal.drive.prepared_points == 1
    terminal.say("PR -50")
    assert terminal.drive.prepared_points == 0
    assert terminal.wait(0.4) == b""
    assert terminal.wait(0.6) == b"1\r\n>"
    assert terminal.ask("S4") == "S004: -10.00"


def test_at_most_eight_points_are_prepared(terminal: Terminal) -> None:
    for i in range(1, 9):
        assert terminal.say(f"PR {i} OT O{i}=1" if i % 2 else f"PR {i} SD {i}") == PROMPT
    assert terminal.ask("PR 9 OT O9=1") == "E95"
    terminal.say("PA 20")
    assert terminal.wait(20) == b"1\r\n>2\r\n>3\r\n>4\r\n>"


def test_speed_steps_change_the_speed_on_the_way(terminal: Terminal) -> None:
    terminal.say("PR 100 SD 25")
    terminal.say("PA 300")
    terminal.wait(0.5)
    assert terminal.ask("S4") == "S004: 100.00"
    terminal.wait(1)
    assert terminal.ask("S4") == "S004: 25.00"
    terminal.wait(10)
    assert terminal.ask("S1") == "S001: 300.00"


def test_a_point_beyond_the_target_is_never_passed(terminal: Terminal) -> None:
    terminal.say("PR 20 OT O1=1")
    terminal.say("PR 10 OT O2=1")
    terminal.say("PA 10$")
    assert terminal.wait(5) == b"2\r\n>$\r\n>"
    terminal.say("PA 100$")
    assert terminal.wait(5) == b"$\r\n>"


def test_homing_finds_machine_zero_and_cancels_points() -> None:
    terminal = Terminal(position=30, machine_zero=-12.5)
    terminal.say("PR 1 OT O1=1")
    assert terminal.ask("S16")[8] == "0"
    assert terminal.say("PH$") == PROMPT
    assert terminal.wait(5) == b"$\r\n>"
    assert terminal.motions() == ["motion_started POSA HOME 17.50", "motion_reached 0.00"]
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.ask("S16") == "S016: 11111000"
    assert terminal.drive.homed
    terminal.say("PA 5")
    terminal.wait(5)
    terminal.say("POSA HOME", 5)
    assert terminal.motions()[-2:] == ["motion_started POSA HOME 0.00", "motion_reached 0.00"]


def test_a_stopped_move_is_continued_to_its_target(terminal: Terminal) -> None:
    terminal.say("PR 100 OT O3=1")
    terminal.say("PA 200$")
    terminal.wait(0.3)
    assert terminal.say("STOP") == PROMPT
    assert terminal.ask("S17") == "S017: 00100010"
    assert terminal.wait(1) == b""
    assert terminal.ask("S17") == "S017: 00000010"
    assert terminal.ask("S16") == "S016: 11010100"
    assert terminal.ask("S2") == "S002: 200.00"
    stopped_at = terminal.drive.position
    assert 20 < stopped_at < 100
    assert terminal.say("START") == PROMPT
    assert terminal.ask("S16") == "S016: 11000000"
    assert terminal.wait(5) == b"1\r\n>$\r\n>"
    assert terminal.motions() == [
        "motion_started POSA 200.00",
        f"motion_stopped {stopped_at:.2f}",
        "motion_continued POSA 200.00",
        "motion_reached 200.00",
    ]


def test_start_during_the_stop_ramp_continues_from_standstill(terminal: Terminal) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    terminal.say("STOP")
    assert terminal.say("START") == PROMPT
    assert terminal.wait(5) == b"$\r\n>"
    assert len(terminal.motions()) == 4


def test_a_second_stop_takes_start_back(terminal: Terminal) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    for line in ("STOP", "START", "STOP"):
        assert terminal.say(line) == PROMPT
    assert terminal.wait(5) == b""
    assert len(terminal.motions()) == 2


@pytest.mark.parametrize("lines", [["BREAK"], ["STOP", "BREAK"], ["BREAK", "STOP"]])
@pytest.mark.parametrize("pause_s", [0.01, 2.0])
def test_start_does_not_continue_after_break(terminal: Terminal, lines: list[str], pause_s: float) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    for line in lines:
        assert terminal.say(line, pause_s) == PROMPT
    assert terminal.say("START") == PROMPT
    assert terminal.wait(5) == b""
    assert len(terminal.motions()) == 2
    assert terminal.ask("S16") == "S016: 11010100"


def test_a_new_move_replaces_a_stopped_one(terminal: Terminal) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    terminal.say("STOP", 1)
    assert terminal.say("PA 10$", 5) == PROMPT + b"$\r\n>"
    terminal.say("START", 5)
    assert terminal.ask("S1") == "S001: 10.00"


@pytest.mark.parametrize("line", ["STOP", "BREAK", "START", "QUIT", "SP", "BR", "ST", "QT"])
def test_control_functions_with_nothing_to_do_are_accepted(terminal: Terminal, line: str) -> None:
    assert terminal.say(line) == PROMPT
    assert terminal.ask("S16") == "S016: 11010000"


def test_a_fault_stops_the_move_and_refuses_others_until_it_is_acknowledged(terminal: Terminal) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    terminal.drive.raise_fault(55)
    assert terminal.drive.fault == 55
    assert terminal.wait(5) == b""
    assert terminal.motions()[-1].startswith("motion_fault ")
    assert terminal.ask("S16") == "S016: 01000000"
    assert terminal.ask("S17") == "S017: 00000000"
    assert terminal.ask("S30") == "S030: 55 0"
    assert terminal.ask("PA 5") == "E94"
    assert terminal.say("START") == PROMPT
    assert terminal.say("QUIT") == PROMPT
    assert terminal.ask("S30") == "S030: 0 0"
    assert terminal.ask("S17") == "S017: 00000010"
    assert len(terminal.motions()) == 2
    assert terminal.say("PA 5") == PROMPT


def test_a_stop_during_the_ramp_of_a_fault_makes_it_no_milder(terminal: Terminal) -> None:
    terminal.say("PA 200$")
    terminal.wait(0.5)
    terminal.drive.raise_fault(10)
    terminal.say("STOP", 1)
    terminal.say("QUIT")
    terminal.say("START")
    assert len(terminal.motions()) == 2


def test_a_stopped_move_is_not_continued_while_the_power_stage_is_off(terminal: Terminal) -> None:
    terminal.say("PA 200")
    terminal.wait(0.5)
    terminal.say("STOP", 1)
    terminal.say("OT O0=1")
    assert terminal.ask("START") == "E97"
    terminal.say("OT O0=0")
    assert terminal.say("START", 5) == PROMPT
    assert terminal.ask("S1") == "S001: 200.00"


def test_a_warning_stops_nothing(terminal: Terminal) -> None:
    terminal.say("PA 100$")
    terminal.drive.raise_fault(60)
    assert terminal.ask("S16") == "S016: 10000000"
    assert terminal.wait(5) == b"$\r\n>"
    terminal.say("QUIT")
    assert terminal.ask("S18") == "S018: 99 60 00 00 00 00 00 00"


@pytest.mark.parametrize("code", [0, 98, 99, -1, 100])
def test_marks_of_the_history_are_no_faults(terminal: Terminal, code: int) -> None:
    with pytest.raises(ValueError, match="1 to 97"):
        terminal.drive.raise_fault(code)


@pytest.mark.parametrize(("mode", "bits", "running"), [(0, "00", "1"), (1, "10", "0"), (2, "01", "0")])
def test_output_0_switches_the_power_stage(terminal: Terminal, mode: int, bits: str, running: str) -> None:
    """UG p. 209 for S16; off is refused to be moved."""
    assert terminal.say(f"OUTPUT O0={mode}") == PROMPT
    assert terminal.ask("S16") == f"S016: 110100{bits}"
    assert terminal.ask("S17") == f"S017: 000000{running}0"
    assert terminal.say("PA 5") == (PROMPT if mode == 0 else b"E97\r\n>")


def test_several_outputs_are_set_at_once(terminal: Terminal) -> None:
    """UG p. 95: up to eight digits, consecutive outputs."""
    assert terminal.say("OUTPUT O7=101") == PROMPT
    assert [number for number, value in terminal.drive.outputs.items() if value] == [7, 9]
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O7=1", "O8=0", "O9=1"]


def test_passwords_show_in_s17(terminal: Terminal) -> None:
    terminal.say("GOTO 302")
    assert terminal.ask("S17") == "S017: 10000010"
    terminal.say("GOTO 620")
    assert terminal.ask("S17") == "S017: 11000010"
    terminal.say("GOTO 270")
    assert terminal.ask("S17") == "S017: 00000010"


def test_settings_are_those_in_force_when_the_move_begins(terminal: Terminal) -> None:
    terminal.say("ACCEL 1000")
    terminal.say("ACCEL- 500")
    terminal.say("SPEED 50")
    begun_at = terminal.now
    terminal.say("PA 100")
    terminal.say("SPEED 1")
    terminal.wait(60)
    # Half the speed: half of 1000 ms and half of 500 ms; 100 mm at 100 mm/s; executed 2 ms after its CR.
    ended_at = next(entry.at for entry in terminal.drive.log if entry.kind is LogKind.MOTION_REACHED)
    assert ended_at - begun_at == pytest.approx(0.002 + 1 + 0.25 + 0.125)


def test_following_error_is_there_on_the_way_and_gone_at_the_target(terminal: Terminal) -> None:
    terminal.say("PA 200")
    terminal.wait(0.5)
    assert terminal.ask("S3") == "S003: 0.20"
    assert terminal.ask("S5") == "S005: 5.00"
    terminal.wait(5)
    assert terminal.ask("S3") == "S003: 0.00"
    terminal.say("PA 0")
    assert float(terminal.ask("S5").split()[1]) == -25


def test_targets_outside_the_travel_range_are_refused() -> None:
    terminal = Terminal(travel_min=-10, travel_max=100)
    assert terminal.ask("PA 100.01") == "E93"
    assert terminal.ask("PR -10.01") == "E93"
    assert terminal.say("PA 100") == PROMPT


@pytest.mark.parametrize(
    ("query", "answer"),
    [
        ("S2", "S002: 0.00"), ("S4", "S004: 0.00"), ("S6", "S006: 35.00"), ("S7", "S007: 24.00"),
        ("S8", "S008: 320.00"),
        ("S9", "S009: 0"), ("S10", "S010: 0"), ("S11", "S011: 0"), ("S12", "S012: 0.00"), ("S13", "S013: 0.00"),
        ("S18", "S018: 00 00 00 00 00 00 00 00"), ("S30", "S030: 0 0"),
        ("P1", "P001: 0.000"), ("P2", "P002: 100.000"), ("P6", "P006: 250"), ("P10", "P010: 100"),
        ("P11", "P011: 4000000.000"), ("P12", "P012: -4000000.000"), ("P14", "P014: 1.000"), ("P20", "P020: 0"),
        ("P90", "P090: 1.000"),
    ],
)  # fmt: skip
def test_values_of_a_new_drive(terminal: Terminal, query: str, answer: str) -> None:
    assert terminal.ask(query) == answer


def test_an_instruction_is_stored_and_executed_later(terminal: Terminal) -> None:
    """UG p. 160: "," and "!"; the memory holds one instruction."""
    assert terminal.say("PA 7$,") == PROMPT
    assert terminal.say("PA 9$ ,") == PROMPT
    assert terminal.ask("S17") == "S017: 00000010"
    assert terminal.say("!") == PROMPT
    assert terminal.wait(5) == b"$\r\n>"
    assert terminal.ask("S1") == "S001: 9.00"
    assert terminal.ask("!") == "E96"


def test_what_cannot_be_interpreted_is_not_stored(terminal: Terminal) -> None:
    assert terminal.ask("PA x,") == "E90"
    assert terminal.ask("!") == "E96"


def test_a_stored_query_is_answered_when_it_is_executed(terminal: Terminal) -> None:
    assert terminal.say("S1,") == PROMPT
    assert terminal.ask("!") == "S001: 0.00"


def test_messages_never_come_into_the_middle_of_an_answer_but_may_come_before_it(terminal: Terminal) -> None:
    terminal.say("PA 100$")
    terminal.wait(0.75 - 0.01 + 0.001)
    assert terminal.say("S1") == b"$\r\n>S001: 100.00\r\n>"


def test_a_message_never_comes_before_the_prompt_of_its_own_command(terminal: Terminal) -> None:
    assert terminal.say("PA 0$") == PROMPT + b"$\r\n>"
    terminal.drive.extra_answer_delay_s = 2
    assert terminal.say("PA 10$", 1.9) == b""
    assert terminal.drive.position == 10
    assert terminal.wait(1) == PROMPT + b"$\r\n>"
