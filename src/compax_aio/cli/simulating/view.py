"""What the far end sees, live: lines received, answers, motions, faults; for people, or as lines of JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Final

from rich.text import Text

from compax_aio.escaping import escaped
from compax_aio.simulator.camm1 import LogEntry as CutterLogEntry
from compax_aio.simulator.haas import LogEntry as ControlLogEntry

from ..printing import Printing
from .devices import Device, Entry

__all__ = ["SimView"]

_FROM_HOST: Final = ("→", "bold")
_TO_HOST: Final = ("←", "cyan")
_MOTION: Final = ("◆", "green")
_TROUBLE: Final = ("✗", "red")
_LIFE: Final = ("·", "dim")
_BY_HAND: Final = ("☞", "bold")
_LOOKS: Final[Mapping[str, tuple[str, str]]] = {
    "line": _FROM_HOST,
    "command": _FROM_HOST,
    "answer": _TO_HOST,
    "message": _TO_HOST,
    "motion_started": _MOTION,
    "motion_continued": _MOTION,
    "speed_changed": _MOTION,
    "motion_reached": _MOTION,
    "motion_ended": _MOTION,
    "motion_stopped": _MOTION,
    "motion_fault": _TROUBLE,
    "fault": _TROUBLE,
    "lost": _TROUBLE,
    "trouble": _TROUBLE,
    "overrun": _TROUBLE,
    "control": _FROM_HOST,
    "enquiry": _FROM_HOST,
    "handshake": _TO_HOST,
    "instruction": _MOTION,
    "cleared": _TROUBLE,
    "overflow": _TROUBLE,
    "io_error": _TROUBLE,
    "data_error": _TROUBLE,
    "refused": _TROUBLE,
    "befell": _TROUBLE,
    "key": _BY_HAND,
    "screen": _MOTION,
    "alarm": _TROUBLE,
    "code": _TO_HOST,
    "flow": _TO_HOST,
    "block": _MOTION,
    "stored": _MOTION,
    "executed": _MOTION,
    "request": _FROM_HOST,
    "written": _MOTION,
    "printed": _TO_HOST,
    "frozen": _TROUBLE,
}
_WORDLESS: Final = frozenset(
    {"line", "command", "answer", "message", "trouble", "befell", "left_out", "control", "instruction"}
    | {"request", "code", "flow"}
)
"""Their text alone says it all."""
_MANY: Final = frozenset({"control", "answer", "enquiry", "handshake", "instruction"})
"""Of a cutter: it may do hundreds in a second, and people read a few."""
_MANY_OF_CONTROL: Final = frozenset({"block", "executed", "flow", "lost"})
"""Of a Haas control, in the middle of a file."""
_PAUSE_S: Final = 0.25
_CHARACTERS: Final = "received"
"""Of a line of axes: single characters, which the commands show better."""


@dataclass(frozen=True, slots=True)
class _Seen:
    at_s: float
    device: str
    kind: str
    text: str
    axis: str = ""
    position: float | None = None


class SimView:
    """
    Prints what devices do and what befalls them.

    Args:
        printing: For people or programs.
        is_quiet: Nothing but what was asked for.
        began_at: The time from which times are counted.
        on_failure: Called once, when nothing can be printed any more.

    Attributes:
        failure: Why nothing can be printed any more; None: it can.
    """

    def __init__(
        self, printing: Printing, *, is_quiet: bool, began_at: float, on_failure: Callable[[], object] = lambda: None
    ) -> None:
        self._printing = printing
        self._is_quiet = is_quiet
        self._began_at = began_at
        self._on_failure = on_failure
        self._name_width = 0
        self.failure: OSError | None = None
        self._next_at: dict[str, float] = {}
        self._left_out: dict[str, int] = {}

    def watch(self, devices: Mapping[str, Device]) -> None:
        """Print what each device logs from now on."""
        self._name_width = max(map(len, devices)) if len(devices) > 1 else 0
        for name, device in devices.items():
            device.log.on_entry = lambda entry, name=name: self.entry(name, entry)

    def entry(self, name: str, entry: Entry) -> None:
        """Print what a device has logged."""
        kind = entry.kind.value
        if not self._is_quiet and kind != _CHARACTERS and not self._is_one_of_many(name, entry):
            axis, position = getattr(entry, "axis", ""), getattr(entry, "position", None)
            self._show(_Seen(self._time_s(entry.at), name, kind, entry.text, axis, position))

    def _is_one_of_many(self, name: str, entry: Entry) -> bool:
        """Whether to leave out what a machine does, for people, because something was just shown; they are told."""
        many = _MANY if isinstance(entry, CutterLogEntry) else _MANY_OF_CONTROL
        is_able = isinstance(entry, CutterLogEntry | ControlLogEntry)
        if self._printing.json or not is_able or entry.kind.value not in many:
            return False
        if entry.at < self._next_at.get(name, float("-inf")):
            self._left_out[name] = self._left_out.get(name, 0) + 1
            return True
        if count := self._left_out.pop(name, 0):
            self._show(_Seen(self._time_s(entry.at), name, "left_out", f"… {count} more"))
        self._next_at[name] = entry.at + _PAUSE_S
        return False

    def befell(self, name: str, at: float, text: str) -> None:
        """Print what has befallen a device or its line."""
        if not self._is_quiet:
            self._show(_Seen(self._time_s(at), name, "befell", text))

    def _time_s(self, at: float) -> float:
        return round(at - self._began_at, 3)

    def _show(self, seen: _Seen) -> None:
        if self.failure is not None:
            return
        try:
            self._printing.show(
                {key: value for key, value in asdict(seen).items() if value not in {None, ""}}, self._told(seen)
            )
        except OSError as error:  # which is no business of the device that has just done something
            self.failure = error
            self._on_failure()

    def _told(self, seen: _Seen) -> Text:
        mark, style = _LOOKS.get(seen.kind, _LIFE)
        words = [] if seen.kind in _WORDLESS else [seen.kind.replace("_", " ")]
        words += [escaped(seen.text)] if seen.text else []
        words += [] if seen.position is None else [f"at {seen.position:g}"]
        return Text.assemble(
            (f"{seen.at_s:9.3f}  ", "dim"),
            (f"{seen.device:{self._name_width}}  " if self._name_width else ""),
            (f"{mark} ", style),
            (f"{seen.axis}  " if seen.axis else "", "bold"),
            (" ".join(words) or "(empty)", style),
        )
