"""How a block ends on the line: the patterns of Setting 25."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["EobPattern"]


class EobPattern(StrEnum):
    """
    What is sent for each end of block (Setting 25; OpenDNC).

    On receipt any mix of CR and LF ends a block, and CR LF ends one (inferred); that CR CR or LF LF end one block and
    not two can only be known from the setting, or from a whole file in which no end is single.
    """

    CR_LF = "cr lf"
    LF = "lf"
    CR = "cr"
    CR_CR = "cr cr"
    LF_LF = "lf lf"

    @property
    def data(self) -> bytes:
        r"""As bytes: ``b"\r\n"``."""
        return self.value.replace("cr", "\r").replace("lf", "\n").replace(" ", "").encode("ascii")

    @property
    def on_screen(self) -> str:
        """As the page of settings shows it: ``CR LF``, ``LF ONLY``."""
        text = self.value.upper()
        return text if " " in text else f"{text} ONLY"
