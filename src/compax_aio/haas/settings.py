"""What a user sets of one control's line: how long each phase may take, how much may come, what may be written."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite
from typing import Final

from ..checked_numbers import check_time, check_whole
from ..errors import InvalidCommandError
from ..escaping import shown

__all__ = ["ControlSettings"]

_COUNTS: Final = ("resync_attempts", "reconnect_attempts", "back_off_after")
_SIZES: Final = ("max_bytes", "most_blocks_repeated", "most_unsent_bytes")
_MAY_BE_NONE: Final = frozenset({"reconnect_attempts", "baud_rate"})
_LEAST_CYCLE_S: Final = 1.0
_LEAST_GAP_S: Final = 0.02
_MOST_VARIABLE: Final = 99_999


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSettings:
    """
    How long things may take on one line, and how much may come; all times in seconds.

    Raises:
        InvalidCommandError: A value means nothing.
    """

    # Files
    operator_timeout_s: float = 120.0
    """How long the operator may take to press SEND or RECV at the control."""
    silence_timeout_s: float = 30.0
    """For so long nothing may come in the middle of a file, and the control may hold the line (Xoff, CTS)."""
    tail_s: float = 2.0
    """After the last ``%`` nothing must come for so long: with that a file is whole that no DC4 ends …"""
    reader_off_timeout_s: float = 5.0
    """… and so long the control may take to say that it has read the last ``%`` (DC3, with DC codes)."""
    drip_held_timeout_s: float = 3600.0
    """For so long the control may hold a drip feed: a block under way may take long, and so may a feed hold."""
    block_timeout_s: float = 10.0
    """How long a block of XMODEM, or its acknowledgement, may take before it is asked for, or sent, again …"""
    most_blocks_repeated: int = 10
    """… and how often one is."""
    max_bytes: int = 64 * 1024 * 1024
    """Of a file, both ways: a larger one is refused, or ends while it comes."""
    most_unsent_bytes: int = 16
    """So much may wait to leave while the control can say stop (Xon/Xoff, DC codes): all of it goes after an Xoff."""

    # Data collection
    answer_timeout_s: float = 2.0
    """How long the answer to a question may take, beside what its bytes take."""
    gap_s: float = 0.05
    """After an answer nothing is asked for so long: a control that is polled without pause has frozen."""
    cycle_s: float = 1.0
    """What is watched is read no more often than that; at least 1 s."""
    back_off_after: int = 2
    """After so many questions in a row without an answer the pause between questions grows …"""
    back_off_first_s: float = 2.0
    """… from this, twice as long each time …"""
    back_off_slowest_s: float = 60.0
    """… up to this."""
    writable: tuple[range, ...] = ()
    """
    Variables that :meth:`Control.write_variable` may write, ``(range(500, 600), range(10_200, 10_300))``; none by
    default. Leave out those that probes and macros of the vendor keep their calibration in.
    """
    largest_value: float = 999_999.0
    """No value beyond that is written, above and below 0."""

    # The line
    quiet_s: float = 0.25
    """With nothing coming for so long the line is in step: nothing is sent to find that out."""
    resync_attempts: int = 5
    """So often such a pause is tried."""
    baud_rate: int | None = None
    """Of the line; None: what the URL or the profile says, which behind a terminal server may not be so."""
    in_doubt_after_s: float = 30.0
    """How long a lost line is waited for by what asks."""
    reconnect: bool = True
    """Open a line that was lost again. A file is never resumed."""
    reconnect_first_s: float = 0.5
    """When a lost line is tried first, at most; later ever more rarely."""
    reconnect_slowest_s: float = 30.0
    """Longest pause between two attempts."""
    reconnect_attempts: int | None = None
    """How often a lost line is tried; None: until it is back."""

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if value is None and name in _MAY_BE_NONE:
                continue
            if name.endswith("_s"):
                check_time(name, value)
            elif name in _COUNTS:
                check_whole(name, value, 1, 1_000_000)
            elif name in _SIZES:
                check_whole(name, value, 1, 1 << 40)
        if self.baud_rate is not None:
            check_whole("baud_rate", self.baud_rate, 1, 12_000_000)
        self._refuse_haste()
        self._check_writable()

    def _refuse_haste(self) -> None:
        hint = "a VF2YT and an HS7R that were polled without pause have frozen, so that only RESET helped"
        if self.cycle_s < _LEAST_CYCLE_S:
            raise InvalidCommandError(f"cycle_s is {_LEAST_CYCLE_S:g} s at least, not {self.cycle_s:g}", hint=hint)
        if self.gap_s < _LEAST_GAP_S:
            raise InvalidCommandError(f"gap_s is {_LEAST_GAP_S:g} s at least, not {self.gap_s:g}", hint=hint)

    def _check_writable(self) -> None:
        for each in self.writable if isinstance(self.writable, tuple) else (self.writable,):
            if not (isinstance(each, range) and each.step == 1 and 1 <= each.start < each.stop <= _MOST_VARIABLE + 1):
                raise InvalidCommandError(
                    f"writable has ranges of variables from 1 to {_MOST_VARIABLE}, not {shown(each)}",
                    hint="give for instance (range(500, 600),): 500 to 599",
                )
        value = self.largest_value
        if isinstance(value, bool) or not isinstance(value, int | float) or not (isfinite(value) and value > 0):
            raise InvalidCommandError(f"largest_value is a number above 0, not {shown(value)}")

    def may_write(self, variable: int) -> bool:
        """Whether that variable is among the writable ones."""
        return any(variable in each for each in self.writable)
