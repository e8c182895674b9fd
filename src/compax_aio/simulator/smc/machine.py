"""What the commands of a controller do: to its axis, its parameters, its outputs and its memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from compax_aio.smc.facts import COMMANDS, Mode

from .language import HUNDREDTHS, PROGRAMMABLE, Argument, Instruction, arguments, parsed
from .log import Ending, LogKind
from .mechanics import Mechanics
from .memory import Memory, Parameters
from .program import ProgramRun
from .surroundings import Surroundings

__all__ = ["Machine", "RefusedError"]

_OUTPUTS: Final = 8 | 16 | 32
_INPUTS: Final = 1 | 2 | 4
_READ_PORT: Final = 129
"""(gem-controld)."""
_HOME_CIRCUIT: Final = 8
"""The output without which a 789A-4 tells no home."""

_Effect = Callable[[tuple[float, ...], str], str | None]


class RefusedError(Exception):
    """
    A command has no effect.

    Attributes:
        answer: What is said before the terminator; None: nothing at all, nor a terminator.
    """

    def __init__(self, answer: str | None) -> None:
        super().__init__(answer)
        self.answer = answer


class Machine:
    """
    A controller behind its serial port.

    Attributes:
        name: One character; in RAM.
        mode: As the input said at the last reset.
        parameters: In RAM.
        inputs: Bits 1, 2 and 4.
        outputs: Bits 8, 16 and 32.
        memory: What it keeps without power.
        mechanics: Its axis.
        inserting: Where the next instruction is written; None: it is executed.
    """

    def __init__(self, around: Surroundings, ready: Callable[[], None]) -> None:
        self._around = around
        self._knobs = around.knobs
        self._ready = ready
        self.memory = Memory(around.knobs, around.letter)
        self.mechanics = Mechanics(around, lambda: self.parameters, self._motion_changed)
        self.program = ProgramRun(around, self.memory, self.mechanics, self._perform_in_program, ready)
        self._effects = self._table()
        self.inputs = 0
        self.begin_anew(around.knobs.pin)

    # From nothing to nothing

    def begin_anew(self, mode: Mode) -> None:
        """Have in RAM what a reset puts there."""
        self.mode = mode
        self.name = self.memory.name
        self.parameters = self.memory.parameters
        self.outputs = 0
        self.inserting: int | None = None

    def halt(self, why: Ending) -> None:
        """End everything that goes on: program entry, program, and motion without a ramp."""
        self.inserting = None
        self.program.abort()
        self.mechanics.halt(why)

    # Commands

    def understood(self, text: str) -> Instruction:
        """
        Read a command, with its numbers as they count.

        Raises:
            RefusedError: It is none, or not possible.
        """
        what = parsed(text)
        if what is None or (what.letter == "X" and self.mode is not Mode.SINGLE and not self._knobs.x_in_party):
            raise RefusedError(self.refusal)
        numbers: list[float] = []
        for place, argument in enumerate(arguments(what.letter, self._knobs)):
            number = what.numbers[place] if place < len(what.numbers) else self._missing(argument, numbers)
            numbers.append(self._possible(number, argument, has_fraction=what.letter in HUNDREDTHS))
        return Instruction(what.letter, tuple(numbers))

    @property
    def refusal(self) -> str | None:
        """What is said to a command that is refused."""
        return {"terminator": "", "nothing": None}.get(self._knobs.unknown, self._knobs.unknown)

    def must_wait(self, what: Instruction) -> bool:
        """
        Whether a command waits until something else is over (DCB p. 27).

        Raises:
            RefusedError: It would, but is refused.
        """
        if what.letter == "W" and not what.numbers[0] and self.mechanics.moving:
            return True
        if not COMMANDS[what.letter].is_action:
            return self.program.running
        if not self.program.running and not self.mechanics.busy:
            return False
        if self._knobs.second_action == "reject":
            raise RefusedError(self.refusal)
        return True

    def pause_s(self, what: Instruction) -> float:
        """Return how long a command takes before it is answered."""
        return what.numbers[0] * self._knobs.wait_unit_s if what.letter == "W" else 0.0

    def perform(self, what: Instruction, text: str) -> str:
        """Execute a command; return the data it gives."""
        return self._effects[what.letter](what.numbers, text) or ""

    def insert(self, what: Instruction, text: str) -> None:
        """
        Write an instruction into the program at once, or end that (DCB p. 24).

        Raises:
            RefusedError: It cannot stand in a program, or there is no room.
        """
        assert self.inserting is not None
        if what.letter == "P":
            self.inserting = int(what.numbers[0]) or None
            return
        behind = self.memory.write(self.inserting, what) if what.letter in PROGRAMMABLE else None
        if behind is None:
            raise RefusedError(self.refusal)
        self._around.note(LogKind.WRITTEN, f"{self.inserting}: {text}")
        self.inserting = behind

    def position_text(self) -> str:
        """Write the position as Z does."""
        position = round(self.mechanics.position, self._knobs.decimals) + 0.0
        return f"{position:{self._knobs.width}.{self._knobs.decimals}f}"

    # Numbers

    def _missing(self, argument: Argument, before: list[float]) -> float:
        if argument.default is not None:
            return argument.default if argument.default >= 0 else before[0]
        if self._knobs.half_entered == "clear":
            raise RefusedError("")
        return 0.0

    def _possible(self, number: float, argument: Argument, *, has_fraction: bool) -> float:
        possible = argument.nearest(number)
        if possible != number and self._knobs.out_of_range != "clamp":
            raise RefusedError("?" if self._knobs.out_of_range == "error" else "")
        return self._cut(possible, has_fraction=has_fraction)

    def _cut(self, number: float, *, has_fraction: bool) -> float:
        """Cut off the fraction that is not known of; a hundredth is not exact, and may be a little less."""
        factor = 100 if has_fraction and self._knobs.decimals else 1
        return int(number * factor + math.copysign(1e-6, number)) / factor

    def _number(self, value: int) -> str:
        return f"{value:{self._knobs.width}d}"

    # What commands do

    def _table(self) -> Mapping[str, _Effect]:
        return {
            "R": self._index,
            "+": self._index_plus,
            "-": self._index_minus,
            "M": self._run_at,
            "F": self._find_home,
            "G": self._go,
            "@": self._stop,
            "^": self._status,
            "Z": self._position,
            "]": self._limits,
            "O": self._origin,
            "A": self._port,
            "P": self._enter_program,
            "Q": self._list,
            "X": self._show,
            "S": self._store,
            "C": self._clear,
            "J": self._nothing,
            "W": self._nothing,
            **{letter: self._setting(letter) for letter in "IVKDHYEl"},
        }

    def _setting(self, letter: str) -> _Effect:
        def set_parameters(numbers: tuple[float, ...], _: str) -> None:
            self.parameters = self.parameters.with_values(Instruction(letter, numbers))

        return set_parameters

    def _perform_in_program(self, what: Instruction) -> None:
        """Execute what was read from memory, where any bytes may stand; numbers that cannot be are clamped."""
        numbers = tuple(
            self._cut(argument.nearest(number), has_fraction=what.letter in HUNDREDTHS)
            for argument, number in zip(arguments(what.letter, self._knobs), what.numbers, strict=True)
        )
        self.perform(Instruction(what.letter, numbers), str(what))

    def _motion_changed(self) -> None:
        self.program.motion_changed()
        self._ready()

    def _index(self, numbers: tuple[float, ...], text: str) -> None:
        self.mechanics.index(numbers[0], text)

    def _index_plus(self, numbers: tuple[float, ...], text: str) -> None:
        self.mechanics.index(self.mechanics.position + numbers[0], text)

    def _index_minus(self, numbers: tuple[float, ...], text: str) -> None:
        self.mechanics.index(self.mechanics.position - numbers[0], text)

    def _run_at(self, numbers: tuple[float, ...], text: str) -> None:
        self.mechanics.run_at(numbers[0], text)

    def _find_home(self, numbers: tuple[float, ...], text: str) -> None:
        speed, direction = numbers
        self.mechanics.find_home(speed if direction == self._knobs.home_plus else -speed, text)

    def _go(self, numbers: tuple[float, ...], _: str) -> None:
        self.program.start(int(numbers[0]))

    def _stop(self, _: tuple[float, ...], __: str) -> None:
        self.mechanics.stop()

    def _status(self, _: tuple[float, ...], __: str) -> str:
        return self._number(int(self.mechanics.flags))

    def _position(self, _: tuple[float, ...], __: str) -> str:
        return self.position_text()

    def _limits(self, numbers: tuple[float, ...], _: str) -> str:
        minus, plus = self.mechanics.limits
        home = self.mechanics.at_home
        if self._knobs.limit_bits == "789a":
            home = home and bool(self.outputs & _HOME_CIRCUIT)
            return self._number(2 * self.mechanics.moving | 32 * home | 64 * plus | 128 * minus)
        if numbers[0]:
            return self._number(int(home))
        return self._number(plus | 2 * minus if self._knobs.limit_bits == "ims" else minus | 2 * plus)

    def _origin(self, numbers: tuple[float, ...], _: str) -> None:
        self.mechanics.set_origin(numbers[0])

    def _port(self, numbers: tuple[float, ...], _: str) -> str | None:
        if numbers[0] == _READ_PORT:
            return self._number(self.inputs & _INPUTS | self.outputs)
        self.outputs = int(numbers[0]) & _OUTPUTS
        return None

    def _enter_program(self, numbers: tuple[float, ...], _: str) -> None:
        self.inserting = int(numbers[0])

    def _list(self, numbers: tuple[float, ...], _: str) -> str:
        return self._lines("", self.memory.listing(int(numbers[0])))

    def _show(self, _: tuple[float, ...], __: str) -> str:
        """Show the parameters, in the form of a Panther; the name stands behind the echo (DCB p. 23)."""
        each = self.parameters
        return self._lines(f" {self.name}", [
            f"Y= {each.hold_current}/{each.run_current} E= {each.settling} K= {each.slope_up}/{each.slope_down}"
            f" H={'vr' if each.variable_resolution else 'fr'}",
            f"I= {each.initial_speed} D={each.resolution} l={each.limit_polarity} A={self.outputs}"
            f" V= {each.slew_speed}",
        ])  # fmt: skip

    def _lines(self, first: str, lines: list[str]) -> str:
        """Put lines below the command; none ends with a terminator."""
        return ("\r\n" if self.mode is Mode.SINGLE else "\n").join((first, *lines))

    def _store(self, _: tuple[float, ...], __: str) -> None:
        self.memory.store(self.name, self.parameters)
        self._around.note(LogKind.WRITTEN, "S")

    def _clear(self, numbers: tuple[float, ...], _: str) -> None:
        """Have the parameters of the factory, in RAM; what C1 does is not known."""
        if numbers[0]:
            self.parameters = Parameters.of_factory(self._knobs)

    def _nothing(self, _: tuple[float, ...], __: str) -> None:
        """Jump and wait mean something in a program alone."""
