"""What a probe has found out of a drive: each finding with how well it is founded, and the settings that follow."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from .codecs import SerialInterface
from .settings import DriveSettings

__all__ = ["Attempt", "ErrorStyle", "Finding", "Founded", "ProbeReport"]


class Founded(Enum):
    """How well a finding is founded."""

    SEEN = "seen on the line"
    READ = "the drive says so"
    INFERRED = "inferred from what was seen or read"
    UNKNOWN = "not known"


class ErrorStyle(Enum):
    """What the drive answers to a line that it refuses; the page on it was not available (UG p. 161)."""

    CODE = "its code alone"
    CODE_AND_TEXT = "its code, with text"
    OTHER_TEXT = "a text in which no code was found"
    PROMPT_ONLY = "a bare prompt"
    SILENT = "nothing at all"
    UNKNOWN = "not known: it refused nothing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that was asked about a drive."""

    topic: str
    found: str
    """What was found, in a few words; for people."""
    founded: Founded
    evidence: str
    """What was sent and what came, or why nothing can be said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One way of talking that was tried."""

    url: str
    baudrate: int | None
    """None where the rate is not ours to choose."""
    answers: bool
    """Whether a COMPAX answered."""
    told: str
    """What came instead, for people."""
    received: str | None
    """As it came, readable; None if nothing did."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbeReport:
    """All that a probe has found out; nothing in it was moved, written or switched."""

    url: str
    """That reaches the drive, with what was found put in."""
    attempts: tuple[Attempt, ...]
    findings: tuple[Finding, ...]
    baudrate: int | None
    """At which it answered; None where a server or a simulation sees to that."""
    echo: bool | None
    """Whether it sends back every line; None where it did so now and then."""
    error_style: ErrorStyle
    interface: SerialInterface | None
    """P20; None where the drive does not give it."""
    cts: bool | None
    """Whether CTS is on at the port; None where nobody can say."""
    identification: dict[int, str]
    """S31 to S39 as the drive sent them; those that it refused are left out."""
    settings: DriveSettings
    """The ones that were given, changed only in what was found."""
    changed: dict[str, str] = field(default_factory=dict)
    """By name of a setting that was changed, why."""
    sent: tuple[str, ...] = ()
    """Every line that was asked of the drive, in order, but for what brings a line in step."""
