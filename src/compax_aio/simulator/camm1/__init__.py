"""A simulated Roland CAMM-1 cutter: bytes and time in, bytes out, and what it cut."""

from .cutter import SimulatedCutter
from .cuttings import Cuttings, Mark, Vector
from .knobs import Knobs
from .log import LogEntry, LogKind

__all__ = ["Cuttings", "Knobs", "LogEntry", "LogKind", "Mark", "SimulatedCutter", "Vector"]
