"""The URL that names a line: parsed once, strictly, with its options read by type."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar
from urllib.parse import unquote

from compax_aio.errors import TransportError

__all__ = ["TransportURL"]

_T = TypeVar("_T")

_SHAPE = re.compile(
    r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*)://(?:(?P<userinfo>[^/?#]*)@)?"
    r"(?P<authority>[^/?#@]*)(?P<path>[^?#]*)(?:\?(?P<query>[^#]*))?"
)
_AUTHORITY = re.compile(r"(?P<host>\[[^\[\]]*\]|[^:\[\]]*)(?::(?P<port>.*))?")
# A password with a / in it makes part of itself the path: all from the first colon to the last @ is hidden.
_PASSWORD = re.compile(r"(?<=://)([^?#:]*):[^?#]*@")
_SECRET_OPTION = re.compile(r"pass(word|wd|phrase)|secret|token|credential", re.IGNORECASE)
_ANYTHING_LIKE_A_PASSWORD = re.compile(r"():(?!//).*@", re.DOTALL)
_HALF_ESCAPE = re.compile(r"%(?![0-9A-Fa-f]{2})")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
_FLAGS: Mapping[str, bool] = {"1": True, "0": False}


@dataclass(frozen=True, slots=True, repr=False)
class TransportURL:
    """
    Where a line is and how it is set up, as ``scheme://host:port/path?key=value``.

    The parts are percent-decoded. Upper and lower case are kept, except in the scheme: ``serial://COM3`` is COM3.

    Attributes:
        scheme: What kind of line, in lower case.
        host: Host, port name or loopback name; an IPv6 address without its brackets; empty if there is none.
        port: Port number 1..65535, or None.
        path: Path with its leading ``/``, or empty.
        query: The options as text, each key once.
        text: The URL as it was written, secrets included. ``str()`` and ``repr()`` hide a password before the host,
            and the value of every option whose name speaks of a password, secret, token or credential.
    """

    scheme: str
    host: str
    port: int | None
    path: str
    query: Mapping[str, str] = field(hash=False)
    text: str

    @classmethod
    def parse(cls, text: str) -> TransportURL:
        """
        Read *text*.

        Raises:
            TransportError: It is no URL of this form; the message says which part is wrong.
        """
        shape = _SHAPE.fullmatch(text)
        if shape is None:
            raise _unusable(
                text,
                "it is not of the form scheme://host:port/path?key=value",
                "write for instance serial:///dev/ttyUSB0 or tcp://192.168.1.50:4001, and # inside a name as %23",
            )
        authority = _AUTHORITY.fullmatch(shape["authority"])
        if authority is None:
            raise _unusable(
                text, "its host {} is ambiguous", "write an IPv6 address in brackets: [::1]:4001", shape["authority"]
            )
        return cls(
            scheme=shape["scheme"].lower(),
            host=_decoded(text, authority["host"].strip("[]")),
            port=_port(text, authority["port"]),
            path=_decoded(text, shape["path"]),
            query=MappingProxyType(_query(text, shape["query"] or "")),
            text=text,
        )

    def __str__(self) -> str:
        return _shown(_PASSWORD, self.text)

    def __repr__(self) -> str:
        return f"TransportURL({str(self)!r})"

    def expect(
        self,
        form: str,
        *,
        host: bool = False,
        port: bool = False,
        path: bool = False,
        query: Collection[str] = (),
    ) -> None:
        """
        Refuse every part that this kind of line has no use for.

        Args:
            form: How such a URL is written, for the hint.
            host: Whether a host may be given.
            port: Whether a port number may be given.
            path: Whether a path may be given.
            query: The options that are known.

        Raises:
            TransportError: The URL has a part that would be ignored; a user's name and password always are.
        """
        shape = _SHAPE.fullmatch(self.text)
        if shape is not None and shape["userinfo"] is not None:
            raise _unusable(self.text, f"{self.scheme}:// takes no user name or password", f"write it as {form}")
        for name, allowed, value in (
            ("host", host, self.host),
            ("port number", port, self.port),
            ("path", path, self.path),
        ):
            if value and not allowed:
                raise _unusable(self.text, f"{self.scheme}:// takes no {name}, got {{}}", f"write it as {form}", value)
        for key in self.query:
            if key not in query:
                known = ", ".join(sorted(query)) or "none"
                raise _unusable(self.text, f"{self.scheme}:// has no option {{}}", f"known options: {known}", key)

    def integer(self, key: str, default: int, *, minimum: int, maximum: int) -> int:
        """Return the option *key* as a whole number from *minimum* to *maximum*."""
        return self._read(
            key,
            default,
            int,
            lambda value: minimum <= value <= maximum,
            f"a whole number from {minimum} to {maximum}",
        )

    def number(self, key: str, default: float, *, above: float, maximum: float) -> float:
        """Return the option *key* as a number greater than *above* and not greater than *maximum*."""
        return self._read(
            key,
            default,
            float,
            lambda value: math.isfinite(value) and above < value <= maximum,
            f"a number above {above:g} and up to {maximum:g}",
        )

    def flag(self, key: str, default: bool = False) -> bool:
        """Return the option *key*, which is 1 or 0."""
        return self.choice(key, default, _FLAGS)

    def choice(self, key: str, default: _T, allowed: Mapping[str, _T]) -> _T:
        """Return what the text of the option *key* stands for in *allowed*."""
        return self._read(key, default, lambda value: allowed[value], lambda _: True, f"one of {', '.join(allowed)}")

    def _read(
        self,
        key: str,
        default: _T,
        convert: Callable[[str], _T],
        accept: Callable[[_T], bool],
        allowed: str,
    ) -> _T:
        text = self.query.get(key)
        if text is None:
            return default
        try:
            value = convert(text)
        except (ValueError, KeyError):
            pass
        else:
            if accept(value):
                return value
        shown = "***" if _SECRET_OPTION.search(key) else text
        raise _unusable(self.text, f"{key}={{}} is not allowed", f"{key} is {allowed}", shown)


def _port(url: str, text: str | None) -> int | None:
    if text is None:
        return None
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:6]) <= 65535):
        raise _unusable(url, "its port number is {}", "a port number is a whole number from 1 to 65535", text)
    return int(text)


def _query(url: str, text: str) -> dict[str, str]:
    query: dict[str, str] = {}
    for item in text.split("&") if text else ():
        key, equals, value = item.partition("=")
        if not (key and equals):
            raise _unusable(url, "its option {} has no value", "write options as key=value, with & between them", item)
        key = _decoded(url, key)
        if key in query:
            raise _unusable(url, "its option {} is given twice", "give each option once", key)
        query[key] = _decoded(url, value)
    return query


def _decoded(url: str, text: str) -> str:
    if _HALF_ESCAPE.search(text):
        raise _unusable(url, "{} has a % that begins no escape", "write a % itself as %25", text)
    try:
        decoded = unquote(text, errors="strict")
    except UnicodeDecodeError as exc:
        raise _unusable(url, "{} is not UTF-8 once it is decoded", "escape the bytes of UTF-8", text) from exc
    if _CONTROL.search(decoded):
        raise _unusable(url, "{} contains a control character", "take it out", decoded)
    return decoded


def _shown(password: re.Pattern[str], url: str) -> str:
    """Return *url* as it may be shown and logged."""
    before, mark, query = password.sub(r"\1:***@", url, count=1).partition("?")
    return before + mark + "&".join(map(_shown_option, query.split("&")))


def _shown_option(item: str) -> str:
    key, equals, _ = item.partition("=")
    return f"{key}{equals}***" if equals and _SECRET_OPTION.search(unquote(key)) else item


def _unusable(url: str, what: str, hint: str, part: object = "") -> TransportError:
    """Return the error that says *what* is wrong, with *part* in place of its ``{}``."""
    # A malformed URL does not say where its password ends, and any part of it may be part of that.
    said = what.replace("{}", "***" if _ANYTHING_LIKE_A_PASSWORD.search(url) else repr(part), 1)
    return TransportError(f"cannot use the URL {_shown(_ANYTHING_LIKE_A_PASSWORD, url)!r}: {said}", hint=hint)
