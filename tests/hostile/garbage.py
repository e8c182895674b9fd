"""What no drive should send, and some lines do: noise, halves of answers, floods, texts of other devices."""

from __future__ import annotations

from hypothesis import strategies as st

__all__ = ["WORST", "chunks", "garbage"]

PIECES = (
    *(
        b"\r\n>",
        b"\r\n",
        b"\r",
        b"\n",
        b">",
        b"$",
        b"$\r\n>",
        b"1\r\n>",
        b"8",
        b"E92\r\n>",
        b"E53",
        b"\0",
        b"\x11",
        b"\x13",
    ),
    *(
        b"S001: 77.00",
        b"S016: 1101",
        b"S017: 00100010\r\n>",
        b"S77: 1\r\n>",
        b"P020: 3\r\n>",
        b"S002",
        b"N001: END\r\n>",
    ),
    *(b"login: ", b"!0000\r", b">\r", b"OK\r\n", b"PA 5\r", b"S1\r", b"\x1b[2J", b"\xff" * 7, b"S0000000000000001"),
    *(b"S001: 1 " + b"a" * 60 + b" 5\r\n>", b"S001: " + b"9" * 250 + b"\r\n>", b"U" * 700, b"$" * 300, b"E" * 300),
)
garbage = st.lists(st.sampled_from(PIECES) | st.binary(max_size=40), max_size=12).map(b"".join)
chunks = st.lists(garbage, min_size=1, max_size=12)

WORST = (
    *(b"\r\n>", b"$\r\n>", b"S77: 1\r\n>", b"E92\r\n>", b"1\r\n>", b"a\r", b"\r", b"x", b"\x11", b">\r", b"login:"),
    *(b"a" * 255 + b"\r\n>", b"S" + b"0" * 250 + b"x\r\n>", b"E" * 250 + b"\r\n>", b"S1: 1 " + b"ab " * 80 + b"5\r\n>"),
    *(
        b"1 " * 127 + b"\r\n>",
        b"!0 " * 100,
        b"\r\n",
        b"S001: " + b"-" * 200 + b"\r\n>",
        b"S001: 1 " + b"a" * 200 + b" 5\r\n>",
    ),
)
"""What takes the most time to read, again and again."""
