"""Faults befall a drive and its line when they are due, and are undone when the test is over."""

from __future__ import annotations

import asyncio

import pytest

import compax_aio
from compax_aio.compax.settings import DriveSettings
from compax_aio.testing import Faults, SimulatedAxis, SimulatedGroup, VirtualTime
from compax_aio.testing.stage import Due, Stage

IMPATIENT = DriveSettings(answer_timeout_s=0.3, in_doubt_after_s=2.0)


async def test_a_fault_stops_the_axis_when_it_is_due(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    faults.at(1.0).raise_fault(55)
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        with pytest.raises(compax_aio.DriveFaultError, match="E55"):
            await x.move_to(1000)
        assert simulated_drive.motions[0].ended_by == "fault"
    assert faults.happened == [(1.0, "drive: fault E55")]
    faults.assert_all_happened()


async def test_at_once_after_and_at_are_times_of_the_clock(
    simulated_drive: SimulatedAxis, faults: Faults, virtual_time: VirtualTime
) -> None:
    await asyncio.sleep(2)
    faults.silent(for_s=1)
    faults.after(0.5).deaf()
    faults.at(2.5).noise(b"\xff")
    faults.at(1).lose_answers(2)
    assert [(at, what.split(": ")[1]) for at, what in faults.happened] == [(2.0, "silent"), (2.0, "2 answers lost")]
    with pytest.raises(AssertionError, match="has not happened before the test was over: drive: deaf, drive: noise"):
        faults.assert_all_happened()
    await asyncio.sleep(2)
    assert [at for at, _ in faults.happened] == [2.0, 2.0, 2.5, 2.5]
    far_end = simulated_drive.far_end
    assert (far_end.silent, far_end.deaf, far_end.lose_answers) == (False, True, 2)
    faults.undo()
    assert (far_end.deaf, far_end.lose_answers) == (False, 0)


def test_what_is_asked_for_before_there_is_a_loop_counts_from_the_first_line(
    simulated_drive: SimulatedAxis, faults: Faults, virtual_time: VirtualTime
) -> None:
    faults.after(1.0).raise_fault(55)

    async def application() -> None:
        await asyncio.sleep(3)
        async with compax_aio.connect(simulated_drive.url) as drive:
            with pytest.raises(compax_aio.DriveFaultError):
                await drive.move_to(1000)

    asyncio.run(application())
    assert faults.happened == [(4.0, "drive: fault E55")]


def test_a_fault_that_was_not_due_when_a_loop_ended_befalls_the_next_one(
    simulated_drive: SimulatedAxis, faults: Faults, virtual_time: VirtualTime
) -> None:
    faults.at(1.0).silent(for_s=2)
    faults.at(9.0).deaf()

    async def application(target: float) -> None:
        async with compax_aio.connect(simulated_drive.url) as drive:
            await drive.move_to(target)

    asyncio.run(application(1))
    assert virtual_time.now < 1
    assert faults.happened == []

    async def looks_on() -> tuple[bool, bool]:
        async with compax_aio.connect(simulated_drive.url):
            await asyncio.sleep(1.5 - virtual_time.now)
            return simulated_drive.far_end.silent, virtual_time.now > 1

    assert asyncio.run(looks_on()) == (True, True)
    assert faults.happened == [(1.0, "drive: silent")]

    async def waits() -> None:
        with pytest.raises(compax_aio.AnswerTimeoutError):
            await compax_aio.connect(simulated_drive.url, settings=DriveSettings(answer_timeout_s=0.1))
        await asyncio.sleep(3.1 - virtual_time.now)
        assert not simulated_drive.far_end.silent, "it was to last two seconds"

    asyncio.run(waits())
    assert not simulated_drive.far_end.deaf
    with pytest.raises(AssertionError, match="has not happened before the test was over: drive: deaf"):
        faults.assert_all_happened()


async def test_a_line_that_is_cut_comes_back(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        move = x.move_to(900)
        await simulated_drive.until(lambda axis: axis.position > 100)
        faults.cut_line(for_s=1)
        await asyncio.sleep(0.01)
        assert not simulated_drive.connected
        with pytest.raises(compax_aio.TransportError, match="test://drive refuses the connection: a fault"):
            await compax_aio.connect(simulated_drive.url)
        assert (await move).target == 900
        assert x.is_open


async def test_a_line_that_is_cut_for_an_instant_can_be_opened_at_once(
    simulated_drive: SimulatedAxis, faults: Faults
) -> None:
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        faults.cut_line()
        await asyncio.sleep(2)
        await x.move_to(1)


async def test_a_line_that_stays_cut_is_mended_by_undoing(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    faults.cut_line(for_s=None)
    with pytest.raises(compax_aio.TransportError, match="refuses the connection"):
        await compax_aio.connect(simulated_drive.url)
    faults.undo()
    async with compax_aio.connect(simulated_drive.url) as x:
        await x.move_to(1)


@pytest.mark.parametrize("trouble", ["silent", "deaf", "dead_line"])
async def test_a_drive_of_which_nothing_comes_leaves_its_move_in_doubt(
    simulated_drive: SimulatedAxis, faults: Faults, trouble: str
) -> None:
    x = await compax_aio.connect(simulated_drive.url, name="x", settings=IMPATIENT)
    move = x.move_to(1000)
    await simulated_drive.until_moving()
    getattr(faults, trouble)(for_s=10)
    with pytest.raises(compax_aio.MoveInDoubtError):
        await move
    await asyncio.sleep(10)
    await x.reconcile()
    await x.close()


async def test_answers_come_late_for_a_while(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        loop = asyncio.get_running_loop()
        for trouble in (faults.late_answers, faults.slow_line):
            trouble(0.2, for_s=0.3)
            begun_at = loop.time()
            await x.position()
            assert loop.time() - begun_at == pytest.approx(0.202)
            await asyncio.sleep(0.5)
            begun_at = loop.time()
            await x.position()
            assert loop.time() - begun_at == pytest.approx(0.002)


async def test_position_reached_comes_late_or_never(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        faults.lose_position_reached()
        assert (await x.move_to(100)).confirmed_by == "status"
        faults.late_position_reached(5.0)
        assert (await x.move_to(0)).confirmed_by == "status"


async def test_garbled_bytes_are_not_believed(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    async with compax_aio.connect(simulated_drive.url, name="x") as x:
        faults.garble(3)
        with pytest.raises(compax_aio.CompaxError):
            await x.position()
        assert await x.position() == 0


async def test_power_comes_back_after_a_while_or_when_it_is_undone(
    simulated_drive: SimulatedAxis, faults: Faults
) -> None:
    powers = [["off", "on"], ["off", "on"], ["off", "on"]]
    faults.power_cycle()
    assert _powers(simulated_drive) == powers[:1]
    faults.power_cycle(off_s=2)
    await asyncio.sleep(1)
    assert not simulated_drive.motions
    await asyncio.sleep(1.5)
    assert _powers(simulated_drive) == powers[:2]
    faults.power_cycle(off_s=None)
    await asyncio.sleep(60)
    faults.undo()
    faults.undo()
    assert _powers(simulated_drive) == powers


def _powers(axis: SimulatedAxis) -> list[list[str]]:
    told = [entry.text for entry in axis.log if entry.kind.value == "power"]
    return [told[at : at + 2] for at in range(0, len(told), 2)]


async def test_one_of_several_drives_is_named(simulated_group: SimulatedGroup, faults: Faults) -> None:
    with pytest.raises(ValueError, match=r"for which drive\? there is none"):
        faults.silent()
    simulated_group.add("x", "y")
    with pytest.raises(ValueError, match=r"for which drive\? there are x, y; name one: faults\.of\('x'\)"):
        faults.silent()
    with pytest.raises(ValueError, match="no drive 'z' was added; there are x, y"):
        faults.of("z")
    faults.of("y").silent()
    assert [axis.far_end.silent for axis in simulated_group.values()] == [False, True]


def test_what_means_nothing_is_refused_at_once(simulated_drive: SimulatedAxis, faults: Faults) -> None:
    with pytest.raises(ValueError, match="a fault code is 1 to 97, not 98"):
        faults.raise_fault(98)
    with pytest.raises(ValueError, match="0 s or later, not -1"):
        faults.after(-1)
    with pytest.raises(ValueError, match="0 s or later, not nan"):
        faults.at(float("nan"))
    with pytest.raises(ValueError, match="count is 1 or more"):
        faults.lose_answers(0)
    with pytest.raises(ValueError, match="direction is one of to_drive, to_application, not 'up'"):
        faults.garble(direction="up")  # type: ignore[arg-type]
    assert not faults.happened


# From a seed


async def _a_day_with(faults: Faults, url: str, seed: int) -> list[tuple[float, str]]:
    """Move to and fro through whatever comes; every call settles with a result or an error of the library."""
    faults.from_seed(seed, during_s=6, count=4)
    async with asyncio.timeout(600):
        try:
            async with compax_aio.connect(url, name="x", settings=IMPATIENT) as x:
                for target in (300, 0, 300, 0):
                    await x.move_to(target)
        except compax_aio.CompaxError:
            pass
    return faults.happened


@pytest.mark.parametrize("seed", range(20))
async def test_a_seed_brings_the_same_troubles_each_time(seed: int) -> None:
    days = []
    for _ in range(2):
        with Stage.set() as stage:
            stage.group.add("x", position=1.0)
            begun_at = asyncio.get_running_loop().time()
            told = await _a_day_with(Faults(stage), "test://x", seed)
            days.append([(round(at - begun_at, 6), what) for at, what in told])
    assert days[0] == days[1]


async def test_a_seed_takes_all_drives_of_the_test(simulated_group: SimulatedGroup, faults: Faults) -> None:
    with pytest.raises(ValueError, match="add a drive first"):
        faults.from_seed(1)
    simulated_group.add("x", "y")
    faults.from_seed(1, during_s=1, count=20)
    faults.of("x").after(50).from_seed(2, during_s=1, count=20)
    await asyncio.sleep(2)
    assert {what[0] for _, what in faults.happened} == {"x", "y"}
    await asyncio.sleep(60)
    assert {what[0] for at, what in faults.happened if at > 40} == {"x"}
    faults.assert_all_happened()


# The end of the test


async def test_all_is_undone_when_a_test_is_over() -> None:
    with Stage.set() as stage:
        axis = stage.group.add("x")
        faults = Faults(stage)
        drive = await compax_aio.connect("test://x")
        faults.dead_line()
        faults.silent()
        faults.late_answers(5.0)
        faults.after(100).raise_fault(55)
    assert not axis.far_end.silent
    assert axis.far_end.extra_answer_delay_s == 0
    await asyncio.sleep(200)
    assert axis.far_end.fault is None
    await drive.close()


async def test_a_fault_that_could_not_be_made_fails_the_test() -> None:
    def broken() -> None:
        raise RuntimeError("no hands")

    async def test() -> None:
        with Stage.set() as stage:
            stage.schedule(Due(1.0), "x: something", broken)
            await asyncio.sleep(2)

    with pytest.raises(RuntimeError, match="no hands"):
        await test()


@pytest.mark.real_time
async def test_on_the_real_clock_the_time_counts_from_when_it_was_first_looked_at(
    simulated_drive: SimulatedAxis, faults: Faults
) -> None:
    faults.silent(for_s=0.01)
    faults.at(0.02).deaf()
    await simulated_drive.until(lambda axis: axis.far_end.deaf)
    assert faults.happened[0][0] < 0.02 <= faults.happened[1][0] + 0.001
    assert not simulated_drive.far_end.silent
