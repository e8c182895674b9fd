"""The sending end sends a block for as many NAKs as there are, and takes no answer for another block's."""

from __future__ import annotations

import pytest

from compax_aio.errors import InvalidCommandError, LinkProtocolError
from compax_aio.haas.xmodem import FailureKind, ReceiverTimes, SenderTimes, XmodemSender
from compax_aio.haas.xmodem.blocks import CANCEL, block

ACK, NAK, CAN, EOT = b"\x06", b"\x15", b"\x18", b"\x04"
FILE = b"%\n" + b"O01234\n" + b"N1 G0 X1.\n" * 30 + b"%\n"


@pytest.fixture
def sender() -> XmodemSender:
    """Three blocks, of which the first was asked for and written."""
    sender = XmodemSender(FILE)
    assert sender.begin() == b""
    assert sender.receive(NAK) == block(FILE, 1)
    return sender


def at_end(data: bytes = FILE) -> XmodemSender:
    sender = XmodemSender(data)
    answer = sender.receive(NAK)
    while answer != EOT:
        answer = sender.receive(ACK)
    return sender


def kind_of(sender: XmodemSender) -> FailureKind:
    assert sender.is_over
    assert sender.failure is not None
    return sender.failure.kind


def test_a_file_goes_over_block_by_block(sender: XmodemSender) -> None:
    assert sender.receive(ACK) == block(FILE, 2)
    assert sender.receive(ACK) == block(FILE, 3)
    assert sender.receive(ACK) == EOT
    assert sender.receive(ACK) == b""
    assert sender.is_over
    assert sender.failure is None
    assert sender.ended_by == "ACK"
    assert (sender.blocks, sender.total_blocks, sender.repeats, sender.naks) == (3, 3, 0, 1)
    assert sender.acknowledged_bytes == sender.sent_bytes == len(FILE)


def test_nothing_is_sent_before_the_control_asks() -> None:
    sender = XmodemSender(FILE)
    assert sender.receive(ACK + b"noise") == b""
    assert not sender.has_begun
    assert sender.sent_bytes == 0


def test_all_naks_that_wait_are_answered_by_one_block() -> None:
    sender = XmodemSender(FILE)
    assert sender.receive(NAK * 3) == block(FILE, 1)
    assert sender.repeats == 0


def test_a_nak_that_came_while_the_first_block_was_leaving_asks_for_no_repeat(sender: XmodemSender) -> None:
    assert sender.receive(NAK, still_leaving=True) == b""
    assert sender.receive(ACK) == block(FILE, 2)
    assert sender.repeats == 0


def test_a_nak_that_comes_after_a_block_repeats_it(sender: XmodemSender) -> None:
    assert sender.receive(NAK) == block(FILE, 1)
    assert sender.repeats == 1


def test_a_nak_in_front_of_an_acknowledgement_counts_for_nothing(sender: XmodemSender) -> None:
    assert sender.receive(NAK + ACK) == block(FILE, 2)
    assert sender.repeats == 0


def test_a_block_that_went_out_twice_may_be_acknowledged_twice(sender: XmodemSender) -> None:
    sender.receive(NAK)
    assert sender.receive(ACK) == b""
    assert sender.patience_s == SenderTimes().settle_s
    assert sender.receive(ACK) == b""
    assert sender.receive(NAK) == b""
    assert sender.time_ran_out() == block(FILE, 2)
    assert sender.blocks == 1


def test_two_acknowledgements_at_once_are_one(sender: XmodemSender) -> None:
    assert sender.receive(ACK + ACK) == block(FILE, 2)
    assert sender.blocks == 1


def test_an_acknowledgement_that_comes_before_the_block_has_left_counts_if_no_other_comes(
    sender: XmodemSender,
) -> None:
    assert sender.receive(ACK, still_leaving=True) == b""
    assert sender.time_ran_out() == block(FILE, 2)


def test_an_early_acknowledgement_does_not_hide_a_nak(sender: XmodemSender) -> None:
    sender.receive(ACK, still_leaving=True)
    assert sender.receive(NAK) == block(FILE, 1)
    assert sender.blocks == 0


def test_an_early_acknowledgement_of_the_end_counts_if_no_other_comes() -> None:
    sender = at_end()
    assert sender.receive(ACK, still_leaving=True) == b""
    assert sender.time_ran_out() == b""
    assert sender.ended_by == "ACK"


def test_a_single_can_is_noise(sender: XmodemSender) -> None:
    assert sender.receive(CAN) == b""
    assert sender.receive(ACK) == block(FILE, 2)
    sender.receive(CAN + b"x" + CAN)
    assert not sender.is_over


def test_two_cans_end_it_and_nothing_more_is_sent(sender: XmodemSender) -> None:
    sender.receive(CAN)
    assert sender.receive(CAN + ACK) == b""
    assert kind_of(sender) is FailureKind.CANCELLED_THERE
    assert "0 of 3 blocks" in str(sender.failure)
    assert sender.receive(NAK) == b""


def test_three_cans_behind_the_end_mean_that_it_is_finished() -> None:
    sender = at_end()
    assert sender.receive(CAN * 3) == b""
    assert sender.failure is None
    assert sender.ended_by == "CAN"


@pytest.mark.parametrize("tail", [b"\r\n", b"\r\n\r\n", b"\n" * 3 + b"\x1a"])
def test_the_last_percent_may_stand_in_the_block_before_the_last_if_only_ends_are_behind_it(tail: bytes) -> None:
    data = b"%\n".ljust(127, b"N") + b"%" + tail
    sender = at_end(data)
    sender.receive(CAN * 3)
    assert sender.ended_by == "CAN"


@pytest.mark.parametrize("data", [b"%\nO1\nM30\n", b"%" + b"x" * 200 + b"M30\n", b"%\nM30\n%" + b"x" * 200])
def test_cans_behind_the_end_of_a_file_that_is_not_closed_mean_that_it_is_not_taken(data: bytes) -> None:
    data = data.replace(b"%", b"") if data.startswith(b"%\nO1") else data
    sender = at_end(data)
    sender.receive(CAN * 3)
    assert kind_of(sender) is FailureKind.CANCELLED_THERE
    assert "EOT" in str(sender.failure)


def test_a_nak_for_the_end_repeats_it() -> None:
    sender = at_end()
    assert sender.receive(NAK) == EOT
    assert sender.receive(ACK) == b""
    assert sender.ended_by == "ACK"


def test_the_end_is_said_again_when_nobody_answers_and_then_it_is_told_as_unknown() -> None:
    sender = at_end()
    assert sender.patience_s == 10.0
    assert sender.time_ran_out() == EOT
    assert sender.time_ran_out() == EOT
    assert sender.time_ran_out() == b""
    assert kind_of(sender) is FailureKind.END_UNKNOWN


def test_an_end_that_is_always_refused_is_told_as_unknown() -> None:
    sender = at_end()
    answers = [sender.receive(NAK) for _ in range(11)]
    assert answers == [EOT] * 10 + [CANCEL]
    assert kind_of(sender) is FailureKind.END_UNKNOWN


def test_a_block_is_repeated_ten_times_at_most(sender: XmodemSender) -> None:
    answers = [sender.receive(NAK) for _ in range(11)]
    assert answers == [block(FILE, 1)] * 10 + [CANCEL]
    assert kind_of(sender) is FailureKind.TOO_MANY_REPEATS


def test_each_block_has_ten_repeats_of_its_own(sender: XmodemSender) -> None:
    for _ in range(10):
        sender.receive(NAK)
    sender.receive(ACK)
    assert sender.time_ran_out() == block(FILE, 2)
    assert sender.receive(NAK) == block(FILE, 2)


def test_a_block_is_never_sent_again_only_because_time_ran_out(sender: XmodemSender) -> None:
    assert sender.time_ran_out() == CANCEL
    assert kind_of(sender) is FailureKind.FELL_SILENT


def test_nobody_who_asks_is_told_with_nothing_sent() -> None:
    sender = XmodemSender(FILE)
    assert sender.patience_s == 120.0
    assert sender.time_ran_out() == b""
    assert kind_of(sender) is FailureKind.NEVER_BEGUN


def test_a_receiver_that_wants_a_crc_is_told_apart() -> None:
    sender = XmodemSender(FILE)
    sender.receive(b"CCC")
    assert sender.time_ran_out() == CANCEL
    assert "CRC" in str(sender.failure)


@pytest.mark.parametrize("has_begun", [False, True])
def test_babble_ends_it(has_begun: bool) -> None:
    sender = XmodemSender(FILE)
    if has_begun:
        sender.receive(NAK)
    sender.receive(b"\x02\x90\x81" * 200)
    assert kind_of(sender) is (FailureKind.FELL_SILENT if has_begun else FailureKind.NEVER_BEGUN)


def test_a_program_that_prints_before_the_first_nak_ends_nothing_and_asks_for_no_crc() -> None:
    sender = XmodemSender(FILE)
    for _ in range(100):
        sender.receive(b"COUNT 5\r\n")
    assert not sender.is_over
    assert sender.time_ran_out() == b""
    assert kind_of(sender) is FailureKind.NEVER_BEGUN
    assert "no NAK has come" in str(sender.failure)
    sender = XmodemSender(FILE)
    sender.receive(b"COUNT 5\r\n")
    assert sender.receive(NAK) == block(FILE, 1)
    sender.receive(b"COUNT 5\r\n" * 100)
    assert kind_of(sender) is FailureKind.FELL_SILENT


def test_an_answer_that_came_too_early_passes_for_one_to_the_last_block_only_after_a_long_silence() -> None:
    sender = XmodemSender(FILE)
    sender.receive(NAK)
    for _ in range(sender.total_blocks - 1):
        sender.receive(ACK)
    assert sender.receive(ACK, still_leaving=True) == b""
    assert sender.patience_s > 2 * ReceiverTimes().character_s  # who lost a byte of it says so by then
    assert sender.receive(NAK) == block(FILE, sender.total_blocks)
    assert sender.receive(ACK) == b""
    assert sender.time_ran_out() == EOT


def test_cancelling_tells_the_control_once(sender: XmodemSender) -> None:
    assert sender.cancel() == CANCEL
    assert kind_of(sender) is FailureKind.CANCELLED_HERE
    assert sender.cancel() == b""
    assert sender.receive(ACK) == b""
    assert sender.patience_s == 0.0
    with pytest.raises(LinkProtocolError):
        sender.time_ran_out()


def test_cancelling_before_anybody_has_asked_sends_nothing() -> None:
    sender = XmodemSender(FILE)
    assert sender.cancel() == b""
    assert sender.is_over


def test_an_empty_file_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="nothing to send"):
        XmodemSender(b"")
