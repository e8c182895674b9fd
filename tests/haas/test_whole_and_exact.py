"""
Files go whole and byte for byte by each synchronisation, both ways, whatever befalls the line; or it is told.

The far end's own memory, and the bytes that it says to have sent, are what results are compared with. What delays or
parts bytes, or holds the line, changes nothing. What damages them is repaired (XMODEM), found at its place (a parity
bit in the bytes), or found by looking twice (``verify=True``). Two megabytes go both ways by each of them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from random import Random
from typing import Any, Final

import pytest
from tests.haas.bench import IN_BYTES, MODES, Bench, bench, outcome, program_of, text_of, until

from compax_aio.errors import CompaxError, UnexpectedAnswerError
from compax_aio.haas.profiles import CLASSIC_XMODEM, Profile
from compax_aio.haas.settings import ControlSettings
from compax_aio.haas.transfer import Received, Sent
from compax_aio.simulator.faulty_cable import FaultyCable, Noise

SEEDS: Final = range(12)
WAYS: Final = ("receive", "send")
LARGE_BYTES: Final = 2 * 1024 * 1024
NUMBER: Final = "O01234"


def _cable() -> FaultyCable:
    return FaultyCable(b"\r", lambda _: None, on_command=lambda: None, on_cut=lambda: None)


def _bench(profile: Profile, cable: FaultyCable, **knobs: Any) -> AbstractAsyncContextManager[Bench]:
    rate = knobs.pop("baudrate", 9600)
    settings = ControlSettings(baud_rate=rate, reconnect=False)
    return bench(profile, cable=cable, baudrate=rate, settings=settings, **knobs)


async def _transferred(b: Bench, way: str, text: str, **how: Any) -> Any:
    """Have a file go one way; return what came of it."""
    if way == "receive":
        b.far.memory.programs[NUMBER] = text
        return await outcome(b.control.receive_program(on_operator=b.hand(*[("send", NUMBER)] * 2), **how))
    b.far.memory.programs.clear()
    b.far.press_recv()
    presses = b.hand(("send", NUMBER))
    is_asked = False

    def operator(_: str) -> None:
        nonlocal is_asked  # first for RECV, which is pressed
        if is_asked:
            presses(_)
        is_asked = True

    return await outcome(b.control.send_program(text, on_operator=operator, **how))


async def _is_exact(b: Bench, way: str, text: str, result: Any) -> bool:
    """Whether what is at the other end is what was at this one, once all is there that has left the line."""
    if way == "receive":
        return text_of(bytes(result)) == text
    await until(lambda: b.far.doing == "nothing", 300.0)
    return b.far.memory.programs == {NUMBER: text}


# What delays ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mode", MODES)
async def test_what_delays_parts_or_holds_bytes_changes_nothing(mode: str, way: str, seed: int) -> None:
    random = Random(f"{mode} {way} {seed}")
    cable = _cable()
    cable.piece = random.choice((None, 1, 3, 17))
    cable.piece_gap_s = random.choice((0.0, 0.001, 0.02))
    cable.delay_s["to_host"] = random.choice((0.0, 0.01, 0.3))
    cable.delay_s["to_drive"] = random.choice((0.0, 0.01))
    text = program_of(random.randrange(200, 2500), seed)
    knobs = {"take_bytes_s": random.choice((0.0, 0.0, 600.0)), "slack": 512}
    async with _bench(MODES[mode], cable, **knobs) as b:
        for _ in range(random.randrange(3)):
            at = random.uniform(0.5, 4)
            asyncio.get_running_loop().call_later(at, b.line.hold, True)
            asyncio.get_running_loop().call_later(at + random.uniform(0.1, 3), b.line.hold, False)
        result = await _transferred(b, way, text)
        assert isinstance(result, Received | Sent), f"seed {seed}: {result}"
        assert await _is_exact(b, way, text, result), f"seed {seed}"
        assert not b.far.alarms, f"seed {seed}: {b.far.alarms}"


# What damages --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["garbled", "lost", "doubled"])
@pytest.mark.parametrize("way", WAYS)
async def test_xmodem_repairs_what_is_damaged_or_says_that_it_cannot(way: str, kind: str, seed: int) -> None:
    """
    One damaged byte in some hundred: blocks are asked for again.

    The control cannot damage what it has acknowledged; what came here is compared with what it has sent. A sum of one
    byte does not see all that several damages do to one block, so single ones are rare enough here not to meet.
    """
    cable = _cable()
    cable.noises.append(Noise(kind, 1 / 500, f"{way} {seed}"))
    text = program_of(1500, seed)
    async with _bench(CLASSIC_XMODEM, cable) as b:
        result = await _transferred(b, way, text)
        if isinstance(result, CompaxError):
            assert result.transfer is not None  # type: ignore[attr-defined]
        elif way == "receive":
            assert text_of(bytes(result)) == text, f"seed {seed}"
        else:
            # The simulated control is fooled by nothing but what fools a sum of one byte.
            assert b.far.memory.programs[NUMBER] == text, f"seed {seed}"


@pytest.mark.parametrize("seed", range(40))
async def test_a_parity_bit_in_the_bytes_finds_single_damage_at_its_place(seed: int) -> None:
    random = Random(seed)
    text = program_of(800, seed)
    cable = _cable()
    async with _bench(IN_BYTES, cable) as b:
        good = await _transferred(b, "receive", text)
        place = random.randrange(4, len(good.data) - 6)
        b.far.trouble.spoil_sent_byte(place)
        result = await _transferred(b, "receive", text)
        assert isinstance(result, UnexpectedAnswerError), f"seed {seed}: damage at {place} was taken"
        assert result.transfer.damage_offsets == (place,), f"seed {seed}"  # type: ignore[attr-defined]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["garbled", "lost", "doubled"])
@pytest.mark.parametrize("mode", MODES)
async def test_what_is_received_twice_is_exact_or_told(mode: str, kind: str, seed: int) -> None:
    cable = _cable()
    cable.noises.append(Noise(kind, 1 / 700, f"{mode} {kind} {seed}"))
    text = program_of(1200, seed)
    async with _bench(MODES[mode], cable) as b:
        result = await _transferred(b, "receive", text, verify=True, operator_timeout_s=20)
        if isinstance(result, CompaxError):
            assert result.transfer is not None  # type: ignore[attr-defined]
        else:
            assert text_of(bytes(result)) == text, f"seed {seed}"
            assert result.verified.equal == "byte for byte"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["garbled", "lost", "doubled"])
@pytest.mark.parametrize("mode", MODES)
async def test_what_is_sent_and_read_back_is_exact_or_told(mode: str, kind: str, seed: int) -> None:
    cable = _cable()
    cable.noises.append(Noise(kind, 1 / 1500, f"{mode} {kind} {seed}"))
    text = program_of(1200, seed)
    async with _bench(MODES[mode], cable, input_timeout_s=5.0) as b:
        result = await _transferred(b, "send", text, verify=True, operator_timeout_s=20)
        if isinstance(result, CompaxError):
            assert result.transfer is not None  # type: ignore[attr-defined]
        else:
            assert result.proof == "read back equal"
            assert b.far.memory.programs.get(NUMBER) == text, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("mode", MODES)
async def test_whatever_becomes_of_it_the_next_one_is_whole(mode: str, seed: int) -> None:
    cable = _cable()
    random = Random(f"{mode} {seed}")
    cable.noises.append(Noise(random.choice(("garbled", "lost", "doubled")), 1 / 100, f"{mode} {seed}"))
    text = program_of(1200, seed)
    async with _bench(MODES[mode], cable) as b:
        transfer = b.control.receive_program(on_operator=b.hand(("send", NUMBER)), operator_timeout_s=20)
        b.far.memory.programs[NUMBER] = text
        await asyncio.wait([transfer], timeout=random.choice((0.5, 1.5, 3.0, 200.0)))
        transfer.cancel()
        await asyncio.wait([transfer])
        cable.heal()
        await asyncio.sleep(2)
        b.far.press_reset()
        await asyncio.sleep(3)
        result = await _transferred(b, "receive", text)
        assert isinstance(result, Received), f"seed {seed}: {result}"
        assert text_of(bytes(result)) == text, f"seed {seed}"


# Two megabytes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mode", MODES)
async def test_two_megabytes_go_whole_and_exact(mode: str, way: str) -> None:
    text = program_of(LARGE_BYTES)
    cable = _cable()
    profile = replace(MODES[mode], baudrate=115200)
    async with _bench(profile, cable, baudrate=115200) as b:
        hold: Callable[[bool], None] = b.line.hold
        for at in (3.0, 10.0, 50.0):
            asyncio.get_running_loop().call_later(at, hold, True)
            asyncio.get_running_loop().call_later(at + 2, hold, False)
        result = await _transferred(b, way, text)
        assert isinstance(result, Received | Sent), result
        assert await _is_exact(b, way, text, result)
