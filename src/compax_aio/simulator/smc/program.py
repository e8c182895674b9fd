"""A program that runs: one instruction after the other, as the bytes of the memory say."""

from __future__ import annotations

from collections.abc import Callable

from compax_aio.smc.facts import COMMANDS

from .language import Instruction
from .log import LogKind
from .mechanics import Mechanics
from .memory import Memory
from .surroundings import Surroundings

__all__ = ["ProgramRun"]


class ProgramRun:
    """
    What G starts (DCB p. 24).

    Args:
        around: Time, how long instructions take, and the log, which is told when a program begins and ends.
        memory: Where the program is; it is read as it runs.
        mechanics: Whose motion W and actions wait for.
        perform: Executes an instruction that moves the program nowhere.
        over: Is called when the last instruction is done.
    """

    def __init__(
        self,
        around: Surroundings,
        memory: Memory,
        mechanics: Mechanics,
        perform: Callable[[Instruction], None],
        over: Callable[[], None],
    ) -> None:
        self._around = around
        self._agenda = around.agenda
        self._knobs = around.knobs
        self._memory = memory
        self._mechanics = mechanics
        self._perform = perform
        self._over = over
        self._address = 0
        self._jumps: dict[int, int] = {}
        self._waiting = False
        self.running = False

    def start(self, address: int) -> None:
        """Run the program from an address on."""
        self.running = True
        self._waiting = False
        self._address = address
        self._jumps.clear()
        self._note("started")
        self._go_on(self._knobs.instruction_time_s)

    def abort(self) -> None:
        """Run no further."""
        if self.running:
            self.running = False
            self._agenda.drop(self)
            self._note("aborted")

    def motion_changed(self) -> None:
        """Go on, if that was waited for."""
        if self.running and self._waiting:
            self._waiting = False
            self._go_on(0.0)

    def _go_on(self, after_s: float) -> None:
        self._agenda.put(self, self._agenda.now + after_s, self._step)

    def _step(self) -> None:
        found = self._memory.read(self._address)
        if found is None:
            self.running = False
            self._note("ended")
            self._over()
            return
        instruction, behind = found
        if instruction is not None and self._must_wait(instruction):
            self._waiting = True
            return
        after_s = self._knobs.instruction_time_s
        here, self._address = self._address, behind
        if instruction is not None:
            after_s += self._done(instruction, here)
        self._go_on(after_s)

    def _must_wait(self, what: Instruction) -> bool:
        if what.letter == "W":
            return not what.numbers[0] and self._mechanics.moving
        return COMMANDS[what.letter].is_action and self._mechanics.busy

    def _done(self, what: Instruction, here: int) -> float:
        """Execute an instruction; return how long it pauses the program."""
        if what.letter == "W":
            return what.numbers[0] * self._knobs.wait_unit_s
        if what.letter == "J":
            self._jump(here, *what.numbers)
        elif what.letter == "G":
            self._address = int(what.numbers[0])
        else:
            self._perform(what)
        return 0.0

    def _jump(self, here: int, address: float, times: float) -> None:
        """Go to an address, unless it has been done so often from here; then begin to count anew."""
        done = self._jumps.pop(here, 0)
        if done < times:
            self._jumps[here] = done + 1
            self._address = int(address)

    def _note(self, what: str) -> None:
        self._around.note(LogKind.PROGRAM, f"{what} {self._address}")
