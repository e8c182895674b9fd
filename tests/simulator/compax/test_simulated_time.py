"""Time is an input: steps of any size give the same bytes and the same log."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from compax_aio.simulator.compax import Knobs, LogEntry, SimulatedDrive

LINES = st.sampled_from([
    "PA 100$", "PR -30$", "PR 12.5", "PA 0", "PH$", "STOP", "START", "BREAK", "S1", "S4", "S17", "S16", "SD 30",
    "AL 40", "AL- 300", "PR 5 OT O1=1", "PR 20 SD 10", "PR 5 OT O2=1", "QUIT", "PA 3,", "!", "XY", "PA", "",
])  # fmt: skip
KNOBS = st.fixed_dictionaries(
    {
        "baudrate": st.sampled_from([0, 9600]),
        "ready_after_answer": st.booleans(),
        "answer_time_s": st.sampled_from([0, 0.002, 0.05]),
        "position_reached": st.sampled_from(["prompt_first", "final_only"]),
        "position_reached_on_stop": st.booleans(),
        "echo": st.booleans(),
        "machine_zero": st.sampled_from([0, -7]),
    }
)
SCRIPT = st.lists(st.tuples(st.floats(0, 1.5), LINES, st.sampled_from(["\r", "\r\n", ""])), max_size=12)
STEPS = st.lists(st.floats(0, 1), max_size=6)


def play(
    knobs: dict[str, Any], script: list[tuple[float, str, str]], steps: list[float]
) -> tuple[bytes, list[LogEntry]]:
    """Send the lines of *script*, with looks at the drive in between at *steps*, as shares of each pause."""
    drive, now, output = SimulatedDrive(Knobs(**knobs)), 0.0, b""
    for pause, line, end in [*script, (100.0, "S1", "\r"), (100.0, "", "")]:
        for step in sorted(steps):
            output += drive.take_output(now + step * pause)
        now += pause
        drive.receive((line + end).encode(), now)
    return output + drive.take_output(now), list(drive.log)


@given(KNOBS, SCRIPT, STEPS)
def test_steps_of_time_of_any_size_give_the_same_result(
    knobs: dict[str, Any], script: list[tuple[float, str, str]], steps: list[float]
) -> None:
    assert play(knobs, script, steps) == play(knobs, script, [])


@given(KNOBS, SCRIPT)
def test_waking_at_every_event_gives_the_same_result(
    knobs: dict[str, Any], script: list[tuple[float, str, str]]
) -> None:
    drive, now, output = SimulatedDrive(Knobs(**knobs)), 0.0, b""
    for pause, line, end in [*script, (100.0, "S1", "\r"), (100.0, "", "")]:
        now += pause
        while (at := drive.next_event_at()) is not None and at <= now:
            output += drive.take_output(at)
        drive.receive((line + end).encode(), now)
    assert (output + drive.take_output(now), list(drive.log)) == play(knobs, script, [])


@given(st.lists(st.tuples(st.integers(1, 99), st.integers(1, 16)), max_size=8), st.booleans())
@settings(max_examples=50)
def test_comparators_speak_in_the_order_of_travel(points: list[tuple[int, int]], backwards: bool) -> None:
    drive = SimulatedDrive()
    for i, (distance, output) in enumerate(points):
        drive.receive(f"PR {distance} OT O{output}=1\r".encode(), i)
    drive.take_output(50)
    drive.receive(b"PA -100$\r" if backwards else b"PA 100$\r", 50)
    messages = drive.take_output(100).split(b"\r\n>")[1:-1]
    order = sorted(range(len(points)), key=lambda i: (points[i][0], i))
    assert messages == [*(str(i + 1).encode() for i in order), b"$"]


def test_time_that_goes_back_stands_still() -> None:
    drive = SimulatedDrive()
    drive.receive(b"PA 100\r", 10)
    drive.advance(10.5)
    position = drive.position
    drive.advance(3)
    assert drive.position == position
    assert drive.moving


def test_simulated_time_is_much_faster_than_real_time() -> None:
    """Section 8 of the design asks for 10,000 : 1 with one drive moving; a slow test machine gets a tenth."""
    drive, moves = SimulatedDrive(), 100
    begun_at = perf_counter()
    for i in range(moves):
        drive.receive(b"PA 1000$\r" if i % 2 == 0 else b"PA 0$\r", i * 6.0)
        assert drive.take_output((i + 1) * 6.0) == b"\r\n>$\r\n>"
    assert moves * 6 / (perf_counter() - begun_at) > 1000
