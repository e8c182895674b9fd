"""Where positions are counted from: machine zero, and real zero, which P1 shifts (UG p. 104)."""

from __future__ import annotations

from .axis import Axis
from .knobs import Knobs

__all__ = ["Zero"]


class Zero:
    """
    The zeros of one axis; they only move while it stands.

    Real zero lies P1 from machine zero, in the direction of larger positions, and S1 counts from it. That P1 shifts S1
    is documented, in which direction is not. Until machine zero is found, it is the place where the power came on that
    takes its part.
    """

    def __init__(self, axis: Axis, knobs: Knobs) -> None:
        self._axis = axis
        self.homed = knobs.homed
        """Machine zero has been found."""
        self.machine_zero = 0.0 if knobs.homed else knobs.position + knobs.machine_zero
        """Its position, known or not."""
        self._real_zero = 0.0

    def found(self) -> None:
        """Take the place where the axis stands as machine zero, which it is."""
        self.homed = True
        self.machine_zero = 0.0 - self._real_zero
        self._axis.put(self.machine_zero)

    def lost(self, now: float) -> None:
        """Forget where machine zero is, as without power."""
        self.homed = False
        was = self._axis.position(now)
        self._axis.put(0.0 - self._real_zero)
        self.machine_zero += self._axis.position(now) - was

    def placed(self, position: float, machine_zero: float, real_zero: float, *, homed: bool) -> None:
        """Take everything as it is told."""
        self._axis.put(position)
        self.machine_zero, self._real_zero, self.homed = machine_zero, real_zero, homed

    def shift_to(self, real_zero: float, now: float) -> float:
        """Count from a real zero that lies at *real_zero*, P1, from now on; return how much smaller positions are."""
        shift = real_zero - self._real_zero
        self._real_zero = real_zero
        self._axis.put(self._axis.position(now) - shift)
        self.machine_zero -= shift
        return shift
