"""A simulated Haas control: bytes and time in, bytes out, with its keys, its memory and its display."""

from .control import SimulatedControl
from .knobs import Knobs
from .log import LogEntry, LogKind
from .memory import Memory
from .surroundings import RaisedAlarm

__all__ = ["Knobs", "LogEntry", "LogKind", "Memory", "RaisedAlarm", "SimulatedControl"]
