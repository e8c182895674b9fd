"""The inside of a simulated control: its parts, and what each of them has the others do, in the order of time."""

from __future__ import annotations

from math import inf

from compax_aio.haas.facts.data_files import DataKind
from compax_aio.haas.facts.port_settings import Synchronization

from ..wire import Wire
from .collection import Collection
from .dnc import DncSink
from .files import programs_sent, table_sent
from .hands import Hands
from .intake import Intake
from .knobs import Knobs
from .log import Log, LogKind
from .operations import Feeding, Operation, StreamReceiving, StreamSending, send_code
from .parity import ByteForm
from .presses import ALL, PROGRAMS, Press
from .running import Running
from .sinks import Checksum, ProgramSink, Sink, TableSink
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble
from .xmodem import XmodemReceiving, XmodemSending

__all__ = ["Interior"]


class Interior:
    """
    All parts of one control.

    Args:
        knobs: Of the control.
        log: Where it notes what it does.
        checksum: Makes the value of N0.

    Attributes:
        operation: What it is at; None: it answers requests, if Setting 143 has it.
        lost_bytes: Bytes that nobody waited for, or that found no room, since it was made.
    """

    def __init__(self, knobs: Knobs, log: Log, checksum: Checksum) -> None:
        self.around = around = Surroundings(knobs, log)
        self.trouble = trouble = Trouble(knobs, lambda text: around.note(LogKind.TROUBLE, text))
        form = ByteForm(knobs.bits, knobs.parity_bit, in_bytes=knobs.parity_in_bytes)
        self.wire = Wire(knobs.byte_time_s, knobs.rts_overshoot)
        self.transmitter = Transmitter(
            knobs.byte_time_s, knobs.xoff_latency, lambda data: trouble.sent(form.sent(data))
        )
        self.running = Running(around)
        self.collection = Collection(around, self.running, self.transmitter, trouble)
        self.intake = Intake(
            around, wire=self.wire, transmitter=self.transmitter, trouble=trouble, form=form, listener=self
        )
        self.hands = Hands(knobs, self)
        self.operation: Operation | None = None
        self.lost_bytes = 0
        self._last_lost = 0
        self._checksum = checksum
        self.last_received: list[str] = []
        self._prints_at = knobs.dprnt_every_s if knobs.dprnt else inf
        self.intake.set_idle_line(0.0)

    # Time

    def advance(self, until: float) -> None:
        """Let everything happen that is due until then."""
        until = max(until, self.around.now)
        while not self.around.is_on and (count := self.wire.arrived(until)):
            self.wire.take(count)
        while True:
            at = min(self._due_at(), until)
            if self.around.is_on and self.intake.step(at):
                continue
            self.around.reach(at)
            if at >= until and self._due_at() > until:
                break
            self._run(at)
        self.around.reach(until)

    def _due_at(self) -> float:
        """When something happens by itself that is not a byte."""
        if not self.around.is_on:
            return inf
        at = min(self.running.next_at(), self.hands.next_at(), self._prints_at)
        return at if self.operation is None else min(at, self.operation.next_at())

    def _run(self, now: float) -> None:
        operation = self.operation
        if operation is not None and operation.next_at() <= now:
            operation.run(now)
            if self.operation is operation and not operation.is_full:
                self.intake.room_made(now)
        if self.running.next_at() <= now:
            self.running.run(now)
        if self.hands.next_at() <= now:
            self.hands.run(now)
        if self._prints_at <= now:
            self._prints_at = now + self.around.knobs.dprnt_every_s
            if self.operation is None:
                self.collection.printed(self.around.knobs.dprnt, now)

    def next_at(self) -> float:
        """When something may happen that somebody sees."""
        if not self.around.is_on:
            return inf
        return min(self._due_at(), self.intake.next_at(), self.transmitter.next_at())

    # What comes

    @property
    def awaits_requests(self) -> bool:
        """Whether requests are answered."""
        return self.collection.is_on

    def heard(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes: an operation does, or data collection."""
        operation = self.operation
        if operation is not None:
            return operation.feed(data, at, step_s)
        if self.collection.is_on:
            self.collection.feed(data, at, step_s)
        elif plain := data.translate(None, b"\r\n"):
            self.lost(len(plain), at)
        return len(data)

    def damaged(self, alarm: str, at: float) -> None:
        """Raise the alarm of a byte that could not be read, and end what it was for."""
        self.around.reach(at)
        operation = self.operation
        if operation is None:
            return
        self.around.alarm(alarm, operation.name, at)
        if alarm != "buffer-overflow" or self.around.knobs.overflow_stops:
            self.abort(at)

    def lost(self, count: int, at: float | None = None) -> None:
        """Count bytes that nobody takes; told once in a row."""
        self.lost_bytes += count
        self.around.note_count(LogKind.LOST, self.lost_bytes, at)

    # Operations

    def begin(self, operation: Operation, now: float) -> None:
        """Begin one; the one before, if it is not over, is aborted."""
        self.abort(now)
        self.around.show("")
        self.operation = operation
        self.intake.clear(now)
        self.collection.connected()
        operation.begin(now)

    def over(self, screen: str, at: float) -> None:
        """Take note that the operation is over."""
        self.around.reach(at)
        self.operation = None
        self.around.show(screen, at)
        self.intake.set_idle_line(at)
        self.hands.over(at)

    def abort(self, now: float) -> None:
        """End the operation in the middle."""
        operation = self.operation
        if operation is None:
            return
        operation.abort(now)
        if self.operation is operation:
            self.over("RS232 ABORT", now)
        self.intake.clear(now)

    def send(self, what: str, now: float) -> None:
        """
        Press SEND.

        Raises:
            ValueError: There is no such program.
        """
        if what in set(DataKind):
            data = table_sent(self.around, DataKind(what), self._checksum)
        else:
            data = programs_sent(self.around, self._names(what))
        self.around.note(LogKind.KEY, f"send {what}", now)
        self.begin(self._sending(what, data), now)

    def _names(self, what: str) -> list[str]:
        memory = self.around.memory
        if what == ALL:
            return sorted(memory.programs)
        if what == "last":
            return [name for name in self.last_received if name in memory.programs] or sorted(memory.programs)[:1]
        name = memory.stored_name(what)
        if name is None:
            raise ValueError(f"there is no program {what!r} in memory; there are {', '.join(sorted(memory.programs))}")
        return [name]

    def _sending(self, what: str, data: bytes) -> Operation:
        return XmodemSending(self, what, data) if self._by_blocks else StreamSending(self, what, data)

    def receive(self, what: str, now: float) -> None:
        """
        Press RECV.

        Raises:
            ValueError: There is no such kind of data.
        """
        sink: Sink
        if what == PROGRAMS:
            programs = ProgramSink(self.around)
            self.last_received = programs.stored
            sink = programs
        else:
            sink = TableSink(self.around, DataKind(what), self._checksum)
        self.around.note(LogKind.KEY, f"recv {what}", now)
        self.begin(self._receiving(what, sink), now)

    def _receiving(self, what: str, sink: Sink) -> Operation:
        return XmodemReceiving(self, what, sink) if self._by_blocks else StreamReceiving(self, what, sink)

    @property
    def _by_blocks(self) -> bool:
        return self.around.knobs.mode is Synchronization.XMODEM

    def feed(self, now: float) -> None:
        """Press MDI DNC twice."""
        self.around.note(LogKind.KEY, "dnc", now)
        sink = DncSink(self.around)
        self.begin(XmodemReceiving(self, "dnc", sink) if self._by_blocks else Feeding(self, sink), now)

    def hold_by_line(self, is_held: bool, now: float) -> None:
        """Take pin 5."""
        if self.around.knobs.mode is Synchronization.RTS_CTS and is_held != self.transmitter.is_held:
            self.around.note(LogKind.FLOW, "pin 5 low" if is_held else "pin 5 high", now)
            if is_held:
                self.transmitter.hold(now)
            else:
                self.transmitter.release(now)

    def punch(self, is_on: bool, now: float) -> None:
        """Let a program open the port for what it prints, or close it (POPEN, PCLOS)."""
        send_code(self, "DC2" if is_on else "DC4", now)

    def reset(self, now: float) -> None:
        """Press RESET: what it is at ends, alarms go, and a frozen control lives again."""
        around = self.around
        around.note(LogKind.KEY, "reset", now)
        if around.is_frozen and around.knobs.freeze_ends == "power":
            return
        self.thaw(now)
        self.abort(now)
        self.running.reset(now)
        around.alarms.clear()

    def freeze(self, now: float) -> None:
        """Let it freeze."""
        if not self.around.is_frozen:
            self.around.is_frozen = True
            self.around.note(LogKind.FROZEN, "by hand", now)

    def thaw(self, now: float) -> None:
        """Let a frozen control live again."""
        if self.around.is_frozen:
            self.around.is_frozen = False
            self.collection.begin_anew()
            self.around.note(LogKind.FROZEN, "over", now)

    # Power

    def switch_off(self, now: float) -> None:
        """Lose what is under way."""
        if self.operation is not None:
            self.operation.abort(now)
            self.operation = None
        self.transmitter.cut()
        self.around.note(LogKind.POWER, "off", now)
        self.around.is_on = False

    def switch_on(self, now: float) -> None:
        """Begin anew with what is in memory."""
        around = self.around
        around.is_on = True
        around.note(LogKind.POWER, "on", now)
        around.alarms.clear()
        around.show("")
        self.thaw(now)
        self.collection.begin_anew()
        self.running.switch_on(now)
        self._prints_at = now + around.knobs.dprnt_every_s if around.knobs.dprnt else inf
        self.intake.clear(now)
        self.hands.begin(now)

    # Keys that press themselves

    def press(self, press: Press, now: float) -> None:
        """Press a key; what is at work is not interrupted by keys that press themselves."""
        match press.key:
            case "recv":
                self.receive(press.what, now)
            case "send":
                try:
                    self.send(press.what, now)
                except ValueError as error:
                    self.around.note(LogKind.KEY, str(error), now)
                    self.hands.over(now)
            case "cycle":
                self.running.start(now, self.around.knobs.cycle_s or 10.0)
                self.hands.over(now)
            case _:
                self.feed(now)
