"""How much room labels take: size, direction and spacing of characters, as far as the job says them."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians, sin
from typing import Final

from .drawing import Point

__all__ = ["Lettering"]

_USUAL_WIDTH_STEPS: Final = 0.19 * 400
_USUAL_HEIGHT_STEPS: Final = 0.27 * 400
"""Those of the HP family, in cm; what a cutter takes is its own matter."""
_PITCH: Final = 1.5
"""Of characters, in their widths, and of lines half as much in heights: the cell around a character."""
_LINE_PITCH: Final = 2.0
_MODE1_STEP: Final = 0.8 * 40
"""By which ``S`` of mode 1 makes characters higher; as plotters of the family have it, so about."""
_MODE1_WIDTH: Final = 0.7


@dataclass(slots=True)
class Lettering:
    """
    The lettering that is in force.

    Attributes:
        width_steps: Of a character.
        height_steps: Of a capital.
        angle_deg: Of the base line, counter-clockwise.
    """

    width_steps: float = _USUAL_WIDTH_STEPS
    height_steps: float = _USUAL_HEIGHT_STEPS
    angle_deg: float = 0.0

    def set_size_cm(self, numbers: tuple[float, ...]) -> None:
        """Take ``SI``: width and height in cm; none of them: the usual ones."""
        width, height = (400 * numbers[0], 400 * numbers[1]) if len(numbers) >= 2 else (0.0, 0.0)
        self.width_steps = width or _USUAL_WIDTH_STEPS
        self.height_steps = height or _USUAL_HEIGHT_STEPS

    def set_direction(self, numbers: tuple[float, ...]) -> None:
        """Take ``DI``: run and rise of the base line; none: to the right."""
        run, rise = (numbers[0], numbers[1]) if len(numbers) >= 2 else (1.0, 0.0)
        self.angle_deg = degrees(atan2(rise, run)) if hypot(run, rise) else 0.0

    def set_mode1_size(self, size: float) -> None:
        """Take ``S`` of mode 1, 0 to 127 (PNC-900 p. 18)."""
        self.height_steps = (min(max(size, 0.0), 127.0) + 1) * _MODE1_STEP
        self.width_steps = _MODE1_WIDTH * self.height_steps

    def box(self, at: Point, text: str) -> tuple[list[Point], Point]:
        """Return the corners of the area of *text* that begins *at* somewhere, and where the tool stands after it."""
        lines = text.replace("\r", "").split("\n")
        longest = max(map(len, lines))
        width = max(longest * _PITCH - (_PITCH - 1), 0.0) * self.width_steps
        below = (len(lines) - 1) * _LINE_PITCH * self.height_steps
        corners = [(0.0, -below), (width, -below), (width, self.height_steps), (0.0, self.height_steps)]
        end = (len(lines[-1]) * _PITCH * self.width_steps, -below)
        return [self._placed(at, each) for each in corners], self._placed(at, end)

    def advanced(self, at: Point, spaces: float, lines: float) -> Point:
        """Return where ``CP`` leads: so many characters to the right and lines up."""
        return self._placed(at, (spaces * _PITCH * self.width_steps, lines * _LINE_PITCH * self.height_steps))

    def _placed(self, at: Point, offset: Point) -> Point:
        angle = radians(self.angle_deg)
        x, y = offset
        return at[0] + x * cos(angle) - y * sin(angle), at[1] + x * sin(angle) + y * cos(angle)
