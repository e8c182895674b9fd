"""Alarms that the port of a control raises; numbers and texts stand in ``alarms.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from types import MappingProxyType
from typing import Final

from ...certainty import Certainty
from .sources import certainty_of

__all__ = ["ALARMS", "Alarm", "alarm_numbered"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One alarm; its text is seen on the screen of the control alone, nothing of it goes over the line."""

    name: str
    """By which programs know it: ``parity-error``."""
    number: int | None = None
    """None where it is not known; the numbers that are known are second-hand."""
    heard_as: int | None = None
    """The number that is often told, where no source confirms it."""
    text: str
    meaning: str
    remedy: str
    confirmed: bool
    """A page of Haas says that it exists."""
    stops: bool = False
    """The receive operation ends there."""
    source: str

    @property
    def certainty(self) -> Certainty:
        """How well it is founded that it exists."""
        return certainty_of(self.source)

    def __str__(self) -> str:
        """Write ``alarm 404 (RS-232 NO PROG NAME)``, ``alarm PARITY ERROR (number not known, often told as 416)``."""
        if self.number is not None:
            return f"alarm {self.number} ({self.text})"
        often = f", often told as {self.heard_as}" if self.heard_as is not None else ""
        return f"alarm {self.text} (number not known{often})"


def _read() -> Mapping[str, Alarm]:
    rows = tomllib.loads(files(__package__).joinpath("alarms.toml").read_text(encoding="utf-8"))["alarm"]
    return MappingProxyType({row["name"]: Alarm(**row) for row in rows})


ALARMS: Final = _read()
"""By name, in the order of their numbers."""


def alarm_numbered(number: int) -> Alarm | None:
    """Return the alarm with that number, or None: 416 to 419 are not confirmed and give none."""
    return next((each for each in ALARMS.values() if each.number == number), None)
