"""What of a drive not everybody uses: parameters, variables, program; made when it is used first."""

from __future__ import annotations

from functools import cached_property

from .line import DriveLine
from .motion import Motion
from .observer import Observer
from .parameters import VARIABLE_TABLE, NumberedValues, Parameters
from .program_memory import ProgramMemory

__all__ = ["Parts"]


class Parts:
    """The parts of one drive; :class:`~compax_aio.compax.drive.Drive` has them, and a thousand idle ones do not."""

    _line: DriveLine
    _observer: Observer
    _motion: Motion

    @cached_property
    def parameters(self) -> Parameters:
        """P1-P250, read, written, saved and restored."""
        return Parameters(self._line)

    @cached_property
    def variables(self) -> NumberedValues:
        """V1-V39 and V50-V70, likewise."""
        return NumberedValues(self._line, VARIABLE_TABLE)

    @cached_property
    def program(self) -> ProgramMemory:
        """The records N001-N250, and the program that they are."""
        return ProgramMemory(self._observer, self._motion)
