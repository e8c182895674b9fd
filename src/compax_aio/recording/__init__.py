"""Recordings: wire traces of conversations, and motion records of axes."""

from .motion_reading import MotionRecord, read_record
from .motion_record import MotionRecording, record
from .trace_entries import TraceEntry
from .trace_reading import Conversation, conversations, read_trace
from .trace_writing import TraceRecorder, record_trace

__all__ = [
    "Conversation",
    "MotionRecord",
    "MotionRecording",
    "TraceEntry",
    "TraceRecorder",
    "conversations",
    "read_record",
    "read_trace",
    "record",
    "record_trace",
]
