"""A serial port's counters say what was damaged between two looks; where there are none, that is said."""

from __future__ import annotations

import os
import pty
import socket
import struct
from collections.abc import Callable

import pytest

from compax_aio.transports import line_errors
from compax_aio.transports.line_errors import LineErrors, line_errors_of
from compax_aio.transports.line_settings import LineSettings
from compax_aio.transports.serial_backends import open_port


class _Port:
    def __init__(self, descriptor: int = 7) -> None:
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor


def _answering(*counts: int) -> Callable[[int, int, bytes], bytes]:
    def ask(descriptor: int, request: int, space: bytes) -> bytes:
        assert (descriptor, request, len(space)) == (7, 0x545D, 80)
        return struct.pack("20i", *counts, *[0] * (20 - len(counts)))

    return ask


@pytest.fixture
def linux(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """The call's number, wherever this runs."""
    monkeypatch.setattr(line_errors, "_COUNTERS", 0x545D)
    return monkeypatch


def test_counts_are_read_where_linux_puts_them(linux: pytest.MonkeyPatch) -> None:
    linux.setattr(line_errors, "_ASK", _answering(1, 2, 3, 4, 500, 600, 7, 8, 9, 10, 11))
    assert line_errors_of(_Port()) == LineErrors(frame=7, overrun=8, parity=9, breaks=10, buffer_overrun=11)


def test_what_happened_is_the_difference_of_two_looks() -> None:
    before = LineErrors(parity=5, frame=1)
    after = LineErrors(parity=7, frame=1, breaks=1)
    assert after.since(before) == LineErrors(parity=2, breaks=1)
    assert after.since(before).total == 3
    assert not before.since(before)
    assert after.since(before)


def test_a_counter_that_begins_anew_counts_on() -> None:
    assert LineErrors(parity=-(2**31)).since(LineErrors(parity=2**31 - 1)) == LineErrors(parity=1)


def test_errors_are_said_in_words() -> None:
    assert str(LineErrors(parity=2, breaks=1)) == "2 parity errors and 1 break"
    assert str(LineErrors(overrun=1, buffer_overrun=3)) == "1 overrun of the port and 3 overruns of the system's buffer"
    assert str(LineErrors()) == "no errors"


def test_a_pseudo_terminal_and_a_socket_have_no_counters() -> None:
    near, far = pty.openpty()
    try:
        assert line_errors_of(_Port(near)) is None
    finally:
        os.close(near)
        os.close(far)
    with socket.socket() as sock:
        assert line_errors_of(sock) is None


def test_what_is_no_port_or_went_away_has_no_counters(linux: pytest.MonkeyPatch) -> None:
    def closed(*_: object) -> bytes:
        raise OSError

    assert line_errors_of(None) is None
    assert line_errors_of(object()) is None
    linux.setattr(line_errors, "_ASK", closed)
    assert line_errors_of(_Port()) is None


def test_a_closed_port_of_either_library_has_no_counters(linux: pytest.MonkeyPatch) -> None:
    linux.setattr(line_errors, "_ASK", lambda *_: bytes(80))
    for backend in ("pyserial", "serialx"):
        device_end, port_end = os.openpty()
        port = open_port(backend, os.ttyname(port_end), LineSettings(), dsrdtr=False)
        port.close()
        assert line_errors_of(port) is None
        os.close(device_end)
        os.close(port_end)


def test_other_systems_have_no_counters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line_errors, "_COUNTERS", None)
    assert line_errors_of(_Port()) is None
