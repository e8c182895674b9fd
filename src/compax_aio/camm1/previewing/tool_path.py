"""From the instructions of a job, in either language, to the ways of the tool (PNC-900 p. 18-19)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import cos, radians, sin
from typing import Final, NamedTuple

from ..language.instruction import Instruction, Language
from ..language.numbers import numbers
from ..language.stripping import stripped
from .drawing import Drawing, Place, Point
from .frame import Frame
from .lettering import Lettering
from .tool import Tool, arc

__all__ = ["drawing_of"]

_LABELS: Final = "labels are drawn as boxes of about their size: fonts, and sizes that are not said, are the machine's"


class _Told(NamedTuple):
    """What an instruction says."""

    mnemonic: str
    numbers: tuple[float, ...]
    arguments: bytes


def drawing_of(instructions: Iterable[Instruction]) -> Drawing:
    """
    Draw a job, instruction by instruction, as far as each can be understood.

    What cannot, is left out, and remarked; what is wrong with it, :func:`compax_aio.camm1.check` says.
    """
    path = _ToolPath()
    for each in instructions:
        path.take(each)
    return path.tool.drawing()


class _ToolPath:
    """Carries out instructions; each that draws or changes how is drawn has a method, by :data:`_METHODS`."""

    def __init__(self) -> None:
        self.tool = Tool()
        self._is_absolute = True
        self._frame = Frame()
        self._lettering = Lettering()
        self._centre: Point = (0.0, 0.0)
        self._polygon: list[list[Point]] | None = None
        """While one is defined: its rings."""
        self._last_polygon: list[list[Point]] = []

    def take(self, instruction: Instruction) -> None:
        """Carry out one instruction."""
        language = instruction.language
        if language is Language.BLANK or language is Language.CONTROL:  # no machine draws by them
            return
        if instruction.holds_control:
            without = stripped(instruction)
            if without is None:
                return
            instruction = without
        tool, name = self.tool, instruction.name
        tool.begin(Place(instruction.place, instruction.line, instruction.column))
        method = _METHODS.get(name)
        if method is not None:
            arguments = instruction.arguments
            try:
                told = tuple(numbers(arguments)) if arguments and name not in _OF_TEXT else ()
                method(self, _Told(name, told, arguments))
            except (IndexError, OverflowError, ValueError, ZeroDivisionError):
                tool.remark(f"{name} with too few numbers, or such that make no sense, is not drawn")
        elif (why := _NOT_DRAWN.get(name)) is not None:
            tool.remark(why)
        elif name not in _OF_NO_SHAPE and not name.startswith("O"):
            tool.remark(f"{name or 'what is no instruction'} is not drawn: what it does is not known")
        tool.end_of_instruction()

    # Ways -------------------------------------------------------------------------------------------------------------

    def _way(self, numbers: tuple[float, ...], *, absolute: bool) -> list[Point]:
        """Return the points that pairs of numbers lead to; a last one without its partner is left out."""
        if self._frame.is_unknown:
            self.tool.remark("what is scaled by SC is drawn as if its units were steps: no IP says how large they are")
        points = []
        x, y = self._now
        x_factor, y_factor = self._frame.factors()
        for index in range(0, len(numbers) - 1, 2):
            if absolute:
                x, y = self._frame.point(numbers[index], numbers[index + 1])
            else:
                x, y = x + numbers[index] * x_factor, y + numbers[index + 1] * y_factor
            points.append((x, y))
        if len(numbers) % 2:
            self.tool.remark("a coordinate without its partner is left out")
        return points

    @property
    def _now(self) -> Point:
        """Where the tool stands, or would stand while a polygon is defined."""
        return self._polygon[-1][-1] if self._polygon and self._polygon[-1] else self.tool.at

    def _follow(self, points: list[Point]) -> None:
        if self._polygon is None:
            self.tool.go_all(points)
        else:
            self._polygon[-1].extend(points)

    def _plot(self, told: _Told) -> None:
        self._follow(self._way(told.numbers, absolute=self._is_absolute))

    def pen_up(self, told: _Told) -> None:
        self.tool.lift()
        self._plot(told)

    def pen_down(self, told: _Told) -> None:
        if self._polygon is None:
            self.tool.lower()
        self._plot(told)

    def plot_absolute(self, told: _Told) -> None:
        self._is_absolute = True
        self._plot(told)

    def plot_relative(self, told: _Told) -> None:
        self._is_absolute = False
        self._plot(told)

    def home(self, _: _Told) -> None:
        self.tool.lift()
        self.tool.go((0.0, 0.0))

    def mode1_way(self, told: _Told) -> None:
        """``D``, ``M``, ``I``, ``R``: they say themselves whether the tool is down."""
        points = self._way(told.numbers, absolute=told.mnemonic in {"D", "M"})
        if told.mnemonic in {"D", "I"}:
            self.tool.lower()
        else:
            self.tool.lift()
        self.tool.go_all(points)

    # What is in force -------------------------------------------------------------------------------------------------

    def initialise(self, told: _Told) -> None:
        if told.mnemonic == "IN":
            self.tool.lift()
            self.tool.speed_cm_s = None
            self._frame.reset()
        self._frame.set_scale(())
        self._is_absolute = True
        self._lettering = Lettering()

    def set_points(self, told: _Told) -> None:
        self._frame.set_points(told.numbers)

    def set_scale(self, told: _Told) -> None:
        self._frame.set_scale(told.numbers)

    def set_window(self, told: _Told) -> None:
        if len(told.numbers) >= 4:
            left, bottom, right, top = told.numbers[:4]
            self.tool.take("window", [(left, bottom), (right, bottom), (right, top), (left, top)])
            self.tool.remark("what lies outside of the window of IW is drawn, and will not be cut")

    def set_speed(self, told: _Told) -> None:
        self.tool.speed_cm_s = told.numbers[0] if told.numbers and told.numbers[0] > 0 else None

    def choose_tool(self, told: _Told) -> None:
        self.tool.number = int(told.numbers[0]) if told.numbers else None

    def feed(self, told: _Told) -> None:
        self.tool.feed_mm += told.numbers[0] if told.numbers else 0.0
        self.tool.remark("!PG feeds the sheet; what follows is drawn as if it had not")

    # Round, and with corners ------------------------------------------------------------------------------------------

    def circle(self, told: _Told) -> None:
        radius = told.numbers[0] * self._frame.factors()[0]
        centre = self.tool.at
        start = (centre[0] + radius, centre[1])
        self._shape([start, *arc(centre, start, 360.0, _chord(told, 1))], back_to=centre)

    def arc(self, told: _Told) -> None:
        (centre,) = self._way(told.numbers[:2], absolute=told.mnemonic == "AA")
        self._follow(arc(centre, self._now, told.numbers[2], _chord(told, 3)))

    def wedge(self, told: _Told) -> None:
        radius, begin, sweep = told.numbers[:3]
        centre = self.tool.at
        start = _at_angle(centre, radius * self._frame.factors()[0], begin)
        corners = [centre, start, *arc(centre, start, sweep, _chord(told, 3)), centre]
        if told.mnemonic == "WG":
            self._fill(corners[:-1])
        else:
            self._shape(corners, back_to=centre)

    def rectangle(self, told: _Told) -> None:
        (opposite,) = self._way(told.numbers[:2], absolute=told.mnemonic in {"EA", "RA"})
        x, y = self.tool.at
        corners = [(x, y), (opposite[0], y), opposite, (x, opposite[1])]
        if told.mnemonic in {"RA", "RR"}:
            self._fill(corners)
        else:
            self._shape([*corners, (x, y)], back_to=(x, y))

    def _fill(self, corners: list[Point]) -> None:
        self.tool.take("fill", corners)
        self.tool.remark("filled areas are drawn as areas: how close their lines are is the machine's (FT, PT)")

    def _shape(self, points: list[Point], *, back_to: Point) -> None:
        """Draw along *points* with the tool down, and go back; it is up or down then as it was."""
        self.tool.travel(points[0])
        self.tool.cut(points[1:])
        self.tool.travel(back_to)

    def mode1_arc(self, told: _Told) -> None:
        """``C``, ``G`` around a centre, ``E`` from where the tool stands; the tool stays at their end."""
        numbers = told.numbers
        if told.mnemonic == "C":
            centre, numbers = (numbers[0], numbers[1]), numbers[2:]
        elif told.mnemonic == "G":
            centre = self._centre
        else:
            centre = _at_angle(self.tool.at, -numbers[0], numbers[1])
        radius, begin, end = numbers[:3]
        start = _at_angle(centre, radius, begin)
        self.tool.travel(start)
        self.tool.cut(arc(centre, start, end - begin, numbers[3] if len(numbers) > 3 else None))
        self.tool.lift()

    def set_centre(self, told: _Told) -> None:
        self._centre = (told.numbers[0], told.numbers[1])

    def mode1_axis(self, told: _Told) -> None:
        """``X``: an axis from where the tool stands; its ticks are left out."""
        which, pitch, count = told.numbers[:3]
        x, y = self.tool.at
        way = pitch * count
        self.tool.cut([(x + way, y) if which else (x, y + way)])
        self.tool.remark("ticks of axes are not drawn")

    def mode1_rectangle(self, told: _Told) -> None:
        _, width, height = told.numbers[:3]
        x, y = self.tool.at
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        self._shape([*corners, (x, y)], back_to=(x, y))
        if told.numbers[0]:
            self.tool.remark("the hatching of T is not drawn, its edges are")

    # Polygons ---------------------------------------------------------------------------------------------------------

    def polygon_mode(self, told: _Told) -> None:
        """``PM0`` begins a polygon, ``PM1`` its next ring, ``PM2`` ends it."""
        step = int(told.numbers[0]) if told.numbers else 0
        if step == 0:
            self._polygon = [[self.tool.at]]
        elif self._polygon is not None and step == 1:
            self._polygon.append([])
        elif self._polygon is not None:
            self._last_polygon, self._polygon = [ring for ring in self._polygon if len(ring) > 1], None

    def edge_polygon(self, _: _Told) -> None:
        back_to = self.tool.at
        for ring in self._last_polygon:
            self._shape([*ring, ring[0]], back_to=back_to)

    def fill_polygon(self, _: _Told) -> None:
        for ring in self._last_polygon:
            self._fill(ring)

    # Lettering --------------------------------------------------------------------------------------------------------

    def label(self, told: _Told) -> None:
        text = told.arguments.decode("latin-1")
        if not text:
            return
        corners, end = self._lettering.box(self.tool.at, text)
        self.tool.take("label", corners, text)
        self.tool.remark(_LABELS)
        self.tool.travel(end)

    def set_size(self, told: _Told) -> None:
        self._lettering.set_size_cm(told.numbers)

    def set_direction(self, told: _Told) -> None:
        self._lettering.set_direction(told.numbers)

    def set_mode1_size(self, told: _Told) -> None:
        self._lettering.set_mode1_size(told.numbers[0])

    def set_mode1_angle(self, told: _Told) -> None:
        self._lettering.angle_deg = 90.0 * told.numbers[0]

    def advance(self, told: _Told) -> None:
        spaces, lines = told.numbers[:2] if len(told.numbers) >= 2 else (0.0, -1.0)
        self.tool.travel(self._lettering.advanced(self.tool.at, spaces, lines))


def _chord(told: _Told, index: int) -> float | None:
    return told.numbers[index] if len(told.numbers) > index else None


def _at_angle(centre: Point, radius: float, angle_deg: float) -> Point:
    return centre[0] + radius * cos(radians(angle_deg)), centre[1] + radius * sin(radians(angle_deg))


_METHODS: Final[Mapping[str, Callable[[_ToolPath, _Told], None]]] = {
    "PU": _ToolPath.pen_up,
    "PD": _ToolPath.pen_down,
    "PA": _ToolPath.plot_absolute,
    "PR": _ToolPath.plot_relative,
    "IN": _ToolPath.initialise,
    "DF": _ToolPath.initialise,
    "IP": _ToolPath.set_points,
    "SC": _ToolPath.set_scale,
    "IW": _ToolPath.set_window,
    "VS": _ToolPath.set_speed,
    "SP": _ToolPath.choose_tool,
    "!ST": _ToolPath.choose_tool,
    "!PG": _ToolPath.feed,
    "CI": _ToolPath.circle,
    "AA": _ToolPath.arc,
    "AR": _ToolPath.arc,
    "EA": _ToolPath.rectangle,
    "ER": _ToolPath.rectangle,
    "RA": _ToolPath.rectangle,
    "RR": _ToolPath.rectangle,
    "EW": _ToolPath.wedge,
    "WG": _ToolPath.wedge,
    "PM": _ToolPath.polygon_mode,
    "EP": _ToolPath.edge_polygon,
    "FP": _ToolPath.fill_polygon,
    "LB": _ToolPath.label,
    "SI": _ToolPath.set_size,
    "DI": _ToolPath.set_direction,
    "CP": _ToolPath.advance,
    "H": _ToolPath.home,
    "D": _ToolPath.mode1_way,
    "M": _ToolPath.mode1_way,
    "I": _ToolPath.mode1_way,
    "R": _ToolPath.mode1_way,
    "C": _ToolPath.mode1_arc,
    "E": _ToolPath.mode1_arc,
    "G": _ToolPath.mode1_arc,
    "A": _ToolPath.set_centre,
    "X": _ToolPath.mode1_axis,
    "T": _ToolPath.mode1_rectangle,
    "P": _ToolPath.label,
    "S": _ToolPath.set_mode1_size,
    "Q": _ToolPath.set_mode1_angle,
}

_PATTERNS: Final = "patterns of lines are drawn without gaps"
_TICKS: Final = "ticks are not drawn"
_SYMBOLS: Final = "symbols are not drawn"
_SHARES: Final = "sizes that are shares of P1 to P2 are not drawn: nobody knows here where these are"

_NOT_DRAWN: Final[Mapping[str, str]] = {
    "LT": _PATTERNS,
    "L": _PATTERNS,
    "XT": _TICKS,
    "YT": _TICKS,
    "SM": _SYMBOLS,
    "N": _SYMBOLS,
    "UC": "characters of UC are not drawn",
    "K": "radial division lines are not drawn",
    "SR": _SHARES,
    "DR": _SHARES,
    "SL": "labels are drawn without slant",
    "PE": "packed vectors are not drawn, and what follows may be drawn elsewhere than it will be cut",
    "RO": "RO turns what follows, and it is drawn as if it did not",
}

_OF_TEXT: Final = frozenset({"LB", "P"})

_OF_NO_SHAPE: Final = frozenset(
    {"PT", "FT", "TL", "DT", "CA", "CS", "SA", "SS", "IM", "!NR", "!FS", "FS", "B", "AS", "AP", "PS", "CO", "WD", "NR"}
)
"""They change nothing that is drawn here."""
