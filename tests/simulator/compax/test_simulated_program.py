"""The program memory: records written, read, run, stopped, continued and broken off."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import LogKind

MANUAL = [
    "ACCEL 250", "SPEED 80", "REPEAT 10", "IF I7=1 GOTO 9", "WAIT 100", "END", "OUTPUT O7=1", "GOTO 13", "POSA 1250",
    "OUTPUT O8=1", "WAIT 500", "OUTPUT O8=0", "END",
]  # fmt: skip
"""UG p. 95."""


@pytest.fixture
def terminal() -> Terminal:
    return Terminal()


def with_program(*records: str, **knobs: object) -> Terminal:
    terminal = Terminal(**knobs)
    terminal.drive.load_program(records)
    return terminal


def program_log(terminal: Terminal) -> list[str]:
    return terminal.drive.log.texts(LogKind.PROGRAM)


def outputs(terminal: Terminal) -> list[str]:
    return terminal.drive.log.texts(LogKind.OUTPUT)


def test_the_program_of_the_manual_gives_up_when_its_input_stays_off(terminal: Terminal) -> None:
    for record, text in enumerate(MANUAL, 1):
        assert terminal.ask(f"N{record:03d}: {text}") == ""
    assert [terminal.ask(f"N{record}") for record in range(1, 14)] == [
        f"N{record:03d}: {text}" for record, text in enumerate(MANUAL, 1)
    ]
    assert terminal.say("START", 0.5) == PROMPT
    assert terminal.ask("S17") == "S017: 00010010"
    assert terminal.ask("S16") == "S016: 11000000"
    assert terminal.ask("S11") == "S011: 5"
    terminal.wait(2)
    assert outputs(terminal) == ["O7=1"]
    assert terminal.motions() == []
    assert program_log(terminal) == ["started N001", "ended N013"]
    assert terminal.ask("S17") == "S017: 00000010"
    assert terminal.ask("S16") == "S016: 11010000"
    assert terminal.ask("S11") == "S011: 0"


def test_the_program_of_the_manual_moves_when_its_input_comes(terminal: Terminal) -> None:
    terminal.drive.load_program(MANUAL)
    terminal.say("START", 0.35)
    terminal.drive.inputs[7] = True
    terminal.wait(1)
    assert terminal.ask("S17") == "S017: 00110010"
    assert terminal.ask("PA 5") == "E92"
    terminal.wait(7.2)
    assert terminal.drive.outputs[8]
    assert terminal.drive.position == 1250
    terminal.wait(1)
    assert outputs(terminal) == ["O8=1", "O8=0"]
    assert terminal.motions() == ["motion_started POSA 1250.00", "motion_reached 1250.00"]
    assert program_log(terminal) == ["started N001", "ended N013"]


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("N5 POSA 250", "N005: POSA 250"), ("N005:PA250", "N005: POSA 250"), ("N5: PH", "N005: POSA HOME"),
        ("N5 PA HOME", "N005: POSA HOME"), ("n5 pr 10 sd 50", "N005: POSR 10 SPEED 50"),
        ("N5 PR -.5", "N005: POSR -.5"), ("N5PR10OTO9=1", "N005: POSR 10 OUTPUT O9=1"),
        ("N5 OTO1=1010", "N005: OUTPUT O1=1010"), ("N5 AL- .P40", "N005: ACCEL- .P40"),
        ("N5 SD .V1", "N005: SPEED .V1"),
        ("N5 WAIT START", "N005: WAIT START"), ("N5 GOTO EXT", "N005: GOTO EXT"), ("N5 GOSUB 7", "N005: GOSUB 7"),
        ("N5 IF ERROR GOTO 7", "N005: IF ERROR GOTO 7"), ("N5 IFI1=10GOSUB7", "N005: IF I1=10 GOSUB 7"),
        ("N5 IF V1<=.P40 GOTO 9", "N005: IF V1<=.P40 GOTO 9"), ("N5 V1=V1+1", "N005: V1=V1+1"),
        ("N5 RETURN", "N005: RETURN"), ("N5 REPEAT 3", "N005: REPEAT 3"),
        ("N5 IF STOP GOSUB EXT", "N005: IF STOP GOSUB EXT"),
        ("N5 PR1000000.25OTO10=1", "N005: POSR 1000000.25 OUTPUT O"),
    ],
)  # fmt: skip
def test_a_record_is_written_in_many_forms_and_read_in_one(terminal: Terminal, line: str, shown: str) -> None:
    """Cut to the 30 characters of the output buffer (UG p. 160)."""
    assert terminal.ask("N5") == "N005: END"
    assert terminal.ask(line) == ""
    assert terminal.ask("N5") == shown


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("N5 XY", 90), ("N5 STOP", 90), ("N5 S1", 90), ("N5 GOTO X", 90), ("N5 GOTO 251", 88), ("N5 IF I1 GOTO 5", 90),
        ("N5 RETURN 1", 90), ("N5 END 1", 90), ("N5 WAIT -1", 91), ("N5 REPEAT 0", 91), ("N5 IF I16=11 GOTO 5", 91),
        ("N5 IF I0=1 GOTO 5", 91), ("N5 POSA .P2", 90), ("N5 PA 5$", 90), ("N0 END", 88), ("N251 END", 88),
        ("N251", 88),
        ("N5 POSA 1250                   ", 90), ("N5:", 90), ("END", 90), ("N5 N6 END", 90), ("GOTO 251", 88),
        ("SINGLE 0", 88), ("N5 POSA 1.005", 91),
    ],
)  # fmt: skip
def test_what_is_no_record_is_refused(terminal: Terminal, line: str, code: int) -> None:
    assert terminal.ask(line) == f"E{code}"


def test_a_program_for_a_test_is_checked_too(terminal: Terminal) -> None:
    terminal.drive.load_program(["posa 5", "end"], first=249)
    assert terminal.drive.program == {249: "POSA 5"}
    with pytest.raises(ValueError, match="N251: 'END' is refused: E88"):
        terminal.drive.load_program(["END", "END"], first=250)
    with pytest.raises(ValueError, match="E90"):
        terminal.drive.load_program(["POSR 10".ljust(24) + "OT O9=1"])


def test_inputs_are_those_that_exist(terminal: Terminal) -> None:
    assert not any(terminal.drive.inputs.values())
    with pytest.raises(ValueError, match="I17"):
        terminal.drive.inputs[17] = True


def test_stop_interrupts_a_move_of_the_program_and_start_continues_both() -> None:
    terminal = with_program("POSA 100", "OUTPUT O1=1")
    terminal.say("START", 0.3)
    terminal.say("STOP", 5)
    assert terminal.ask("S16") == "S016: 11010100"
    assert terminal.ask("S17") == "S017: 00000010"
    assert outputs(terminal) == []
    terminal.say("START", 5)
    assert terminal.motions()[1:] == [
        f"motion_stopped {terminal.motions()[1].split()[1]}", "motion_continued POSA 100.00", "motion_reached 100.00",
    ]  # fmt: skip
    assert outputs(terminal) == ["O1=1"]
    assert program_log(terminal) == ["started N001", "stopped N002", "continued N002", "ended N003"]


def test_stop_in_a_wait_keeps_the_time_that_is_left() -> None:
    terminal = with_program("WAIT 1000", "OUTPUT O1=1")
    terminal.say("START", 0.6)
    terminal.say("STOP", 60)
    assert terminal.ask("S16") == "S016: 11010100"
    terminal.say("START", 0.3)
    assert outputs(terminal) == []
    terminal.wait(0.2)
    assert outputs(terminal) == ["O1=1"]


@pytest.mark.parametrize("pause_s", [0.01, 3])
def test_break_ends_a_program(pause_s: float) -> None:
    terminal = with_program("POSR 100", "OUTPUT O1=1")
    terminal.say("START", 0.3)
    terminal.say("STOP", pause_s)
    terminal.say("BREAK", 5)
    assert program_log(terminal)[-1] == "broken off N002"
    terminal.say("START", 0.1)
    assert program_log(terminal)[-1] == "started N001"


def test_wait_start_waits_for_start() -> None:
    terminal = with_program("WAIT START", "OUTPUT O1=1")
    terminal.say("START", 5)
    terminal.say("STOP", 5)
    assert terminal.ask("S16") == "S016: 11010000"
    assert terminal.ask("S17") == "S017: 00010010"
    terminal.say("START", 1)
    assert outputs(terminal) == ["O1=1"]
    assert program_log(terminal) == ["started N001", "ended N003"]


def test_a_move_from_the_line_while_the_program_waits_is_accepted_and_waited_for() -> None:
    terminal = with_program("WAIT 100", "POSA 50", "OUTPUT O1=1")
    terminal.say("START")
    assert terminal.say("PA 100$", 5) == PROMPT + b"$\r\n>"
    assert [text for text in terminal.motions() if "started" in text] == [
        "motion_started POSA 100.00", "motion_started POSA 50.00",
    ]  # fmt: skip
    assert outputs(terminal) == ["O1=1"]


def test_a_program_stopped_while_it_waits_for_a_move_from_the_line_goes_on_after_it() -> None:
    terminal = with_program("WAIT 100", "POSA 50")
    terminal.say("START")
    terminal.say("PA 100", 0.3)
    terminal.say("STOP", 2)
    terminal.say("PA 20", 3)
    terminal.say("START", 3)
    assert terminal.drive.position == 50
    assert program_log(terminal)[-1] == "ended N003"


def test_a_program_may_start_while_a_move_from_the_line_is_under_way() -> None:
    terminal = with_program("OUTPUT O1=1", "POSA 10")
    terminal.say("PA 100", 0.1)
    assert terminal.say("START", 0.1) == PROMPT
    assert outputs(terminal) == ["O1=1"]
    terminal.wait(5)
    assert terminal.drive.position == 10


def test_start_continues_a_move_from_the_line_and_no_program() -> None:
    terminal = with_program("OUTPUT O1=1")
    terminal.say("PA 100", 0.3)
    terminal.say("STOP", 2)
    terminal.say("START", 5)
    assert terminal.drive.position == 100
    assert outputs(terminal) == []


def test_start_begins_where_goto_points_and_a_single_record_comes_back() -> None:
    terminal = with_program("OUTPUT O1=1", "END", "OUTPUT O3=1", "POSA 5", "OUTPUT O5=1")
    assert terminal.ask("GOTO 3") == ""
    terminal.say("SINGLE 5", 1)
    terminal.say("SINGLE 4", 1)
    assert terminal.drive.position == 5
    assert outputs(terminal) == ["O5=1"]
    terminal.say("PA 0", 1)
    terminal.say("START")
    assert terminal.ask("GOTO 1") == "E86"
    assert terminal.ask("SINGLE 1") == "E86"
    terminal.wait(1)
    assert outputs(terminal) == ["O5=1", "O3=1", "O5=1"]


def test_a_single_move_waits_for_the_axis_and_moves_once() -> None:
    terminal = with_program("POSR 5")
    terminal.say("PA 10")
    terminal.say("SINGLE 1", 5)
    assert terminal.drive.position == 15


def test_loops_and_subroutines() -> None:
    terminal = with_program(
        "REPEAT 2", "REPEAT .V1", "GOSUB 10", "END", "V2=V2+10", "END", "OUTPUT O1=1", "END", "END",
        "V2=V2+1", "IF V2>=26 GOTO 13", "RETURN", "V3=S11", "RETURN",
    )  # fmt: skip
    terminal.say("V1=3")
    terminal.say("START", 1)
    assert terminal.ask("V2") == "V002: 26"
    assert outputs(terminal) == ["O1=1"]
    assert program_log(terminal) == ["started N001", "ended N008"]


def test_an_inner_loop_may_be_left_for_the_outer_one() -> None:
    terminal = with_program("REPEAT 3", "REPEAT 5", "V1=V1+1", "GOTO 6", "END", "V2=S11", "END", "OUTPUT O1=1")
    terminal.say("START", 1)
    assert terminal.ask("V1") == "V001: 3"
    assert terminal.ask("V2") == "V002: 3"
    assert outputs(terminal) == ["O1=1"]


@pytest.mark.parametrize(
    ("condition", "met"),
    [("V1=2", True), ("V1<>2", False), ("V1<3", True), (".V1>.P40", False), ("P40>=2.5", True), ("S1<=5", True),
     ("S1>5", False), ("I2=1", True), ("I1=01", True), ("I1=11", False)],
)  # fmt: skip
def test_conditions(condition: str, met: bool) -> None:
    terminal = with_program(f"IF {condition} GOTO 3", "END", "OUTPUT O1=1", position=5)
    terminal.say("V1=2")
    terminal.say("P40=2.5")
    terminal.drive.inputs[2] = True
    terminal.say("START", 1)
    assert terminal.drive.outputs[1] is met


def test_inputs_choose_the_record_of_ext() -> None:
    terminal = with_program("GOSUB EXT", "OUTPUT O1=1", "END", "OUTPUT O4=1", "RETURN")
    terminal.drive.inputs[11] = True
    terminal.say("START", 1)
    assert outputs(terminal) == ["O4=1", "O1=1"]
    terminal.drive.inputs[11] = False
    terminal.say("START", 1)
    assert terminal.drive.fault == 88


def test_home_and_prepared_points_and_arithmetic_in_a_program() -> None:
    terminal = with_program(
        "POSA HOME", "P41=.V1*2", "POSR 10 OUTPUT O9=1", "POSR 5 SPEED 20", "POSA .P41", "POSR -1", machine_zero=5
    )
    terminal.say("V1=20.5")
    assert terminal.say("START", 10) == PROMPT + b"1\r\n>"
    assert terminal.motions() == [
        "motion_started POSA HOME 5.00", "motion_reached 0.00", "motion_started POSA 41.00", "motion_reached 41.00",
        "motion_started POSR 40.00", "motion_reached 40.00",
    ]  # fmt: skip
    assert terminal.drive.homed


@pytest.mark.parametrize(
    ("records", "code"),
    [
        (["RETURN"], 87), (["GOSUB 1"], 87), (["REPEAT 2", "GOSUB 1"], 87), (["POSA 5000"], 93), (["V1=1/0"], 91),
        (["P2=50"], 89), (["SPEED .V9"], 91), (["V1=S99"], 90), (["IF V40=1 GOTO 5"], 90),
    ],
)  # fmt: skip
def test_a_record_that_cannot_be_carried_out_ends_the_program_and_shows(records: list[str], code: int) -> None:
    terminal = with_program(*records, travel_max=1000)
    terminal.say("START", 5)
    assert terminal.ask("S30") == f"S030: {code} 0"
    assert terminal.ask("S17") == "S017: 00000010"
    assert program_log(terminal)[-1].startswith("broken off")


def test_loops_nest_only_so_deep() -> None:
    terminal = with_program(*["REPEAT 2"] * 17)
    terminal.say("START", 1)
    assert terminal.drive.fault == 87


def test_a_repeat_without_end_is_refused() -> None:
    terminal = with_program(*["REPEAT 2"] * 250)
    terminal.say("START", 1)
    assert terminal.drive.fault == 88


def test_a_program_ends_behind_the_last_record() -> None:
    terminal = Terminal()
    terminal.drive.load_program(["OUTPUT O1=1"], first=250)
    terminal.say("GOTO 250")
    terminal.say("START", 1)
    assert program_log(terminal) == ["started N250", "ended N250"]


def test_a_fault_ends_a_program() -> None:
    terminal = with_program("POSA 100", "OUTPUT O1=1")
    terminal.say("START", 0.3)
    terminal.drive.raise_fault(55)
    terminal.wait(5)
    assert program_log(terminal) == ["started N001", "broken off N002"]
    assert outputs(terminal) == []


def test_if_error_takes_over_after_a_fault() -> None:
    terminal = with_program("IF ERROR GOTO 4", "POSA 100", "END", "OUTPUT O4=1")
    terminal.say("START", 0.3)
    terminal.drive.raise_fault(55)
    terminal.wait(1)
    assert outputs(terminal) == ["O4=1"]
    assert program_log(terminal) == ["started N001", "ended N005"]


def test_if_stop_takes_over_after_stop_and_return_waits_for_start() -> None:
    terminal = with_program("IF STOP GOSUB 5", "POSA 100", "OUTPUT O1=1", "END", "OUTPUT O5=1", "RETURN")
    terminal.say("START", 0.3)
    terminal.say("STOP", 5)
    assert outputs(terminal) == ["O5=1"]
    assert program_log(terminal) == ["started N001", "stopped N003"]
    terminal.say("START", 5)
    assert terminal.drive.position == 100
    assert outputs(terminal) == ["O5=1", "O1=1"]


def test_an_if_stop_that_leads_nowhere_breaks_off() -> None:
    terminal = with_program("IF STOP GOTO EXT", "WAIT 1000")
    terminal.say("START", 0.3)
    terminal.say("STOP", 1)
    assert program_log(terminal) == ["started N001", "broken off N003"]


def test_power_off_ends_the_program_and_keeps_the_memory() -> None:
    terminal = with_program("POSA 100", "OUTPUT O1=1")
    terminal.say("START", 0.3)
    terminal.drive.power_cycle()
    terminal.wait(5)
    assert outputs(terminal) == []
    assert terminal.ask("N1") == "N001: POSA 100"


def test_an_endless_program_takes_bounded_time() -> None:
    terminal = with_program("V1=V1+1", "GOTO 1")
    terminal.say("START", 1)
    assert terminal.ask("V1") == "V001: 250"
    assert terminal.ask("STOP") == ""


@given(st.lists(st.floats(0.001, 3), max_size=8), st.lists(st.sampled_from(["STOP", "START", "PA 7"]), max_size=8))
def test_steps_of_time_of_any_size_give_the_same_program(steps: list[float], lines: list[str]) -> None:
    logs = []
    for parts in (1, 7):
        terminal = with_program("REPEAT 3", "POSR 10", "WAIT 30", "OUTPUT O1=1", "POSR -5", "END")
        terminal.say("START")
        for step, line in zip(steps, lines, strict=False):
            terminal.say(line, 0)
            at = terminal.now
            for part in range(1, parts + 1):
                terminal.now = at
                terminal.wait(step * part / parts)
        logs.append([(round(entry.at, 6), entry.kind, entry.text) for entry in terminal.drive.log])
    assert logs[0] == logs[1]
