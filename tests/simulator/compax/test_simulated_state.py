"""What a drive keeps without power is saved whole and loaded strictly, or not at all."""

from __future__ import annotations

import copy
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.compax.state import read_state_file, write_state_file


@pytest.fixture
def terminal() -> Terminal:
    """A drive with a history: everything that is kept is not as it was at the beginning."""
    terminal = Terminal(position=5, machine_zero=20)
    for line in ("GOTO 302", "P2=50", "P1=2.5", "VP", "P40=1.25", "V5=-7.5", "N3 PR 100 OT O9=1", "N250 PA.V5"):
        assert terminal.ask(line) == ""
    terminal.drive.raise_fault(53)
    terminal.say("QUIT")
    terminal.say("PH", 5)
    terminal.say("PA 30", 5)
    return terminal


@pytest.fixture
def state(terminal: Terminal) -> dict[str, Any]:
    return terminal.drive.save_state()


def loaded(state: dict[str, Any], **knobs: Any) -> Terminal:
    terminal = Terminal(**knobs)
    terminal.drive.load_state(state)
    return terminal


def test_what_a_drive_keeps_is_plain_data(state: dict[str, Any]) -> None:
    assert state == {
        "kind": "simulated COMPAX",
        "version": 1,
        "parameters": {"P1": 2.5, "P2": 50.0, "P40": 1.25},
        "variables": {"V5": -7.5},
        "program": {"N3": "POSR 100 OUTPUT O9=1", "N250": "POSA .V5"},
        "error_history": [99, 53, 0, 0, 0, 0, 0, 0],
        "error_present": False,
        "axis": {"position": 30.0, "machine_zero": -2.5, "homed": True},
        "cycles": 2,
        "operating_time_s": pytest.approx(10.09),
    }
    assert json.loads(json.dumps(state)) == state


def test_a_state_may_be_written_as_toml() -> None:
    text = """
        kind = "simulated COMPAX"
        version = 1
        error_history = [55, 0, 0, 0, 0, 0, 0, 0]
        error_present = true
        cycles = 3
        operating_time_s = 7200
        [parameters]
        [variables]
        V1 = 4
        [program]
        [axis]
        position = 1
        machine_zero = 0
        homed = false
        """
    terminal = loaded(tomllib.loads(text))
    assert [terminal.ask(query) for query in ("S1", "S9", "S10", "V1")] == [
        "S001: 1.00", "S009: 3", "S010: 2", "V001: 4",
    ]  # fmt: skip


def test_another_drive_goes_on_where_the_first_one_was(state: dict[str, Any]) -> None:
    terminal = loaded(state)
    expected = {
        "S1": "30.00", "S2": "30.00", "S9": "2", "S18": "99 53 00 00 00 00 00 00", "P1": "2.500", "P2": "50.000",
        "P40": "1.25", "V5": "-7.5", "V6": "0", "N3": "POSR 100 OUTPUT O9=1", "N4": "END", "S16": "11110000",
    }  # fmt: skip
    assert {query: terminal.ask(query).split(": ")[1] for query in expected} == expected
    assert terminal.drive.homed
    assert terminal.motions() == []
    terminal.say("PH", 5)
    assert terminal.motions()[0] == "motion_started POSA HOME -2.50"


def test_saving_what_was_loaded_gives_the_same(state: dict[str, Any]) -> None:
    drive = SimulatedDrive()
    drive.load_state(state, now=1e6)
    state["operating_time_s"] = pytest.approx(state["operating_time_s"])
    assert drive.save_state() == state


def test_everything_else_is_as_after_power_on() -> None:
    terminal = Terminal()
    for line in ("GOTO 302", "SD 10", "AL 1", "P3=9", "PR 5 OT O1=1", "OT O2=1", "PA 5,", "OT O0=1"):
        assert terminal.ask(line) == ""
    terminal.drive.load_state(terminal.drive.save_state())
    assert terminal.ask("S17") == "S017: 00000010"
    assert terminal.drive.prepared_points == 0
    assert not any(terminal.drive.outputs.values())
    assert terminal.ask("P3") == "P003: 0.000"
    assert terminal.ask("!") == "E96"
    terminal.say("PA 100", 0.4)
    assert terminal.ask("S4") == "S004: 100.00"


def test_a_state_can_be_saved_on_the_way_and_changes_nothing_there() -> None:
    terminal = Terminal()
    terminal.say("PA 100$", 0.3)
    state = terminal.drive.save_state(terminal.now)
    assert terminal.wait(5) == b"$\r\n>"
    other = loaded(state)
    assert 0 < other.drive.position < 100
    assert not other.drive.moving
    assert other.say("PA 100$", 5) == PROMPT + b"$\r\n>"


def test_loading_ends_what_was_under_way() -> None:
    terminal = Terminal()
    empty = terminal.drive.save_state()
    terminal.drive.load_program(["POSA 100", "POSA 0"])
    terminal.say("START", 0.3)
    terminal.drive.load_state(empty)
    assert terminal.wait(60) == b""
    assert not terminal.drive.moving
    assert terminal.drive.position == 0
    assert terminal.drive.log.texts(LogKind.MOTION_STARTED) == ["POSA 100.00"]
    assert terminal.drive.log.texts(LogKind.POWER) == ["off", "on"]
    assert terminal.drive.program == {}


@pytest.mark.parametrize("code", [55, 60])
def test_an_error_that_was_present_is_closed_by_the_power(code: int) -> None:
    """UG p. 209: 98."""
    terminal = Terminal()
    terminal.drive.raise_fault(code)
    other = loaded(terminal.drive.save_state())
    assert other.ask("S18") == f"S018: 98 {code} 00 00 00 00 00 00"
    assert other.ask("S30") == "S030: 0 0"
    assert other.say("PA 1") == PROMPT


def test_knobs_are_no_state(state: dict[str, Any]) -> None:
    terminal = loaded(state, speed_percent=20, acceleration_ms=999, position=77, decimals=3)
    assert terminal.ask("P2") == "P002: 50.000"
    assert terminal.ask("P6") == "P006: 999"
    assert terminal.ask("S1") == "S001: 30.000"
    assert terminal.drive.knobs == Knobs(speed_percent=20, acceleration_ms=999, position=77, decimals=3)


def test_operating_hours_go_on() -> None:
    terminal = Terminal()
    terminal.wait(5400)
    other = loaded(terminal.drive.save_state(terminal.now))
    assert other.ask("S10") == "S010: 1"
    other.wait(1800)
    assert other.ask("S10") == "S010: 2"


def test_serial_parameters_are_in_force_at_once() -> None:
    terminal = Terminal(password="off")
    terminal.say("P20=3")
    terminal.say("VP")
    other = loaded(terminal.drive.save_state())
    assert other.send(b"\x13S1\r") == b""
    assert other.send(b"\x11") == b"S001: 0.00\r\n>"
    assert other.ask("XY") == ""


def test_what_is_not_in_a_state_is_as_it_was_at_the_beginning(state: dict[str, Any]) -> None:
    terminal = Terminal(password="off", acceleration_ms=300)
    for line in ("P6=77", "P41=5", "V6=5", "N9 PA 5", "VP", "P7=8", "GOTO 9"):
        assert terminal.ask(line) == ""
    terminal.drive.load_state(state)
    assert [terminal.ask(query) for query in ("P6", "P7", "P41", "V6", "N9")] == [
        "P006: 300", "P007: 0", "P041: 0", "V006: 0", "N009: END",
    ]  # fmt: skip
    terminal.say("START", 0.01)
    assert terminal.drive.log.texts(LogKind.PROGRAM)[0] == "started N001"


def changed(state: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Give a copy with another value at ``a.b``; None takes it away."""
    state = copy.deepcopy(state)
    *tables, name = path.split(".")
    table = state
    for each in tables:
        table = table[each]
    if value is None:
        del table[name]
    else:
        table[name] = value
    return state


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("kind", "parameters", "must say kind 'simulated COMPAX' and version 1"), ("version", 2, "version 1"),
        ("cycles", None, "cycles is missing"), ("speed", 5, "'speed' means nothing"),
        ("axis.homed", None, "axis: homed is missing"), ("axis.x", 1, "axis: 'x' means nothing"),
        ("axis.homed", 1, "homed = 1 is neither true nor false"), ("axis", [1], "axis is no table"),
        ("axis.position", "5", "position = '5' is no such number"),
        ("axis.position", float("nan"), "position = nan is no such number"), ("axis.position", True, "position = True"),
        ("axis.machine_zero", 10**400, "machine_zero = 1000"), ("cycles", 1.5, "cycles = 1.5 is no count"),
        ("cycles", -1, "cycles = -1"), ("operating_time_s", -1, "operating_time_s = -1"),
        ("error_present", "no", "error_present = 'no'"), ("error_history", [55], "error_history has 8 codes"),
        ("error_history", [55, 0, 0, 0, 0, 0, 0, 100], "codes from 0 to 99"),
        ("error_history", [55, 0, 0, 0, 0, 0, 0, True], "codes from 0 to 99"),
        ("parameters", {"P02": 5}, "'P02' is not one of P1, P2"), ("parameters", {"V2": 5}, "'V2' is not one of P1"),
        ("parameters", {2: 5}, "2 is not one of P1"), ("parameters", [], "parameters is no table"),
        ("parameters.P251", 0, "P251 = 0 is refused: E90"), ("parameters.P2", 601, "P2 = 601 is refused: E91"),
        ("parameters.P6", 1.5, "P6 = 1.5 is finer than it can be stored"), ("parameters.P2", "5", "P2 = '5'"),
        ("variables.V45", 0, "V45 = 0 is refused: E90"), ("variables.V5", 0.0001, "V5 = 0.0001 is finer"),
        ("program.N251", "END", "N251 = 'END' is refused: E88"), ("program.N5", "XY", "N5 = 'XY' is refused: E90"),
        ("program.N5", 5, "N5 = 5 is no text"), ("program.N5", "STOP", "E90"),
    ],
)  # fmt: skip
def test_a_state_that_is_half_wrong_changes_nothing(
    terminal: Terminal, state: dict[str, Any], path: str, value: Any, message: str
) -> None:
    other = Terminal(position=3)
    other.say("V1=1")
    other.say("PA 50", 0.1)
    before, log = other.drive.save_state(), list(other.drive.log)
    with pytest.raises(ValueError, match=re.escape(message)):
        other.drive.load_state(changed(state, path, value))
    assert other.drive.save_state() == before
    assert list(other.drive.log) == log
    assert other.drive.moving


def test_something_else_than_a_table_is_no_state() -> None:
    with pytest.raises(ValueError, match="must say kind"):
        SimulatedDrive().load_state([])  # type: ignore[arg-type]


def test_a_file_keeps_a_state(terminal: Terminal, state: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    write_state_file(path, {"kind": "older"})
    write_state_file(str(path), state)
    assert read_state_file(path) == state
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_be_written_whole_stays_as_it_was(state: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    write_state_file(path, state)
    with pytest.raises(ValueError, match="JSON"):
        write_state_file(path, {**state, "cycles": float("nan")})
    with pytest.raises(TypeError):
        write_state_file(path, {**state, "cycles": object()})
    assert read_state_file(path) == state
    assert list(tmp_path.iterdir()) == [path]
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"):
        write_state_file(tmp_path / "folder", state)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["folder", "x.json"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "Expecting value"), (b"[]", "must say kind"), (b"\xff{}", "codec"), (b"{" * 100_000, "."),
        (b'{"kind": "a", "kind": "b"}', "'kind' stands there twice"), (b'{"x": NaN}', "NaN is no number"),
        (b" " * 300_000, "more than 262144 bytes"), (b'{"kind": "simulated COMPAX", "version": 1}', "is missing"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_says_where_and_why(tmp_path: Path, text: bytes, message: str) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(text)
    with pytest.raises(ValueError, match=f"x.json is no state of a simulated drive: .*{message}"):
        read_state_file(path)


def test_a_file_that_is_not_there_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_state_file(tmp_path / "x.json")


LINES = st.sampled_from([
    "P40=1.234", "P2=33.3", "P1=-4.5", "VP", "V1=V1+1", "V39=-.125", "N1 PA 5", "N7 IF I1=101 GOSUB 9", "N2 SD5WAIT7",
    "PA 12.5", "PR -3", "PH", "REALZERO", "STOP", "START", "QUIT", "P90=2", "N1 END", "N9 POSR 1.25 SPEED 5 ACCEL 9",
])  # fmt: skip


@given(st.lists(st.tuples(LINES, st.floats(0.01, 2)), max_size=15), st.booleans())
def test_whatever_was_done_comes_back(script: list[tuple[str, float]], fault: bool) -> None:
    terminal = Terminal(password="off", machine_zero=7)
    for line, pause in script:
        terminal.say(line, pause)
    if fault:
        terminal.drive.raise_fault(55)
    terminal.wait(100)
    terminal.say("VP")
    state = json.loads(json.dumps(terminal.drive.save_state()))
    other = Terminal(password="off", position=-50)
    other.drive.load_state(state)
    again = other.drive.save_state()
    if fault:
        state |= {"error_present": False, "error_history": [98, *state["error_history"][:7]]}
    assert again == state
    for query in ("S1", "S9", "S12", "P1", "P2", "P40", "P90", "V1", "V39", "N1", "N2", "N7", "N9"):
        assert other.ask(query) == terminal.ask(query)
