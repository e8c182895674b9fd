"""What a lost line that comes back must still not do: move late, wait too long, mistake a restart (P2, P3, P6, P10)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

import pytest

import compax_aio
from compax_aio import (
    CompaxError,
    ConnectionLostError,
    Drive,
    DriveGroup,
    DriveSettings,
    MoveInDoubtError,
    MoveResult,
)
from compax_aio.compax.events import ConnectionRestored
from compax_aio.compax.program import MoveTo
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.transports import registry
from compax_aio.transports.loopback import listen, open_loopback

from .bench import ScriptedDrive, lines, motions, now, until
from .cable import Cable, connected, outcome

lenient = partial(connected, may_fail_to_close=True)

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def _awaited(work: Awaitable[Any]) -> Any:
    return await work


async def _group_move(drive: Drive) -> Any:
    return await DriveGroup(x=drive).move_to(x=50)


MOTIONS: Final[dict[str, Callable[[Drive], Awaitable[Any]]]] = {
    "move_to": lambda drive: drive.move_to(50),
    "move_by": lambda drive: drive.move_by(50),
    "home": lambda drive: drive.home(),
    "command": lambda drive: drive.command("PA50"),
    "program.start": lambda drive: drive.program.start(1),
    "group": _group_move,
}


# Motions that wait for a stop ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", MOTIONS)
async def test_a_motion_that_was_commanded_while_a_stop_waits_for_a_lost_line_never_begins(what: str) -> None:
    async with lenient() as (drive, far, cable):
        await drive.program.write(1, MoveTo(50))
        await cable.pull()
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(1)
        commanded = asyncio.ensure_future(_awaited(MOTIONS[what](drive)))
        await asyncio.sleep(5)
        await cable.plug(far)
        await outcome(stopping)
        fate = await outcome(commanded)
        assert motions(far) == []
        assert isinstance(fate, ConnectionLostError), fate


@pytest.mark.parametrize("what", MOTIONS)
async def test_a_motion_that_waits_for_a_stop_whose_line_is_lost_never_begins(what: str) -> None:
    async with lenient(stop_ramp_ms=3000) as (drive, far, cable):
        await drive.program.write(1, MoveTo(50))
        move = drive.move_to(10_000)
        await move.accepted
        await asyncio.sleep(3)
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.05)
        commanded = asyncio.ensure_future(_awaited(MOTIONS[what](drive)))
        await asyncio.sleep(0.05)
        await cable.pull()
        await asyncio.sleep(5)
        await cable.plug(far)
        await outcome(stopping)
        await outcome(commanded)
        await outcome(move)
        assert motions(far) == ["POSA 10000.00"]


@pytest.mark.parametrize(
    ("cut_at", "what"),
    [(cut_at, what) for cut_at in ("S16", "S30", "S1", "S2") for what in MOTIONS],
)
async def test_a_motion_whose_look_at_a_new_fault_is_cut_never_begins(cut_at: str, what: str) -> None:
    async with lenient(answer_time_s=0.01, homed=True, position=7) as (drive, far, cable):
        await drive.program.write(1, MoveTo(50))
        far.raise_fault(55)
        before = len(lines(far))
        commanded = asyncio.ensure_future(_awaited(MOTIONS[what](drive)))
        with suppress(TimeoutError):
            await until(lambda: cut_at in lines(far)[before:] or commanded.done(), 2, to_the_tick=True)
        if commanded.done():
            await outcome(commanded)
            return
        await cable.pull()
        far.receive(b"QUIT\r", now())
        await asyncio.sleep(5)
        await cable.plug(far)
        await outcome(commanded)
        assert motions(far) == []


# Lines that lead nowhere ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", MOTIONS)
async def test_a_motion_that_finds_its_line_leading_nowhere_does_not_begin_when_somebody_mends_it(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mended = asyncio.Event()
    mended.set()

    async def open_slowly(url: Any, factory: Any) -> asyncio.Transport:
        await mended.wait()
        return await open_loopback(type(url).parse(f"loop://{url.host}"), factory)

    monkeypatch.setitem(registry._openers, "odd", open_slowly)
    far, cable = SimulatedDrive(name="x"), Cable("slow")
    await cable.plug(far)
    drive = await compax_aio.connect("odd://slow", name="x")
    await drive.program.write(1, MoveTo(50))
    cable.go_half_open()
    while drive._line.link._silence.error is None:
        assert isinstance(await outcome(drive.position()), CompaxError)
    mended.clear()
    commanded = asyncio.ensure_future(_awaited(MOTIONS[what](drive)))
    await asyncio.sleep(25)
    mended.set()
    await outcome(commanded)
    begun = motions(far)
    await drive.close()
    await cable.pull()
    assert begun == []


async def test_a_stop_on_a_line_that_says_nothing_is_still_written_on_it() -> None:
    """Perhaps the drive hears, and only its answers are lost; and nobody knows whether the line can be opened anew."""
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        fars.append(ScriptedDrive())
        return fars[-1]

    listener = await listen("deaf", far)
    drive = await compax_aio.connect(listener.url, name="x", settings=DriveSettings(stop_timeout_s=5))
    fars[0].answers = {f"S{number}": None for number in range(1, 100)}
    fars[0].answers["STOP"] = None
    while drive._line.link._silence.error is None:
        assert isinstance(await outcome(drive.position()), CompaxError)
    listener.close()  # a second connection is not to be had
    await outcome(drive.stop())
    with suppress(CompaxError):
        await drive.close()
    assert "STOP" in fars[0].lines


async def test_a_line_on_which_something_has_come_since_is_not_opened_anew() -> None:
    async with lenient() as (drive, far, cable):
        far.extra_answer_delay_s = 21.0
        while drive._line.link._silence.error is None:
            assert isinstance(await outcome(drive.position()), CompaxError)
        far.extra_answer_delay_s = 0.0
        heard = drive.stats.bytes_received
        await until(lambda: drive.stats.bytes_received > heard)
        await asyncio.sleep(30)
        assert isinstance(await outcome(drive.position()), float)
        assert cable.opened == 1


# Waiting no longer than was told -------------------------------------------------------------------------------------


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Let ``odd://name`` open ``loop://name``, or hang while the list holds True."""
    hangs = [False]

    async def open_odd(url: Any, factory: Any) -> asyncio.Transport:
        if hangs[0]:
            await asyncio.get_running_loop().create_future()
        return await open_loopback(type(url).parse(f"loop://{url.host}"), factory)

    monkeypatch.setitem(registry._openers, "odd", open_odd)
    return hangs


@pytest.mark.parametrize("asked_after_s", [2, 20, 29, 31, 100])
async def test_a_query_settles_although_the_port_hangs_while_it_is_opened(
    hanging: list[bool], asked_after_s: float
) -> None:
    far, cable = SimulatedDrive(name="x"), Cable("hangs")
    await cable.plug(far)
    drive = await compax_aio.connect("odd://hangs", name="x")
    hanging[0] = True
    await cable.pull()
    await asyncio.sleep(asked_after_s)
    try:
        async with asyncio.timeout(65):
            with suppress(CompaxError):
                await drive.position()
    finally:
        begun_at = now()
        await drive.close()
        assert now() - begun_at < 3


async def test_closing_ends_although_an_opener_makes_an_error_of_its_cancelling(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    is_released = False

    async def open_odd(url: Any, factory: Any) -> asyncio.Transport:
        if far.lines and not is_released:
            try:
                await asyncio.get_running_loop().create_future()
            except asyncio.CancelledError:
                raise OSError("interrupted") from None
        return await open_loopback(type(url).parse(f"loop://{url.host}"), factory)

    monkeypatch.setitem(registry._openers, "odd", open_odd)
    far = ScriptedDrive()
    with await listen("stubborn", lambda: far):
        drive = await compax_aio.connect("odd://stubborn", name="x")
        far.transport.abort()
        await asyncio.sleep(3)
        closing = asyncio.ensure_future(drive.close())
        await asyncio.sleep(5)
        was_closed, is_released = closing.done(), True
        while not closing.done():
            for task in asyncio.all_tasks():
                if task.get_name() == "x: reconnect":
                    task.cancel()
            await asyncio.sleep(1)
        assert was_closed


@pytest.mark.parametrize("lost_after_s", [4.95, 5.05])
async def test_a_stop_whose_line_is_lost_as_its_time_ends_waits_no_longer_than_told(lost_after_s: float) -> None:
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        fars.append(ScriptedDrive())
        return fars[-1]

    listener = await listen("late", far)
    drive = await compax_aio.connect(listener.url, name="x", settings=DriveSettings(stop_timeout_s=5))
    fars[0].answers |= {f"S{number}": f"S{number:03}: 0" for number in range(1, 100)} | {"STOP": None}
    begun_at = now()
    stopping = asyncio.ensure_future(drive.stop())
    await asyncio.sleep(lost_after_s)
    assert not stopping.done()
    listener.close()
    fars[0].transport.abort()
    await outcome(stopping)
    took = now() - begun_at
    with suppress(CompaxError):
        await drive.close()
    assert took < 8


@pytest.mark.parametrize(
    ("dies_at", "status"),
    [
        ("S17", "S016: 11010000"),
        ("S16", "S016: 11010000"),
        ("S17", "S016: 01010000"),
        ("S16", "S016: 01010000"),
        ("S30", "S016: 01010000"),
        ("S1", "S016: 11010000"),
        ("S1", "S016: 01010000"),
    ],
)
async def test_a_refused_stop_whose_line_is_lost_waits_no_longer_than_told(dies_at: str, status: str) -> None:
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        fars.append(ScriptedDrive())
        return fars[-1]

    listener = await listen("refusing", far)
    settings = DriveSettings(stop_timeout_s=5, standstill_timeout_s=5)
    drive = await compax_aio.connect(listener.url, name="x", settings=settings)
    fars[0].answers |= {"STOP": "E90", "S16": status}

    def die(line: str) -> None:
        if line == dies_at:
            listener.close()
            fars[0].transport.abort()

    fars[0].on_line = die
    begun_at = now()
    await outcome(drive.stop())
    took = now() - begun_at
    with suppress(CompaxError):
        await drive.close()
    assert took < 12, took


@pytest.mark.parametrize("dies_at", ["S30", "S1"])
async def test_a_stop_that_has_seen_the_standstill_of_a_faulty_drive_waits_no_longer_than_told(dies_at: str) -> None:
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        fars.append(ScriptedDrive())
        return fars[-1]

    listener = await listen("refusing", far)
    settings = DriveSettings(stop_timeout_s=5, standstill_timeout_s=5)
    drive = await compax_aio.connect(listener.url, name="x", settings=settings)
    fars[0].answers |= {"S16": "S016: 00010000"}
    await drive.reconcile()  # the fault is known

    def die(line: str) -> None:
        if line == dies_at:
            listener.close()
            fars[0].transport.abort()

    fars[0].on_line = die
    begun_at = now()
    await outcome(drive.stop())
    took = now() - begun_at
    with suppress(CompaxError):
        await drive.close()
    assert took < 12


async def test_a_move_whose_line_flaps_is_in_doubt_no_later_than_told() -> None:
    async with lenient(DriveSettings(in_doubt_after_s=20)) as (drive, far, cable):
        move = drive.move_to(1_000_000)
        await move.accepted
        await asyncio.sleep(10)
        await cable.pull()
        lost_at = now()
        while not move.done():
            await asyncio.sleep(18)
            opened = cable.opened
            await cable.plug(far)
            await until(partial(lambda before: cable.opened > before or move.done(), opened))
            await asyncio.sleep(0.001)
            await cable.pull()
            if now() - lost_at > 200:
                break
        assert isinstance(await outcome(move), MoveInDoubtError)
        assert now() - lost_at < 2 * 20


# Restarts ------------------------------------------------------------------------------------------------------------


async def test_a_move_that_is_stopped_while_its_drive_is_switched_off_is_not_told_as_reached() -> None:
    async with lenient(position=500) as (drive, far, cable):
        move = drive.move_to(0)
        await move.accepted
        await asyncio.sleep(1)
        await cable.pull()
        stopping = asyncio.ensure_future(drive.stop())
        far.power_cycle()
        await asyncio.sleep(1)
        await cable.plug(far)
        await outcome(stopping)
        fate = await outcome(move)
        assert not isinstance(fate, MoveResult), fate


async def test_a_homed_move_that_is_stopped_while_its_drive_is_switched_off_is_in_doubt() -> None:
    async with lenient(position=500, homed=True) as (drive, far, cable):
        await drive.status()
        await drive.reconcile()
        move = drive.move_to(0)
        await move.accepted
        await asyncio.sleep(1)
        await cable.pull()
        stopping = asyncio.ensure_future(drive.stop())
        far.power_cycle()
        await asyncio.sleep(1)
        await cable.plug(far)
        await outcome(stopping)
        fate = await outcome(move)
        assert isinstance(fate, MoveInDoubtError), fate


@pytest.mark.parametrize(
    "how",
    [
        "raw",
        "cancelled",
        "detached",
        "stopped",
    ],
)
async def test_a_search_for_machine_zero_that_is_cut_is_no_sign_of_a_restart(how: str) -> None:
    async with lenient(homed=True, position=2000) as (drive, far, cable):
        await drive.reconcile()
        events = drive.events()
        if how == "raw":
            await drive.command("PH")
        else:
            home = drive.home(on_cancel="detach" if how == "detached" else "stop")
            await home.accepted
        await asyncio.sleep(1)
        await cable.pull()
        if how in ("cancelled", "detached"):
            home.cancel()
        elif how == "stopped":
            stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.5)
        await cable.plug(far)
        while not isinstance(event := await anext(events), ConnectionRestored):
            pass
        if how == "stopped":
            await outcome(stopping)
            await outcome(home)
        assert event.signs_of_restart == ()
