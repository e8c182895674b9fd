"""Asking a drive for several things, of which it may refuse some: what it refuses is told, and ends nothing."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import TypeVar

from ..errors import CommandRejectedError, CompaxError, UnexpectedAnswerError

__all__ = ["Asking"]

_Value = TypeVar("_Value")


class Asking:
    """
    Asks one thing after the other.

    Attributes:
        refused: By name of what was asked, how the drive refused it or what it answered instead.
    """

    def __init__(self) -> None:
        self.refused: dict[str, str] = {}

    async def ask(self, name: str, answer: Awaitable[_Value]) -> _Value | None:
        """Return what is asked; None if the drive refuses it. Time-outs and lost lines are raised."""
        try:
            return await answer
        except (CommandRejectedError, UnexpectedAnswerError) as error:
            self.note(name, error)
            return None

    def note(self, name: str, error: CompaxError) -> None:
        """Take note of something that the drive did not say."""
        received = f": {error.received!r}" if error.received is not None else ""
        self.refused[name] = f"{error.what}{received}"
