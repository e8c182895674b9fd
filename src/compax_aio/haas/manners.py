"""How a transfer is wanted, as callers say it by keyword: checked at once, before anybody goes to the control."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict

from ..checked_numbers import check_number
from ..errors import InvalidCommandError
from ..escaping import shown

__all__ = ["HowToReceive", "HowToSend", "Manner", "OnOperator", "ReceivingManner", "check_flag"]

OnOperator = Callable[[str], object]
"""Called with what has to be done at the control; what it returns is awaited, if it can be."""


class HowToSend(TypedDict, total=False):
    """
    Keywords of all that sends.

    Attributes:
        verify: Have the control send it back, and compare: the operator presses SEND then.
        on_operator: Called with what has to be done at the control; what it returns is awaited, if it can be.
        operator_timeout_s: How long the operator may take; as the settings have it, if not given.
        silence_timeout_s: How long the control may hold the line; as the settings have it, if not given.
    """

    verify: bool
    on_operator: OnOperator | None
    operator_timeout_s: float | None
    silence_timeout_s: float | None


class HowToReceive(HowToSend, total=False):
    """
    Keywords of all that receives; *verify* receives it twice.

    Attributes:
        archive: Keeps what comes, as it comes: a file, which has ``.incomplete`` at its end until it is whole; or a
            folder, in which it gets a name by what it is and the time.
        accept_damaged: Take it although it is known to be damaged, or lacks its last ``%``.
    """

    archive: os.PathLike[str] | str | None
    accept_damaged: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Manner:
    """How a transfer is wanted; see :class:`HowToSend`. Raises InvalidCommandError if something means nothing."""

    verify: bool = False
    on_operator: OnOperator | None = None
    operator_timeout_s: float | None = None
    silence_timeout_s: float | None = None

    def __post_init__(self) -> None:
        check_flag("verify", self.verify)
        for name in ("operator_timeout_s", "silence_timeout_s"):
            value = getattr(self, name)
            if value is not None and not check_number(name, value) > 0:
                raise InvalidCommandError(f"{name} is a time above 0 in seconds, not {shown(value)}")
        if self.on_operator is not None and not callable(self.on_operator):
            raise InvalidCommandError(f"on_operator is called with a text, and {shown(self.on_operator)} cannot be")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivingManner(Manner):
    """How a file is to be received; see :class:`HowToReceive`."""

    archive: os.PathLike[str] | str | None = None
    accept_damaged: bool = False

    def __post_init__(self) -> None:
        super(ReceivingManner, self).__post_init__()  # slots make another class of it
        check_flag("accept_damaged", self.accept_damaged)


def check_flag(name: str, value: object) -> bool:
    """
    Return *value*, which is True or False.

    Raises:
        InvalidCommandError: It is neither; *name* names it.
    """
    if type(value) is not bool:
        raise InvalidCommandError(f"{name} is True or False, not {shown(value)}")
    return value
