"""What a port shows of its handshake lines, where anybody can say it."""

from __future__ import annotations

import fcntl
import os
import struct
import termios
from typing import Any

import pytest

from compax_aio.transports.serial_signals import cts_level


class Port:
    """A port of which only the descriptor is asked."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor


@pytest.mark.parametrize(
    ("lines", "cts"), [(termios.TIOCM_CTS, True), (termios.TIOCM_CTS | termios.TIOCM_DSR, True), (0, False)]
)
def test_cts_is_read_from_the_driver(lines: int, cts: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def ioctl(descriptor: int, request: int, argument: Any) -> bytes:
        assert (descriptor, request) == (5, termios.TIOCMGET)
        return struct.pack("i", lines)

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    assert cts_level(Port(5)) is cts


def test_a_pseudo_terminal_has_no_such_line() -> None:
    near, far = os.openpty()
    try:
        assert cts_level(Port(far)) is None
    finally:
        os.close(near)
        os.close(far)


def test_a_port_that_was_closed_says_nothing() -> None:
    assert cts_level(Port(-1)) is None
