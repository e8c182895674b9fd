"""
Move servo axes over a serial line or TCP and await the position reached.

What is not an error is imported when it is asked for first. In a program that must not be held up then, take it at its
top: ``from compax_aio import connect``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from .errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    InvalidCommandError,
    LinkProtocolError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
    RestoreIncompleteError,
    TransportError,
    UnexpectedAnswerError,
)

if TYPE_CHECKING:
    from .compax.axis import Axis
    from .compax.codecs import DriveStatus
    from .compax.connecting import connect
    from .compax.drive import Drive
    from .compax.group import DriveGroup, GroupMove
    from .compax.moves import Move, MoveResult, PreparedMove
    from .compax.protocol import MessageForm
    from .compax.settings import AxisUnit, Dialect, DriveSettings
    from .compax.vocabulary import Comparator, SpeedStep

__all__ = [
    "AnswerTimeoutError",
    "Axis",
    "AxisUnit",
    "CommandRejectedError",
    "Comparator",
    "CompaxError",
    "ConnectionLostError",
    "Dialect",
    "Drive",
    "DriveFaultError",
    "DriveGroup",
    "DriveSettings",
    "DriveStatus",
    "GroupMove",
    "InvalidCommandError",
    "LinkProtocolError",
    "MessageForm",
    "Move",
    "MoveActiveError",
    "MoveError",
    "MoveInDoubtError",
    "MoveResult",
    "MoveStoppedError",
    "MoveTimeoutError",
    "PreparedMove",
    "RestoreIncompleteError",
    "SpeedStep",
    "TransportError",
    "UnexpectedAnswerError",
    "connect",
]

_HOMES: Final = {
    "Axis": ".compax.axis",
    "AxisUnit": ".compax.settings",
    "Comparator": ".compax.vocabulary",
    "Dialect": ".compax.settings",
    "Drive": ".compax.drive",
    "DriveGroup": ".compax.group",
    "DriveSettings": ".compax.settings",
    "DriveStatus": ".compax.codecs",
    "GroupMove": ".compax.group",
    "MessageForm": ".compax.protocol",
    "Move": ".compax.moves",
    "MoveResult": ".compax.moves",
    "PreparedMove": ".compax.moves",
    "SpeedStep": ".compax.vocabulary",
    "connect": ".compax.connecting",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(_HOMES[name], __name__), name)
    return found


def __dir__() -> list[str]:
    return __all__
