"""Where the tool goes by an instruction: an estimate from the job alone, in steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate
from math import atan2, ceil, cos, degrees, hypot, inf, isfinite, radians, sin
from typing import ClassVar, Final

from .instruction import Instruction, Language
from .numbers import numbers
from .stripping import stripped

__all__ = ["Path", "Tracker"]

_CHORD_DEGREES: Final = 5
"""Of arcs (PNC-900 p. 18)."""
_MOST_CHORDS: Final = 720


@dataclass(slots=True)
class Path:
    """The points that one instruction leads the tool to, the one it starts from not included."""

    xs: list[float]
    ys: list[float]
    is_cut: bool

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Lowest and highest x, lowest and highest y."""
        return min(self.xs), max(self.xs), min(self.ys), max(self.ys)


@dataclass(slots=True)
class _Scale:
    """From user units to steps: what ``SC`` has set between P1 and P2."""

    factor: float
    offset: float


_Act = Callable[["Tracker", list[float]], Path | None]
_NO_ACTS: Final[dict[str, _Act]] = {}


class Tracker:
    """
    Follows the tool through a job, instruction by instruction.

    Attributes:
        x: Where it is, in steps, as far as known: see *is_certain*.
        y: The same.
        tool_is_down: Whether it is lowered.
        is_certain: False behind what only the machine knows the end of: a label, ``CP``, a scale between points that
            the job has not set, a rotation; and until the next absolute move. At the beginning the tool is reckoned to
            be at the origin, and up.
    """

    def __init__(self) -> None:
        self.x = self.y = 0.0
        self.tool_is_down = False
        self.is_certain = True
        self._is_relative = False
        self._centre = (0.0, 0.0)
        self._points: tuple[float, float, float, float] | None = None
        self._user: tuple[float, float, float, float] | None = None
        self._scales: tuple[_Scale, _Scale] | None = None
        self._is_unscaled = True
        self._is_rotated = False

    @property
    def position_steps(self) -> tuple[float, float]:
        """Where it is, as far as known."""
        return self.x, self.y

    def follow(self, instruction: Instruction, values: list[float] | None = None) -> Path | None:
        """
        Take an instruction; return the way that it leads, None if it leads nowhere or nobody can say where.

        What cannot be read changes nothing: a check tells it. Whoever has read its numbers gives them as *values*.
        """
        act = self._ACTS.get(instruction.language, _NO_ACTS).get(instruction.name)
        if act is None:
            key = instruction.language, instruction.name
            self.is_certain = self.is_certain and key not in _WITHOUT_NUMBERS
            return None
        try:
            if values is None:
                instruction = stripped(instruction) or instruction
                values = numbers(instruction.arguments)
            return act(self, values)
        except (ValueError, IndexError, OverflowError):
            return None

    # Straight ways ----------------------------------------------------------------------------------------------------

    def _list(self, values: list[float], *, is_relative: bool, is_cut: bool, is_plain: bool = False) -> Path | None:
        xs, ys = values[0::2], values[1::2]
        if not ys or len(xs) != len(ys):
            return None
        if not is_plain and not self._is_unscaled:
            if self._scales is None:
                self.is_certain = False
                return None
            xs, ys = self._scaled(xs, 0, is_relative), self._scaled(ys, 1, is_relative)
        if is_relative:
            xs, ys = [*accumulate(xs, initial=self.x)][1:], [*accumulate(ys, initial=self.y)][1:]
        x, y = xs[-1], ys[-1]
        if not (isfinite(x) and isfinite(y)):
            self.is_certain = False
            return None
        self.x, self.y = x, y
        if not is_relative and not self._is_rotated:
            self.is_certain = True
        return Path(xs, ys, is_cut)

    def _scaled(self, values: list[float], axis: int, is_relative: bool) -> list[float]:
        scale = self._scales[axis]  # type: ignore[index]  # asked before
        offset = 0.0 if is_relative else scale.offset
        return [value * scale.factor + offset for value in values]

    def _plot(self, values: list[float]) -> Path | None:
        return self._list(values, is_relative=self._is_relative, is_cut=self.tool_is_down)

    def _down(self, values: list[float]) -> Path | None:
        self.tool_is_down = True
        return self._plot(values) if values else Path([self.x], [self.y], True)

    def _up(self, values: list[float]) -> Path | None:
        self.tool_is_down = False
        return self._plot(values)

    def _absolute(self, values: list[float]) -> Path | None:
        self._is_relative = False
        return self._plot(values)

    def _relative(self, values: list[float]) -> Path | None:
        self._is_relative = True
        return self._plot(values)

    def _initialise(self, _values: list[float]) -> None:
        self.tool_is_down = False
        self._points = None
        self._defaults(_values)

    def _defaults(self, _values: list[float]) -> None:
        self._is_relative = False
        self._is_rotated = False
        self._user = None
        self._rescale()

    def _home(self, _values: list[float]) -> Path | None:
        self.tool_is_down = False
        return self._list([0.0, 0.0], is_relative=False, is_cut=False, is_plain=True)

    def _cut_absolute(self, values: list[float]) -> Path | None:
        return self._mode_1(values, is_relative=False, is_cut=True)

    def _cut_relative(self, values: list[float]) -> Path | None:
        return self._mode_1(values, is_relative=True, is_cut=True)

    def _move_absolute(self, values: list[float]) -> Path | None:
        return self._mode_1(values, is_relative=False, is_cut=False)

    def _move_relative(self, values: list[float]) -> Path | None:
        return self._mode_1(values, is_relative=True, is_cut=False)

    def _mode_1(self, values: list[float], *, is_relative: bool, is_cut: bool) -> Path | None:
        self.tool_is_down = is_cut
        return self._list(values, is_relative=is_relative, is_cut=is_cut, is_plain=True)

    # Scales -----------------------------------------------------------------------------------------------------------

    def _scaling_points(self, values: list[float]) -> None:
        if len(values) == 4:
            self._points = values[0], values[1], values[2], values[3]
        elif len(values) == 2 and self._points:
            x1, y1, x2, y2 = self._points
            self._points = values[0], values[1], values[0] + x2 - x1, values[1] + y2 - y1
        else:
            self._points = None
        self._rescale()

    def _scale(self, values: list[float]) -> None:
        self._user = (values[0], values[1], values[2], values[3]) if len(values) == 4 else None
        self._rescale()

    def _rescale(self) -> None:
        self._is_unscaled = self._user is None
        self._scales = None
        if self._user is None or self._points is None:
            return
        (left, right, bottom, top), (x1, y1, x2, y2) = self._user, self._points
        if left != right and bottom != top:
            across, up = (x2 - x1) / (right - left), (y2 - y1) / (top - bottom)
            self._scales = _Scale(across, x1 - left * across), _Scale(up, y1 - bottom * up)

    def _rotate(self, values: list[float]) -> None:
        self._is_rotated = bool(values and values[0] % 360)
        self.is_certain = self.is_certain and not self._is_rotated

    # Curves -----------------------------------------------------------------------------------------------------------

    def _factor(self) -> float:
        """Return by how much a radius grows; nan-free: 0 where nobody knows."""
        if self._is_unscaled:
            return 1.0
        return abs(self._scales[0].factor) if self._scales else 0.0

    def _arc_absolute(self, values: list[float]) -> Path | None:
        return self._arc(values, is_relative=False)

    def _arc_relative(self, values: list[float]) -> Path | None:
        return self._arc(values, is_relative=True)

    def _arc(self, values: list[float], *, is_relative: bool) -> Path | None:
        here, certain = self.position_steps, self.is_certain
        centre = self._list(values[:2], is_relative=is_relative, is_cut=False)
        self.x, self.y = here
        if centre is None:
            return None
        self.is_certain = certain
        x, y = centre.xs[-1], centre.ys[-1]
        start = degrees(atan2(here[1] - y, here[0] - x))
        path = _turn((x, y), hypot(here[0] - x, here[1] - y), start, start + values[2], self.tool_is_down)
        self.x, self.y = path.xs[-1], path.ys[-1]
        return path

    def _circle(self, values: list[float]) -> Path | None:
        radius = values[0] * self._factor()
        return _turn(self.position_steps, radius, 0, 360, True) if isfinite(radius) else None

    def _wedge(self, values: list[float]) -> Path | None:
        radius = values[0] * self._factor()
        path = _turn(self.position_steps, radius, values[1], values[1] + values[2], True)
        return Path([*path.xs, self.x], [*path.ys, self.y], True)

    def _rectangle_absolute(self, values: list[float]) -> Path | None:
        return self._rectangle(values, is_relative=False)

    def _rectangle_relative(self, values: list[float]) -> Path | None:
        return self._rectangle(values, is_relative=True)

    def _rectangle(self, values: list[float], *, is_relative: bool) -> Path | None:
        here, certain = self.position_steps, self.is_certain
        corner = self._list(values, is_relative=is_relative, is_cut=True)
        self.x, self.y = here
        if corner is None:
            return None
        self.is_certain = certain
        x, y = corner.xs[-1], corner.ys[-1]
        return Path([x, x, here[0], here[0]], [here[1], y, y, here[1]], True)

    def _arc_around(self, values: list[float]) -> Path:
        return self._mode_1_arc((values[0], values[1]), values[2], values[3], values[4])

    def _arc_from_here(self, values: list[float]) -> Path:
        radius, start, end = values[:3]
        centre = self.x - radius * cos(radians(start)), self.y - radius * sin(radians(start))
        return self._mode_1_arc(centre, radius, start, end)

    def _set_centre(self, values: list[float]) -> None:
        self._centre = values[0], values[1]

    def _arc_around_centre(self, values: list[float]) -> Path:
        return self._mode_1_arc(self._centre, values[0], values[1], values[2])

    def _mode_1_arc(self, centre: tuple[float, float], radius: float, start: float, end: float) -> Path:
        self.tool_is_down = True
        path = _turn(centre, radius, start, end, True)
        self.x, self.y = path.xs[-1], path.ys[-1]
        return path

    def _lose(self, _values: list[float]) -> None:
        """Take an instruction that ends where the machine alone knows."""
        self.is_certain = False

    _ACTS: ClassVar[dict[Language, dict[str, _Act]]] = {
        Language.ONE: {
            "H": _home,
            "D": _cut_absolute,
            "I": _cut_relative,
            "M": _move_absolute,
            "R": _move_relative,
            "C": _arc_around,
            "E": _arc_from_here,
            "A": _set_centre,
            "G": _arc_around_centre,
            **dict.fromkeys("KTX", _lose),
        },
        Language.TWO: {
            "IN": _initialise,
            "DF": _defaults,
            "PU": _up,
            "PD": _down,
            "PA": _absolute,
            "PR": _relative,
            "IP": _scaling_points,
            "SC": _scale,
            "RO": _rotate,
            "AA": _arc_absolute,
            "AR": _arc_relative,
            "CI": _circle,
            "EW": _wedge,
            "WG": _wedge,
            "EA": _rectangle_absolute,
            "RA": _rectangle_absolute,
            "ER": _rectangle_relative,
            "RR": _rectangle_relative,
            "CP": _lose,
            "UC": _lose,
        },
    }


def _turn(centre: tuple[float, float], radius: float, start: float, end: float, is_cut: bool) -> Path:
    """Return an arc as chords, both ends included; angles in degrees."""
    if not all(map(isfinite, (*centre, radius, start, end))) or abs(end - start) == inf:
        raise ValueError("an arc without end")
    chords = max(1, min(_MOST_CHORDS, ceil(abs(end - start) / _CHORD_DEGREES)))
    angles = [radians(start + (end - start) * number / chords) for number in range(chords + 1)]
    return Path(
        [centre[0] + radius * cos(angle) for angle in angles],
        [centre[1] + radius * sin(angle) for angle in angles],
        is_cut,
    )


_WITHOUT_NUMBERS: Final = frozenset({(Language.ONE, "P"), (Language.TWO, "LB"), (Language.TWO, "PE")})
"""They move the tool too, nobody here knows where to."""
