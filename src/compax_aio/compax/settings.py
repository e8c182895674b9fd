"""What a user may know, or want, about one drive: time-outs, decimals, and how it words what manuals leave open."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import isfinite

from ..errors import InvalidCommandError
from .facts.limits import MAX_SPEED_PERCENT, POSITION_DECIMALS, POSITION_DECIMALS_INCH
from .plain_line import check_line
from .protocol import MessageForm

__all__ = ["Dialect", "DriveSettings"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """
    The words of commands whose RS-232 form stands on no page that was available.

    The defaults are the words that manuals use for the functions (UG p. 101, 162; CAN-S p. 28); change them, if your
    drive says otherwise, without changing code.
    """

    stop: str = "STOP"
    quit: str = "QUIT"
    home: str = "PH"
    make_valid: str = "VP"


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings:
    """
    How to talk to one drive.

    Attributes:
        answer_timeout_s: How long an answer may take before the line is in doubt and is brought back in step.
        resync_attempts: How many status queries are tried to get back in step before the drive counts as silent.
        unit: Name of the unit chosen with P90, for people; the drive does not send it.
        decimals: Of positions and distances: 2, or 3 where the unit is inches (UG p. 100).
        speed_limit_percent: Speeds above are refused. The drive takes up to 600 (IBS p. 42), few axes do.
        message_form: What the drive answers to a command with ``$``; UNKNOWN lets the first move find out.
        verify_messages: Ask the status before ``$`` is believed: for drives that send it after a stop or fault too.
        poll_first_s: A pending move's status is asked for the first time after this, then ever more rarely …
        poll_slowest_s: … down to one look in this many seconds.
        stall_timeout_s: A move whose axis stands still for so long, while its command is active, has failed.
        in_doubt_after_s: A pending move of which nothing can be learnt for so long is in doubt.
        stop_timeout_s: How long STOP is repeated until it is acknowledged.
        standstill_timeout_s: How long an acknowledged STOP may take to bring the axis to a standstill.
        dialect: Words that may differ.
    """

    answer_timeout_s: float = 1.0
    resync_attempts: int = 3
    unit: str = "units"
    decimals: int = POSITION_DECIMALS
    speed_limit_percent: float = 100.0
    message_form: MessageForm = MessageForm.UNKNOWN
    verify_messages: bool = False
    poll_first_s: float = 0.1
    poll_slowest_s: float = 0.5
    stall_timeout_s: float = 10.0
    in_doubt_after_s: float = 30.0
    stop_timeout_s: float = 10.0
    standstill_timeout_s: float = 10.0
    dialect: Dialect = field(default_factory=Dialect)

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        for each in fields(self.dialect):
            check_line(getattr(self.dialect, each.name))
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name.endswith("_s") and not (isfinite(value) and value > 0):
                raise InvalidCommandError(f"{each.name} must be a finite number of seconds above 0, not {value!r}")
        if type(self.decimals) is not int or self.decimals not in (POSITION_DECIMALS, POSITION_DECIMALS_INCH):
            raise InvalidCommandError(f"decimals must be 2, or 3 for inches, not {self.decimals!r}")
        if not 0 < self.speed_limit_percent <= MAX_SPEED_PERCENT:
            raise InvalidCommandError(
                f"speed_limit_percent must be above 0 and at most {MAX_SPEED_PERCENT:g}, "
                f"not {self.speed_limit_percent!r}"
            )
        if type(self.resync_attempts) is not int or self.resync_attempts < 1:
            raise InvalidCommandError(
                f"resync_attempts must be a whole number and at least 1, not {self.resync_attempts!r}"
            )
