"""The memory of a simulated control: programs, parameters, settings, offsets, macro variables."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, nan
from typing import Final

from compax_aio.haas.facts.data_files import DataKind
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.facts.port_settings import (
    ADD_SPACES,
    BAUD_RATE,
    BAUD_RATES,
    DATA_BITS,
    DATA_COLLECTION,
    DATA_ECHO,
    END_OF_BLOCK,
    LEADER_TO_PUNCH,
    PARITY,
    STOP_BITS,
    SYNCHRONIZATION,
    Parity,
    Synchronization,
)

from .knobs import Knobs
from .presses import program_number

__all__ = ["Memory", "name_of"]

_PROBE_PROGRAM: Final = "O09810\n(PROBE, PROTECTED MOVE)\nG65 P9832\nM99"
_SMALL_PROGRAM: Final = (
    "O01234\n(FACE)\nG90 G54 G00 X0. Y0.\nG43 H01 Z1.\nS1500 M03\nG01 Z-0.1 F20.\nX4.\nG00 Z1. M05\nM30"
)
_TAIL: Final = ("G00 Z1. M05", "M30")
_PARAMETERS: Final = 60
_TOOLS: Final = 20
_MACROS: Final = (*range(1, 34), *range(100, 200), *range(500, 700))
_STORABLE_MACROS: Final = frozenset({*range(1, 34), *range(100, 200), *range(500, 1000), *range(10_000, 11_000)})


class Memory:
    """
    What is stored, without power too.

    Args:
        knobs: What is stored at first.

    Attributes:
        programs: Text of each program by its name with five digits, blocks separated by LF, the first one its name.
        parameters: V values by number, as text.
        settings: The same; those that the port goes by hold the place of the value in its list, from 0 on, which is
            our own: how the control numbers them is not known.
        offsets: The same.
        macros: Values of variables by number; NaN: empty.
    """

    def __init__(self, knobs: Knobs) -> None:
        self.programs: dict[str, str] = {
            name_of(10): _sample(knobs.program_blocks),
            name_of(1234): _SMALL_PROGRAM,
            name_of(9810): _PROBE_PROGRAM,
        }
        self.parameters: dict[int, str] = {number: str(number * 7919 % 100_003) for number in range(1, _PARAMETERS + 1)}
        self.settings = {**dict.fromkeys(range(1, 61), "0"), **_port_settings(knobs)}
        self.offsets = {number: f"{number * 0.0125:.4f}" for number in range(1, _TOOLS + 1)}
        self.macros: dict[int, float] = {**dict.fromkeys(_MACROS, nan), 100: 0.0, 101: 12.5, 500: 1.0}

    def stored_name(self, name: str) -> str | None:
        """Return under which name a program is stored, however it is written; None: there is none."""
        number = program_number(name)
        return name_of(number) if number is not None and name_of(number) in self.programs else None

    @property
    def used_bytes(self) -> int:
        """What the programs take."""
        return sum(len(text) for text in self.programs.values())

    def table(self, kind: DataKind) -> Mapping[int, str]:
        """Return numbers and V values of one kind; variables that are empty have none."""
        match kind:
            case DataKind.PARAMETERS:
                return self.parameters
            case DataKind.SETTINGS:
                return self.settings
            case DataKind.OFFSETS:
                return self.offsets
            case DataKind.MACROS:
                return {number: f"{value:.4f}" for number, value in sorted(self.macros.items()) if isfinite(value)}

    def has_place(self, kind: DataKind, number: int) -> bool:
        """Whether there is such a number."""
        if kind is DataKind.MACROS:
            return number in self.macros or number in _STORABLE_MACROS
        return number in self.table(kind)

    def put(self, kind: DataKind, number: int, value: str) -> None:
        """Store a V value."""
        match kind:
            case DataKind.PARAMETERS:
                self.parameters[number] = value
            case DataKind.SETTINGS:
                self.settings[number] = value
            case DataKind.OFFSETS:
                self.offsets[number] = value
            case DataKind.MACROS:
                self.macros[number] = float(value)

    def can_write(self, number: int) -> bool:
        """Whether a host can write that variable."""
        return number in _STORABLE_MACROS

    # Settings that are on or off take effect when they are loaded; 1 is on (inferred).

    def is_on(self, number: int, otherwise: bool) -> bool:
        """Whether a setting is on."""
        try:
            return float(self.settings[number]) != 0
        except (KeyError, ValueError):
            return otherwise


def name_of(number: int, digits: int = 5) -> str:
    """Return the name of a program."""
    return f"O{number:0{digits}d}"


def _sample(blocks: int) -> str:
    """Return a program of so many blocks, besides its name."""
    moves = (f"X{n % 90 / 10:.1f} Y{n * 7 % 60 / 10:.1f}" for n in range(1, blocks))
    lines = ["(POCKET)", "G90 G54 G00 X0. Y0.", "S3000 M03", "G01 Z-0.05 F15.", *moves][: max(0, blocks - len(_TAIL))]
    return "\n".join([name_of(10), *lines, *_TAIL[-blocks:]])


def _port_settings(knobs: Knobs) -> dict[int, str]:
    places = {
        BAUD_RATE: BAUD_RATES.index(knobs.baudrate or 9600),
        PARITY: list(Parity).index(knobs.parity_bit),
        STOP_BITS: knobs.stop_bit_count - 1,
        SYNCHRONIZATION: list(Synchronization).index(knobs.mode),
        LEADER_TO_PUNCH: ("none", "blank", "nul").index(knobs.leader),
        END_OF_BLOCK: list(EobPattern).index(knobs.eob_pattern),
        DATA_BITS: knobs.bits - 7,
        ADD_SPACES: int(knobs.spaces),
        DATA_COLLECTION: int(knobs.collection != "off"),
        DATA_ECHO: int(knobs.echoes),
    }
    return {number: str(place) for number, place in places.items()}
