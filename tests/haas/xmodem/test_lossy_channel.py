"""Whatever a line does to single bytes: a file arrives as it was, or both ends do not say that it did."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.haas.xmodem.channel import Channel, Damage

from compax_aio.haas.xmodem import ReceiverTimes, XmodemReceiver, XmodemSender

Faults = dict[int, Damage]

SIGNS = b"\x01\x04\x06\x15\x18\x1a"


def program_of(size: int, seed: int = 1) -> bytes:
    random = Random(seed)
    lines = [f"N{at} G1 X{random.randrange(10_000) / 1000} F{random.randrange(99)}." for at in range(size // 16)]
    return ("\n%\nO01234\n" + "\n".join(lines) + "\n\n%\n").encode()


def lose(byte: int) -> bytes:
    return b""


def double(byte: int) -> bytes:
    return bytes([byte, byte])


def garble(mask: int) -> Damage:
    return lambda byte: bytes([byte ^ mask])


damages = st.one_of(st.just(lose), st.just(double), st.integers(1, 255).map(garble))


def run(data: bytes, to_receiver: Faults, to_sender: Faults) -> Channel:
    channel = Channel(XmodemSender(data), XmodemReceiver(), to_receiver, to_sender)
    channel.run()
    return channel


def is_true(channel: Channel, data: bytes) -> bool:
    """Whether the file is as it was, or is told to be doubtful."""
    return channel.data == data or bool(channel.receiver.doubtful_blocks)


def test_without_faults_a_file_arrives_and_no_block_goes_twice() -> None:
    data = program_of(5000)
    channel = run(data, {}, {})
    assert channel.data == data
    assert channel.sender.failure is channel.receiver.failure is None
    assert channel.sender.repeats == channel.receiver.repeats == channel.receiver.strays == 0


@given(at=st.integers(0, 132 * 12), damage=damages)
def test_one_damaged_byte_on_the_way_to_the_receiver_is_mended(at: int, damage: Damage) -> None:
    data = program_of(1500)
    channel = run(data, {at: damage}, {})
    assert channel.sender.failure is channel.receiver.failure is None
    assert is_true(channel, data)


@given(at=st.integers(0, 14), damage=damages)
def test_one_damaged_answer_never_passes_for_a_file(at: int, damage: Damage) -> None:
    data = program_of(1500)
    channel = run(data, {}, {at: damage})
    if channel.receiver.failure is None:
        assert is_true(channel, data)
    if channel.sender.failure is None:
        assert channel.receiver.failure is None


def apart(gaps: list[tuple[int, Damage]], least: int) -> Faults:
    """Put faults so far apart that no block has two: the sum of one byte does not see those for sure."""
    at, faults = -least, {}
    for gap, damage in gaps:
        at += least + gap
        faults[at] = damage
    return faults


@given(
    to_receiver=st.lists(st.tuples(st.integers(0, 300), damages), max_size=6).map(lambda gaps: apart(gaps, 133)),
    to_sender=st.dictionaries(st.integers(0, 30), st.one_of(st.just(lose), st.just(double)), max_size=6),
    size=st.integers(1, 1200),
)
def test_lost_and_doubled_answers_and_damaged_blocks_never_make_another_file(
    to_receiver: Faults, to_sender: Faults, size: int
) -> None:
    data = program_of(size)
    channel = run(data, to_receiver, to_sender)
    if channel.receiver.failure is None:
        assert is_true(channel, data)
    if channel.sender.failure is None:
        assert channel.receiver.failure is None


@pytest.mark.parametrize("seed", range(12))
def test_it_always_ends_on_a_line_that_spoils_everything(seed: int) -> None:
    random = Random(seed)
    spoilt: Faults = {at: random.choice([lose, double, garble(random.randrange(1, 256))]) for at in range(9, 60_000, 7)}
    channel = run(program_of(4000), spoilt, dict.fromkeys(range(0, 60_000, random.randrange(2, 5)), lose))
    assert channel.sender.failure is not None
    assert channel.receiver.failure is not None
    assert channel.now < 3000


@given(data=st.binary(min_size=1, max_size=700).filter(lambda data: not data.endswith(b"\x1a")))
def test_any_bytes_arrive_as_they_are(data: bytes) -> None:
    channel = run(data, {}, {})
    assert channel.data == data


@given(pieces=st.lists(st.binary(max_size=40), max_size=40))
def test_nothing_that_comes_makes_the_receiver_stumble(pieces: list[bytes]) -> None:
    receiver = XmodemReceiver(ReceiverTimes(start_s=30.0), eob=b"\r\n")
    receiver.begin()
    for piece in pieces:
        receiver.receive(piece)
        if len(piece) % 3 == 0 and not receiver.is_over:
            receiver.time_ran_out()
    assert receiver.is_over or receiver.patience_s > 0


@given(pieces=st.lists(st.one_of(st.binary(max_size=9), st.sampled_from([bytes([each]) for each in SIGNS]))))
def test_nothing_that_comes_makes_the_sender_stumble(pieces: list[bytes]) -> None:
    sender = XmodemSender(program_of(900))
    for at, piece in enumerate(pieces):
        sender.receive(piece, still_leaving=at % 4 == 0)
        if len(piece) % 3 == 0 and not sender.is_over:
            sender.time_ran_out()
    assert sender.is_over or sender.patience_s > 0
    assert sender.blocks <= sender.total_blocks


def test_a_file_of_more_than_256_blocks_arrives() -> None:
    data = program_of(40_000)
    faults: Faults = {132 * 255 + 40: garble(1), 132 * 257 + 3: lose}
    channel = run(data, faults, {200: lose})
    assert channel.data == data
    assert channel.receiver.blocks > 256
    assert channel.receiver.repeats == 1
