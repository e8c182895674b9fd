"""Speed, force, tool, feed and ways of a cutter, worded as bytes; what it cannot be told is refused by its profile."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ..checked_numbers import check_number, check_whole
from ..errors import InvalidCommandError
from .facts.line import MAX_COORDINATE, MAX_INSTRUCTION_LENGTH
from .language.numbers import written_number
from .profiles import Profile

__all__ = ["JobSettings", "cut", "feed", "force", "initialise", "lift", "park", "speed", "tool", "travel"]


def initialise() -> bytes:
    """Return to defaults, with the tool up: ``IN;``."""
    return b"IN;"


def lift() -> bytes:
    """Raise the tool: ``PU;``; the ``;`` in front ends whatever stood there half."""
    return b";PU;"


def speed(speed_cm_s: float, profile: Profile) -> bytes:
    """
    Set the speed, ``VS``, in cm/s (PNC-900 p. 19).

    Raises:
        InvalidCommandError: It is out of the machine's range, or its range is not known.
    """
    return _within("speed_cm_s", speed_cm_s, profile, "speeds_cm_s", "VS")


def force(force_gf: float, profile: Profile) -> bytes:
    """
    Set the force, ``!FS`` in gf; or ``FS``, in the machine's own steps.

    Raises:
        InvalidCommandError: The machine has no instruction for it, its range is not known, or it is out of range.
    """
    if profile.force_instruction is None:
        raise InvalidCommandError(
            f"{profile.name} is not known to have an instruction for the force", hint="set it at the machine"
        )
    return _within("force_gf", force_gf, profile, "forces", profile.force_instruction)


def tool(number: int, profile: Profile) -> bytes:
    """
    Choose a tool, ``!ST``, or a pen, ``SP`` (PNC-900 p. 19).

    Raises:
        InvalidCommandError: The machine has none of that number, or no instruction for it is known.
    """
    if profile.tool_instruction is None:
        raise InvalidCommandError(f"{profile.name} is not known to have an instruction for the tool")
    lowest, highest = _known(profile, "tools")
    number = check_whole("tool", number, int(lowest), int(highest), source=profile.name)
    return f"{profile.tool_instruction}{number};".encode()


def feed(feed_mm: float, profile: Profile) -> bytes:
    """
    Feed the sheet by whole mm, ``!PG`` (PNC-900 p. 19); how fractions are rounded is not known, so none is said.

    Raises:
        InvalidCommandError: The machine feeds no sheet, or not so far.
    """
    lowest, highest = _known(profile, "feeds_mm")
    return f"!PG{check_whole('feed_mm', feed_mm, int(lowest), int(highest), source=profile.name)};".encode()


def travel(x_mm: float, y_mm: float, profile: Profile) -> bytes:
    """
    Go there with the tool up, from the origin: ``PU;PA x,y;``.

    Raises:
        InvalidCommandError: It is out of range, or negative: such is not cut (PNC-900 p. 8).
    """
    return b"PU;PA" + _coordinates(x_mm, y_mm, profile) + b";"


def park(profile: Profile) -> bytes:
    """Go to the origin with the tool up."""
    return travel(0, 0, profile)


def cut(points_mm: Iterable[tuple[float, float]], profile: Profile) -> bytes:
    """
    Cut a line through these points, from the origin: travel to the first, cut to the others, lift.

    Raises:
        InvalidCommandError: There is only one point, or one is out of range.
    """
    (first, *others) = points = [*points_mm] or [(0.0, 0.0)]
    if len(points) < 2:
        raise InvalidCommandError("a line to cut has two points at least")
    data = travel(*first, profile)
    row: list[bytes] = []
    for x_mm, y_mm in others:
        pair = _coordinates(x_mm, y_mm, profile)
        if row and sum(map(len, row)) + len(row) + len(pair) + len(b"PD;") > MAX_INSTRUCTION_LENGTH:
            data += b"PD" + b",".join(row) + b";"
            row = []
        row.append(pair)
    return data + b"PD" + b",".join(row) + b";PU;"


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSettings:
    """
    What is set in front of a job; None leaves it as the machine or the job has it.

    Attributes:
        speed_cm_s: ``VS``.
        force_gf: ``!FS`` in gf, or ``FS`` in steps of the machine.
        tool: ``!ST`` or ``SP``.
    """

    speed_cm_s: float | None = None
    force_gf: float | None = None
    tool: int | None = None

    def worded(self, profile: Profile) -> bytes:
        """
        Return the instructions.

        Raises:
            InvalidCommandError: The machine cannot be told one of them; nothing was sent.
        """
        parts = [
            b"" if self.tool is None else tool(self.tool, profile),
            b"" if self.speed_cm_s is None else speed(self.speed_cm_s, profile),
            b"" if self.force_gf is None else force(self.force_gf, profile),
        ]
        return b"".join(parts)


def _known(profile: Profile, field: str) -> tuple[float, float]:
    span: tuple[float, float] | None = getattr(profile, field)
    if span is None:
        raise InvalidCommandError(
            f"{field} of {profile.name} are not known, or it has none",
            hint=f"if you know them: dataclasses.replace(profile, {field}=(lowest, highest))",
        )
    return span


def _within(what: str, value: object, profile: Profile, field: str, name: str) -> bytes:
    number = check_number(what, value)
    lowest, highest = _known(profile, field)
    if not lowest <= number <= highest:
        raise InvalidCommandError(f"{what} of {profile.name} is from {lowest:g} to {highest:g}, not {number:g}")
    text = written_number(number)
    return f"{name}{text};".encode()


def _coordinates(x_mm: object, y_mm: object, profile: Profile) -> bytes:
    steps = []
    for what, value in (("x_mm", x_mm), ("y_mm", y_mm)):
        number = round(check_number(what, value) * profile.steps_per_mm)
        if not 0 <= number <= MAX_COORDINATE:
            raise InvalidCommandError(
                f"{what} is from 0 to {MAX_COORDINATE / profile.steps_per_mm:.0f} mm (PNC-900 p. 8, 18), not {value}"
            )
        steps.append(str(number))
    return ",".join(steps).encode()
