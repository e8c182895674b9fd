"""What is said to a cutter to set it up: device control in an order that leaves nothing of what was set before."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from ..errors import InvalidCommandError
from .facts.line import DC1, DC3, ENQ
from .handshakes import ACKNOWLEDGEMENT, HEARD, EnqAck, Hardwire, XonXoff
from .instructions import BlockHandshake, Control, DtrControl, EnqAckMode1, PresetHandshake, Reset, SignFormat, encode
from .pacing import Pacing
from .profiles import Profile
from .protocol import AGREED_FORMAT

__all__ = ["handshake_words", "reset_words", "worded"]

_HARDWIRE_PRESET: Final = 3
"""(PNC-1610 p. 29)."""


def worded(controls: Iterable[Control], profile: Profile) -> str:
    """
    Return *controls* as they are sent to that machine.

    Raises:
        InvalidCommandError: It has none of them, or not so.
    """
    return b"".join(encode(each, profile) for each in controls).decode("latin-1")


def reset_words(profile: Profile) -> str:
    """Say what forgets every handshake, where the machine has such a thing, and the form of replies again."""
    controls: list[Control] = []
    if "R" in profile.controls:
        controls.append(Reset())
    return worded(controls, profile) + AGREED_FORMAT + worded(_dtr(profile, is_on=False), profile)


def handshake_words(pacing: Pacing, profile: Profile) -> str:
    """
    Say what establishes the handshake of *pacing*.

    ``.P`` is used only where there is no other way to have DTR follow the free space: its presets change the form of
    replies, which is said again behind it.

    Raises:
        InvalidCommandError: The machine cannot be told to have it.
    """
    is_hardwire = isinstance(pacing, Hardwire)
    if is_hardwire and not {"@", "P"} & profile.controls:
        raise InvalidCommandError(
            f"how {profile.name} is told to use its DTR line is not known",
            hint="choose another handshake; or add '@' to 'controls' of its profile, if it has ESC.@",
        )
    if is_hardwire and "@" not in profile.controls:
        words = worded([PresetHandshake(_HARDWIRE_PRESET)], profile) + AGREED_FORMAT
    else:
        words = worded(_dtr(profile, is_on=is_hardwire), profile)
    return words + worded(_signals(pacing, profile), profile)


def _dtr(profile: Profile, *, is_on: bool) -> list[Control]:
    return [DtrControl(dtr=int(is_on))] if "@" in profile.controls else []


def _signals(pacing: Pacing, profile: Profile) -> list[Control]:
    if isinstance(pacing, EnqAck):
        kind = EnqAckMode1 if pacing.mode == 1 else BlockHandshake
        return [SignFormat(signs=HEARD), kind(pacing.announced_bytes, ENQ, ACKNOWLEDGEMENT)]
    threshold = max(pacing.room.threshold_bytes, profile.lowest_threshold)
    if isinstance(pacing, XonXoff):
        return [SignFormat(signs=bytes((DC3,))), BlockHandshake(threshold, signs=bytes((DC1,)))]
    if isinstance(pacing, Hardwire):
        return [SignFormat(), BlockHandshake(threshold)]
    return [SignFormat(), BlockHandshake()]
