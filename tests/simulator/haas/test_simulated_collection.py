"""Data collection of a simulated control: what is answered, in which frame, how late, and what polling does to it."""

from __future__ import annotations

from math import inf

import pytest
from tests.simulator.haas.host import Host

from compax_aio.haas.facts.queries import QUERIES
from compax_aio.simulator.haas import LogKind


def _framed(text: str) -> bytes:
    return b"\x02" + text.encode() + b"\x17\r\n>"


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("Q100", "S/N, 1234567"),
        ("Q101", "SOFTWARE, VER 000.00"),
        ("Q102", "MODEL, VF2"),
        ("Q104", "MODE, (MEM)"),
        ("Q200", "TOOL CHANGES, 35"),
        ("Q201", "USING TOOL, 4"),
        ("Q300", "P.O. TIME, 00001:01:01"),
        ("Q301", "C.S. TIME, 00000:00:00"),
        ("Q303", "LAST CYCLE, 00000:00:00"),
        ("Q304", "PREV CYCLE, 00000:00:00"),
        ("Q402", "M30 #1, 380"),
        ("Q403", "M30 #2, 380"),
        ("Q500", "PROGRAM, O00010, IDLE, PARTS, 42"),
        ("Q600 101", "MACRO, 101,   12.5000"),
        ("Q600 1", "MACRO, 1,       NaN"),
        ("Q600 0", "MACRO, 0,       NaN"),
        ("Q600 5022", "MACRO, 5022,   -2.2500"),
        ("Q600 3020", "MACRO, 3020, 3661.0000"),
        ("Q600 1098", "MACRO, 1098,    0.0000"),
        ("Q600 99999", "UNKNOWN"),
        ("Q600 X", "UNKNOWN"),
        ("Q600", "UNKNOWN"),
        ("Q501", "UNKNOWN"),
        ("q100", "UNKNOWN"),
        ("E1 1.5", "!"),
        ("E1 X", "UNKNOWN"),
        ("E1", "UNKNOWN"),
        ("E5021 1", "UNKNOWN"),
    ],
)
def test_each_request_has_its_answer(request_: str, answer: str) -> None:
    host = Host()
    host.wait(3661.0)
    for form in (f"{request_}\r\n", f"?{request_}\r"):
        assert host.send(form.encode()) == _framed(answer)
    assert host.texts(LogKind.ANSWER) == [answer] * 2


@pytest.mark.parametrize("profile", ["classic", "ethernet"])
def test_answers_begin_as_the_table_of_requests_says(profile: str) -> None:
    host = Host(profile=profile)
    for row in QUERIES.values():
        request = f"{row.command}{' 1 1' if row.command == 'E' else ' 101' if row.takes_variable else ''}\r\n"
        head = row.classic if profile == "classic" else row.ethernet
        assert host.send(request.encode())[1:].startswith(head.encode()), row


def test_newer_controls_have_no_frame() -> None:
    host = Host(profile="ethernet")
    assert host.send(b"?Q100\n") == b">SERIAL NUMBER, 1234567\r\n"
    assert host.send(b"?Q104\n") == b">MODE, MEM\r\n"
    assert host.send(b"?Q600 101\n") == b">MACRO, 12.5\r\n"
    assert host.send(b"?Q600 1\n") == b">MACRO, NaN\r\n"
    assert host.send(b"?E1 2.5\n") == b">!\r\n"
    assert host.control.memory.macros[1] == 2.5


def test_a_request_may_come_in_pieces_and_several_at_once() -> None:
    host = Host()
    assert host.send(b"Q2") == b""
    assert host.send(b"01") == b""
    assert host.send(b"\r\nQ402\r\nQ") == _framed("USING TOOL, 4") + _framed("M30 #1, 380")
    assert host.send(b"403\n") == _framed("M30 #2, 380")
    assert host.send(b"\r\n \r\n") == b""
    assert host.send(b"Q" * 200 + b"\r") == _framed("UNKNOWN")


def test_without_setting_143_nothing_is_answered() -> None:
    host = Host(data_collection="off")
    assert host.send(b"Q100\r\n", 10.0) == b""
    assert host.control.lost_bytes == 4
    host.send(b"Q100\r\n")
    assert host.texts(LogKind.LOST) == ["8"]


def test_setting_187_echoes_the_request() -> None:
    assert Host(echo="on").send(b"Q201\r\n") == b"Q201\r\n" + _framed("USING TOOL, 4")


def test_answers_take_their_time() -> None:
    host = Host(baudrate=9600, answer_time_s=0.1)
    host.send(b"Q201\r")
    assert host.wait(0.1) == b""
    assert host.wait(0.1) == _framed("USING TOOL, 4")


@pytest.mark.parametrize(("knob", "answer"), [("frame", _framed("!")), ("bare", b"!"), ("none", b"")])
def test_what_answers_a_write(knob: str, answer: bytes) -> None:
    host = Host(write_answer=knob)
    assert host.send(b"E100 -1.5\r\n") == answer
    assert host.control.memory.macros[100] == -1.5
    assert host.texts(LogKind.WRITTEN) == ["#100 = -1.5 (was 0)"]
    host.send(b"E10200 3\r\n")
    assert host.texts(LogKind.WRITTEN)[1] == "#10200 = 3 (was empty)"


# Cycles


def test_a_cycle_is_seen_and_counted() -> None:
    host = Host()
    host.control.cycle_start(host.now)
    host.control.cycle_start(host.now)
    host.wait(61.0)
    assert host.send(b"Q500\r") == _framed("STATUS, BUSY")
    assert host.send(b"Q201\r") == _framed("USING TOOL, 4")
    assert host.send(b"Q600 3027\r") == _framed("MACRO, 3027, 3000.0000")
    assert host.send(b"Q301\r") == _framed("C.S. TIME, 00000:01:01")
    host.control.feed_hold(host.now)
    host.control.feed_hold(host.now)
    assert host.send(b"Q500\r") == _framed("PROGRAM, O00010, FEED HOLD, PARTS, 42")
    host.wait(100.0)
    host.control.cycle_start(host.now)
    host.wait(1.0)
    host.control.cycle_stop(host.now)
    host.control.cycle_stop(host.now)
    assert host.send(b"Q500\r") == _framed("PROGRAM, O00010, IDLE, PARTS, 43")
    assert host.send(b"Q303\r") == _framed("LAST CYCLE, 00000:01:02")
    assert host.send(b"Q402\r") == _framed("M30 #1, 381")
    assert host.send(b"Q200\r") == _framed("TOOL CHANGES, 36")


def test_everything_may_be_busy() -> None:
    host = Host(busy_answers="all")
    host.control.cycle_start(host.now, lasts_s=10.0)
    assert host.send(b"Q201\r") == _framed("STATUS, BUSY")
    host.wait(10.0)
    assert host.send(b"Q201\r") == _framed("USING TOOL, 4")


def test_cycles_run_by_themselves() -> None:
    host = Host(cycle_s=20.0)
    seen = []
    for _ in range(8):
        host.wait(10.0)
        seen.append(b"BUSY" in host.send(b"Q500\r"))
    assert seen == [False, True, True, False, False, True, True, False]
    assert host.control.running.parts == 44


def test_reset_ends_a_cycle_without_a_part() -> None:
    host = Host()
    host.control.cycle_start(host.now)
    host.control.press_reset(host.now)
    assert host.send(b"Q500\r") == _framed("PROGRAM, O00010, IDLE, PARTS, 42")


def test_alarms_are_told() -> None:
    host = Host()
    host.load(b"%\nX1\n%\n")
    assert host.send(b"Q500\r") == _framed("PROGRAM, O00010, ALARM ON, PARTS, 42")
    host.control.press_reset(host.now)
    assert host.send(b"Q500\r") == _framed("PROGRAM, O00010, IDLE, PARTS, 42")


def test_what_a_test_sets_is_told() -> None:
    host = Host(serial_number="7", software="VER 10.15A", model="SL20")
    host.control.running.mode = "ZERO RET"
    host.control.running.variables[1098] = 12.0
    host.control.running.tool = 9
    assert host.send(b"Q100\rQ101\rQ102\rQ104\rQ600 1098\rQ600 3026\r") == b"".join(
        map(
            _framed,
            [
                "S/N, 7",
                "SOFTWARE, VER 10.15A",
                "MODEL, SL20",
                "MODE, (ZERO RET)",
                "MACRO, 1098,   12.0000",
                "MACRO, 3026,    9.0000",
            ],
        )
    )


# Polling


def _poll(host: Host, gap_s: float, count: int) -> list[bool]:
    answered = []
    for _ in range(count):
        answer = host.send(b"Q500\r\n")
        answered.append(bool(answer + host.until_quiet(1.0)))
        host.wait(gap_s)
    return answered


def test_a_control_that_is_polled_without_pause_freezes_until_reset() -> None:
    host = Host(baudrate=9600, freeze_after=20)
    assert _poll(host, 0.0, 30) == [True] * 20 + [False] * 10
    assert host.control.is_frozen
    host.wait(1000.0)
    assert _poll(host, 1.0, 2) == [False, False]
    host.control.press_send("O00010", host.now)
    assert host.control.doing == "frozen"
    host.control.press_reset(host.now)
    assert _poll(host, 1.0, 2) == [True, True]
    assert host.texts(LogKind.FROZEN)[1] == "over"


def test_or_until_the_main_switch_is_used() -> None:
    host = Host(freeze_after=2, freeze_ends="power")
    _poll(host, 0.0, 4)
    host.control.press_reset(host.now)
    assert host.control.is_frozen
    host.control.power_cycle(host.now)
    assert _poll(host, 1.0, 1) == [True]


def test_a_pause_keeps_it_alive() -> None:
    host = Host(baudrate=9600, freeze_after=3, freeze_gap_s=0.05)
    assert all(_poll(host, 0.06, 100))
    assert not host.control.is_frozen


def test_the_smallest_pause_can_be_seen() -> None:
    host = Host(baudrate=9600)
    for gap_s in (1.0, 0.2, 0.07, 0.5):
        _poll(host, gap_s, 1)
    _poll(host, 0.0, 1)
    assert host.control.gaps_s[0] == inf
    assert list(host.control.gaps_s)[1:] == pytest.approx([1.0, 0.2, 0.07, 0.5], abs=0.002)
    assert host.texts(LogKind.REQUEST)[3] == "Q500 after 0.0711 s"


def test_a_request_that_comes_before_the_answer_is_over_has_no_pause() -> None:
    host = Host(baudrate=9600)
    host.send(b"Q500\r\n", 0.02)
    host.send(b"Q500\r\n", 1.0)
    assert host.control.gaps_s[1] < 0


# Trouble


def test_answers_are_lost_doubled_garbled_and_late() -> None:
    host = Host()
    host.control.trouble.replies_to_lose = 1
    assert host.send(b"Q201\r") == b""
    host.control.trouble.replies_to_double = 1
    assert host.send(b"Q201\r") == _framed("USING TOOL, 4") * 2
    host.control.trouble.replies_to_garble = 1
    garbled = host.send(b"Q201\r")
    assert sum(a != b for a, b in zip(garbled, _framed("USING TOOL, 4"), strict=True)) == 1
    host.control.trouble.replies_to_delay_s.append(2.0)
    assert host.send(b"Q201\r", 1.9) == b""
    assert host.wait(0.2) == _framed("USING TOOL, 4")
    assert [each.split(" ")[-1] for each in host.texts(LogKind.TROUBLE)][:2] == ["lost", "doubled"]
    host.control.trouble.replies_to_lose = 1
    host.control.heal()
    assert host.send(b"Q201\r")


def test_and_so_they_are_by_chance() -> None:
    right = _framed("USING TOOL, 4")
    assert Host(lose_reply=1.0).send(b"Q201\r") == b""
    assert Host(double_reply=1.0).send(b"Q201\r") == right * 2
    assert Host(garble_reply=1.0).send(b"Q201\r") != right
    assert Host(late_reply=1.0, late_s=3.0).send(b"Q201\r", 2.9) == b""
    assert Host(foreign_reply=1.0).send(b"Q201\r") == _framed("USING TOOL, 9") + right


def test_answers_to_other_hosts_come_too() -> None:
    host = Host(profile="ethernet")
    host.control.overhear("MACRO, 7.5", host.now)
    assert host.wait() == b">MACRO, 7.5\r\n"
    host.control.trouble.foreign_replies.append("STATUS, BUSY")
    assert host.send(b"?Q201\n") == b">STATUS, BUSY\r\n>USING TOOL, 4\r\n"


def test_the_first_request_of_a_connection_may_be_lost() -> None:
    host = Host(profile="ethernet", first_request_lost=True)
    host.control.connect(host.now)
    assert host.send(b"?Q201\n") == b""
    assert host.send(b"?Q201\n") == b">USING TOOL, 4\r\n"


# DPRNT


def test_a_program_prints_between_answers() -> None:
    host = Host()
    host.control.dprnt("TOOL*4*DONE", host.now)
    assert host.wait() == b"TOOL 4 DONE\r"
    assert host.texts(LogKind.PRINTED) == ["TOOL 4 DONE"]
    host.control.popen(host.now)
    host.control.pclos(host.now)
    assert host.wait() == b"\x12\x14"


def test_a_program_prints_inside_an_answer() -> None:
    host = Host(dprnt_inside=True)
    host.control.dprnt("X1", host.now)
    assert host.send(b"Q201\r") == b"\x02USING X1\rTOOL, 4\x17\r\n>"
    assert host.send(b"Q201\r") == _framed("USING TOOL, 4")


def test_it_prints_by_itself() -> None:
    host = Host(dprnt="A*B", dprnt_every_s=2.0)
    assert host.wait(1.9) == b""
    assert host.wait(0.2) == b"A B\r"
    assert host.wait(4.0) == b"A B\rA B\r"
    host.receive()
    assert host.wait(10.0) == b""
    host.control.power_cycle(host.now)
    assert host.wait(2.0) == b"A B\r"


def test_requests_within_a_file_are_data() -> None:
    host = Host()
    host.receive()
    assert host.send(b"Q100\r\n") == b""
    assert host.texts(LogKind.REQUEST) == []
    host.control.press_send("O00010", host.now)
    assert host.control.screen == "RS232 DONE"


def test_requests_without_end_find_a_limit() -> None:
    host = Host()
    host.send(b"\x13" + b"Q201\r" * 10_000)
    assert 4096 < len(host.send(b"\x11")) < 4200
    assert host.send(b"Q201\r") == _framed("USING TOOL, 4")


def test_it_may_freeze_by_hand() -> None:
    host = Host()
    host.control.freeze(host.now)
    host.control.freeze(host.now)
    assert host.send(b"Q201\r") == b""
    assert host.texts(LogKind.FROZEN) == ["by hand"]
    host.control.press_reset(host.now)
    assert host.send(b"Q201\r")
