"""How one control is set up, as data that a user can change: its settings of the port, and how it is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Final, Literal, get_args

from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.eob import EobPattern
from .facts.port_settings import BAUD_RATES
from .facts.programs import PROTECTED_PROGRAMS

__all__ = [
    "CLASSIC",
    "CLASSIC_DC_CODES",
    "CLASSIC_RTS_CTS",
    "CLASSIC_XMODEM",
    "DATA_COLLECTION",
    "DATA_COLLECTION_19200",
    "DATA_COLLECTION_115200",
    "NEXT_GENERATION",
    "PROFILES",
    "DataCollection",
    "EndOfBlock",
    "Parity",
    "ParityIn",
    "Profile",
    "Synchronization",
    "profile_named",
]

Synchronization = Literal["rts/cts", "xon/xoff", "dc codes", "xmodem"]
"""What keeps sender and receiver together (Setting 14)."""
Parity = Literal["none", "zero", "even", "odd"]
"""Setting 12; ``zero`` is a parity bit that is always 0."""
EndOfBlock = Literal["cr lf", "lf", "cr", "cr cr", "lf lf"]
"""What is sent at the end of each block (Setting 25)."""
DataCollection = Literal["rs-232", "ethernet"]
"""Where the control answers questions (Setting 143)."""
ParityIn = Literal["port", "bytes"]
"""Who makes and checks the parity bit: the serial port, or this end, in the bytes themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """
    One way to set up a control; ``dataclasses.replace()`` makes another. Nothing asks for its name.

    None stands for what is not known and stays so: a line is opened as its URL says, and what cannot be done without
    it is refused. The settings are those of the control's SETTING page; both ends must agree on them.

    Attributes:
        name: For people.
        baudrate: Setting 11.
        parity: Setting 12.
        stop_bits: Setting 13.
        synchronization: Setting 14; None: no files go over this line.
        sends_xon: Whether with Xon/Xoff the control sends Xon when RECV is pressed: it is waited for then. With DC
            codes and XMODEM it says by itself when it is ready; otherwise nobody does, and the operator is asked.
        eob: Setting 25; what this end sends. What comes may end its blocks in any way.
        data_bits: Setting 37.
        add_spaces: Setting 41: whether words of a block come with spaces between them.
        o_digits: How many a program's name is written with: 5, or 4 on controls of the 1990s.
        data_collection: Setting 143: where the control answers questions; None: it does not.
        echo: Setting 187: whether it sends back what it is asked; None: either is taken.
        request_prefix: In front of a question: nothing, or ``?``.
        request_end: Behind it.
        parity_in: Whether the serial port makes the parity bit (``"port"``), or this end puts it into the bytes and
            checks it there (``"bytes"``): the port is opened with 8 data bits and no parity then, and damage is found
            at its exact place over any line.
        protected: Programs that are not overwritten without being asked for (``protected=True``): first and last.
        remarks: For people.
    """

    name: str
    baudrate: int | None = None
    parity: Parity | None = None
    stop_bits: int | None = None
    synchronization: Synchronization | None = None
    sends_xon: bool = False
    eob: EndOfBlock = "cr lf"
    data_bits: int | None = None
    add_spaces: bool | None = None
    o_digits: int = 5
    data_collection: DataCollection | None = "rs-232"
    echo: bool | None = None
    request_prefix: str = ""
    request_end: str = "\r\n"
    parity_in: ParityIn = "port"
    protected: tuple[tuple[int, int], ...] = ((PROTECTED_PROGRAMS[0], PROTECTED_PROGRAMS[-1]),)
    remarks: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Refuse what cannot be meant, before a line is opened by it."""
        for each in fields(self):
            value, (is_meant, wanted) = getattr(self, each.name), _EXPECTED[each.name]
            if not is_meant(value):
                raise InvalidCommandError(f"{each.name} of a profile is {wanted}, not {shown(value)}")
        self._refuse_contradictions()

    def _refuse_contradictions(self) -> None:
        if self.synchronization == "xmodem" and (self.data_bits == 7 or self.parity not in (None, "none")):
            raise InvalidCommandError(
                f"XMODEM needs 8 data bits and no parity, not {self.data_bits} and {self.parity}: already its first "
                "block has a byte above 7F",
                hint="set the control to Setting 37 = 8 and Setting 12 = NONE, and the profile to the same",
            )
        if self.parity_in == "bytes" and (self.data_bits != 7 or self.parity in (None, "none")):
            raise InvalidCommandError(
                f"a parity bit in the bytes needs 7 data bits and a parity, not {self.data_bits} and {self.parity}",
                hint="give data_bits=7 and the parity (even, odd or zero) that the control has; or parity_in='port'",
            )
        if self.data_collection == "ethernet" and self.synchronization is not None:
            raise InvalidCommandError(
                "data collection over Ethernet has no synchronization (Setting 14): no files go over that connection",
                hint="connect to the serial port and to the network separately, with a profile for each",
            )

    @property
    def says_when_ready(self) -> bool:
        """Whether the control tells this end that RECV was pressed."""
        return self.synchronization in ("dc codes", "xmodem") or (self.synchronization == "xon/xoff" and self.sends_xon)

    @property
    def eob_bytes(self) -> bytes:
        """What ends a block that this end sends."""
        return EobPattern(self.eob).data

    @property
    def bits_per_character(self) -> int | None:
        """On the wire, start and stop bits included; None where that is not known."""
        if self.data_bits is None or self.parity is None or self.stop_bits is None:
            return None
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits

    def protects(self, number: int) -> bool:
        """Whether the program of that number is not to be overwritten without being asked for."""
        return any(first <= number <= last for first, last in self.protected)


# What a field may be -------------------------------------------------------------------------------------------------

_Expected = tuple[Callable[[Any], bool], str]
"""A test, and in words what passes it."""


def _is_one_of(choices: tuple[object, ...]) -> Callable[[Any], bool]:
    # A member of an enumeration of the facts is as good as its text; True is no 1.
    return lambda value: any(
        value == each and (type(value) is type(each) or isinstance(value, str)) for each in choices
    )


def _one_of(*choices: object, or_unknown: bool = True) -> _Expected:
    said = ", ".join(map(str, choices)) + (", or None where it is not known" if or_unknown else "")
    return _is_one_of((*choices, None) if or_unknown else choices), said


def _is_text(value: object) -> bool:
    return type(value) is str and value.isascii() and value.isprintable() and bool(value.strip())


def _are_spans(value: object) -> bool:
    return type(value) is tuple and all(
        type(span) is tuple and len(span) == 2 and all(type(end) is int for end in span) and 0 <= span[0] <= span[1]
        for span in value
    )


_EXPECTED: Final[Mapping[str, _Expected]] = {
    "name": (_is_text, "a printable text"),
    "baudrate": _one_of(*BAUD_RATES),
    "parity": _one_of(*get_args(Parity)),
    "stop_bits": _one_of(1, 2),
    "synchronization": _one_of(*get_args(Synchronization)),
    "sends_xon": _one_of(True, False, or_unknown=False),
    "eob": _one_of(*get_args(EndOfBlock), or_unknown=False),
    "data_bits": _one_of(7, 8),
    "add_spaces": _one_of(True, False),
    "o_digits": _one_of(4, 5, or_unknown=False),
    "data_collection": _one_of(*get_args(DataCollection)),
    "echo": _one_of(True, False),
    "request_prefix": (_is_one_of(("", "?")), "nothing or a question mark"),
    "request_end": (_is_one_of(("\r\n", "\r", "\n")), "CR LF, CR or LF"),
    "parity_in": _one_of(*get_args(ParityIn), or_unknown=False),
    "protected": (_are_spans, "pairs of a first and a last program, ((8000, 9999),)"),
    "remarks": (lambda value: type(value) is str, "a text"),
}


# Settings that were seen at work --------------------------------------------------------------------------------------

CLASSIC: Final = Profile(
    name="classic",
    baudrate=9600,
    parity="even",
    stop_bits=2,
    synchronization="xon/xoff",
    eob="cr lf",
    data_bits=7,
    add_spaces=True,
    remarks="programs over a classic control's serial port, as the vendor of a CAM system sets it up; Xon and Xoff "
    "are the most common choice",
)
CLASSIC_DC_CODES: Final = replace(
    CLASSIC,
    name="classic dc codes",
    synchronization="dc codes",
    remarks="as classic, with the start and stop codes of manual 11596-8000: the control says when it begins and ends",
)
CLASSIC_RTS_CTS: Final = replace(
    CLASSIC,
    name="classic rts/cts",
    synchronization="rts/cts",
    remarks="as classic, with the wires of the cable instead of signs; needs pins 4 and 5 in the cable",
)
CLASSIC_XMODEM: Final = Profile(
    name="classic xmodem",
    baudrate=115200,
    parity="none",
    stop_bits=1,
    synchronization="xmodem",
    eob="lf",
    data_bits=8,
    remarks="blocks of 128 bytes that are checked and repeated; seen on a VF4, a DT1 and a simulator of 2017. With "
    "another end of block than LF some controls add up wrong sums",
)
DATA_COLLECTION: Final = Profile(
    name="data collection",
    baudrate=9600,
    parity="none",
    stop_bits=1,
    synchronization="xon/xoff",
    eob="cr lf",
    data_bits=8,
    add_spaces=False,
    echo=False,
    remarks="as a gateway for shop monitoring has controls before the Next Generation set up: Setting 143 ON, 187 OFF",
)
DATA_COLLECTION_19200: Final = Profile(
    name="data collection 19200",
    baudrate=19200,
    parity="even",
    stop_bits=1,
    data_bits=7,
    remarks="as an MTConnect adapter has it; which synchronization is not known, so no files are sent",
)
DATA_COLLECTION_115200: Final = Profile(
    name="data collection 115200",
    baudrate=115200,
    parity="none",
    stop_bits=1,
    data_bits=7,
    request_prefix="?",
    remarks="as one workshop has its lathe; questions begin with a question mark there",
)
NEXT_GENERATION: Final = Profile(
    name="next generation",
    data_collection="ethernet",
    request_prefix="?",
    request_end="\n",
    remarks="data collection over Ethernet alone (Setting 143 is the number of its TCP port); it takes two "
    "connections, and every answer goes to both",
)

PROFILES: Final[Mapping[str, Profile]] = MappingProxyType(
    {
        each.name: each
        for each in (
            CLASSIC,
            CLASSIC_DC_CODES,
            CLASSIC_RTS_CTS,
            CLASSIC_XMODEM,
            DATA_COLLECTION,
            DATA_COLLECTION_19200,
            DATA_COLLECTION_115200,
            NEXT_GENERATION,
        )
    }
)
"""By name."""


def profile_named(name: str) -> Profile:
    """
    Return the profile of that name, however it is spaced and written: ``classic-xmodem``, ``CLASSIC_XMODEM``.

    Raises:
        InvalidCommandError: There is none; those that there are are told.
    """
    wanted = _letters_of(name)
    for each in PROFILES.values():
        if _letters_of(each.name) == wanted:
            return each
    raise InvalidCommandError(f"no profile {shown(name)}", hint=f"there are {', '.join(PROFILES)}")


def _letters_of(name: str) -> str:
    return "".join(filter(str.isalnum, name)).lower()
