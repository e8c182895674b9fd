"""The link of a device's line: made as its user's settings say, and with those to whom it tells what happens."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Protocol, TypedDict

from ..errors import ConnectionLostError
from .contract import DeviceProtocol, Event
from .link import Link
from .reconnecting import Reconnecting, ReconnectSettings, Restored

__all__ = ["LineTells", "LinkSettings", "device_link"]


class LineTells(TypedDict):
    """Who is told of a line."""

    on_event: Callable[[Event], None]
    """Called with what comes unasked, as it is read."""
    on_lost: Callable[[ConnectionLostError], None]
    """Called when the line goes away for good."""
    greet: Callable[[], Awaitable[None]]
    """Looks who is on a line that was opened; see :class:`~compax_aio.link.link.Link`."""
    on_down: Callable[[ConnectionLostError], None]
    """Called when the line goes away, and is tried again."""
    on_restored: Callable[[Restored], None]
    """Called when it is back."""


class LinkSettings(ReconnectSettings, Protocol):
    """What a user says of any line."""

    @property
    def answer_timeout_s(self) -> float:
        """How long an answer may take."""

    @property
    def resync_attempts(self) -> int:
        """How many markers are tried before the device counts as silent."""


def device_link(
    protocol: DeviceProtocol,
    name: str,
    settings: LinkSettings,
    tells: LineTells,
    *,
    advice_on_silence: str,
    about: Callable[[], Mapping[str, object]],
    answer_timeout_s: float | None = None,
    marker_timeout_s: float | None = None,
) -> Link:
    """Make a link; *answer_timeout_s* stands for that of the settings, for the rest see :class:`Link`."""
    return Link(
        protocol,
        name=name,
        answer_timeout_s=settings.answer_timeout_s if answer_timeout_s is None else answer_timeout_s,
        resync_attempts=settings.resync_attempts,
        on_event=tells["on_event"],
        on_lost=tells["on_lost"],
        greet=tells["greet"],
        reconnecting=Reconnecting.by(settings, name, tells["on_down"], tells["on_restored"]),
        marker_timeout_s=marker_timeout_s,
        advice_on_silence=advice_on_silence,
        about=about,
    )
