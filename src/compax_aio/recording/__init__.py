"""Recordings: wire traces of conversations, and motion records of axes."""

from .trace_entries import TraceEntry
from .trace_reading import Conversation, conversations, read_trace
from .trace_writing import TraceRecorder, record_trace

__all__ = ["Conversation", "TraceEntry", "TraceRecorder", "conversations", "read_trace", "record_trace"]
