"""Answers, echoes and printed text are told apart by their signs, in pieces of any size."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.frames import Broken, Echo, Form, Frame, FrameSplitter, Line, Outside, Part, PrintReader, Prompt

ANSWER = b"\x02S/N, 12345678\x17\r\n>"


def joined(parts: list[Part]) -> list[Part]:
    """Put pieces of what is outside together: how they are cut says nothing."""
    found: list[Part] = []
    for part in parts:
        last = found[-1] if found else None
        if isinstance(part, Outside) and isinstance(last, Outside) and part.is_damaged == last.is_damaged:
            found[-1] = Outside(last.data + part.data, part.is_damaged)
        else:
            found.append(part)
    return found


def split(data: bytes, form: Form = "rs-232") -> list[Part]:
    return joined(FrameSplitter(form).feed(data))


def test_an_answer_is_what_stands_between_stx_and_etb() -> None:
    assert split(ANSWER) == [Frame("S/N, 12345678"), Prompt()]


def test_answers_follow_each_other_whatever_is_missing_between() -> None:
    assert split(b"\x02A, 1\x17\x02B, 2\x17>\x02C, 3\x17\n") == [
        Frame("A, 1"),
        Frame("B, 2"),
        Prompt(),
        Frame("C, 3"),
    ]


def test_over_ethernet_an_answer_begins_with_the_prompt() -> None:
    assert split(b">MACRO, 0.0\r\n>!\r\n", "ethernet") == [Frame("MACRO, 0.0"), Prompt(), Frame("!"), Prompt()]


@pytest.mark.parametrize(
    ("came", "parts"),
    [
        (b"TEXT\r\n>S/N, 1\n", [Outside(b"TEXT\r\n"), Frame("S/N, 1"), Prompt()]),
        (b"A > B\r\n", [Outside(b"A > B\r\n")]),
        (b">\r\n>>S/N, 1\r\n", [Prompt(), Frame("S/N, 1"), Prompt()]),
        (b">S/N\r, 1\r\n", [Broken(b"S/N\r, 1"), Prompt()]),
        (b">S/\x07N\r\n", [Broken(b"S/\x07N"), Prompt()]),
    ],
)
def test_over_ethernet_only_lines_that_begin_with_it_are_answers(came: bytes, parts: list[Part]) -> None:
    assert split(came, "ethernet") == parts


def test_what_a_program_prints_between_answers_is_outside() -> None:
    assert split(b"Z 1.25\r" + ANSWER + b"Z 2.5\r\n") == [
        Outside(b"Z 1.25\r"),
        Frame("S/N, 12345678"),
        Prompt(),
        Outside(b"Z 2.5\r\n"),
    ]


def test_what_a_program_prints_between_an_answer_and_its_prompt_is_outside() -> None:
    splitter = FrameSplitter()
    parts = joined(splitter.feed(b"\x02S/N, 1\x17\rHELLO"))
    assert parts == [Frame("S/N, 1"), Outside(b"HELLO")]
    assert splitter.awaits_prompt
    assert joined(splitter.feed(b" > 5\r\n>AGAIN\r")) == [Outside(b" > 5\r\n"), Prompt(), Outside(b"AGAIN\r")]
    assert not splitter.awaits_prompt


def test_what_a_program_prints_within_an_answer_breaks_it() -> None:
    assert split(b"\x02MACRO, 30HELLO\r27, 1.0\x17\r\n>") == [Broken(b"MACRO, 30HELLO\r27, 1.0"), Prompt()]


def test_an_answer_whose_etb_was_lost_ends_with_its_prompt() -> None:
    assert split(b"\x02S/N, 1\r\n>" + ANSWER) == [
        Broken(b"S/N, 1"),
        Prompt(),
        Frame("S/N, 12345678"),
        Prompt(),
    ]


def test_an_answer_that_begins_anew_was_broken() -> None:
    assert split(b"\x02S/N\x02S/N, 1\x17") == [Broken(b"S/N"), Frame("S/N, 1")]


@pytest.mark.parametrize(("form", "begin"), [("rs-232", b"\x02"), ("ethernet", b">")])
def test_an_answer_that_never_ends_takes_no_more_than_it_may(form: Form, begin: bytes) -> None:
    splitter = FrameSplitter(form)
    parts = splitter.feed(begin + b"x" * 1000)
    assert isinstance(parts[0], Broken)
    assert len(parts[0].data) == 257
    assert not splitter.is_inside


def test_what_is_given_up_is_told() -> None:
    splitter = FrameSplitter()
    splitter.feed(b"\x02S/N")
    assert splitter.is_inside
    assert splitter.give_up() == [Broken(b"S/N")]
    assert splitter.give_up() == []
    assert splitter.feed(b"x") == [Outside(b"x")]


@pytest.mark.parametrize(
    ("before", "damaged", "parts"),
    [
        (b"\x02S/N", b", 1\x17", [Broken(b"S/N, 1")]),
        (b"", b"Zb", [Outside(b"Z", is_damaged=True), Outside(b"b")]),
        (b"\x02A\x17", b"\r\n>", [Prompt()]),
    ],
)
def test_a_damaged_byte_breaks_the_answer_that_it_is_in(before: bytes, damaged: bytes, parts: list[Part]) -> None:
    splitter = FrameSplitter()
    splitter.feed(before)
    splitter.note_damage()
    assert joined(splitter.feed(damaged)) == parts


@given(data=st.binary(max_size=300), cuts=st.lists(st.integers(0, 300)), form=st.sampled_from(["rs-232", "ethernet"]))
def test_how_what_comes_is_cut_makes_no_difference(data: bytes, cuts: list[int], form: Form) -> None:
    places = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    splitter = FrameSplitter(form)
    parts = [part for begin, end in pairwise(places) for part in splitter.feed(data[begin:end])]
    assert joined(parts) == split(data, form)


@given(texts=st.lists(st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=60), max_size=6))
def test_every_answer_comes_out_as_it_went_in(texts: list[str]) -> None:
    data = b"".join(b"\x02" + text.encode() + b"\x17\r\n>" for text in texts)
    assert [part.text for part in split(data) if isinstance(part, Frame)] == texts


# Printed text --------------------------------------------------------------------------------------------------------


def test_each_cr_ends_a_line_and_lf_behind_it_is_none() -> None:
    assert PrintReader().feed(b"A\rB\r\nC\n\r\r\n\n") == [
        Line("A"),
        Line("B"),
        Line("C"),
        Line(""),
        Line(""),
        Line(""),
    ]


def test_what_opens_and_closes_the_port_is_not_printed() -> None:
    assert PrintReader().feed(b"\x12\x00HELLO\x7f\r\x14") == [Line("HELLO")]


def test_a_long_line_comes_in_several() -> None:
    lines = PrintReader().feed(b"x" * 1100 + b"\r")
    assert lines == [Line("x" * 512, is_whole=False), Line("x" * 512, is_whole=False), Line("x" * 76)]


def test_a_damaged_line_says_so() -> None:
    reader = PrintReader()
    reader.feed(b"Z 1.")
    reader.feed(b"\xb5", is_damaged=True)
    assert reader.feed(b"\rB\r") == [Line("Z 1.\xb5", is_damaged=True), Line("B")]


def test_an_echo_is_known_once() -> None:
    reader = PrintReader()
    reader.expect_echo("Q600 3027")
    assert reader.feed(b"Q600 3027\r\nQ600 3027\r\n") == [Echo("Q600 3027"), Line("Q600 3027")]


@pytest.mark.parametrize("echo", [b"?Q100", b">?Q100 "])
def test_an_echo_without_an_end_is_known_by_the_answer_behind_it(echo: bytes) -> None:
    reader = PrintReader()
    reader.expect_echo("?Q100")
    reader.feed(echo)
    found = reader.answer_begins()
    assert [type(each) for each in found] == [Echo]
    assert not reader.has_begun_line


@pytest.mark.parametrize("left", [b">", b"!"])
def test_the_rest_of_an_answer_is_no_printed_text(left: bytes) -> None:
    reader = PrintReader()
    reader.feed(left)
    assert reader.answer_begins() == []
    assert reader.feed(b"A\r") == [Line("A")]


def test_a_line_goes_on_behind_an_answer() -> None:
    reader = PrintReader()
    reader.feed(b"HEL")
    assert reader.answer_begins() == []
    assert reader.has_begun_line
    assert reader.feed(b"LO\r") == [Line("HELLO")]


def test_a_line_that_is_given_up_is_told() -> None:
    reader = PrintReader()
    reader.feed(b"HEL")
    assert reader.give_up() == [Line("HEL", is_whole=False)]
    assert reader.give_up() == []
