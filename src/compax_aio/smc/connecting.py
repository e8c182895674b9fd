"""Opening a line with axes: an awaitable that is an asynchronous context manager as well."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Literal

from ..errors import InvalidCommandError
from ..escaping import shown
from ..motion.connecting import Connecting, name_of
from .facts import MAX_AXES, Mode
from .naming import names_of_chain
from .party_line import PartyLine
from .settings import SmcSettings
from .vocabulary import check_name

__all__ = ["connect"]


def connect(
    url: str,
    *,
    mode: Mode | Literal["single", "party", "daisy"] = Mode.PARTY,
    axes: Iterable[str] = (),
    name: str | None = None,
    settings: SmcSettings | None = None,
) -> Connecting[PartyLine]:
    """
    Connect to a line with one or more AMS SMC axes.

    Await the result, and close the line yourself, or use it as ``async with connect(url) as line``: leaving the block,
    however it ends, stops the moves that it started and closes the line.

    Args:
        url: ``serial:///dev/ttyUSB0?baudrate=9600``, ``tcp://host:4001``, ``sim://smc?axes=ABC``, or any other that
            there is an opener for. The line has no handshake but the echo (DCB p. 15).
        mode: How the axes are switched: ``"party"``, ``"daisy"``, or ``"single"``, made for typing (DCB p. 20).
        axes: Their names, such as ``"ABC"``; all of them must be there. None in single mode. Without them nothing is
            asked on a party line, and :meth:`PartyLine.scan` finds them; a daisy chain tells how many it has.
        name: For errors, logs and results; the URL if not given.
        settings: Time-outs, and which member of the family these are.

    Raises:
        InvalidCommandError: *mode* or *axes* means nothing.

    Raises (when awaited or entered):
        TransportError: The line cannot be opened; the error says why.
        AnswerTimeoutError: Nobody answers, or one of *axes* does not.
        UnexpectedAnswerError: What answers is no such axis; or a daisy chain has others than *axes*.
    """
    mode = _mode(mode)
    names = _names(axes, mode)
    return Connecting(url, partial(PartyLine, name_of(url, name), mode, names, settings or SmcSettings()))


def _mode(mode: object) -> Mode:
    try:
        return Mode(mode)
    except ValueError:
        allowed = ", ".join(repr(each.value) for each in Mode)
        raise InvalidCommandError(f"the mode of a line is one of {allowed}, not {shown(mode)}") from None


def _names(axes: Iterable[str], mode: Mode) -> str:
    names = [check_name(each, Mode.PARTY) for each in axes]
    if names and not mode.has_names:
        raise InvalidCommandError("in single mode there is one axis, and it has no name", hint="leave axes out")
    if len(set(names)) < len(names) or len(names) > MAX_AXES:
        raise InvalidCommandError(f"a line has up to {MAX_AXES} axes, each with a name of its own (DCB p. 17)")
    in_order = names_of_chain(names[0], len(names)) if names else ""
    if mode is Mode.DAISY and "".join(names) != in_order:
        raise InvalidCommandError(f"a daisy chain takes names that follow each other, such as {in_order!r} (DCB p. 24)")
    return "".join(names)
