"""Open ``tls://`` lines: TCP that is encrypted, to a server whose certificate is always checked."""

from __future__ import annotations

import asyncio
import ssl
from pathlib import Path
from typing import Final, NoReturn

from compax_aio.errors import TransportError

from .layered import open_layered
from .network import NetworkAddress, connected_socket
from .registry import ProtocolFactory
from .tls_layer import TlsLayer
from .url import TransportURL

__all__ = ["open_tls"]

_FORM: Final = "tls://moxa.example:4001?cafile=/etc/ssl/plant.pem"
_FILES: Final = ("cafile", "certfile", "keyfile")
_OPTIONS: Final = (*_FILES, "server_name")

# Why a certificate is refused: the numbers are OpenSSL's (x509_vfy.h), each with what to do about it.
_EXPIRED: Final = "renew it on the server, and check the clock of this computer"
_UNKNOWN_CA: Final = "name the file of its certificate authority: cafile=/path/of/ca.pem"
_WRONG_NAME: Final = "write the name that its certificate has as host, or as server_name=… if the host is an address"
_REFUSED: Final = {
    9: ("is not valid yet", _EXPIRED),
    10: ("has expired", _EXPIRED),
    18: ("is signed by itself", "name the file of that very certificate: cafile=/path/of/server.pem"),
    19: ("is signed by an authority that this computer does not trust", _UNKNOWN_CA),
    20: ("is signed by an authority that this computer does not know", _UNKNOWN_CA),
    21: ("is signed by an authority that this computer does not know", _UNKNOWN_CA),
    62: ("is made out to another name", _WRONG_NAME),
    64: ("is made out to another address", _WRONG_NAME),
}


async def open_tls(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``tls://host:port``: as ``tcp://``, and encrypted. The server's certificate is always checked.

    Options: ``cafile`` (PEM file of the authorities to trust; without it, those of the system), ``certfile`` and
    ``keyfile`` (PEM files of a certificate that shows who we are; the key may be in ``certfile`` too),
    ``server_name`` (what the certificate is made out to, if it is not the host), ``connect_timeout_s`` (default 5,
    handshake included).

    Raises:
        TransportError: As for ``tcp://``; or a file is missing or unusable, the server's certificate is not to be
            trusted, or the far end speaks no TLS.
    """
    address = NetworkAddress.of(url, _FORM, _OPTIONS)
    server_name = url.query.get("server_name") or address.host
    deadline = asyncio.get_running_loop().time() + address.connect_timeout_s
    try:
        async with asyncio.timeout_at(deadline):
            context = await asyncio.to_thread(_context_of, url)
        layer = TlsLayer(context, server_name)
    except TimeoutError as exc:
        raise TransportError(
            f"the certificates for {address} could not be read within {address.connect_timeout_s:g} s",
            hint="are those files on a network that does not answer?",
        ) from exc
    except ValueError as exc:  # UnicodeError, and what ssl says of a name that cannot be one
        raise TransportError(
            f"{server_name!r} cannot be the name of a TLS server: {exc}", hint="check host and server_name"
        ) from exc
    async with connected_socket(address, deadline) as sock:
        try:
            left_s = deadline - asyncio.get_running_loop().time()
            return await open_layered(sock, layer, protocol_factory, greetings_s=left_s)
        except OSError as exc:
            raise _explained(address, exc) from exc


# --- files, in a thread


def _context_of(url: TransportURL) -> ssl.SSLContext:
    files = {option: path for option in _FILES if (path := url.query.get(option)) is not None}
    if "keyfile" in files and "certfile" not in files:
        raise TransportError("there is a keyfile, but no certfile", hint="give both, or neither")
    for option, path in files.items():
        _check_readable(option, path)
    try:
        context = ssl.create_default_context(cafile=files.get("cafile"))
        context.options |= ssl.OP_NO_RENEGOTIATION  # so that writing never has to wait for reading
    except ssl.SSLError as exc:
        raise TransportError(
            f"cafile {files['cafile']} holds no certificates: {exc.reason or exc}", hint="it must be in PEM form"
        ) from exc
    if "certfile" in files:
        _load_own_certificate(context, files["certfile"], files.get("keyfile"))
    return context


def _check_readable(option: str, path: str) -> None:
    try:
        with Path(path).open("rb"):
            pass
    except FileNotFoundError as exc:
        raise TransportError(
            f"there is no {option} {path}", hint="check the path, which is one of this computer"
        ) from exc
    except OSError as exc:
        raise TransportError(f"{option} {path} cannot be read: {exc.strerror}", hint="who may read it?") from exc


def _load_own_certificate(context: ssl.SSLContext, certfile: str, keyfile: str | None) -> None:
    where = keyfile or certfile

    def refuse_to_ask() -> NoReturn:  # where OpenSSL would ask on the terminal, and wait
        raise TransportError(
            f"the key in {where} is protected by a password, which a URL is no place for",
            hint="give a key file without a password that only this program may read: openssl pkey -in … -out …",
        )

    try:
        context.load_cert_chain(certfile, keyfile, password=refuse_to_ask)
    except ssl.SSLError as exc:
        if exc.reason == "KEY_VALUES_MISMATCH":
            what, hint = f"the key in {where} does not belong to the certificate in {certfile}", "they come in pairs"
        else:
            what = f"certfile {certfile}" + (f" and keyfile {keyfile}" if keyfile else "")
            what, hint = f"{what} cannot be used: {exc.reason or exc}", "both must be in PEM form, the key as well"
        raise TransportError(what, hint=hint) from exc


# --- what a handshake fails by


def _explained(address: NetworkAddress, exc: OSError) -> TransportError:
    if isinstance(exc, TimeoutError):
        return TransportError(
            f"{address} took the connection, but its TLS handshake did not end within {address.connect_timeout_s:g} s",
            hint="does that port speak TLS? connect_timeout_s=… waits longer",
        )
    if isinstance(exc, ssl.SSLCertVerificationError):
        what, hint = _REFUSED.get(exc.verify_code, ("is refused", "have a look at it: openssl s_client -connect …"))
        return TransportError(f"the certificate of {address} {what}: {exc.verify_message}", hint=hint)
    if isinstance(exc, ssl.SSLError) and "ALERT" in (exc.reason or ""):
        return TransportError(
            f"{address} refused the TLS handshake: {_plain(exc)}",
            hint="does it want a certificate of ours (certfile=… and keyfile=…), or does it speak TLS older than 1.2?",
        )
    if isinstance(exc, ssl.SSLEOFError | ConnectionError):
        return TransportError(
            f"{address} hung up during the TLS handshake",
            hint="does that port speak TLS, or want a certificate of ours?",
        )
    if isinstance(exc, ssl.SSLError):
        return TransportError(
            f"{address} does not speak TLS as we do: {_plain(exc)}",
            hint="is that the port for TLS? tcp:// opens one without",
        )
    return TransportError(f"the TLS handshake with {address} failed: {exc}")


def _plain(exc: ssl.SSLError) -> str:
    return (exc.reason or str(exc)).lower().replace("_", " ")
