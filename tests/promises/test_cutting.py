"""P1 to P10 for cutting: jobs with every handshake, in trouble of every kind, weighed by the far end's testimony."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import pytest
from tests.camm1.bench import HANDSHAKES, Bench, Handshake, bench, codes, expected_vectors, job_of, vectors

from compax_aio.camm1.cut import Cut, CutResult
from compax_aio.camm1.settings import CutterSettings
from compax_aio.errors import (
    CompaxError,
    DriveFaultError,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
)
from compax_aio.simulator.clock import VirtualClockLoop

SEEDS_A_TEST = 10
SMALL_JOB = "IN;PU0,0;PD100,100;PU;"
LONGEST_S = 3000.0
"""Longer than anything may take that is awaited, pauses of the operator included (P3)."""


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@dataclass(frozen=True)
class Scenario:
    """What is cut, on which machine, and what befalls it, all from one seed."""

    seed: int
    handshake: Handshake
    job: str
    knobs: dict[str, Any]
    troubles: tuple[tuple[float, str], ...]

    @classmethod
    def of(cls, seed: int) -> Scenario:
        random = Random(seed)
        handshake = random.choice(HANDSHAKES)
        size = random.choice([60, 100, 255, 256, 1024, 1024, 15360])
        knobs: dict[str, Any] = {
            "physical_size": size,
            "seed": random.randrange(2**31),
            "dtr_wired": handshake == "hardwire",
            "dtr_overshoot": random.choice([0, 16]) if size >= 255 else 0,
            "time_factor": random.choice([0.05, 0.3, 1.0]),
            "hidden_slack": random.choice([0, 0, -8, 8]),
            "xoff_repeat_every": random.choice([0, 0, 50]),
            "delay_on_xon": random.choice([False, True]),
            "ack_compare": random.choice(["gt", "ge"]),
            "free_on": random.choice(["fetch", "finish"]),
            "error_latch": random.choice(["last", "first"]),
            "k_window_ms": random.choice([0, 0, 20]),
            "k_drops_partial": random.choice([True, False]),
            "esc_splits_instruction": random.choice([False, True]),
            "o_answers": random.choice(["parse", "motion"]),
            "status_style": random.choice(["codes", "word"]),
            "power_on_handshake": random.choice(["model", "hardwire", "xonxoff", "dummy"]),
            "reset_clears_error": random.choice([True, False]),
            "overflow_drop": random.choice(["newest", "oldest"]),
            "late_s": random.choice([0.3, 1.9, 2.5, 6.0]),
        }
        for name in ("lose_reply", "garble_reply", "late_reply", "lose_xon", "stray_byte"):
            if random.random() < 0.35:
                knobs[name] = random.choice([0.001, 0.01, 0.05])
        kinds = ["pause", "operator ends", "power", "line", "abort", "cancel", "hold", "slow", "ask", "three lost"]
        if handshake == "hardwire":
            kinds.remove("operator ends")  # nobody can be asked while the cable holds the line: see the documents
        troubles = tuple(
            sorted((random.uniform(0.3, 12), random.choice(kinds)) for _ in range(random.choice([0, 0, 1, 1, 2])))
        )
        job = job_of(random.choice([300, 1500, 4000]), seed, longest_list=random.choice([1, 1, 12]))
        return cls(seed, handshake, job, knobs, troubles)


async def befall(scenario: Scenario, on: Bench, cut: Cut) -> None:
    """Let the troubles come, each at its time."""
    random, before = Random(scenario.seed + 1), 0.0
    for at, kind in scenario.troubles:
        await asyncio.sleep(max(0.0, at - before))
        before = at
        await _befall(kind, random, on, cut)


async def _befall(kind: str, random: Random, on: Bench, cut: Cut) -> None:  # noqa: C901, PLR0912  # a table
    far = on.far
    if kind == "pause":
        far.press_pause()
        await asyncio.sleep(random.uniform(0.5, 30))
        if far.is_paused:
            far.press_pause()
    elif kind == "operator ends":
        far.press_pause()
        await asyncio.sleep(random.uniform(1.5, 5))
        if far.is_paused:
            far.press_setup()
    elif kind == "power":
        far.power_off()
        await asyncio.sleep(random.choice([0.5, 12]))
        far.power_on()
    elif kind == "line":
        on.lose_line()
    elif kind == "abort":
        with suppress(CompaxError):
            await cut.abort()
    elif kind == "cancel":
        cut.cancel()
    elif kind == "hold":
        await cut.pause()
        await asyncio.sleep(random.uniform(0, 5))
        await cut.resume()
    elif kind == "slow":
        far.slow_down(20)
        await asyncio.sleep(5)
        far.slow_down(1)
    elif kind == "ask":
        for question in (on.cutter.status, on.cutter.free_space):
            with suppress(CompaxError):
                await question()
    else:
        far.trouble.replies_to_lose = 3


async def play(scenario: Scenario) -> str:
    """Cut the job in trouble, weigh what came of it, then see whether the machine can be used; say how it ended."""
    settings = CutterSettings(baud_rate=9600, held_timeout_s=60)
    try:
        manager = bench(settings, fails_to_close=True, **scenario.knobs)
        on = await manager.__aenter__()
    except CompaxError as error:
        return f"not connected: {type(error).__name__}"
    try:
        cut = on.cutter.cut(scenario.job, handshake=scenario.handshake, check=bool(scenario.seed % 2))
        trouble = asyncio.create_task(befall(scenario, on, cut))
        async with asyncio.timeout(LONGEST_S):
            await asyncio.wait([cut])
            await trouble
            with suppress(CompaxError):
                await cut.abort()  # or wait for the abort that is under way
        how = "cancelled" if cut.cancelled() else type(cut.exception() or cut.result()).__name__
        weigh(scenario, on, cut)
        await check_usable(scenario, on)
        return how
    finally:
        await manager.__aexit__(None, None, None)


def weigh(scenario: Scenario, on: Bench, cut: Cut) -> None:
    made, wanted = vectors(on.far), expected_vectors(scenario.job)
    kinds = {kind for _, kind in scenario.troubles}
    error = None if cut.cancelled() else cut.exception()
    if not cut.cancelled() and error is None:
        assert isinstance(cut.result(), CutResult)
        assert made == wanted, "P10: told as cut, and it is not"
        assert on.far.lost_bytes == 0
    elif on.far.lost_bytes:
        assert isinstance(error, DriveFaultError | MoveInDoubtError) or cut.cancelled(), "P10: bytes lost and not told"
    elif not kinds & {"power", "operator ends"}:
        assert made == wanted[: len(made)], "P2: what was cut is no beginning of the job"
    if isinstance(error, CompaxError) and not isinstance(error, InvalidCommandError | MoveActiveError):
        account = error.job  # type: ignore[attr-defined]  # every error of a job has it
        assert 0 <= account.bytes_sent <= len(scenario.job)
        assert account.instructions_taken is None or account.instructions_taken <= account.instructions_sent
    # P1: one question at a time; the cutter itself may say Xoff in the moment in which a question arrives.
    assert "10" not in codes(on.far) or scenario.handshake == "xonxoff"
    assert not {"11", "12", "13", "14"} & set(codes(on.far))


async def check_usable(scenario: Scenario, on: Bench) -> None:
    """Without trouble, the machine can be stopped, and cuts the next job."""
    on.far.heal()
    on.far.trouble._knobs = replace(on.far.knobs, lose_reply=0, garble_reply=0, late_reply=0, lose_xon=0, stray_byte=0)
    async with asyncio.timeout(LONGEST_S):
        while True:
            try:
                await on.cutter.stop()
                break
            except CompaxError:
                await asyncio.sleep(5)
        on.far.new_sheet()
        await on.cutter.cut(SMALL_JOB, handshake=scenario.handshake)
    assert [each for each in vectors(on.far) if each[4]] == [(0, 0, 100, 100, True)]


def run(seed: int) -> str:
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        return runner.run(play(Scenario.of(seed)))


@pytest.mark.parametrize("first", range(0, 250, SEEDS_A_TEST))
def test_whatever_befalls_a_job_what_is_told_of_it_is_true_and_the_machine_stays_usable(first: int) -> None:
    for seed in range(first, first + SEEDS_A_TEST):
        try:
            run(seed)
        except BaseException as error:
            error.add_note(f"replay: python -m tests.promises.test_cutting {seed}")
            raise


def test_the_scenarios_lead_to_every_kind_of_ending() -> None:
    endings = {run(seed) for seed in range(1000, 1060)}
    assert {"CutResult", "MoveInDoubtError", "MoveStoppedError", "cancelled"} <= endings


if __name__ == "__main__":
    import sys

    for each in range(int(sys.argv[1]), int(sys.argv[-1]) + 1):
        sys.stdout.write(f"{each} {Scenario.of(each).handshake} {Scenario.of(each).troubles} {run(each)}\n")
