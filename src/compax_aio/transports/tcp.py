"""Open ``tcp://`` lines, to device servers and terminal servers on the network."""

from __future__ import annotations

import asyncio
from typing import Final

from .network import NetworkAddress, connected_socket
from .registry import ProtocolFactory
from .url import TransportURL

__all__ = ["open_tcp"]

_FORM: Final = "tcp://192.168.1.50:4001 or tcp://[fe80::1]:4001"


async def open_tcp(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``tcp://host:port`` with TCP_NODELAY and keep-alive on; all addresses of the host are tried in turn.

    Options: ``connect_timeout_s`` (default 5).

    Raises:
        TransportError: The host is unknown, unreachable or silent, or nothing listens on that port.
    """
    async with connected_socket(NetworkAddress.of(url, _FORM)) as sock:
        transport, _ = await asyncio.get_running_loop().create_connection(protocol_factory, sock=sock)
    return transport
