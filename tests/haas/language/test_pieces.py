"""A large file is looked through in pieces of whole lines: nobody waits long for his turn, and nothing is missed."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.language import lines
from compax_aio.haas.language.lines import Lines, matches

ENDS = st.sampled_from([b"\r", b"\n", b"\r\n", b"\r\r", b"\n\n", b"\r\n\r\n\r\n\r\n\r\n\r\n"])
PARTS = st.lists(st.one_of(ENDS, st.sampled_from([b"%", b"O1", b"(A)", b"X1", b" ", b"\x07"])), max_size=60)
PATTERNS = [rb"\r\n?|\n", rb"\r\r|\r\n|\r|\n", rb"\n\n|\r\n|\r|\n", rb"(?<![^\r\n])[^\r\n%]*%[^\r\n]*", rb"\x07"]


@pytest.mark.parametrize("pattern", PATTERNS)
@given(parts=PARTS, begin=st.integers(0, 10), size=st.integers(8, 20))
def test_pieces_find_what_the_whole_has(pattern: bytes, parts: list[bytes], begin: int, size: int) -> None:
    data = b"".join(parts)
    longest = max(map(len, re.split(rb"[\r\n]", data)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lines, "_PIECE_BYTES", max(size, longest + 1))
        compiled = re.compile(pattern)
        found = [(each.span(), each[0]) for each in matches(compiled, data, begin)]
    assert found == [(each.span(), each[0]) for each in compiled.finditer(data, begin)]


def test_no_piece_of_a_large_file_is_large() -> None:
    class Watched:
        def __init__(self) -> None:
            self.sizes: list[int] = []

        def finditer(self, data: bytes, begin: int, end: int) -> list[re.Match[bytes]]:
            self.sizes.append(end - begin)
            return []

    watched = Watched()
    data = b"G01 X1.2345 Y2.3456\r\n" * 100_000
    assert list(matches(watched, data)) == []  # type: ignore[arg-type]
    assert sum(watched.sizes) == len(data)
    assert max(watched.sizes) < 70_000


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r", b"\r\r", b"\n\n"])
def test_blank_lines_of_more_than_a_piece_are_counted_right(end: bytes) -> None:
    data = b"%" + end + end * 50_000 + b"O1" + end + b"%" + end
    assert len(Lines(data).raw) == 50_003
