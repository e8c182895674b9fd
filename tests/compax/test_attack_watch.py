"""Watching and recognising under attack: watchers in any number and state, drives that say anything at all."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager, suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.compax.test_cancellation import Stepper, together_with_the_answer, twice, while_waiting
from tests.fakes.answers import PROMPT, as_drive
from tests.fakes.scripted import Script, ScriptedFarEnd
from tests.link.lines import Line, elapsed, unique_name
from tests.promises.bench import bench, ending, now, scripted

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    Drive,
    DriveGroup,
    DriveSettings,
    UnexpectedAnswerError,
)
from compax_aio.compax.events import Fault
from compax_aio.compax.watch import Watch
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp
from compax_aio.transports.loopback import listen


def run(work: Coroutine[Any, Any, Any]) -> Any:
    """Run *work* in a loop of its own."""
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        return runner.run(work)


def polling() -> list[asyncio.Task[Any]]:
    return [task for task in asyncio.all_tasks() if task.get_name().endswith(": watch")]


# Watchers in any number and state -------------------------------------------------------------------------------------


@pytest.mark.usefixtures("nothing_left_behind")
async def test_those_who_have_left_are_not_kept_although_somebody_holds_them() -> None:
    async with bench() as (drive, _):
        held = [drive.watch("position") for _ in range(3000)]
        stays = drive.watch("position")
        for watch in held:
            watch.close()
            watch.close()
        assert len(drive._poller._watches) == 1, "each that leaves would be looked through by the next"
        assert (await anext(stays))["position"] == 0
        for watch in held:
            assert [reading async for reading in watch] == []
        stays.close()
        assert not drive._poller._watches


@pytest.mark.usefixtures("nothing_left_behind")
async def test_watchers_that_are_dropped_by_the_thousand_leave_nothing() -> None:
    async with bench() as (drive, far):
        for _ in range(20):
            some = [drive.watch("position", "S5", interval_s=0.01) for _ in range(100)]
            for watch in some[::3]:
                await anext(watch)
            del some, watch
            gc.collect(0)
            await asyncio.sleep(0.05)
            assert not drive._poller._watches
            assert not polling()
        before = len(far.log)
        await asyncio.sleep(10)
        assert len(far.log) == before, "nobody is asked any more"


@pytest.mark.usefixtures("nothing_left_behind")
async def test_watchers_of_every_kind_end_whenever_the_drive_is_closed_or_lost() -> None:
    for milliseconds in range(0, 40, 3):
        for lose in (False, True):
            async with bench(f"{milliseconds}{lose}", settings=DriveSettings(reconnect=False)) as (drive, far):
                watches = [
                    drive.watch("position"),
                    drive.watch("status", "error", interval_s=0.001),
                    drive.watch("S40", interval_s=5),
                    drive.watch("P1", "V1", interval_s=0.02),
                ]
                ends = asyncio.gather(*map(to_its_end, watches), return_exceptions=True)
                closed = drive.watch("speed")
                closed.close()
                await asyncio.sleep(milliseconds / 1000)
                if lose:
                    far.power_off()
                    drive._line.link._port.hang_up()
                    await asyncio.sleep(0.01)
                else:
                    await drive.close()
                async with asyncio.timeout(5):
                    outcomes = await ends
                assert all(isinstance(each, ConnectionLostError if lose else int) for each in outcomes), outcomes
                assert [reading async for reading in closed] == []
                late = await asyncio.gather(to_its_end(drive.watch("position")), return_exceptions=True)
                assert isinstance(late[0], ConnectionLostError if lose else int)
                if lose:
                    far.power_on()


async def to_its_end(watch: Watch) -> int:
    return len([reading async for reading in watch])


@pytest.mark.parametrize("cancel", [while_waiting, together_with_the_answer, twice])
def test_a_consumer_cancelled_at_any_await_leaves_the_line_in_step_and_nobody_polling(cancel: Any) -> None:
    async def consume(drive: Drive, group: DriveGroup) -> None:
        with drive.watch("position", "S40", interval_s=0.01) as watch:
            for _ in range(5):
                await anext(watch)
        count = 0
        async for _ in group.watch("status", "error", interval_s=0.01):
            count += 1
            if count == 5:
                break

    async def attack(at: int | None) -> int:
        async with bench("x") as (x, _), bench("y") as (y, _):
            stepper = Stepper(at, cancel)
            task = asyncio.ensure_future(stepper.run(consume(x, DriveGroup(x=x, y=y))))
            await asyncio.wait([task])
            assert task.cancelled() == (at is not None)
            del task
            gc.collect(0)
            await asyncio.sleep(0.05)
            assert not polling()
            assert (await x.position(), await y.position()) == (0, 0)
            assert x.stats.timeouts == y.stats.timeouts == 0
            return stepper.awaits

    for at in range(1, run(attack(None)) + 1):
        run(attack(at))


async def test_a_watch_outside_of_its_loop_is_refused_without_a_complaint() -> None:
    async with bench() as (drive, _):
        with pytest.raises(RuntimeError, match="no running event loop"):
            await asyncio.to_thread(drive.watch, "position")
        gc.collect()
        assert not drive._poller._watches


# Trouble with one quantity, or one axis -------------------------------------------------------------------------------


@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_quantity_that_is_never_answered_costs_the_others_time_and_no_value() -> None:
    answers: dict[str, str | None] = {f"S{number}": f"S{number:03d}: 7.00" for number in range(1, 13)}
    async with scripted({**answers, "S40": None}) as (drive, _):
        with drive.watch("S40", "position", interval_s=0.1) as watch, drive.watch("position", interval_s=0.1) as other:
            for _ in range(5):
                reading = await anext(watch)
                assert reading["position"] == 7
                assert isinstance(reading.errors["S40"], AnswerTimeoutError)
                assert (await anext(other))["position"] == 7
        assert await drive.position() == 7


@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_fault_while_a_group_is_watched_is_in_the_readings_and_an_event_once() -> None:
    async with bench("x") as (x, far), bench("y") as (y, _):
        events = x.events()
        faults = []

        async def listen_to() -> None:
            async for event in events:
                faults.extend([event] if isinstance(event, Fault) else [])

        listener = asyncio.create_task(listen_to())
        seen = 0
        async for reading in DriveGroup(x=x, y=y).watch("status", "error", "position", interval_s=0.05):
            seen += 1
            if seen == 3:
                far.raise_fault(55)
            if seen == 10:
                assert not reading["x"]["status"].no_fault
                assert reading["x"]["error"].code == 55
                assert reading["y"]["status"].no_fault
                break
        listener.cancel()
        await asyncio.wait([listener])
        assert [event.error.code for event in faults if event.error] == [55]


@pytest.mark.usefixtures("nothing_left_behind")
async def test_one_slow_axis_of_a_group_delays_no_other_and_no_old_value_is_told_as_new() -> None:
    far = ScriptedFarEnd(delay_s=0.7)
    with await listen("slow", lambda: far) as listener:
        async with bench("x") as (x, _), compax_aio.connect(listener.url, name="slow") as slow:
            ages = []
            with DriveGroup(x=x, slow=slow).watch("position", interval_s=0.1) as watch:
                for _ in range(30):
                    reading = await anext(watch)
                    assert now() - reading["x"].at <= 0.2
                    if "slow" in reading:
                        ages.append(now() - reading["slow"].at)
            assert max(ages) > 0.3, "and its age tells"
            assert len(far.lines) < 20, "nor is it asked more often than it answers"


@given(st.lists(st.text(st.characters(max_codepoint=255, exclude_characters="\r\n>"), max_size=300), max_size=6))
@settings(max_examples=40)
def test_whatever_a_drive_answers_a_watcher_gets_values_or_errors_and_goes_on(answers: list[str]) -> None:
    async def watch_it() -> None:
        async with scripted() as (drive, far):
            with drive.watch("position", "status", "error", "error_history", "S40", "P20", interval_s=0.1) as watch:
                for answer in answers:
                    for query in ("S1", "S16", "S30", "S18", "S40", "P20"):
                        head = f"{query[0]}{int(query[1:]):03d}: "
                        far.answers[query] = (head if len(answer) % 2 else "") + answer
                    reading = await anext(watch)
                    assert all(isinstance(error, CompaxError) for error in reading.errors.values())
                far.answers |= {"S1": "S001: 3.25", "S16": "S016: 11010000", "S30": "S030: 0 0"}
                far.answers |= {"S18": "S018: 0", "S40": "S040: 1", "P20": "P020: 0"}
                async with asyncio.timeout(100):
                    while (reading := await anext(watch)).errors:
                        pass
                assert reading["position"] == 3.25

    run(watch_it())


# Who is at the far end ------------------------------------------------------------------------------------------------


async def opened(script: Script, *, greeting: bytes = b"", delay_s: float = 0.0) -> BaseException | None:
    """Open a line to a far end that greets, and then answers as *script* says; return why it was not accepted."""
    name = unique_name()
    far = ScriptedFarEnd(script, delay_s=delay_s)
    line = Line(far)
    with await listen(name, lambda: far):
        loop = asyncio.get_running_loop()
        loop.call_later(0.0005, lambda: far.transport.write(greeting))
        error, _ = await elapsed(line.link.open(f"loop://{name}"))
        if error is None:
            far.script = as_drive
            for _ in range(3):
                with suppress(AnswerTimeoutError):  # what came just before may have spoilt one
                    await line.answer("S9")
            assert await line.answer("S1") == "S001: 1"
        await line.link.close()
    return error


SAID_BY_A_COMPAX = st.sampled_from(
    [
        *(PROMPT, b"\n>", b">", b"\r\n", b"\n", b"E90\r\n>", b"E92 command active\r\n>", b"$\r\n>", b"3\r\n>"),
        *(b"S017: 00000010\r\n>", b"S18\rS018: 99 55 10 99 53 98 10 99\r\n>", b"N005: GOTO 13\r\n>", b"P1=5\r\n>"),
        *(b"COMPAX 1000SL V6.26\r\n>", b"COMPAX OK\r\n", b"login: \r\n>", b"Password:\r\n", b"self-test OK\r\n"),
        *(b"\x11", b"\x13", b"\0\0", b"\xff\xfe\x80", b"\xf8" * 40, b"PA100", b"S17\r", b"S16\rS30\r", b"?", b"!"),
        *(b"READY! 1234\r\n", b"12 34\r\n>", b"N001: END\r\n>" * 30, b"V" * 300),
    ]
)


@given(
    greeting=st.lists(SAID_BY_A_COMPAX, max_size=5).map(b"".join),
    first=st.lists(SAID_BY_A_COMPAX, max_size=4).map(b"".join) | st.none(),
    bad=st.integers(0, 2),
    echo=st.booleans(),
    delay_s=st.sampled_from([0.0, 0.01, 0.9]),
)
@settings(max_examples=250)
def test_who_answers_one_of_our_queries_properly_is_accepted_whatever_it_said_before(
    greeting: bytes, first: bytes | None, bad: int, echo: bool, delay_s: float
) -> None:
    count = 0

    def script(text: str) -> bytes | None:
        nonlocal count
        count += 1
        if count <= bad and first is not None:
            return first
        return (text.encode() + b"\r" if echo else b"") + as_drive(text)

    error = run(opened(script, greeting=greeting + b"\r\n>" * (b"PA" in greeting), delay_s=delay_s))
    assert not isinstance(error, UnexpectedAnswerError), "no stranger"
    if bad <= 1 and delay_s < 0.5:
        assert error is None


@given(
    answers=st.lists(
        st.sampled_from([b"> \r", b">\r", b"!0005\r", b"! 00aF\r", b"! 1234 \r", b">\r\n", b"! 0007\r\n"]), min_size=3
    ),
    echo=st.booleans(),
    delay_s=st.sampled_from([0.0, 0.01, 0.5]),
    greeting=st.sampled_from([b"", b"\r", b"\xff", b"Compax3\r", b"\0"]),
)
@settings(max_examples=60)
def test_a_compax3_is_never_accepted(answers: list[bytes], echo: bool, delay_s: float, greeting: bytes) -> None:
    each = iter(answers * 9)
    error = run(
        opened(lambda text: (text.encode() + b"\r" if echo else b"") + next(each), greeting=greeting, delay_s=delay_s)
    )
    assert isinstance(error, UnexpectedAnswerError | AnswerTimeoutError)
    if not any(answer.endswith(b"\n") for answer in answers) and greeting != b"\xff":
        assert "Compax3" in str(error)


SAMPLES = 16
"""Per bit at 9600 baud."""


def through_a_wrong_rate(data: bytes, sender: int, receiver: int) -> bytes:
    """Say what a UART makes of *data* that came at another rate; a frame without a stop bit is told all the same."""
    bit = SAMPLES * 9600 // sender
    wave = [1] * SAMPLES
    for byte in data:
        for level in (0, *(byte >> place & 1 for place in range(8)), 1):
            wave += [level] * bit
    wave += [1] * SAMPLES * 40
    bit, at, received = SAMPLES * 9600 // receiver, 1, bytearray()
    while at < len(wave) - 10 * bit:
        if wave[at - 1] and not wave[at]:
            received.append(sum(wave[at + bit * place + bit * 3 // 2] << place for place in range(8)))
            at += 9 * bit + bit // 2
        at += 1
    return bytes(received)


def test_a_uart_at_the_right_rate_reads_what_was_sent() -> None:
    assert through_a_wrong_rate(b"S017: 0\r\n>", 9600, 9600) == b"S017: 0\r\n>"
    assert through_a_wrong_rate(b"S017: 0\r\n>", 4800, 9600) != b"S017: 0\r\n>"


@pytest.mark.parametrize(("drive", "host"), [(4800, 9600), (9600, 4800)])
async def test_a_drive_at_another_rate_is_silence_and_no_stranger(drive: int, host: int) -> None:
    said = [b"\r\n>", b"E90\r\n>", b"E90 syntax error\r\n>", b"S017: 00000010\r\n>", b"$\r\n>", b"1\r\n>"]
    for answer in [*said, b"\r\n>" * 5, *(bytes([byte]) + b"\r\n>" for byte in range(32, 127))]:
        garbled = through_a_wrong_rate(answer, drive, host)
        for echo in (False, True):
            error = await opened(
                lambda text, garbled=garbled, echo=echo: (  # type: ignore[misc]
                    (through_a_wrong_rate(text.encode() + b"\r", drive, host) if echo else b"") + garbled
                )
            )
            assert isinstance(error, AnswerTimeoutError), (answer, garbled)


# Over real lines ------------------------------------------------------------------------------------------------------


@pytest.mark.real_time
@pytest.mark.parametrize("serve", [serve_tcp, serve_pty])
async def test_a_drive_is_watched_over_a_real_line_while_it_moves(
    serve: Callable[[SimulatedDrive], AbstractAsyncContextManager[str]],
) -> None:
    far = SimulatedDrive()
    async with asyncio.timeout(10), serve(far) as url, compax_aio.connect(url, name="x") as drive:
        move = drive.move_to(1000)
        seen = []
        with drive.watch("position", "status", interval_s=0.02) as watch:
            for _ in range(15):
                reading = await anext(watch)
                assert not reading.errors
                seen.append(reading["position"])
        assert seen == sorted(seen)
        assert seen[-1] > seen[0]
        await move.stop()
        assert isinstance(await ending(move), compax_aio.MoveStoppedError)
        assert drive.stats.timeouts == 0
