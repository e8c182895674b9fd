"""A simulated cutter: bytes and time in, bytes out; a panel, trouble on demand, and a log of what was done."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final

from ..host_driver import HostDriver
from ..served_device import ServedDevice
from .cuttings import Cuttings
from .interior import Interior
from .knobs import Knobs
from .log import MAX_ENTRIES, Log, LogKind

__all__ = ["SimulatedCutter"]

_LOOK_EVERY_S: Final = 1.0
"""A cutter at work is looked at so often, though nothing is to be told: what it has done is noted then."""


class SimulatedCutter(ServedDevice):
    """
    One cutter on a serial line; does no I/O. Time goes by as for any :class:`.ServedDevice`.

    Args:
        knobs: Behaviour, mechanics and trouble.
        name: For messages and tests.
        log_entries: How much of what it has done is kept.

    Attributes:
        log: What it has done, oldest first.
        trouble: What is to go wrong next.
    """

    def __init__(self, knobs: Knobs | None = None, *, name: str = "cutter", log_entries: int = MAX_ENTRIES) -> None:
        super().__init__(name)
        self.knobs = knobs or Knobs()
        self.log = Log(log_entries)
        self._inside = Interior(self.knobs, self.log)
        self._around = self._inside.around
        self._machine = self._inside.machine
        self._wire = self._inside.wire
        self.trouble = self._inside.trouble
        self._driver = HostDriver(self._wire, self.knobs.host_queue, lost_on_close=self.knobs.lost_on_close)

    def __repr__(self) -> str:
        return f"<SimulatedCutter {self.name!r}: {self.knobs.model}, {self.stored_bytes} bytes stored>"

    # What is to be seen

    @property
    def baudrate(self) -> int:
        """Baud rate, as the knob says; 0: bytes take no time, and any rate will do."""
        return self.knobs.baudrate

    @property
    def cuttings(self) -> Cuttings:
        """What lies on the machine: all vectors, and what else was done."""
        return self._machine.blade.cuttings

    @property
    def stored_bytes(self) -> int:
        """How many bytes are in the data buffer."""
        return self._inside.buffer.stored

    @property
    def free_bytes(self) -> int:
        """How many bytes the data buffer has room for, as far as it says it goes."""
        return self._inside.handshakes.free

    @property
    def received_bytes(self) -> int:
        """How many bytes have come from the host since it was made, data and all else."""
        return self._wire.taken

    @property
    def lost_bytes(self) -> int:
        """How many bytes of data were lost because the buffer was full, since power-on."""
        return self._inside.reception.lost_bytes

    @property
    def io_error(self) -> int:
        """What ``.E`` would answer; it is not cleared."""
        return self._around.io_error

    @property
    def data_error(self) -> int:
        """What ``OE`` would answer; it is not cleared."""
        return self._machine.data_error

    @property
    def force(self) -> float | None:
        """Of the blade, as ``!FS`` or ``FS`` has set it; None: neither has."""
        return self._machine.tool.force

    @property
    def speed_cm_s(self) -> float:
        """Of the blade when it is down."""
        return self._machine.tool.speed_cm_s

    @property
    def is_blinking(self) -> bool:
        """Whether POWER/ERROR blinks: there was an error in the data."""
        return self._machine.is_blinking

    @property
    def is_paused(self) -> bool:
        """Whether the PAUSE key holds it."""
        return self._machine.is_paused

    @property
    def is_ready(self) -> bool:
        """Whether SETUP is lit."""
        return self._machine.is_ready

    @property
    def is_idle(self) -> bool:
        """Whether nothing is stored, nothing moves, and nothing is under way from the host."""
        return self._machine.is_idle and not len(self._wire)

    @property
    def is_dtr_high(self) -> bool:
        """Whether DTR says that there is room."""
        return self._inside.handshakes.is_dtr_high

    def position(self, now: float | None = None) -> tuple[float, float, bool]:
        """Return where the tool is, in steps, and whether it is down."""
        self.advance(now)
        return self._machine.position_at(self._around.now)

    # The line

    @property
    def holds_host(self) -> bool:
        """Whether what the host writes now stays with it: DTR is low and wired, or its driver is full."""
        return self._driver.holds_program()

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host writes at time *now*."""
        self.advance(now)
        self._wire.write(data, self._around.now)
        self.advance(now)

    def take_output(self, now: float) -> bytes:
        """Return the bytes that have come out by *now* and were not taken yet."""
        self.advance(now)
        return self._inside.transmitter.take(self._around.now)

    def next_event_at(self) -> float | None:
        """Return when something may happen that the host is told, or when it is time to look; None: never."""
        now = self._around.now
        at = min(self._inside.transmitter.next_at(), self._inside.reception.hears_at(), self._driver.next_at())
        machine_at = self._machine.next_at()
        if machine_at < inf:
            at = min(at, machine_at if self._inside.is_watched else max(machine_at, now + _LOOK_EVERY_S))
        if len(self._wire) and not self._wire.is_stopped:
            at = min(at, max(self._wire.ends_at, now))
        return at if at < inf else None

    def connect(self, now: float | None = None) -> None:
        """Note that somebody is on the line; what came out while nobody was there is gone."""
        self.advance(now)
        self._inside.transmitter.take(self._around.now)
        self._around.note(LogKind.CONNECTED)

    def disconnect(self, now: float | None = None) -> None:
        """Note that nobody is on the line; the cutter goes on with what it has."""
        self.advance(now)
        if lost := self._driver.close(self._around.now):
            self._around.note(LogKind.TROUBLE, f"{lost} bytes lost with the port")
        self._around.note(LogKind.DISCONNECTED)

    # The panel

    def press_pause(self, now: float | None = None) -> None:
        """Press PAUSE: execution is held, or goes on."""

        def press() -> str:
            self._machine.is_paused = not self._machine.is_paused
            return "pause" if self._machine.is_paused else "resume"

        self._at_panel(now, press)

    def press_setup(self, now: float | None = None) -> None:
        """Press SETUP: the light goes on or off; while paused, it ends the job and deletes what was received."""

        def press() -> str:
            if self._machine.is_paused:
                self._inside.clear_buffer("panel", self._around.now)
                self._machine.is_paused = False
                return "cancel"
            self._machine.is_ready = not self._machine.is_ready
            return "setup on" if self._machine.is_ready else "setup off"

        self._at_panel(now, press)

    def press_view(self, now: float | None = None) -> None:
        """Press VIEW of an HP: the plot is held to be looked at, or goes on."""

        def press() -> str:
            self._machine.is_viewed = not self._machine.is_viewed
            return "view" if self._machine.is_viewed else "view over"

        self._at_panel(now, press)

    def raise_lever(self, now: float | None = None) -> None:
        """Raise the lever: the sheet is loose, and nothing is cut."""
        self._at_panel(now, lambda: self._lever(is_up=True))

    def lower_lever(self, now: float | None = None) -> None:
        """Lower the lever."""
        self._at_panel(now, lambda: self._lever(is_up=False))

    def new_sheet(self, now: float | None = None) -> None:
        """Take away what was cut."""
        self.act(now, self.cuttings.clear)

    # Power

    def power_off(self, now: float | None = None) -> None:
        """Take the power away: what is stored and set is gone, and the tool stands where it was."""
        self.act(now, self._power_off)

    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""
        self.act(now, self._power_on)

    # Trouble

    def slow_down(self, factor: float, now: float | None = None) -> None:
        """Let what is begun from now on take so many times as long as the knobs say."""
        self.act(now, lambda: setattr(self._machine.blade, "factor", factor))

    def inject(self, data: bytes, now: float | None = None) -> None:
        """Put bytes out of nothing on the line to the host at once."""
        self.act(now, lambda: self._inside.transmitter.inject(data))

    def heal(self) -> None:
        """End all trouble that was asked for and has not come yet."""
        self.trouble.end()
        self._machine.blade.factor = self.knobs.time_factor

    # How it works

    def _lever(self, *, is_up: bool) -> str:
        self._machine.is_lever_up = is_up
        return "lever up" if is_up else "lever down"

    def _at_panel(self, now: float | None, press: Callable[[], str]) -> None:
        """Do something that may hold the machine, or let it go on."""

        def act() -> None:
            if self._around.is_on:
                was_still = self._machine.stands_still
                what = press()
                self._around.note(LogKind.PANEL, what)
                self._machine.held(was_still, self._around.now)

        self.act(now, act)

    def _power_off(self) -> None:
        inside, now = self._inside, self._around.now
        if self._around.is_on:
            self._around.note(LogKind.POWER, "off")
            self._machine.switch_off(now)
            inside.clear_buffer("power", now)
            inside.abort_output(now)
            self._around.is_on = False

    def _power_on(self) -> None:
        inside, now = self._inside, self._around.now
        if not self._around.is_on:
            self._around.is_on = True
            self._around.io_error = 0
            self._around.note(LogKind.POWER, "on")
            self._machine.switch_on()
            inside.reception.switch_on()
            inside.control.power_on()
            inside.handshakes.power_on()
            inside.handshakes.look(now)

    def _run(self, until: float) -> None:
        self._inside.reception.advance(max(until, self._around.now))

    def _last_told(self) -> float:
        return self._around.now
