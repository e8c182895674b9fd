"""Opening a cutter's line: an awaitable that is an asynchronous context manager as well."""

from __future__ import annotations

from functools import partial

from ..errors import InvalidCommandError
from ..escaping import shown
from ..motion.connecting import Connecting, name_of
from .cutter import Cutter
from .profiles import PNC_1610, Profile, profile_named
from .settings import CutterSettings

__all__ = ["connect"]


def connect(
    url: str,
    *,
    profile: Profile | str = PNC_1610,
    name: str | None = None,
    settings: CutterSettings | None = None,
) -> Connecting[Cutter]:
    """
    Connect to a Roland CAMM-1 cutter, or to one of its relatives.

    Await the result, and close the cutter yourself, or use it as ``async with connect(url) as cutter``: leaving the
    block, however it ends, aborts the job under way and closes the line.

    Args:
        url: ``serial:///dev/ttyUSB0?baudrate=9600``, ``tcp://host:4001``, ``sim://camm1?baudrate=9600``, or any other
            that there is an opener for. ``rtscts=1`` or ``dsrdtr=1`` for the hardwire handshake, as the cable is made.
        profile: Which machine it is, or its name; see :data:`PROFILES`.
        name: For errors, logs and results; the URL if not given.
        settings: Time-outs, and how much may be on its way.

    Raises:
        InvalidCommandError: *profile* or *settings* is none.

    Raises (when awaited or entered):
        TransportError: The line cannot be opened; the error says why.
        AnswerTimeoutError: Nobody answers.
        CommandRejectedError: The machine does not take what sets up the line.
        UnexpectedAnswerError: Another machine answers than *profile*.
    """
    if isinstance(profile, str):
        profile = profile_named(profile)
    if not isinstance(profile, Profile):
        raise InvalidCommandError(f"a profile is one of PROFILES, or its name, not {shown(profile)}")
    if settings is not None and not isinstance(settings, CutterSettings):
        raise InvalidCommandError(f"settings are CutterSettings, not {shown(settings)}")
    return Connecting(url, partial(Cutter, name_of(url, name), profile, settings or CutterSettings()))
