"""Every form of every program command is kept; what the manuals do not explain fails when it is executed."""

from __future__ import annotations

import re

import pytest
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.compax.facts.program_commands import PROGRAM_COMMANDS
from compax_aio.simulator.compax import LogKind

PLACES = {
    "ramp_ms": "250", "percent": "12.5", "wait_ms": "70000", "position": "-7.25", "distance": "7.5", "point": "10.5",
    "step_percent": "50", "output": "9", "level": "1", "levels": "101", "mode": "1", "password": "302", "record": "7",
    "count": "70000", "jump": "GOSUB 7", "input": "3", "value": "V1", "comparison": ">=", "target": "P40",
    "arithmetic": "+",
}  # fmt: skip


def filled(form: str) -> str:
    return re.sub("{([a-z_]+)}", lambda found: PLACES[found[1]], form)


@pytest.fixture
def terminal() -> Terminal:
    return Terminal()


@pytest.mark.parametrize("row", PROGRAM_COMMANDS, ids=lambda row: row.long)
def test_every_form_is_written_long_or_short_and_read_long(row: object) -> None:
    terminal = Terminal()
    long, short = filled(row.long), filled(row.short)  # type: ignore[attr-defined]
    for text in (long, short, long.replace(" ", "")):
        if len(f"N1{text}") <= 30:
            terminal.say("N1 END")
            assert terminal.ask(f"N1{text}") == ""
            assert terminal.drive.program.get(1, "END") == long


@pytest.mark.parametrize(
    "text", ["SPEED SYNC", "POSR CAM", "WAIT POSA 5", "WAIT POSR -5", "LOOP 3", "LOOP .V1", "SD SYNC", "PR CAM"]
)
def test_what_is_not_simulated_ends_the_program_that_comes_to_it(terminal: Terminal, text: str) -> None:
    terminal.say("V1=3")
    terminal.drive.load_program([text, "OUTPUT O1=1"])
    terminal.say("START", 1)
    assert terminal.drive.log.texts(LogKind.PROGRAM)[1] == "N001 refused: E84 not simulated"
    assert terminal.ask("S30") == "S030: 84 0"
    assert not terminal.drive.outputs[1]
    assert terminal.motions() == []


@pytest.mark.parametrize("line", ["SPEED SYNC", "PR CAM", "LOOP 3"])
def test_what_is_not_simulated_is_refused_on_the_line(terminal: Terminal, line: str) -> None:
    assert terminal.ask(line) == "E84"


@pytest.mark.parametrize(
    ("line", "code"),
    [("LOOP", 90), ("LOOP 0", 91), ("SPEED SYNCED", 90), ("PR CAM 1", 90), ("N1 WAIT POSA", 90), ("WAIT 5", 90),
     ("N1 WAIT POSA 5.001", 91), ("N1 SPEED 50 WAIT", 90), ("N1 SPEED WAIT 5", 90), ("N1 SPEED SYNC WAIT 5", 90),
     ("N1 SPEED 601 WAIT 5", 91), ("SPEED 50 WAIT 5", 90), ("N1 GOSUB 302", 88), ("N1 IF I1=1 GOTO 302", 88),
     ("N1 WAIT 8388608", 91), ("N1 REPEAT 8388608", 91)],
)  # fmt: skip
def test_what_is_almost_such_a_form_is_refused(terminal: Terminal, line: str, code: int) -> None:
    assert terminal.ask(line) == f"E{code}"


@pytest.mark.parametrize("record", ["SPEED 50 WAIT 500", "SD .P40 WAIT .V1"])
def test_speed_and_wait_in_one_record(terminal: Terminal, record: str) -> None:
    """CAN p. 59, 61."""
    terminal.say("P40=50")
    terminal.say("V1=500")
    terminal.drive.load_program([record, "POSA 1000"])
    terminal.say("START", 0.4)
    assert not terminal.drive.moving
    terminal.wait(1)
    assert terminal.ask("S4") == "S004: 50.00"


def test_a_password_in_a_record_is_no_jump(terminal: Terminal) -> None:
    """CAN p. 32."""
    terminal.drive.load_program(["GOTO 302", "P2=50", "GOTO 270", "P3=1"])
    terminal.say("START", 1)
    assert terminal.ask("P2") == "P002: 50.000"
    assert terminal.drive.log.texts(LogKind.PROGRAM)[1] == "N004 refused: E89 password needed"
    assert terminal.ask("S17")[6] == "0"


@pytest.mark.parametrize("line", ["POSR 100 SPEED 20 ACCEL 5000", "PR100 SD20 AL5000", "PR .V1 SD .V2 AL .V3"])
def test_a_speed_step_with_a_ramp_of_its_own(terminal: Terminal, line: str) -> None:
    """IBS p. 43: 5000 ms from nominal speed to standstill are 40 mm/s a second; back up it is ACCEL again."""
    for each in ("V1=100", "V2=20", "V3=5000", "PR 500 SD 100"):
        terminal.say(each)
    assert terminal.ask(line) == ""
    terminal.say("PA 1000", then_wait_s=0.002)
    terminal.wait(0.125 + 0.5 + 1)
    assert float(terminal.ask("S4").split()[1]) == pytest.approx(80, abs=0.5)
    terminal.wait(60)
    assert terminal.ask("S1") == "S001: 1000.00"


@pytest.mark.parametrize(
    ("line", "code"), [("PR 5 SD 50 AL 1.5", 91), ("PR 5 SD 50 AL 65001", 91), ("PR 5 SD 50 AL", 90)]
)
def test_the_ramp_of_a_step_is_whole_milliseconds(terminal: Terminal, line: str, code: int) -> None:
    assert terminal.ask(line) == f"E{code}"


def test_inputs_choose_where_start_begins(terminal: Terminal) -> None:
    """CAN p. 32, 59: GOTO EXT; which inputs is a placeholder."""
    terminal.drive.load_program(["OUTPUT O1=1", "END", "OUTPUT O2=1"])
    assert terminal.ask("GOTO EXT") == "E88"
    terminal.drive.inputs[9] = terminal.drive.inputs[10] = True
    assert terminal.say("GOTO EXT") == PROMPT
    terminal.say("START", 1)
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O2=1"]
