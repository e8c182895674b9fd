"""How a simulated control keeps a host from sending too much, and what a host can stop: wires, Xon and Xoff, codes."""

from __future__ import annotations

import pytest
from tests.simulator.haas.host import XOFF, XON, Host

from compax_aio.simulator.haas import LogKind

_BLOCKS = [f"N{n} G01 X{n % 90}.5 Y-{n % 70}.25" for n in range(400)]
_FILE = "\r\n".join(["%", "O00001", *_BLOCKS, "M30", "%", ""]).encode()
_SLOW = {"baudrate": 9600, "take_bytes_s": 400.0}
"""The control takes less than half of what the line can carry."""


def _send_obeying(host: Host, data: bytes, *, piece: int = 16, reacts_after: int = 0) -> None:
    """Send as a host does that heeds Xon and Xoff, so many pieces too late."""
    is_held, late = False, 0
    while data:
        if not is_held or late < reacts_after:
            late += is_held
            host.control.receive(data[:piece], host.now)
            data = data[piece:]
        heard = host.wait(piece * host.control.knobs.byte_time_s)
        for sign in heard:
            is_held, late = sign == XOFF[0], 0
        assert host.now < 10_000
    host.until_quiet()


def _stored(host: Host) -> str:
    return host.control.memory.programs["O00001"]


# Xon and Xoff


def test_a_host_that_heeds_xoff_loses_nothing() -> None:
    host = Host(**_SLOW)
    host.receive()
    _send_obeying(host, _FILE)
    assert host.control.screen == "RS232 DONE"
    assert _stored(host).split("\n")[1:-1] == _BLOCKS
    assert host.control.lost_bytes == 0
    flow = host.texts(LogKind.FLOW)
    assert flow == ["Xoff", "Xon"] * (len(flow) // 2)
    assert len(flow) > 20
    assert host.now >= (len(_FILE) - 3) / 400


def test_xoff_comes_at_the_high_water_mark_and_xon_at_the_low_one() -> None:
    host = Host(baudrate=9600, take_bytes_s=100.0, hwm=100, lwm=20)
    host.receive()
    host.send(_FILE[:150])
    out, filled = b"", []
    while not out:
        out = host.wait(0.0001)
        filled.append(host.control.buffered_bytes)
    assert out == XOFF
    assert max(filled) == pytest.approx(101, abs=1)
    out = b""
    while not out:
        out = host.wait(0.001)
    assert out == XON
    assert host.control.buffered_bytes == pytest.approx(20, abs=1)


def test_who_does_not_heed_xoff_overflows_it() -> None:
    host = Host(**_SLOW)
    assert host.load(_FILE) == "RS232 ABORT"
    assert [(each.name, each.number) for each in host.control.alarms] == [("buffer-overflow", 414)]
    assert host.texts(LogKind.FLOW)[0] == "Xoff"
    assert host.control.lost_bytes
    blocks = _stored(host).split("\n")[1:]
    assert 0 < len(blocks) < 30
    assert blocks == _BLOCKS[: len(blocks)]


def test_the_overflow_can_leave_a_hole_in_the_program() -> None:
    host = Host(**_SLOW, overflow_stops=False)
    assert host.load(_FILE) in {"RS232 DONE", ""}
    assert set(host.alarms()) > {"buffer-overflow"} or host.alarms().count("buffer-overflow") > 1
    assert host.control.lost_bytes > 1000


@pytest.mark.parametrize(("late", "screen"), [(1, "RS232 DONE"), (3, "RS232 DONE"), (10, "RS232 ABORT")])
def test_the_slack_is_for_what_still_leaves_the_host(late: int, screen: str) -> None:
    host = Host(**_SLOW, slack=64)
    host.receive()
    _send_obeying(host, _FILE, reacts_after=late)
    assert host.control.screen == screen


def test_lost_signs_are_a_hosts_problem() -> None:
    host = Host(**_SLOW)
    host.control.trouble.xoffs_to_lose = 1
    assert host.load(_FILE) == "RS232 ABORT"
    assert host.texts(LogKind.TROUBLE)[0] == "Xoff lost"
    host = Host(**_SLOW, lose_xon=1.0)
    host.receive()
    host.send(_FILE[:430])
    assert host.until_quiet() == XOFF
    assert Host(**_SLOW, lose_xoff=1.0).load(_FILE) == "RS232 ABORT"


def test_a_receive_operation_may_begin_with_xon() -> None:
    assert Host(xon_at_start=True).receive() == XON
    assert Host().receive() == b""


def test_what_waits_in_the_buffer_behind_the_end_goes_to_who_listens_then() -> None:
    host = Host(baudrate=9600, take_bytes_s=2000.0)
    host.receive()
    host.send(b"%\r\nO00001\r\nM30\r\n%\r\nQ201\r\n")
    assert host.until_quiet() == b"\x02USING TOOL, 4\x17\r\n>"
    assert host.control.screen == "RS232 DONE"


@pytest.mark.parametrize("latency", [0, 5])
def test_a_host_stops_what_the_control_sends(latency: int) -> None:
    host = Host(baudrate=9600, xoff_latency=latency)
    whole = Host().fetch("O00010")
    host.control.press_send("O00010", host.now)
    byte_s = host.control.knobs.byte_time_s
    first = host.wait(50.5 * byte_s)
    assert first == whole[:50]
    host.control.receive(XOFF, host.now)
    held = first + host.wait(100.0)
    # It goes on until Xoff has arrived: the byte under way then, and the latency.
    assert held == whole[: 52 + latency]
    assert host.control.screen == ""
    host.control.receive(XON, host.now)
    assert held + host.until_quiet() == whole
    assert host.control.screen == "RS232 DONE"
    assert host.texts(LogKind.FLOW) == ["host Xoff", "host Xon"]


def test_xoff_goes_ahead_of_what_the_control_has_to_say() -> None:
    host = Host(baudrate=9600, take_bytes_s=100.0)
    host.control.inject(b"." * 1000, host.now)
    host.control.press_recv("programs", host.now)
    host.send(_FILE[:220])
    out = host.wait(0.25)
    assert out.count(XOFF) == 1
    assert set(out) == {ord("."), XOFF[0]}


def test_a_control_that_is_held_answers_no_request_until_it_may() -> None:
    host = Host()
    assert host.send(XOFF + b"Q201\r\n") == b""
    assert host.send(XON) == b"\x02USING TOOL, 4\x17\r\n>"


# DC codes


def test_dc_codes_come_late_or_not_at_all() -> None:
    host = Host(profile="dc codes", dc2_delay_s=1.0, dc4_delay_s=2.0)
    host.control.press_send("O00010", host.now)
    assert host.wait(0.9) == b""
    sent = host.wait(0.2)
    assert sent.startswith(b"\x12\r\n%")
    assert sent.endswith(b"%\r\n")
    assert host.control.screen == ""
    assert host.wait(2.0) == b"\x14"
    assert host.control.screen == "RS232 DONE"
    host = Host(profile="dc codes", dc1_delay_s=1.0, dc3_delay_s=1.0)
    assert host.receive() == b""
    assert host.wait(1.0) == b"\x11"
    assert host.send(b"%\nO00001\nM30\n%") == b""
    assert host.wait(1.0) == b"\x13"


@pytest.mark.parametrize("code", [1, 2, 3, 4])
def test_each_code_can_be_dropped(code: int) -> None:
    for host in (Host(profile="dc codes", **{f"drop_dc{code}": True}), Host(profile="dc codes")):
        host.control.trouble.codes_to_lose.add(f"DC{code}")
        signs = host.receive() + host.send(b"%\nO00001\nM30\n%\n") + host.fetch("O00001")
        wanted = [sign for sign in (0x11, 0x13, 0x12, 0x14) if sign != 0x10 + code]
        assert [byte for byte in signs if byte in range(0x11, 0x15)] == wanted
        assert f"DC{code} dropped" in host.texts(LogKind.CODE)


def test_within_a_file_dc3_means_pause_and_dc1_go_on() -> None:
    host = Host(profile="dc codes", **_SLOW)
    host.control.press_recv("programs", host.now)
    _send_obeying(host, _FILE)
    assert host.control.screen == "RS232 DONE"
    assert _stored(host).split("\n")[1:-1] == _BLOCKS
    assert host.texts(LogKind.CODE) == ["DC1", "DC3"]
    assert "Xoff" in host.texts(LogKind.FLOW)
    last = [each.text for each in host.control.log if each.kind in {LogKind.CODE, LogKind.FLOW}][-1]
    assert last == "DC3"


def test_no_reader_is_turned_off_by_an_abort() -> None:
    host = Host(profile="dc codes")
    host.receive()
    host.send(b"%\nO00001\nM30")
    host.control.press_reset(host.now)
    assert host.wait() == b""
    assert host.control.screen == "RS232 ABORT"


# Wires


def test_pin_4_stops_a_host_and_lets_it_go_on() -> None:
    host = Host(profile="rts/cts", **_SLOW)
    assert host.load(_FILE) == "RS232 DONE"
    assert _stored(host).split("\n")[1:-1] == _BLOCKS
    assert host.control.lost_bytes == 0
    flow = host.texts(LogKind.FLOW)
    assert flow == ["pin 4 low", "pin 4 high"] * (len(flow) // 2)
    assert len(flow) > 20
    assert host.control.is_pin4_high


@pytest.mark.parametrize(("overshoot", "screen"), [(0, "RS232 DONE"), (16, "RS232 DONE"), (128, "RS232 ABORT")])
def test_the_fifo_of_a_host_sends_on_when_pin_4_falls(overshoot: int, screen: str) -> None:
    assert Host(profile="rts/cts", **_SLOW, rts_overshoot=overshoot).load(_FILE) == screen


def test_pin_4_is_high_though_nobody_listens() -> None:
    host = Host(profile="rts/cts", data_collection="off")
    assert host.control.is_pin4_high
    host.send(b"%\nO00001\nM30\n%\n")
    assert host.control.lost_bytes == 11
    assert host.texts(LogKind.LOST) == ["11"]
    host = Host(profile="rts/cts", data_collection="off", pin4_idle="low")
    assert not host.control.is_pin4_high
    host.send(b"%\nO00001\nM30\n%\n")
    assert host.control.holds_host
    host.receive()
    host.until_quiet()
    assert host.control.screen == "RS232 DONE"
    assert not host.control.is_pin4_high
    assert Host(profile="rts/cts", pin4_idle="low").control.is_pin4_high


def test_pin_5_stops_the_control_at_once() -> None:
    host = Host(profile="rts/cts", baudrate=9600)
    host.control.press_send("O00010", host.now)
    first = host.wait(0.05)
    host.control.hold_output(True, host.now)
    host.control.hold_output(True, host.now)
    held = host.wait(100.0)
    assert len(held) <= 1
    host.control.hold_output(False, host.now)
    assert first + held + host.until_quiet() == Host().fetch("O00010")
    assert host.texts(LogKind.FLOW) == ["pin 5 low", "pin 5 high"]
    deaf = Host(baudrate=9600)
    deaf.control.hold_output(True, 0.0)
    assert deaf.fetch("O00010")
    assert not deaf.texts(LogKind.FLOW)


def test_with_wires_dc1_and_dc3_are_data() -> None:
    host = Host(profile="rts/cts")
    host.load(b"%\nO00001\nG0\x13\n%\n")
    assert host.alarms() == ["invalid-code"]


# Time


@pytest.mark.parametrize(
    ("knobs", "bits"),
    [
        ({"profile": "classic"}, 11),
        ({"profile": "xmodem", "synchronization": "xon/xoff"}, 10),
        ({"parity": "none", "stop_bits": 1, "data_bits": 7}, 9),
        ({"parity": "odd", "stop_bits": 2, "data_bits": 8}, 12),
    ],
)
def test_a_byte_takes_the_time_of_its_bits(knobs: dict[str, object], bits: int) -> None:
    host = Host(baudrate=300, **knobs)
    host.send(b"Q201\r")
    size = len(host.until_quiet())
    assert host.now == pytest.approx((5 + size) * bits / 300)


def test_signs_have_a_parity_bit_too() -> None:
    host = Host(parity_in_bytes=True, parity="odd")
    host.send(bytes([0x13]))
    host.send(bytes([0x11]))
    assert host.texts(LogKind.FLOW) == ["host Xoff"]
    host.send(bytes([0x91]))
    assert host.texts(LogKind.FLOW) == ["host Xoff", "host Xon"]


@pytest.mark.parametrize("profile", ["classic", "dc codes", "rts/cts"])
def test_a_host_that_was_stopped_at_the_end_may_go_on_unless_the_reader_is_off(profile: str) -> None:
    host = Host(profile=profile, baudrate=9600, take_bytes_s=200.0)
    host.receive()
    host.wait(1.0)
    out = host.send(b"%\r\nO00001\r\n" + b"G0 X1.\r\n" * 12 + b"%\r\n" + b"\r\n" * 75)
    out += host.until_quiet()
    assert host.control.screen == "RS232 DONE"
    last = [each.text for each in host.control.log if each.kind in {LogKind.CODE, LogKind.FLOW}][-2:]
    if profile == "classic":
        assert out == XOFF + XON
    elif profile == "dc codes":
        assert out == XOFF + XOFF
        assert last == ["Xoff", "DC3"]
    else:
        assert last == ["pin 4 low", "pin 4 high"]
    assert host.control.is_pin4_high
    assert host.control.buffered_bytes == 0


def test_what_a_host_sends_while_the_control_does_is_lost() -> None:
    host = Host(baudrate=9600)
    host.control.press_send("O00010", host.now)
    host.wait(0.05)
    host.send(b"Q100\r\n", 0.05)
    assert host.control.doing == "sending O00010"
    assert host.control.lost_bytes == 6
    assert b"S/N" not in host.until_quiet()
