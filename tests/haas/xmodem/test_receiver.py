"""The receiving end takes each block once, and takes nothing for an end that stands within a block."""

from __future__ import annotations

import pytest

from compax_aio.errors import LinkProtocolError
from compax_aio.haas.facts.xmodem import checksum
from compax_aio.haas.xmodem import FailureKind, ReceiverTimes, XmodemReceiver
from compax_aio.haas.xmodem.blocks import CANCEL, block

ACK, NAK, CAN, EOT = b"\x06", b"\x15", b"\x18", b"\x04"
FILE = b"\n%\n" + b"O01234\n" + b"N1 G0 X1.\n" * 60 + b"\n%\n"


@pytest.fixture
def receiver() -> XmodemReceiver:
    """It has asked for the first block."""
    receiver = XmodemReceiver()
    assert receiver.begin() == NAK
    return receiver


def kind_of(receiver: XmodemReceiver) -> FailureKind:
    assert receiver.is_over
    assert receiver.failure is not None
    return receiver.failure.kind


def finish(receiver: XmodemReceiver, from_block: int = 1) -> None:
    for index in range(from_block, -(-len(FILE) // 128) + 1):
        assert receiver.receive(block(FILE, index)) == ACK
    assert receiver.receive(EOT) == b""
    assert receiver.time_ran_out() == ACK
    assert receiver.is_over
    assert receiver.failure is None


@pytest.mark.parametrize("size", [1, 2, 7, 131, 132])
def test_a_file_comes_in_pieces_of_any_size(receiver: XmodemReceiver, size: int) -> None:
    got, answers = b"", b""
    for index in range(1, -(-len(FILE) // 128) + 1):
        sent = block(FILE, index)
        for at in range(0, 132, size):
            answers += receiver.receive(sent[at : at + size])
        got += receiver.take()
    receiver.receive(EOT)
    answers += receiver.time_ran_out()
    assert answers == ACK * 6
    assert got + receiver.take() == FILE
    assert receiver.received_bytes == len(FILE)
    assert receiver.fill_bytes == 5 * 128 - len(FILE)


def test_sub_is_stripped_only_at_the_end(receiver: XmodemReceiver) -> None:
    data = (b"a" * 100 + b"\x1a" * 28) + b"\x1a" * 128 + b"b\x1a"
    for index in (1, 2, 3):
        receiver.receive(block(data, index))
    receiver.receive(EOT)
    receiver.time_ran_out()
    assert receiver.take() == data[:-1]


def test_the_first_block_is_asked_for_every_ten_seconds_and_not_for_ever(receiver: XmodemReceiver) -> None:
    waited = 0.0
    while not receiver.is_over:
        waited += receiver.patience_s
        answer = receiver.time_ran_out()
        assert answer == (b"" if receiver.is_over else NAK)
    assert waited == 120.0
    assert kind_of(receiver) is FailureKind.NEVER_BEGUN
    assert receiver.naks == 12


def test_the_wait_for_the_first_block_ends_when_it_should() -> None:
    receiver = XmodemReceiver(ReceiverTimes(start_s=25.0))
    receiver.begin()
    waits = []
    while not receiver.is_over:
        waits.append(receiver.patience_s)
        receiver.time_ran_out()
    assert waits == [10.0, 10.0, 5.0]


def test_a_block_that_comes_again_is_acknowledged_and_dropped(receiver: XmodemReceiver) -> None:
    assert receiver.receive(block(FILE, 1)) == ACK
    assert receiver.receive(block(FILE, 1)) == ACK
    assert receiver.repeats == 1
    finish(receiver, 2)
    assert receiver.take() == FILE


def test_two_copies_that_come_at_once_have_one_answer(receiver: XmodemReceiver) -> None:
    assert receiver.receive(block(FILE, 1) * 2) == ACK


def test_a_block_that_comes_again_with_other_bytes_is_told(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    assert receiver.receive(block(b"x" * 128, 1)) == CANCEL
    assert kind_of(receiver) is FailureKind.OUT_OF_STEP


@pytest.mark.parametrize("index", [3, 5])
def test_a_block_that_is_not_the_next_ends_it(receiver: XmodemReceiver, index: int) -> None:
    receiver.receive(block(FILE, 1))
    assert receiver.receive(block(FILE, index)) == CANCEL
    assert kind_of(receiver) is FailureKind.OUT_OF_STEP


def test_number_0_is_no_repeat_of_anything_at_the_beginning(receiver: XmodemReceiver) -> None:
    data = b"x" * 128 * 256
    assert receiver.receive(block(data, 256)) == CANCEL
    assert kind_of(receiver) is FailureKind.OUT_OF_STEP


def test_a_damaged_block_is_asked_for_again_behind_silence(receiver: XmodemReceiver) -> None:
    sent = bytearray(block(FILE, 1))
    sent[50] ^= 0x10
    assert receiver.receive(bytes(sent)) == b""
    assert receiver.patience_s == 1.0
    assert receiver.time_ran_out() == NAK
    assert receiver.damaged == 1
    finish(receiver)
    assert receiver.take() == FILE


def test_a_block_of_which_a_byte_is_lost_is_asked_for_again(receiver: XmodemReceiver) -> None:
    sent = block(FILE, 1)
    assert receiver.receive(sent[:60] + sent[61:]) == b""
    assert receiver.time_ran_out() == NAK
    finish(receiver)


def test_the_number_4_behind_a_lost_soh_is_no_end(receiver: XmodemReceiver) -> None:
    for index in (1, 2, 3):
        receiver.receive(block(FILE, index))
    answers = [receiver.receive(bytes([byte])) for byte in block(FILE, 4)[1:]]
    assert answers == [b""] * 131
    assert receiver.time_ran_out() == NAK
    finish(receiver, 4)
    assert receiver.take() == FILE


def test_signs_within_a_damaged_block_are_none(receiver: XmodemReceiver) -> None:
    assert receiver.receive(b"\x02" + CAN * 3 + EOT + b"x" * 128) == b""
    assert not receiver.is_over
    assert receiver.time_ran_out() == NAK


def test_a_damaged_end_is_asked_for_again(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    receiver.receive(b"\x05")
    assert receiver.time_ran_out() == NAK
    receiver.receive(EOT)
    assert receiver.time_ran_out() == ACK
    assert receiver.failure is None


def test_an_end_in_place_of_a_block_that_was_damaged_is_told(receiver: XmodemReceiver) -> None:
    sent = bytearray(block(FILE, 1))
    sent[50] ^= 0x10
    receiver.receive(bytes(sent))
    receiver.time_ran_out()
    receiver.receive(EOT)
    assert receiver.time_ran_out() == CANCEL
    assert kind_of(receiver) is FailureKind.OUT_OF_STEP


def test_an_end_that_comes_twice_is_one_and_later_ones_are_acknowledged_again(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    receiver.receive(EOT + EOT)
    assert receiver.time_ran_out() == ACK
    assert receiver.receive(EOT) == ACK
    assert receiver.receive(b"x") == b""
    assert receiver.receive(b"") == b""


def test_noise_in_front_of_a_block_does_no_harm(receiver: XmodemReceiver) -> None:
    assert receiver.receive(b"\x00\xff" + block(FILE, 1)) == ACK
    assert receiver.strays == 2
    finish(receiver, 2)


def test_noise_before_the_first_block_is_no_damaged_block(receiver: XmodemReceiver) -> None:
    for _ in range(20):
        receiver.receive(b"\xff")
        assert receiver.time_ran_out() == NAK
    assert receiver.damaged == 0
    finish(receiver)


def test_babble_ends_it(receiver: XmodemReceiver) -> None:
    answers = b"".join(receiver.receive(b"DPRNT TEXT\r" * 30) for _ in range(20))
    assert answers == NAK * 10 + CANCEL
    assert kind_of(receiver) is FailureKind.TOO_MANY_REPEATS


def test_two_cans_end_it(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    receiver.receive(CAN)
    assert receiver.receive(CAN) == b""
    assert kind_of(receiver) is FailureKind.CANCELLED_THERE


def test_a_single_can_is_noise(receiver: XmodemReceiver) -> None:
    receiver.receive(CAN)
    assert receiver.receive(block(FILE, 1)) == ACK


def test_cans_in_the_middle_of_a_block_end_it_when_silence_follows(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1)[:40] + CAN * 3)
    assert not receiver.is_over
    assert receiver.time_ran_out() == b""
    assert kind_of(receiver) is FailureKind.CANCELLED_THERE


def test_a_sender_that_falls_silent_is_asked_ten_times(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    answers = b""
    while not receiver.is_over:
        assert receiver.patience_s == 10.0
        answers += receiver.time_ran_out()
    assert answers == NAK * 10 + CANCEL
    assert kind_of(receiver) is FailureKind.FELL_SILENT


def test_cancelling_tells_the_control_once(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    assert receiver.cancel() == CANCEL
    assert kind_of(receiver) is FailureKind.CANCELLED_HERE
    assert receiver.cancel() == b""
    assert receiver.receive(EOT) == b""
    assert receiver.take() == FILE[:128]


def test_it_is_begun_once_and_before_anything_is_read() -> None:
    receiver = XmodemReceiver()
    with pytest.raises(LinkProtocolError):
        receiver.receive(b"x")
    with pytest.raises(LinkProtocolError):
        receiver.time_ran_out()
    receiver.begin()
    with pytest.raises(LinkProtocolError):
        receiver.begin()


def test_cancelling_before_it_has_begun_sends_nothing() -> None:
    assert XmodemReceiver().cancel() == b""


def with_sum_as_line_feed(data: bytes, index: int) -> bytes:
    made = block(data, index)
    return made[:-1] + bytes([checksum(made[3:-1].replace(b"\r\n", b"\n"))])


def test_sums_as_if_ends_were_line_feed_are_taken_where_ends_are_others() -> None:
    data = FILE.replace(b"\n", b"\r\n")
    receiver = XmodemReceiver(eob=b"\r\n")
    receiver.begin()
    for index in range(1, -(-len(data) // 128) + 1):
        assert receiver.receive(with_sum_as_line_feed(data, index)) == ACK
    assert receiver.sums_as_line_feed is True
    assert receiver.take() == data


def test_plain_sums_are_taken_as_well_where_ends_are_others() -> None:
    data = FILE.replace(b"\n", b"\r\n")
    receiver = XmodemReceiver(eob=b"\r\n")
    receiver.begin()
    assert receiver.receive(block(data, 1)) == ACK
    assert receiver.sums_as_line_feed is False
    assert receiver.receive(with_sum_as_line_feed(data, 2)) == b""


def test_sums_as_if_ends_were_line_feed_are_none_where_ends_are_line_feed(receiver: XmodemReceiver) -> None:
    assert receiver.receive(with_sum_as_line_feed(FILE.replace(b"\n", b"\r\n"), 1)) == b""


def with_a_byte_twice() -> tuple[bytes, bytes]:
    """Return a block of which a byte came twice, and whose sum fits all the same; and the byte too many."""
    data = bytearray(b"N1 G1 X1.\n" * 12 + b"12345678")
    # A sum fits if the byte that is pushed into its place equals the sum of all that is in front of it.
    data[-1] = 0
    pushed = checksum(bytes(data[:10]) + bytes(data[9:127]))
    data[-1] = pushed
    sent = block(bytes(data), 1)
    doubled = sent[:13] + sent[12:]
    assert checksum(doubled[3:131]) == doubled[131]
    return doubled[:132], doubled[132:]


def test_a_block_with_a_byte_too_many_at_once_is_asked_for_again(receiver: XmodemReceiver) -> None:
    spoilt, behind = with_a_byte_twice()
    assert receiver.receive(spoilt + behind) == b""
    assert receiver.time_ran_out() == NAK
    finish(receiver)


def test_a_byte_too_many_behind_a_block_that_was_acknowledged_makes_it_doubtful(receiver: XmodemReceiver) -> None:
    spoilt, behind = with_a_byte_twice()
    assert receiver.receive(spoilt) == ACK
    assert receiver.receive(behind) == b""
    assert receiver.receive(block(FILE, 2)) == ACK
    assert receiver.doubtful_blocks == [1]


def test_a_byte_too_many_behind_the_last_block_makes_it_doubtful(receiver: XmodemReceiver) -> None:
    spoilt, behind = with_a_byte_twice()
    receiver.receive(spoilt)
    receiver.receive(behind)
    receiver.receive(EOT)
    assert receiver.time_ran_out() == NAK
    receiver.receive(EOT)
    assert receiver.time_ran_out() == ACK
    assert receiver.doubtful_blocks == [1]


def test_a_block_that_comes_again_without_end_ends_it(receiver: XmodemReceiver) -> None:
    receiver.receive(block(FILE, 1))
    for _ in range(ReceiverTimes().retry_limit):
        assert receiver.receive(block(FILE, 1)) == ACK
    assert receiver.receive(block(FILE, 2)) == ACK
    for _ in range(ReceiverTimes().retry_limit):
        assert receiver.receive(block(FILE, 2)) == ACK
    assert receiver.receive(block(FILE, 2)) == CANCEL
    assert kind_of(receiver) is FailureKind.TOO_MANY_REPEATS
    assert "although it was acknowledged" in str(receiver.failure)
