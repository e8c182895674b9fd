"""The simulated COMPAX servo drive: bytes and time in, bytes out, and a log of what it did."""

from .drive import SimulatedDrive
from .knobs import Knobs
from .log import LogEntry, LogKind

__all__ = ["Knobs", "LogEntry", "LogKind", "SimulatedDrive"]
