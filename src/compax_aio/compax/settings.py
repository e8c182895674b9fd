"""What a user may know, or want, about one drive: time-outs, decimals, and how it words what manuals leave open."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from numbers import Real
from pathlib import Path
from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .bounded_pattern import expect_bounded_pattern
from .facts.limits import MAX_SPEED_PERCENT, POSITION_DECIMALS, POSITION_DECIMALS_INCH
from .facts.line import ERROR_PATTERN
from .facts.serial_interface import ERRORS_SUPPRESSED_BIT, XONXOFF_BIT
from .plain_line import check_line
from .protocol import MessageForm

__all__ = ["AxisUnit", "Dialect", "DriveSettings"]


_PLACES: Final[Mapping[str, Mapping[str, object]]] = {
    "write_value": {"name": "P250", "value": "-9999999.999999"},
    "record": {"n": 250, "text": "END"},
    "set_pointer": {"n": 250},
    "single_record": {"n": 250},
    "change_speed": {"percent": 100},
}
"""What a word has places for, with an example of the longest."""
_LONGEST_WORD: Final = 100
"""Characters of a word with its places; what is sent has at most 30."""
_WIDE_PLACE: Final = re.compile(r"\{[^}]*[0-9]{3}")
"""A place may be made as wide as a number says: ``{n:999999999}``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """
    The words of commands whose RS-232 form stands on no page that was available.

    The defaults are the words that manuals use for the functions (UG p. 101, 158, 162; CAN p. 32, 69; CAN-S p. 28);
    change them, if your drive says otherwise, without changing code. Those that are None have no word that is known:
    what needs them is refused until you give one.
    """

    stop: str = "STOP"
    start: str = "START"
    break_off: str = "BREAK"
    """Ends program and positioning, so that START does not continue them."""
    quit: str = "QUIT"
    home: str = "PH"
    make_valid: str = "VP"
    write_value: str = "{name}={value}"
    """How a parameter or variable is written: documented for the fieldbus (IBS p. 23)."""
    record: str = "N{n:03d}: {text}"
    """How a record is written: by the style of the listings (UG p. 95)."""
    set_pointer: str = "GOTO {n}"
    """Lets START begin at record n: the function is in CAN p. 69, the word is that of the PLC interface (UG p. 158)."""
    single_record: str | None = None
    """Runs record n alone, with ``{n}``; the function exists (CAN p. 69)."""
    real_zero: str | None = None
    """Takes the actual position as real zero; the function exists (CAN p. 32)."""
    change_speed: str = "PR0 SD{percent}"
    """Another speed for the positioning that runs: by the name of the fieldbus object (IBS p. 42)."""
    power_on: str = "OT O0=0"
    """Drive energised. Which number does what is inferred from the order of the functions (CAN p. 32, UG p. 209)."""
    power_off: str = "OT O0=1"
    """No current, brake closed."""
    power_off_brake_open: str = "OT O0=2"
    """No current, brake open: a hanging load falls."""

    @property
    def motions(self) -> tuple[str, ...]:
        """The words that set the axis in motion, or a program that may."""
        return tuple(word for word in (self.home, self.start, self.single_record) if word)

    def __post_init__(self) -> None:
        """Refuse what cannot be sent."""
        for each in fields(self):
            word, places = getattr(self, each.name), _PLACES.get(each.name, {})
            if word is None and each.default is None:
                continue
            if not isinstance(word, str):
                raise InvalidCommandError(f"the word for {each.name} is a text, not {word!r}")
            if word != word.strip() or len(word) > _LONGEST_WORD or _WIDE_PLACE.search(word):
                raise InvalidCommandError(
                    f"the word for {each.name} is longer than what can be sent, or has blanks around it: {shown(word)}"
                )
            try:
                check_line(word.format(**places))
            except (AttributeError, LookupError, TypeError, ValueError) as error:
                wanted = ", ".join(f"{{{place}}}" for place in places) or "none"
                why = f"it has no place {error}" if isinstance(error, LookupError) else error
                raise InvalidCommandError(
                    f"the word for {each.name} cannot be {word!r}: {why}", hint=f"places it may have: {wanted}"
                ) from error
            if missing := [place for place in places if f"{{{place}" not in word]:
                raise InvalidCommandError(f"the word for {each.name} must hold {{{missing[0]}}}, unlike {word!r}")


@dataclass(frozen=True, slots=True)
class AxisUnit:
    """What one value of P90 means: the unit of positions and their decimals, 2 or 3 (UG p. 100-101)."""

    name: str
    decimals: int = POSITION_DECIMALS


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings:
    """
    How to talk to one drive.

    Attributes:
        answer_timeout_s: How long an answer may take before the line is in doubt and is brought back in step.
        resync_attempts: How many status queries are tried to get back in step before the drive counts as silent.
        reconnect: Open a line that was lost, or that keeps silent, again; moves under way survive that.
        reconnect_first_s: The first attempt comes so soon at most, each later one after twice the time …
        reconnect_slowest_s: … up to this; a random part of it, so that many lines are not tried all at once.
        reconnect_attempts: How often a lost line is tried; None: until it is back.
        unit: Name of the unit chosen with P90, for people; the drive does not send it.
        decimals: Of positions and distances: 2, or 3 where the unit is inches (UG p. 100).
        units: What the values of P90 mean on this drive, for :meth:`Drive.read_axis`; no page at hand says it.
        travel: Lowest and highest position that may be commanded; None: whatever a number can say.
        speed_limit_percent: Speeds above are refused. The drive takes up to 600 (IBS p. 42), few axes do.
        message_form: What the drive answers to a command with ``$``; UNKNOWN lets the first move find out.
        error_pattern: Regular expression that finds an error in an answer; its one group is the code. The form of error
            replies stands on no page at hand.
        xonxoff_weight: What P20 holds when Xon and Xoff are heeded; inferred from its documented values 3 and 19.
        errors_suppressed_weight: And when the drive keeps quiet about errors.
        verify_messages: Ask the status before ``$`` is believed: for drives that send it after a stop or fault too.
        message_when_prepared: Ask for ``$`` also when a move is prepared with ``,``; whether a drive takes both signs
            on one line is not documented.
        binary_settings: Send SPEED and ACCEL in binary where P20 allows it (UG p. 166).
        binary_motion: Send POSA and POSR so, too. A frame that loses a byte swallows what comes next and may become a
            move to another target: only for lines that cannot lose bytes. Needs *binary_settings*.
        poll_first_s: A pending move's status is asked for the first time after this, then ever more rarely …
        poll_slowest_s: … down to one look in this many seconds.
        stall_timeout_s: A move whose axis stands still for so long, while its command is active, has failed.
        in_doubt_after_s: A pending move of which nothing can be learnt for so long is in doubt; what asks the drive
            something waits for a lost line as long.
        stop_timeout_s: How long STOP is repeated until it is acknowledged.
        standstill_timeout_s: How long an acknowledged STOP may take to bring the axis to a standstill.
        dialect: Words that may differ.
    """

    answer_timeout_s: float = 1.0
    resync_attempts: int = 3
    reconnect: bool = True
    reconnect_first_s: float = 0.2
    reconnect_slowest_s: float = 5.0
    reconnect_attempts: int | None = None
    unit: str = "units"
    decimals: int = POSITION_DECIMALS
    units: Mapping[int, AxisUnit] = field(default_factory=dict)
    travel: tuple[float, float] | None = None
    speed_limit_percent: float = 100.0
    message_form: MessageForm = MessageForm.UNKNOWN
    error_pattern: str = ERROR_PATTERN
    xonxoff_weight: int = XONXOFF_BIT.weight
    errors_suppressed_weight: int = ERRORS_SUPPRESSED_BIT.weight
    verify_messages: bool = False
    message_when_prepared: bool = False
    binary_settings: bool = False
    binary_motion: bool = False
    poll_first_s: float = 0.1
    poll_slowest_s: float = 0.5
    stall_timeout_s: float = 10.0
    in_doubt_after_s: float = 30.0
    stop_timeout_s: float = 10.0
    standstill_timeout_s: float = 10.0
    dialect: Dialect = field(default_factory=Dialect)

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        for each in fields(self):
            value = getattr(self, each.name)
            if not _is_of_kind(each.name, value, each.default):
                raise InvalidCommandError(f"{each.name} cannot be {value!r}", hint=_KINDS.get(each.name))
            if each.name.endswith("_s") and not (isfinite(value) and value > 0):
                raise InvalidCommandError(f"{each.name} must be a finite number of seconds above 0, not {value!r}")
        for decimals in (self.decimals, *(unit.decimals for unit in self.units.values())):
            if type(decimals) is not int or decimals not in (POSITION_DECIMALS, POSITION_DECIMALS_INCH):
                raise InvalidCommandError(f"decimals must be 2, or 3 for inches, not {decimals!r}")
        if self.travel is not None and not (
            len(self.travel) == 2 and all(map(isfinite, self.travel)) and self.travel[0] < self.travel[1]
        ):
            raise InvalidCommandError(f"travel is a lowest and a highest position, not {self.travel!r}")
        if self.binary_motion and not self.binary_settings:
            raise InvalidCommandError("binary_motion needs binary_settings as well: it is the second opt-in")
        if not 0 < self.speed_limit_percent <= MAX_SPEED_PERCENT:
            raise InvalidCommandError(
                f"speed_limit_percent must be above 0 and at most {MAX_SPEED_PERCENT:g}, "
                f"not {self.speed_limit_percent!r}"
            )
        _check_error_pattern(self.error_pattern)
        _check_attempts("resync_attempts", self.resync_attempts)
        if self.reconnect_attempts is not None:
            _check_attempts("reconnect_attempts", self.reconnect_attempts)

    @classmethod
    def load(cls, path: str | Path) -> DriveSettings:
        """
        Read the settings of a drive from a TOML file; what it does not say has its default.

        Raises:
            InvalidCommandError: It is no TOML, or has a key or value that cannot be meant; says which.
            OSError: It cannot be read.
        """
        from .settings_file import read_settings  # noqa: PLC0415 - which knows this class

        return read_settings(path)

    def save(self, path: str | Path) -> None:
        """
        Write all settings to *path* with what they mean; the file is replaced whole, or left as it was.

        Raises:
            OSError: It cannot be written.
        """
        from .settings_file import write_settings  # noqa: PLC0415 - which knows this class

        write_settings(path, self)


_KINDS: Final = {
    "dialect": "it is a Dialect(...)",
    "message_form": "it is a MessageForm",
    "travel": "it is a lowest and a highest position, (-10, 500), or None",
    "units": "by value of P90: {1: AxisUnit('mm')}",
}


def _is_of_kind(name: str, value: object, default: object) -> bool:
    """Whether a setting is of the kind that it must be: a wrong word for STOP must not be found when it is wanted."""
    if name == "units":
        return isinstance(value, Mapping) and all(
            type(code) is int and isinstance(unit, AxisUnit) for code, unit in value.items()
        )
    if name == "reconnect_attempts":
        return value is None or _is_number(value)
    if name == "travel":
        return value is None or (isinstance(value, tuple | list) and all(map(_is_number, value)))
    if name == "dialect":
        return isinstance(value, Dialect)
    return _is_number(value) if isinstance(default, float) else isinstance(value, type(default)) or name == "decimals"


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _check_attempts(name: str, attempts: object) -> None:
    if type(attempts) is not int or attempts < 1:
        raise InvalidCommandError(f"{name} must be a whole number and at least 1, not {attempts!r}")


def _check_error_pattern(pattern: str) -> None:
    if isinstance(pattern, str):
        expect_bounded_pattern(pattern)
    try:
        groups = re.compile(pattern).groups
    except (re.error, TypeError) as error:
        raise InvalidCommandError(f"error_pattern is no regular expression: {error}") from error
    if groups != 1:
        raise InvalidCommandError(f"error_pattern has one group, for the code, not {groups}")
