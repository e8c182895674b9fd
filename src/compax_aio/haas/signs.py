"""DC1 and DC3 outside of files: stop and go on with Xon/Xoff, reader on and reader off with DC codes."""

from __future__ import annotations

from typing import Final

from ..link.contract import Event
from .facts.characters import DC1, DC3
from .profiles import Profile
from .protocol_events import ReaderOff, ReaderOn

__all__ = ["FlowSigns"]

_SIGNS: Final = bytes((DC1, DC3))
_HOLDING: Final = "xon/xoff"
_WITH_READER: Final = "dc codes"


class FlowSigns:
    """
    Takes the signs out of what comes, and remembers what they mean.

    Args:
        profile: How the control is set up: with wires and with XMODEM they mean nothing.

    Attributes:
        is_held: Whether the control has told to send nothing (Xoff).
        is_reader_on: Whether it has told that it reads a file, and nothing was sent since.
    """

    def __init__(self, profile: Profile) -> None:
        self.is_held = self.is_reader_on = False
        self._holds = profile.synchronization == _HOLDING
        self._tells_reader = profile.synchronization == _WITH_READER

    def forget(self) -> None:
        """Take note that the line is new."""
        self.is_held = self.is_reader_on = False

    def take(self, data: bytes) -> tuple[bytes, list[Event]]:
        """Return *data* without the signs, which may stand anywhere in it, and what they tell."""
        if not (self._holds or self._tells_reader):
            return data, []
        rest = data.translate(None, _SIGNS)
        if len(rest) == len(data):
            return data, []
        told: list[Event] = []
        for byte in data:
            if byte in _SIGNS:
                self._heed(is_go=byte == DC1, told=told)
        return rest, told

    def _heed(self, *, is_go: bool, told: list[Event]) -> None:
        if self._holds:
            self.is_held = not is_go
        else:
            self.is_reader_on = is_go
            told.append(ReaderOn() if is_go else ReaderOff())
