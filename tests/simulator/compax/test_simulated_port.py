"""The port of the drive: half lines, byte times, power, and the fault hooks of tests."""

from __future__ import annotations

import pytest
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import LogEntry, LogKind

BYTE_S = 10 / 9600


def test_half_a_line_stays_until_its_cr_comes() -> None:
    terminal = Terminal()
    assert terminal.send(b"PA1", 100) == b""
    assert terminal.send(b"00$\r") == PROMPT
    assert terminal.motions() == ["motion_started POSA 100.00"]


def test_half_a_line_of_an_earlier_connection_is_still_there() -> None:
    terminal = Terminal()
    terminal.drive.connect()
    terminal.send(b"PA100")
    terminal.drive.disconnect()
    terminal.wait(3600)
    terminal.drive.connect()
    assert terminal.say("S17") == b"E90\r\n>"
    assert terminal.say("S17") == b"S017: 00000010\r\n>"
    terminal.send(b"PA100")
    assert terminal.send(b"\r") == PROMPT
    assert terminal.motions() == ["motion_started POSA 100.00"]
    kinds = [entry.kind for entry in terminal.drive.log][:3]
    assert kinds == [LogKind.CONNECTED, LogKind.DISCONNECTED, LogKind.CONNECTED]


def test_what_comes_out_while_nobody_is_there_is_gone() -> None:
    terminal = Terminal()
    terminal.drive.connect()
    terminal.say("PA 100$")
    terminal.drive.disconnect()
    terminal.drive.advance(10)
    terminal.drive.connect(11)
    terminal.now = 11
    assert terminal.wait(0) == b""
    assert terminal.ask("S1") == "S001: 100.00"


def test_a_byte_takes_its_time_at_9600_baud() -> None:
    terminal = Terminal(baudrate=9600, answer_time_s=0.002)
    terminal.drive.receive(b"S1\r", 0.0)
    begins = 3 * BYTE_S + 0.002
    assert terminal.drive.next_event_at() == pytest.approx(BYTE_S)
    answer = b"S001: 0.00\r\n>"
    assert terminal.drive.take_output(begins + 0.99 * BYTE_S) == b""
    for count, byte in enumerate(answer, 1):
        assert terminal.drive.take_output(begins + (count + 0.01) * BYTE_S) == bytes([byte])
    assert terminal.drive.next_event_at() is None


def test_4800_baud_take_twice_as_long() -> None:
    times = []
    for baudrate in (9600, 4800):
        terminal = Terminal(baudrate=baudrate, answer_time_s=0)
        terminal.drive.receive(b"S1\r", 0.0)
        while (at := terminal.drive.next_event_at()) is not None:
            terminal.drive.advance(at)
            times.append(at)
    assert times[-1] == pytest.approx(2 * times[len(times) // 2 - 1])


def test_a_line_is_busy_until_the_last_byte_has_left() -> None:
    terminal = Terminal(baudrate=9600, ready_after_answer=True)
    terminal.drive.receive(b"S1\r", 0.0)
    terminal.drive.receive(b"S2\r", 0.010)
    assert terminal.drive.take_output(1) == b"S001: 0.00\r\n>"


def test_messages_follow_an_answer_under_way() -> None:
    terminal = Terminal(baudrate=9600)
    terminal.say("PA 100$")
    terminal.wait(0.73)
    assert terminal.say("S18", 1) == b"S018: 00 00 00 00 00 00 00 00\r\n>$\r\n>"


def test_xoff_lets_the_byte_under_way_go() -> None:
    terminal = Terminal(baudrate=9600, xonxoff=True, answer_time_s=0)
    terminal.drive.receive(b"S1\r", 0.0)
    terminal.drive.receive(b"\x13", 3.5 * BYTE_S)
    assert terminal.drive.take_output(5) == b"S0"
    terminal.drive.receive(b"\x11", 5)
    assert terminal.drive.take_output(10) == b"01: 0.00\r\n>"


def test_memory_is_bounded_whatever_arrives() -> None:
    for knobs in ({}, {"baudrate": 9600}, {"xonxoff": True}):
        terminal = Terminal(**knobs)
        if "xonxoff" in knobs:
            terminal.send(b"\x13")
        for _ in range(5):
            terminal.drive.receive(b"S18" * 5000 + b"\r" * 1000, 0.0)
        port = terminal.drive._port
        sizes = [len(each) for each in (port._received, port._arriving, port._waiting, port._left, port._entry)]
        assert max(sizes) <= 65_536
    for _ in range(100):
        terminal.drive.inject(b"x" * 1000)
    assert len(terminal.wait(0)) == 65_536


def test_the_log_is_bounded_and_says_when() -> None:
    terminal = Terminal()
    terminal.say("S1")
    assert list(terminal.drive.log) == [
        LogEntry(0.0, LogKind.LINE, "S1"),
        LogEntry(0.002, LogKind.ANSWER, "S001: 0.00"),
    ]
    terminal.send(b"\r" * 10_000, 100)
    assert len(terminal.drive.log) == 20_000


def test_without_power_nothing_is_received_and_the_axis_stands() -> None:
    terminal = Terminal(position=10)
    terminal.say("SD 10")
    terminal.say("PR 1 OT O1=1")
    terminal.say("PA 7,")
    terminal.say("PA 100$")
    terminal.wait(1)
    terminal.say("OT O2=1")
    terminal.drive.receive(b"PA", terminal.now)
    terminal.drive.power_off()
    stood_at = terminal.drive.position
    assert 20 < stood_at < 40
    assert not terminal.drive.moving
    assert terminal.say("S1", 10) == b""
    terminal.drive.power_on()
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.ask("S16") == "S016: 11010000"
    assert terminal.ask("!") == "E96"
    assert not any(terminal.drive.outputs.values())
    assert terminal.drive.log.texts(LogKind.POWER) == ["off", "on"]
    # SPEED from P2 again, no prepared points left, and machine zero still where it was.
    terminal.say("PH", 0.5)
    assert terminal.motions() == [
        "motion_started POSA 100.00",
        f"motion_fault {stood_at:.2f}",
        f"motion_started POSA HOME {10 - stood_at:.2f}",
        "motion_reached 0.00",
    ]


def test_power_on_closes_a_fault_with_98() -> None:
    terminal = Terminal()
    terminal.drive.power_cycle()
    terminal.drive.raise_fault(10)
    terminal.drive.power_cycle()
    assert terminal.ask("S18") == "S018: 98 10 00 00 00 00 00 00"
    assert terminal.drive.fault is None


def test_a_silent_drive_executes_and_says_nothing() -> None:
    terminal = Terminal()
    terminal.drive.silent = True
    assert terminal.say("PA 100$", 5) == b""
    assert terminal.drive.position == 100
    assert terminal.drive.log.texts(LogKind.LOST) == ["", "$"]
    terminal.drive.silent = False
    assert terminal.ask("S1") == "S001: 100.00"


def test_a_deaf_drive_receives_nothing() -> None:
    terminal = Terminal()
    terminal.drive.deaf = True
    assert terminal.say("PA 100$", 5) == b""
    assert terminal.motions() == []


def test_an_answer_is_delayed_but_its_line_is_executed() -> None:
    terminal = Terminal()
    terminal.drive.extra_answer_delay_s = 3
    assert terminal.drive.extra_answer_delay_s == 3
    assert terminal.say("PA 100", 2.9) == b""
    assert terminal.drive.position == 100
    assert terminal.wait(0.2) == PROMPT


def test_a_delay_that_ends_lets_the_answer_go_now() -> None:
    terminal = Terminal()
    terminal.drive.extra_answer_delay_s = 60
    assert terminal.say("S1", 10) == b""
    terminal.drive.extra_answer_delay_s = 0
    assert terminal.drive.next_event_at() == terminal.now
    assert terminal.wait(0) == b"S001: 0.00\r\n>"


def test_answers_get_lost() -> None:
    terminal = Terminal()
    terminal.drive.lose_answers = 2
    assert terminal.say("PA 5") == b""
    assert terminal.say("S1") == b""
    assert terminal.ask("S2") == "S002: 5.00"
    lost = terminal.drive.log.texts(LogKind.LOST)
    assert [text[:5] for text in lost] == ["", "S001:"]


def test_position_reached_gets_lost_or_late() -> None:
    terminal = Terminal()
    terminal.drive.lose_position_reached = 1
    terminal.drive.delay_position_reached_s = 2
    assert terminal.say("PA 100$", 5) == PROMPT
    assert terminal.say("PA 0$", 2) == PROMPT
    assert not terminal.drive.moving
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.wait(2) == b"$\r\n>"


def test_noise_comes_at_once() -> None:
    terminal = Terminal(baudrate=9600)
    terminal.say("S1", 0.010)
    terminal.drive.inject(b"\xff\x00")
    output = terminal.wait(1)
    assert output.startswith(b"\xff\x00")
    assert output.endswith(b"\r\n>")


def test_a_drive_says_who_and_where_it_is() -> None:
    assert repr(Terminal(position=2.5).drive) == "<SimulatedDrive 'drive' at 2.5 mm>"
