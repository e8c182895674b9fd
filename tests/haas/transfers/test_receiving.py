"""Files that come as they are: begun, ended, damaged, broken off, in pieces of any size."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError, LinkProtocolError
from compax_aio.haas.transfers.account import Ending, Phase
from compax_aio.haas.transfers.choosing import receive_file
from compax_aio.haas.transfers.notes import TransferBegan

from .bench import DC1, DC2, DC3, DC4, PATIENCE, Bench, in_pieces

PROGRAM = b"\r\n%\r\nO05555(A)\r\nG0 X1.\r\n\r\nM30\r\n\r\n%\r\n"
SETTINGS = b"%\r\nN0 V12345\r\nN1 V100\r\n%\r\n"


class Reception(Bench):
    """A file is awaited."""

    def __init__(self, synchronization: str = "xon/xoff", max_bytes: int = 1 << 20) -> None:
        self.pieces: list[bytes] = []
        super().__init__(
            receive_file(synchronization, "receive", self.pieces.append, patience=PATIENCE, max_bytes=max_bytes)
        )

    @property
    def file(self) -> bytes:
        return b"".join(self.pieces)


@pytest.mark.parametrize("synchronization", ["rts/cts", "xon/xoff", "dc codes"])
def test_a_file_is_whole_when_two_seconds_of_silence_are_behind_the_last_percent_sign(synchronization: str) -> None:
    bench = Reception(synchronization)
    bench.wait(60)
    bench.come(PROGRAM)
    bench.wait(1.9)
    assert bench.strategy.ending is None
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.now_s == pytest.approx(62)
    assert bench.file == PROGRAM
    assert bench.written == []


def test_dc_codes_around_a_file_end_it_soon_and_are_no_part_of_it() -> None:
    """The vector of the sheet: DC out."""
    bench = Reception("dc codes")
    bench.come(DC2, SETTINGS, DC4)
    assert bench.wait_for_end(within_s=0.5) is Ending.COMPLETE
    account = bench.strategy.account()
    assert bench.file == SETTINGS
    assert (account.has_dc2, account.has_dc4, account.is_closed, account.lines) == (True, True, True, 4)
    assert account.dropped_bytes == 2
    assert account.phase is Phase.TAIL


def test_a_missing_dc2_and_a_missing_dc4_are_told() -> None:
    bench = Reception("dc codes")
    bench.come(SETTINGS)
    assert bench.wait_for_end() is Ending.COMPLETE
    account = bench.strategy.account()
    assert (account.has_dc2, account.has_dc4, account.is_closed) == (False, False, True)


def test_blank_tape_and_flow_signs_within_a_file_are_no_part_of_it() -> None:
    bench = Reception("dc codes")
    bench.come(b"\0\0\x7f" + DC2 + b"\0 \0", SETTINGS[:9] + DC3 + DC1 + b"\0", SETTINGS[9:] + b"\0" * 20 + DC4 + b"\0")
    assert bench.wait_for_end(within_s=0.5) is Ending.COMPLETE
    assert bench.file == SETTINGS


def test_text_between_dc2_and_dc4_that_is_no_file_is_what_a_program_prints() -> None:
    bench = Reception("dc codes")
    bench.come(DC2 + b"PART 7\r" + DC4)
    bench.wait(100)
    assert bench.strategy.phase is Phase.WAIT_START
    assert bench.foreign == b"PART 7\r"
    bench.come(SETTINGS)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.file == SETTINGS
    assert not bench.strategy.account().has_dc2


def test_a_dc4_that_is_noise_in_the_middle_does_not_end_the_file() -> None:
    bench = Reception("dc codes")
    bench.come(DC2, SETTINGS[:9], DC4)
    bench.wait(1)
    bench.come(SETTINGS[9:])
    bench.wait(1.9)
    assert bench.strategy.ending is None
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.file == SETTINGS
    assert not bench.strategy.account().has_dc4


def test_a_file_that_dc4_ends_without_a_percent_sign_is_told_to_be_open() -> None:
    bench = Reception("dc codes")
    bench.come(DC2, SETTINGS[:20], DC4)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert not bench.strategy.account().is_closed


def test_a_second_file_behind_the_first_one_is_received_with_it() -> None:
    bench = Reception("dc codes")
    bench.come(DC2, SETTINGS, DC4)
    bench.wait(0.2)
    bench.come(DC2, PROGRAM, DC4)
    assert bench.wait_for_end() is Ending.COMPLETE
    assert bench.file == SETTINGS + PROGRAM


def test_nobody_presses_send() -> None:
    bench = Reception()
    assert bench.wait_for_end() is Ending.NOT_STARTED
    assert bench.now_s == pytest.approx(120)
    assert bench.strategy.account().phase is Phase.WAIT_START


def test_what_is_printed_meanwhile_does_not_make_the_wait_longer() -> None:
    bench = Reception()
    for _ in range(11):
        bench.wait(10)
        bench.come(b"PART 50% DONE\r\n")
    assert bench.wait_for_end() is Ending.NOT_STARTED
    assert bench.now_s == pytest.approx(120)
    assert bench.foreign.count(b"PART") == 11


def test_silence_in_the_middle_of_a_file_ends_it_after_thirty_seconds() -> None:
    bench = Reception()
    bench.come(PROGRAM[:20])
    bench.wait(29)
    bench.come(PROGRAM[20:25])
    assert bench.wait_for_end() is Ending.WENT_SILENT
    assert bench.now_s == pytest.approx(59)
    account = bench.strategy.account()
    assert (account.phase, account.bytes, account.is_closed) == (Phase.BODY, 25, False)
    assert bench.file == PROGRAM[:25]


def test_silence_behind_dc2_is_silence_in_the_middle() -> None:
    bench = Reception("dc codes")
    bench.come(DC2)
    assert bench.wait_for_end() is Ending.WENT_SILENT
    assert bench.now_s == pytest.approx(30)


def test_a_file_that_is_too_large_ends_and_what_had_come_is_kept() -> None:
    bench = Reception(max_bytes=30)
    bench.come(PROGRAM[:25])
    bench.come(PROGRAM[25:])
    assert bench.strategy.ending is Ending.TOO_LARGE
    assert bench.file == PROGRAM[:25]
    bench.come(b"more")
    assert bench.foreign == b"\r\nmore"


def test_damage_is_told_with_its_place_in_the_file() -> None:
    bench = Reception()
    bench.strategy.note_damage()  # in front of the file: none of it
    bench.come(b"x\r\n")
    bench.come(SETTINGS[:5])
    bench.strategy.note_damage()
    bench.come(SETTINGS[5:])
    bench.wait_for_end()
    account = bench.strategy.account()
    begin = len(bench.file) - len(SETTINGS)
    assert (account.damage_offsets, account.damaged_bytes) == ((begin + 5,), 1)


def test_of_very_much_damage_the_first_places_are_kept() -> None:
    bench = Reception()
    bench.come(b"%\r\n")
    for _ in range(500):
        bench.strategy.note_damage()
        bench.come(b"x")
    account = bench.strategy.account()
    assert account.damaged_bytes == 500
    assert account.damage_offsets == tuple(range(3, 103))


def test_its_beginning_is_told_once() -> None:
    bench = Reception()
    bench.come(PROGRAM[:10], PROGRAM[10:])
    assert bench.notes == [TransferBegan("receive")]


def test_giving_it_up_writes_nothing() -> None:
    bench = Reception()
    bench.come(PROGRAM[:10])
    bench.strategy.give_up()
    bench.strategy.give_up()
    assert bench.strategy.ending is Ending.GIVEN_UP
    assert bench.written == []


def test_a_line_that_is_lost_ends_it_once() -> None:
    bench = Reception()
    bench.strategy.line_lost()
    bench.strategy.give_up()
    assert bench.strategy.ending is Ending.LINE_LOST


def test_a_transfer_begins_once() -> None:
    bench = Reception()
    with pytest.raises(LinkProtocolError, match="never sent twice"):
        Bench(bench.strategy)


def test_a_synchronisation_that_there_is_not_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="'dtr'") as caught:
        Reception("dtr")
    assert "rts/cts, xon/xoff, dc codes, xmodem" in str(caught.value.hint)


PIECES = st.lists(
    st.sampled_from([b"%", b"\r\n", b"\n", b" ", b"O1", b"X\xb0", b"\0", DC1, DC2, DC3, DC4, b"M30", b"\x02", b"\x17"]),
    max_size=30,
)


@given(parts=PIECES, cuts=st.lists(st.integers(0, 200), max_size=10))
def test_pieces_of_any_size_make_no_difference(parts: list[bytes], cuts: list[int]) -> None:
    data = b"".join(parts)
    whole, cut = Reception("dc codes"), Reception("dc codes")
    whole.come(data)
    cut.come(*in_pieces(data, cuts))
    assert (cut.file, cut.foreign, cut.strategy.account()) == (whole.file, whole.foreign, whole.strategy.account())
    assert whole.wait_for_end() is cut.wait_for_end()


@given(parts=PIECES)
def test_what_is_handed_on_is_what_came_without_the_signs(parts: list[bytes]) -> None:
    data = b"".join(parts)
    bench = Reception("rts/cts")
    bench.come(data)
    text = data.translate(None, b"\0\x7f" + DC1 + DC2 + DC3 + DC4)
    assert text.endswith(bench.file.lstrip(b"\r\n"))
    if bench.file:
        assert bench.file.lstrip(b"\r\n").startswith(b"%")
    assert text == bench.foreign + bench.file.lstrip(b"\r\n")
