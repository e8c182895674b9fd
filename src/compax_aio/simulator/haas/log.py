"""What a simulated control has done, for tests to read: the far end's own testimony."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from ..log import DeviceLog, DeviceLogEntry

__all__ = ["MAX_ENTRIES", "Log", "LogEntry", "LogKind"]

MAX_ENTRIES: Final = 50_000


class LogKind(StrEnum):
    """What a log entry tells of, and how its text is formed."""

    KEY = "key"
    """Somebody is at the machine: ``send O01234``, ``recv programs``, ``dnc``, ``reset``, ``cycle start`` ..."""
    SCREEN = "screen"
    """What the bottom left corner of the display shows now: ``RS232 DONE``, ``RS232 ABORT``."""
    ALARM = "alarm"
    """An alarm, and what it is about: ``404 RS-232 NO PROG NAME: G0 X1``."""
    CODE = "code"
    """A reader or punch code is sent: ``DC1`` to ``DC4``; ``DC2 dropped`` if a knob keeps it from going."""
    FLOW = "flow"
    """``Xoff``, ``Xon``, ``pin 4 low``, ``pin 4 high`` of the control; ``host Xoff``, ``pin 5 low`` ... of the host."""
    BLOCK = "block"
    """A block of XMODEM: ``took 1``, ``sent 1``, ``again 1``, ``refused 2: sum``, ``repeated 1``."""
    STORED = "stored"
    """Something is in memory now: ``O01234``, ``settings: 12 values``."""
    EXECUTED = "executed"
    """A block of DNC begins: its text."""
    REQUEST = "request"
    """A request of data collection, and for how long the line was quiet before it: ``Q100 after 0.05 s``."""
    ANSWER = "answer"
    """An answer begins, without its frame: ``S/N, 1234567``."""
    WRITTEN = "written"
    """A variable was written by a host, and what it was before: ``#100 = 1.5 (was 0)``."""
    PRINTED = "printed"
    """A program prints (DPRNT): the text."""
    FROZEN = "frozen"
    """The control has frozen, and why; or ``over``."""
    LOST = "lost"
    """Bytes came that nobody waited for, or that found the buffer full; how many so far."""
    POWER = "power"
    """``off`` or ``on``."""
    TROUBLE = "trouble"
    """Trouble was made: ``answer S/N, 1234567 lost``, ``Xon lost`` ..."""
    CONNECTED = "connected"
    """Somebody is on the line."""
    DISCONNECTED = "disconnected"
    """Nobody is on the line any more."""


class LogEntry(DeviceLogEntry[LogKind]):
    """One thing that a control did."""

    __slots__ = ()


class Log(DeviceLog[LogEntry, LogKind]):
    """The last things that happened; old ones fall off at the end."""

    def __init__(self, entries: int = MAX_ENTRIES) -> None:
        super().__init__(LogEntry, entries)
