"""Open ``rfc2217://`` lines: serial ports of a server on the network, whose settings we choose."""

from __future__ import annotations

import asyncio
import logging
from typing import Final

from compax_aio.errors import TransportError

from .layered import open_layered
from .line_settings import LINE_OPTIONS, LineSettings
from .network import NetworkAddress, connected_socket
from .registry import ProtocolFactory
from .rfc2217_codec import Rfc2217Layer
from .url import TransportURL

__all__ = ["open_rfc2217"]

_FORM: Final = "rfc2217://192.168.1.50:2217?baudrate=9600"

_log = logging.getLogger("compax_aio.transports")


async def open_rfc2217(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``rfc2217://host:port`` and have the server set its serial port, by default to 9600 baud, 8N1, no handshake.

    Options: ``baudrate``, ``bytesize`` (5..8), ``parity`` (N, E, O, M, S), ``stopbits`` (1, 1.5, 2), one of the
    handshakes ``rtscts`` and ``xonxoff`` (1 or 0), ``connect_timeout_s`` (default 5, greetings included).

    A setting that the server has not acknowledged after half that time is logged as a warning. What came from the
    serial port before it was set is discarded.

    Raises:
        TransportError: As for ``tcp://``; or the far end does not speak RFC 2217, or refuses a setting.
    """
    address = NetworkAddress.of(url, _FORM, LINE_OPTIONS)
    settings = LineSettings.of(url)
    if settings.rtscts and settings.xonxoff:
        raise TransportError(f"the URL {str(url)!r} asks for two handshakes", hint="RFC 2217 knows one at a time")
    layer = Rfc2217Layer(settings)
    deadline = asyncio.get_running_loop().time() + address.connect_timeout_s
    async with connected_socket(address, deadline) as sock:
        left_s = deadline - asyncio.get_running_loop().time()
        try:
            transport = await open_layered(sock, layer, protocol_factory, greetings_s=left_s)
        except OSError as exc:
            raise _explained(address, layer, exc) from exc
    if layer.unacknowledged:
        _log.warning("%s has not acknowledged %s; is its serial port set so?", address, layer.unacknowledged)
    return transport


def _explained(address: NetworkAddress, layer: Rfc2217Layer, exc: OSError) -> TransportError:
    if isinstance(exc, ConnectionRefusedError):
        return TransportError(
            f"{address} refuses the serial line that we asked for: {exc}",
            hint="ask for what its port can do, or set the port at the server and open it by tcp://",
        )
    if isinstance(exc, TimeoutError) and not layer.is_telnet:
        return TransportError(
            f"{address} took the connection, but said nothing of RFC 2217 within {address.connect_timeout_s:g} s",
            hint="is that port in raw TCP mode? then use tcp://; connect_timeout_s=… waits longer",
        )
    if isinstance(exc, TimeoutError):
        return TransportError(
            f"{address} speaks telnet, but did not agree to RFC 2217 within {address.connect_timeout_s:g} s",
            hint="does the server have it switched on for that port? connect_timeout_s=… waits longer",
        )
    said = bytes(layer.heard).decode("ascii", "backslashreplace").strip()
    return TransportError(
        f"{address} hung up during the greetings" + (f", saying {said!r}" if said else ""),
        hint="does the server serve that port to nobody else?",
    )
