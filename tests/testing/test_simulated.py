"""A simulated drive of a test gives the application its URL, and testifies afterwards what it has done."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

import pytest

import compax_aio
from compax_aio import testing
from compax_aio.simulator.compax import LogKind
from compax_aio.testing import Motion, SimulatedAxis, SimulatedGroup, VirtualTime
from compax_aio.testing.stage import Stage


@pytest.fixture
def simulated_drive_knobs() -> Mapping[str, Any]:
    return {"machine_zero": -5.0, "travel_max": 100.0}


async def stopped_move(url: str) -> None:
    async with compax_aio.connect(url, name="x") as x:
        move = x.move_to(50)
        await asyncio.sleep(0.2)
        await x.stop()
        with pytest.raises(compax_aio.MoveStoppedError):
            await move


# Lines


async def test_it_is_opened_by_its_url_and_lives_on_between_connections(simulated_drive: SimulatedAxis) -> None:
    assert simulated_drive.url == "test://drive"
    assert not simulated_drive.connected
    async with compax_aio.connect(simulated_drive.url) as drive:
        assert "connected" in simulated_drive.story()
        await drive.move_to(20)
    async with compax_aio.connect(simulated_drive.url) as drive:
        assert await drive.position() == 20
    assert not simulated_drive.connected
    assert repr(simulated_drive) == "<SimulatedAxis 'drive' at 20>"


async def test_a_line_has_two_ends(simulated_drive: SimulatedAxis) -> None:
    async with compax_aio.connect(simulated_drive.url):
        with pytest.raises(compax_aio.TransportError, match="somebody else is connected to test://drive"):
            await compax_aio.connect(simulated_drive.url)


async def test_a_line_that_has_just_been_closed_can_be_opened_at_once(simulated_drive: SimulatedAxis) -> None:
    for _ in range(3):
        drive = await compax_aio.connect(simulated_drive.url)
        await drive.close()


async def test_who_opens_a_drive_that_is_not_there_is_told_which_are(simulated_group: SimulatedGroup) -> None:
    with pytest.raises(compax_aio.TransportError, match=r"there are none; simulated_group\.add\('z'\) adds one"):
        await compax_aio.connect("test://z")
    simulated_group.add("x", "y")
    with pytest.raises(compax_aio.TransportError, match="no simulated drive 'z'; there are x, y"):
        await compax_aio.connect("test://z")


async def test_the_scheme_is_there_for_no_longer_than_a_test_needs_it() -> None:
    with Stage.set() as stage:
        stage.group.add("x")
        line = await compax_aio.connect("test://x")
    with pytest.raises(compax_aio.CompaxError):
        await line.move_to(1)
    await line.close()
    with pytest.raises(compax_aio.TransportError, match="no transport for test://"):
        await compax_aio.connect("test://x")


@pytest.mark.real_time
async def test_it_can_be_served_to_other_processes(simulated_drive: SimulatedAxis) -> None:
    async with simulated_drive.serve_pty() as url:
        assert url.startswith("serial:///dev/")
        async with compax_aio.connect(url) as drive:
            await drive.move_to(1)
    async with simulated_drive.serve_tcp() as url, compax_aio.connect(url) as drive:
        assert await drive.position() == 1
    assert [motion.target for motion in simulated_drive.motions] == [1]


# Groups


async def test_a_group_opens_all_urls_of_the_group(simulated_group: SimulatedGroup) -> None:
    y = simulated_group.add("x", "y", position=5.0)
    assert (len(simulated_group), list(simulated_group)) == (2, ["x", "y"])
    assert y is simulated_group["y"]
    async with compax_aio.DriveGroup.connect(simulated_group.urls) as group:
        assert await group.positions() == {"x": 5.0, "y": 5.0}
        move = group.move_to(x=50, y=60)
        await y.until_moving()
        with pytest.raises(AssertionError, match="x still moves, at"):
            simulated_group.assert_standing()
        await move
    simulated_group.assert_standing()
    simulated_group.assert_nothing_refused()


def test_a_group_says_what_it_cannot_have(simulated_group: SimulatedGroup, simulated_drive: SimulatedAxis) -> None:
    assert dict(simulated_group) == {"drive": simulated_drive}
    with pytest.raises(ValueError, match="there is a drive 'drive' already"):
        simulated_group.add("drive")
    with pytest.raises(ValueError, match="name the drives"):
        simulated_group.add()
    with pytest.raises(ValueError, match="letters, digits"):
        simulated_group.add("x/y")
    with pytest.raises(compax_aio.TransportError, match="no knob 'speed'; there are acceleration_ms, answer_time_s"):
        simulated_group.add("x", speed=1)
    with pytest.raises(compax_aio.TransportError, match="decimals"):
        simulated_group.add("x", decimals=7)
    with pytest.raises(KeyError, match="no drive 'x' was added; there are drive"):
        simulated_group["x"]


# Testimony


async def test_it_tells_its_motions_and_how_they_ended(simulated_drive: SimulatedAxis) -> None:
    async with compax_aio.connect(simulated_drive.url) as drive:
        await drive.home()
        await drive.move_by(10)
        moving = drive.move_to(90)
        await simulated_drive.until_moving()
        assert simulated_drive.moving
        assert str(simulated_drive.motions[-1]).endswith("POSA 90: still moving")
        await asyncio.sleep(0.1)
        simulated_drive.far_end.raise_fault(55)
        with pytest.raises(compax_aio.DriveFaultError):
            await moving
        await drive.quit()
    await stopped_move(simulated_drive.url)
    homing, relative, faulty, stopped = simulated_drive.motions
    assert (homing.homing, homing.target, homing.position) == (True, -5.0, 0.0)
    assert (relative.command, relative.target, relative.ended_by, relative.position) == ("POSR", 10.0, "reached", 10.0)
    assert (faulty.target, faulty.ended_by) == (90.0, "fault")
    assert (stopped.target, stopped.ended_by) == (50.0, "stopped")
    assert all(
        motion.ended_at is not None and motion.ended_at > motion.started_at for motion in simulated_drive.motions
    )
    assert "POSR 10: reached at 10 after 0." in str(relative)


def test_a_motion_without_an_end_is_none() -> None:
    assert Motion("POSA", 1.0, 0.0).ended_by is None


async def test_it_asserts_that_it_was_stopped(simulated_drive: SimulatedAxis) -> None:
    with pytest.raises(AssertionError, match="drive was not stopped: it never moved"):
        simulated_drive.assert_stopped()
    simulated_drive.assert_never_moved()
    async with compax_aio.connect(simulated_drive.url) as drive:
        await drive.move_to(10)
    with pytest.raises(AssertionError, match=r"drive was not stopped: .*POSA 10: reached at 10"):
        simulated_drive.assert_stopped()
    with pytest.raises(AssertionError, match=r"drive has moved: .*POSA 10"):
        simulated_drive.assert_never_moved()
    await stopped_move(simulated_drive.url)
    simulated_drive.assert_stopped()
    simulated_drive.assert_standing()


async def test_who_leaves_an_axis_moving_is_found_out(simulated_drive: SimulatedAxis) -> None:
    drive = await compax_aio.connect(simulated_drive.url)
    move = drive.move_to(100, on_cancel="detach")
    await move.accepted
    move.cancel()
    with pytest.raises(AssertionError, match="drive still moves, at"):
        simulated_drive.assert_standing()
    await drive.close()
    await simulated_drive.until_standing()
    simulated_drive.assert_standing()


async def test_it_counts_every_way_of_commanding_it_outside(simulated_drive: SimulatedAxis) -> None:
    async with compax_aio.connect(simulated_drive.url) as drive:
        await drive.home()
        await drive.move_to(90)
        simulated_drive.assert_never_commanded_outside(0, 100)
        with pytest.raises(AssertionError, match=r"commanded to 90 \(PA90\$\) at .* outside 0 to 80"):
            simulated_drive.assert_never_commanded_outside(0, 80)
        simulated_drive.assert_nothing_refused()
        with pytest.raises(compax_aio.CommandRejectedError):
            await drive.move_to(150)
    with pytest.raises(AssertionError, match=r"commanded to 150 \(PA150\$\)"):
        simulated_drive.assert_never_commanded_outside(0, 100)
    assert simulated_drive.refused == [("PA150$", "E93")]
    with pytest.raises(AssertionError, match="drive refused 'PA150\\$' with E93"):
        simulated_drive.assert_nothing_refused()


async def test_a_relative_move_is_counted_by_where_it_leads(simulated_drive: SimulatedAxis) -> None:
    async with compax_aio.connect(simulated_drive.url) as drive:
        await drive.move_to(60)
        await drive.move_by(30)
    with pytest.raises(AssertionError, match=r"commanded to 90 \(POSR\)"):
        simulated_drive.assert_never_commanded_outside(0, 70)


async def test_its_story_leaves_out_what_was_merely_read(simulated_drive: SimulatedAxis) -> None:
    assert simulated_drive.story() == "nobody has spoken to it"
    async with compax_aio.connect(simulated_drive.url) as drive:
        await drive.move_to(10)
    assert "PA10$" in simulated_drive.lines
    assert "S17" in simulated_drive.lines
    told = simulated_drive.story().splitlines()
    assert [line.split("s  ", 1)[1].split()[0] for line in told] == [
        *("connected", "line", "motion", "answer", "motion", "message", "disconnected")
    ]
    assert simulated_drive.story(2).splitlines()[0] == "(5 earlier entries)"


async def test_waiting_for_what_never_comes_fails_in_time(
    simulated_drive: SimulatedAxis, virtual_time: VirtualTime
) -> None:
    with pytest.raises(AssertionError, match="not come to what was waited for within 5 s"):
        await simulated_drive.until(lambda axis: axis.position > 50, timeout_s=5)
    assert virtual_time.now == pytest.approx(5)


def test_a_log_that_is_full_proves_nothing(simulated_drive: SimulatedAxis) -> None:
    log = simulated_drive.far_end.log
    assert log.maxlen is not None
    for _ in range(log.maxlen):
        log.add(0.0, LogKind.LINE, "S1")
    with pytest.raises(AssertionError, match="more than its log holds"):
        simulated_drive.assert_stopped()


def test_what_the_package_offers_is_imported_when_it_is_asked_for() -> None:
    assert {name: getattr(testing, name).__name__ for name in testing.__all__} == {
        name: name for name in testing.__all__
    }
    with pytest.raises(AttributeError, match="no attribute 'Drive'"):
        testing.Drive  # noqa: B018


async def test_one_stage_gives_the_scheme_back_to_another(simulated_drive: SimulatedAxis) -> None:
    with Stage.set() as stage:
        stage.group.add("x", position=3.0)
        async with compax_aio.connect("test://x") as x:
            assert await x.position() == 3.0
    async with compax_aio.connect(simulated_drive.url) as drive:
        assert await drive.position() == 0.0
