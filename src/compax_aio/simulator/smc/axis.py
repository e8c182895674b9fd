"""A simulated axis as tests see it: what it is, where it is, what it keeps, and hands that reset or move it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from compax_aio.smc.facts import Mode, MotionFlags

from .controller import Controller
from .memory import ERASED, Parameters

__all__ = ["SimulatedAxis"]


class _Line(Protocol):
    def advance(self, now: float | None = None) -> None:
        """Let everything happen that is due."""

    def act(self, now: float | None, action: Callable[[], None]) -> None:
        """Do something at time *now*."""


class SimulatedAxis:
    """
    One controller and its axis, as a test sees them and lays hands on them.

    Args:
        line: Gives it the time.
        controller: The controller.

    Attributes:
        letter: Its key in ``line.axes``.
    """

    def __init__(self, line: _Line, controller: Controller) -> None:
        self._line = line
        self._controller = controller
        self._machine = controller.machine
        self.letter = controller.name

    def __repr__(self) -> str:
        return f"<SimulatedAxis {self.letter!r} at {self.position:g}>"

    @property
    def name(self) -> str:
        """The character that addresses it now."""
        self._line.advance()
        return self._machine.name

    @property
    def mode(self) -> Mode:
        """How it takes commands since the last reset."""
        self._line.advance()
        return self._machine.mode

    @property
    def pin(self) -> Mode:
        """What its input says, which is read at the next reset."""
        return self._controller.pin

    @pin.setter
    def pin(self, mode: Mode) -> None:
        self._controller.pin = mode

    @property
    def position(self) -> float:
        """What it reads now, finer than it tells."""
        self._line.advance()
        return self._machine.mechanics.position

    @property
    def place(self) -> float:
        """Where it stands; unlike the position this changes by motion alone."""
        self._line.advance()
        return self._machine.mechanics.place

    @property
    def speed(self) -> float:
        """Steps per second, with a sign."""
        self._line.advance()
        return self._machine.mechanics.speed

    @property
    def moving(self) -> bool:
        """Whether it steps now."""
        self._line.advance()
        return self._machine.mechanics.moving

    @property
    def flags(self) -> MotionFlags:
        """What ``^`` would answer now."""
        self._line.advance()
        return self._machine.mechanics.flags

    @property
    def parameters(self) -> Parameters:
        """Those that are valid now."""
        self._line.advance()
        return self._machine.parameters

    @property
    def stored_parameters(self) -> Parameters:
        """Those that the next reset brings."""
        self._line.advance()
        return self._machine.memory.parameters

    @property
    def stored_name(self) -> str:
        """The name that the next reset brings."""
        self._line.advance()
        return self._machine.memory.name

    @property
    def program(self) -> bytes:
        """The bytes of its program memory, without the erased ones at the end."""
        self._line.advance()
        return bytes(self._machine.memory.program).rstrip(bytes([ERASED]))

    @property
    def listing(self) -> list[str]:
        """Its program as ``Q`` would list it."""
        self._line.advance()
        return self._machine.memory.listing(0)

    @property
    def program_runs(self) -> bool:
        """Whether a program runs now."""
        self._line.advance()
        return self._machine.program.running

    @property
    def memory_writes(self) -> int:
        """How often its non-volatile memory was written."""
        self._line.advance()
        return self._machine.memory.writes

    @property
    def inputs(self) -> int:
        """Inputs 1, 2 and 3 as bits 1, 2 and 4."""
        return self._machine.inputs

    @inputs.setter
    def inputs(self, bits: int) -> None:
        self._machine.inputs = bits

    @property
    def outputs(self) -> int:
        """Outputs 1, 2 and 3 as bits 8, 16 and 32."""
        self._line.advance()
        return self._machine.outputs

    def reset(self, now: float | None = None) -> None:
        """Have it reset itself alone, as after a dip of its supply."""
        self._line.act(now, lambda: self._controller.reset("itself"))

    def jog(self, distance: float, now: float | None = None) -> None:
        """Have somebody move it by a jog input, if it stands."""
        self._line.act(now, lambda: self._controller.jog(distance))
