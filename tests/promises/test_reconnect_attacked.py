"""What a lost line must not do, however unluckily it is lost: hang, double, mislead (P2, P3, P6, P8, P10)."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
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
    MoveStoppedError,
    RestoreIncompleteError,
)
from compax_aio.compax.events import ConnectionRestored, DriveEvent, Fault, PositionMessage
from compax_aio.compax.ledger import Sent
from compax_aio.compax.program import MoveTo
from compax_aio.link.exchanges import Exchange
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports import registry
from compax_aio.transports.loopback import listen

from .bench import PROMPT, ScriptedDrive, is_moving, lines, motions, now, until
from .cable import Cable, connected, outage, outcome

lenient = partial(connected, may_fail_to_close=True)

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

MARKERS_TOO: Final[dict[str, str | None]] = {f"S{number}": f"S{number:03}: 0.00" for number in range(1, 13)}


def instances(*kinds: type) -> int:
    """Count what is alive of *kinds*."""
    gc.collect()
    return sum(isinstance(each, kinds) for each in gc.get_objects())


class HandLine(asyncio.Transport):
    """
    A line whose end is told as a thread would tell it: in one breath with the last bytes, or late, or twice.

    It answers as a scripted drive; *dies_with* is the line with whose answer it ends.
    """

    def __init__(
        self, protocol: asyncio.Protocol, *, dies_with: str = "", silent: bool = False, end_after_s: float = 0.0
    ) -> None:
        super().__init__()
        self.far = ScriptedDrive(MARKERS_TOO)
        self.far.transport = self  # only asked for what it would write
        self.protocol = protocol
        self.is_ended = False
        self._dies_with = dies_with
        self._silent = silent
        self._end_after_s = end_after_s
        self._loop = asyncio.get_running_loop()
        self._out: list[bytes] = []
        protocol.connection_made(self)

    def get_write_buffer_size(self) -> int:
        return 0

    def write(self, data: bytes | bytearray | memoryview) -> None:
        for line in bytes(data).decode().split("\r")[:-1]:
            self.far.lines.append(line)
            answer = self.far.answers.get(line, "")
            if not self._silent and answer is not None:
                self._loop.call_soon(self.protocol.data_received, answer.encode() + PROMPT)
            if line == self._dies_with:
                self._dies_with = ""
                self._loop.call_soon(self.tell_end)

    def is_closing(self) -> bool:
        return self.is_ended

    def close(self) -> None:
        self.abort()

    def abort(self) -> None:
        if not self.is_ended:
            self.is_ended = True
            self._loop.call_later(self._end_after_s, self.protocol.connection_lost, None)

    def tell_end(self) -> None:
        self.is_ended = True
        self.protocol.connection_lost(None)


@pytest.fixture
def hand_lines(monkeypatch: pytest.MonkeyPatch) -> tuple[list[dict[str, Any]], list[HandLine]]:
    """Let ``odd://`` open hand lines, the first as the first plan says, and so on; then good ones."""
    plans: list[dict[str, Any]] = []
    opened: list[HandLine] = []

    async def open_odd(_: object, factory: Callable[[], asyncio.Protocol]) -> asyncio.Transport:
        plan = plans.pop(0) if plans else {}
        if error := plan.pop("error", None):
            raise error
        opened.append(HandLine(factory(), **plan))
        return opened[-1]

    monkeypatch.setitem(registry._openers, "odd", open_odd)
    return plans, opened


# Lost at the worst moment ---------------------------------------------------------------------------------------------


async def test_a_line_that_is_lost_in_one_breath_with_the_last_answer_of_the_greeting_is_tried_again(
    hand_lines: tuple[list[dict[str, Any]], list[HandLine]],
) -> None:
    plans, opened = hand_lines
    drive = await compax_aio.connect("odd://x", name="x")
    plans.append({"dies_with": "S18"})
    opened[0].tell_end()
    await asyncio.sleep(30)
    try:
        assert await outcome(drive.position()) == 0
        assert drive.is_open
    finally:
        await drive.close()


async def test_a_line_that_is_lost_while_it_is_opened_for_the_first_time_is_told_or_tried_again(
    hand_lines: tuple[list[dict[str, Any]], list[HandLine]],
) -> None:
    plans, _ = hand_lines
    plans.append({"dies_with": "S18"})
    try:
        drive = await compax_aio.connect("odd://x", name="x")
    except ConnectionLostError:
        return
    try:
        assert await outcome(drive.position()) == 0
    finally:
        await drive.close()


async def test_the_late_end_of_an_earlier_attempt_does_not_end_the_line_that_is_open(
    hand_lines: tuple[list[dict[str, Any]], list[HandLine]],
) -> None:
    plans, opened = hand_lines
    drive = await compax_aio.connect("odd://x", name="x")
    plans.append({"silent": True, "end_after_s": 20.0})
    opened[0].tell_end()
    await until(lambda: drive.is_open)
    restored = drive.stats.reconnects
    await asyncio.sleep(40)
    try:
        assert drive.stats.reconnects == restored
        assert [line.is_ended for line in opened] == [True, True, False]
    finally:
        await drive.close()


async def test_an_end_that_is_told_twice_does_not_end_the_line_that_was_opened_since(
    hand_lines: tuple[list[dict[str, Any]], list[HandLine]],
) -> None:
    _, opened = hand_lines
    drive = await compax_aio.connect("odd://x", name="x")
    opened[0].tell_end()
    await until(lambda: drive.is_open)
    opened[0].tell_end()
    try:
        assert drive.is_open
        await asyncio.sleep(10)
        assert not opened[1].is_ended
        assert len(opened) == 2
    finally:
        await drive.close()


async def test_what_an_earlier_transport_still_says_answers_nothing_on_the_new_line(
    hand_lines: tuple[list[dict[str, Any]], list[HandLine]],
) -> None:
    _, opened = hand_lines
    drive = await compax_aio.connect("odd://x", name="x")
    opened[0].tell_end()
    await until(lambda: drive.is_open)
    opened[1].far.answers["S1"] = None
    reading = asyncio.ensure_future(drive.position())
    await asyncio.sleep(0.01)
    opened[0].protocol.data_received(b"S001: 99.00" + PROMPT)
    try:
        assert await outcome(reading) != 99
    finally:
        await drive.close()


@pytest.mark.parametrize("error", [ValueError("odd"), RuntimeError("odd"), asyncio.CancelledError()], ids=repr)
async def test_an_opener_that_fails_in_its_own_way_once_is_tried_again(
    error: BaseException, hand_lines: tuple[list[dict[str, Any]], list[HandLine]]
) -> None:
    plans, opened = hand_lines
    drive = await compax_aio.connect("odd://x", name="x")
    plans.append({"error": error})
    opened[0].tell_end()
    await asyncio.sleep(60)
    try:
        assert await outcome(drive.position()) == 0
    finally:
        await drive.close()


async def test_a_line_that_led_nowhere_and_is_then_lost_is_opened_once() -> None:
    async with lenient() as (drive, far, cable):
        cable.half_open = True
        while drive._line.link._silence.error is None:
            assert isinstance(await outcome(drive.position()), CompaxError)
        await asyncio.sleep(5)
        assert cable.opened == 1, "what is asked next opens it anew"
        await cable.pull()
        cable.half_open = False
        reading = asyncio.ensure_future(drive.position())
        await asyncio.sleep(0.01)
        before = cable.opened
        await cable.plug(far)
        assert await outcome(reading) == 0
        await asyncio.sleep(30)
        assert cable.opened == before + 1
        assert drive.stats.reconnects == 1


# Everything awaited settles ------------------------------------------------------------------------------------------


async def test_a_query_that_came_while_a_hopeless_line_was_greeted_settles_when_that_is_lost_again() -> None:
    async with lenient(DriveSettings(in_doubt_after_s=3)) as (drive, far, cable):
        await cable.pull()
        await asyncio.sleep(10)
        cable.half_open = True
        await cable.plug(far)
        opened = cable.opened
        await until(lambda: cable.opened > opened)
        reading = asyncio.ensure_future(drive.position())
        await asyncio.sleep(0.1)
        await cable.pull()
        assert isinstance(await outcome(reading, 20), ConnectionLostError)


async def test_a_query_whose_answer_always_loses_the_line_settles() -> None:
    class Poisoned(ScriptedDrive):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(transport)
            self.answers |= MARKERS_TOO
            self.on_line = lambda line: self.transport.abort() if line == "S45" else None

    with await listen("poisoned", Poisoned) as listener:
        drive = await compax_aio.connect(listener.url, name="x")
        try:
            assert isinstance(await outcome(drive.read_status(45), 300), ConnectionLostError)
        finally:
            await drive.close()


async def test_a_stop_that_was_acknowledged_before_the_line_was_lost_ends_in_its_own_time() -> None:
    settings = DriveSettings(stop_timeout_s=2, standstill_timeout_s=3)
    async with lenient(settings, stop_ramp_ms=60_000) as (drive, _, cable):
        move = drive.move_to(100_000)
        await move.accepted
        await asyncio.sleep(10)
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.5)
        await cable.pull()
        begun_at = now()
        assert isinstance(await outcome(stopping), CompaxError)
        assert now() - begun_at < 6
        assert isinstance(await outcome(move), MoveInDoubtError)


async def test_a_drive_that_was_off_for_long_is_there_soon_after_it_is_back() -> None:
    async with lenient() as (drive, far, cable):
        await cable.pull()
        far.power_off()
        await cable.plug(far)
        await asyncio.sleep(600)
        far.power_on()
        back_at = now()
        await until(lambda: drive.is_open, 300)
        assert now() - back_at < 10


async def test_a_limited_number_of_attempts_counts_for_each_loss() -> None:
    async with lenient(DriveSettings(reconnect_attempts=1, reconnect_first_s=0.1)) as (drive, far, cable):
        for _ in range(3):
            await outage(cable, far, 0.01)
            await asyncio.sleep(1)
            assert drive.is_open
            assert await outcome(drive.position()) == 0


# Who is there --------------------------------------------------------------------------------------------------------


async def test_a_fault_of_another_drive_is_not_told_as_ours() -> None:
    async with lenient() as (drive, far, cable):
        events = drive.events()
        other = SimulatedDrive(name="other")
        other.raise_fault(55)
        await cable.pull()
        await cable.plug(other)
        await asyncio.sleep(3)
        await cable.pull()
        await cable.plug(far)
        seen: list[DriveEvent] = []
        while not (seen and isinstance(seen[-1], ConnectionRestored)):
            seen.append(await anext(events))
        assert not any(isinstance(event, Fault) for event in seen)


async def test_a_message_of_another_drive_is_not_told_as_ours() -> None:
    async with lenient() as (drive, far, cable):
        events = drive.events()
        other = SimulatedDrive(name="other")
        await cable.pull()
        await cable.plug(other)
        opened = cable.opened
        await until(lambda: cable.opened > opened)
        other.inject(b"$" + PROMPT)
        await asyncio.sleep(3)
        await cable.pull()
        await cable.plug(far)
        seen: list[DriveEvent] = []
        while not (seen and isinstance(seen[-1], ConnectionRestored)):
            seen.append(await anext(events))
        assert not any(isinstance(event, PositionMessage) for event in seen)


@pytest.mark.parametrize("other_is_homed", [False, True])
async def test_another_drive_that_was_looked_at_meanwhile_neither_hides_nor_fakes_a_restart(
    other_is_homed: bool,
) -> None:
    async with lenient() as (drive, far, cable):
        if not other_is_homed:
            await drive.home()
        other, other_cable = SimulatedDrive(name="other"), Cable("other")
        await other_cable.plug(other)
        if other_is_homed:
            async with compax_aio.connect(other_cable.url, name="other") as others:
                await others.home()
        await other_cable.pull()
        events = drive.events()
        await cable.pull()
        await cable.plug(other)
        await asyncio.sleep(3)
        await cable.pull()
        if not other_is_homed:
            far.power_cycle()
        await cable.plug(far)
        while not isinstance(event := await anext(events), ConnectionRestored):
            pass
        assert bool(event.signs_of_restart) is not other_is_homed


async def test_a_stop_that_another_drive_has_acknowledged_is_still_said_to_ours() -> None:
    async with lenient() as (drive, far, cable):
        move = drive.move_to(1_000_000)
        await move.accepted
        await cable.pull()
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.1)
        other = SimulatedDrive(name="other")
        await cable.plug(other)
        await until(lambda: "STOP" in lines(other))
        await asyncio.sleep(1)
        await cable.pull()
        await cable.plug(far)
        await outcome(stopping)
        assert "STOP" in lines(far)
        assert not is_moving(far)
        assert isinstance(await outcome(move), MoveStoppedError)


# Switched off and on -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut_at", ["S16", "P20", "S31", "S39", "S18"])
async def test_a_restart_is_noticed_although_the_greeting_that_showed_it_was_cut(cut_at: str) -> None:
    async with lenient() as (drive, far, cable):
        far.raise_fault(55)
        await drive.status()
        await drive.quit()
        await drive.home()
        far.raise_fault(55)
        await drive.status()
        events = drive.events()
        await cable.pull()
        far.power_cycle()
        before = len(lines(far))
        await cable.plug(far)
        await until(lambda: cut_at in lines(far)[before:], to_the_tick=True)
        await asyncio.sleep(0.0005)
        await cable.pull()
        await asyncio.sleep(1)
        await cable.plug(far)
        while not isinstance(event := await anext(events), ConnectionRestored):
            pass
        assert len(event.signs_of_restart) == 2


async def test_a_drive_that_was_switched_off_is_not_told_to_have_reached_zero() -> None:
    """Unhomed, its position begins anew at 0; only the bit that says "position reached" is left to tell."""
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        fars.append(ScriptedDrive({"S1": "S001: 0.00"} if fars else {"S1": "S001: 50.00", "S17": "S017: 00100010"}))
        if len(fars) > 1:
            fars[-1].answers["S16"] = "S016: 10010000"
        else:
            fars[-1].answers["S16"] = "S016: 10000010"
        return fars[-1]

    with await listen("restarted", far) as listener:
        drive = await compax_aio.connect(listener.url, name="x")
        move = drive.move_to(0)
        await move.accepted
        await asyncio.sleep(1)
        fars[0].transport.abort()
        result = await outcome(move)
        with suppress(CompaxError):
            await drive.close()
        assert isinstance(result, MoveInDoubtError), result


async def test_a_program_whose_drive_was_switched_off_is_not_told_as_finished() -> None:
    async with lenient() as (drive, far, cable):
        await drive.home()
        await drive.program.download("N001: POSA 5000\nN002: END")
        await drive.program.start(1)
        waiting = asyncio.ensure_future(drive.program.wait_finished())
        await asyncio.sleep(0.5)
        await outage(cable, far, 1, power_cycle=True)
        assert isinstance(await outcome(waiting), CompaxError)
        assert far.position < 5000


async def test_nothing_goes_in_binary_to_a_drive_that_does_not_take_it_any_more() -> None:
    async with lenient(DriveSettings(binary_settings=True), p20=16) as (drive, _, cable):
        assert drive.interface is not None
        assert drive.interface.binary
        await drive.move_to(1, speed_percent=50)
        await cable.pull()
        changed = SimulatedDrive(Knobs(p20=0), name="x")
        await cable.plug(changed)
        await until(lambda: drive.is_open)
        assert isinstance(await outcome(drive.move_to(2, speed_percent=40)), MoveResult)
        assert drive.stats.timeouts == 0
        assert "SD40" in lines(changed)


async def test_a_position_reached_message_that_comes_during_the_greeting_is_counted() -> None:
    async with lenient(answer_time_s=0.01) as (drive, far, cable):
        await drive.move_to(10)
        move = drive.move_to(110)
        await move.accepted
        await asyncio.sleep(0.5)
        before = len(lines(far))
        far.delay_position_reached_s = 0.0
        await cable.pull()
        await cable.plug(far)
        await until(lambda: "S31" in lines(far)[before:], to_the_tick=True)
        assert is_moving(far)
        # it arrives now, between the look at the status and the end of the greeting
        line = DeviceLine.of(far)
        far.lose_position_reached = 1
        assert line._write is not None
        line._write(b"$" + PROMPT)
        await outcome(move)
        assert (await drive.move_to(120)).confirmed_by == "message"


# Motion while lost ---------------------------------------------------------------------------------------------------


MOTIONS: Final[dict[str, Callable[[Drive], Awaitable[Any]]]] = {
    "move_to": lambda drive: drive.move_to(50),
    "move_to with settings": lambda drive: drive.move_to(50, speed_percent=50),
    "move_by": lambda drive: drive.move_by(50),
    "home": lambda drive: drive.home(),
    "command": lambda drive: drive.command("PA50"),
    "program.start": lambda drive: drive.program.start(1),
}


@pytest.mark.parametrize("what", MOTIONS)
async def test_no_motion_that_was_commanded_while_the_line_was_lost_begins_when_it_is_back(what: str) -> None:
    async with lenient() as (drive, far, cable):
        await drive.program.write(1, MoveTo(50))
        await cable.pull()
        commanded = asyncio.ensure_future(_awaited(MOTIONS[what](drive)))
        await asyncio.sleep(10)
        await cable.plug(far)
        assert isinstance(await outcome(commanded), ConnectionLostError)
        await asyncio.sleep(10)
        assert motions(far) == []


async def _awaited(work: Awaitable[Any]) -> Any:
    return await work


async def test_a_half_open_line_is_opened_anew_before_a_move_on_it_is_in_doubt() -> None:
    async with lenient() as (drive, far, cable):
        move = drive.move_to(100)
        await move.accepted
        cable.half_open = True

        def leads_on_only_anew() -> None:
            if cable.opened > 1:
                cable.half_open = False

        ticking = asyncio.ensure_future(_every(0.01, leads_on_only_anew))
        result = await outcome(move)
        ticking.cancel()
        assert isinstance(result, MoveResult), result
        assert motions(far) == ["POSA 100.00"]


async def _every(seconds: float, work: Callable[[], None]) -> None:
    while True:
        work()
        await asyncio.sleep(seconds)


# Cut anywhere --------------------------------------------------------------------------------------------------------


async def _and_trigger(drive: Drive) -> Any:
    move = drive.prepare_move_to(50)
    await move.ready
    move.trigger()
    return await move


async def _start_program(drive: Drive) -> None:
    await drive.program.start(1)
    await drive.program.wait_finished()


async def _watched(drive: Drive) -> None:
    watch = drive.watch("position", "status", interval_s=0.01)
    for _ in range(3):
        await anext(watch)
    watch.close()


WORKS: Final[dict[str, Callable[[Drive], Awaitable[Any]]]] = {
    "move_to": lambda drive: drive.move_to(50, speed_percent=80, steps=[(10, 40)]),
    "move_by": lambda drive: drive.move_by(50),
    "home": lambda drive: drive.home(),
    "prepared": _and_trigger,
    "stop": lambda drive: drive.stop(),
    "quit": lambda drive: drive.quit(),
    "reconcile": lambda drive: drive.reconcile(),
    "status": lambda drive: drive.status(),
    "error_history": lambda drive: drive.error_history(),
    "command": lambda drive: drive.command("PA50"),
    "query": lambda drive: drive.query("S1"),
    "program": _start_program,
    "watch": _watched,
    "parameters.write": lambda drive: drive.parameters.write(40, 5),
    "read_axis": lambda drive: drive.read_axis(),
}


@pytest.mark.parametrize("power_cycle", [False, True], ids=["cut", "cut and switched off"])
@pytest.mark.parametrize("what", WORKS)
async def test_whatever_is_under_way_when_the_line_is_lost_ends_in_time_and_says_no_motion_twice(
    what: str, power_cycle: bool
) -> None:
    for milliseconds in (1, 4, 9, 13, 22, 35, 48):
        async with lenient(answer_time_s=0.003) as (drive, far, cable):
            await drive.program.write(1, MoveTo(50))
            begun, said = len(motions(far)), len(lines(far))
            work = asyncio.ensure_future(_awaited(WORKS[what](drive)))
            await asyncio.sleep(milliseconds / 1000)
            await outage(cable, far, 0.5, power_cycle=power_cycle)
            await outcome(work)
            assert len(motions(far)[begun:]) <= 1
            told = lines(far)[said:]
            for line in ("PA50", "PA50$", "PR50", "PR50$", "PH", "START", "P40=5"):
                assert told.count(line) <= 1, (line, told)
            await until(lambda: drive.is_open, 30)
            await outcome(drive.reconcile())
            assert isinstance(await outcome(drive.position()), float)


@pytest.mark.parametrize("what", ["move_to", "prepared", "stop", "program", "status"])
async def test_whatever_is_cancelled_while_its_line_is_lost_or_greeted_leaves_the_drive_usable_and_standing(
    what: str,
) -> None:
    for milliseconds in range(0, 700, 71):
        async with lenient(answer_time_s=0.003) as (drive, far, cable):
            await drive.program.write(1, MoveTo(5000))
            work = asyncio.ensure_future(_awaited(WORKS[what](drive)))
            await asyncio.sleep(0.03)
            await cable.pull()
            plugging = asyncio.get_running_loop().create_task(_plug_after(cable, far, 0.1))
            await asyncio.sleep(milliseconds / 1000)
            work.cancel()
            with suppress(asyncio.CancelledError, CompaxError):
                await work
            await plugging
            await until(lambda: drive.is_open, 30)
            await outcome(drive.stop())
            assert not is_moving(far)
            await outcome(drive.reconcile())
            assert isinstance(await outcome(drive.move_to(1)), MoveResult)


async def _plug_after(cable: Cable, far: SimulatedDrive, seconds: float) -> None:
    await asyncio.sleep(seconds)
    await cable.plug(far)


async def test_closing_at_any_time_of_a_loss_ends_in_time_and_leaves_nothing_open() -> None:
    for milliseconds in range(0, 700, 19):
        far, cable = SimulatedDrive(Knobs(answer_time_s=0.003), name="x"), Cable()
        await cable.plug(far)
        drive = await compax_aio.connect(cable.url, name="x")
        reading = asyncio.ensure_future(_awaited(drive.position()))
        await cable.pull()
        plugging = asyncio.get_running_loop().create_task(_plug_after(cable, far, 0.1))
        await asyncio.sleep(milliseconds / 1000)
        begun_at = now()
        await drive.close()
        assert now() - begun_at < 2
        await outcome(reading, 1)
        await plugging
        await asyncio.sleep(6)
        assert not DeviceLine.of(far).occupied
        await cable.pull()


class Frayed(Connection):
    """Breaks with the byte that is one too many, either way."""

    def __init__(self, line: DeviceLine, left: list[int], *, to_drive: bool) -> None:
        super().__init__(line, set())
        self._left = left
        self._to_drive = to_drive

    def data_received(self, data: bytes) -> None:
        super().data_received(self._let_through(data) if self._to_drive else data)

    def _send(self, data: bytes) -> None:
        super()._send(data if self._to_drive else self._let_through(data))

    def _let_through(self, data: bytes) -> bytes:
        passed, self._left[0] = data[: self._left[0]], self._left[0] - len(data)
        if self._left[0] < 0:
            self._left[0] = 1_000_000
            asyncio.get_running_loop().call_soon(self.abort)
        return passed


@pytest.mark.parametrize("to_drive", [True, False], ids=["to the drive", "from the drive"])
async def test_a_move_whose_line_breaks_at_any_byte_moves_at_most_once_and_its_fate_is_true(to_drive: bool) -> None:
    for byte in range(45):
        far, left = SimulatedDrive(name="x"), [1_000_000]
        line = DeviceLine.of(far)
        with await listen("frayed", partial(Frayed, line, left, to_drive=to_drive)) as listener:
            drive = await compax_aio.connect(listener.url, name="x")
            left[0] = byte
            move = drive.move_to(20, speed_percent=80)
            fate = await outcome(move)
            begun = motions(far)
            assert begun in ([], ["POSA 20.00"]), (byte, begun)
            if isinstance(fate, ConnectionLostError):
                assert begun == [], byte
            else:
                assert isinstance(fate, MoveResult), (byte, fate)
                assert far.position == 20
            left[0] = 1_000_000
            await drive.close()


async def test_a_line_that_flaps_all_the_time_costs_no_memory() -> None:
    async with lenient(DriveSettings(reconnect_slowest_s=0.5)) as (drive, far, cable):
        for turn in range(600):
            reading = asyncio.ensure_future(_awaited(drive.position()))
            await cable.pull()
            await asyncio.sleep(0.1)
            await cable.plug(far)
            await asyncio.sleep(turn / 600)
            reading.cancel()
        await until(lambda: drive.is_open)
        await drive.position()
        assert instances(Exchange, Sent) < 10
        assert await outcome(drive.position()) == 0


async def test_thousands_of_queries_that_are_given_up_while_the_line_is_lost_leave_nothing_behind() -> None:
    async with lenient() as (drive, far, cable):
        await cable.pull()
        for _ in range(5000):
            with suppress(TimeoutError):
                async with asyncio.timeout(0.001):
                    await drive.position()
        await cable.plug(far)
        await until(lambda: drive.is_open)
        await drive.position()
        assert instances(Exchange, asyncio.Future) < 50
        assert await outcome(drive.position()) == 0


# Groups, programs, restores, frames ----------------------------------------------------------------------------------


async def test_stopping_a_group_of_which_one_line_is_lost_stops_the_others_at_once() -> None:
    fars = {axis: SimulatedDrive(name=axis) for axis in "xyz"}
    cables = {axis: Cable(axis) for axis in fars}
    for axis, far in fars.items():
        await cables[axis].plug(far)
    drives = {axis: await compax_aio.connect(cable.url, name=axis) for axis, cable in cables.items()}
    group = DriveGroup(**drives)
    move = group.move_to(x=100_000, y=100_000, z=100_000)
    await move.accepted
    await cables["y"].pull()
    await asyncio.sleep(1)
    assert all(is_moving(far) for far in fars.values())
    stopping = asyncio.ensure_future(group.stop())
    await asyncio.sleep(0.5)
    assert not is_moving(fars["x"])
    assert not is_moving(fars["z"])
    error = await outcome(stopping, 12)
    assert isinstance(error, ConnectionLostError)
    assert isinstance(await outcome(move), CompaxError)
    await cables["y"].plug(fars["y"])
    await until(lambda: drives["y"].is_open)
    await drives["y"].stop()
    await group.close()
    for cable in cables.values():
        await cable.pull()


async def test_a_group_of_which_one_line_is_lost_while_it_starts_moves_all_or_stops_all() -> None:
    for milliseconds in range(0, 40, 3):
        fars = {axis: SimulatedDrive(Knobs(answer_time_s=0.003), name=axis) for axis in "xy"}
        cables = {axis: Cable(axis) for axis in fars}
        for axis, far in fars.items():
            await cables[axis].plug(far)
        drives = {axis: await compax_aio.connect(cable.url, name=axis) for axis, cable in cables.items()}
        move = DriveGroup(**drives).move_to(x=300, y=300)
        await asyncio.sleep(milliseconds / 1000)
        await outage(cables["y"], fars["y"], 0.2)
        fate = await outcome(move)
        if isinstance(fate, CompaxError):
            assert not any(is_moving(far) for far in fars.values())
        else:
            assert [far.position for far in fars.values()] == [300, 300]
        assert all(len(motions(far)) <= 1 for far in fars.values())
        for axis, drive in drives.items():
            await drive.close()
            await cables[axis].pull()


def _note(event: asyncio.Event, *_: int) -> None:
    event.set()


async def test_a_restore_that_is_cut_says_exactly_what_the_drive_has(tmp_path: Path) -> None:
    path = tmp_path / "variables.toml"
    wanted = {number: float(number) for number in range(1, 7)}
    async with lenient() as (drive, _, _):
        for number, value in wanted.items():
            await drive.variables.write(number, value)
        await drive.variables.save(path)
    for milliseconds in range(40, 130, 9):
        async with lenient(answer_time_s=0.003) as (drive, far, cable):
            begun_at = now()
            first = asyncio.Event()
            work = asyncio.ensure_future(drive.variables.restore(path, on_progress=partial(_note, first)))
            await first.wait()
            await asyncio.sleep(milliseconds / 1000 - 0.04)
            assert now() > begun_at
            await outage(cable, far, 0.3)
            result = await outcome(work)
            have = {number: await drive.variables.read(number) for number in wanted}
            if isinstance(result, RestoreIncompleteError):
                assert all(have[number] == wanted[number] for number in result.applied)
                assert all(have[number] == 0 for number in result.not_applied)
                assert {*result.applied, *result.not_applied, *result.uncertain} == {*wanted}
                assert len(result.uncertain) <= 1
            else:
                assert not isinstance(result, CompaxError), result
                assert have == wanted


@pytest.mark.parametrize("how", ["reconcile", "stop"])
async def test_a_binary_motion_that_was_cut_holds_the_line_through_reconnecting_and_ends_as_told(how: str) -> None:
    for byte in range(1, 9):
        far, left = SimulatedDrive(Knobs(p20=16), name="x"), [1_000_000]
        line = DeviceLine.of(far)
        settings = DriveSettings(binary_settings=True, binary_motion=True)
        with await listen("frayed", partial(Frayed, line, left, to_drive=True)) as listener:
            drive = await compax_aio.connect(listener.url, name="x", settings=settings)
            left[0] = byte
            move = drive.move_to(360)
            await asyncio.sleep(3)
            if byte < 8:
                assert motions(far) == []
            far.power_cycle()  # as the hint says: what the drive holds of the frame is gone
            await outcome(getattr(drive, how)())
            fate = await outcome(move)
            assert isinstance(fate, CompaxError | MoveResult)
            assert [each for each in motions(far) if each != "POSA 360.00"] == []
            await asyncio.sleep(20)
            await outcome(drive.reconcile())
            assert isinstance(await outcome(drive.move_to(5, speed_percent=50)), MoveResult)
            await drive.close()
