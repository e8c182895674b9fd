"""
What the axes at the far end have really said and done, and what cannot be known by anybody at this end.

The exclusions are all here (:data:`EXCUSES`), each with its reason; whenever one is used it is counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Final

from compax_aio.simulator.smc.log import LogEntry, LogKind

from ..hunt.testimony import WireKind
from .spoken import Spoken
from .testimony import WHOLE_LINE, AxisCall, SeenLine

__all__ = ["EXCUSES", "MOTIONS", "AxisEvidence", "Case", "Said"]

MOTIONS: Final = "R+-MFG"
"""Letters of commands that move."""

EXCUSES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "answer forged": (
            "bytes to the host were changed, lost or put between while the answer came, and a number became another "
            "one: there is no checksum, and no echo in this direction"
        ),
        "command forged": (
            "bytes in both directions were changed, or another host wrote: the axis has taken what the client never "
            "said, and the echoes hid it"
        ),
        "reset at zero": (
            "the axis was reset in a move to exactly 0, or where it stood at 0: it counts what it should"
        ),
        "reset did not show": (
            "the axis was reset and then moved by somebody else, or read 0 before, or was not read in between: its "
            "position was never 0 where it was not"
        ),
        "changed in that moment": "a jog, a reset or an abort came between the last answer and the telling",
        "names dealt anew": (
            "one controller of a ring was reset alone: without all of them it relays nothing, or has a name twice"
        ),
        "in program entry": (
            "writing a program failed half way, and it was told that the axis may store what it should obey"
        ),
        "unheard neighbours": (
            "an axis that steps reads slower than another one is spoken to, loses characters that are not for it, and "
            "takes what comes next for its name"
        ),
        "unknown motion": "a command that nobody watches, or of which nothing is known, may have moved it to 0",
        "home by standstill": "without a home input a search that was cut short cannot be told from one that found it",
        "program of its own": "a program runs, which goes on as it likes, and may say nothing meanwhile",
    }
)
"""What looks like a broken promise, and cannot be known at this end of the line; by a short name, with the reason."""

_FORGES_TO_HOST: Final = ("lose to_host", "garble to_host", "flip to_host", "double to_host", "noise to_host")
_FORGES_TO_AXIS: Final = ("lose to_drive", "garble to_drive", "flip to_drive", "double to_drive", "another host")


@dataclass(frozen=True, slots=True)
class Said:
    """One answer of an axis."""

    asked_at: float
    """When the axis executed the command."""
    at: float
    """When it began to answer."""
    command: str
    data: str

    @property
    def number(self) -> float | None:
        """The number it is."""
        try:
            return float(self.data)
        except ValueError:
            return None

    @property
    def is_position(self) -> bool:
        """Whether it tells where the axis is."""
        return self.command.startswith("Z")


@dataclass(slots=True)
class AxisEvidence:
    """What one axis has done."""

    letter: str
    commands: list[LogEntry] = field(default_factory=list)
    answers: list[Said] = field(default_factory=list)
    resets: list[float] = field(default_factory=list)
    aborts: list[float] = field(default_factory=list)
    jogs: list[float] = field(default_factory=list)
    programs: list[LogEntry] = field(default_factory=list)
    motions: list[LogEntry] = field(default_factory=list)
    """Beginnings and ends."""
    _last: LogEntry | None = None

    def take(self, entry: LogEntry) -> None:
        """Sort an entry of the log in."""
        match entry.kind:
            case LogKind.COMMAND:
                self.commands.append(entry)
                self._last = entry
            case LogKind.WRITTEN | LogKind.REFUSED:
                self._last = entry
            case LogKind.ANSWER if self._last is not None:
                self.answers.append(Said(self._last.at, entry.at, self._last.text.strip(), entry.text))
            case LogKind.RESET:
                self.resets.append(entry.at)
            case LogKind.ABORT:
                self.aborts.append(entry.at)
            case LogKind.PROGRAM:
                self.programs.append(entry)
            case LogKind.MOTION_STARTED | LogKind.MOTION_ENDED:
                self.motions.append(entry)
                if entry.text == "jog":
                    self.jogs.append(entry.at)

    def commanded(self, since: float, until: float, letters: str = MOTIONS) -> list[LogEntry]:
        """List the commands of these letters that it executed."""
        return [
            entry
            for entry in self.commands
            if since <= entry.at <= until and entry.text.strip() and entry.text.strip()[0] in letters
        ]

    def last_position(self, until: float) -> Said | None:
        """Return the last position it told."""
        return next((said for said in reversed(self.answers) if said.at <= until and said.is_position), None)

    def disturbed(self, since: float, until: float) -> bool:
        """Whether it was jogged, reset or aborted in that time."""
        return any(since <= at <= until for at in (*self.jogs, *self.resets, *self.aborts))

    def runs_program(self, at: float) -> bool:
        """Whether a program ran at that time."""
        begun = [entry for entry in self.programs if entry.at <= at]
        return bool(begun) and begun[-1].text.startswith("started")


class Case:
    """
    All that promises are held against.

    Args:
        testimony: What was seen.
    """

    def __init__(self, testimony: SeenLine) -> None:
        self.testimony = testimony
        self.plan = testimony.scenario.line
        self.settings = testimony.scenario.line.settings
        self.mode = testimony.scenario.line.knobs.mode
        testimony.excused.clear()

    @cached_property
    def axes(self) -> dict[str, AxisEvidence]:
        """The evidence of each axis, by its letter."""
        axes = {letter: AxisEvidence(letter) for letter in self.testimony.far.axes}
        for entry in self.testimony.far.log:
            if entry.axis:
                axes[entry.axis].take(entry)
        return axes

    @cached_property
    def spoken(self) -> Spoken:
        """What the client has said."""
        return Spoken(self.testimony.wire, self.settings, self.mode)

    def calls(self, letter: str, *whats: str) -> list[AxisCall]:
        """List what was asked of an axis, or of all of them."""
        return [
            call
            for call in self.testimony.calls
            if call.axis in {letter, WHOLE_LINE} and (not whats or call.what in whats)
        ]

    def moves(self, letter: str) -> list[AxisCall]:
        """List the motions that were asked for, watched ones and raw ones."""
        return [call for call in self.calls(letter) if call.move is not None or self.raw_motion(call) is not None]

    @staticmethod
    def raw_motion(call: AxisCall) -> str | None:
        """Return the text of a motion that nobody watches, or a change of speed."""
        text = call.detail if call.what in {"raw", "change_speed"} else None
        return text if text and text[0] in MOTIONS else None

    def text_of(self, call: AxisCall) -> str:
        """Return what starts the motion of a call."""
        return call.text or self.raw_motion(call) or ""

    def name(self, letter: str) -> str:
        """Return the name in front of what is said to an axis."""
        return "" if self.mode == "single" else letter

    def excuse(self, why: str) -> bool:
        """Count an excuse; always true."""
        assert why in EXCUSES
        self.testimony.excused[why] += 1
        return True

    def forged_to_host(self, since: float, until: float) -> bool:
        """Whether bytes to the host were changed, lost or put between."""
        return self._befell(_FORGES_TO_HOST, since, until) or self._troubled(("echo", "noise", "stuck"), since, until)

    def forged_to_axis(self, since: float, until: float) -> bool:
        """Whether bytes to the axes were changed, lost or put between."""
        return (
            self._befell(_FORGES_TO_AXIS, since, until)
            or self._troubled(("became", "lost"), since, until)
            or self.overran(since, until)
        )

    def ring_is_broken(self, until: float) -> bool:
        """Whether an axis of a ring was reset alone."""
        return self.mode == "daisy" and (
            any(
                entry.kind is LogKind.RESET and entry.text == "itself" and entry.at <= until
                for entry in self.testimony.far.log
            )
            or self.forged_to_host(0.0, until)
            or self.forged_to_axis(0.0, until)
        )

    def may_be_programming(self, letter: str, at: float) -> bool:
        """Whether it was told that writing a program had failed."""
        return any(
            call.ended_at is not None and call.ended_at <= at and isinstance(call.outcome, BaseException)
            for call in self.calls(letter, "write program", "edit program")
        )

    def overran(self, since: float, until: float) -> bool:
        """Whether an axis has lost characters for want of time."""
        return any(entry.kind is LogKind.OVERRUN and since <= entry.at <= until for entry in self.testimony.far.log)

    def _befell(self, what: tuple[str, ...], since: float, until: float) -> bool:
        return any(
            entry.kind is WireKind.BEFELL and since <= entry.at <= until and entry.text.startswith(what)
            for entry in self.testimony.wire
        )

    def _troubled(self, words: tuple[str, ...], since: float, until: float) -> bool:
        return any(
            entry.kind is LogKind.TROUBLE and since <= entry.at <= until and any(word in entry.text for word in words)
            for entry in self.testimony.far.log
        )
