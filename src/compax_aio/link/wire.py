"""The last bytes of one line, kept in a small ring and written so that a person can read them."""

from __future__ import annotations

from typing import Final

__all__ = ["WireHistory", "readable"]

_ENTRIES: Final = 24
_BYTES_AN_ENTRY: Final = 96

_PICTURES: Final[dict[int, int | str]] = {
    **{code: 0x2400 + code for code in range(0x20)},
    0x7F: 0x2421,
    **{code: f"\\x{code:02x}" for code in range(0x80, 0x100)},
}


def readable(data: bytes) -> str:
    """Write *data* with control characters as pictures (``␍``) and 8-bit bytes in hexadecimal."""
    return data.decode("latin-1").translate(_PICTURES)


class WireHistory:
    """A ring of what went out (→) and came in (←), with the loop's time; pieces of one direction are joined."""

    __slots__ = ("_entries",)

    def __init__(self) -> None:
        self._entries: list[tuple[float, str, str]] = []
        """
        When, which way, and the first of it, a character for a byte.

        Never the bytes themselves: those that were read may hold on to all of the room they were read into.
        """

    def sent(self, at: float, data: bytes, *, goes_on: bool = False) -> None:
        """Note bytes that went out; where they go on with what was sent before, beside its answer, they are joined."""
        if goes_on:
            for back in range(1, min(2, len(self._entries)) + 1):
                if self._entries[-back][1] == "→":
                    self._join(-back, data)
                    return
        self._add(at, "→", data)

    def received(self, at: float, data: bytes) -> None:
        """Note bytes that came in."""
        if self._entries and self._entries[-1][1] == "←":
            self._join(-1, data)
        else:
            self._add(at, "←", data)

    def _add(self, at: float, arrow: str, data: bytes) -> None:
        if len(self._entries) == _ENTRIES:
            del self._entries[0]
        self._entries.append((at, arrow, data[:_BYTES_AN_ENTRY].decode("latin-1")))

    def _join(self, place: int, data: bytes) -> None:
        first_at, arrow, before = self._entries[place]
        text = data[:_BYTES_AN_ENTRY].decode("latin-1")
        self._entries[place] = (first_at, arrow, (before + text)[:_BYTES_AN_ENTRY])

    def received_since_sent(self) -> str | None:
        """Return what came in since something was last sent, readable; None if nothing did."""
        if self._entries and self._entries[-1][1] == "←":
            return self._entries[-1][2].translate(_PICTURES)
        return None

    def last_sent(self) -> str | None:
        """Return what went out last, readable and without its end sign; None if nothing did."""
        texts = (text for _, arrow, text in reversed(self._entries) if arrow == "→")
        return next((text.translate(_PICTURES).rstrip("␍␊") for text in texts), None)

    @property
    def has_received(self) -> bool:
        """Whether anything has come in, as far back as this goes."""
        return any(arrow == "←" for _, arrow, _ in self._entries)

    def lines(self) -> tuple[str, ...]:
        """Return the ring, oldest first: ``12.345 → PA100$␍``."""
        return tuple(f"{at:.3f} {arrow} {text.translate(_PICTURES)}" for at, arrow, text in self._entries)
