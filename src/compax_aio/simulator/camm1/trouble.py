"""Trouble with a simulated cutter, by chance from one seed or when a test says so."""

from __future__ import annotations

from collections.abc import Callable

from ..trouble import Chance, ReplyTrouble
from .knobs import Knobs

__all__ = ["Trouble"]


class Trouble(ReplyTrouble):
    """
    What goes wrong, and when.

    Args:
        knobs: Chances.
        note: Called with what was done, in words.

    Attributes:
        xons_to_lose: So many Xon are not sent.
        bytes_to_spoil: So many bytes of the host arrive as others.
    """

    _knobs: Knobs

    def __init__(self, knobs: Knobs, note: Callable[[str], None]) -> None:
        super().__init__(knobs, Chance(knobs.seed), note)

    def end(self) -> None:
        """Forget what was asked for."""
        super().end()
        self.xons_to_lose = self.bytes_to_spoil = 0

    @property
    def spoils(self) -> bool:
        """Whether a byte of the host might be spoilt."""
        return self.bytes_to_spoil > 0 or self._knobs.spoil_byte > 0

    def spoilt(self, byte: int) -> int | None:
        """Return as what a byte arrives that is spoilt; None: this one is not."""
        if self.bytes_to_spoil > 0:
            self.bytes_to_spoil -= 1
        elif not self._chance.happens(self._knobs.spoil_byte):
            return None
        other = byte ^ 1 << self._chance.randrange(8)
        self._note(f"{byte:02X} spoilt: {other:02X}")
        return other

    def reply(self, data: bytes) -> tuple[bytes | None, float]:
        """Return what becomes of a reply, None if it does not come, and by how much it is late."""
        text = data.decode("latin-1")
        if self._loses_reply(text):
            return None, 0.0
        text = self._garbled_reply(text)
        return text.encode("latin-1"), self._reply_late_s(text)

    def loses_xon(self) -> bool:
        """Whether this Xon is lost."""
        if self.xons_to_lose <= 0 and not self._chance.happens(self._knobs.lose_xon):
            return False
        self.xons_to_lose = max(0, self.xons_to_lose - 1)
        self._note("Xon lost")
        return True

    def stray(self) -> bytes:
        """Return what comes out of nothing."""
        if not self._chance.happens(self._knobs.stray_byte):
            return b""
        byte = bytes([self._chance.randrange(256)])
        self._note(f"stray {byte.hex().upper()}")
        return byte
