"""Files by XMODEM: whole, damaged, cancelled at either end, and never begun."""

from __future__ import annotations

import pytest

from compax_aio.haas.transfers.account import Ending, Phase
from compax_aio.haas.transfers.choosing import receive_file, send_file
from compax_aio.haas.transfers.notes import TransferBegan
from compax_aio.haas.xmodem.blocks import block, block_count

from .bench import PATIENCE, Bench

ACK, NAK, EOT, CAN = b"\x06", b"\x15", b"\x04", b"\x18"
PROGRAM = b"\n%\nO05555(A)\n" + b"G01 X1. Y2.\n" * 40 + b"\n%\n"
BLOCKS = block_count(len(PROGRAM))


class Reception(Bench):
    """A file is awaited; the control sends LF at the end of blocks."""

    def __init__(self, max_bytes: int = 1 << 20) -> None:
        self.pieces: list[bytes] = []
        super().__init__(
            receive_file("xmodem", "receive", self.pieces.append, patience=PATIENCE, max_bytes=max_bytes, eob=b"\n")
        )

    @property
    def file(self) -> bytes:
        return b"".join(self.pieces)


def sending(data: bytes = PROGRAM) -> Bench:
    return Bench(send_file("xmodem", "send", data, patience=PATIENCE, eob=b"\n"))


def acknowledged(bench: Bench, blocks: int) -> None:
    """Let the control ask, and take so many blocks."""
    bench.come(NAK)
    for _ in range(blocks):
        bench.wait(0.2)
        bench.come(ACK)


def test_a_file_is_received_without_the_fill_of_its_last_block() -> None:
    bench = Reception()
    bench.wait(15)
    for index in range(1, BLOCKS + 1):
        bench.come(block(PROGRAM, index))
        bench.wait(0.2)
    bench.come(EOT)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.file == PROGRAM
    assert bench.sent == NAK * 2 + ACK * BLOCKS + ACK
    account = bench.strategy.account()
    assert (account.blocks, account.bytes, account.is_closed) == (BLOCKS, len(PROGRAM), True)
    assert account.lines == PROGRAM.count(b"\n")
    assert bench.notes == [TransferBegan("receive")]


def test_a_byte_too_many_behind_a_block_counts_as_damage_of_it() -> None:
    bench = Reception()
    for index in range(1, BLOCKS + 1):
        bench.come(block(PROGRAM, index))
        if index == 2:
            bench.come(b"\x5a")
        bench.wait(0.2)
    bench.come(EOT)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    account = bench.strategy.account()
    assert (account.damage_offsets, account.damaged_bytes) == ((128,), 1)


def test_the_end_comes_over_only_with_what_is_sure_not_to_be_fill() -> None:
    bench = Reception()
    bench.come(block(PROGRAM, 1))
    assert bench.file == PROGRAM[:128]


def test_nobody_presses_send() -> None:
    bench = Reception()
    assert bench.wait_for_end() is Ending.NOT_STARTED
    assert bench.now_s == pytest.approx(120)
    assert bench.strategy.account().phase is Phase.WAIT_START
    assert "NAK" in bench.strategy.account().detail or bench.strategy.account().detail


def test_a_damaged_block_is_asked_for_again() -> None:
    bench = Reception()
    damaged = bytearray(block(PROGRAM, 1))
    damaged[50] ^= 4
    bench.come(bytes(damaged))
    bench.wait(2)
    assert bench.sent.endswith(NAK)
    bench.come(block(PROGRAM, 1))
    account = bench.strategy.account()
    assert bench.file == PROGRAM[:128]
    assert (account.blocks, account.repeated_blocks) == (1, 0)


def test_giving_up_a_reception_tells_the_control() -> None:
    bench = Reception()
    bench.come(block(PROGRAM, 1))
    bench.strategy.give_up()
    assert bench.sent.endswith(CAN * 3)
    assert bench.strategy.account().ending is Ending.GIVEN_UP
    bench.come(b"late")
    assert bench.foreign == b"late"


def test_a_control_that_cancels_ends_the_reception() -> None:
    bench = Reception()
    bench.come(block(PROGRAM, 1), CAN * 2)
    assert bench.wait_for_end(within_s=5) is Ending.CANCELLED
    assert bench.file == PROGRAM[:128]


def test_a_file_that_is_too_large_is_cancelled() -> None:
    bench = Reception(max_bytes=200)
    bench.come(block(PROGRAM, 1))
    bench.come(block(PROGRAM, 2))
    assert bench.strategy.ending is Ending.TOO_LARGE
    assert bench.sent.endswith(CAN * 3)
    assert bench.file == PROGRAM[:128]


def test_a_file_is_sent_and_what_is_proved_is_that_it_was_acknowledged() -> None:
    bench = sending()
    bench.wait(60)
    assert bench.written == []
    acknowledged(bench, BLOCKS)
    assert bench.strategy.phase is Phase.TAIL
    bench.wait(0.5)
    assert bench.sent == b"".join(block(PROGRAM, index) for index in range(1, BLOCKS + 1)) + EOT
    bench.come(CAN * 3)
    assert bench.strategy.ending is Ending.COMPLETE
    assert bench.strategy.proof == "xmodem acknowledged"
    account = bench.strategy.account()
    assert account.bytes == account.total_bytes == account.written_bytes == len(PROGRAM)
    assert (account.blocks, account.lines) == (BLOCKS, PROGRAM.count(b"\n"))
    assert bench.notes == [TransferBegan("send")]


def test_an_acknowledgement_that_comes_while_the_block_still_leaves_answers_none_of_it() -> None:
    bench = sending()
    bench.come(NAK, NAK)
    assert bench.sent == block(PROGRAM, 1)
    bench.wait(0.2)
    bench.come(NAK)
    assert bench.strategy.account().repeated_blocks == 1


def test_nobody_presses_recv() -> None:
    bench = sending()
    assert bench.wait_for_end() is Ending.NOT_STARTED
    assert bench.now_s == pytest.approx(120)
    assert bench.strategy.proof is None


def test_a_control_that_falls_silent_ends_it_with_what_was_acknowledged() -> None:
    bench = sending()
    acknowledged(bench, 2)
    assert bench.wait_for_end() is Ending.WENT_SILENT
    account = bench.strategy.account()
    assert (account.phase, account.blocks, account.bytes, account.written_bytes) == (Phase.BODY, 2, 256, 384)
    assert account.detail


def test_a_control_that_refuses_a_block_again_and_again_ends_it() -> None:
    bench = sending()
    bench.come(NAK)
    for _ in range(PATIENCE.most_repeats + 2):
        bench.wait(0.2)
        bench.come(NAK)
    assert bench.strategy.ending is Ending.GARBLED


def test_a_control_that_cancels_ends_the_sending() -> None:
    bench = sending()
    acknowledged(bench, 1)
    bench.come(CAN * 2)
    assert bench.strategy.ending is Ending.CANCELLED
    bench.come(b"late")
    assert bench.foreign == b"late"


def test_giving_up_a_sending_tells_the_control_if_it_has_begun() -> None:
    bench = sending()
    acknowledged(bench, 1)
    bench.strategy.give_up()
    assert bench.sent.endswith(CAN * 3)
    before = sending()
    before.strategy.give_up()
    assert before.written == []


def test_a_transfer_that_has_not_begun_can_be_given_up() -> None:
    strategy = send_file("xmodem", "send", PROGRAM, patience=PATIENCE)
    strategy.give_up()
    assert strategy.ending is Ending.GIVEN_UP


# A program prints, or sends by another synchronisation ----------------------------------------------------------------

PRINTED = b"COUNT 12 X1.2345 Y2.3456\r\n"


def test_what_a_program_prints_before_the_first_block_is_none_of_the_file_and_no_damage() -> None:
    bench = Reception()
    for _ in range(30):
        bench.wait(3)
        bench.come(PRINTED[:9], PRINTED[9:])
    assert bench.foreign == PRINTED * 30
    assert bench.sent == NAK * 10  # every ten seconds, whatever is printed
    for index in range(1, BLOCKS + 1):
        bench.come(block(PROGRAM, index))
        bench.wait(0.2)
    bench.come(EOT)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.file == PROGRAM


def test_a_program_that_prints_gives_the_operator_no_more_time() -> None:
    for bench in (Reception(), sending()):
        while bench.strategy.ending is None:
            bench.wait(7)
            bench.come(PRINTED)
        assert bench.strategy.ending is Ending.NOT_STARTED
        assert bench.now_s == pytest.approx(120, abs=8)


def test_what_a_program_prints_before_the_first_nak_is_handed_on() -> None:
    bench = sending()
    bench.come(PRINTED, NAK + PRINTED[:3])
    assert bench.foreign == PRINTED + PRINTED[:3]
    assert bench.sent == block(PROGRAM, 1)
    bench.wait(0.2)
    bench.come(b"noise")
    assert bench.foreign == PRINTED + PRINTED[:3]


def test_a_file_that_comes_as_it_is_ends_it_and_is_told_apart_from_damage() -> None:
    bench = Reception()
    bench.wait(3)
    for at in range(0, len(PROGRAM), 50):
        bench.come(PROGRAM[at : at + 50])
    assert bench.wait_for_end(within_s=11) is Ending.UNLIKE
    assert "not in blocks" in bench.strategy.account().detail
    assert bench.file == b""


def test_an_end_that_is_never_answered_is_told_apart_from_silence_in_the_middle() -> None:
    bench = sending()
    acknowledged(bench, BLOCKS)
    assert bench.wait_for_end() is Ending.END_UNANSWERED
    account = bench.strategy.account()
    assert account.bytes == len(PROGRAM)
    assert bench.strategy.proof is None
