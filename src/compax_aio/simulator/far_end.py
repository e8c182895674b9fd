"""A simulated device that is served and played: faults by chance, on a timetable, or whenever somebody says so."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from random import Random
from typing import Protocol, runtime_checkable

from compax_aio.compax.facts.line import COMMAND_END
from compax_aio.errors import CompaxError, InvalidCommandError

from .faulty_cable import FaultyCable, Noise
from .line import DeviceLine, SimulatedDevice
from .outlet import Outlet
from .planned_faults import FaultKind, PlannedFault

__all__ = ["FarEnd"]


@runtime_checkable
class _Powered(Protocol):
    def power_off(self) -> None:
        """Take the power away."""

    def power_on(self) -> None:
        """Give it back."""


@runtime_checkable
class _Commanded(Protocol):
    @property
    def command_end(self) -> bytes:
        """What ends a command on its line."""


@runtime_checkable
class _Faulty(Protocol):
    def raise_fault(self, code: int) -> None:
        """Have a fault or warning come."""


@dataclass(slots=True)
class _ByChance:
    """A fault that befalls some commands, drawn from a chance of its own."""

    fault: PlannedFault
    random: Random
    is_due: bool = field(default=False)
    """Whether its time has come, and is not over."""

    def happens(self) -> bool:
        """Draw for one command."""
        return self.is_due and (self.fault.chance is None or self.random.random() < self.fault.chance)


def _command_end_of(device: SimulatedDevice) -> bytes:
    return device.command_end if isinstance(device, _Commanded) else COMMAND_END


class FarEnd:
    """
    One device, the outlet it is served on, and what befalls both.

    The same seed has the same faults befall the same bytes and commands, in whatever pieces they come. Times of a
    timetable count from its start.

    Args:
        device: What is served.
        outlet: Where.
        faults: What is to happen, and when.
        seed: Of all chance.
        say: Called with what befalls the device and its line, in words.

    Raises:
        InvalidCommandError: The device cannot have one of *faults*.
    """

    def __init__(
        self,
        device: SimulatedDevice,
        outlet: Outlet,
        faults: Iterable[PlannedFault] = (),
        *,
        seed: int = 0,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.device = device
        self.outlet = outlet
        self._faults = tuple(faults)
        self._seed = seed
        self._say = say
        self._loop = asyncio.get_running_loop()
        self._line = DeviceLine.of(device)
        self._cable = FaultyCable(_command_end_of(device), say, on_command=self._draw, on_cut=self._on_cut)
        self._by_chance: list[_ByChance] = []
        self._ends: dict[str, asyncio.TimerHandle] = {}
        self._timetable: list[asyncio.TimerHandle] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._is_powered = True
        self._is_unplugged = False
        self._random = Random(f"{seed} {device.name}")
        for fault in self._faults:
            self.expect_possible(fault.kind)

    def expect_possible(self, kind: FaultKind) -> None:
        """
        Refuse what this device cannot have.

        Raises:
            InvalidCommandError: It cannot.
        """
        if kind.code is not None and not isinstance(self.device, _Faulty):
            raise InvalidCommandError(f"{self.device.name} has no fault {kind.name}", hint="only COMPAX drives have")

    @asynccontextmanager
    async def served(self) -> AsyncIterator[str]:
        """
        Serve the device in this block; gives its URL. Nothing befalls it before :meth:`start_timetable`.

        Raises:
            TransportError: It cannot be served; says why.
        """
        self._line.lay(self._cable)
        await self.outlet.plug()
        try:
            yield str(self.outlet.url)
        finally:
            for handle in (*self._timetable, *self._ends.values()):
                handle.cancel()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            await self.outlet.unplug()

    # The timetable and chance

    def start_timetable(self) -> None:
        """Let what was ordered happen, from now on."""
        for number, fault in enumerate(self._faults):
            seed = f"{self._seed} {self.device.name} {number} {fault.kind.name}"
            if fault.kind.nature == "noise":
                noise = Noise(fault.kind.name, 1.0 if fault.chance is None else fault.chance, seed)
                self._at(fault.start_s, self._cable.noises.append, noise)
                self._until(fault, self._remove_noise, noise)
            elif fault.chance is None and fault.kind.nature in {"spell", "moment"}:
                self._at(fault.start_s, self.begin, fault.kind, fault.span_s)
            else:
                by_chance = _ByChance(fault, Random(seed))
                self._by_chance.append(by_chance)
                self._at(fault.start_s, setattr, by_chance, "is_due", True)
                self._until(fault, setattr, by_chance, "is_due", False)

    def _until(self, fault: PlannedFault, act: Callable[..., object], *arguments: object) -> None:
        if fault.span_s is not None:
            self._at(fault.start_s + fault.span_s, act, *arguments)

    def _at(self, seconds: float, act: Callable[..., object], *arguments: object) -> None:
        if seconds <= 0:
            act(*arguments)
        else:
            self._timetable.append(self._loop.call_later(seconds, act, *arguments))

    def _remove_noise(self, noise: Noise) -> None:
        if noise in self._cable.noises:
            self._cable.noises.remove(noise)

    def _draw(self) -> None:
        """Draw what befalls the command that has come, and its answer."""
        for each in self._by_chance:
            happens, kind = each.happens(), each.fault.kind
            if kind.nature == "answering":
                if happens:
                    self._answer_so(kind, each.fault.amount_s)
                elif kind.name not in self._ends:
                    self._answer_so(kind, 0.0)
            elif happens and kind.name == "cut":
                self._say("the line is cut within the answer")
                self._cable.cut_within_answer(self._random)
            elif happens and kind.name not in self._ends:
                self.begin(kind, each.fault.amount_s)

    # What can be done to it

    def begin(self, kind: FaultKind, lasts_s: float | None = None, amount_s: float | None = None) -> None:
        """
        Let a fault happen now.

        Args:
            kind: Which; no noise.
            lasts_s: When it ends by itself; None: not before :meth:`end`.
            amount_s: Of what befalls answers: by how much.
        """
        if (end := self._ends.pop(kind.name, None)) is not None:
            end.cancel()
        if kind.code is None:  # it is in the log of the drive
            self._say(self._told(kind, lasts_s, amount_s))
        self._start(kind, amount_s)
        if lasts_s is not None and kind.nature != "moment":
            self._ends[kind.name] = self._loop.call_later(lasts_s, self.end, kind)

    def _told(self, kind: FaultKind, lasts_s: float | None, amount_s: float | None) -> str:
        """Say what begins, in words."""
        if kind.nature == "answering":
            return f"{kind.name} by {kind.amount_s if amount_s is None else amount_s:g} s"
        if kind.nature == "moment":
            return f"{kind.name}, but the cable is out" if self._is_unplugged else kind.name
        return kind.name if lasts_s is None else f"{kind.name} for {lasts_s:g} s"

    def _start(self, kind: FaultKind, amount_s: float | None) -> None:
        if kind.code is not None and isinstance(self.device, _Faulty):
            self.device.raise_fault(kind.code)
        elif kind.nature == "answering":
            self._answer_so(kind, kind.amount_s or 0.0 if amount_s is None else amount_s)
        elif kind.name == "silent":
            self._cable.is_silent = True
        elif kind.name == "held":
            self._line.hold(held=True)
        elif kind.name == "power" and self._is_powered and isinstance(self.device, _Powered):
            self._is_powered = False
            self.device.power_off()
        elif kind.name == "unplug":
            self._is_unplugged = True
            self._do(self.outlet.unplug)
        elif kind.name == "cut" and not self._is_unplugged:
            self._on_cut()

    def end(self, kind: FaultKind) -> None:
        """Let a fault be over that :meth:`begin` has begun; nothing happens if it is."""
        if (end := self._ends.pop(kind.name, None)) is not None:
            end.cancel()
        if kind.nature == "answering":
            self._answer_so(kind, 0.0)
        elif kind.name == "silent" and self._cable.is_silent:
            self._cable.is_silent = False
            self._say("it is heard again")
        elif kind.name == "held" and self._line.is_held:
            self._line.hold(held=False)
            self._say("what the host writes is taken again")
        elif kind.name == "power" and not self._is_powered and isinstance(self.device, _Powered):
            self._is_powered = True
            self._say("the power is back")
            self.device.power_on()
        elif kind.name == "unplug" and self._is_unplugged:
            self._is_unplugged = False
            self._do(self._plug)

    def _answer_so(self, kind: FaultKind, amount_s: float) -> None:
        if kind.name == "late":
            self._cable.delay_s["to_host"] = amount_s
        else:
            self._cable.piece = 1 if amount_s else None
            self._cable.piece_gap_s = amount_s

    def set_noise(self, kind: FaultKind, chance: float) -> None:
        """Let noise of one kind befall bytes from now on, by another chance; 0 ends it."""
        self._cable.noises[:] = [each for each in self._cable.noises if each.kind != kind.name]
        if chance:
            self._cable.noises.append(Noise(kind.name, chance, f"{self._seed} {self.device.name} {kind.name}"))
        self._say(f"{kind.name}: {chance:g} of all bytes")

    def heal(self) -> None:
        """End all that is done to bytes, and what befalls commands by chance; what has its time later still comes."""
        self._cable.heal()
        for each in self._by_chance:
            each.is_due = False
        self._say("healed")

    def _on_cut(self) -> None:
        self._say("the line is cut")
        self._do(self._replug)

    async def _replug(self) -> None:
        await self.outlet.unplug()
        await self._plug()

    async def _plug(self) -> None:
        if not self._is_unplugged:  # again, meanwhile
            await self.outlet.plug()
            self._say(f"plugged in: {self.outlet.url}")

    def _do(self, work: Callable[[], Awaitable[None]]) -> None:
        async def told() -> None:
            try:
                await work()
            except CompaxError as error:
                self._say(f"it cannot be plugged in: {error}")

        task = self._loop.create_task(told())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
