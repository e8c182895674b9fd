"""The byte vectors of the fact sheet (§12), the codes of Haas 11596-8000, the traces of §7: the control's side."""

from __future__ import annotations

import pytest
from tests.simulator.haas.host import ACK, EOT, NAK, Host, block

from compax_aio.simulator.haas import LogKind

_DATA = b"%\r\nN0 V12345\r\nN1 V100\r\n%\r\n"
_TRACE = b"\n%\nO05555(CS390_Test_NC)\n(Using G0 ...)\nN10G90G94G17\nN66465M30\n\n%\n"


def test_a_classic_control_answers_q600() -> None:
    assert Host().send(b"Q600 3027\r\n") == b"\x02MACRO, 3027,    0.0000\x17\r\n>"


def test_it_is_busy_while_a_cycle_runs() -> None:
    host = Host()
    host.control.cycle_start()
    assert host.send(b"Q500\r\n") == b"\x02STATUS, BUSY\x17\r\n>"


def test_it_does_not_know_what_is_no_request() -> None:
    assert Host().send(b"Q999\r\n") == b"\x02UNKNOWN\x17\r\n>"


def test_a_newer_control_answers_in_another_form() -> None:
    assert Host(profile="ethernet").send(b"?Q600 3027\r\n") == b">MACRO, 0.0\r\n"


def test_the_serial_number_comes_as_printed() -> None:
    assert Host().send(b"Q100\r") == b"\x02S/N, 1234567\x17\r\n>"


def test_dc_codes_surround_what_is_sent() -> None:
    host = Host.whose_n0_is(12345, profile="dc codes")
    host.control.memory.settings.clear()
    host.control.memory.settings[1] = "100"
    assert host.fetch("settings") == b"\x12" + _DATA + b"\x14"
    assert host.control.screen == "RS232 DONE"
    assert host.texts(LogKind.CODE) == ["DC2", "DC4"]


def test_dc_codes_surround_what_is_received() -> None:
    host = Host.whose_n0_is(12345, profile="dc codes")
    assert host.receive("settings") == b"\x11"
    assert host.send(_DATA) == b"\x13"
    assert host.control.screen == "RS232 DONE"
    assert host.control.memory.settings[1] == "100"
    assert not host.control.alarms


def test_the_reader_is_off_as_soon_as_the_last_percent_has_come() -> None:
    host = Host.whose_n0_is(12345, profile="dc codes", baudrate=9600)
    assert host.receive("settings") == b""
    assert host.wait(0.01) == b"\x11"
    sent_at = host.now
    host.send(_DATA)
    host.until_quiet()
    at = {each.text: each.at for each in host.control.log if each.kind is LogKind.CODE}["DC3"]
    assert at - sent_at == pytest.approx(_DATA.rindex(b"%") * 11 / 9600 + 11 / 9600)


def test_the_first_block_of_the_trace_is_sent_byte_for_byte() -> None:
    host = Host(profile="xmodem")
    host.control.memory.programs["O05555"] = "O05555(CS390_Test_NC)\n(Using G0 ...)\nN10 G90 G94 G17\nN66465 M30"
    host.control.press_send("O5555", host.now)
    assert host.wait(9.0) == b""
    first = host.send(NAK)
    assert first[:12] == bytes.fromhex("01 01 FE 0A 25 0A 4F 30 35 35 35 35")
    assert first == block(1, _TRACE)
    assert host.send(ACK) == EOT
    assert host.control.screen == ""
    assert host.send(ACK) == b""
    assert host.control.screen == "RS232 DONE"


def test_the_trace_of_a_pc_that_answers_two_naks() -> None:
    host = Host(profile="xmodem")
    assert host.receive() == NAK
    assert host.wait(2.0) == NAK + NAK
    data = (_TRACE[:-3] + b"N1G0X1\n" * 30 + b"\n%\n").ljust(384, b"\x1a")
    assert host.send(block(1, data[:128])) == ACK
    assert host.send(block(1, data[:128])) == ACK
    host.control.trouble.blocks_to_refuse = 1
    assert host.send(block(2, data[128:256])) == NAK
    assert host.send(block(2, data[128:256])) == ACK
    assert host.send(block(3, data[256:])) == ACK
    assert host.send(EOT) == b"\x18\x18\x18"
    assert host.control.screen == "RS232 DONE"
    assert host.control.memory.programs["O05555"].count("N1G0X1") == 30
    assert host.texts(LogKind.BLOCK) == ["took 1", "repeated 1", "refused 2: trouble", "took 2", "took 3"]


def test_the_reading_of_the_seed_page_about_semicolons() -> None:
    host = Host()
    host.load(b"%\nO00001\nG0 X1;\n;\nM30\n%\n")
    assert host.control.memory.programs["O00001"] == "O00001\nG0 X1\n\n\nM30"
