"""How a drive's line is used: what P20 says of it, text or binary, and settings whose frame may have arrived cut."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

from ..errors import AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError
from ..link.contract import Lane
from .binary import BinaryTransfer, encode_ascii, is_frame, is_motion_frame
from .codecs import SerialInterface, decode_interface
from .facts.serial_interface import INTERFACE_PARAMETER

if TYPE_CHECKING:
    from .line import DriveLine

__all__ = ["Transfer"]

_log = logging.getLogger("compax_aio.compax")

_SETTING: Final = re.compile(r"(SPEED|SD|ACCEL-|AL-|ACCEL|AL)(?=[\d.+])")
_SHORT: Final = {"SPEED": "SD", "ACCEL": "AL", "ACCEL-": "AL-"}
_SPEED: Final = "SD"
_INTERFACE_WRITTEN: Final = re.compile(rf"P0*{INTERFACE_PARAMETER}=")


class Transfer:
    """
    Chooses between text and binary, and remembers what binary has left in doubt.

    Attributes:
        interface: What P20 says; None where it could not be read, or was written since.

    Args:
        line: Of the drive.
    """

    def __init__(self, line: DriveLine) -> None:
        self.interface: SerialInterface | None = None
        self._line = line
        self._unsure: dict[str, str | None] = {}
        """By word, what was said of a setting last, or None for nothing; the drive may have taken another value."""
        self._said: dict[str, str] = {}
        """By word, what the drive has acknowledged of a setting last."""

    # P20 ------------------------------------------------------------------------------------------------------------

    @property
    def tells_errors(self) -> bool:
        """Whether P20 is known to let the drive tell errors; if not, a prompt proves nothing (UG p. 166)."""
        return self.interface is not None and not self.interface.errors_suppressed

    async def read_interface(self, lane: Lane) -> None:
        """Read P20, and do as it says: believe no prompt of a drive that keeps quiet about errors."""
        line = self._line
        try:
            decode = partial(
                decode_interface,
                xonxoff_weight=line.settings.xonxoff_weight,
                errors_suppressed_weight=line.settings.errors_suppressed_weight,
            )
            interface = await line.read(f"P{INTERFACE_PARAMETER}", decode, lane)
        except (AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError) as error:
            _log.warning("%s does not give P20, so whether it tells errors is unknown: %s", line.name, error)
            return
        if interface == self.interface:
            return
        self.interface = interface
        if interface.errors_suppressed:
            _log.warning(
                "%s keeps quiet about errors (P20 = %d): a refused command looks like an accepted one; "
                "moves are confirmed by its status",
                line.name,
                interface.raw,
            )
            line.settings = replace(line.settings, verify_messages=True)
        self._choose(interface)

    def _choose(self, interface: SerialInterface) -> None:
        """Use binary transfer, if the settings ask for it and P20 allows it (UG p. 166)."""
        line = self._line
        line.protocol.encode = encode_ascii
        if line.settings.binary_settings and interface.binary:
            line.protocol.encode = BinaryTransfer(motion=line.settings.binary_motion).encode
        elif line.settings.binary_settings:
            _log.warning("%s takes no binary transfer (P20 = %d), so everything goes as text", line.name, interface.raw)
        elif interface.binary:
            _log.warning(
                "%s has binary transfer on (P20 = %d): a stray byte with its top bit set may swallow what follows it",
                line.name,
                interface.raw,
            )

    # Frames ---------------------------------------------------------------------------------------------------------

    def is_motion_frame(self, text: str) -> bool:
        """Whether *text* would go out now as a frame that sets the axis in motion."""
        return is_motion_frame(self._line.protocol.encode(text))

    def motion_was_lost(self, text: str) -> None:
        """Take note of a motion in binary that may be cut: completed by what came next, it may have become a SPEED."""
        self._give_up(text)
        self._unsure.setdefault(_SPEED, None)

    def _give_up(self, text: str) -> None:
        """Send text from now on: a line that loses bytes is none for frames, which have no end sign."""
        _log.warning("%s lost %r or its answer: everything goes as text from now on", self._line.name, text)
        self._line.protocol.encode = encode_ascii

    def note_sent(self, text: str) -> None:
        """Take note of a line that is written."""
        if _INTERFACE_WRITTEN.match(text.replace(" ", "")):
            self.interface = None

    def note_taken(self, text: str) -> None:
        """Take note of a line that the drive has acknowledged."""
        if word := _word(text):
            self._unsure.pop(word, None)
            self._said[word] = text

    def forget_taken(self) -> None:
        """Take note that the drive may have been without power: what it was told of settings is to be said again."""
        self._unsure = {**self._said, **self._unsure}

    def note_lost(self, text: str, wire: bytes) -> None:
        """Take note of a line whose acknowledgement did not come, and that went out as *wire*."""
        if not is_frame(wire):
            return
        if is_motion_frame(wire):
            self.motion_was_lost(text)
        else:
            self._give_up(text)
            self._unsure[_word(text)] = text

    # Settings -------------------------------------------------------------------------------------------------------

    @property
    def speed_is_unknown(self) -> bool:
        """Whether the SPEED in force may be one that nobody has said, and there is none to be said again."""
        return self._unsure.get(_SPEED, "") is None

    async def say_settings(self, lines: Iterable[str]) -> None:
        """
        Say SPEED and ramps, each until the drive has acknowledged it.

        Those that are in doubt go first, as text where binary has left them so, unless *lines* say them anew: twice
        they do no harm.

        Raises:
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: One was not taken.
        """
        wanted = {_word(text): text for text in lines}
        for word, left in list(self._unsure.items()):
            if left is not None and word not in wanted:
                await self._say_again(word, left)
        for word, text in wanted.items():
            try:
                await self._line.command(text, Lane.MOTION)
            except AnswerTimeoutError:
                if self._unsure.get(word) != text:
                    raise
                await self._say_again(word, text)

    async def _say_again(self, word: str, text: str) -> None:
        try:
            await self._line.command(text, Lane.MOTION)
        except CommandRejectedError:
            # What is in force instead nobody knows; a speed is wanted of the next move.
            del self._unsure[word]
            if word == _SPEED:
                self._unsure[word] = None
            raise


def _word(text: str) -> str:
    """Return the short word of a setting; of anything else nothing."""
    found = _SETTING.match(text.replace(" ", ""))
    return _SHORT.get(found[1], found[1]) if found else ""
