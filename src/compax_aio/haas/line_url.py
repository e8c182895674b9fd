"""A control's URL completed by its profile: what it says of the line, and what the line needs to be for the control."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final
from urllib.parse import quote

from ..errors import InvalidCommandError, TransportError
from ..transports.line_settings import LineSettings
from ..transports.url import TransportURL
from .profiles import Profile

__all__ = ["bytes_per_s", "completed", "profile_for"]

_SCHEMES_OF_PORTS: Final = frozenset({"serial", "rfc2217"})
_SCHEMES_OF_NETWORKS: Final = frozenset({"tcp", "tls", "unix"})
"""Behind these there is a port that has the speed of the control, or nothing would be understood."""
_PARITIES: Final = {"none": "N", "even": "E", "odd": "O", "zero": "N"}
"""As the port has them; ``zero`` is an eighth data bit that is always 0, which not every port has as a parity."""
_WORDS: Final = {"N": "none", "E": "even", "O": "odd", "S": "zero"}


def profile_for(url: str, profile: Profile) -> Profile:
    """
    Return *profile* as the URL of a serial port has it, which says more of it: its user has that line before him.

    Raises:
        InvalidCommandError: The line that the URL asks for cannot be one of that control.
        TransportError: It is no URL, or an option of it is none.
    """
    parsed = TransportURL.parse(url)
    if parsed.scheme not in _SCHEMES_OF_PORTS:
        return profile
    line = LineSettings.of(parsed)
    _refuse_contradictions(parsed, line, profile)
    told: dict[str, Any] = {}
    if "baudrate" in parsed.query:
        told["baudrate"] = line.baudrate
    if "stopbits" in parsed.query:
        told["stop_bits"] = line.stopbits if line.stopbits != int(line.stopbits) else int(line.stopbits)
    if profile.parity_in == "port" and profile.parity != "zero":
        if "bytesize" in parsed.query:
            told["data_bits"] = line.bytesize
        if "parity" in parsed.query:
            told["parity"] = _WORDS.get(line.parity, line.parity)
    try:
        return replace(profile, **told)
    except InvalidCommandError as error:
        error.what = f"the URL asks for another line than a control has: {error.what}"
        raise


def _refuse_contradictions(url: TransportURL, line: LineSettings, profile: Profile) -> None:
    if line.xonxoff:
        raise InvalidCommandError(
            "xonxoff=1 has the port's driver take DC1 and DC3 off the line, which this end has to see",
            hint="leave xonxoff out of the URL: Xon and Xoff are heeded all the same",
        )
    if profile.synchronization == "rts/cts" and url.query.get("rtscts") == "0":
        raise InvalidCommandError(
            "rtscts=0 contradicts the profile, whose control holds the line by RTS and CTS (Setting 14)",
            hint="leave rtscts out of the URL, or take a profile with the synchronization that the control is set to",
        )
    frame = _frame_of(profile)
    for option, value in (("bytesize", str(line.bytesize)), ("parity", line.parity)):
        is_ours = profile.parity_in == "bytes" or profile.parity == "zero"
        if is_ours and option in url.query and value != frame[option]:
            raise InvalidCommandError(
                f"{option}={value} contradicts the profile, whose parity bit is made and checked in the bytes: the "
                "port has 8 data bits and no parity then",
                hint=f"leave {option} out of the URL, or take a profile with parity_in='port'",
            )


def _frame_of(profile: Profile) -> dict[str, str]:
    """Return the options of a URL that the profile says something of."""
    options: dict[str, str] = {}
    if profile.baudrate is not None:
        options["baudrate"] = str(profile.baudrate)
    in_bytes = profile.parity_in == "bytes" or (profile.parity == "zero" and profile.data_bits == 7)
    if in_bytes:
        options |= {"bytesize": "8", "parity": "N"}
    else:
        if profile.data_bits is not None:
            options["bytesize"] = str(profile.data_bits)
        if profile.parity is not None:
            options["parity"] = _PARITIES[profile.parity]
    if profile.stop_bits is not None:
        options["stopbits"] = str(profile.stop_bits)
    if profile.synchronization == "rts/cts":
        options["rtscts"] = "1"
    return options


def completed(url: str, profile: Profile) -> str:
    """
    Return *url* with what *profile* says of the port, where it is one and the URL says nothing.

    Raises:
        TransportError: It is no URL.
    """
    parsed = TransportURL.parse(url)
    if parsed.scheme not in _SCHEMES_OF_PORTS:
        return url
    missing = [f"{key}={quote(value)}" for key, value in _frame_of(profile).items() if key not in parsed.query]
    if not missing:
        return url
    mark = "&" if parsed.query else "" if url.endswith("?") else "?"
    return url + mark + "&".join(missing)


def bytes_per_s(url: str, profile: Profile, baud_rate: int | None) -> float | None:
    """
    Return how fast the line sends; None where nobody knows.

    Args:
        url: Of the line, completed.
        profile: Says how many bits a character has.
        baud_rate: As the user has set it; None: the URL's, or behind a network the control's own: faster than that
            bytes would only gather in a terminal server, where they cannot be held back after an Xoff.
    """
    bits = profile.bits_per_character or 11
    if baud_rate is not None:
        return baud_rate / bits
    parsed = TransportURL.parse(url)
    if parsed.scheme in _SCHEMES_OF_NETWORKS:
        return None if profile.baudrate is None else profile.baudrate / bits
    if parsed.scheme not in _SCHEMES_OF_PORTS and "baudrate" not in parsed.query:
        return None
    try:
        return LineSettings.of(parsed).baudrate / bits
    except TransportError:
        return None  # whoever opens it says what is wrong
