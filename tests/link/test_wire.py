"""The ring of what was said on a line, for errors and people."""

from __future__ import annotations

import sys

from compax_aio.link.wire import WireHistory, readable


def test_control_characters_are_shown_as_pictures_and_8_bit_bytes_in_hexadecimal() -> None:
    assert readable(b"S1\r\n>\x00\x11\x7f\xff\x80") == "S1␍␊>␀␑␡\\xff\\x80"


def test_what_is_written_for_a_person_is_not_cut() -> None:
    assert readable(b"x" * 1000) == "x" * 1000


def test_what_is_kept_is_a_copy_for_what_was_read_may_hold_on_to_all_of_its_room() -> None:
    history, read = WireHistory(), bytes(range(0x20, 0x60))
    held = sys.getrefcount(read)
    history.received(1.0, read)
    history.sent(2.0, read)
    assert sys.getrefcount(read) == held


def test_pieces_of_one_answer_are_one_entry() -> None:
    history = WireHistory()
    history.sent(1.0, b"S1\r")
    for at, piece in ((1.5, b"S00"), (1.6, b"1: 5"), (1.7, b"\r\n>")):
        history.received(at, piece)
    assert history.lines() == ("1.000 → S1␍", "1.500 ← S001: 5␍␊>")


def test_what_came_since_something_was_sent() -> None:
    history = WireHistory()
    assert history.received_since_sent() is None
    history.received(0.0, b"boot")
    assert history.received_since_sent() == "boot"
    history.sent(1.0, b"S1\r")
    assert history.received_since_sent() is None
    history.received(2.0, b"x")
    assert history.received_since_sent() == "x"


def test_the_ring_is_bounded_in_entries_and_bytes() -> None:
    history = WireHistory()
    for at in range(1000):
        history.sent(at, b"S" * 1000)
        history.received(at, b"x" * 100_000)
        history.received(at, b"y" * 100_000)
    assert len(history.lines()) == 24
    assert all(len(line) < 120 for line in history.lines())
    assert history.lines()[-1].startswith("999.000 ← x")
