"""XMODEM from the side of the control: when it says NAK, what it takes twice, and how it gives up."""

from __future__ import annotations

import pytest
from tests.simulator.haas.host import ACK, EOT, NAK, Host, block

from compax_aio.simulator.haas import LogKind

_CAN = b"\x18"
_PROGRAM = ("%\nO00001\n" + "".join(f"N{n}G01X{n % 90}.5\n" for n in range(300)) + "M30\n%\n").encode()
_BLOCKS = [_PROGRAM[at : at + 128] for at in range(0, len(_PROGRAM), 128)]


def _receiving(**knobs: object) -> Host:
    host = Host(profile="xmodem", **knobs)
    assert host.receive() == NAK
    return host


def _send_all(host: Host) -> bytes:
    for number, data in enumerate(_BLOCKS, start=1):
        assert host.send(block(number % 256, data)) == ACK
    return host.send(EOT)


def test_a_file_is_received() -> None:
    host = _receiving()
    assert _send_all(host) == _CAN * 3
    assert host.control.screen == "RS232 DONE"
    assert host.control.memory.programs["O00001"].startswith("O00001\nN0G01X0.5\n")
    assert host.control.memory.programs["O00001"].endswith("\nM30")
    assert not host.control.alarms


def test_it_says_nak_every_second_until_somebody_begins() -> None:
    host = Host(profile="xmodem", baudrate=115200)
    assert host.receive() == b""
    times = [host.now for _ in range(450) if host.wait(0.01) == NAK]
    assert times == pytest.approx([0.01, 1.01, 2.01, 3.01, 4.01], abs=0.005)
    host.send(block(1, _BLOCKS[0]))
    assert host.wait(0.1) == ACK
    assert host.wait(5.0) == b""


def test_eot_is_acknowledged_where_the_knob_says_so() -> None:
    assert _send_all(_receiving(end_answer="ack")) == ACK


def test_a_file_that_is_not_whole_is_an_alarm() -> None:
    host = _receiving()
    host.send(block(1, _BLOCKS[0]))
    assert host.send(EOT) == _CAN * 3
    assert host.control.screen == "RS232 ABORT"
    assert host.alarms() == ["unexpected-end"]


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (block(1, _BLOCKS[0])[:-1] + b"\x00", "1: sum"),
        (b"\x01\x01\xfd" + block(1, _BLOCKS[0])[3:], "1: number"),
        (block(3, _BLOCKS[0]), "3: not 1"),
        (block(0, _BLOCKS[0]), "0: not 1"),
    ],
)
def test_a_bad_block_is_refused(wrong: bytes, why: str) -> None:
    host = _receiving()
    assert host.send(wrong) == NAK
    assert host.texts(LogKind.BLOCK) == [f"refused {why}"]
    assert _send_all(host) == _CAN * 3


def test_a_block_that_stops_in_the_middle_is_refused_after_a_second() -> None:
    host = _receiving()
    assert host.send(block(1, _BLOCKS[0])[:60], 0.9) == b""
    assert host.wait(0.2) == NAK
    assert _send_all(host) == _CAN * 3


def test_it_asks_again_when_no_block_comes_and_gives_up_at_last() -> None:
    host = _receiving(block_wait_s=10.0, block_retries=3)
    host.send(block(1, _BLOCKS[0]))
    assert host.wait(9.9) == b""
    assert host.wait(0.2) == NAK
    assert host.wait(20.0) == NAK * 2
    assert host.wait(10.0) == _CAN * 2
    assert host.control.screen == "RS232 ABORT"


@pytest.mark.parametrize(("knob", "answer"), [("ack", ACK), ("ignore", b"")])
def test_a_block_that_comes_twice_is_taken_once(knob: str, answer: bytes) -> None:
    host = _receiving(repeated_block=knob)
    host.control.trouble.acks_to_lose = 1
    assert host.send(block(1, _BLOCKS[0])) == b""
    assert host.send(block(1, _BLOCKS[0])) == answer
    for number, data in enumerate(_BLOCKS[1:], start=2):
        assert host.send(block(number, data)) == ACK
    assert host.send(EOT) == _CAN * 3
    assert host.control.memory.programs["O00001"].count("N0G01X0.5") == 1


def test_two_can_end_it_and_one_does_not() -> None:
    host = _receiving()
    assert host.send(_CAN + b"x" + _CAN) == b""
    assert host.control.screen == ""
    assert host.send(_CAN * 2) == b""
    assert host.control.screen == "RS232 ABORT"


def test_a_program_that_cannot_be_stored_ends_it_with_can() -> None:
    host = _receiving()
    assert host.send(block(1, b"%\nG0X1\n%\n")) == _CAN * 2
    assert host.control.screen == "RS232 ABORT"
    assert host.alarms() == ["no-program-name"]


def test_reset_tells_the_host() -> None:
    host = _receiving()
    host.send(block(1, _BLOCKS[0]))
    host.control.press_reset(host.now)
    assert host.wait() == _CAN * 2
    assert host.control.screen == "RS232 ABORT"


def test_numbered_data_come_in_blocks_too() -> None:
    host = Host(profile="xmodem")
    host.receive("offsets")
    assert host.send(block(1, b"%\nN1 V7\n%\n")) == ACK
    host.send(EOT)
    assert host.control.memory.offsets[1] == "7"


def test_blocks_are_refused_by_chance() -> None:
    host = _receiving(refuse_block=1.0, block_retries=2)
    assert host.send(block(1, _BLOCKS[0])) == NAK
    assert host.send(block(1, _BLOCKS[0])) == NAK
    assert host.send(block(1, _BLOCKS[0])) == _CAN * 2
    assert host.alarms() == ["missing-code"]


# Sending


def _sending(what: str = "O00010", **knobs: object) -> Host:
    host = Host(profile="xmodem", program_blocks=40, **knobs)
    host.control.press_send(what, host.now)
    assert host.wait() == b""
    return host


def test_block_numbers_go_on_behind_255() -> None:
    host = Host(profile="xmodem", program_blocks=4000)
    host.control.press_send("O00010", host.now)
    data, numbers = b"", []
    answer = host.send(NAK)
    while answer != EOT:
        assert answer == block(answer[1], answer[3:131])
        numbers.append(answer[1])
        data += answer[3:131]
        answer = host.send(ACK)
    assert numbers == [n % 256 for n in range(1, len(numbers) + 1)]
    assert len(numbers) > 257
    host.send(ACK)
    assert host.control.screen == "RS232 DONE"
    assert data.rstrip(b"\x1a").endswith(b"M30\n\n%\n")


def test_a_block_is_repeated_when_it_is_refused_or_not_answered() -> None:
    host = _sending()
    first = host.send(NAK)
    assert host.send(NAK) == first
    assert host.wait(10.1) == first
    second = host.send(ACK)
    assert second[1] == 2
    assert host.texts(LogKind.BLOCK) == ["sent 1", "again 1", "again 1", "sent 2"]


def test_a_nak_that_comes_while_the_block_is_on_its_way_is_one_of_those_before() -> None:
    host = _sending(baudrate=9600)
    host.send(NAK, 0.05)
    host.send(NAK, 1.0)
    assert host.texts(LogKind.BLOCK) == ["sent 1"]


def test_it_gives_up_after_so_many_tries() -> None:
    host = _sending(block_retries=2)
    host.send(NAK)
    assert host.send(NAK)[0] == 1
    assert host.send(NAK)[0] == 1
    assert host.send(NAK) == _CAN * 2
    assert host.control.screen == "RS232 ABORT"


def test_a_host_ends_it_with_two_can() -> None:
    host = _sending()
    host.send(NAK)
    host.send(_CAN * 2)
    assert host.control.screen == "RS232 ABORT"


def test_eot_is_repeated_too() -> None:
    host = Host(profile="xmodem", program_blocks=1, lead_in=False)
    host.control.press_send("O00010", host.now)
    host.send(NAK)
    assert host.send(ACK) == EOT
    assert host.send(NAK) == EOT
    assert host.wait(10.1) == EOT
    host.send(ACK)
    assert host.control.screen == "RS232 DONE"


def test_a_sum_can_be_wrong() -> None:
    host = _sending()
    host.control.trouble.blocks_to_spoil = 1
    wrong = host.send(NAK)
    right = host.send(NAK)
    assert wrong[:-1] == right[:-1]
    assert wrong[-1] != right[-1] == sum(right[3:131]) % 256


def test_the_sum_can_be_that_of_other_ends_of_block() -> None:
    host = Host(profile="xmodem", eob="cr lf", sum_as_if_lf=True)
    host.control.press_send("O00010", host.now)
    frame = host.send(NAK)
    data = frame[3:131]
    assert b"\r\n" in data
    assert frame[-1] == sum(data.replace(b"\r\n", b"\n")) % 256 != sum(data) % 256
    host.receive()
    assert host.send(block(1, b"%\r\nO1\r\n%\r\n")) == NAK
    assert host.send(frame) == ACK


def test_reset_ends_sending() -> None:
    host = _sending()
    host.send(NAK)
    host.control.press_reset(host.now)
    assert host.wait() == _CAN * 2
    assert host.control.doing == "nothing"


# DNC


def test_dnc_takes_blocks_as_fast_as_it_executes_them() -> None:
    host = Host(profile="xmodem", dnc_block_s=0.5, look_ahead=4)
    host.control.press_dnc(host.now)
    assert host.wait() == NAK
    assert host.control.doing == "dnc"
    assert host.send(block(1, _BLOCKS[0]), 0.1) == b""
    assert host.send(b"?", 0.1) == b""
    assert host.until_quiet(60.0).startswith(ACK)
    for number, data in enumerate(_BLOCKS[1:], start=2):
        host.control.receive(block(number, data), host.now)
        answer = b""
        while not answer:
            answer = host.wait(0.1)
        assert answer == ACK
    assert host.send(EOT) == _CAN * 3
    assert host.control.screen == "RS232 DONE"
    host = Host(profile="xmodem")
    host.control.press_dnc(host.now)
    host.wait()
    assert host.send(block(1, b"%\nG0 X1\nGARBLED\n%\n")) == _CAN * 2
    assert host.control.screen == "RS232 ABORT"
    slow = Host(profile="xmodem", dnc_block_s=0.5, look_ahead=1)
    slow.control.press_dnc(slow.now)
    slow.wait()
    slow.send(block(1, b"%\nG0 X1\nG0 X2\nG0 X3\nGARBLED\nG0 X4\n%\n"))
    assert slow.until_quiet(60.0) == _CAN * 2
    assert slow.texts(LogKind.EXECUTED) == ["G0 X1", "G0 X2", "G0 X3"]
