"""Trouble with a simulated cutter, by chance from one seed or when a test says so."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from random import Random

from .knobs import Knobs

__all__ = ["Trouble"]


class Trouble:
    """
    What goes wrong, and when.

    Args:
        knobs: Chances.
        note: Called with what was done, in words.

    Attributes:
        replies_to_lose: So many replies are not sent.
        replies_to_garble: So many get another character somewhere.
        replies_to_delay_s: By how much each of the next ones is late.
        xons_to_lose: So many Xon are not sent.
        bytes_to_spoil: So many bytes of the host arrive as others.
    """

    def __init__(self, knobs: Knobs, note: Callable[[str], None]) -> None:
        self._knobs = knobs
        self._note = note
        self._chance = Random(knobs.seed)
        self.end()

    def end(self) -> None:
        """Forget what was asked for."""
        self.replies_to_lose = self.replies_to_garble = self.xons_to_lose = self.bytes_to_spoil = 0
        self.replies_to_delay_s: deque[float] = deque()

    @property
    def spoils(self) -> bool:
        """Whether a byte of the host might be spoilt."""
        return self.bytes_to_spoil > 0 or self._knobs.spoil_byte > 0

    def spoilt(self, byte: int) -> int | None:
        """Return as what a byte arrives that is spoilt; None: this one is not."""
        if self.bytes_to_spoil > 0:
            self.bytes_to_spoil -= 1
        elif not self._happens(self._knobs.spoil_byte):
            return None
        other = byte ^ 1 << self._chance.randrange(8)
        self._note(f"{byte:02X} spoilt: {other:02X}")
        return other

    def reply(self, text: bytes) -> tuple[bytes | None, float]:
        """Return what becomes of a reply, None if it does not come, and by how much it is late."""
        if self.replies_to_lose > 0 or self._happens(self._knobs.lose_reply):
            self.replies_to_lose = max(0, self.replies_to_lose - 1)
            self._note(f"reply {text.decode('latin-1')} lost")
            return None, 0.0
        if text and (self.replies_to_garble > 0 or self._happens(self._knobs.garble_reply)):
            self.replies_to_garble = max(0, self.replies_to_garble - 1)
            at = self._chance.randrange(len(text))
            other = text[:at] + bytes([text[at] ^ 1 << self._chance.randrange(7)]) + text[at + 1 :]
            self._note(f"reply {text.decode('latin-1')} became {other.decode('latin-1')!r}")
            text = other
        late_s = 0.0
        if self.replies_to_delay_s:
            late_s = self.replies_to_delay_s.popleft()
        elif self._happens(self._knobs.late_reply):
            late_s = self._knobs.late_s
        if late_s:
            self._note(f"reply {text.decode('latin-1')} {late_s:g} s late")
        return text, late_s

    def loses_xon(self) -> bool:
        """Whether this Xon is lost."""
        if self.xons_to_lose <= 0 and not self._happens(self._knobs.lose_xon):
            return False
        self.xons_to_lose = max(0, self.xons_to_lose - 1)
        self._note("Xon lost")
        return True

    def stray(self) -> bytes:
        """Return what comes out of nothing."""
        if not self._happens(self._knobs.stray_byte):
            return b""
        byte = bytes([self._chance.randrange(256)])
        self._note(f"stray {byte.hex().upper()}")
        return byte

    def _happens(self, probability: float) -> bool:
        return probability > 0 and self._chance.random() < probability
