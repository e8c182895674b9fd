"""A pseudo-terminal as the line of a simulated device, for programs that open serial ports."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty

from .line import DeviceLine

__all__ = ["PseudoTerminal"]

_PIECE_BYTES = 4096


class PseudoTerminal:
    """
    A raw pty whose device end is a simulated device.

    It stays when a program closes it, and the next one that opens it finds the device as it was left. A pty does not
    tell whether it is open, so the device takes it for connected all the time; bytes that find its buffer full are
    lost.
    """

    def __init__(self, line: DeviceLine) -> None:
        self._line = line
        self._loop = asyncio.get_running_loop()
        # The port's own end is kept open, or reading would fail while no program has it open.
        self._device_end, self._port_end = os.openpty()
        try:
            tty.setraw(self._port_end)
            os.set_blocking(self._device_end, False)
            self.path = os.ttyname(self._port_end)
            line.connect(self._send)
        except BaseException:
            self._close_both()
            raise
        self._loop.add_reader(self._device_end, self._receive)

    def close(self) -> None:
        """Take the port away; a program that has it open finds it hung up."""
        self._loop.remove_reader(self._device_end)
        self._line.disconnect()
        self._close_both()

    def _receive(self) -> None:
        self._line.receive(os.read(self._device_end, _PIECE_BYTES))

    def _send(self, data: bytes) -> None:
        # If nobody reads and the buffer is full, bytes are lost, as on a serial line without handshake.
        with contextlib.suppress(BlockingIOError):
            os.write(self._device_end, data)

    def _close_both(self) -> None:
        os.close(self._device_end)
        os.close(self._port_end)
