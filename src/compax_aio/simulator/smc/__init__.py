"""Simulated AMS SMC steppers on one serial line: bytes and time in, bytes out, and a log of what they did."""

from .axis import SimulatedAxis
from .knobs import Knobs
from .line import SimulatedPartyLine
from .log import Ending, LogEntry, LogKind

__all__ = ["Ending", "Knobs", "LogEntry", "LogKind", "SimulatedAxis", "SimulatedPartyLine"]
