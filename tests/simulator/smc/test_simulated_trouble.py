"""Trouble comes when a test says so, or by chance from one seed; and whatever comes, nothing is raised or unbounded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.simulator.smc.host import Host

from compax_aio.simulator.smc import Ending, Knobs, LogKind, SimulatedPartyLine
from compax_aio.simulator.smc.agenda import Agenda
from compax_aio.simulator.state_file import write_state_file
from compax_aio.smc.facts import Mode

# When a test says so


def test_an_echo_is_lost() -> None:
    host = Host(axes="AB")
    host.line.lose_next_echo("A", 2)
    assert host.type(b"\nB^\n") == b"B^         0\n"
    assert host.type(b"\nA^\n") == b"         0\n"
    assert host.type(b"\nA^\n") == b"A^         0\n"
    assert host.texts(LogKind.TROUBLE, axis="A") == ["echo 41 lost", "echo 5E lost"]


def test_the_terminator_is_an_echo_too() -> None:
    host = Host()
    host.type(b"\nAR50")
    host.line.lose_next_echo("A")
    assert host.type(b"\n") == b""
    assert host.axis.position == 50


def test_an_echo_is_garbled() -> None:
    host = Host()
    host.line.garble_next_echo("A")
    answer = host.type(b"\nA^\n")
    assert answer[:1] != b"A"
    assert answer[1:] == b"^         0\n"
    assert host.texts(LogKind.TROUBLE) == [f"echo 41 became {answer[0]:02X}"]


def test_a_character_is_lost_or_changed_on_its_way() -> None:
    host = Host()
    host.line.lose_next_character()
    assert host.type(b"\nA^\n") == b""
    assert host.type(b"A^\n") == b"A^         0\n"
    host.type(b"AR")
    host.line.flip_next_character(1)
    host.line.flip_next_character(0)
    assert host.type(b"12\n") == b"33\n"
    host.wait(5)
    assert host.axis.position == 33
    assert host.texts(LogKind.TROUBLE) == ["0A lost", "31 became 33", "32 became 33"]


def test_a_stuck_line_says_nothing_for_a_while() -> None:
    host = Host()
    host.type(b"\n")
    host.line.stick(1.0, host.now)
    host.line.stick(0.5, host.now)
    assert host.type(b"AR50\n", 0.15) == b""
    assert host.axis.position == 50
    host.wait(0.3)
    assert host.type(b"A^\n")[:2] == b"A^"


def test_an_answer_is_late_but_its_command_is_not() -> None:
    host = Host()
    host.line.delay_next_answer("A", 3.0)
    host.type(b"\nAR50\n", 0.1)
    assert host.axis.position == 50
    assert host.wait(2.5) == b""
    assert host.wait(1) == b"\n"
    assert host.command("A", "Z") == "        50"


def test_noise_comes_at_once() -> None:
    host = Host()
    host.line.inject(b"\x00\xff", host.now)
    assert host.wait(0) == b"\x00\xff"


def test_an_unknown_axis_has_no_trouble() -> None:
    with pytest.raises(KeyError):
        Host().line.lose_next_echo("B")


# By chance


@pytest.mark.parametrize(
    ("knob", "text"),
    [
        ("lose_echo", "echo 0A lost"),
        ("garble_echo", "echo 0A became"),
        ("flip_bit", "0A became"),
        ("lose_character", "0A lost"),
        ("noise", "noise "),
        ("stick", "stuck for 1 s"),
        ("late_answer", "answer 1 s late"),
    ],
)
def test_trouble_by_chance(knob: str, text: str) -> None:
    def trouble(**knobs: Any) -> list[str]:
        host = Host(**knobs)
        for _ in range(100):
            host.type(b"\nA^\n", 0.01)
            host.wait(2)
        return host.texts(LogKind.TROUBLE)

    found = trouble(**{knob: 0.1})
    assert any(each.startswith(text) for each in found)
    assert 3 < len(found) < 120
    assert found == trouble(**{knob: 0.1}) != trouble(**{knob: 0.1, "seed": 1})
    assert trouble() == []


def test_resets_and_jogs_by_chance() -> None:
    host = Host(spontaneous_reset=0.2)
    for _ in range(50):
        host.type(b"\nA^\n", 0.01)
        host.wait(1)
    assert 5 < len(host.texts(LogKind.RESET)) < 100
    host = Host(jog=0.2, jog_distance=-7)
    for _ in range(50):
        host.type(b"\nA^\n", 0.01)
        host.wait(1)
    assert host.axis.position < -7
    assert host.axis.position % 7 == 0
    assert {each.split()[0] for each in host.motions()} == {"jog", "target"}


# What is kept


def test_a_state_is_kept_and_loaded() -> None:
    host = Host(axes="AB", position=3)
    for name, texts in {"A": ("V700", "S", "R50", "P0", "R5", "P0"), "B": ("I50",)}.items():
        for text in texts:
            host.command(name, text, 2)
    state = json.loads(json.dumps(host.line.save_state(host.now)))
    other = Host(axes="AB")
    other.line.load_state(state, other.now)
    assert other.line.save_state() == state
    other.wait(1)
    a, b = other.line.axes["A"], other.line.axes["B"]
    assert (a.parameters.slew_speed, a.listing, a.memory_writes, a.place, a.position) == (700, ["0 R 5.00"], 2, 50, 0)
    assert (b.parameters.initial_speed, b.memory_writes, b.place) == (400, 0, 3)
    assert other.texts(LogKind.RESET) == ["power", "power"]


def test_a_state_is_read_from_its_file(tmp_path: Path) -> None:
    host = Host()
    path = tmp_path / "line.json"
    write_state_file(path, host.line.save_state())
    assert host.line.read_state_file(path) == host.line.save_state()
    path.write_text("{}")
    with pytest.raises(ValueError, match=r"line.json is no state of a simulated line: it must say kind"):
        host.line.read_state_file(path)


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        (("kind",), "simulated COMPAX", "must say kind 'simulated SMC line' and version 1"),
        (("version",), 2, "version 1"),
        (("axes",), [], "axes is no table"),
        (("axes",), {}, "it is of the axes , not A"),
        (("more",), 1, "'more' means nothing"),
        (("axes", "A"), 1, "axis 'A' is no table"),
        (("axes", "A", "more"), 1, "axis 'A': 'more' means nothing"),
        (("axes", "A", "name"), "AB", "the name 'AB' is no character"),
        (("axes", "A", "name"), "Ω", "is no character"),
        (("axes", "A", "name"), 1, "the name 1 is no character"),
        (("axes", "A", "parameters"), 1, "parameters is no table"),
        (("axes", "A", "parameters"), {}, "parameters: hold_current is missing"),
        (("axes", "A", "parameters", "slew_speed"), 0, "a speed is 0"),
        (("axes", "A", "parameters", "slew_speed"), True, "no whole number"),
        (("axes", "A", "parameters", "slew_speed"), 1.5, "no whole number"),
        (("axes", "A", "program"), "5", "is no row of bytes"),
        (("axes", "A", "program"), 5, "is no row of bytes"),
        (("axes", "A", "program"), "00" * 8193, "more than 8192 bytes"),
        (("axes", "A", "program"), "00" * 2049, "the program of axis A is longer than its memory"),
        (("axes", "A", "writes"), -1, "writes = -1 is no whole number"),
        (("axes", "A", "place"), "x", "place = 'x' is no such number"),
        (("axes", "A", "place"), True, "is no such number"),
        (("axes", "A", "place"), 1e13, "is no such number"),
    ],
)
def test_a_state_that_no_line_can_keep_changes_nothing(where: tuple[str, ...], value: Any, message: str) -> None:
    host = Host()
    state = host.line.save_state()
    table = state
    for key in where[:-1]:
        table = table[key]
    table[where[-1]] = value
    with pytest.raises(ValueError, match=message):
        host.line.load_state(state)
    assert host.texts(LogKind.POWER) == []


def test_a_state_is_a_table() -> None:
    with pytest.raises(ValueError, match="must say kind"):
        Host().line.load_state([])  # type: ignore[arg-type]


# Whatever comes


def test_the_line_can_be_told_apart() -> None:
    host = Host(axes="AB")
    assert repr(host.line) == "<SimulatedPartyLine 'line' with A, B>"
    assert repr(host.axis) == "<SimulatedAxis 'A' at 0>"
    assert host.axis.pin is Mode.PARTY
    host.axis.inputs = 3
    assert host.axis.inputs == 3


def test_what_came_out_while_nobody_was_there_is_gone() -> None:
    host = Host()
    host.line.inject(b"x", host.now)
    host.line.connect(host.now)
    assert host.wait(0) == b""
    host.line.disconnect(host.now)
    assert host.texts(LogKind.CONNECTED, LogKind.DISCONNECTED) == ["", ""]


def test_the_log_is_bounded_and_tells_what_arrived() -> None:
    line = SimulatedPartyLine(log_entries=3)
    line.receive(b"\nAB", 0.0)
    assert line.log.texts(LogKind.RECEIVED, LogKind.OVERRUN) == ["0A", "42", "41"]


def test_an_hour_of_stepping_is_a_handful_of_events() -> None:
    host = Host()
    host.command("A", "R8000000")
    events = 0
    while (at := host.line.next_event_at()) is not None:
        host.line.advance(at)
        events += 1
    assert host.line.axes["A"].position == 8_000_000
    assert events <= 3


def test_an_agenda_forgets_what_was_replaced() -> None:
    agenda = Agenda()
    done: list[int] = []
    for number in range(1000):
        agenda.put("x", 1000.0 - number, lambda number=number: done.append(number))  # type: ignore[misc]
    agenda.put("y", 5000.0, lambda: done.append(-1))
    agenda.drop("y")
    agenda.drop("z")
    assert len(agenda._heap) < 200
    agenda.run(6000.0)
    assert done == [999]
    assert agenda.next_at() is None
    agenda.run(1.0)
    assert agenda.now == 6000


LETTERS = b"AB \n\r\x1b\x03\x08,.+-0123456789RMF@^Z]OIVKDHYElPQGJWXSCx\xff"

chunks = st.lists(
    st.tuples(
        st.one_of(st.binary(max_size=8), st.lists(st.sampled_from(LETTERS), max_size=8).map(bytes)),
        st.floats(0, 3),
    ),
    max_size=40,
)


OTHER_KNOBS: list[dict[str, Any]] = [
    {},
    {"echo_leading_lf": True, "abort_echo": "all", "overlong": "beep", "unknown": "nothing"},
    {"half_entered": "clear", "out_of_range": "ignore", "second_action": "reject", "during_program": "deaf"},
    {"limit_min": -50.0, "limit_max": 50.0, "decimals": 2, "collision": "garble", "overrun": "drop"},
]
TROUBLES = ("lose_echo", "garble_echo", "flip_bit", "noise", "jog", "late_answer", "spontaneous_reset", "stick")


@st.composite
def any_knobs(draw: st.DrawFn) -> Knobs:
    mode = draw(st.sampled_from(["party", "daisy", "single"]))
    chosen: dict[str, Any] = {
        "mode": mode,
        "axes": "A" if mode == "single" else "AB",
        "baudrate": draw(st.sampled_from([0, 9600])),
        "seed": draw(st.integers(0, 1000)),
        **dict.fromkeys(TROUBLES, draw(st.sampled_from([0.0, 0.1]))),
        **draw(st.sampled_from(OTHER_KNOBS)),
    }
    return Knobs(**chosen)


@settings(max_examples=200)
@given(chunks=chunks, knobs=any_knobs())
def test_any_bytes_at_any_times_do_no_harm(chunks: list[tuple[bytes, float]], knobs: Knobs) -> None:
    line = SimulatedPartyLine(knobs)
    now = 0.0
    for data, pause in chunks:
        line.receive(data, now)
        now += pause
        line.take_output(now)
        assert (line.next_event_at() or now) >= now
        assert len(line._agenda._heap) < 200
        for axis in line.axes.values():
            assert knobs.limit_min <= axis.place <= knobs.limit_max
            assert axis.moving or not axis.speed
            assert axis.moving == bool(axis.flags & 1)
    assert line.take_output(now) == b""


@settings(max_examples=150)
@given(
    targets=st.lists(st.tuples(st.integers(-3000, 3000), st.floats(0.01, 3)), max_size=8),
    slope=st.integers(0, 255),
    speeds=st.tuples(st.integers(20, 20_000), st.integers(20, 20_000)),
)
def test_an_axis_is_never_outside_of_what_was_commanded(
    targets: list[tuple[int, float]], slope: int, speeds: tuple[int, int]
) -> None:
    host = Host(ramp_slope=slope, initial_speed=speeds[0], slew_speed=speeds[1])
    low = high = 0.0
    for target, pause in targets:
        host.type(b"\n" + f"AR{target}\n".encode(), 0.01)
        low, high = min(low, target), max(high, target)
        for _ in range(5):
            host.wait(pause / 5)
            assert low <= host.axis.position <= high
    for entry in host.line.log:
        if entry.kind is LogKind.MOTION_ENDED:
            assert entry.text == Ending.TARGET
            assert entry.position in {float(target) for target, _ in targets}


@given(cuts=st.lists(st.floats(0, 2), max_size=20))
def test_time_in_steps_of_any_size_gives_the_same(cuts: list[float]) -> None:
    def story(times: list[float]) -> list[Any]:
        host = Host(baudrate=9600, axes="AB", jitter=0.5, limit_max=2000)
        host.line.receive(b"\nAR500\nBM2000\n\nA^\n", 0.0)
        output = b"".join(host.line.take_output(time) for time in [*sorted(times), 3.0])
        return [output, *host.line.log]

    assert story(cuts) == story([])
