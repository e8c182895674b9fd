"""The settings of an axis as far as this end knows them: on a party line they cannot be read back (panther)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from types import MappingProxyType
from typing import Any, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .setting_lines import SettingValue

__all__ = ["SETTING_LETTERS", "AxisSettings", "SettingsCopy"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSettings:
    """
    What an axis is set to, as far as is known; None where it is not.

    Known is what was written from here and taken, or what the axis has shown: never a default.
    """

    initial_speed_steps_s: int | None = None
    slew_speed_steps_s: int | None = None
    acceleration_slope: int | None = None
    deceleration_slope: int | None = None
    hold_current_percent: int | None = None
    run_current_percent: int | None = None
    resolution: int | None = None
    variable_resolution: bool | None = None
    settling_delay: int | None = None
    limit_active_high: bool | None = None


_NAMES: Final = tuple(each.name for each in fields(AxisSettings))

SETTING_LETTERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "I": ("initial_speed_steps_s",),
        "V": ("slew_speed_steps_s",),
        "K": ("acceleration_slope", "deceleration_slope"),
        "Y": ("hold_current_percent", "run_current_percent"),
        "D": ("resolution",),
        "H": ("variable_resolution",),
        "E": ("settling_delay",),
        "l": ("limit_active_high",),
    }
)
"""What a command sets, by field of ``AxisSettings``, in the order of its arguments."""


class SettingsCopy:
    """
    What is known of the settings of one axis, and of what it would have after a reset.

    It forgets rather than guesses: whatever may have changed a setting makes it unknown until it is written again.
    """

    def __init__(self) -> None:
        self._now: dict[str, SettingValue] = {}
        self._stored: dict[str, SettingValue] = {}

    def get(self, name: str) -> SettingValue | None:
        """Return the value of one field of ``AxisSettings``, or None if it is not known."""
        return self._now.get(_checked(name))

    @property
    def settings(self) -> AxisSettings:
        """What the axis has now, as far as is known."""
        return _settings_of(self._now)

    @property
    def stored_settings(self) -> AxisSettings:
        """What it will have after a reset, as far as is known."""
        return _settings_of(self._stored)

    def note_written(self, name: str, value: SettingValue) -> None:
        """Note that the axis has been told *value*, and has acknowledged it."""
        self._now[_checked(name)] = value

    def note_shown(self, settings: AxisSettings) -> None:
        """Note what the axis has shown; what it has not shown stays as it was."""
        self._now.update({name: value for name, value in asdict(settings).items() if value is not None})

    def note_in_doubt(self, name: str) -> None:
        """Note that the axis was sent a value, and nobody knows whether it has taken it."""
        self._now.pop(_checked(name), None)

    def note_raw(self, text: str) -> None:
        """
        Note a command of the caller's own words: whatever it may set is not known any more.

        A command of which nothing is known may set anything, in the memory as well.
        """
        letter = text.strip(" ")[:1]
        if letter in SETTING_LETTERS:
            for name in SETTING_LETTERS[letter]:
                self.note_in_doubt(name)
        elif letter == _STORE:
            self.note_store_in_doubt()
        elif letter == _GO:
            self.note_program_ran()
        elif letter not in _HARMLESS:
            self.forget()

    def note_program_ran(self, instructions: Iterable[str] | None = None) -> None:
        """
        Note that a program has run, or may have: what it sets is not known any more.

        Args:
            instructions: Of that program; None where they are not known, and it may have set anything.
        """
        if instructions is None:
            self._now.clear()
            return
        for text in instructions:
            self.note_raw(text)

    def note_stored(self) -> None:
        """Note that the axis has stored its settings (``S``, DCB p. 23), those that are not known here among them."""
        self._stored = dict(self._now)

    def note_store_in_doubt(self) -> None:
        """Note that nobody knows whether it has: what would be the same either way stays known."""
        self._stored = {name: value for name, value in self._stored.items() if self._now.get(name) == value}

    def note_reset(self) -> None:
        """Note that the axis has reset: it has what is stored again (AMS p. 25), as far as it was stored from here."""
        self._now = dict(self._stored)

    def forget(self) -> None:
        """Note that this may be another axis, or was in other hands: nothing is known."""
        self._now.clear()
        self._stored.clear()


_STORE: Final = "S"
_GO: Final = "G"
_HARMLESS: Final = frozenset("+-RMF@^Z]OAPQJWX")
"""Commands that set nothing of it."""


def _settings_of(values: Mapping[str, Any]) -> AxisSettings:
    return AxisSettings(**values)


def _checked(name: str) -> str:
    if name not in _NAMES:
        raise InvalidCommandError(
            f"there is no setting {shown(name)} of an axis", hint=f"there are {', '.join(_NAMES)}"
        )
    return name
