"""Files sent a few bytes at a time: held, let go on, ended, stuck; and drip feed."""

from __future__ import annotations

import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.transfers.account import Ending, Phase
from compax_aio.haas.transfers.choosing import drip_feed, send_file
from compax_aio.haas.transfers.notes import TransferBegan, TransferHeld, TransferStillHeld, TransferWentOn

from .bench import DC1, DC3, PATIENCE, RATE, Bench

PROGRAM = b"\r\n%\r\nO05555\r\n" + b"G01 X1.2345 Y6.789\r\n" * 50 + b"M30\r\n%\r\n"
SYNCHRONIZATIONS = ["rts/cts", "xon/xoff", "dc codes"]


def sending(synchronization: str, data: bytes = PROGRAM, **more: object) -> Bench:
    """Begin to send a file; with DC codes the control has said that its reader is on."""
    bench = Bench(send_file(synchronization, "send", data, patience=PATIENCE, **more))  # type: ignore[arg-type]
    if synchronization == "dc codes":
        bench.come(DC1)
    return bench


@pytest.mark.parametrize("synchronization", SYNCHRONIZATIONS)
def test_a_file_goes_out_byte_for_byte_at_the_speed_of_the_line(synchronization: str) -> None:
    bench = sending(synchronization)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.sent == PROGRAM
    assert bench.strategy.proof == "left the line"
    last = bench.written[-1][0]
    assert last == pytest.approx(len(PROGRAM) / RATE, rel=0.05)
    account = bench.strategy.account()
    assert account.bytes == account.written_bytes == account.total_bytes == len(PROGRAM)
    assert account.lines == PROGRAM.count(b"\r\n")
    assert account.phase is Phase.TAIL


@pytest.mark.parametrize(("synchronization", "most"), [("rts/cts", 64), ("xon/xoff", 16), ("dc codes", 16)])
def test_never_more_than_a_few_bytes_are_written_or_wait(synchronization: str, most: int) -> None:
    bench = sending(synchronization)
    bench.wait_for_end()
    assert max(len(data) for _, data in bench.written) <= 16
    assert bench.most_unsent <= most


def test_how_many_may_wait_can_be_set() -> None:
    bench = sending("xon/xoff", most_unsent_bytes=1)
    bench.wait_for_end()
    assert bench.most_unsent == 1
    assert bench.sent == PROGRAM


def test_xoff_holds_it_and_xon_lets_it_go_on_and_what_left_in_between_is_counted() -> None:
    bench = sending("xon/xoff")
    bench.wait(0.1)
    bench.come(DC3)
    written = len(bench.sent)
    bench.wait(20)
    assert len(bench.sent) == written
    account = bench.strategy.account()
    assert account.is_held
    assert account.bytes == written
    assert account.hold_offsets == (written - account.held_bytes,)
    assert 0 < account.held_bytes <= 16
    assert account.most_held_bytes == account.held_bytes
    bench.come(DC1)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.sent == PROGRAM
    began, held, went_on = bench.notes
    assert began == TransferBegan("send")
    assert held == TransferHeld("send", written - account.held_bytes, account.held_bytes)
    assert went_on == TransferWentOn("send", written)


def test_an_xoff_that_comes_again_counts_once_and_an_xon_too() -> None:
    bench = sending("xon/xoff")
    bench.come(DC3 + DC3, DC3)
    bench.come(DC1 + DC1)
    assert bench.strategy.account().holds == 1


def test_a_control_that_never_says_go_on_ends_it() -> None:
    bench = sending("xon/xoff")
    bench.wait(0.1)
    bench.come(DC3)
    written = len(bench.sent)
    assert bench.wait_for_end() is Ending.HELD_TOO_LONG
    assert bench.now_s == pytest.approx(30.1)
    account = bench.strategy.account()
    assert (account.bytes, account.phase, account.is_held) == (written, Phase.BODY, True)
    assert bench.strategy.proof is None


def test_each_xon_gives_the_control_its_time_anew() -> None:
    bench = sending("xon/xoff")
    for _ in range(5):
        bench.come(DC3)
        bench.wait(29)
        bench.come(DC1)
        bench.wait(0.1)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.strategy.account().holds == 5


@pytest.mark.parametrize("synchronization", SYNCHRONIZATIONS)
def test_what_does_not_leave_ends_it(synchronization: str) -> None:
    bench = sending(synchronization)
    bench.wait(0.2)
    bench.is_blocked = True
    written = len(bench.sent)
    assert bench.wait_for_end() is Ending.STUCK
    assert 30 <= bench.now_s <= 31.5
    account = bench.strategy.account()
    assert account.bytes < account.written_bytes
    assert account.written_bytes <= written + 64
    assert len(bench.written) < 100


def test_what_stands_still_for_a_while_goes_on() -> None:
    bench = sending("rts/cts")
    bench.is_blocked = True
    bench.wait(29)
    bench.is_blocked = False
    bench.wait(0.2)
    bench.is_blocked = True
    bench.wait(29)
    bench.is_blocked = False
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.sent == PROGRAM


def test_with_dc_codes_nothing_is_sent_before_the_reader_is_on() -> None:
    bench = Bench(send_file("dc codes", "send", PROGRAM, patience=PATIENCE))
    bench.come(DC3)
    bench.wait(119)
    assert bench.written == []
    bench.come(DC1)
    assert bench.sent == PROGRAM[:16]


def test_with_dc_codes_nobody_presses_recv() -> None:
    bench = Bench(send_file("dc codes", "send", PROGRAM, patience=PATIENCE))
    assert bench.wait_for_end() is Ending.NOT_STARTED
    assert bench.now_s == pytest.approx(120)
    assert bench.strategy.account().bytes == 0


def test_with_dc_codes_a_reader_that_was_on_before_is_on() -> None:
    bench = Bench(send_file("dc codes", "send", PROGRAM, patience=PATIENCE), reader_is_on=True)
    assert bench.sent == PROGRAM[:16]


def test_with_xon_a_first_one_is_awaited_only_if_that_is_wanted() -> None:
    assert sending("xon/xoff").written
    bench = sending("xon/xoff", waits_for_start=True)
    bench.wait(10)
    assert bench.written == []
    bench.come(DC1)
    assert bench.wait_for_end() is Ending.COMPLETE


def test_a_reader_that_is_off_behind_the_last_percent_sign_proves_that_it_was_read() -> None:
    """The vector of the sheet: DC in."""
    data = b"%\r\nN1 V100\r\n%\r\n"
    bench = sending("dc codes", data)
    bench.wait(len(data) / RATE + 0.3)
    bench.come(DC3)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.strategy.proof == "reader off seen"
    assert bench.sent == data
    assert not bench.strategy.account().is_held


def test_a_reader_that_is_off_when_only_the_end_of_the_block_has_to_leave_proves_it_too() -> None:
    data = b"%\r\nN1 V100\r\n%\r\n"
    bench = sending("dc codes", data)
    bench.wait((len(data) - 1.5) / RATE)
    bench.come(DC3)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.strategy.proof == "reader off seen"


def test_the_end_of_the_block_is_written_though_the_reader_is_off_already() -> None:
    data = b"%\r\nO00077\r\nN10 G0 X1.\r\nM30\r\n%\r\n"
    for signs, proof in ((DC3, "reader off seen"), (DC3 + DC1, "left the line")):
        bench = sending("dc codes", data, most_unsent_bytes=1)
        while bench.sent != data[:-1]:
            bench.wait(0.5 / RATE)
        bench.wait(0.9 / RATE)
        bench.come(signs)
        assert bench.wait_for_end() is Ending.COMPLETE
        assert bench.sent == data
        assert bench.strategy.proof == proof


def test_a_dc3_that_comes_before_the_percent_sign_has_left_proves_nothing() -> None:
    data = b"%\r\nN1 V100\r\n%\r\n"
    bench = sending("dc codes", data)
    assert bench.sent == data
    bench.come(DC3)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.now_s == pytest.approx(5, abs=0.1)
    assert bench.strategy.proof == "left the line"


def test_a_last_dc3_from_a_line_that_is_faster_than_is_known_holds_the_end_for_a_moment_and_proves_nothing() -> None:
    data = b"%\r\nN1 V1\r\n%" + b"\r\n" * 4
    bench = sending("dc codes", data)
    assert b"V1\r\n%" in bench.sent  # written, and reckoned to be on its way
    assert bench.sent != data
    bench.come(DC3)
    assert bench.strategy.account().is_held
    bench.wait(4)
    assert bench.sent != data
    assert bench.wait_for_end(within_s=8) is Ending.COMPLETE
    assert bench.sent == data
    assert bench.strategy.proof == "left the line"


def test_a_dc3_behind_the_end_that_a_dc1_follows_was_an_xoff_and_the_last_one_is_awaited() -> None:
    bench = sending("dc codes")
    bench.wait(len(PROGRAM) / RATE + 0.2)
    bench.come(DC3)
    bench.wait(0.3)
    bench.come(DC1)
    bench.wait(4.5)
    assert bench.strategy.ending is None
    bench.come(DC3)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.strategy.proof == "reader off seen"


def test_an_xoff_just_before_the_end_and_the_last_dc3_are_told_apart() -> None:
    data = b"%\r\nN1 V100\r\n%\r\n"
    bench = sending("dc codes", data)
    bench.come(DC3)
    bench.wait(0.1)
    bench.come(DC1)
    bench.wait(0.5)
    bench.come(DC3)
    assert bench.wait_for_end(within_s=1) is Ending.COMPLETE
    assert bench.strategy.proof == "reader off seen"


def test_a_dc3_and_a_dc1_while_the_end_leaves_are_no_proof() -> None:
    data = b"%\r\nN1 V100\r\n%" + b"\r\n" * 2
    bench = sending("dc codes", data)
    bench.wait((len(data) - 2) / RATE)
    bench.come(DC3 + DC1)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.strategy.proof == "left the line"


def test_signs_are_nothing_to_wires() -> None:
    bench = sending("rts/cts")
    bench.come(DC3)
    assert bench.foreign == DC3
    assert bench.wait_for_end() is Ending.COMPLETE


def test_other_bytes_that_come_meanwhile_are_none_of_it() -> None:
    bench = sending("xon/xoff")
    bench.come(b"PART" + DC3 + b" 7\r")
    assert bench.foreign == b"PART 7\r"
    assert bench.strategy.account().is_held


def test_giving_it_up_writes_no_more_and_tells_what_went() -> None:
    bench = sending("xon/xoff")
    bench.wait(0.1)
    bench.strategy.give_up()
    written = len(bench.sent)
    bench.come(DC3 + DC1)
    bench.wait(10)
    account = bench.strategy.account()
    assert (len(bench.sent), account.written_bytes, account.ending) == (written, written, Ending.GIVEN_UP)


def test_a_line_of_unknown_speed_is_given_a_few_bytes_at_a_time() -> None:
    bench = Bench(send_file("xon/xoff", "send", PROGRAM, patience=PATIENCE), rate=None)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.sent == PROGRAM
    assert max(len(data) for _, data in bench.written) <= 16
    assert bench.written[-1][0] >= len(PROGRAM) / 16 * 0.001 - 0.002


@pytest.mark.parametrize("eob", [b"\r\n", b"\n", b"\r", b"\r\r", b"\n\n"])
def test_lines_are_counted_by_the_end_of_block(eob: bytes) -> None:
    data = eob.join([b"%", b"O1", b"M30", b"%", b""])
    bench = sending("xon/xoff", data, eob=eob)
    bench.strategy.account()
    bench.wait_for_end()
    assert bench.strategy.account().lines == 4


@pytest.mark.parametrize("synchronization", ["rts/cts", "xon/xoff", "dc codes", "xmodem"])
def test_nothing_to_send_is_refused(synchronization: str) -> None:
    with pytest.raises(InvalidCommandError, match="nothing to send"):
        send_file(synchronization, "send", b"", patience=PATIENCE)
    with pytest.raises(InvalidCommandError, match="nothing to send"):
        drip_feed(synchronization, "send", b"", patience=PATIENCE)


@given(
    signs=st.lists(st.tuples(st.floats(0, 0.3), st.sampled_from([DC1, DC3, b"x", DC3 + DC1])), max_size=30),
    synchronization=st.sampled_from(SYNCHRONIZATIONS),
    most=st.integers(1, 16),
)
def test_whatever_signs_come_no_byte_is_sent_twice_and_it_ends(
    signs: list[tuple[float, bytes]], synchronization: str, most: int
) -> None:
    bench = sending(synchronization, most_unsent_bytes=most)
    is_held = False
    for pause_s, sign in signs:
        bench.wait(pause_s)
        before = len(bench.sent)
        if is_held and synchronization != "rts/cts" and bench.strategy.account().phase is Phase.BODY:
            assert bench.strategy.account().is_held
        bench.come(sign)
        is_held = sign == DC3 if sign != b"x" else is_held
        assert len(bench.sent) - before <= 16
    ending = bench.wait_for_end()
    assert PROGRAM.startswith(bench.sent)
    assert ending is (Ending.COMPLETE if bench.sent == PROGRAM else Ending.HELD_TOO_LONG)
    assert bench.most_unsent <= most


# Drip feed ------------------------------------------------------------------------------------------------------------


def dripping(synchronization: str = "xon/xoff") -> Bench:
    return Bench(drip_feed(synchronization, "drip", PROGRAM, patience=PATIENCE))


def test_a_drip_feed_that_is_held_for_long_is_told_and_goes_on_where_it_was() -> None:
    bench = dripping()
    bench.wait(0.1)
    bench.come(DC3)
    at = len(bench.sent)
    bench.wait(100)
    told = [note for note in bench.notes if isinstance(note, TransferStillHeld)]
    assert told == [TransferStillHeld("drip", at, held_s) for held_s in (30, 60, 90)]
    bench.come(DC1)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.sent == PROGRAM


def test_a_drip_feed_remembers_where_it_was_held() -> None:
    bench = dripping()
    offsets = []
    for _ in range(4):
        bench.wait(0.1)
        bench.come(DC3)
        account = bench.strategy.account()
        offsets.append(account.hold_offsets[-1])
        bench.wait(1)
        bench.come(DC1)
    assert bench.strategy.account().hold_offsets == tuple(offsets)
    assert offsets == sorted(offsets)


def test_a_drip_feed_is_not_held_for_ever() -> None:
    bench = dripping()
    bench.come(DC3)
    assert bench.wait_for_end() is Ending.HELD_TOO_LONG
    assert bench.now_s == pytest.approx(PATIENCE.drip_held_s)


def test_a_drip_feed_whose_wires_hold_it_is_told_too() -> None:
    bench = dripping("rts/cts")
    bench.is_blocked = True
    bench.wait(70)
    told = [note for note in bench.notes if isinstance(note, TransferStillHeld)]
    assert [round(note.held_s) for note in told] == [30, 60]
    assert [note.offset for note in told] == [0, 0]
    assert bench.wait_for_end() is Ending.STUCK
    assert bench.now_s == pytest.approx(PATIENCE.drip_held_s, abs=1)


def test_there_is_no_drip_feed_with_xmodem() -> None:
    with pytest.raises(InvalidCommandError, match="XMODEM") as caught:
        dripping("xmodem")
    assert "Setting 14" in str(caught.value.hint)


def test_a_large_program_costs_no_more_a_byte_than_a_small_one() -> None:
    """No piece of it is copied but those that are written."""
    bench = Bench(send_file("xon/xoff", "send", b"%\r\n" + b"N1 G1 X1.\r\n" * 200_000 + b"%\r\n", patience=PATIENCE))
    tracemalloc.start()
    try:
        bench.wait(1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 200_000
