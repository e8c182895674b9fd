"""Move servo axes over a serial line or TCP and await the position reached."""

from .compax.axis import Axis
from .compax.codecs import DriveStatus
from .compax.connecting import connect
from .compax.drive import Drive
from .compax.group import DriveGroup, GroupMove
from .compax.moves import Move, MoveResult, PreparedMove
from .compax.protocol import MessageForm
from .compax.settings import AxisUnit, Dialect, DriveSettings
from .compax.vocabulary import Comparator, SpeedStep
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
