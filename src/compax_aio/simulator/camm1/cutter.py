"""A simulated cutter: bytes and time in, bytes out; a panel, trouble on demand, and a log of what was done."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final

from compax_aio.camm1.facts.handshakes import OutputKind
from compax_aio.camm1.facts.line import ESCAPE

from ..line import Host
from .buffer import Buffer
from .control import Control
from .cuttings import Cuttings
from .handshakes import Handshakes
from .knobs import Knobs
from .log import MAX_ENTRIES, Log, LogKind
from .machine import Machine
from .reports import output, status
from .transmitter import Transmitter
from .trouble import Trouble
from .wire import Wire

__all__ = ["SimulatedCutter"]

_LOOK_EVERY_S: Final = 1.0
"""A cutter at work is looked at so often, though nothing is to be told: what it has done is noted then."""
_ABORTS: Final = (b"\x1b.J", b"\x1b.R")
_ESC: Final = bytes([ESCAPE])


class SimulatedCutter:
    """
    One cutter on a serial line; does no I/O.

    Times are seconds on any one clock. Time goes forward in steps of any size with the same result; a time that lies
    behind the last one counts as that. Where *now* may be left out, it is the time of whoever serves the cutter, or
    the last time it was told.

    Args:
        knobs: Behaviour, mechanics and trouble.
        name: For messages and tests.
        log_entries: How much of what it has done is kept.

    Attributes:
        log: What it has done, oldest first.
        trouble: What is to go wrong next.
        served_by: Who gives the cutter the time and carries its bytes; None where a test does that itself.
    """

    def __init__(self, knobs: Knobs | None = None, *, name: str = "cutter", log_entries: int = MAX_ENTRIES) -> None:
        self.knobs = knobs or Knobs()
        self.name = name
        self.log = Log(log_entries)
        self.served_by: Host | None = None
        self.trouble = Trouble(self.knobs, lambda text: self._note(LogKind.TROUBLE, text))
        self._now = 0.0
        self._is_on = True
        self._buffer = Buffer(self.knobs.physical_bytes)
        self._wire = Wire(self.knobs.byte_time_s, self.knobs.dtr_overshoot)
        self._transmitter = Transmitter(self.knobs.byte_time_s, self.knobs.data_bits)
        self._machine = Machine(self.knobs, self._buffer, self.log, self)
        self._handshakes = Handshakes(
            self.knobs, self._buffer, self._wire, self._transmitter, self.trouble, self.log.add, self._on_io_error
        )
        self._control = Control(self.knobs, self._handshakes, self._transmitter, self)
        self._io_error = 0
        self._owes_size = False
        self._heard = b""
        self._drops_until = -inf
        self._lost = self._refused = 0
        self._holds = False

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
        return self._machine.cuttings

    @property
    def stored_bytes(self) -> int:
        """How many bytes are in the data buffer."""
        return self._buffer.stored

    @property
    def free_bytes(self) -> int:
        """How many bytes the data buffer has room for, as far as it says it goes."""
        return self._handshakes.free

    @property
    def lost_bytes(self) -> int:
        """How many bytes of data were lost because the buffer was full, since power-on."""
        return self._lost

    @property
    def io_error(self) -> int:
        """What ``.E`` would answer; it is not cleared."""
        return self._io_error

    @property
    def data_error(self) -> int:
        """What ``OE`` would answer; it is not cleared."""
        return self._machine.data_error

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
        return self._handshakes.is_dtr_high

    def position(self, now: float | None = None) -> tuple[float, float, bool]:
        """Return where the tool is, in steps, and whether it is down."""
        self.advance(now)
        return self._machine.position_at(self._now)

    # The line

    @property
    def holds_host(self) -> bool:
        """Whether what the host writes now stays with it: DTR is low and wired, or its driver is full."""
        waiting = len(self._wire)
        if self._wire.is_stopped or waiting > self.knobs.host_queue:
            self._holds = True
        elif waiting <= self.knobs.host_queue // 2:
            self._holds = False
        return self._holds

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host writes at time *now*."""
        self.advance(now)
        self._wire.write(data, self._now)
        self.advance(now)

    def advance(self, now: float | None = None) -> None:
        """Let everything happen that is due until *now*."""
        if now is None:
            now = self._now if self.served_by is None else self.served_by.time()
        until = max(now, self._now)
        while True:
            self._receive(until)
            reached = self._machine.run(until)
            self._now = max(self._now, reached)
            if reached >= until and not self._wire.arrived(until):
                break

    def take_output(self, now: float) -> bytes:
        """Return the bytes that have come out by *now* and were not taken yet."""
        self.advance(now)
        return self._transmitter.take(self._now)

    def next_event_at(self) -> float | None:
        """Return when something may happen that the host is told, or when it is time to look; None: never."""
        at = min(self._transmitter.next_at(), self._hears_at())
        machine_at = self._machine.next_at()
        if machine_at < inf:
            at = min(at, machine_at if self._is_watched else max(machine_at, self._now + _LOOK_EVERY_S))
        if self._holds and not self._wire.is_stopped:
            at = min(at, self._wire.at(len(self._wire) - self.knobs.host_queue // 2 - 1))
        if len(self._wire) and not self._wire.is_stopped:
            at = min(at, max(self._wire.ends_at, self._now))
        return at if at < inf else None

    def connect(self, now: float | None = None) -> None:
        """Note that somebody is on the line; what came out while nobody was there is gone."""
        self.advance(now)
        self._transmitter.take(self._now)
        self._note(LogKind.CONNECTED)

    def disconnect(self, now: float | None = None) -> None:
        """Note that nobody is on the line; the cutter goes on with what it has."""
        self.advance(now)
        if self.knobs.lost_on_close and (lost := self._wire.cut(self._now)):
            self._note(LogKind.TROUBLE, f"{lost} bytes lost with the port")
        self._note(LogKind.DISCONNECTED)

    # The panel

    def press_pause(self, now: float | None = None) -> None:
        """Press PAUSE: execution is held, or goes on."""
        self._at_panel(now, self._pause)

    def press_setup(self, now: float | None = None) -> None:
        """Press SETUP: the light goes on or off; while paused, it ends the job and deletes what was received."""
        self._at_panel(now, self._setup)

    def press_view(self, now: float | None = None) -> None:
        """Press VIEW of an HP: the plot is held to be looked at, or goes on."""

        def view() -> None:
            self._machine.is_viewed = not self._machine.is_viewed
            self._note(LogKind.PANEL, "view" if self._machine.is_viewed else "view over")

        self._at_panel(now, view)

    def raise_lever(self, now: float | None = None) -> None:
        """Raise the lever: the sheet is loose, and nothing is cut."""
        self._at_panel(now, lambda: self._lever(is_up=True))

    def lower_lever(self, now: float | None = None) -> None:
        """Lower the lever."""
        self._at_panel(now, lambda: self._lever(is_up=False))

    def power_off(self, now: float | None = None) -> None:
        """Take the power away: what is stored and set is gone, and the tool stands where it was."""
        self._act(now, self._power_off)

    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""
        self._act(now, self._power_on)

    def power_cycle(self, now: float | None = None) -> None:
        """Take the power away and give it back at once."""
        self.power_off(now)
        self.power_on(now)

    def new_sheet(self, now: float | None = None) -> None:
        """Take away what was cut."""
        self._act(now, self.cuttings.clear)

    # Trouble

    def slow_down(self, factor: float, now: float | None = None) -> None:
        """Let what is begun from now on take so many times as long as the knobs say."""
        self._act(now, lambda: setattr(self._machine, "factor", factor))

    def inject(self, data: bytes, now: float | None = None) -> None:
        """Put bytes out of nothing on the line to the host at once."""
        self._act(now, lambda: self._transmitter.inject(data))

    def heal(self) -> None:
        """End all trouble that was asked for and has not come yet."""
        self.trouble.end()
        self._machine.factor = self.knobs.time_factor

    # Receiving

    def _receive(self, until: float) -> None:
        """Take what has arrived, piece by piece, with everything else that happens meanwhile in its order."""
        wire = self._wire
        while count := wire.arrived(until):
            if not self._hears_plainly:
                self._take_byte()
                continue
            count = min(count, wire.before(self._signs))
            if not count:
                self._take_byte()
                continue
            if not self._is_stored:
                self._machine_at(wire.next_at)
                self._refuse(len(wire.take(count)))
                continue
            headroom = self._handshakes.headroom
            if headroom < count:
                self._machine_at(wire.next_at)
                if not wire.arrived(until):
                    continue
                headroom = self._handshakes.headroom
                if not headroom:
                    self._take_byte()
                    continue
            count = min(count, headroom)
            first_at = wire.next_at
            self._buffer.append(wire.take(count), first_at, wire.byte_time_s)
            self._handshakes.stored(count, first_at + (count - 1) * wire.byte_time_s)

    @property
    def _hears_plainly(self) -> bool:
        """Whether what comes is data, but for some signs."""
        return (
            self._control.is_idle
            and not self._transmitter.awaits_trigger
            and self._transmitter.discards_from == inf
            and not self.trouble.spoils
            and self._drops_until == -inf
        )

    @property
    def _signs(self) -> bytes:
        return _ESC + self._handshakes.enquiry

    @property
    def _is_stored(self) -> bool:
        return self._is_on and (self._machine.is_ready or self.knobs.accept_when_not_ready)

    def _machine_at(self, at: float) -> None:
        """Let the machine do what it does before *at*."""
        while self._machine.run(at) < at:
            pass
        self._now = max(self._now, at)

    def _take_byte(self) -> None:
        """Take one byte, at the very time at which it arrives."""
        at = self._wire.next_at
        self._machine_at(at)
        if self._wire.next_at != at:  # the host was let go on meanwhile
            return
        byte = self._wire.take(1)[0]
        if not self._is_on:
            return
        if self.knobs.data_bits == 7:
            byte &= 0x7F
        if self.trouble.spoils and (spoilt := self.trouble.spoilt(byte)) is not None:
            self._on_io_error(15)
            byte = spoilt
        transmitter = self._transmitter
        if transmitter.awaits_trigger:
            if byte == transmitter.format.trigger:
                transmitter.triggered(at)
            else:
                self._listen_for_abort(byte, at)
        elif at >= transmitter.discards_from:
            if byte == transmitter.format.echo_terminator:
                transmitter.discards_from = inf
            else:
                self._listen_for_abort(byte, at)
        elif not self._control.byte(byte, at):
            if bytes([byte]) == self._handshakes.enquiry:
                self._handshakes.asked(at)
            else:
                self._store(byte, at)

    def _listen_for_abort(self, byte: int, at: float) -> None:
        """Hear ``.J`` and ``.R`` also where all else is ignored, or nobody could end that."""
        self._heard = (self._heard + bytes([byte]))[-3:]
        if self._heard in _ABORTS:
            for each in self._heard:
                self._control.byte(each, at)
            self._heard = b""

    def _store(self, byte: int, at: float) -> None:
        """Store a byte with which something may have to be said, or which is lost."""
        buffer = self._buffer
        data = bytes([byte])
        if at <= self._drops_until:
            return
        self._drops_until = -inf
        if not self._is_stored:
            self._refuse(1)
            return
        if not buffer.room:
            self._lost += 1
            self._on_io_error(16)
            self._note_count(LogKind.OVERFLOW, self._lost)
            if self.knobs.overflow_drop == "newest":
                return
            buffer.drop_oldest(1)
            self._machine.forget_next()
        if buffer.room:
            buffer.append(data, at, 0.0)
            self._handshakes.stored(1, at)

    def _refuse(self, count: int) -> None:
        """Lose bytes that a machine that is not ready does not take."""
        if self._is_on:
            self._refused += count
            self._note_count(LogKind.REFUSED, self._refused)

    def _note_count(self, kind: LogKind, count: int) -> None:
        """Note how many bytes were lost, in one entry as long as nothing else is noted."""
        if self.log and self.log[-1].kind is kind:
            self.log.pop()
        self._note(kind, str(count))

    # When to look

    def _hears_at(self) -> float:
        """Return when something arrives that may have to be answered."""
        wire = self._wire
        if not len(wire) or wire.is_stopped:
            return inf
        if not self._hears_plainly:
            return wire.at(0)
        at = inf
        for sign in (_ESC, b"O"):  # behind both, two characters at least
            first = wire.first(sign)
            if first is not None:
                at = min(at, wire.at(first + 2))
        if enquiry := self._handshakes.enquiry:
            asked = wire.first(enquiry)
            at = min(at, inf if asked is None else wire.at(asked))
        told = self._handshakes.until_told
        return at if told is None else min(at, wire.at(told))

    @property
    def _is_watched(self) -> bool:
        """Whether the host is told of something that the machine does."""
        return (
            self._handshakes.waits_for_room
            or self._owes_size
            or self.log.on_entry is not None
            or b"O" in self._buffer.data
        )

    # What the machine tells

    def freed(self, now: float) -> bool:
        """Let the host go on, if that is what it waits for."""
        if self._owes_size and not self._buffer.stored:
            self._owes_size = False
            self._reply("L", str(self._handshakes.logical_bytes), now)
        return self._handshakes.freed(now) if self._handshakes.waits_for_room else False

    def asked(self, name: str, now: float) -> None:
        """Answer an output instruction."""
        if self._is_answering(now):
            self._on_io_error(10)
        else:
            self._reply(name, output(name, self._machine, self.knobs, now), now)

    # What device control instructions do

    def obey(self, text: str, now: float) -> None:
        """Note a device control instruction."""
        self._now = max(self._now, now)
        self._note(LogKind.CONTROL, text)
        data = self._buffer.data
        if self.knobs.esc_splits_instruction and self._machine.partial() and data and self._buffer.room:
            self._buffer.append(b";", now, 0.0)
        if stray := self.trouble.stray():
            self._transmitter.inject(stray)

    def answer(self, letter: str, now: float) -> None:
        """Answer a question, unless another answer is unfinished."""
        if self._is_answering(now):
            self._on_io_error(10)
            return
        match letter:
            case "B":
                self._reply(letter, str(self._handshakes.told_free), now)
            case "E":
                error, self._io_error = self._io_error, 0
                self._reply(letter, "" if not error and self.knobs.empty_e else str(error), now)
            case "O":
                is_empty = not self._buffer.stored
                self._reply(letter, str(status(self._machine, self.knobs, is_empty=is_empty)), now)
            case "A":
                self._reply(letter, self.knobs.model_answer, now)
            case _:
                if self.knobs.size_waits and self._buffer.stored:
                    self._owes_size = True
                else:
                    self._reply(letter, str(self._handshakes.logical_bytes), now)

    def abort_output(self, now: float) -> None:
        """Drop what has not left, and what would be said later."""
        self._transmitter.abort(now)
        self._handshakes.abort()
        self._owes_size = False

    def clear(self, now: float) -> None:
        """Throw away all instructions but the one that is carried out."""
        self._clear("K", now, kept=0 if self.knobs.k_drops_partial else self._machine.partial())
        if self.knobs.k_window_ms:
            self._drops_until = now + self.knobs.k_window_ms / 1000
        if self.knobs.reset_clears_error:
            self._io_error = 0

    def reset(self, now: float) -> None:
        """Do what ``.R`` does besides what it stands for."""
        if self.knobs.reset_restores_dip:
            self._handshakes.power_on()
            self._handshakes.look(now)
        if self.knobs.reset_clears_error:
            self._io_error = 0

    def put(self, data: bytes, now: float) -> None:
        """Store what was no device control instruction after all."""
        for byte in data:
            self._store(byte, now)

    def note_io_error(self, code: int, now: float) -> None:
        """Keep an error of a device control instruction."""
        self._now = max(self._now, now)
        self._on_io_error(code)

    def _is_answering(self, now: float) -> bool:
        return self._owes_size or self._transmitter.is_busy(now)

    def _reply(self, asked: str, text: str, now: float) -> None:
        self.log.add(now, LogKind.ANSWER, f"{asked} {text}")
        reply, late_s = self.trouble.reply(text.encode())
        if reply is not None:
            self._transmitter.send(reply, OutputKind.REPLY, now, late_s=late_s)

    def _clear(self, by: str, now: float, *, kept: int = 0) -> None:
        self._machine.drop_waiting()
        self._machine.uncount()
        dropped = self._buffer.clear(kept=kept)
        self._machine.forget_next()
        self.log.add(now, LogKind.CLEARED, f"{by} {dropped}")
        self.freed(now)

    def _on_io_error(self, code: int) -> None:
        if not self._io_error or self.knobs.error_latch == "last":
            self._io_error = code
        if code != 16 or not self.log or self.log[-1].kind is not LogKind.OVERFLOW:
            self._note(LogKind.IO_ERROR, str(code))

    # Panel and power

    def _pause(self) -> None:
        self._machine.is_paused = not self._machine.is_paused
        self._note(LogKind.PANEL, "pause" if self._machine.is_paused else "resume")

    def _setup(self) -> None:
        if self._machine.is_paused:
            self._note(LogKind.PANEL, "cancel")
            self._clear("panel", self._now)
            self._machine.is_paused = False
            return
        self._machine.is_ready = not self._machine.is_ready
        self._note(LogKind.PANEL, "setup on" if self._machine.is_ready else "setup off")

    def _lever(self, *, is_up: bool) -> None:
        self._machine.is_lever_up = is_up
        self._note(LogKind.PANEL, "lever up" if is_up else "lever down")

    def _power_off(self) -> None:
        if self._is_on:
            self._note(LogKind.POWER, "off")
            self._machine.switch_off(self._now)
            self._clear("power", self._now)
            self.abort_output(self._now)
            self._is_on = False

    def _power_on(self) -> None:
        if not self._is_on:
            self._is_on = True
            self._note(LogKind.POWER, "on")
            self._io_error = self._lost = self._refused = 0
            self._heard, self._drops_until = b"", -inf
            self._machine.switch_on()
            self._control.power_on()
            self._handshakes.power_on()
            self._handshakes.look(self._now)

    def _at_panel(self, now: float | None, action: Callable[[], None]) -> None:
        """Do something that may hold the machine, or let it go on."""

        def act() -> None:
            if self._is_on:
                was_still = self._machine.stands_still
                action()
                self._machine.held(was_still, self._now)

        self._act(now, act)

    def _act(self, now: float | None, action: Callable[[], None]) -> None:
        self.advance(now)
        action()
        if self.served_by is not None:
            self.served_by.changed()

    def _note(self, kind: LogKind, text: str = "") -> None:
        self.log.add(self._now, kind, text)
