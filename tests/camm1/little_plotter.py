"""A plotter of few words, made on its own from the sheet, to hold against what the library makes of a job."""

from __future__ import annotations

import re

__all__ = ["Segment", "segments"]

Segment = tuple[float, float, float, float, bool]
"""From where to where, and whether the tool is down."""

_WORD = re.compile(r"\s*(PU|PD|PA|PR|IN|[DMIR])([-+0-9.,\s]*);?")


def segments(job: bytes) -> list[Segment]:
    """Draw ``PU PD PA PR IN`` of mode 2 and ``D M I R`` of mode 1; anything else is an error of the test."""
    text = job.decode("ascii")
    at, x, y, down, relative = 0, 0.0, 0.0, False, False
    drawn: list[Segment] = []
    while text[at:].strip(" ;\r\n"):
        found = _WORD.match(text, at)
        assert found, f"the little plotter does not know {text[at : at + 20]!r}"
        at = found.end()
        word = found[1]
        numbers = [float(each) for each in re.split(r"[,\s]+", found[2].strip()) if each]
        if word in ("PU", "M", "R", "IN"):
            down = False
        elif word in ("PD", "D", "I"):
            down = True
        if word in ("PA", "PR", "IN"):
            relative = word == "PR"
        is_relative = word in "IR" if len(word) == 1 else relative
        for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
            new_x, new_y = (x + dx, y + dy) if is_relative else (dx, dy)
            drawn.append((x, y, new_x, new_y, down))
            x, y = new_x, new_y
    return drawn
