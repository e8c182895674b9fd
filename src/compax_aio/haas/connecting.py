"""Opening a control's line: an awaitable that is an asynchronous context manager as well."""

from __future__ import annotations

from functools import partial

from ..errors import InvalidCommandError
from ..escaping import shown
from ..motion.connecting import Connecting, name_of
from .control import Control
from .profiles import CLASSIC, Profile, profile_named
from .settings import ControlSettings

__all__ = ["connect"]


def connect(
    url: str,
    *,
    profile: Profile | str = CLASSIC,
    name: str | None = None,
    settings: ControlSettings | None = None,
) -> Connecting[Control]:
    """
    Connect to a Haas CNC control.

    Await the result, and close the control yourself, or use it as ``async with connect(url) as control``: leaving the
    block, however it ends, cancels the transfer under way and closes the line.

    Nothing is sent to open it: a control whose data collection is off answers nothing, and files go over its line all
    the same. That the line is open does not say that there is a control.

    Args:
        url: ``serial:///dev/ttyUSB0``, ``rfc2217://host:2217``, ``tcp://host:4001``, ``sim://haas``, or any other that
            there is an opener for. A serial port is opened as the profile says, where the URL says nothing.
        profile: How the control is set up, or the name of that; see :data:`PROFILES`.
        name: For errors, logs and results; the URL if not given.
        settings: Time-outs, and what may be written.

    Raises:
        InvalidCommandError: *profile* or *settings* is none.

    Raises (when awaited or entered):
        InvalidCommandError: The URL asks for a line that the control cannot be on.
        TransportError: The line cannot be opened; the error says why.
        UnexpectedAnswerError: Something sends and never stops.
    """
    if isinstance(profile, str):
        profile = profile_named(profile)
    if not isinstance(profile, Profile):
        raise InvalidCommandError(f"a profile is one of PROFILES, or its name, not {shown(profile)}")
    if settings is not None and not isinstance(settings, ControlSettings):
        raise InvalidCommandError(f"settings are ControlSettings, not {shown(settings)}")
    return Connecting(url, partial(Control, name_of(url, name), profile, settings or ControlSettings(), url))
