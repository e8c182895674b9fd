"""Which transfer goes by which synchronisation (Setting 14)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from ...errors import InvalidCommandError
from ...escaping import shown
from .by_xmodem import ReceiveByXmodem, SendByXmodem
from .receiving import ReceiveFile
from .sending import SendByDcCodes, SendByWires, SendFile
from .strategy import Patience, Strategy

__all__ = ["drip_feed", "receive_file", "send_file"]

XMODEM: Final = "xmodem"

_SENDERS: Final[Mapping[str, type[SendFile]]] = MappingProxyType(
    {"rts/cts": SendByWires, "xon/xoff": SendFile, "dc codes": SendByDcCodes}
)


def receive_file(
    synchronization: str,
    label: str,
    sink: Callable[[bytes], None],
    *,
    patience: Patience,
    max_bytes: int,
    eob: bytes = b"\r\n",
) -> Strategy:
    """
    Return the transfer of a file that the control sends.

    Args:
        synchronization: Setting 14: ``rts/cts``, ``xon/xoff``, ``dc codes``, ``xmodem``.
        label: What it is called.
        sink: Called with each piece of the file, in order, as soon as it has come.
        patience: How long each phase may take.
        max_bytes: A file that is larger is not received to its end.
        eob: What ends a block, as the control is set up (Setting 25).

    Raises:
        InvalidCommandError: There is no such synchronisation.
    """
    if synchronization == XMODEM:
        return ReceiveByXmodem(label, patience, sink, max_bytes=max_bytes, eob=eob)
    _sender_of(synchronization)
    return ReceiveFile(label, patience, sink, max_bytes=max_bytes)


def send_file(
    synchronization: str,
    label: str,
    data: bytes,
    *,
    patience: Patience,
    eob: bytes = b"\r\n",
    most_unsent_bytes: int | None = None,
    waits_for_start: bool | None = None,
) -> Strategy:
    """
    Return the transfer of a file to the control.

    Args:
        synchronization: Setting 14.
        label: What it is called.
        data: The file, byte for byte.
        patience: How long each phase may take.
        eob: What ends a block in it.
        most_unsent_bytes: So much may wait to leave; None: as is usual with that synchronisation.
        waits_for_start: Whether DC1 is awaited first; None: with DC codes. Others give no such sign, or their own.

    Raises:
        InvalidCommandError: There is no such synchronisation, or nothing to send.
    """
    if not data:
        raise InvalidCommandError("there is nothing to send")
    if synchronization == XMODEM:
        return SendByXmodem(label, patience, data, eob=eob)
    return _sender_of(synchronization)(
        label, patience, data, eob=eob, most_unsent_bytes=most_unsent_bytes, waits_for_start=waits_for_start
    )


def drip_feed(
    synchronization: str,
    label: str,
    data: bytes,
    *,
    patience: Patience,
    eob: bytes = b"\r\n",
    most_unsent_bytes: int | None = None,
    waits_for_start: bool | None = None,
) -> Strategy:
    """
    Return the transfer of a program that the control runs while it comes (DNC); see :func:`send_file`.

    Raises:
        InvalidCommandError: There is no such synchronisation, or it has no drip feed; or nothing to send.
    """
    if not data:
        raise InvalidCommandError("there is nothing to send")
    if synchronization == XMODEM:
        raise InvalidCommandError(
            "nobody has seen a drip feed with XMODEM",
            hint="set the control to another synchronisation (Setting 14), and the profile to the same",
        )
    return _sender_of(synchronization)(
        label,
        patience,
        data,
        eob=eob,
        most_unsent_bytes=most_unsent_bytes,
        waits_for_start=waits_for_start,
        drips=True,
    )


def _sender_of(synchronization: str) -> type[SendFile]:
    try:
        return _SENDERS[synchronization]
    except KeyError:
        known = ", ".join((*_SENDERS, XMODEM))
        raise InvalidCommandError(f"no synchronisation {shown(synchronization)}", hint=f"there are {known}") from None
