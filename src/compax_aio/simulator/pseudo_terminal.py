"""A pseudo-terminal as the line of a simulated device, for programs that open serial ports."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import tty
from pathlib import Path
from typing import Final

from compax_aio.errors import TransportError

from .line import DeviceLine
from .rates import heard, rate_of, set_rate

__all__ = ["PseudoTerminal"]

_PIECE_BYTES: Final = 4096
_PAUSE_BYTES: Final = 3
"""So many byte times of silence, and what a device has said at the wrong rate is over."""
_USUAL_RATE: Final = 9600
"""That of ``serial://`` without an option."""
_TERMINALS: Final = "/dev/"
"""Where the ports are that a link of ours can point to."""


class PseudoTerminal:
    """
    A raw pty whose device end is a simulated device.

    It stays when a program closes it, and the next one that opens it finds the device as it was left. A pty does not
    tell whether it is open, so the device takes it for connected all the time; bytes that find its buffer full are
    lost.

    A device with a baud rate (its knob ``baudrate`` is not 0) sets the port to that rate at the beginning. If a
    program sets another one, what it sends and reads is what a UART makes of the wrong rate, bit by bit: the same
    garbage for the same bytes. What the device says then comes when it pauses, not byte by byte.

    Args:
        line: Of the device.
        link: A symbolic link to the port, with a name that stays the same; it is taken away at the end. A link that
            leads to a port that is gone, or has become ours since, is replaced, as one of a program that was killed.

    Attributes:
        path: Of the port.
        url: What opens it: by its link if it has one, at the rate of the device.

    Raises:
        TransportError: Somebody else is connected to the device, or *link* cannot be made.
    """

    def __init__(self, line: DeviceLine, link: str | os.PathLike[str] | None = None) -> None:
        self._line = line
        self._loop = asyncio.get_running_loop()
        self._garbled = bytearray()
        self._pause: asyncio.TimerHandle | None = None
        self._link = None if link is None else Path(link)
        # The port's own end is kept open, or reading would fail while no program has it open.
        self._device_end, self._port_end = os.openpty()
        try:
            tty.setraw(self._port_end)
            if line.baudrate:
                set_rate(self._port_end, line.baudrate)
            os.set_blocking(self._device_end, False)
            self.path = os.ttyname(self._port_end)
            rate = f"?baudrate={line.baudrate}" if line.baudrate not in {0, _USUAL_RATE} else ""
            self.url = f"serial://{self.path if self._link is None else self._link.absolute()}{rate}"
            self._hold(held=False)
            line.connect(self._send, self._hold)
            try:
                self._make_link()
            except BaseException:
                line.disconnect()
                raise
        except BaseException:
            self._hold(held=True)
            self._close_both()
            raise

    def close(self) -> None:
        """Take the port away; a program that has it open finds it hung up."""
        self._hold(held=True)
        if self._pause is not None:
            self._pause.cancel()
        self._line.disconnect()
        self._take_link_away()
        self._close_both()

    def _hold(self, held: bool) -> None:
        """Leave what the host writes in the buffers, as a device does that holds it by its handshake."""
        if held:
            self._loop.remove_reader(self._device_end)
        else:
            self._loop.add_reader(self._device_end, self._receive)

    # Bytes

    def _receive(self) -> None:
        data = os.read(self._device_end, _PIECE_BYTES)
        port_rate = self._wrong_rate()
        self._line.receive(data if port_rate is None else heard(data, port_rate, self._line.baudrate))

    def _send(self, data: bytes) -> None:
        if self._wrong_rate() is None and not self._garbled:
            self._write(data)
            return
        self._garbled += data
        if self._pause is not None:
            self._pause.cancel()
        if len(self._garbled) >= _PIECE_BYTES:
            self._write_garbled()
        else:
            pause_s = _PAUSE_BYTES * 10 / self._line.baudrate
            self._pause = self._loop.call_later(pause_s, self._write_garbled)

    def _write_garbled(self) -> None:
        data, self._pause = bytes(self._garbled), None
        self._garbled.clear()
        port_rate = self._wrong_rate()
        self._write(data if port_rate is None else heard(data, self._line.baudrate, port_rate))

    def _wrong_rate(self) -> int | None:
        """Return the rate that a program has set, if it is not the device's."""
        if not self._line.baudrate:
            return None
        rate = rate_of(self._port_end)
        return None if rate == self._line.baudrate else rate

    def _write(self, data: bytes) -> None:
        # If nobody reads and the buffer is full, bytes are lost, as on a serial line without handshake.
        with contextlib.suppress(BlockingIOError):
            os.write(self._device_end, data)

    # The link and the end

    def _make_link(self) -> None:
        if self._link is None:
            return
        try:
            _take_stale_away(self._link, self.path)
            self._link.symlink_to(self.path)
        except FileExistsError:
            raise TransportError(
                f"{self._link} is there already, and is no link to a port that is gone",
                hint="give the link another name, or take away what is there",
            ) from None
        except OSError as error:
            raise TransportError(f"no link to {self.path} can be made: {error}") from error

    def _take_link_away(self) -> None:
        """Remove the link if it still leads to our port; what somebody else has put there stays."""
        with contextlib.suppress(OSError):
            if self._link is not None and self._link.readlink() == Path(self.path):
                self._link.unlink()

    def _close_both(self) -> None:
        os.close(self._device_end)
        os.close(self._port_end)


def _take_stale_away(link: Path, port: str) -> None:
    """
    Take *link* away if it leads to a port that is gone, or to *port*: then that of a program that was killed was alike.

    It is set aside first, under a name that nobody knows, for somebody else may be making it anew at the same time.
    """
    if not link.is_symlink():
        return
    leads_to = link.readlink()
    if not leads_to.is_relative_to(_TERMINALS) or (link.exists() and str(leads_to) != port):
        return
    aside = link.with_name(f".{link.name[:32]}.{secrets.token_hex(8)}")
    link.rename(aside)
    if not aside.is_symlink() or aside.readlink() != leads_to:
        os.link(aside, link, follow_symlinks=False)  # it is theirs
    aside.unlink()
