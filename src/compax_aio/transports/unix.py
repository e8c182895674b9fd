"""Open ``unix://`` lines, to programs on the same computer."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path
from typing import Final

from compax_aio.errors import TransportError

from .registry import ProtocolFactory
from .url import TransportURL

__all__ = ["open_unix"]

_FORM: Final = "unix:///run/drive.sock"


async def open_unix(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``unix:///path/of/the/socket``; it has no options.

    Raises:
        TransportError: The socket is missing, no socket, not ours to open, or nothing listens on it; or this
            platform has no such sockets.
    """
    url.expect(_FORM, path=True)
    if not url.path:
        raise TransportError(f"the URL {str(url)!r} has no path", hint=f"write it as {_FORM}, with three slashes")
    if not hasattr(socket, "AF_UNIX"):
        raise TransportError("this platform has no Unix sockets", hint="use tcp:// instead")
    sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        try:
            # Not loop.sock_connect: a listener whose queue is full says EAGAIN, which that takes for a connection.
            sock.connect(url.path)
        except OSError as exc:
            raise await asyncio.to_thread(_explained, url.path, exc) from exc
        transport, _ = await asyncio.get_running_loop().create_unix_connection(protocol_factory, sock=sock)
    except BaseException:
        sock.close()
        raise
    return transport


def _explained(path: str, exc: OSError) -> TransportError:
    if isinstance(exc, FileNotFoundError):
        return TransportError(f"there is no socket {path}", hint="does the program that makes it run?")
    if isinstance(exc, PermissionError):
        return TransportError(
            f"no permission to connect to the socket {path}",
            hint="its owner decides who may write to it and enter its directory",
        )
    if isinstance(exc, ConnectionRefusedError) and not Path(path).is_socket():
        return TransportError(f"{path} is not a socket", hint="give the path on which the program listens")
    if isinstance(exc, ConnectionRefusedError):
        return TransportError(
            f"nothing listens on the socket {path}", hint="the program that made it has ended; start it again"
        )
    if isinstance(exc, BlockingIOError):
        return TransportError(
            f"the program that listens on the socket {path} takes no more connections",
            hint="does it hang, or does it serve one at a time?",
        )
    return TransportError(f"the socket {path} could not be connected to: {exc}")
