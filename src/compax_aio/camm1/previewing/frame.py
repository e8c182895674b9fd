"""How the numbers of a job become steps: as they are, or by ``SC`` from the area between ``P1`` and ``P2``."""

from __future__ import annotations

from .drawing import Point

__all__ = ["Frame"]


class Frame:
    """How numbers become steps: as they are, or by ``SC`` from the area between ``P1`` and ``P2``."""

    def __init__(self) -> None:
        self.p1: Point | None = None
        self.p2: Point | None = None
        self._user: tuple[float, float, float, float] | None = None

    def set_points(self, numbers: tuple[float, ...]) -> None:
        """Take ``IP``; one point moves the other along; no numbers: the machine's own, which nobody knows here."""
        if len(numbers) >= 4:
            self.p1, self.p2 = (numbers[0], numbers[1]), (numbers[2], numbers[3])
        elif len(numbers) >= 2 and self.p1 is not None and self.p2 is not None:
            dx, dy = numbers[0] - self.p1[0], numbers[1] - self.p1[1]
            self.p1, self.p2 = (numbers[0], numbers[1]), (self.p2[0] + dx, self.p2[1] + dy)
        else:
            self.p1 = self.p2 = None

    def set_scale(self, numbers: tuple[float, ...]) -> None:
        """Take ``SC``: user units at ``P1`` and ``P2``; none: steps again."""
        x1, x2, y1, y2 = numbers[:4] if len(numbers) >= 4 else (0.0, 0.0, 0.0, 0.0)
        self._user = (x1, x2, y1, y2) if x1 != x2 and y1 != y2 else None

    def reset(self) -> None:
        """Take steps as they are, and forget ``P1`` and ``P2``."""
        self.p1 = self.p2 = self._user = None

    @property
    def is_unknown(self) -> bool:
        """Whether user units are in force whose size nobody said."""
        return self._user is not None and (self.p1 is None or self.p2 is None)

    def factors(self) -> Point:
        """Return how many steps a unit is, to the right and up."""
        if self._user is None or self.p1 is None or self.p2 is None:
            return 1.0, 1.0
        x1, x2, y1, y2 = self._user
        return (self.p2[0] - self.p1[0]) / (x2 - x1), (self.p2[1] - self.p1[1]) / (y2 - y1)

    def point(self, x: float, y: float) -> Point:
        """Return the point with these coordinates, in steps."""
        if self._user is None or self.p1 is None or self.p2 is None:
            return x, y
        x_factor, y_factor = self.factors()
        return self.p1[0] + (x - self._user[0]) * x_factor, self.p1[1] + (y - self._user[2]) * y_factor
