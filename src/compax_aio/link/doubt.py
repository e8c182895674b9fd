"""What is still tried to bring one line in step, and how often it came in step in vain."""

from __future__ import annotations

from typing import Final

__all__ = ["Doubt"]

_MOST_IN_VAIN: Final = 8
"""Times a line comes in step and is in doubt again at once, before it counts as one that babbles."""


class Doubt:
    """
    Counts what is sent while a line is in doubt.

    Args:
        attempts: How many markers are tried before the device counts as silent.
    """

    __slots__ = ("_attempts", "_more_markers", "is_pursued", "markers_left", "may_send_ahead", "times_in_vain")

    def __init__(self, attempts: int) -> None:
        self._attempts = attempts
        self._more_markers = 0
        """How many the device can earn by what it says."""
        self.markers_left = 0
        """How many are sent still, if they are not answered."""
        self.is_pursued = False
        """Whether it is tried to get in step."""
        self.may_send_ahead = False
        """Whether a stop is next, of those that go ahead in turn with the markers."""
        self.times_in_vain = 0
        """Came in step, and was in doubt again before any exchange was answered."""

    @property
    def is_babble(self) -> bool:
        """Whether the line never stays in step."""
        return self.times_in_vain >= _MOST_IN_VAIN

    def begin(self) -> None:
        """Take note that the line is in doubt, anew perhaps."""
        self.markers_left = self._more_markers = self._attempts
        self.is_pursued = True
        self.may_send_ahead = True

    def late_answer_came(self) -> None:
        """Take note that the device speaks: the next marker may be the one that is answered in time."""
        if self.is_pursued and not self.markers_left and self._more_markers:
            self._more_markers -= 1
            self.markers_left = 1

    def stop_waits(self) -> None:
        """Take note of a stop that was never sent: one that comes late has its chance, too."""
        self.markers_left = max(self.markers_left, 1)

    def stop_goes_ahead(self) -> None:
        """Count a stop that goes ahead; a marker is next."""
        self.may_send_ahead = False

    def marker_goes(self) -> None:
        """Count a marker, or what goes in its place; a stop is next, if one waits."""
        self.markers_left -= 1
        self.may_send_ahead = True

    def end(self) -> None:
        """Take note that the line is in step."""
        self.times_in_vain += 1
        self.markers_left = 0
        self.is_pursued = False

    def exchange_ended(self) -> None:
        """Take note that the line did not come in step in vain."""
        self.times_in_vain = 0

    def give_up(self) -> None:
        """Take note that nobody waits for the line to come in step: what is asked next begins anew."""
        self.markers_left = self.times_in_vain = 0
        self.is_pursued = False
