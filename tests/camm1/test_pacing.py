"""Handshakes: a buffer never overflows, the wire never waits without need, and damaged signs do no harm."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.camm1.handshakes import EnqAck, Hardwire, SoftwareChecking, XonXoff, pacing_of
from compax_aio.camm1.pacing import HANDSHAKES, Doing, Handshake, Pacing
from compax_aio.camm1.room import Room, reserve_of
from compax_aio.errors import InvalidCommandError

SIZES = (60, 256, 1024, 15360)
XON, XOFF = 0x11, 0x13


class SmallMachine:
    """
    The far end of a pacing, byte by byte: a buffer that empties by whole instructions, and all that it says of itself.

    One step is the time of a byte on the wire; what it says arrives *delay* steps later.
    """

    def __init__(self, pacing: Pacing, sizes: list[int], *, every: float, delay: int = 5) -> None:
        self.pacing = pacing
        self.sizes = deque(sizes)
        self.capacity = pacing.room.capacity_bytes
        self.stored: deque[int] = deque()
        self.bytes_stored = self.partial = 0
        self.most_stored = 0
        self.every = every
        """Steps that an instruction takes to be cut."""
        self.busy_until = 0.0
        self.wire: deque[Callable[[], None] | None] = deque()
        self.wire_steps = self.idle_steps = 0
        self.coming: deque[tuple[int, Callable[[], None]]] = deque()
        self.delay = delay
        self.step = 0
        self.is_xoff = self.awaits_ack = False
        self.fulls = 0
        self.held_for = 0

    def run(self, most_steps: int = 2_000_000) -> None:
        self.pacing.begin()
        pause_until = 0
        while (self.sizes or self.wire or self.stored) and self.step < most_steps:
            self.step += 1
            while self.coming and self.coming[0][0] <= self.step:
                self.coming.popleft()[1]()
            if self.step >= pause_until and not self._write():
                pause_until = self.step + 20
                self.pacing.begin()
            self._carry()
            self._cut()
        assert not self.sizes, f"stuck at step {self.step}"

    def _write(self) -> bool:
        """Do what the pacing says; False if the buffer is full."""
        while True:
            size = self.sizes[0] if self.sizes else None
            doing = self.pacing.next(size, len(self.wire))
            if doing is Doing.WRITE:
                assert size is not None
                self.sizes.popleft()
                self.pacing.wrote(size)
                self.wire.extend([None] * (size - 1))
                self.wire.append(lambda size=size: self._arrived(size))  # type: ignore[misc]
            elif doing is Doing.ASK:
                self.pacing.asked()
                self.wire.extend([self._skip] * (len(self.pacing.question) - 1))
                self.wire.append(self._asked)
            elif doing is Doing.HELD:
                self.held_for += 1
                if self.held_for > 500:
                    self.held_for = 0
                    self.pacing.look()
                    continue
                return True
            else:
                self.fulls += doing is Doing.FULL
                return doing is not Doing.FULL

    def _skip(self) -> None:
        """A byte of a question."""

    def _carry(self) -> None:
        if not self.wire:
            self.idle_steps += bool(self.sizes)
            return
        if isinstance(self.pacing, Hardwire) and self.capacity - self.bytes_stored < self.pacing.room.threshold_bytes:
            return  # DTR is low
        self.wire_steps += 1
        byte = self.wire.popleft()
        if byte is None or byte.__name__ == "<lambda>":
            self.bytes_stored += 1
            self.most_stored = max(self.most_stored, self.bytes_stored)
            self._watch_flow()
        if byte is not None:
            byte()

    def _arrived(self, size: int) -> None:
        self.stored.append(size)

    def _asked(self) -> None:
        if self.pacing.acknowledgement:
            self.awaits_ack = True
            self._watch_flow()
        else:
            free = self.capacity - self.bytes_stored
            self._say(lambda: self._answered(free))

    def _answered(self, free: int) -> None:
        assert self.pacing.answered(free)

    def _cut(self) -> None:
        if self.stored and self.step >= self.busy_until:
            self.bytes_stored -= self.stored.popleft()
            self.busy_until = self.step + self.every
            self._watch_flow()

    def _watch_flow(self) -> None:
        free, pacing = self.capacity - self.bytes_stored, self.pacing
        if isinstance(pacing, EnqAck) and self.awaits_ack and free > pacing.announced_bytes:
            self.awaits_ack = False
            self._say(pacing.acknowledged)
        if isinstance(pacing, XonXoff):
            threshold = pacing.room.threshold_bytes
            if not self.is_xoff and free < threshold:
                self.is_xoff = True
                self._say(lambda: pacing.flow(XOFF))
            elif self.is_xoff and self.bytes_stored <= min(self.capacity // 2, self.capacity - 1 - threshold):
                self.is_xoff = False
                self._say(lambda: pacing.flow(XON))

    def _say(self, what: Callable[[], None]) -> None:
        self.coming.append((self.step + self.delay, what))


def instructions(seed: int, total: int, longest: int) -> list[int]:
    random = Random(seed)
    sizes: list[int] = []
    while sum(sizes) < total:
        sizes.append(random.randrange(3, longest + 1))
    return sizes


def machine(handshake: Handshake, size: int, *, every: float, total: int = 20_000, seed: int = 1) -> SmallMachine:
    pacing = pacing_of(handshake, Room.of(size))
    return SmallMachine(pacing, instructions(seed, total, min(15, pacing.longest_bytes)), every=every)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("handshake", HANDSHAKES)
def test_a_fast_cutter_keeps_the_wire_busy_and_its_buffer_never_overflows(handshake: Handshake, size: int) -> None:
    far = machine(handshake, size, every=3)
    far.run()
    assert far.most_stored <= size
    assert far.wire_steps / (far.wire_steps + far.idle_steps) >= 0.97


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("handshake", HANDSHAKES)
def test_a_slow_cutter_is_never_without_work_and_its_buffer_never_overflows(handshake: Handshake, size: int) -> None:
    far = machine(handshake, size, every=60)
    far.run()
    assert far.most_stored <= size
    assert far.step <= 60 * len(instructions(1, 20_000, min(15, far.pacing.longest_bytes))) * 1.1 + 2000


@given(
    st.sampled_from(HANDSHAKES),
    st.integers(min_value=40, max_value=2000),
    st.integers(min_value=0, max_value=80),
    st.integers(min_value=1, max_value=8),
    st.integers(),
)
def test_no_buffer_overflows_at_any_size_and_any_speed(
    handshake: Handshake, size: int, every: int, delay: int, seed: int
) -> None:
    pacing = pacing_of(handshake, Room.of(size))
    far = SmallMachine(pacing, instructions(seed, 3000, min(20, pacing.most_bytes)), every=every, delay=delay)
    far.run()
    assert far.most_stored <= size


def test_room_stays_free_for_the_cutter_that_counts_otherwise() -> None:
    far = machine("software", 1024, every=200)
    far.run()
    assert far.most_stored <= 1024 - 128
    assert [reserve_of(size) for size in SIZES] == [16, 32, 128, 128]


# Software checking ----------------------------------------------------------------------------------------------------


def software(size: int = 1024) -> SoftwareChecking:
    pacing = SoftwareChecking(Room.of(size))
    pacing.begin()
    return pacing


def ask(pacing: Pacing, free: int) -> None:
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    assert pacing.answered(free)


def write(pacing: Pacing, count: int, size: int = 10) -> None:
    for _ in range(count):
        assert pacing.next(size, None) is Doing.WRITE
        pacing.wrote(size)


def test_nothing_is_sent_before_the_first_answer() -> None:
    pacing = software()
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    assert pacing.next(10, 0) is Doing.AWAIT


def test_the_next_question_goes_out_while_there_is_credit_left_and_more_goes_behind_it() -> None:
    pacing = software()
    ask(pacing, 1024)
    write(pacing, 12)
    assert pacing.next(10, 0) is Doing.ASK  # half of the window is on its way
    pacing.asked()
    write(pacing, 12)
    assert pacing.next(10, 0) is Doing.AWAIT


def test_a_cutter_without_room_is_full_once_it_has_said_so_of_all_that_was_sent() -> None:
    pacing = software()
    ask(pacing, 150)
    write(pacing, 1)
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    write(pacing, 1)
    assert pacing.next(10, 0) is Doing.AWAIT
    assert pacing.answered(140)
    assert pacing.next(10, 0) is Doing.ASK  # that answer did not count what was sent behind it
    pacing.asked()
    assert pacing.answered(130)
    assert pacing.next(10, 0) is Doing.FULL
    pacing.begin()
    assert pacing.next(10, 0) is Doing.ASK


def test_a_sudden_jump_of_free_space_is_asked_for_twice_and_the_lesser_answer_counts() -> None:
    pacing = software()
    ask(pacing, 138)
    write(pacing, 1)
    pacing.next(10, 0)
    pacing.asked()
    assert pacing.answered(364)  # "164" with a damaged digit
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    assert pacing.next(10, 0) is Doing.AWAIT  # it is not believed yet
    assert pacing.answered(164)
    sent = 0
    while (doing := pacing.next(10, 0)) is not Doing.AWAIT:
        if doing is Doing.WRITE:
            pacing.wrote(10)
            sent += 10
        else:
            pacing.asked()
    assert sent == 30


def test_more_than_the_buffer_has_is_no_answer() -> None:
    pacing = software()
    pacing.next(10, 0)
    pacing.asked()
    assert not pacing.answered(1025)


def test_an_answer_that_nobody_waits_for_changes_nothing() -> None:
    assert not software().answered(1000)


def test_what_the_cutter_has_taken_is_what_it_was_sent_less_what_it_holds() -> None:
    pacing = software()
    before = pacing.taken_bytes
    assert before is None
    ask(pacing, 1024)
    write(pacing, 12)
    pacing.next(10, 0)
    pacing.asked()
    assert pacing.answered(924)
    assert pacing.taken_bytes == 20
    pacing.told(1000)
    assert (pacing.taken_bytes, pacing.free_bytes) == (96, 1000)
    pacing.told(4000)  # nonsense
    assert pacing.free_bytes == 1000


# ENQ/ACK --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES)
def test_a_block_is_announced_larger_than_it_is_and_smaller_than_the_buffer(size: int) -> None:
    pacing = EnqAck(Room.of(size), 2)
    assert pacing.block_bytes < pacing.announced_bytes < size
    assert pacing.block_bytes <= size // 2


def test_one_acknowledgement_buys_one_block_counted_from_its_enquiry() -> None:
    pacing = EnqAck(Room.of(256), 2)
    pacing.begin()
    assert pacing.next(10, None) is Doing.ASK
    pacing.asked()
    pacing.acknowledged()
    sent = asked = 0
    while (doing := pacing.next(10, None)) is not Doing.AWAIT:
        if doing is Doing.WRITE:
            pacing.wrote(10)
            sent += 10
        else:
            pacing.asked()
            asked += 1
    assert asked == 1
    assert pacing.block_bytes - 10 < sent <= pacing.block_bytes


def test_an_immediate_response_says_what_has_arrived_and_buys_nothing() -> None:
    pacing = EnqAck(Room.of(256), 1)
    pacing.begin()
    pacing.next(10, None)
    pacing.asked()
    pacing.heard()
    assert pacing.next(10, None) is Doing.AWAIT


def test_an_acknowledgement_that_nobody_waits_for_buys_nothing() -> None:
    pacing = EnqAck(Room.of(256), 1)
    pacing.begin()
    pacing.acknowledged()
    pacing.heard()
    assert pacing.next(10, None) is Doing.ASK


def test_an_acknowledgement_shows_what_was_taken_at_least() -> None:
    pacing = EnqAck(Room.of(1024), 2)
    pacing.begin()
    pacing.asked()
    pacing.acknowledged()
    assert pacing.taken_bytes == 0
    pacing.told(1024)
    assert pacing.taken_bytes == 0


# Xon/Xoff -------------------------------------------------------------------------------------------------------------


def xonxoff(size: int = 1024) -> XonXoff:
    pacing = XonXoff(Room.of(size))
    pacing.begin()
    return pacing


def test_nothing_is_asked_as_long_as_nothing_stops_it() -> None:
    pacing = xonxoff()
    for _ in range(100):
        assert pacing.next(10, 0) is Doing.WRITE
        pacing.wrote(10)


def test_no_more_waits_to_leave_than_there_is_room_for_after_xoff() -> None:
    for size in SIZES:
        pacing = xonxoff(size)
        assert pacing.most_unsent_bytes < pacing.room.threshold_bytes <= size // 2
        assert pacing.next(10, pacing.most_unsent_bytes) is Doing.PAUSE
        assert pacing.low_unsent_bytes < pacing.most_unsent_bytes


def test_where_nobody_knows_what_is_unsent_answers_tell_what_has_arrived() -> None:
    pacing = xonxoff()
    sent = 0
    while pacing.next(10, None) is Doing.WRITE:
        pacing.wrote(10)
        sent += 10
    assert pacing.next(10, None) is Doing.ASK
    assert sent <= pacing.most_unsent_bytes


def test_xoff_stops_and_xon_has_free_space_asked_for_before_more_is_sent() -> None:
    pacing = xonxoff()
    pacing.flow(XOFF)
    pacing.flow(XOFF)
    assert pacing.next(10, 0) is Doing.HELD
    pacing.flow(XON)
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    assert pacing.next(10, 0) is Doing.AWAIT
    assert pacing.answered(600)
    assert pacing.next(10, 0) is Doing.WRITE


def test_an_xon_that_noise_has_made_lets_nothing_go() -> None:
    pacing = xonxoff()
    pacing.flow(XOFF)
    pacing.flow(XON)
    pacing.next(10, 0)
    pacing.asked()
    assert pacing.answered(100)
    assert pacing.next(10, 0) is Doing.FULL


def test_a_lost_xon_is_found_out_and_no_more_is_sent_than_was_said_to_be_free_until_the_next() -> None:
    pacing = xonxoff()
    write(pacing, 1)
    pacing.flow(XOFF)
    pacing.look()
    assert pacing.next(10, 0) is Doing.ASK
    pacing.asked()
    assert pacing.answered(400)
    sent = 0
    while pacing.next(10, 0) is Doing.WRITE:
        pacing.wrote(10)
        sent += 10
    assert sent <= 400 - 128
    pacing.flow(XOFF)
    pacing.flow(XON)
    pacing.next(10, 0)
    pacing.asked()
    assert pacing.answered(1024)
    for _ in range(100):
        assert pacing.next(10, 0) is Doing.WRITE
        pacing.wrote(10)


def test_an_xon_between_two_bursts_is_not_forgotten() -> None:
    pacing = xonxoff()
    pacing.flow(XOFF)
    pacing.flow(XON)
    pacing.begin()
    assert pacing.next(10, 0) is Doing.ASK


def test_signs_of_flow_are_noise_to_the_others() -> None:
    pacing = software()
    pacing.flow(XOFF)
    assert pacing.next(10, 0) is Doing.ASK


# What is refused ------------------------------------------------------------------------------------------------------


def test_a_buffer_that_is_too_small_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="too small"):
        Room.of(20)
    with pytest.raises(InvalidCommandError, match="too small"):
        Room.of(60, reserve_bytes=55)


def test_a_handshake_that_nobody_knows_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="'software'"):
        pacing_of("rts", Room.of(1024))  # type: ignore[arg-type]


@pytest.mark.parametrize("handshake", HANDSHAKES)
def test_a_burst_is_done_when_nothing_is_left_and_nothing_outstanding(handshake: Handshake) -> None:
    pacing = pacing_of(handshake, Room.of(1024))
    pacing.begin()
    assert pacing.next(None, 0) is Doing.DONE
    pacing.asked()
    assert pacing.next(None, 0) is Doing.AWAIT
    assert pacing.handshake == handshake
