"""A simulated control: bytes and time in, bytes out; its keys, its memory, its display, and a log of what was done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from compax_aio.haas.facts.port_settings import Synchronization

from ..host_driver import HostDriver
from ..served_device import ServedDevice
from .checksums import stand_in
from .interior import Interior
from .knobs import Knobs
from .log import MAX_ENTRIES, Log, LogKind
from .memory import Memory
from .presses import PROGRAMS
from .running import Running
from .sinks import Checksum
from .surroundings import RaisedAlarm

__all__ = ["SimulatedControl"]


class SimulatedControl(ServedDevice):
    """
    One control on its data port; does no I/O. Time goes by as for any :class:`.ServedDevice`.

    Args:
        knobs: Settings, behaviour and trouble.
        name: For messages and tests.
        log_entries: How much of what it has done is kept.
        checksum: Makes the value of N0 from kind and values; how real controls do is not known.

    Attributes:
        log: What it has done, oldest first.
        trouble: What is to go wrong next.
    """

    def __init__(
        self,
        knobs: Knobs | None = None,
        *,
        name: str = "control",
        log_entries: int = MAX_ENTRIES,
        checksum: Checksum = stand_in,
    ) -> None:
        super().__init__(name)
        self.knobs = knobs or Knobs()
        self.log = Log(log_entries)
        self._inside = Interior(self.knobs, self.log, checksum)
        self.trouble = self._inside.trouble
        self._driver = HostDriver(self._inside.wire, self.knobs.host_queue, lost_on_close=self.knobs.lost_on_close)

    def __repr__(self) -> str:
        return f"<SimulatedControl {self.name!r}: {self.doing}>"

    # What is to be seen

    @property
    def baudrate(self) -> int:
        """Baud rate, as the knob says; 0: bytes take no time, and any rate will do."""
        return self.knobs.baudrate

    @property
    def command_end(self) -> bytes:
        """What ends a request."""
        return b"\r"

    @property
    def memory(self) -> Memory:
        """Programs, parameters, settings, offsets, macro variables; it may be changed."""
        return self._inside.around.memory

    @property
    def running(self) -> Running:
        """Cycles, counters, mode, tool, system variables; it may be changed."""
        return self._inside.running

    @property
    def alarms(self) -> Sequence[RaisedAlarm]:
        """The ALARM display, oldest first; RESET clears it."""
        return self._inside.around.alarms

    @property
    def screen(self) -> str:
        """The bottom left corner of the display: ``RS232 DONE``, ``RS232 ABORT``, or empty."""
        return self._inside.around.screen

    @property
    def doing(self) -> str:
        """What it is at: ``sending O01234``, ``receiving settings``, ``dnc``, ``frozen``, ``off``, or ``nothing``."""
        if not self._inside.around.is_on:
            return "off"
        if self._inside.around.is_frozen:
            return "frozen"
        operation = self._inside.operation
        return "nothing" if operation is None else operation.name

    @property
    def is_frozen(self) -> bool:
        """Whether polling has frozen it."""
        return self._inside.around.is_frozen

    @property
    def received_bytes(self) -> int:
        """How many bytes have come from the host since it was made."""
        return self._inside.wire.taken

    @property
    def lost_bytes(self) -> int:
        """How many bytes came that nobody waited for, or that found the buffer full."""
        return self._inside.lost_bytes

    @property
    def buffered_bytes(self) -> int:
        """How many bytes are in the receive buffer."""
        return self._inside.intake.filled

    @property
    def gaps_s(self) -> Sequence[float]:
        """For how long the line was quiet in front of each request since the answer before; the first is infinite."""
        return self._inside.collection.gaps_s

    @property
    def is_pin4_high(self) -> bool:
        """Whether pin 4 says that data may come."""
        return not self._inside.wire.is_stopped

    # The line

    @property
    def holds_host(self) -> bool:
        """Whether what the host writes now stays with it: pin 4 is low, or its driver is full."""
        return self._driver.holds_program()

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host writes at time *now*."""
        self.advance(now)
        self._inside.wire.write(data, self._inside.around.now)
        self.advance(now)

    def take_output(self, now: float) -> bytes:
        """Return the bytes that have come out by *now* and were not taken yet."""
        self.advance(now)
        return self._inside.transmitter.take(self._inside.around.now)

    def next_event_at(self) -> float | None:
        """Return when something may happen that the host is told; None: never."""
        at = min(self._inside.next_at(), self._driver.next_at())
        return at if at < inf else None

    def connect(self, now: float | None = None) -> None:
        """Note that somebody is on the line; what came out while nobody was there is gone."""
        self.advance(now)
        self._inside.transmitter.take(self._inside.around.now)
        self._inside.around.note(LogKind.CONNECTED)
        self._inside.collection.connected()
        self._inside.hands.somebody_came(self._inside.around.now)

    def disconnect(self, now: float | None = None) -> None:
        """Note that nobody is on the line; the control goes on with what it is at."""
        self.advance(now)
        if lost := self._driver.close(self._inside.around.now):
            self._inside.around.note(LogKind.TROUBLE, f"{lost} bytes lost with the port")
        self._inside.around.note(LogKind.DISCONNECTED)

    @property
    def heeds_hold(self) -> bool:
        """Whether it stops sending when the host says so by pin 5; otherwise what a host has no room for is lost."""
        return self.knobs.mode is Synchronization.RTS_CTS

    def hold_output(self, is_held: bool, now: float | None = None) -> None:
        """Set pin 5, the host's hold: with RTS/CTS the control stops sending at once, or goes on."""

        def act() -> None:
            self._inside.hold_by_line(is_held, self._inside.around.now)

        self.act(now, act)

    # Keys

    def press_send(self, what: str = "ALL", now: float | None = None) -> None:
        """
        Press SEND: a program goes out, or all, or numbered data.

        Args:
            what: ``O01234``, ``ALL``, ``last`` (what was received last), ``parameters``, ``settings``, ``offsets`` or
                ``macros``.
            now: When.

        Raises:
            ValueError: There is no such program.
        """
        self._at_panel(now, lambda at: self._inside.send(what, at))

    def press_recv(self, what: str = PROGRAMS, now: float | None = None) -> None:
        """
        Press RECV: what comes is stored.

        Args:
            what: ``programs``, ``parameters``, ``settings``, ``offsets`` or ``macros``.
            now: When.

        Raises:
            ValueError: There is no such kind of data.
        """
        self._at_panel(now, lambda at: self._inside.receive(what, at))

    def press_dnc(self, now: float | None = None) -> None:
        """Press MDI DNC twice: blocks are executed as they come, and nothing is stored."""
        self._at_panel(now, self._inside.feed)

    def press_reset(self, now: float | None = None) -> None:
        """Press RESET: what it is at ends, alarms go, and a frozen control lives again."""
        self.act(now, lambda: self._if_on(self._inside.reset))

    def cycle_start(self, now: float | None = None, *, lasts_s: float | None = None) -> None:
        """Press CYCLE START: a cycle runs for *lasts_s*, or until :meth:`cycle_stop`."""
        self._at_panel(now, lambda at: self._inside.running.start(at, lasts_s))

    def cycle_stop(self, now: float | None = None) -> None:
        """End the cycle: a part is made."""
        self._at_panel(now, self._inside.running.stop)

    def feed_hold(self, now: float | None = None) -> None:
        """Press FEED HOLD: the cycle is held; CYCLE START goes on."""
        self._at_panel(now, self._inside.running.hold)

    def dprnt(self, text: str, now: float | None = None) -> None:
        """Let a program print a line (DPRNT); ``*`` is a space."""
        self.act(now, lambda: self._if_on(lambda at: self._inside.collection.printed(text, at)))

    def popen(self, now: float | None = None) -> None:
        """Let a program open the port for what it prints (POPEN): DC2 is sent."""
        self.act(now, lambda: self._if_on(lambda at: self._inside.punch(True, at)))

    def pclos(self, now: float | None = None) -> None:
        """Let a program close it (PCLOS): DC4 is sent."""
        self.act(now, lambda: self._if_on(lambda at: self._inside.punch(False, at)))

    def overhear(self, text: str, now: float | None = None) -> None:
        """Send an answer to another host, as newer controls do over Ethernet."""
        self.act(now, lambda: self._if_on(lambda at: self._inside.collection.overheard(text, at)))

    # Power and trouble

    def power_off(self, now: float | None = None) -> None:
        """Take the power away: what is under way is lost; memory stays."""
        self.act(now, lambda: self._if_on(self._inside.switch_off))

    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""

        def act() -> None:
            if not self._inside.around.is_on:
                self._inside.switch_on(self._inside.around.now)

        self.act(now, act)

    def freeze(self, now: float | None = None) -> None:
        """Let it freeze, as a control did that was polled without pause: nothing is answered until RESET is pressed."""
        self.act(now, lambda: self._if_on(self._inside.freeze))

    def inject(self, data: bytes, now: float | None = None) -> None:
        """Put bytes out of nothing on the line to the host, behind what is being sent."""
        self.act(now, lambda: self._inside.transmitter.send(data, self._inside.around.now))

    def heal(self) -> None:
        """End all trouble that was asked for and has not come yet."""
        self.trouble.end()

    # How it works

    def _if_on(self, action: Callable[[float], None]) -> None:
        if self._inside.around.is_on:
            action(self._inside.around.now)

    def _at_panel(self, now: float | None, press: Callable[[float], None]) -> None:
        """Press a key; one that is frozen heeds none."""

        def act() -> None:
            if not self._inside.around.is_frozen:
                self._if_on(press)

        self.act(now, act)

    def _run(self, until: float) -> None:
        self._inside.advance(until)

    def _last_told(self) -> float:
        return self._inside.around.now
