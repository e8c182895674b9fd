"""Intent into lines: every command of a move, checked here before a byte is sent (UG p. 100-101, 162)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypedDict, TypeVar

from ..checked_numbers import check_number, written
from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.limits import (
    MAX_ACCELERATION_TIME_MS,
    MAX_POSITION,
    MAX_PREPARED_POINTS,
    OUTPUT_NUMBERS,
    SPEED_DECIMALS,
)
from .facts.program_commands import MAX_LEVELS
from .plain_line import as_index, check_line
from .settings import DriveSettings

__all__ = [
    "Comparator",
    "MoveOptions",
    "MovePlan",
    "SpeedStep",
    "change_of_speed",
    "check_travel",
    "plan_home",
    "plan_move_by",
    "plan_move_to",
    "setting_of_outputs",
]

_Point = TypeVar("_Point")


@dataclass(frozen=True, slots=True)
class SpeedStep:
    """
    From *distance* on, counted from the start of the move and always positive, go at *speed_percent* (UG p. 101).

    A plain tuple ``(distance, speed_percent)`` does as well.
    """

    distance: float
    speed_percent: int


@dataclass(frozen=True, slots=True)
class Comparator:
    """
    At *distance* from the start of the move, always positive, set *output* to *value* (UG p. 101, 162).

    The drive reports it with its number, which is the order of programming, from 1. A plain tuple
    ``(distance, output)`` or ``(distance, output, value)`` does as well.
    """

    distance: float
    output: int
    value: int = 1


class MoveOptions(TypedDict, total=False):
    """What a move may say besides its target; see :meth:`compax_aio.Drive.move_to`."""

    speed_percent: float | None
    acceleration_ms: int | None
    deceleration_ms: int | None
    steps: Iterable[SpeedStep | tuple[float, int]]
    comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class MovePlan:
    """What a move says to the drive, in order, and where it leads."""

    description: str
    """For errors: ``move_to(120.5)``."""
    target: float | None = None
    """As rounded to the drive's decimals; None where only the drive knows it."""
    distance: float | None = None
    """Of a relative move, as rounded."""
    settings_lines: tuple[str, ...] = ()
    """SPEED, ACCEL, ACCEL-: in force from the next positioning on."""
    point_lines: tuple[str, ...] = ()
    """Speed steps and comparators: prepared for the next positioning."""
    comparators: int = 0
    """How many of the points are comparators."""
    motion: str
    """The line that starts the motion, without ``$``."""
    sets_speed: bool = False
    may_ask_for_message: bool = True
    """Whether ``$`` applies: to POSA and POSR only (UG p. 160)."""
    finds_machine_zero: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be sent, whoever has made the plan."""
        for each in ("settings_lines", "point_lines"):
            object.__setattr__(self, each, tuple(check_line(line) for line in getattr(self, each)))
        object.__setattr__(self, "motion", check_line(self.motion, room_for_sign=self.may_ask_for_message))


def plan_move_to(
    position: float,
    settings: DriveSettings,
    *,
    speed_percent: float | None = None,
    acceleration_ms: int | None = None,
    deceleration_ms: int | None = None,
    steps: Iterable[SpeedStep | tuple[float, int]] = (),
    comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]] = (),
) -> MovePlan:
    """
    Plan an absolute move.

    Raises:
        InvalidCommandError: A number is not finite, out of range, or cannot be said to this drive.
    """
    target = check_travel(_position("position", position, settings), settings)
    return MovePlan(
        description=f"move_to({written(target, settings.decimals)})",
        target=target,
        settings_lines=_settings_lines(settings, speed_percent, acceleration_ms, deceleration_ms),
        sets_speed=speed_percent is not None,
        point_lines=_point_lines(settings, steps, points := tuple(_all("comparators", comparators))),
        comparators=len(points),
        motion=f"PA{written(target, settings.decimals)}",
    )


def plan_move_by(
    distance: float,
    settings: DriveSettings,
    *,
    speed_percent: float | None = None,
    acceleration_ms: int | None = None,
    deceleration_ms: int | None = None,
    steps: Iterable[SpeedStep | tuple[float, int]] = (),
    comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]] = (),
) -> MovePlan:
    """
    Plan a relative move.

    Raises:
        InvalidCommandError: A number is not finite, out of range, or cannot be said to this drive.
    """
    rounded = _position("distance", distance, settings)
    if rounded == 0 != distance:
        raise InvalidCommandError(
            f"distance {shown(distance)} is nothing once rounded to the drive's {settings.decimals} decimals "
            "(UG p. 100)"
        )
    return MovePlan(
        description=f"move_by({written(rounded, settings.decimals)})",
        distance=rounded,
        settings_lines=_settings_lines(settings, speed_percent, acceleration_ms, deceleration_ms),
        sets_speed=speed_percent is not None,
        point_lines=_point_lines(settings, steps, points := tuple(_all("comparators", comparators))),
        comparators=len(points),
        motion=f"PR{written(rounded, settings.decimals)}",
    )


def plan_home(settings: DriveSettings) -> MovePlan:
    """Plan the search for machine zero (POSA HOME, UG p. 162); whether it takes ``$`` is not documented."""
    return MovePlan(
        description="home()",
        motion=settings.dialect.home,
        may_ask_for_message=False,
        finds_machine_zero=True,
    )


def check_travel(target: float, settings: DriveSettings) -> float:
    """
    Return *target*, if it lies within the travel that the settings allow.

    Raises:
        InvalidCommandError: It does not.
    """
    if settings.travel is not None and not settings.travel[0] <= target <= settings.travel[1]:
        low, high = (f"{limit:.{settings.decimals}f}" for limit in settings.travel)
        raise InvalidCommandError(
            f"{written(target, settings.decimals)} {settings.unit} lies outside the travel of the axis, "
            f"{low} to {high} (P11, P12, UG p. 100)",
            hint="the limits are those of read_axis() or DriveSettings.travel",
        )
    return target


def change_of_speed(speed_percent: int, settings: DriveSettings) -> str:
    """
    Word another speed for the move that runs.

    Raises:
        InvalidCommandError: It cannot be said to this drive.
    """
    percent = _whole_speed("speed_percent", speed_percent, settings)
    return check_line(settings.dialect.change_speed.format(percent=percent))


def setting_of_outputs(first: int, levels: Sequence[bool | int]) -> str:
    """
    Word the setting of one or more outputs in a row (UG p. 95, CAN p. 59).

    Raises:
        InvalidCommandError: There is no such output, or it is not told 0 or 1.
    """
    index, count = as_index(first), len(levels)
    if index is None or not 1 <= count <= MAX_LEVELS or {index, index + count - 1} - set(OUTPUT_NUMBERS):
        raise InvalidCommandError(
            f"1 to {MAX_LEVELS} of the outputs 1 to {OUTPUT_NUMBERS[-1]} are set at once, "
            f"not {count} from output {shown(first)} on"
        )
    return check_line(f"OT O{index}={''.join(map(_level, levels))}")


def _level(level: bool | int) -> str:
    number = level if isinstance(level, bool) else check_number("the level of an output", level)
    if number not in (0, 1):
        raise InvalidCommandError(f"an output is set to 0 or 1, not to {shown(level)}")
    return "1" if number else "0"


def _settings_lines(
    settings: DriveSettings, speed_percent: float | None, acceleration_ms: int | None, deceleration_ms: int | None
) -> tuple[str, ...]:
    lines = []
    if speed_percent is not None:
        speed = check_number("speed_percent", speed_percent)
        if not 0 < speed <= settings.speed_limit_percent or round(speed, SPEED_DECIMALS) == 0:
            raise InvalidCommandError(
                f"speed_percent must be above 0 and at most {settings.speed_limit_percent:g}, "
                f"not {shown(speed_percent)}",
                hint="DriveSettings.speed_limit_percent allows more, up to 600",
            )
        lines.append(f"SD{written(speed, SPEED_DECIMALS)}")
    if acceleration_ms is not None:
        lines.append(f"AL{_ramp_time('acceleration_ms', acceleration_ms)}")
    if deceleration_ms is not None:
        lines.append(f"AL-{_ramp_time('deceleration_ms', deceleration_ms)}")
    return tuple(lines)


def _point_lines(
    settings: DriveSettings,
    steps: Iterable[SpeedStep | tuple[float, int]],
    comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]],
) -> tuple[str, ...]:
    lines = []
    for each in _all("steps", steps):
        step = each if isinstance(each, SpeedStep) else _of_tuple(SpeedStep, each)
        speed = _whole_speed("the speed of a speed step", step.speed_percent, settings)
        lines.append(f"PR{_point_distance(step.distance, settings)} SD{speed}")
    for item in comparators:
        comparator = item if isinstance(item, Comparator) else _of_tuple(Comparator, item)
        output = check_number("the output of a comparator", comparator.output)
        if output not in OUTPUT_NUMBERS:
            raise InvalidCommandError(
                f"a comparator sets one of the outputs 1 to {OUTPUT_NUMBERS[-1]}, not output {shown(comparator.output)}"
            )
        distance = _point_distance(comparator.distance, settings)
        lines.append(f"PR{distance} OT O{int(output)}={_level(comparator.value)}")
    if len(lines) > MAX_PREPARED_POINTS:
        raise InvalidCommandError(
            f"a move takes at most {MAX_PREPARED_POINTS} speed steps and comparators together (UG p. 101), "
            f"not {len(lines)}"
        )
    return tuple(lines)


def _whole_speed(what: str, value: float, settings: DriveSettings) -> int:
    """Check the speed behind a distance, which has no decimals (UG p. 101)."""
    speed = check_number(what, value)
    if speed != int(speed) or not 0 < speed <= settings.speed_limit_percent:
        raise InvalidCommandError(
            f"{what} is a whole number from 1 to {settings.speed_limit_percent:g} (UG p. 101), not {shown(value)}"
        )
    return int(speed)


def _all(what: str, points: Iterable[_Point]) -> Iterable[_Point]:
    try:
        return iter(points)
    except TypeError:
        raise InvalidCommandError(f"{what} are several, as a list or tuple, not {shown(points)}") from None


def _of_tuple(kind: type[_Point], values: object) -> _Point:
    try:
        return kind(*values)  # type: ignore[misc]
    except TypeError:
        raise InvalidCommandError(f"{shown(values)} is no {kind.__name__}") from None


def _point_distance(distance: float, settings: DriveSettings) -> str:
    rounded = _position("distance of a point", distance, settings)
    if rounded <= 0:
        raise InvalidCommandError(
            f"the distance of a speed step or comparator counts from the start of the move and is positive "
            f"(UG p. 101), not {shown(distance)}"
        )
    return written(rounded, settings.decimals)


def _position(what: str, value: float, settings: DriveSettings) -> float:
    number = round(check_number(what, value), settings.decimals)
    if abs(number) > MAX_POSITION:
        raise InvalidCommandError(f"{what} must be within ±{MAX_POSITION:,.0f} {settings.unit}, not {shown(value)}")
    return number + 0.0  # no -0.0


def _ramp_time(what: str, value: int) -> int:
    number = check_number(what, value)
    if number != int(number) or not 0 <= number <= MAX_ACCELERATION_TIME_MS:
        raise InvalidCommandError(
            f"{what} must be a whole number of milliseconds from 0 to {MAX_ACCELERATION_TIME_MS} (IBS p. 48), "
            f"not {shown(value)}"
        )
    return int(number)
