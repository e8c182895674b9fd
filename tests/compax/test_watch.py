"""Watching: what the drive says is asked once for all who watch, told as it is, and nobody else waits for it."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable
from itertools import pairwise
from typing import Any

import pytest
from tests.promises.bench import bench, ending, lines, now, received, scripted, until

from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    Drive,
    DriveGroup,
    DriveSettings,
    InvalidCommandError,
    UnexpectedAnswerError,
)
from compax_aio.compax.events import Fault
from compax_aio.compax.watch import GroupReading, GroupWatch, Reading, Watch
from compax_aio.simulator.compax import SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def readings(watch: Watch, number: int) -> list[Reading]:
    """Take *number* readings, and let go of *watch*."""
    with watch:
        return [await anext(watch) for _ in range(number)]


def polling() -> list[asyncio.Task[Any]]:
    """List the pollers at work."""
    return [task for task in asyncio.all_tasks() if task.get_name().endswith(": watch")]


def asked(far: SimulatedDrive, since: float = 0.0) -> Counter[str]:
    """Count the lines that the far end has received since a time."""
    return Counter(entry.text for entry in far.log if entry.kind == "line" and entry.at >= since)


async def turns(number: int = 3) -> None:
    """Let the event loop go round."""
    for _ in range(number):
        await asyncio.sleep(0)


def gaps(times: Iterable[float]) -> list[float]:
    """List the time from each to the next."""
    return [late - early for early, late in pairwise(times)]


def let_go_on(*watches: Watch) -> list[asyncio.Task[list[Reading]]]:
    """Consume *watches* to their end."""

    async def consume(watch: Watch) -> list[Reading]:
        return [reading async for reading in watch]

    return [asyncio.create_task(consume(watch)) for watch in watches]


# What a reading says --------------------------------------------------------------------------------------------------


async def test_a_watch_gives_a_reading_at_once_and_then_one_every_interval() -> None:
    async with bench(position=12.5) as (drive, _):
        await asyncio.sleep(0.31)
        begun_at = now()
        seen = await readings(drive.watch("position", "status", interval_s=0.2), 4)
        assert [reading["position"] for reading in seen] == [12.5] * 4
        assert seen[0]["status"] == await drive.status()
        assert {reading.drive for reading in seen} == {"x"}
        times = [reading.at for reading in seen]
        assert times[0] - begun_at < 0.01
        assert times[1:] == pytest.approx([0.4, 0.6, 0.8], abs=0.01), "whole multiples on the loop's clock"


async def test_every_quantity_is_what_the_drives_own_method_returns() -> None:
    async with bench(position=5) as (drive, far):
        far.raise_fault(55)
        await drive.quit()
        names = ("position", "target", "following_error", "speed", "torque", "status", "error", "error_history")
        (reading,) = await readings(drive.watch(*names, "S12", "P40", "V5"), 1)
        for name in names:
            assert reading[name] == await getattr(drive, name)(), name
        assert reading["error"] is None
        assert reading["S12"] == await drive.read_status(12)
        assert reading["P40"] == await drive.parameters.read(40)
        assert reading["V5"] == await drive.variables.read(5)
        assert list(reading.values) == [*names, "S12", "P40", "V5"]
        assert "position" in reading
        assert "torque" in reading
        assert "S2" not in reading


@pytest.mark.parametrize(
    "names",
    [
        (), ("postion",), ("position", "S0"), ("S251",), ("S012",), ("s1",), ("P251",), ("V40",), ("V0",), ("N1",),
        ("S1 ",), ("S1\n",), ("S٣",), (1,), (None,), (["position"],), ("parameters",), ("close",), ("",), ("stop",),
    ],
)  # fmt: skip
async def test_what_cannot_be_watched_is_refused_with_what_can(names: tuple[Any, ...]) -> None:
    async with bench() as (drive, _):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError, match=r"possible are position, .*S1-S250, P1-P250, V1-V39, V50-V70"):
            drive.watch(*names)
        await asyncio.sleep(1)
        assert drive.stats.bytes_sent == before
        assert not polling()


@pytest.mark.parametrize("interval_s", [0, -1, float("nan"), float("inf"), "1", None, True])
async def test_an_interval_that_is_no_time_is_refused(interval_s: Any) -> None:
    async with bench() as (drive, _):
        with pytest.raises(InvalidCommandError, match="interval_s"):
            drive.watch("position", interval_s=interval_s)
        assert not polling()


async def test_a_value_that_the_drive_refuses_is_absent_and_its_error_stays_visible(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with scripted({"S40": "E90"}) as (drive, far):
        with caplog.at_level(logging.WARNING):
            seen = await readings(drive.watch("position", "S40", interval_s=0.1), 120)
        for reading in seen:
            assert dict(reading.values) == {"position": 0}
            assert isinstance(reading.errors["S40"], CommandRejectedError)
            assert "S40" not in reading
        with pytest.raises(CommandRejectedError) as caught:
            _ = seen[-1]["S40"]
        assert (caught.value.sent, caught.value.received) == ("S40", "E90")
        assert far.lines.count("S1") >= 120, "the others are read all the same"
        assert 2 <= far.lines.count("S40") <= 4, "it was asked again and again although it is refused"
        assert caplog.text.count("S40 cannot be read") == 1


async def test_an_error_that_is_raised_again_and_again_does_not_grow() -> None:
    async with scripted({"S40": "E90"}) as (drive, _):
        (reading,) = await readings(drive.watch("S40"), 1)
        error = reading.errors["S40"]
        assert error.__traceback__ is None
        for _ in range(3):
            with pytest.raises(CommandRejectedError) as caught:
                _ = reading["S40"]
            assert caught.value is error
            assert len(caught.traceback) == 2


async def test_who_watches_only_what_is_refused_is_not_woken_by_what_others_watch() -> None:
    async with scripted({"S40": "E90"}) as (drive, _):
        consumers = let_go_on(drive.watch("S40", interval_s=0.1), drive.watch("position", interval_s=0.1))
        await asyncio.sleep(12)
        await drive.close()
        assert 2 <= len(await consumers[0]) <= 4
        assert len(await consumers[1]) > 100


async def test_a_value_that_is_refused_no_longer_is_there_again() -> None:
    async with scripted({"S40": "E90"}) as (drive, far):
        with drive.watch("S40", interval_s=0.1) as watch:
            assert (await anext(watch)).errors
            far.answers["S40"] = "S040: 7"
            reading = await anext(watch)
            assert not reading.errors
            assert reading["S40"].raw == "7"
            assert (await anext(watch)).at - reading.at == pytest.approx(0.1)


async def test_an_answer_that_is_none_is_told_each_time_and_the_next_good_one_counts() -> None:
    async with scripted({"S1": "S001: ----"}) as (drive, far):
        with drive.watch("position", "speed", interval_s=0.1) as watch:
            far.answers["S4"] = "S004: 3"
            for _ in range(3):
                reading = await anext(watch)
                assert isinstance(reading.errors["position"], UnexpectedAnswerError)
                assert dict(reading.values) == {"speed": 3}
            far.answers["S1"] = "S001: 5.00"
            reading = await anext(watch)
            assert dict(reading.values) == {"position": 5, "speed": 3}
            assert not reading.errors


async def test_what_is_not_watched_cannot_be_had_from_a_reading() -> None:
    async with bench() as (drive, _):
        (reading,) = await readings(drive.watch("position"), 1)
        with pytest.raises(InvalidCommandError, match="'speed' is not watched here; watched: position"):
            _ = reading["speed"]
        with pytest.raises((AttributeError, TypeError)):
            reading.values["position"] = 1  # type: ignore[index]


async def test_a_drive_that_falls_silent_gives_readings_without_values_and_goes_on_when_it_speaks_again() -> None:
    async with bench(position=3) as (drive, far):
        with drive.watch("position", interval_s=0.1) as watch:
            assert (await anext(watch))["position"] == 3
            far.deaf = True
            silent = await anext(watch)
            assert not silent.values, "an old value was told as if it were new"
            assert isinstance(silent.errors["position"], AnswerTimeoutError)
            assert silent.at == pytest.approx(1.1, abs=0.02)
            with pytest.raises(AnswerTimeoutError):
                _ = silent["position"]
            await asyncio.sleep(30)
            far.deaf = False
            await until(lambda: drive.is_open)
            await drive.move_to(8)
            seen = [await anext(watch) for _ in range(5)]
            assert seen[-1]["position"] == 8
            assert seen[-1].at - seen[-2].at == pytest.approx(0.1)


async def test_no_value_is_told_twice_although_the_line_is_too_slow() -> None:
    async with bench(baudrate=9600) as (drive, _):
        move = drive.move_to(1e5, on_cancel="detach")
        await move.accepted
        reading_all = asyncio.create_task(drive.parameters.read_all())
        seen = await readings(drive.watch("position", "status", "speed", interval_s=0.1), 30)
        reading_all.cancel()
        assert all(later["position"] > earlier["position"] for earlier, later in pairwise(seen))
        await drive.stop()
        await ending(move)


async def test_an_answer_that_comes_late_is_not_taken_for_another_quantity() -> None:
    async with bench(position=3) as (drive, far):
        with drive.watch("position", "torque", interval_s=0.1) as watch:
            await anext(watch)
            far.extra_answer_delay_s = 1.5
            await asyncio.sleep(8)
            far.extra_answer_delay_s = 0
            await asyncio.sleep(8)
            for _ in range(20):
                reading = await anext(watch)
                assert reading.values.get("position", 3.0) == 3
                assert reading.values.get("torque", 0.0) == 0
            assert not reading.errors


async def test_a_fault_is_told_although_the_last_watcher_leaves_while_the_drive_is_asked_which() -> None:
    async with bench(baudrate=9600) as (drive, far):
        events = drive.events()
        watch = drive.watch("status", interval_s=0.1)
        await anext(watch)
        far.raise_fault(55)
        await received(far, "S30")
        watch.close()
        fault = await anext(events)
        assert isinstance(fault, Fault)
        assert fault.error is not None


async def test_a_fault_that_a_watched_status_shows_is_an_event_once() -> None:
    async with bench() as (drive, far):
        events = drive.events()
        consumers = let_go_on(*(drive.watch("status", interval_s=0.1) for _ in range(3)))
        await asyncio.sleep(1)
        far.raise_fault(55)
        fault = await anext(events)
        assert isinstance(fault, Fault)
        assert fault.error is not None
        assert fault.error.code == 55
        await asyncio.sleep(2)
        await drive.close()
        assert [event async for event in events] == []
        for consumer in consumers:
            assert not (await consumer)[-1]["status"].no_fault


# One poller for all ---------------------------------------------------------------------------------------------------


async def test_a_hundred_watchers_are_read_for_once() -> None:
    async with bench() as (drive, far):
        consumers = let_go_on(*(drive.watch("position", "status", interval_s=0.2) for _ in range(50)))
        await asyncio.sleep(0.55)  # and others come at any time
        consumers += let_go_on(*(drive.watch("status", "position", interval_s=0.2) for _ in range(50)))
        since = now() + 0.1
        await asyncio.sleep(10.1)
        counted = asked(far, since)
        assert set(counted) == {"S1", "S16", "S17"}
        assert all(49 <= times <= 51 for times in counted.values())
        assert len(polling()) == 1
        await drive.close()
        assert {len(await consumer) for consumer in consumers[50:]} == {len(consumers[-1].result())}
        assert all(len(consumer.result()) >= 50 for consumer in consumers)


async def test_each_quantity_is_read_as_often_as_the_quickest_wants_it() -> None:
    async with bench() as (drive, far):
        quick, slow = let_go_on(drive.watch("position", interval_s=0.1), drive.watch("S6", "position", interval_s=1))
        await asyncio.sleep(20.5)
        assert asked(far)["S1"] == pytest.approx(206, abs=2)
        assert asked(far)["S6"] == pytest.approx(21, abs=1)
        await drive.close()
        assert len(await quick) == pytest.approx(206, abs=2)
        seen = await slow
        assert len(seen) == pytest.approx(21, abs=1)
        assert [reading.at for reading in seen[1:]] == pytest.approx(list(range(1, len(seen))), abs=0.01)


async def test_intervals_that_do_not_fit_together_cost_no_more_than_the_quickest() -> None:
    async with bench() as (drive, far):
        intervals = (0.15, 0.2, 0.7, 0.33)
        consumers = let_go_on(*(drive.watch("position", "speed", interval_s=interval_s) for interval_s in intervals))
        await asyncio.sleep(42)
        assert asked(far)["S1"] == pytest.approx(281, abs=3)
        assert asked(far)["S4"] == pytest.approx(281, abs=3)
        await drive.close()
        for interval_s, consumer in zip(intervals, consumers, strict=True):
            times = [reading.at for reading in await consumer]
            assert len(times) == pytest.approx(42 / interval_s, rel=0.02), interval_s
            assert max(gaps(times)) < interval_s + 0.16


async def test_intervals_that_fit_together_but_for_the_last_digit_do_fit() -> None:
    assert 3 * 0.3 < 0.9, "in floating point"
    async with scripted() as (drive, _):  # which answers in no time
        consumers = let_go_on(drive.watch("position", interval_s=0.3), drive.watch("position", interval_s=0.9))
        await asyncio.sleep(9.5)
        await drive.close()
        assert [reading.at for reading in await consumers[1]] == pytest.approx([0.9 * beat for beat in range(11)])
        await consumers[0]


async def test_the_shortest_interval_there_is_does_no_harm() -> None:
    async with scripted() as (drive, far):
        await readings(drive.watch("position", interval_s=5e-324), 50)
        assert now() == pytest.approx(0.049)
        assert far.lines.count("S1") <= 51


async def test_when_the_quickest_leaves_the_drive_is_asked_less() -> None:
    async with bench() as (drive, far):
        (slow,) = let_go_on(drive.watch("position", interval_s=1))
        await readings(drive.watch("position", "S6", interval_s=0.1), 20)
        since = now() + 0.2
        await asyncio.sleep(10.1)
        assert asked(far, since) == {"S1": pytest.approx(10, abs=1)}
        assert not slow.done()
        slow.cancel()


async def test_who_comes_later_is_told_nothing_that_was_read_before() -> None:
    async with bench() as (drive, _):
        (other,) = let_go_on(drive.watch("position", interval_s=10))
        await asyncio.sleep(5)
        await drive.move_to(50)
        joined_at = now()
        (reading,) = await readings(drive.watch("position", interval_s=10), 1)
        assert reading["position"] == 50
        assert joined_at <= reading.at < joined_at + 0.1
        other.cancel()


async def test_the_poller_begins_with_the_first_watch_and_ends_with_the_last() -> None:
    async with bench() as (drive, far):
        assert not polling()
        first, second = drive.watch("position"), drive.watch("speed")
        assert len(polling()) == 1
        await asyncio.sleep(1)
        first.close()
        first.close()
        since = now()
        await asyncio.sleep(1)
        assert len(polling()) == 1
        assert set(asked(far, since)) == {"S4"}
        second.close()
        await turns()
        assert not polling()
        before = len(lines(far))
        await asyncio.sleep(10)
        assert len(lines(far)) == before
        (again,) = await readings(drive.watch("position"), 1)
        assert again.at > 10


async def test_the_last_leaves_and_another_comes_in_the_same_moment() -> None:
    async with bench() as (drive, _):
        watch = drive.watch("position")
        await anext(watch)
        watch.close()
        second = drive.watch("position")
        assert await anext(second)
        third = drive.watch("speed")
        assert await anext(third)
        assert len(polling()) == 1
        second.close()
        third.close()
        await asyncio.sleep(1)
        assert not polling()


async def test_leaving_the_loop_or_dropping_the_watch_ends_its_polling() -> None:
    async with bench() as (drive, _):
        async for _ in drive.watch("position"):
            break
        await turns()
        assert not polling()

        async def fails() -> None:
            async for reading in drive.watch("position"):
                _ = 1 / reading["position"]

        with pytest.raises(ZeroDivisionError):
            await fails()
        await turns()
        assert not polling()
        watch = drive.watch("position", interval_s=3600)
        await anext(watch)
        await asyncio.sleep(5)
        assert len(polling()) == 1
        del watch
        await turns()
        assert not polling(), "it would have waited for an hour"
        forgotten = drive.watch("position")
        circle: list[Any] = [forgotten]
        circle.append(circle)
        del forgotten, circle
        gc.collect()
        await turns()
        assert not polling()


async def test_the_one_who_stays_is_read_for_after_others_were_dropped() -> None:
    async with bench() as (drive, far):
        kept, dropped = drive.watch("position"), drive.watch("speed")
        await asyncio.sleep(1)
        del dropped
        since = now() + 0.1
        await asyncio.sleep(2)
        assert set(asked(far, since)) == {"S1"}
        kept.close()


async def test_a_watch_that_was_closed_gives_nothing_more() -> None:
    async with bench() as (drive, _):
        with drive.watch("position") as watch:
            await asyncio.sleep(1)
        assert [reading async for reading in watch] == []


# Consumers ------------------------------------------------------------------------------------------------------------


async def test_a_slow_consumer_sees_the_newest_and_knows_what_it_has_missed() -> None:
    async with bench() as (drive, _):
        quick, slow = drive.watch("position", interval_s=0.1), drive.watch("position", interval_s=0.1)
        (consumer,) = let_go_on(quick)
        await anext(slow)
        assert slow.skipped == 0
        await asyncio.sleep(10.05)
        reading = await anext(slow)
        assert now() - reading.at < 0.1
        assert slow.skipped == pytest.approx(99, abs=1)
        assert quick.skipped == 0
        await asyncio.sleep(0.5)
        await drive.close()
        assert len([reading async for reading in slow]) == 1, "what is newest is told before the end"
        assert len(await consumer) == pytest.approx(106, abs=2)


async def test_two_consumers_of_one_watch_share_its_readings_and_both_end() -> None:
    async with bench() as (drive, _):
        watch = drive.watch("position", interval_s=0.1)
        consumers = let_go_on(watch, watch)
        await asyncio.sleep(2.05)
        await drive.close()
        assert sum(map(len, await asyncio.gather(*consumers))) == pytest.approx(21, abs=1)


async def test_cancelling_a_consumer_at_any_moment_disturbs_no_other() -> None:
    """P5: a hundred consumers come, and are cancelled after another time each."""
    async with bench(position=4, baudrate=9600) as (drive, _):
        watch = drive.watch("position", "speed", interval_s=0.2)
        (steady,) = let_go_on(watch)
        for number in range(100):
            (victim,) = let_go_on(drive.watch("status", "position", interval_s=0.05))
            await asyncio.sleep(0.0017 * number)
            victim.cancel()
            await asyncio.wait([victim])
            assert victim.cancelled()
        await asyncio.sleep(1)
        assert await drive.target() == 4
        assert drive.stats.timeouts == drive.stats.strays == 0
        await drive.close()
        seen = await steady
        assert all(dict(reading.values) == {"position": 4, "speed": 0} for reading in seen)
        assert max(gaps(reading.at for reading in seen)) < 0.6


async def test_cancelling_the_last_consumer_while_the_drive_is_asked_leaves_the_line_in_step() -> None:
    async def consume(drive: Drive) -> None:
        async for _ in drive.watch("status", "position", interval_s=0.001):
            pass

    for tick in range(0, 60, 3):
        async with bench(f"d{tick}", position=4, baudrate=9600) as (drive, _):
            victim = asyncio.create_task(consume(drive))
            await asyncio.sleep(tick / 1000)
            victim.cancel()
            assert await drive.position() == 4
            assert await drive.speed() == 0
            assert drive.stats.timeouts == drive.stats.strays == 0
            await asyncio.sleep(0.1)
            assert not polling(), "it is read for somebody who was cancelled"
            assert victim.cancelled()


async def test_whoever_cancels_the_poller_itself_lets_nobody_wait_for_ever() -> None:
    async with bench() as (drive, _):
        (consumer,) = let_go_on(drive.watch("position"))
        await asyncio.sleep(1)
        polling()[0].cancel()
        assert len(await consumer) >= 5
        assert len(await readings(drive.watch("position"), 2)) == 2


async def test_a_defect_is_raised_in_who_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    async with bench() as (drive, _):
        consumer = drive.watch("position")
        complaints: list[str] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context["message"]))
        monkeypatch.setattr(drive._poller, "_reading", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            await anext(consumer)


# The end --------------------------------------------------------------------------------------------------------------


async def test_closing_the_drive_ends_every_watch_and_those_to_come() -> None:
    async with bench() as (drive, _):
        consumers = let_go_on(*(drive.watch("position", interval_s=interval_s) for interval_s in (0.05, 1, 3600)))
        await asyncio.sleep(1.5)
        await drive.close()
        await turns()
        assert not polling()
        assert [len(await consumer) for consumer in consumers] == [pytest.approx(31, abs=1), 2, 1]
        assert [reading async for reading in drive.watch("position")] == []
        assert not polling()


@pytest.mark.parametrize("at", [0.0005, 0.0013, 0.05, 0.0999, 0.1003])
async def test_a_lost_line_is_raised_in_every_consumer(at: float) -> None:
    async with scripted(settings=DriveSettings(reconnect=False)) as (drive, far):
        consumers = let_go_on(*(drive.watch("position", interval_s=interval_s) for interval_s in (0.1, 3600)))
        await asyncio.sleep(at)
        far.transport.abort()
        errors = [await ending(consumer) for consumer in consumers]
        assert all(isinstance(error, ConnectionLostError) and error.device == "x" for error in errors)
        assert errors[0] is not errors[1]
        await turns()
        assert not polling()
        assert isinstance(await ending(anext(drive.watch("position"))), ConnectionLostError)
        assert not polling()


async def test_a_reading_that_came_before_the_line_was_lost_is_seen_first() -> None:
    async with scripted(settings=DriveSettings(reconnect=False)) as (drive, far):
        watch = drive.watch("position")
        await asyncio.sleep(0.1)
        far.transport.abort()
        await turns()
        assert (await anext(watch))["position"] == 0
        for _ in range(2):
            assert isinstance(await ending(anext(watch)), ConnectionLostError)


# The line belongs to others first -------------------------------------------------------------------------------------


async def time_of(work: Awaitable[Any]) -> float:
    begun_at = now()
    await work
    return now() - begun_at


def read(drive: Drive) -> Awaitable[Any]:
    return drive.parameters.read(40)


def write(drive: Drive) -> Awaitable[Any]:
    return drive.parameters.write(40, 1.5)  # two exchanges


async def accepted(drive: Drive) -> None:
    move = drive.move_to(drive_target(drive), on_cancel="detach")
    await move.accepted
    move.cancel()


async def stop(drive: Drive) -> None:
    await drive.command("STOP")


_TARGETS: Counter[str] = Counter()


def drive_target(drive: Drive) -> float:
    _TARGETS[drive.name] += 1
    return float(_TARGETS[drive.name])


@pytest.mark.parametrize(("work", "exchanges"), [(read, 1), (write, 2), (accepted, 1), (stop, 1)])
async def test_a_thousand_watchers_slow_a_command_down_by_one_exchange_at_most(
    work: Callable[[Drive], Awaitable[Any]], exchanges: int
) -> None:
    async def times(name: str, watchers: int) -> list[float]:
        async with bench(name, baudrate=9600, homed=True) as (drive, _):
            watches = [drive.watch("position", "status", "speed", interval_s=0.001) for _ in range(watchers)]
            await asyncio.sleep(1)
            taken = []
            for number in range(25):
                await asyncio.sleep(0.3 + 0.0037 * number)
                taken.append(await time_of(work(drive)))
            assert all(watch.skipped > 10 for watch in watches)
            return taken

    async with bench("measured", baudrate=9600) as (drive, _):
        one_exchange_s = max([await time_of(drive.query(each)) for each in ("S1", "S4", "S16", "S17")])
    alone, watched = await times("alone", 0), await times("watched", 1000)
    assert max(watched) - max(alone) <= exchanges * one_exchange_s
    assert max(watched) - max(alone) > one_exchange_s / 2, "nobody was watching"


async def test_no_more_than_one_reading_is_queued_and_half_of_an_idle_line_is_used() -> None:
    async with bench(baudrate=9600) as (drive, _):
        pending: set[asyncio.Future[Any]] = set()
        most, busy_s = 0, 0.0
        link = drive._line.link
        exchange = link.exchange

        def counted(*arguments: Any, **more: Any) -> asyncio.Future[Any]:
            nonlocal most
            future, begun_at = exchange(*arguments, **more), now()

            def done(_: object) -> None:
                nonlocal busy_s
                pending.discard(future)
                busy_s += now() - begun_at

            pending.add(future)
            future.add_done_callback(done)
            most = max(most, len(pending))
            return future

        link.exchange = counted  # type: ignore[method-assign]
        watches = [drive.watch("position", "status", "S6", interval_s=0.001) for _ in range(100)]
        await asyncio.sleep(10)
        assert most == 1
        assert busy_s == pytest.approx(5, abs=0.1)
        assert len(watches) == 100


async def test_while_others_need_the_line_watchers_wait_but_are_not_forgotten() -> None:
    async with bench(baudrate=9600) as (drive, _):
        alone_s = await time_of(drive.parameters.read_all())
        with drive.watch("position", interval_s=0.001) as watch:
            (consumer,) = let_go_on(watch)
            begun_at = now()
            watched_s = await time_of(drive.parameters.read_all())
            watch.close()
        assert watched_s < 1.2 * alone_s
        times = [reading.at for reading in await consumer]
        assert max(gaps([begun_at, *times])) < 1


async def test_after_a_time_out_the_line_is_not_hogged() -> None:
    """What a drive that keeps silent costs is shared: the poller waits as long as it has waited for nothing."""
    async with bench(position=3) as (drive, far):
        watch = drive.watch("position", interval_s=0.001)
        await anext(watch)
        far.deaf = True
        await asyncio.sleep(60)
        far.deaf = False
        since = now()
        await drive.position()
        assert now() - since < 10
        while not (await anext(watch)).values:
            pass
        assert now() - since < 15


# Groups ---------------------------------------------------------------------------------------------------------------


async def groups(watch: GroupWatch, number: int) -> list[GroupReading]:
    with watch:
        return [await anext(watch) for _ in range(number)]


async def test_a_group_gives_the_newest_reading_of_every_axis_together() -> None:
    async with bench("x", position=1) as (x, _), bench("y", position=2) as (y, _):
        group = DriveGroup(x=x, y=y)
        seen = await groups(group.watch("position", interval_s=0.2), 5)
        for reading in seen:
            assert {axis: each["position"] for axis, each in reading.items()} == {"x": 1, "y": 2}
            assert abs(reading["x"].at - reading["y"].at) < 0.01
        times = [reading["x"].at for reading in seen]
        assert times[1:] == pytest.approx([0.2, 0.4, 0.6, 0.8], abs=0.01)
        await turns()
        assert not polling()


async def test_a_silent_axis_delays_the_others_by_an_interval_and_is_not_invented() -> None:
    async with bench("x") as (x, _), bench("y") as (y, far):
        far.deaf = True
        with DriveGroup(x=x, y=y).watch("position", interval_s=0.1) as watch:
            seen = [await anext(watch) for _ in range(5)]
            assert now() < 0.65
            assert [list(reading) for reading in seen] == [["x"]] * 5
            while "y" not in (reading := await anext(watch)):
                pass
            assert now() < 1.5
            assert isinstance(reading["y"].errors["position"], AnswerTimeoutError)
            far.deaf = False
            await asyncio.sleep(10)
            reading = await anext(watch)
            assert reading["y"]["position"] == 0
            assert watch.skipped > 0


async def test_news_that_come_quicker_than_a_silent_axis_hold_nothing_up() -> None:
    def watch_of_nobody() -> Watch:
        return Watch(("position",), 0.1, lambda: None, lambda: None)

    x, y = watch_of_nobody(), watch_of_nobody()
    group = GroupWatch({"x": x, "y": y})
    for tick in range(3):
        at = 0.07 * tick
        asyncio.get_running_loop().call_at(at, x.put, Reading("x", at, {"position": tick}, {}))
    reading = await anext(group)
    assert now() == pytest.approx(0.1)
    assert reading["x"]["position"] == 1
    assert group.skipped == 1


async def test_an_axis_that_falls_silent_shows_in_the_age_of_its_reading() -> None:
    async with bench("x") as (x, _), bench("y") as (y, far):
        with DriveGroup(x=x, y=y).watch("position", interval_s=0.1) as watch:
            await anext(watch)
            far.deaf = True
            for _ in range(6):
                reading = await anext(watch)
            assert reading["x"].at - reading["y"].at > 0.3
            far.deaf = False


async def test_an_axis_that_is_lost_is_named() -> None:
    async with bench("left") as (x, _), scripted(settings=DriveSettings(reconnect=False)) as (y, far):
        watch = DriveGroup(a=x, b=y).watch("position")
        await anext(watch)
        far.transport.abort()
        error = await ending(anext(watch))
        assert isinstance(error, ConnectionLostError)
        assert "b" in error.__notes__[0].split()
        await turns()
        assert not polling(), "the axis that is left is polled for nobody"
        assert await ending(anext(watch)) is error


async def test_closing_a_drive_of_a_group_ends_the_iteration() -> None:
    async with bench("x") as (x, _), bench("y") as (y, _):
        watch = DriveGroup(x=x, y=y).watch("position")

        async def consume() -> int:
            return len([reading async for reading in watch])

        consumer = asyncio.create_task(consume())
        await asyncio.sleep(1.05)
        await y.close()
        assert await consumer == pytest.approx(6, abs=1)
        await turns()
        assert not polling()


async def test_dropping_a_groups_watch_or_cancelling_its_consumer_ends_the_polling() -> None:
    async with bench("x") as (x, _), bench("y") as (y, _):
        group = DriveGroup(x=x, y=y)
        async for reading in group.watch("position", "speed"):
            assert list(reading) == ["x", "y"]
            break
        await turns()
        assert not polling()

        async def consume() -> None:
            async for _ in group.watch("position"):
                pass

        consumer = asyncio.create_task(consume())
        await asyncio.sleep(1.23)
        consumer.cancel()
        await asyncio.sleep(0.1)
        assert not polling()
        assert consumer.cancelled()
        with pytest.raises(InvalidCommandError, match="possible are"):
            group.watch("positions")
        assert not polling()
