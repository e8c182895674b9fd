"""Several drives as one: all accepted or all stopped, and one in trouble stops the others and delays none."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
from tests.promises.bench import bench, ending, lines, motions, now, scripted, until

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    DriveFaultError,
    DriveGroup,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
    TransportError,
)
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


class Three:
    """A group of three drives, and their far ends."""

    def __init__(self, group: DriveGroup) -> None:
        self.group = group
        self.x, self.y, self.z = (drive_named(axis) for axis in "xyz")

    @property
    def far(self) -> tuple[SimulatedDrive, ...]:
        return self.x, self.y, self.z

    @property
    def moving(self) -> bool:
        return any(far.moving for far in self.far)

    @property
    def bytes_sent(self) -> int:
        return sum(drive.stats.bytes_sent for drive in self.group.drives.values())


@asynccontextmanager
async def three(settings: DriveSettings | None = None) -> AsyncIterator[Three]:
    async with AsyncExitStack() as stack:
        drives = {axis: (await stack.enter_async_context(bench(axis, settings=settings)))[0] for axis in "xyz"}
        yield Three(DriveGroup(**drives))


async def test_a_group_reaches_its_targets_and_gives_each_axis_its_result() -> None:
    async with three() as t:
        move = t.group.move_to(x=100, y=-50.004, speed_percent=50)
        await move.accepted
        assert t.x.moving
        assert t.y.moving
        results = await move
        assert list(results) == ["x", "y"]
        assert results["x"].drive == "x"
        assert (results["x"].target, results["y"].target) == (100, -50)
        assert await t.group.positions() == {"x": 100, "y": -50, "z": 0}
        assert motions(t.z) == []
        assert move.moves["x"].done()
        for far, motion in ((t.x, "PA100,"), (t.y, "PA-50,")):
            at = lines(far).index(motion)
            assert lines(far)[at - 1 : at + 2] == ["SD50", motion, "!"]


async def test_a_group_finds_machine_zero_with_the_axes_named_or_all() -> None:
    async with three() as t:
        assert list(await t.group.home("y")) == ["y"]
        assert [far.homed for far in t.far] == [False, True, False]
        assert list(await t.group.home()) == ["x", "y", "z"]
        assert all(far.homed for far in t.far)
        assert t.group["y"] is t.group.drives["y"]


async def test_all_start_at_the_same_time() -> None:
    async with three() as t:
        await t.group.move_to(x=100, y=200, z=300)
        starts = {next(entry.at for entry in far.log if entry.kind is LogKind.MOTION_STARTED) for far in t.far}
        assert len(starts) == 1


@pytest.mark.parametrize("culprit", ["x", "y", "z"])
async def test_if_one_drive_refuses_nobody_moves_afterwards(culprit: str) -> None:
    async with three() as t:
        drive_named(culprit).raise_fault(20)
        move = t.group.move_to(x=10_000, y=10_000, z=10_000)
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.device == culprit
        assert [motions(far) for far in t.far] == [[], [], []]
        assert now() < 1
        with pytest.raises(DriveFaultError):
            await move.accepted
        others = [axis for axis in "xyz" if axis != culprit]
        assert [note.split(":")[0] for note in error.__notes__] == others
        assert all("stopped" in note for note in error.__notes__)
        for axis in others:
            assert isinstance(await ending(move.moves[axis]), MoveStoppedError)
        await asyncio.sleep(100)
        assert not t.moving
        await t.group[culprit].quit()
        await t.group.move_to(x=10, y=10, z=10)


async def test_if_one_is_not_ready_in_time_nobody_moves_afterwards() -> None:
    async with three() as t:
        t.y.deaf = True
        error = await ending(t.group.move_to(x=10_000, y=10_000, z=10_000))
        assert isinstance(error, CompaxError)
        assert error.device == "y"
        assert not t.moving
        t.y.deaf = False


async def test_if_one_fails_under_way_the_others_are_stopped() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000, z=1)
        await asyncio.sleep(2)
        assert move.accepted.done()
        t.y.raise_fault(55)
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert (error.device, error.code) == ("y", 55)
        assert not t.moving
        assert any(note.startswith("x: ") and "was stopped at" in note for note in error.__notes__)
        assert "z: reached its target" in error.__notes__
        assert t.z.position == 1
        assert "STOP" not in lines(t.z)


async def test_if_one_is_stopped_by_hand_the_others_are_stopped_too() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
        await t.group["x"].stop()
        assert isinstance(await ending(move), MoveStoppedError)
        assert not t.moving


async def test_if_one_is_cancelled_the_others_are_stopped_too() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
        move.moves["x"].cancel()
        assert isinstance(await ending(move), MoveStoppedError)
        assert not t.moving


async def test_if_all_are_cancelled_one_by_one_the_group_is_cancelled() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
        for each in move.moves.values():
            each.cancel()
        with pytest.raises(asyncio.CancelledError):
            await move
        assert move.cancelled()
        await until(lambda: not t.moving, 1)


async def test_cancelling_stops_all_at_once() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000, z=10_000)
        await asyncio.sleep(1)
        before = t.bytes_sent
        assert move.cancel()
        assert t.bytes_sent - before == 3 * len("STOP\r")
        assert not move.cancel()
        with pytest.raises(asyncio.CancelledError):
            await move.accepted if not move.accepted.done() else await move
        await until(lambda: not t.moving, 1)


async def test_cancelling_before_anything_was_sent_sends_nothing() -> None:
    async with three() as t:
        before = t.bytes_sent
        t.group.move_to(x=10_000, y=10_000).cancel()
        await asyncio.sleep(5)
        assert t.bytes_sent == before


async def test_stopping_the_move_stops_its_axes_alone() -> None:
    async with three() as t:
        other = t.group["z"].move_to(1000)
        move = t.group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
        await move.stop()
        assert not t.x.moving
        assert not t.y.moving
        assert isinstance(await ending(move), MoveStoppedError)
        assert (await other).target == 1000


async def test_stop_goes_out_on_all_lines_although_one_is_silent() -> None:
    async with three(DriveSettings(stop_timeout_s=3)) as t:
        move = t.group.move_to(x=10_000, y=10_000, z=10_000)
        await asyncio.sleep(1)
        t.y.deaf = True
        stopping = asyncio.ensure_future(t.group.stop())
        await asyncio.sleep(0.2)
        assert [far.moving for far in t.far] == [False, True, False]
        assert not stopping.done()
        error = await ending(stopping)
        assert isinstance(error, AnswerTimeoutError)
        assert error.device == "y"
        assert now() < 12
        assert isinstance(await ending(move), MoveInDoubtError)
        t.y.deaf = False
        await t.group.stop()
        assert not t.moving


async def test_the_errors_of_all_that_could_not_be_stopped_are_told() -> None:
    async with three(DriveSettings(stop_timeout_s=3)) as t:
        t.x.deaf = t.z.deaf = True
        error = await ending(t.group.stop())
        assert error.device == "x"
        (note,) = error.__notes__
        assert note.startswith("z: ")
        t.x.deaf = t.z.deaf = False


@pytest.mark.parametrize(
    "refused",
    [
        {"x": 5, "y": float("nan")}, {"x": 5, "y": 4e6 + 1}, {"x": 5, "w": 5}, {}, {"x": 5, "y": "5"},
        {"x": 5, "y": 5, "speed_percent": 500}, {"x": 5, "acceleration_ms": -1}, {"speed_percent": 50},
    ],
)  # fmt: skip
async def test_if_one_axis_cannot_be_told_nothing_is_sent_to_any(refused: dict[str, float]) -> None:
    async with three() as t:
        before = t.bytes_sent
        with pytest.raises(InvalidCommandError):
            t.group.move_to(**refused)  # type: ignore[arg-type]
        await asyncio.sleep(1)
        assert t.bytes_sent == before
        assert [motions(far) for far in t.far] == [[], [], []]


async def test_an_axis_that_is_not_there_is_named_together_with_those_that_are() -> None:
    async with three() as t:
        with pytest.raises(InvalidCommandError, match=r"no axis 'w' in this group; there are x, y, z"):
            t.group.home("x", "w")
    with pytest.raises(InvalidCommandError):
        DriveGroup()


async def test_if_one_axis_is_busy_or_in_doubt_nothing_is_sent_to_any() -> None:
    async with three(DriveSettings(in_doubt_after_s=5)) as t:
        single = t.group["z"].move_to(500)
        await single.accepted
        before = t.bytes_sent
        with pytest.raises(MoveActiveError):
            t.group.move_to(x=1, z=1)
        assert t.bytes_sent == before
        t.z.silent = True
        assert isinstance(await ending(single), MoveInDoubtError)
        before = t.bytes_sent
        with pytest.raises(MoveInDoubtError):
            t.group.home()
        await asyncio.sleep(1)
        assert t.bytes_sent == before
        t.z.silent = False
        await t.group["z"].reconcile()
        await t.group.move_to(x=1, z=1)


async def test_a_group_has_a_budget_of_time() -> None:
    async with three() as t:
        error = await ending(t.group.move_to(x=10_000, y=1, timeout_s=2))
        assert isinstance(error, MoveTimeoutError)
        assert not t.moving
        assert "y: reached its target" in error.__notes__


async def test_positions_of_a_group_fail_together() -> None:
    async with bench("x") as (x, _), scripted({"S1": "E90"}) as (y, _):
        error = await ending(DriveGroup(x=x, y=y).positions())
        assert isinstance(error, CommandRejectedError)


# Connecting -------------------------------------------------------------------------------------------------------


async def test_a_group_connects_all_at_once_and_stops_and_closes_all_at_the_end() -> None:
    urls = {axis: f"sim://compax?name={axis}" for axis in "xyz"}
    settings = {"x": DriveSettings(unit="mm"), "y": DriveSettings(unit="degree")}
    async with DriveGroup.connect(urls, settings=settings) as group:
        assert [drive.unit for drive in group.drives.values()] == ["mm", "degree", "units"]
        assert list(group.drives) == ["x", "y", "z"]
        assert group["y"].name == "y"
        move = group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
    assert not drive_named("x").moving
    assert not drive_named("y").moving
    assert not any(drive.is_open for drive in group.drives.values())
    assert isinstance(await ending(move), MoveStoppedError)


async def test_if_one_cannot_be_reached_the_others_are_closed() -> None:
    urls = {"x": "sim://compax?name=x", "y": "loop://nobody", "z": "sim://compax?name=z"}
    with pytest.raises(TransportError, match="nobody listens"):
        async with DriveGroup.connect(urls):
            pytest.fail("it was connected")
    for axis in "xz":
        async with bench(axis) as (drive, _):
            assert await drive.position() == 0


async def test_if_one_does_not_answer_the_others_are_closed_in_time() -> None:
    drive_named("y").deaf = True
    urls = {axis: f"sim://compax?name={axis}" for axis in "xyz"}
    with pytest.raises(AnswerTimeoutError) as caught:
        async with DriveGroup.connect(urls, settings=DriveSettings(resync_attempts=1)):
            pytest.fail("it was connected")
    assert caught.value.device == "y"
    assert now() < 2
    assert drive_named("x").log[-1].kind is LogKind.DISCONNECTED
    async with bench("z") as (drive, _):
        assert await drive.position() == 0


async def test_a_group_that_is_cancelled_while_it_connects_leaves_nothing_open() -> None:
    drive_named("y").deaf = True
    urls = {axis: f"sim://compax?name={axis}" for axis in "xy"}
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.5), DriveGroup.connect(urls):
            pytest.fail("it was connected")
    assert [drive_named(axis).log[-1].kind for axis in "xy"] == [LogKind.DISCONNECTED] * 2


async def test_a_group_whose_block_fails_stands_still() -> None:
    urls = {axis: f"sim://compax?name={axis}" for axis in "xy"}
    with pytest.raises(ZeroDivisionError):  # noqa: PT012  # the block is tested
        async with DriveGroup.connect(urls) as group:
            move = group.move_to(x=10_000, y=10_000)
            await asyncio.sleep(1)
            raise ZeroDivisionError
    assert not drive_named("x").moving
    assert not drive_named("y").moving
    assert isinstance(await ending(move), MoveStoppedError)


async def test_closing_a_group_stops_all_at_once() -> None:
    async with three() as t:
        move = t.group.move_to(x=10_000, y=10_000)
        await asyncio.sleep(1)
        await t.group.close()
        assert not t.moving
        stops = {next(entry.at for entry in far.log if entry.text == "STOP") for far in (t.x, t.y)}
        assert max(stops) - min(stops) < 0.01
        assert isinstance(await ending(move), MoveStoppedError)
        # Closed is closed, also for the blocks around it.
        assert not any(drive.is_open for drive in t.group.drives.values())


async def test_drives_of_different_kinds_make_one_group() -> None:
    drive_named("inch", Knobs(unit="inch", decimals=3))
    async with (
        compax_aio.connect("sim://compax?name=inch", settings=DriveSettings(decimals=3)) as inch,
        bench("mm") as (mm, far),
    ):
        results = await DriveGroup(a=inch, b=mm).move_to(a=1.2345, b=1.2345)
        assert (results["a"].target, results["b"].target) == (1.234, 1.23)
        assert far.position == 1.23
