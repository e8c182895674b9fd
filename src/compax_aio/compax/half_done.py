"""What of a row of changes a drive has, while they are written one by one; told however that ends."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ..errors import CommandRejectedError, InvalidCommandError, RestoreIncompleteError
from ..escaping import escaped

__all__ = ["HalfDone", "RollBack"]

_log = logging.getLogger("compax_aio.compax")


class HalfDone:
    """
    Keeps account of changes that are written in order.

    Args:
        changes: By number, what the drive had and what it is to have.
        name: Names a number, for people.
    """

    def __init__(self, changes: Mapping[int, tuple[Any, Any]], name: Callable[[int], str]) -> None:
        self.changes = changes
        self.applied: dict[int, tuple[Any, Any]] = {}
        self._name = name
        self._under_way: int | None = None
        self._was_sent = False

    def begin(self, number: int) -> None:
        """Take note that *number* is next; it is not sent yet."""
        self._under_way, self._was_sent = number, False

    def note_sent(self) -> None:
        """Take note that it is on the wire."""
        self._was_sent = True

    def note_failure(self, error: BaseException, query: str) -> None:
        """Take note of what came of it: a refusal of anything but *query*, which reads it back, is certain."""
        if isinstance(error, CommandRejectedError) and error.sent != query:
            self._was_sent = False

    def note_applied(self) -> None:
        """Take note that it was read back as it was written."""
        if self._under_way is not None:
            self.applied[self._under_way] = self.changes[self._under_way]
            self._under_way, self._was_sent = None, False

    @property
    def uncertain(self) -> dict[int, tuple[Any, Any]]:
        """What was sent, and may have been taken or not."""
        number = self._under_way
        return {number: self.changes[number]} if number is not None and self._was_sent else {}

    @property
    def not_applied(self) -> tuple[int, ...]:
        """What the drive still has as before."""
        return tuple(each for each in self.changes if each not in self.applied and each not in self.uncertain)

    @property
    def has_changed(self) -> bool:
        """Whether the drive has something else than before, or may have."""
        return bool(self.applied or self.uncertain)

    @property
    def lists(self) -> str:
        """Name them all."""
        text = f"applied: {self._names(self.applied)}; not applied: {self._names(self.not_applied)}"
        return f"{text}; uncertain: {self._names(self.uncertain)}" if self.uncertain else text

    def report(self, what: str, **more: Any) -> RestoreIncompleteError:
        """Say *what* has happened, and how far it has got."""
        return RestoreIncompleteError(
            f"{what}; {self.lists}",
            applied=self.applied,
            not_applied=self.not_applied,
            uncertain=self.uncertain,
            **more,
        )

    def tell_with(self, error: BaseException, report: RestoreIncompleteError) -> None:
        """Say in *error*, a cancellation or a caller's own, what it has left; it may be swallowed on its way."""
        told = escaped(f"{report.device}: {report.what}")
        error.add_note(told)
        if self.has_changed:
            _log.warning("%s", told)

    def _names(self, numbers: Iterable[int]) -> str:
        return ", ".join(map(self._name, numbers)) or "none"


class RollBack:
    """
    Goes back through what a restore has left, the uncertain first, and says how far it got if it fails.

    Args:
        left: What a restore has left half done.
        kind: Of whom it is asked; *left* must be that of the same, on the same drive.
        device: The drive's name.
        name: Names a number, for people.

    Raises:
        InvalidCommandError: *left* is that of another drive, or of something else on it.
    """

    def __init__(self, left: RestoreIncompleteError, kind: str, device: str, name: Callable[[int], str]) -> None:
        if (left.kind, left.device) != (kind, device):
            raise InvalidCommandError(
                f"that is left of {left.kind or 'nothing that is known'} of {left.device or 'no drive'}, "
                f"not of {kind} of {device}; nothing was written",
                device=device,
                hint="roll back where it was restored or downloaded",
            )
        self.old = {
            number: old for number, (old, _) in (*reversed(left.uncertain.items()), *reversed(left.applied.items()))
        }
        self.done: list[int] = []
        self._name = name

    def __enter__(self) -> RollBack:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is not None:
            left = [number for number in self.old if number not in self.done]
            error.add_note(
                f"rolled back: {', '.join(map(self._name, self.done)) or 'none'}; "
                f"not rolled back, or not surely: {', '.join(map(self._name, left)) or 'none'}"
            )
