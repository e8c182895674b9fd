"""A simulated line and its controllers: bytes and time in, bytes out; trouble on demand, and a log of what was done."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from compax_aio.smc.facts import Mode

from ..served_device import ServedDevice
from ..state_file import load_state_file
from ..trouble import Chance
from .agenda import Agenda
from .axis import SimulatedAxis
from .controller import Controller
from .knobs import Knobs
from .log import MAX_ENTRIES, Log, LogKind
from .memory import ERASED
from .state import KeptAxis, read_state, written_state
from .surroundings import Surroundings
from .trouble import Trouble
from .wiring import Bus, Stretch

__all__ = ["SimulatedPartyLine"]

_MAX_WAITING: Final = 65_536
"""Bytes kept in any one direction; more are lost, so that memory is bounded."""


class SimulatedPartyLine(ServedDevice):
    """
    One serial line with one or several controllers; does no I/O. Time goes by as for any :class:`.ServedDevice`.

    In a ring, who sends of its own leaves its neighbour time to read: how real ones do that is not known.

    Args:
        knobs: Behaviour and mechanics of the line and its axes.
        name: For messages and tests.
        axis_knobs: By letter, knobs of axes that are not like the others; what is about the line is not looked at.
        log_entries: How much of what it has done is kept.

    Attributes:
        axes: The axes, by the letters of the knob.
        log: What line and axes have done, oldest first.
    """

    def __init__(
        self,
        knobs: Knobs | None = None,
        *,
        name: str = "line",
        axis_knobs: Mapping[str, Knobs] | None = None,
        log_entries: int = MAX_ENTRIES,
    ) -> None:
        super().__init__(name)
        self.knobs = knobs or Knobs()
        self.log = Log(log_entries)
        self._agenda = Agenda()
        self._chance = Chance(self.knobs.seed)
        self._trouble = Trouble(self._agenda, self.knobs, self.log, self._chance)
        own = axis_knobs or {}
        self._controllers = {
            letter: Controller(
                Surroundings(letter, self._agenda, own.get(letter, self.knobs), self.log), self._trouble, self._chance
            )
            for letter in self.knobs.axes
        }
        self.axes: Mapping[str, SimulatedAxis] = MappingProxyType(
            {letter: SimulatedAxis(self, controller) for letter, controller in self._controllers.items()}
        )
        self._hears_first = self._wired()
        self._powered = True
        self._arriving: deque[tuple[float, int]] = deque()
        self._input_free_at = 0.0
        self._left = bytearray()

    def __repr__(self) -> str:
        return f"<SimulatedPartyLine {self.name!r} with {', '.join(self.axes)}>"

    # The line

    @property
    def baudrate(self) -> int:
        """Baud rate of all axes, as the knob says; 0: bytes take no time, and any rate will do."""
        return self.knobs.baudrate

    @property
    def command_end(self) -> bytes:
        """LF on a party line, else CR."""
        return bytes([Mode(self.knobs.mode).terminator])

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host begins to send at time *now*."""
        self.advance(now)
        if not self.knobs.byte_time_s:
            for byte in data:
                self._arrived(byte)
            return
        for byte in data[: _MAX_WAITING - len(self._arriving)]:
            self._input_free_at = max(self._input_free_at, self._agenda.now) + self.knobs.byte_time_s
            self._arriving.append((self._input_free_at, byte))
        self._await_arrival()

    def take_output(self, now: float) -> bytes:
        """Return the bytes that have come out by *now* and were not taken yet."""
        self.advance(now)
        data = bytes(self._left)
        self._left.clear()
        return data

    def next_event_at(self) -> float | None:
        """Return when something happens by itself next; None if nothing will, unless bytes come."""
        return self._agenda.next_at()

    def connect(self, now: float | None = None) -> None:
        """Note that somebody is on the line; what came out while nobody was there is gone."""
        self.advance(now)
        self._left.clear()
        self._note(LogKind.CONNECTED, "")

    def disconnect(self, now: float | None = None) -> None:
        """Note that nobody is on the line; all axes go on as they were."""
        self.advance(now)
        self._note(LogKind.DISCONNECTED, "")

    # Power

    def power_off(self, now: float | None = None) -> None:
        """Take the power away from all axes: they stand, and keep what is in non-volatile memory alone."""
        self.act(now, self._power_off)

    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""
        self.act(now, self._power_on)

    def save_state(self, now: float | None = None) -> dict[str, Any]:
        """
        Return what the axes keep without power, as plain data; they go on as they were.

        That is name, parameters and program; unlike real ones they also remember where they stand. Knobs are no state.
        """
        self.advance(now)
        kept = {}
        for letter, axis in self.axes.items():
            memory = self._controllers[letter].machine.memory
            kept[letter] = KeptAxis(
                name=memory.name,
                parameters=memory.parameters,
                program=axis.program,
                writes=memory.writes,
                place=axis.place,
            )
        return written_state(kept)

    def load_state(self, state: Mapping[str, Any], now: float | None = None) -> None:
        """
        Switch off and on, and have kept *state*.

        Raises:
            ValueError: It is no such state, or one of other axes; then nothing has changed.
        """
        kept = read_state(state)
        if set(kept) != set(self.axes):
            raise ValueError(f"it is of the axes {', '.join(kept)}, not {', '.join(self.axes)}")
        memories = {letter: controller.machine.memory for letter, controller in self._controllers.items()}
        for letter, axis in kept.items():
            if len(axis.program) > len(memories[letter].program):
                raise ValueError(f"the program of axis {letter} is longer than its memory")
        self.power_off(now)
        for letter, axis in kept.items():
            memory = memories[letter]
            memory.name, memory.parameters, memory.writes = axis.name, axis.parameters, axis.writes
            memory.program[:] = axis.program.ljust(len(memory.program), bytes([ERASED]))
            self._controllers[letter].machine.mechanics.put_at(axis.place)
        self.power_on(now)

    @staticmethod
    def read_state_file(path: str | os.PathLike[str]) -> dict[str, Any]:
        """
        Read a file of a state.

        Raises:
            ValueError: It is no such file, or holds something that no controller can keep; says what and where.
            OSError: It cannot be read.
        """
        return load_state_file(path, read_state, "line")

    # Trouble

    def lose_next_echo(self, axis: str, count: int = 1) -> None:
        """Keep the next echoes of an axis from the line; LF and CR LF at the end of a command count, too."""
        self._trouble.echoes_to_lose[self.axes[axis].letter] += count

    def garble_next_echo(self, axis: str, count: int = 1) -> None:
        """Turn the next echoes of an axis into other characters."""
        self._trouble.echoes_to_garble[self.axes[axis].letter] += count

    def lose_next_character(self, count: int = 1) -> None:
        """Keep the next characters of the host from all axes."""
        self._trouble.characters_to_lose += count

    def flip_next_character(self, bit: int = 0) -> None:
        """Change a bit, 0 to 7, of the next character of the host that is not to be changed yet."""
        self._trouble.bits_to_flip.append(bit & 7)

    def delay_next_answer(self, axis: str, seconds: float) -> None:
        """Let an axis execute its next command in time, and answer late."""
        self._trouble.answers_to_delay_s[self.axes[axis].letter].append(seconds)

    def stick(self, seconds: float, now: float | None = None) -> None:
        """Let nothing go to the host for so long; it is lost."""
        self.act(now, lambda: self._trouble.stick(seconds))

    def inject(self, data: bytes, now: float | None = None) -> None:
        """Put noise on the line to the host at once."""
        self.act(now, lambda: self._leave(data))

    def heal(self) -> None:
        """End all trouble that was asked for and has not come yet, and let the line speak."""
        self._trouble.end()

    # How it works

    def _run(self, until: float) -> None:
        self._agenda.run(until)

    def _last_told(self) -> float:
        return self._agenda.now

    def _wired(self) -> list[Controller]:
        """Connect the controllers; return those that hear the host."""
        controllers = list(self._controllers.values())
        if self.knobs.mode != "daisy":
            bus = Bus(self._sent, self.knobs.collision, self._chance)
            for controller in controllers:
                controller.connect(bus)
            return controllers
        gap_s = self.knobs.stepping_service_s * (1 + self.knobs.jitter)
        targets = [*(controller.arrived for controller in controllers[1:]), self._sent]
        for controller, target in zip(controllers, targets, strict=True):
            controller.connect(Stretch(target), gap_s)
        return controllers[:1]

    def _await_arrival(self) -> None:
        if self._arriving:
            self._agenda.put(self, self._arriving[0][0], self._next_arrived)

    def _next_arrived(self) -> None:
        self._arrived(self._arriving.popleft()[1])
        self._await_arrival()

    def _arrived(self, byte: int) -> None:
        """Let a character of the host arrive at those that hear it."""
        noise = self._trouble.noise()
        if noise is not None:
            self._leave(bytes([noise]))
        arrived = self._trouble.arriving(byte)
        if arrived is None:
            return
        self._note(LogKind.RECEIVED, f"{arrived:02X}")
        for controller in self._hears_first:
            controller.arrived(arrived)

    def _sent(self, byte: int) -> None:
        """Let a character of the controllers arrive at the host."""
        self._leave(bytes([byte]))

    def _leave(self, data: bytes) -> None:
        if not self._trouble.stuck:
            self._left += data
            del self._left[:-_MAX_WAITING]

    def _power_off(self) -> None:
        if self._powered:
            self._powered = False
            self._note(LogKind.POWER, "off")
            for controller in self._controllers.values():
                controller.switch_off()

    def _power_on(self) -> None:
        if not self._powered:
            self._powered = True
            self._note(LogKind.POWER, "on")
            for controller in self._controllers.values():
                controller.reset("power")

    def _note(self, kind: LogKind, text: str) -> None:
        self.log.add(self._agenda.now, kind, text=text)
