"""RFC 2217 without I/O: telnet, and the settings of the serial port at its other end."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Final, TypeVar

from .layered import Layer
from .line_settings import LineSettings

__all__ = ["Rfc2217Layer"]

_T = TypeVar("_T")

_IAC, _DONT, _DO, _WONT, _WILL, _SB, _SE = 255, 254, 253, 252, 251, 250, 240
_BINARY, _SUPPRESS_GO_AHEAD, _COM_PORT = 0, 3, 44
_WANTED: Final = frozenset({_BINARY, _SUPPRESS_GO_AHEAD, _COM_PORT})

# What we offer and ask for at the beginning. Servers that begin themselves take these as answers.
_GREETING: Final = (
    (_WILL, _COM_PORT),
    (_WILL, _BINARY),
    (_DO, _BINARY),
    (_WILL, _SUPPRESS_GO_AHEAD),
    (_DO, _SUPPRESS_GO_AHEAD),
)

# Commands of RFC 2217, section 3; a server answers with the same number plus 100.
_SET_BAUDRATE, _SET_DATASIZE, _SET_PARITY, _SET_STOPSIZE, _SET_CONTROL = 1, 2, 3, 4, 5
_SET_LINESTATE_MASK, _SET_MODEMSTATE_MASK = 10, 11
_FROM_SERVER: Final = 100
_SUSPEND, _RESUME = 108, 109

_PARITIES: Final[Mapping[int, str]] = MappingProxyType({1: "N", 2: "O", 3: "E", 4: "M", 5: "S"})
_STOPSIZES: Final[Mapping[int, float]] = MappingProxyType({1: 1, 2: 2, 3: 1.5})
_HANDSHAKES: Final[Mapping[int, str]] = MappingProxyType({1: "none", 2: "xonxoff", 3: "rtscts"})

# The longest that means anything to us is a baud rate of 4 bytes; one server appends another 4.
_LONGEST_SUBNEGOTIATION: Final = 32
_HEARD_BYTES: Final = 80


class _Reading(IntEnum):
    """Where in the grammar of telnet the next byte stands."""

    DATA = 0
    COMMAND = 1
    OPTION = 2
    SUBNEGOTIATION = 3
    COMMAND_IN_SUBNEGOTIATION = 4


class Rfc2217Layer(Layer):
    """
    The client's side of one RFC 2217 connection.

    It is ready when the server has acknowledged every setting. Until then what comes from the serial port is
    discarded, as opening a port of this computer does: it came at settings that are nobody's.

    Attributes:
        is_telnet: Whether the far end has said anything that belongs to telnet.
        has_agreed: Whether the server lets us set the port.
        heard: The first bytes of what was discarded: what a server says when it hangs up at once.
    """

    def __init__(self, settings: LineSettings) -> None:
        self.is_telnet = False
        self.has_agreed = False
        self.heard = bytearray()
        self._commands = _commands_for(settings)
        self._unacknowledged = dict(self._commands)
        self._to_send = bytearray()
        self._state = _Reading.DATA
        self._verb = 0
        self._subnegotiation = bytearray()
        # Every pair of verb and option that was said: none is said twice, or two ends might thank each other for ever.
        self._said: set[tuple[int, int]] = set()
        self._is_suspended = False
        self._held = bytearray()
        for verb, option in _GREETING:
            self._say(verb, option)

    @property
    def unacknowledged(self) -> str:
        """Which settings the server has not acknowledged yet, readable; empty if none."""
        return ", ".join(_readable(command, value) for command, value in self._unacknowledged.items())

    def may_do_without(self) -> bool:
        """Be ready without the acknowledgements that are still missing: not every server sends them all."""
        self.is_ready = self.has_agreed
        return self.is_ready

    # --- to the server

    def encode(self, data: bytes | bytearray | memoryview) -> bytes:
        """Return *data* with every 255 doubled; while the server wants none, keep it."""
        escaped = bytes(data).replace(b"\xff", b"\xff\xff")
        if not self._is_suspended:
            return escaped
        self._held += escaped
        return b""

    @property
    def held_bytes(self) -> int:
        """How many bytes wait for the server to want them."""
        return len(self._held)

    def bytes_to_send(self) -> bytes:
        """Return what is to be said in telnet, and what was held and may go now."""
        data = bytes(self._to_send)
        self._to_send.clear()
        if not self._is_suspended:
            data += self._held
            self._held.clear()
        return data

    def farewell(self) -> bytes:
        """Return what is held: the line closes, and the last line of all may be a stop."""
        self._is_suspended = False
        return self.bytes_to_send()

    def _say(self, verb: int, option: int) -> None:
        if (verb, option) not in self._said:
            self._said.add((verb, option))
            self._to_send += bytes([_IAC, verb, option])

    def _command(self, command: int, value: bytes) -> None:
        escaped = value.replace(b"\xff", b"\xff\xff")
        self._to_send += bytes([_IAC, _SB, _COM_PORT, command]) + escaped + bytes([_IAC, _SE])

    # --- from the server

    def receive(self, data: bytes) -> bytes:
        """Return what of *data* came from the serial port; ConnectionRefusedError if the server refuses a setting."""
        received = bytearray()
        at = 0
        while at < len(data):
            if self._state is _Reading.DATA:
                # Nearly all of it is data: as far as the next command in one go.
                end = data.find(_IAC, at)
                end = len(data) if end < 0 else end
                if self.is_ready:
                    received += data[at:end]
                else:
                    self.heard += data[at:end][: _HEARD_BYTES - len(self.heard)]
                at = end + 1
                if end < len(data):
                    self._state = _Reading.COMMAND
            else:
                received += self._take(data[at])
                at += 1
        return bytes(received)

    def _take(self, byte: int) -> bytes:
        """Take one byte that is not data, and return the data byte that it stands for, if it does."""
        state, self._state = self._state, _Reading.DATA
        match state:
            case _Reading.OPTION:
                self._negotiate(self._verb, byte)
            case _Reading.SUBNEGOTIATION:
                if byte == _IAC:
                    self._state = _Reading.COMMAND_IN_SUBNEGOTIATION
                else:
                    self._keep(byte)
            case _Reading.COMMAND_IN_SUBNEGOTIATION if byte == _IAC:
                self._keep(byte)
            case _Reading.COMMAND_IN_SUBNEGOTIATION if byte == _SE:
                self._subnegotiated(bytes(self._subnegotiation))
            case _ if byte == _IAC:
                return b"\xff" if self.is_ready else b""
            case _:  # a command, also where a subnegotiation was never ended: that one is dropped
                self._take_command(byte)
        return b""

    def _take_command(self, byte: int) -> None:
        if byte == _SB:
            self._subnegotiation.clear()
            self._state = _Reading.SUBNEGOTIATION
        elif byte in {_WILL, _WONT, _DO, _DONT}:
            self._verb = byte
            self._state = _Reading.OPTION

    def _keep(self, byte: int) -> None:
        self._state = _Reading.SUBNEGOTIATION
        if len(self._subnegotiation) < _LONGEST_SUBNEGOTIATION:
            self._subnegotiation.append(byte)

    def _negotiate(self, verb: int, option: int) -> None:
        self.is_telnet = True
        if verb == _WILL:
            self._say(_DO if option in _WANTED else _DONT, option)
        elif verb == _DO:
            self._say(_WILL if option in _WANTED else _WONT, option)
        # Some servers agree to our WILL, others offer it themselves and are content with our DO.
        if option == _COM_PORT and verb in {_WILL, _DO}:
            self._agreed()
        elif option == _COM_PORT and verb == _DONT and not self.has_agreed:
            raise ConnectionRefusedError("it does not let anybody set its serial port")
        elif option == _BINARY and verb in {_WONT, _DONT} and not self.is_ready:
            raise ConnectionRefusedError("it does not pass all 256 bytes unchanged: it refused BINARY")

    def _agreed(self) -> None:
        if not self.has_agreed:
            self.has_agreed = True
            for command, value in self._commands.items():
                self._command(command, value)
            # Nobody here wants to hear about the modem lines; no server needs to acknowledge that.
            self._command(_SET_LINESTATE_MASK, b"\x00")
            self._command(_SET_MODEMSTATE_MASK, b"\x00")

    def _subnegotiated(self, content: bytes) -> None:
        if len(content) < 2 or content[0] != _COM_PORT:
            return
        command, value = content[1], content[2:]
        if command in {_SUSPEND, _RESUME}:
            self._is_suspended = command == _SUSPEND
        elif (asked := self._unacknowledged.get(command - _FROM_SERVER)) is not None:
            answered = value[: len(asked)]
            if answered != asked:
                raise ConnectionRefusedError(
                    f"it was asked for {_readable(command - _FROM_SERVER, asked)}, "
                    f"and has {_readable(command - _FROM_SERVER, answered)}"
                )
            del self._unacknowledged[command - _FROM_SERVER]
            self.is_ready = self.is_ready or not self._unacknowledged


def _commands_for(settings: LineSettings) -> dict[int, bytes]:
    return {
        _SET_BAUDRATE: settings.baudrate.to_bytes(4),
        _SET_DATASIZE: bytes([settings.bytesize]),
        _SET_PARITY: bytes([_key(_PARITIES, settings.parity)]),
        _SET_STOPSIZE: bytes([_key(_STOPSIZES, settings.stopbits)]),
        _SET_CONTROL: bytes([_key(_HANDSHAKES, settings.handshake)]),
    }


def _key(table: Mapping[int, _T], value: _T) -> int:
    return next(number for number, each in table.items() if each == value)


def _readable(command: int, value: bytes) -> str:
    number = int.from_bytes(value)
    match command:
        case 1:
            return f"baudrate={number}"
        case 2:
            return f"bytesize={number}"
        case 3:
            return f"parity={_PARITIES.get(number, number)}"
        case 4:
            return f"stopbits={_STOPSIZES.get(number, number)}"
        case _:
            return f"handshake={_HANDSHAKES.get(number, number)}"
