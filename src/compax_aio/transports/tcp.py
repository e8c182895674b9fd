"""Open ``tcp://`` lines, to device servers and terminal servers on the network."""

from __future__ import annotations

import asyncio
import errno
import socket
from typing import Any, Final

from compax_aio.errors import TransportError

from .registry import ProtocolFactory
from .url import TransportURL

__all__ = ["open_tcp"]

_FORM: Final = "tcp://192.168.1.50:4001 or tcp://[fe80::1]:4001"
_CONNECT_TIMEOUT_S: Final = 5.0

# A far end that lost its power says nothing. It is missed after 10 s + 3 x 5 s, and no sooner than that either when
# bytes of ours stay without acknowledgement. Linux, macOS and Windows have different ones of these.
_SOCKET_OPTIONS: Final = (
    ("SOL_SOCKET", "SO_KEEPALIVE", 1),
    ("IPPROTO_TCP", "TCP_NODELAY", 1),
    ("IPPROTO_TCP", "TCP_KEEPIDLE", 10),
    ("IPPROTO_TCP", "TCP_KEEPALIVE", 10),
    ("IPPROTO_TCP", "TCP_KEEPINTVL", 5),
    ("IPPROTO_TCP", "TCP_KEEPCNT", 3),
    ("IPPROTO_TCP", "TCP_USER_TIMEOUT", 25_000),
)


async def open_tcp(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``tcp://host:port`` with TCP_NODELAY and keep-alive on; all addresses of the host are tried in turn.

    Options: ``connect_timeout_s`` (default 5).

    Raises:
        TransportError: The host is unknown, unreachable or silent, or nothing listens on that port.
    """
    url.expect(_FORM, host=True, port=True, query=("connect_timeout_s",))
    if not url.host or url.port is None:
        missing = "host" if not url.host else "port number"
        raise TransportError(f"the URL {str(url)!r} has no {missing}", hint=f"write it as {_FORM}")
    timeout_s = url.number("connect_timeout_s", _CONNECT_TIMEOUT_S, above=0, maximum=3600)
    try:
        async with asyncio.timeout(timeout_s):
            sock = await _connect(url.host, url.port, timeout_s)
    except (OSError, UnicodeError) as exc:
        raise _explained(url, timeout_s, exc) from exc
    try:
        transport, _ = await asyncio.get_running_loop().create_connection(protocol_factory, sock=sock)
    except BaseException:
        sock.close()
        raise
    return transport


async def _connect(host: str, port: int, timeout_s: float) -> socket.socket:
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeout_s
    addresses = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    failures: list[OSError] = []
    for tried, (family, kind, protocol, _, address) in enumerate(addresses):
        # Each address gets its share of the time, so that a silent one leaves some for the next.
        share_s = (deadline - loop.time()) / (len(addresses) - tried)
        try:
            async with asyncio.timeout(share_s):
                return await _connect_to(family, kind, protocol, address)
        except OSError as exc:
            failures.append(exc)
    raise failures[0]


async def _connect_to(family: int, kind: int, protocol: int, address: Any) -> socket.socket:
    sock = socket.socket(family, kind, protocol)
    try:
        sock.setblocking(False)
        for level, name, value in _SOCKET_OPTIONS:
            if hasattr(socket, name):
                sock.setsockopt(getattr(socket, level), getattr(socket, name), value)
        await asyncio.get_running_loop().sock_connect(sock, address)
    except BaseException:
        sock.close()
        raise
    return sock


def _explained(url: TransportURL, timeout_s: float, exc: OSError | UnicodeError) -> TransportError:
    where = f"{url.host} port {url.port}"
    if isinstance(exc, socket.gaierror | UnicodeError):
        return TransportError(
            f"the host name {url.host!r} is not known: {exc}",
            hint="check its spelling and the network, or give the IP address",
        )
    if isinstance(exc, ConnectionRefusedError):
        return TransportError(
            f"{where} refused the connection",
            hint="is the port number right, and does the device server serve that port to nobody else?",
        )
    if exc.errno in {errno.ENETUNREACH, errno.EHOSTUNREACH}:
        return TransportError(
            f"{where} is unreachable: {exc.strerror}",
            hint="check the cable, the address and the network's route to it",
        )
    if isinstance(exc, TimeoutError):
        return TransportError(
            f"{where} did not answer within {timeout_s:g} s",
            hint="is it switched on, and does a firewall swallow the connection? connect_timeout_s=… waits longer",
        )
    return TransportError(f"{where} could not be connected to: {exc}")
