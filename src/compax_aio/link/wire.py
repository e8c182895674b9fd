"""The last bytes of one line, kept in a small ring and written so that a person can read them."""

from __future__ import annotations

from collections import deque
from typing import Final

__all__ = ["WireHistory", "readable"]

_ENTRIES: Final = 24
_BYTES_AN_ENTRY: Final = 96

_CONTROL_PICTURES: Final = {code: 0x2400 + code for code in range(0x20)} | {0x7F: 0x2421}


def readable(data: bytes) -> str:
    """Write *data* with control characters as pictures (``␍``) and 8-bit bytes in hexadecimal."""
    return "".join(chr(_CONTROL_PICTURES.get(byte, byte)) if byte < 0x80 else f"\\x{byte:02x}" for byte in data)


class WireHistory:
    """A ring of what went out (→) and came in (←), with the loop's time; pieces of one direction are joined."""

    def __init__(self) -> None:
        self._entries: deque[tuple[float, str, bytes]] = deque(maxlen=_ENTRIES)

    def sent(self, at: float, data: bytes, *, goes_on: bool = False) -> None:
        """Note bytes that went out; where they go on with what was sent before, beside its answer, they are joined."""
        if goes_on:
            for back in range(1, min(2, len(self._entries)) + 1):
                first_at, arrow, before = self._entries[-back]
                if arrow == "→":
                    self._entries[-back] = (first_at, arrow, (before + data)[:_BYTES_AN_ENTRY])
                    return
        self._entries.append((at, "→", data[:_BYTES_AN_ENTRY]))

    def received(self, at: float, data: bytes) -> None:
        """Note bytes that came in."""
        if self._entries and self._entries[-1][1] == "←":
            first_at, arrow, before = self._entries.pop()
            self._entries.append((first_at, arrow, (before + data)[:_BYTES_AN_ENTRY]))
        else:
            self._entries.append((at, "←", data[:_BYTES_AN_ENTRY]))

    def received_since_sent(self) -> str | None:
        """Return what came in since something was last sent, readable; None if nothing did."""
        if self._entries and self._entries[-1][1] == "←":
            return readable(self._entries[-1][2])
        return None

    def last_sent(self) -> str | None:
        """Return what went out last, readable and without its end sign; None if nothing did."""
        return next((readable(data).rstrip("␍␊") for _, arrow, data in reversed(self._entries) if arrow == "→"), None)

    @property
    def has_received(self) -> bool:
        """Whether anything has come in, as far back as this goes."""
        return any(arrow == "←" for _, arrow, _ in self._entries)

    def lines(self) -> tuple[str, ...]:
        """Return the ring, oldest first: ``12.345 → PA100$␍``."""
        return tuple(f"{at:.3f} {arrow} {readable(data)}" for at, arrow, data in self._entries)
