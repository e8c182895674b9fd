"""The drive's memory of faults: the present one, and the history of S18 (UG p. 209)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Final

from compax_aio.compax.facts.device_errors import FAULT_CODES, HISTORY_ACKNOWLEDGED, HISTORY_POWERED_ON

__all__ = ["STAGES", "FaultMemory"]

STAGES: Final = 8
"""Of the history."""


class FaultMemory:
    """Which fault is present, and the last eight codes and marks; the history outlives power-off."""

    def __init__(self) -> None:
        self.fault: int | None = None
        """E1-E57: positioning is refused until it is acknowledged."""
        self.warning: int | None = None
        """Any higher code."""
        self._history: deque[int] = deque([0] * STAGES, maxlen=STAGES)

    @property
    def present(self) -> int | None:
        """The code that S30 shows."""
        return self.fault or self.warning

    @property
    def history(self) -> tuple[int, ...]:
        """Eight codes and marks, newest first; 0 where nothing has happened yet."""
        return tuple(self._history)

    def came(self, code: int) -> None:
        """Note a fault or warning."""
        if code in FAULT_CODES:
            self.fault = code
        else:
            self.warning = code
        self._history.appendleft(code)

    def acknowledged(self) -> None:
        """Clear what is present, by QUIT."""
        self._clear(HISTORY_ACKNOWLEDGED)

    def powered_on(self) -> None:
        """Clear what is present, by switching off and on."""
        self._clear(HISTORY_POWERED_ON)

    def remember(self, history: Iterable[int], *, unclosed: bool) -> None:
        """Take another history, newest first; the power went off while an error was present, or not."""
        self.fault = self.warning = None
        self._history = deque(history, maxlen=STAGES)
        if unclosed:
            self._history.appendleft(HISTORY_POWERED_ON)

    def _clear(self, mark: int) -> None:
        if self.present is not None:
            self._history.appendleft(mark)
        self.fault = self.warning = None
