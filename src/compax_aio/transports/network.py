"""The way to a host on the network: one socket, connected within a time-out, and what to do when that fails."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final

from compax_aio.errors import TransportError

from .url import TransportURL

__all__ = ["CONNECT_TIMEOUT", "NetworkAddress", "connected_socket"]

CONNECT_TIMEOUT: Final = "connect_timeout_s"
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


@dataclass(frozen=True, slots=True)
class NetworkAddress:
    """
    Where a URL leads to, and how long opening it may take.

    Attributes:
        host: Name or IP address.
        port: Port number.
        connect_timeout_s: For all of the opening: name, connection and greetings; the option of that name.
    """

    host: str
    port: int
    connect_timeout_s: float

    @classmethod
    def of(cls, url: TransportURL, form: str, options: Collection[str] = ()) -> NetworkAddress:
        """
        Read the address of *url*, which is written like *form* and may have *options* beside ``connect_timeout_s``.

        Raises:
            TransportError: It has no host or no port number, or a part that would be ignored.
        """
        url.expect(form, host=True, port=True, query=(CONNECT_TIMEOUT, *options))
        if not url.host or url.port is None:
            missing = "host" if not url.host else "port number"
            raise TransportError(f"the URL {str(url)!r} has no {missing}", hint=f"write it as {form}")
        timeout_s = url.number(CONNECT_TIMEOUT, _CONNECT_TIMEOUT_S, above=0, maximum=3600)
        return cls(url.host, url.port, timeout_s)

    def __str__(self) -> str:
        return f"{self.host} port {self.port}"


@asynccontextmanager
async def connected_socket(address: NetworkAddress, deadline: float | None = None) -> AsyncIterator[socket.socket]:
    """
    Connect a socket with TCP_NODELAY and keep-alive on; all addresses of the host are tried in turn.

    By *deadline*, a time of the event loop, it is connected or has failed; None: ``connect_timeout_s`` from now.
    A block that fails or is cancelled closes it; one that ends has given it to somebody else.

    Raises:
        TransportError: The host is unknown, unreachable or silent, or nothing listens on that port.
    """
    if deadline is None:
        deadline = asyncio.get_running_loop().time() + address.connect_timeout_s
    try:
        async with asyncio.timeout_at(deadline):
            sock = await _connect(address, deadline)
    except (OSError, UnicodeError) as exc:
        raise _explained(address, exc) from exc
    try:
        yield sock
    except BaseException:
        sock.close()
        raise


async def _connect(address: NetworkAddress, deadline: float) -> socket.socket:
    loop = asyncio.get_running_loop()
    resolved = await loop.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)
    failures: list[OSError] = []
    for tried, (family, kind, protocol, _, socket_address) in enumerate(resolved):
        # Each address gets its share of the time, so that a silent one leaves some for the next.
        share_s = (deadline - loop.time()) / (len(resolved) - tried)
        try:
            async with asyncio.timeout(share_s):
                return await _connect_to(family, kind, protocol, socket_address)
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


def _explained(address: NetworkAddress, exc: OSError | UnicodeError) -> TransportError:
    if isinstance(exc, socket.gaierror | UnicodeError):
        return TransportError(
            f"the host name {address.host!r} is not known: {exc}",
            hint="check its spelling and the network, or give the IP address",
        )
    if isinstance(exc, ConnectionRefusedError):
        return TransportError(
            f"{address} refused the connection",
            hint="is the port number right, and does the device server serve that port to nobody else?",
        )
    if exc.errno in {errno.ENETUNREACH, errno.EHOSTUNREACH}:
        return TransportError(
            f"{address} is unreachable: {exc.strerror}",
            hint="check the cable, the address and the network's route to it",
        )
    if isinstance(exc, TimeoutError):
        return TransportError(
            f"{address} did not answer within {address.connect_timeout_s:g} s",
            hint="is it switched on, and does a firewall swallow the connection? connect_timeout_s=… waits longer",
        )
    return TransportError(f"{address} could not be connected to: {exc}")
