"""What empties the buffers of axes, stops or resets them: single characters, each with the pause that it needs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

from .facts import BACKSPACE, ESCAPE, LINE_FEED, RESET, SPACE, Mode
from .settings import SmcSettings

__all__ = ["Clearing", "Steps"]

Steps: TypeAlias = list[tuple[bytes, float]]
"""What is sent, and for how many seconds nothing is sent after it."""

_ESCAPE_AGAIN_S: Final = 0.005
"""The first one may have fallen on a character that the controller had not read yet; it does no harm twice."""
_BACKSPACE_S: Final = 0.03
_NAMING_S: Final = 0.1

_BLANK: Final = bytes((SPACE,))
_LINE_FEED: Final = bytes((LINE_FEED,))


@dataclass(frozen=True, slots=True)
class Clearing:
    """Words what clears one line."""

    mode: Mode
    settings: SmcSettings

    def after_command(self, may_hold: int, *, is_half_typed: bool) -> Steps:
        """
        Clear what is left of a command that was not ended.

        Args:
            may_hold: So many characters may stand in a buffer.
            is_half_typed: They may be half a command of this end.
        """
        if is_half_typed and self.settings.cancel_with == "escape":
            return self.escape()
        if self.mode.has_names:
            return [(_LINE_FEED, self.settings.quiet_s)]
        # A blank first: were it just reset, any other character would become its name (DCB p. 23).
        backspaces = [(bytes((BACKSPACE,)), _BACKSPACE_S)] * (may_hold + 1)
        return [(_BLANK, self.settings.sign_on_s), *backspaces]

    def preempting(self, text: str, left: Iterable[tuple[bytes, float]]) -> Steps:
        """
        Send ESC, or ^C with a name or none behind it.

        Args:
            text: Of them.
            left: What was still to be sent to clear the line.
        """
        steps = self.escape() if text == chr(ESCAPE) else self._reset(text[1:])
        still_to_send = [data for data, _ in left]
        if text == chr(ESCAPE) and bytes((RESET,)) in still_to_send:
            return [*steps, *left]  # who asked for the reset will be told that it was
        # A single axis that was reset takes what comes first for its name (DCB p. 23), unless it is a blank.
        return [(_BLANK, _ESCAPE_AGAIN_S), *steps] if _BLANK in still_to_send else steps

    def escape(self) -> Steps:
        """Abort all axes (AMS p. 25)."""
        escape = bytes((ESCAPE,))
        steps = [(escape, _ESCAPE_AGAIN_S), (escape, self.settings.escape_quiet_s)]
        return [*steps, (_LINE_FEED, self.settings.quiet_s)] if self.mode.has_names else steps

    def _reset(self, name: str) -> Steps:
        """^C, once: a second one would become the name of a single axis (DCB p. 23)."""
        steps = [(b"", self.settings.quiet_s), (bytes((RESET,)), self.settings.profile.reset_time_s)]
        if self.mode.has_names:
            return [*steps, (_LINE_FEED, self.settings.quiet_s)]
        naming = [(name.encode("latin-1"), _NAMING_S)] if name else []
        return [*steps, *naming, (_BLANK, self.settings.sign_on_s)]

    def wants_sign_on(self, step: tuple[bytes, float]) -> bool:
        """Whether an axis that hears *step* says something, at least an echo: one that is silent is deaf as yet."""
        return step == (_BLANK, self.settings.sign_on_s)
