"""What is asked before something is done, the help, and what is seen while the monitor is being left."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Static

from .words import LampLight

__all__ = ["Help", "Leaving", "Question"]

_KEYS = (
    ("space", "STOP ALL axes, whatever is on the screen; and motion is switched off"),
    ("s", "stop the axis that is chosen"),
    ("↑ ↓  j k", "choose an axis"),
    ("m", "let this keyboard move axes, and no more"),
    ("← →", "jog by a step while motion is on; shift: ten steps"),
    ("+ -", "a larger, or smaller, step"),
    ("h", "find machine zero, while motion is on; asks first"),
    ("a", "acknowledge the error (QUIT)"),
    ("r", "reconcile a drive in doubt; asks first"),
    ("c", "try a line again that could not be opened"),
    ("PgUp PgDn", "scroll the log"),
    ("q", "leave: stops what was started here"),
    ("ctrl+c", "the same, without asking"),
)


class _Dialog(ModalScreen[bool]):
    """A box in the middle of the screen."""

    DEFAULT_CSS: ClassVar[str] = """
    _Dialog { align: center middle; background: #000000 60%; }
    _Dialog > Vertical {
        width: 74; max-width: 96%; height: auto; max-height: 100%;
        background: #222c39; border: round #8a97a5; padding: 0 2; border-title-color: #f2f6fa;
    }
    _Dialog Static { width: 100%; height: auto; color: #dbe4ee; }
    """

    def __init__(self, title: str, text: Text | str) -> None:
        super().__init__()
        self._head = title
        self._text = text

    def compose(self) -> ComposeResult:
        """Lay out the text."""
        with Vertical() as box:
            box.border_title = self._head
            box.can_focus = False
            yield Static(self._text, markup=False)


class Question(_Dialog):
    """Asks; True is returned only for the key ``y``."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "answer(True)"),
        ("n", "answer(False)"),
        ("escape", "answer(False)"),
        ("q", "answer(False)"),
    ]

    def __init__(self, title: str, text: str) -> None:
        keys = Text.assemble(("y", "bold"), " yes     ", ("n", "bold"), " no     ", ("space", "bold"), " STOP ALL")
        super().__init__(title, Text.assemble("\n", text, "\n\n", keys, "\n"))

    def action_answer(self, answer: bool) -> None:
        """Take the answer."""
        self.dismiss(answer)


class Help(_Dialog):
    """Says what the keys do, and what the lamps mean."""

    BINDINGS: ClassVar[list[BindingType]] = [(key, "leave") for key in ("escape", "enter", "q", "question_mark", "h")]

    def __init__(self) -> None:
        text = Text()
        for key, meaning in _KEYS:
            text.append(f"{key:>10}", "bold").append(f"  {meaning}\n")
        text.append(
            f"{LampLight.LIT.value} lit  {LampLight.DARK.value} dark  {LampLight.WARNING.value} look at it  "
            f"{LampLight.UNKNOWN.value} not known.  "
        )
        text.append("Grey values are old; their age stands beside them. ")
        text.append("A stop from software is no emergency stop.", "bold")
        super().__init__("keys (q closes)", text)

    def action_leave(self) -> None:
        """Close it."""
        self.dismiss(False)


class Leaving(_Dialog):
    """Says what is waited for; it closes with the monitor."""

    def __init__(self, moving: str) -> None:
        what = f"Stopping {moving}, and waiting until it stands" if moving else "Closing the lines"
        super().__init__("leaving", f"\n{what} …\n\nUse the emergency stop if an axis goes on.\n")
