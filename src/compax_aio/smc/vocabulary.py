"""Intent into texts: every command of an axis, checked by its profile before a byte is sent."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ..checked_numbers import check_number, check_whole, written
from ..errors import InvalidCommandError
from ..escaping import shown
from .facts import COMMANDS, MAX_COMMAND_LENGTH, NO_NAME, NOT_A_NAME, Mode
from .profile import Profile

__all__ = [
    "MotionKind",
    "MotionPlan",
    "check_command",
    "check_name",
    "check_raw",
    "home_query",
    "limits_query",
    "list_program",
    "plan_home",
    "plan_move_by",
    "plan_move_to",
    "plan_program",
    "plan_run",
    "port_query",
    "position_query",
    "program_begin",
    "program_end",
    "set_origin",
    "set_outputs",
    "show_parameters",
    "soft_stop",
    "status_query",
    "store",
]

_PROGRAM_END: Final = "P0"
_ORIGIN: Final = "O0"
"""As the manual writes it (DCB p. 24); nobody has set another position than zero."""
_STREAM: Final = re.compile(r"Z(?! *0*$).+")
"""``Z`` with anything but zero: what it would do with other numbers than 1 is not known."""
_HIGHEST_ADDRESS: Final = 65_535
"""Where the profile knows of no end; against slips alone."""


class MotionKind(Enum):
    """What a motion is, which decides how its end is recognised."""

    MOVE_TO = "move to"
    MOVE_BY = "move by"
    RUN = "run"
    HOME = "home"
    PROGRAM = "program"


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPlan:
    """What a motion says to the axis, and where it leads."""

    kind: MotionKind
    description: str
    """For people: ``move to 1000 steps``."""
    text: str
    """Without name and terminator."""
    target: float | None = None
    """In steps from the origin, as rounded; None where only the axis knows it."""
    distance: float | None = None
    """Of a move relative to here, as rounded, in steps."""

    def __post_init__(self) -> None:
        """Refuse what cannot be sent, whoever has made the plan."""
        object.__setattr__(self, "text", _checked_text(self.text))


# Motion --------------------------------------------------------------------------------------------------------------


def plan_move_to(position_steps: float, profile: Profile) -> MotionPlan:
    """
    Plan a move to a position, counted from the origin (``R``, AMS p. 25).

    Raises:
        InvalidCommandError: It is no finite number or out of range, or the profile does not know ``R``.
    """
    target = _steps("position_steps", position_steps, profile)
    number = written(target, profile.decimals)
    return MotionPlan(
        kind=MotionKind.MOVE_TO,
        description=f"move to {number} steps",
        text=check_command(f"R{number}", profile),
        target=target,
    )


def plan_move_by(distance_steps: float, profile: Profile) -> MotionPlan:
    """
    Plan a move by a distance from where the axis is (``+`` and ``-``, DCB p. 26).

    Raises:
        InvalidCommandError: It is no finite number or out of range, or zero once rounded, or the profile does not
            know the command.
    """
    distance = _steps("distance_steps", distance_steps, profile)
    if distance == 0:
        least = written(10**-profile.decimals, profile.decimals)
        raise InvalidCommandError(
            f"distance_steps {shown(distance_steps)} is nothing once rounded to {profile.decimals} decimals; "
            f"the least is {least} (DCB p. 26)"
        )
    number = written(abs(distance), profile.decimals)
    sign = "+" if distance > 0 else "-"
    return MotionPlan(
        kind=MotionKind.MOVE_BY,
        description=f"move by {sign}{number} steps",
        text=check_command(f"{sign}{number}", profile),
        distance=distance,
    )


def plan_run(speed_steps_s: float, profile: Profile) -> MotionPlan:
    """
    Plan a run at constant speed, without end; below zero toward minus (``M``, gem-controld).

    Raises:
        InvalidCommandError: It is no whole number of steps/s or out of range, or the profile does not know ``M``.
    """
    low, high = profile.speeds_steps_s
    speed = check_whole("speed_steps_s of a run", speed_steps_s, -high, high)
    if abs(speed) < low:
        raise InvalidCommandError(
            f"speed_steps_s of a run has a size of {low} to {high}, not {shown(speed_steps_s)}",
            hint=None if speed else "a stop ends a run",
        )
    return MotionPlan(
        kind=MotionKind.RUN,
        description=f"run at {speed} steps/s",
        text=check_command(f"M{speed}", profile),
    )


def plan_home(
    speed_steps_s: float, profile: Profile, *, toward_plus: bool | None = None, direction: int | None = None
) -> MotionPlan:
    """
    Plan the search for home (``F``, motorIms).

    Args:
        speed_steps_s: Whole steps/s.
        profile: Of the axis; it may know which direction leads toward plus.
        toward_plus: Where the search begins; or, where the profile does not know the direction of that,
        direction: 0 or 1, as it is sent.

    Raises:
        InvalidCommandError: A number is out of range, not just one of the two says where to, or the profile does not
            know ``F`` or the direction.
    """
    if (toward_plus is None) == (direction is None):
        raise InvalidCommandError("a search for home is told either toward_plus or direction")
    if direction is not None:
        where, way = "", check_whole("direction", direction, 0, 1)
    else:
        way = _direction(toward_plus, profile)
        where = " toward plus" if toward_plus else " toward minus"
    speed = check_whole("speed_steps_s", speed_steps_s, *profile.speeds_steps_s)
    return MotionPlan(
        kind=MotionKind.HOME,
        description=f"find home{where or f' in direction {way}'} at {speed} steps/s",
        text=check_command(f"F{speed}{profile.separator}{way}", profile),
    )


def plan_program(address: int, profile: Profile) -> MotionPlan:
    """
    Plan a run of the program that begins at *address* (``G``, DCB p. 24).

    What its second argument means is not known, and it is not sent.

    Raises:
        InvalidCommandError: It is no address, or the profile does not know ``G``.
    """
    number = _address(address, profile)
    return MotionPlan(
        kind=MotionKind.PROGRAM,
        description=f"run the program at {number}",
        text=check_command(f"G{number}", profile),
    )


def soft_stop(profile: Profile) -> str:
    """Word a stop with its ramp (``@``: panther, gem-controld)."""
    return check_command("@", profile)


# Questions -----------------------------------------------------------------------------------------------------------


def status_query(profile: Profile) -> str:
    """Word the question for the motion status (DCB p. 26)."""
    return check_command("^", profile)


def position_query(profile: Profile) -> str:
    """Word the question for the position (DCB p. 26)."""
    return check_raw(check_command(profile.position_query, profile))


def limits_query(profile: Profile) -> str:
    """
    Word the question for the limit inputs.

    Raises:
        InvalidCommandError: The profile does not know it.
    """
    return _query("limits_query", profile.limits_query, profile)


def home_query(profile: Profile) -> str:
    """Word the question for the home input; errors as above."""
    return _query("home_query", profile.home_query, profile)


def port_query(profile: Profile) -> str:
    """Word the question for the port of inputs and outputs; errors as above."""
    return _query("port_query", profile.port_query, profile)


# The rest ------------------------------------------------------------------------------------------------------------


def set_origin(profile: Profile) -> str:
    """Word that the axis now stands at zero (DCB p. 24)."""
    return check_command(_ORIGIN, profile)


def set_outputs(value: int, profile: Profile) -> str:
    """
    Word the setting of all outputs at once (``A``, gem-controld).

    Args:
        value: The weights of the outputs that are on, added up: 8, 16 and 32 on an IM483I.
        profile: Of the axis; it knows which bits are outputs.

    Raises:
        InvalidCommandError: A weight is none of an output, or the profile knows of none.
    """
    weights = [1 << bit for bit in profile.output_bits]
    if not weights:
        raise _not_known("output_bits", profile)
    number = check_whole("the value of the outputs", value, 0, sum(weights))
    if number & ~sum(weights):
        allowed = ", ".join(map(str, weights))
        raise InvalidCommandError(f"the value of the outputs is a sum of {allowed}, not {shown(value)}")
    return check_command(f"A{number}", profile)


def store(profile: Profile) -> str:
    """Word the storing of parameters and name, which wears the memory out (``S``, DCB p. 23; panther)."""
    return check_command("S", profile)


def show_parameters(profile: Profile) -> str:
    """Word the question for all parameters, in single mode alone (``X``, DCB p. 23; panther)."""
    return check_command("X", profile)


def program_begin(address: int, profile: Profile) -> str:
    """
    Word the start of program entry at *address* (``P``, DCB p. 24); each line after it is stored at once.

    Raises:
        InvalidCommandError: It is no address, or the profile does not know ``P``.
    """
    return check_command(f"P{_address(address, profile)}", profile)


def program_end(profile: Profile) -> str:
    """Word the end of program entry (DCB p. 24); outside of it the same begins one at address 0."""
    return check_command(_PROGRAM_END, profile)


def list_program(profile: Profile) -> str:
    """Word the question for the stored program (``Q``, DCB p. 24)."""
    return check_command("Q", profile)


# Checks --------------------------------------------------------------------------------------------------------------


def check_command(text: str, profile: Profile) -> str:
    """
    Return *text*, if *profile* knows the command that it begins with.

    Raises:
        InvalidCommandError: It does not, or *text* cannot be sent.
    """
    text = _checked_text(text)
    if text[0] not in profile.commands:
        row = COMMANDS.get(text[0])
        meaning = f" ({row.meaning})" if row else ""
        raise InvalidCommandError(
            f"whether {profile.name} has the command {text[0]!r}{meaning} is not known",
            hint="raw() sends it all the same; a profile with it in commands does so from here on",
        )
    return text


def check_raw(text: str) -> str:
    """
    Return *text* without blanks around it, if it is one command that an axis can be told.

    Raises:
        InvalidCommandError: It is empty, longer than 12 characters (AMS p. 25), not printable ASCII, or starts a
            stream of positions.
    """
    if isinstance(text, str):
        text = str.strip(text, " ")  # not as somebody's own kind of text would do it
    text = _checked_text(text)
    if _STREAM.fullmatch(text):
        raise InvalidCommandError(
            f"{text!r} may start positions that come without end (gem-controld); no answer could be told from them",
            hint="position() asks for one at a time, and a move has positions()",
        )
    return text


def check_name(name: str, mode: Mode) -> str:
    """
    Return *name*, if an axis can be addressed by it in *mode*.

    A letter is recommended (DCB p. 23); an axis may have any other printable sign that is not excluded there.

    Raises:
        InvalidCommandError: It is not one such character; or not empty in single mode, which has no names.
    """
    if not isinstance(name, str):
        raise InvalidCommandError(f"the name of an axis is a text, not {shown(name)}")
    name = str.__str__(name)
    if not mode.has_names:
        if name != NO_NAME:
            raise InvalidCommandError(f"in single mode an axis has no name, not {shown(name)} (AMS p. 25)")
        return name
    if len(name) != 1 or not "!" <= name <= "~" or name in NOT_A_NAME:
        raise InvalidCommandError(f"the name of an axis is one character, best a letter, not {shown(name)} (DCB p. 23)")
    return name


def _checked_text(text: object) -> str:
    if not isinstance(text, str):
        raise InvalidCommandError(f"a command is a text, not {shown(text)}")
    text = str.__str__(text)
    for character in text:
        if not " " <= character <= "~":
            raise InvalidCommandError(
                f"{character!r} in {shown(text)} cannot be sent: a command is printable ASCII (AMS p. 25)",
                hint="its end is sent for you, and stop() and reset() have their own ways",
            )
    if not 1 <= len(text) <= MAX_COMMAND_LENGTH:
        raise InvalidCommandError(
            f"{shown(text)} has {len(text)} characters; an axis takes 1 to {MAX_COMMAND_LENGTH} (AMS p. 25)"
        )
    return text


def _steps(what: str, value: float, profile: Profile) -> float:
    number = round(check_number(what, value), profile.decimals)
    if abs(number) > profile.max_position:
        raise InvalidCommandError(f"{what} must be within ±{profile.max_position:,.2f}, not {shown(value)} (DCB p. 26)")
    return number + 0.0  # no -0.0


def _direction(toward_plus: object, profile: Profile) -> int:
    if not isinstance(toward_plus, bool):
        raise InvalidCommandError(f"toward_plus is True or False, not {shown(toward_plus)}")
    if profile.home_toward_plus is None:
        raise _not_known("home_toward_plus", profile, or_else="; or give the direction, 0 or 1, as it is sent")
    return profile.home_toward_plus if toward_plus else 1 - profile.home_toward_plus


def _address(address: int, profile: Profile) -> int:
    highest = _HIGHEST_ADDRESS if profile.last_program_address is None else profile.last_program_address
    return check_whole("the address of a program", address, 0, highest)


def _query(field: str, query: str | None, profile: Profile) -> str:
    if query is None:
        raise _not_known(field, profile)
    return check_command(query, profile)


def _not_known(field: str, profile: Profile, *, or_else: str = "") -> InvalidCommandError:
    return InvalidCommandError(
        f"{field} of {profile.name} is not known",
        hint=f"find it out on the machine, and put it into the profile{or_else}",
    )
