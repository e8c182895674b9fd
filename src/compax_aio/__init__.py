"""Move servo axes over a serial line or TCP and await the position reached."""

from .compax.drive import Drive, connect
from .compax.group import DriveGroup, GroupMove
from .compax.moves import Move, MoveResult
from .compax.settings import DriveSettings
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
    TransportError,
    UnexpectedAnswerError,
)

__all__ = [
    "AnswerTimeoutError",
    "CommandRejectedError",
    "CompaxError",
    "ConnectionLostError",
    "Drive",
    "DriveFaultError",
    "DriveGroup",
    "DriveSettings",
    "GroupMove",
    "InvalidCommandError",
    "LinkProtocolError",
    "Move",
    "MoveActiveError",
    "MoveError",
    "MoveInDoubtError",
    "MoveResult",
    "MoveStoppedError",
    "MoveTimeoutError",
    "TransportError",
    "UnexpectedAnswerError",
    "connect",
]
