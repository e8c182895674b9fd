"""A POSIX serial line as an asyncio transport: pyserial-asyncio's, made safe under flow control and unplugging."""

from __future__ import annotations

import asyncio
import fcntl
import os
import sys
import termios
import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import serial_asyncio

from compax_aio.errors import ConnectionLostError

from .serial_backends import Port

__all__ = ["SerialLine", "unsent_bytes"]

_READ_BYTES = 64 * 1024

# What close() gives the far end to take the unsent bytes, and how often it looks whether the driver has sent them.
_FLUSH_S = 0.5
_LOOK_S = 0.01

# What the driver gets to release the port before connection_lost is called without it.
_RELEASE_S = 0.4


class SerialLine(serial_asyncio.SerialTransport):  # type: ignore[misc]  # it has no type hints
    """
    An open serial port of a POSIX system.

    From pyserial-asyncio come the bookkeeping of readers, writers and water marks. Ours is everything that touches
    the port, because there ``tcdrain``, closing and pyserial's own ``write`` wait for a far end that may hold the line
    by Xoff or CTS for ever: here bytes go through ``os.read`` and ``os.write``, what is left at the end is discarded,
    and the port is released in a thread. ``connection_lost`` is called once, at most half a second after
    :meth:`abort` and a second after :meth:`close`.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, protocol: asyncio.Protocol, port: Port, name: str) -> None:
        # Not the base's __init__: it sets the port up again, on the loop, and schedules connection_made for later.
        asyncio.Transport.__init__(self, {"serial": port})
        self._loop = loop
        self._protocol = protocol
        self._serial = port
        self._name = name
        self._fd: int = port.fileno()
        self._closing = False
        self._releasing = False
        self._lost = False
        self._reading_paused = False
        self._protocol_paused = False
        self._has_reader = False
        self._has_writer = False
        self._write_buffer = bytearray()
        self._timer: asyncio.TimerHandle | None = None
        self._set_write_buffer_limits()

    def connect(self) -> None:
        """Tell the protocol that the line is open, and begin to read; once."""
        try:
            self._protocol.connection_made(self)
        except BaseException:
            self.abort()
            raise
        self._ensure_reader()

    def __repr__(self) -> str:
        state = "closed" if self._lost else "closing" if self._closing else "open"
        return f"<SerialLine {self._name} {state}>"

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return what the port was opened by (``serial.Serial`` or ``serialx.Serial``) for the name ``serial``."""
        return self._extra.get(name, default)

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Connect another protocol to the line."""
        assert isinstance(protocol, asyncio.Protocol), "a line needs a protocol that takes bytes"
        self._protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the protocol that is connected to the line."""
        return self._protocol

    # --- reading

    def is_reading(self) -> bool:
        """Return whether what arrives is handed to the protocol."""
        return not (self._closing or self._reading_paused)

    def pause_reading(self) -> None:
        """Leave what arrives with the system until :meth:`resume_reading`."""
        self._reading_paused = True
        self._remove_reader()

    def resume_reading(self) -> None:
        """Hand what arrives to the protocol again."""
        self._reading_paused = False
        self._ensure_reader()

    def _ensure_reader(self) -> None:
        if not self._reading_paused:
            super()._ensure_reader()

    def _read_ready(self) -> None:
        try:
            data = os.read(self._fd, _READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as exc:
            self._went_away(exc)
            return
        if not data:
            self._went_away(None)
            return
        try:
            self._protocol.data_received(data)
        except Exception as exc:  # as asyncio does: what the protocol has understood so far is not known any more
            self._fatal_error(exc, "protocol.data_received() failed")

    # --- writing

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send *data* now as far as the port takes it, and the rest as soon as it does."""
        if self._closing or not data:
            return
        taken = 0
        if not self._write_buffer:
            try:
                taken = os.write(self._fd, data)
            except (BlockingIOError, InterruptedError):
                pass
            except OSError as exc:
                self._went_away(exc)
                return
            if taken == len(data):
                return
            self._ensure_writer()
        self._write_buffer += memoryview(data)[taken:]
        self._maybe_pause_protocol()

    def writelines(self, list_of_data: Iterable[bytes | bytearray | memoryview]) -> None:
        """Send the pieces as one."""
        self.write(b"".join(list_of_data))

    def get_write_buffer_size(self) -> int:
        """Return how many bytes the port has not taken yet."""
        return len(self._write_buffer)

    def get_write_buffer_limits(self) -> tuple[int, int]:
        """Return the water marks, low and high."""
        return self._low_water, self._high_water

    def _write_ready(self) -> None:
        try:
            del self._write_buffer[: os.write(self._fd, self._write_buffer)]
        except (BlockingIOError, InterruptedError):
            return
        except OSError as exc:
            self._went_away(exc)
            return
        if not self._write_buffer:
            self._remove_writer()
        self._maybe_resume_protocol()  # may write, close or abort

    # --- the end

    def close(self) -> None:
        """Send what is unsent, for half a second at most, then release the port."""
        if not self._closing:
            self._closing = True
            self._remove_reader()
            self._release_when_sent(self._loop.time() + _FLUSH_S)

    def abort(self) -> None:
        """Discard what is unsent and release the port."""
        self._abort(None)

    def _abort(self, exc: Exception | None) -> None:
        self._release(exc, discard=True)

    def _went_away(self, cause: OSError | None) -> None:
        lost = ConnectionLostError(
            f"the serial port {self._name} went away" + (f": {cause.strerror}" if cause else ""),
            hint="was its adapter unplugged?",
        )
        lost.__cause__ = cause
        self._abort(lost)

    def _release_when_sent(self, deadline: float) -> None:
        try:
            unsent = len(self._write_buffer) or unsent_bytes(self._fd)
        except OSError as exc:
            self._went_away(exc)
            return
        if unsent and self._loop.time() < deadline:
            self._timer = self._loop.call_later(_LOOK_S, self._release_when_sent, deadline)
        else:
            self._release(None, discard=bool(unsent))

    def _release(self, exc: Exception | None, *, discard: bool) -> None:
        if self._releasing:
            return
        self._closing = self._releasing = True
        if self._timer is not None:
            self._timer.cancel()
        self._remove_reader()
        self._remove_writer()
        self._write_buffer.clear()
        self._timer = self._loop.call_later(_RELEASE_S, self._call_connection_lost, exc)
        try:
            released = self._loop.run_in_executor(None, _release_port, self._serial, discard)
        except RuntimeError:  # the loop takes no more work, because it is about to end
            threading.Thread(target=_release_port, args=(self._serial, discard), daemon=True).start()
        else:
            released.add_done_callback(lambda _: self._call_connection_lost(exc))

    def _call_connection_lost(self, exc: Exception | None) -> None:
        if not self._lost:
            self._lost = True
            if self._timer is not None:
                self._timer.cancel()
            self._protocol.connection_lost(exc)


def unsent_bytes(descriptor: int) -> int:
    """Return how many bytes the driver has not sent yet; OSError if the port went away."""
    return int.from_bytes(fcntl.ioctl(descriptor, termios.TIOCOUTQ, bytes(4)), sys.byteorder)


def _release_port(port: Port, discard: bool) -> None:
    # Closing waits until the driver has sent everything, which is never while the far end holds the line.
    if discard:
        with suppress(termios.error):
            termios.tcflush(port.fileno(), termios.TCOFLUSH)
    with suppress(OSError):
        port.close()
