"""TLS without I/O: OpenSSL between two buffers in memory."""

from __future__ import annotations

import ssl
from contextlib import suppress

from compax_aio.errors import ConnectionLostError

from .layered import Layer

__all__ = ["TlsLayer"]

_PIECE_BYTES = 64 * 1024


class TlsLayer(Layer):
    """The client's side of one TLS connection, whose handshake begins at once."""

    answers_farewell = True

    def __init__(self, context: ssl.SSLContext, server_name: str) -> None:
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing, server_hostname=server_name)
        self._shake_hands()

    def _shake_hands(self) -> None:
        try:
            self._tls.do_handshake()
        except ssl.SSLWantReadError:
            return
        self.is_ready = True

    def receive(self, data: bytes) -> bytes:
        """Return what *data* says in the clear; ssl.SSLError if it is no TLS or nobody to be trusted."""
        self._incoming.write(data)
        if not self.is_ready:
            self._shake_hands()
        received = bytearray()
        while self.is_ready and not self.is_over:
            try:
                piece = self._tls.read(_PIECE_BYTES)
            except ssl.SSLWantReadError:
                break
            except ssl.SSLZeroReturnError:
                piece = b""
            received += piece
            self.is_over = not piece
        return bytes(received)

    def encode(self, data: bytes | bytearray | memoryview) -> bytes:
        """Return *data* encrypted."""
        rest = memoryview(data)
        while rest:
            rest = rest[self._tls.write(rest) :]
        return self._outgoing.read()

    def bytes_to_send(self) -> bytes:
        """Return what belongs to the handshake, and alerts."""
        return self._outgoing.read()

    def farewell(self) -> bytes:
        """Return the notice that nothing more comes from us."""
        with suppress(ssl.SSLError):  # it wants the far end's notice now, or there is nothing to take leave of any more
            self._tls.unwrap()
        return self._outgoing.read()

    def lost(self, exc: OSError) -> Exception:
        """Return ConnectionLostError that says what the far end had against us."""
        reason = exc.reason if isinstance(exc, ssl.SSLError) else None
        said = (reason or exc.strerror or str(exc)).lower().replace("_", " ")
        lost = ConnectionLostError(
            f"the TLS connection broke: {said}",
            hint="the server wants a certificate of ours: certfile=… and keyfile=…" if "certificate" in said else None,
        )
        lost.__cause__ = exc
        return lost
