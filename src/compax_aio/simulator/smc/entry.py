"""How commands are entered: on a terminal, on a party line, and in a ring whose names are dealt out."""

from __future__ import annotations

from enum import Enum, auto
from typing import Final, Protocol

from compax_aio.smc.facts import BACKSPACE, CARRIAGE_RETURN, ESCAPE, LINE_FEED, NOT_A_NAME, SPACE, Mode

from .knobs import Knobs

__all__ = ["DaisyEntry", "Desk", "Entry", "PartyEntry", "SingleEntry", "entry_of"]

_BEEP: Final = 0x07
_ERASE: Final = b"\b \b"


class Desk(Protocol):
    """Who has commands entered."""

    @property
    def name(self) -> str:
        """The character that addresses this axis."""

    def take_name(self, name: str) -> None:
        """Have that name from now on."""

    def echo(self, byte: int) -> None:
        """Send a character back, or on to the next one in the ring."""

    def say(self, data: bytes) -> None:
        """Send something else."""

    def entered(self, text: str) -> None:
        """Take a whole command; the one who enters sends nothing before it is answered."""


class _Buffer:
    """The characters of a command, and what is said to each."""

    def __init__(self, desk: Desk, knobs: Knobs) -> None:
        self._desk = desk
        self._knobs = knobs
        self.text = bytearray()

    def add(self, byte: int) -> bool:
        """Take a character and echo it; false: it was one too many, and ends the command unexecuted."""
        if len(self.text) < self._knobs.command_length:
            self.text.append(byte)
            self._desk.echo(byte)
        elif self._knobs.overlong == "abort":
            return False
        else:
            self._desk.echo(_BEEP if self._knobs.overlong == "beep" else byte)
        return True

    def take(self) -> str:
        """Return what was entered, and begin anew."""
        text = self.text.decode("latin-1")
        self.text.clear()
        return text


class _Place(Enum):
    """Where on a party line an axis is."""

    WAITING = auto()
    """For LF, and has heard nothing since it began anew."""
    BEHIND_LF = auto()
    """The next character may be its name (AMS p. 25, rule 1)."""
    IN_COMMAND = auto()
    """It has been named."""
    IN_ANOTHER = auto()
    """Something else has been named, and LF will end that."""


class PartyEntry:
    """Commands on a bus where every axis hears everything and only the one that was named is heard (AMS p. 25)."""

    is_naming = False
    """Whether the next character becomes the name, whatever it is."""
    relays = False
    """Whether what is not meant for this axis is passed on."""

    def __init__(self, desk: Desk, knobs: Knobs) -> None:
        self._desk = desk
        self._echoes_lf = knobs.echo_leading_lf
        self._buffer = _Buffer(desk, knobs)
        self._place = _Place.WAITING

    def take(self, byte: int) -> None:
        """Take a character."""
        if self._place is _Place.IN_COMMAND:
            self._go_on(byte)
        elif self._place is _Place.BEHIND_LF and byte == ord(self._desk.name) and byte != LINE_FEED:
            self._place = _Place.IN_COMMAND
            self._desk.echo(byte)
        else:
            self.pass_by(byte)

    def pass_by(self, byte: int) -> None:
        """Take a character that is not meant for this axis."""
        leads = byte == LINE_FEED and self._place is not _Place.IN_ANOTHER
        if self.relays or (leads and self._echoes_lf):
            self._desk.echo(byte)
        self._place = _Place.BEHIND_LF if byte == LINE_FEED else _Place.IN_ANOTHER

    def clear(self) -> None:
        """Forget what was entered, and wait for LF."""
        self._buffer.take()
        self._place = _Place.WAITING

    def _go_on(self, byte: int) -> None:
        if byte == LINE_FEED:
            self._place = _Place.BEHIND_LF
            self._desk.entered(self._buffer.take())
        elif not self._buffer.add(byte):
            self.clear()


class DaisyEntry(PartyEntry):
    """Commands in a ring: names are dealt out first (DCB p. 24), and what is not meant for this axis is passed on."""

    relays = True

    def __init__(self, desk: Desk, knobs: Knobs) -> None:
        super().__init__(desk, knobs)
        self._named = False

    def take(self, byte: int) -> None:
        """Take a character; the one behind the first LF becomes the name, and the next axis is offered the next one."""
        if self._named:
            super().take(byte)
        elif byte == LINE_FEED:
            self._place = _Place.BEHIND_LF
        elif self._place is _Place.BEHIND_LF and chr(byte) not in NOT_A_NAME:
            self._named = True
            self._place = _Place.WAITING
            self._desk.take_name(chr(byte))
            self._desk.say(bytes([LINE_FEED, _name_behind(byte)]))


class SingleEntry:
    """Commands of somebody at a terminal (DCB p. 20, 23, 27)."""

    relays = False

    def __init__(self, desk: Desk, knobs: Knobs) -> None:
        self._desk = desk
        self._sign_on = knobs.sign_on_text.encode("ascii")
        self._erase = _ERASE if knobs.backspace == "erase" else _ERASE[:1]
        self._buffer = _Buffer(desk, knobs)
        self._signed_on = False
        self.is_naming = True

    def take(self, byte: int) -> None:
        """Take a character; the first one is a name, unless it is SPACE (DCB p. 23)."""
        if self._signed_on:
            self._edit(byte)
        elif byte == SPACE:
            self.is_naming = False
            self._signed_on = True
            self._desk.echo(byte)
            self._desk.say(self._sign_on)
        elif self.is_naming:
            self.is_naming = False
            self._desk.take_name(chr(byte))
            self._desk.echo(byte)

    def pass_by(self, byte: int) -> None:
        """Take no notice of a character."""

    def clear(self) -> None:
        """Forget what was entered."""
        self._buffer.take()

    def _edit(self, byte: int) -> None:
        if byte == CARRIAGE_RETURN:
            self._desk.entered(self._buffer.take())
        elif byte == BACKSPACE:
            if self._buffer.text:
                self._buffer.text.pop()
                self._desk.say(self._erase)
        elif byte != LINE_FEED and not self._buffer.add(byte):
            self.clear()


Entry = PartyEntry | SingleEntry


def entry_of(mode: Mode, desk: Desk, knobs: Knobs) -> Entry:
    """Return how commands are entered in a mode."""
    if mode is Mode.SINGLE:
        return SingleEntry(desk, knobs)
    return (DaisyEntry if mode is Mode.DAISY else PartyEntry)(desk, knobs)


def _name_behind(byte: int) -> int:
    """Return the name that the next axis is offered: the next character that can be one."""
    byte = (byte + 1) % 256
    while byte == ESCAPE or chr(byte) in NOT_A_NAME:
        byte += 1
    return byte
