"""XMODEM as a Haas control speaks it, sans-IO: blocks of 128 bytes, each with a sum, each acknowledged."""

from .failures import Failure, FailureKind
from .receiver import ReceiverTimes, XmodemReceiver
from .sender import SenderTimes, XmodemSender

__all__ = ["Failure", "FailureKind", "ReceiverTimes", "SenderTimes", "XmodemReceiver", "XmodemSender"]
