"""DNC of a simulated control: blocks are executed as they come, nothing is stored, the line waits for the machine."""

from __future__ import annotations

from itertools import pairwise

import pytest
from tests.simulator.haas.host import XOFF, XON, Host

from compax_aio.simulator.haas import LogKind

_BLOCKS = [f"N{n} G01 X{n % 90}.5" for n in range(100)]
_FILE = "\r\n".join(["%", *_BLOCKS, "%", ""]).encode()


def _feeding(**knobs: object) -> Host:
    host = Host(**knobs)
    host.control.press_dnc(host.now)
    host.wait()
    assert host.control.doing == "dnc"
    return host


def test_blocks_are_executed_as_they_come_and_nothing_is_stored() -> None:
    host = _feeding()
    before = dict(host.control.memory.programs)
    host.send(_FILE)
    assert host.texts(LogKind.EXECUTED) == _BLOCKS
    assert host.control.screen == "RS232 DONE"
    assert host.control.memory.programs == before


def test_the_line_waits_for_the_machine() -> None:
    host = _feeding(baudrate=9600, dnc_block_s=0.2, look_ahead=5)
    data, is_held, signs = _FILE, False, b""
    while data or host.control.doing == "dnc":
        if data and not is_held:
            host.control.receive(data[:16], host.now)
            data = data[16:]
        heard = host.wait(0.02)
        signs += heard
        if heard:
            is_held = heard[-1:] == XOFF
    assert host.texts(LogKind.EXECUTED) == _BLOCKS
    assert signs == (XOFF + XON) * (len(signs) // 2)
    assert len(signs) >= 10
    at = [each.at for each in host.control.log if each.kind is LogKind.EXECUTED]
    assert [b - a for a, b in pairwise(at)] == pytest.approx([0.2] * 99, abs=1e-6)
    assert host.now == pytest.approx(20.0, abs=0.2)


def test_a_line_that_fails_leaves_it_waiting_until_reset() -> None:
    host = _feeding()
    host.send(_FILE[:200])
    host.wait(1000.0)
    assert host.control.doing == "dnc"
    host.control.press_reset(host.now)
    assert host.control.screen == "RS232 ABORT"
    assert host.control.doing == "nothing"


def test_what_is_read_ahead_is_not_executed_after_reset() -> None:
    host = _feeding(dnc_block_s=1.0)
    host.send(_FILE[:300])
    host.control.press_reset(host.now)
    host.wait(100.0)
    assert host.texts(LogKind.EXECUTED) == _BLOCKS[:1]


def test_a_block_that_is_none_stops_it() -> None:
    for knobs in ({}, {"dnc_block_s": 1.0}):
        host = _feeding(**knobs)
        host.send(b"%\nG0 X1\nG0 X2!\nG0 X3\n%\n")
        host.wait(10.0)
        assert host.texts(LogKind.EXECUTED) == ["G0 X1"]
        assert host.alarms() == ["invalid-code"]
        assert host.control.screen == "RS232 ABORT"


def test_high_line_numbers_can_freeze_it() -> None:
    host = _feeding(dnc_crash_above_n=100_000)
    host.send(b"%\nN100000 G0 X1\nN100001 G0 X2\nN100002 G0 X3\n")
    assert host.texts(LogKind.EXECUTED) == ["N100000 G0 X1"]
    assert host.control.is_frozen
    assert host.control.doing == "frozen"
    host.control.press_reset(host.now)
    assert not host.control.is_frozen


def test_codes_surround_it() -> None:
    host = Host(profile="dc codes")
    host.control.press_dnc(host.now)
    assert host.wait() == b"\x11"
    assert host.send(_FILE) == b"\x13"
    host = Host(xon_at_start=True)
    host.control.press_dnc(host.now)
    assert host.wait() == XON


def test_it_may_go_on_behind_the_last_percent() -> None:
    host = _feeding(dnc_ends="never")
    host.send(_FILE)
    host.send(b"G0 X1\n")
    host.wait(100.0)
    assert host.control.doing == "dnc"
    assert host.texts(LogKind.EXECUTED) == _BLOCKS


def test_a_parity_fault_stops_it() -> None:
    host = _feeding()
    host.control.trouble.spoil_byte(100)
    host.send(_FILE)
    assert host.alarms() == ["parity-error"]
    assert host.control.screen == "RS232 ABORT"
    assert 0 < len(host.texts(LogKind.EXECUTED)) < 10


def test_who_does_not_heed_xoff_loses_blocks_and_the_program() -> None:
    host = _feeding(baudrate=9600, dnc_block_s=1.0)
    host.send(_FILE)
    host.until_quiet()
    assert host.alarms() == ["buffer-overflow"]
    assert host.control.screen == "RS232 ABORT"
