"""One drive: reading, plain lines, events, connecting and closing."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable

import pytest
from tests.promises.bench import (
    PROMPT,
    ScriptedDrive,
    bench,
    ending,
    lines,
    motions,
    now,
    scripted,
    served_through,
    strangers_order,
    until,
)

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    Drive,
    DriveFaultError,
    DriveSettings,
    InvalidCommandError,
    TransportError,
    UnexpectedAnswerError,
)
from compax_aio.compax.events import (
    ComparatorPassed,
    ConnectionLost,
    DriveEvent,
    EventStream,
    Fault,
    MoveAccepted,
    MoveEnded,
    PositionMessage,
    UnexpectedText,
)
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.transports.loopback import listen

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


# Reading ------------------------------------------------------------------------------------------------------------


async def test_every_reading_is_what_the_drive_says() -> None:
    async with bench(position=12.5, following_error_factor=0.01) as (drive, _):
        assert await drive.position() == 12.5
        assert await drive.target() == 12.5
        assert await drive.following_error() == 0
        assert await drive.speed() == 0
        assert await drive.torque() == 0
        status = await drive.status()
        assert status.no_fault
        assert status.running
        assert not status.command_active
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        assert await drive.target() == 1000
        assert await drive.speed() == 100
        assert await drive.torque() == 5
        assert await drive.following_error() == 2
        assert (await drive.status()).command_active
        await move.stop()
        await ending(move)


async def test_a_status_value_says_what_it_is() -> None:
    async with bench(unit="degree", settings=DriveSettings(unit="degree")) as (drive, _):
        position = await drive.read_status(1)
        assert (position.value, position.unit, position.raw) == (0, "degree", "0.00")
        assert (await drive.read_status(7)).value == 24
        assert (await drive.read_status(16)).value == "11010000"
        assert (await drive.read_status(18)).value == (0,) * 8
        with pytest.raises(CommandRejectedError):
            await drive.read_status(200)


@pytest.mark.parametrize("number", [0, -1, 251, True, 1.0, "1", None])
async def test_a_status_that_cannot_be_is_not_asked(number: object) -> None:
    async with bench() as (drive, _):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError):
            await drive.read_status(number)  # type: ignore[arg-type]
        assert drive.stats.bytes_sent == before


async def test_errors_present_and_past_are_read_by_name() -> None:
    async with bench() as (drive, far):
        assert await drive.error() is None
        far.raise_fault(55)
        error = await drive.error()
        assert error is not None
        assert error.code == 55
        await drive.quit()
        assert await drive.error() is None
        history = await drive.error_history()
        assert [(entry.error.code, entry.ended_by) for entry in history] == [(55, "acknowledged")]
        assert far.log.texts(LogKind.QUIT) == [""]


async def test_values_that_cannot_be_read_as_such_are_not_guessed() -> None:
    async with scripted({"S1": "S001: ----", "S2": "", "S3": "E90"}) as (drive, far):
        far.answers["S17"] = "S017: 0010"
        assert isinstance(await ending(drive.position()), UnexpectedAnswerError)
        assert isinstance(await ending(drive.status()), UnexpectedAnswerError)
        # A bare prompt answers no question: it may be anybody's.
        error = await ending(drive.target())
        assert isinstance(error, AnswerTimeoutError)
        assert error.device == "x"
        error = await ending(drive.following_error())
        assert isinstance(error, CommandRejectedError)
        assert (error.code, error.sent, error.received) == (90, "S3", "E90")


async def test_identical_reads_that_wait_together_share_one_exchange() -> None:
    async with bench(position=3) as (drive, far):
        assert await asyncio.gather(*(drive.position() for _ in range(50))) == [3.0] * 50
        assert lines(far).count("S1") <= 2


async def test_a_read_that_is_not_answered_ends_in_time_and_the_next_gets_its_own_answer() -> None:
    async with bench(position=3) as (drive, far):
        far.deaf = True
        error = await ending(drive.position())
        assert isinstance(error, AnswerTimeoutError)
        assert now() < 1.1
        assert error.sent == "S1"
        assert error.exchanges[-1].endswith("→ S1␍")
        far.deaf = False
        assert list(await asyncio.gather(drive.position(), drive.speed(), drive.target())) == [3, 0, 3]
        far.silent = True
        assert isinstance(await ending(drive.position()), AnswerTimeoutError)
        begun_at = now()
        assert isinstance(await ending(drive.speed()), AnswerTimeoutError)
        assert now() - begun_at < 5


async def test_a_late_answer_is_never_that_of_the_next_question() -> None:
    async with bench(position=3) as (drive, far):
        far.extra_answer_delay_s = 1.5
        first = await ending(drive.position())
        assert isinstance(first, AnswerTimeoutError)
        far.extra_answer_delay_s = 0
        assert await drive.torque() == 0
        assert drive.stats.late_answers <= 1
        assert (await drive.read_status(6)).value == 35


# Plain lines --------------------------------------------------------------------------------------------------------


async def test_a_plain_line_is_answered_with_what_the_drive_says() -> None:
    async with bench(position=120.5) as (drive, far):
        assert await drive.command("S1") == "S001: 120.50"
        assert await drive.command(" SD 50 ") == ""
        assert await drive.query("S1") == "S001: 120.50"
        assert await drive.query("P2") == "P002: 100.000"
        assert lines(far)[-4:] == ["S1", "SD 50", "S1", "P2"]
        assert isinstance(await ending(drive.command("NONSENSE")), CommandRejectedError)
        assert isinstance(await ending(drive.query("NONSENSE")), CommandRejectedError)
        assert isinstance(await ending(drive.query("SD 50")), UnexpectedAnswerError)


async def test_an_answer_of_no_known_form_is_given_as_it_came() -> None:
    async with scripted({"WHO": "COMPAX 1000SL"}) as (drive, _):
        assert await drive.query("WHO") == "COMPAX 1000SL"
        assert isinstance(await ending(drive.command("WHO")), UnexpectedAnswerError)
        assert await drive.position() == 0


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "PA 5$", "PA5\r", "PA5\nPA6", "PA5\r\nPA6", "S1?", "!", "PA5,", ">", "x" * 31, "PA 5 µ", "S1\x00",
        "\tS1", "PA5\x7f", "PA5\x11",
    ],
)  # fmt: skip
async def test_what_is_not_one_plain_line_is_not_sent(text: str) -> None:
    async with bench() as (drive, far):
        before = drive.stats.bytes_sent
        for say in (drive.command, drive.query):
            with pytest.raises(InvalidCommandError):
                await say(text)
        await asyncio.sleep(0.1)
        assert drive.stats.bytes_sent == before
        assert motions(far) == []


async def test_a_line_of_thirty_characters_is_sent() -> None:
    async with bench() as (drive, far):
        await drive.command("POSA".ljust(29) + "5")
        await until(lambda: far.position == 5)


# Events -------------------------------------------------------------------------------------------------------------


async def collect(stream: EventStream) -> list[DriveEvent]:
    return [event async for event in stream]


async def test_what_happens_is_told_to_all_who_follow_until_the_drive_is_closed() -> None:
    async with bench("press") as (drive, far):
        followers = [asyncio.ensure_future(collect(drive.events())) for _ in range(3)]
        await asyncio.sleep(0)
        await drive.move_to(100, comparators=[(50, 1)])
        far.inject(b"hello" + PROMPT)
        await asyncio.sleep(0.1)
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.raise_fault(20)
        assert isinstance(await ending(move), DriveFaultError)
        assert not any(follower.done() for follower in followers)
    first, *others = [await follower for follower in followers]
    assert all(other == first for other in others)
    assert [type(event) for event in first] == [
        MoveAccepted, ComparatorPassed, PositionMessage, MoveEnded, UnexpectedText, MoveAccepted, Fault, MoveEnded
    ]  # fmt: skip
    assert all(event.drive == "press" and 0 < event.at <= now() for event in first)
    _, comparator, _, _, text, _, fault, _ = first
    assert isinstance(comparator, ComparatorPassed)
    assert comparator.number == 1
    assert isinstance(text, UnexpectedText)
    assert text.text == "hello"
    assert isinstance(fault, Fault)
    assert fault.error is not None
    assert fault.error.code == 20
    assert await collect(drive.events()) == []


async def test_a_fault_is_told_once_and_again_after_it_was_acknowledged() -> None:
    async with bench() as (drive, far):
        following = asyncio.ensure_future(collect(drive.events()))
        await asyncio.sleep(0)
        for _ in range(2):
            far.raise_fault(20)
            for _ in range(3):
                await drive.status()
            await drive.quit()
            await drive.status()
    assert [type(event) for event in await following] == [Fault, Fault]


async def test_a_lost_line_is_told_and_ends_the_events_when_the_drive_is_closed() -> None:
    far = SimulatedDrive()
    async with served_through(far, "bad", bytes) as url:
        drive = await compax_aio.connect(url, name="x")
        following = asyncio.ensure_future(collect(drive.events()))
        await asyncio.sleep(0.1)
    await asyncio.sleep(0.1)
    assert not drive.is_open
    assert isinstance(await ending(drive.position()), ConnectionLostError)
    await drive.close()
    (event,) = await following
    assert isinstance(event, ConnectionLost)
    assert "lost" in event.reason


async def test_a_line_that_is_closed_here_is_no_lost_one() -> None:
    async with bench() as (drive, _):
        following = asyncio.ensure_future(collect(drive.events()))
        await asyncio.sleep(0)
    assert await following == []


async def test_a_slow_follower_loses_the_oldest_events_and_no_memory() -> None:
    async with bench() as (drive, far):
        slow = drive.events()
        for number in range(1500):
            far.inject(f"noise {number}".encode() + PROMPT)
            await asyncio.sleep(0.01)
        assert slow.lost == 500
        event = await anext(slow)
        assert isinstance(event, UnexpectedText)
        assert event.text == "noise 500"
        assert await drive.position() == 0


async def test_a_follower_that_is_gone_is_forgotten() -> None:
    async with bench() as (drive, _):
        for _ in range(10):
            drive.events()
        gc.collect()
        streams = drive._events._streams
        assert streams is not None
        assert len(streams) == 0


async def test_an_order_of_somebody_else_shows_as_unexpected_text() -> None:
    async with bench() as (drive, far):
        events = drive.events()
        strangers_order(far, "S6")
        event = await anext(events)
        assert isinstance(event, UnexpectedText)
        assert event.text == "S006: 35.00"
        assert drive.stats.strays == 1
        assert await drive.torque() == 0


# Connecting and closing ---------------------------------------------------------------------------------------------


async def test_nothing_that_could_move_is_sent_before_it_is_known_who_is_on_the_line() -> None:
    async with bench() as (drive, far):
        assert lines(far)[0] == "S17"
        assert {line for line in lines(far) if line[0] != "S"} == {"P20"}
        await drive.move_to(5)
        before = len(lines(far))
    async with bench() as (drive, far):
        assert {line for line in lines(far)[before:] if line[0] != "S"} == {"P20"}
        assert len(lines(far)) > before


async def test_a_drive_can_be_awaited_and_closed_by_hand() -> None:
    drive = await compax_aio.connect("sim://compax?position=4")
    assert isinstance(drive, Drive)
    assert drive.name == "sim://compax"
    assert repr(drive) == "<Drive sim://compax open>"
    assert await drive.position() == 4
    await drive.close()
    await drive.close()
    assert not drive.is_open
    assert repr(drive) == "<Drive sim://compax closed>"
    async with drive:
        pass


async def test_a_drive_that_is_closed_answers_nobody() -> None:
    async with bench() as (drive, far):
        pass
    before = len(lines(far))
    calls: list[Callable[[], Awaitable[object]]] = [
        drive.position,
        lambda: drive.command("PA5"),
        drive.quit,
        lambda: drive.move_to(5),
        drive.stop,
    ]
    for call in calls:
        error = await ending(call())
        assert isinstance(error, ConnectionLostError)
        assert error.device == "x"
    assert len(lines(far)) == before


async def test_closing_ends_what_still_waits() -> None:
    async with bench() as (drive, far):
        far.deaf = True
        waiting = [asyncio.ensure_future(drive.read_status(number)) for number in range(1, 6)]
        await asyncio.sleep(0.1)
        closed_at = now()
    assert now() - closed_at < 1
    for read in waiting:
        assert isinstance(await ending(read), ConnectionLostError)


async def test_closing_twice_at_once_is_harmless() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        await asyncio.gather(drive.close(), drive.close(), drive.close())
        assert not far.moving
        assert lines(far).count("STOP") == 1
        await ending(move)


async def test_a_drive_that_does_not_answer_is_told_as_such_in_time() -> None:
    far = SimulatedDrive()
    far.deaf = True
    async with served_through(far, "bad", bytes) as url:
        error = await ending(_connected(url))
        assert isinstance(error, AnswerTimeoutError)
        assert "check power, cable" in str(error)
        assert error.device == "x"
        assert 3 <= now() < 4.1
        # The line is free again.
        far.deaf = False
        async with compax_aio.connect(url) as drive:
            assert await drive.position() == 0


async def _connected(url: str, settings: DriveSettings | None = None) -> Drive:
    return await compax_aio.connect(url, name="x", settings=settings)


@pytest.mark.parametrize(
    "babble", [b"login: ", b"\xff\x00\xfe" * 50, b"! 1234\r", b"$GPGGA,1\r\n", PROMPT, b"E90\r\n>"]
)
async def test_a_device_that_babbles_is_no_drive(babble: bytes) -> None:
    class Babbler(ScriptedDrive):
        def data_received(self, data: bytes) -> None:
            self.lines.append(data.decode())
            self.transport.write(babble)

    far = Babbler()
    with await listen("babbler", lambda: far) as listener:
        error = await ending(_connected(listener.url))
        # Some devices are recognised at once; the others are waited for in vain.
        assert isinstance(error, AnswerTimeoutError | UnexpectedAnswerError)
        assert isinstance(error, UnexpectedAnswerError) == (babble in {b"login: ", b"! 1234\r"})
        assert error.hint
        assert error.received
        assert now() < 5
        assert all(line[0] == "S" for line in far.lines)


async def test_a_device_that_never_stops_babbling_is_no_drive() -> None:
    far = ScriptedDrive({f"S{number}": None for number in range(1, 31)})
    with await listen("babbler", lambda: far) as listener:
        connecting = asyncio.ensure_future(_connected(listener.url))
        while not connecting.done():
            await asyncio.sleep(0.01)
            if hasattr(far, "transport"):
                far.transport.write(b"12345678\r\n>")
        assert isinstance(await ending(connecting), AnswerTimeoutError)
        assert now() < 6


async def test_a_line_that_is_lost_while_connecting_is_told() -> None:
    class HangingUp(ScriptedDrive):
        def data_received(self, data: bytes) -> None:
            self.transport.abort()

    with await listen("gone", HangingUp) as listener:
        assert isinstance(await ending(_connected(listener.url)), ConnectionLostError)


@pytest.mark.parametrize("url", ["loop://nobody", "nonsense://x", "sim://haas2", "no url", "tcp://127.0.0.1"])
async def test_a_line_that_cannot_be_opened_is_told(url: str) -> None:
    error = await ending(_connected(url))
    assert isinstance(error, TransportError)
    assert not isinstance(error, ConnectionLostError)


async def test_two_clients_do_not_share_one_line() -> None:
    async with bench():
        with pytest.raises(TransportError, match="somebody else"):
            async with bench():
                pass


async def test_a_drive_that_wakes_up_while_it_is_being_connected_is_connected() -> None:
    far = SimulatedDrive(Knobs(power_on_text="banner"))
    far.power_off()
    async with served_through(far, "bad", bytes) as url:
        connecting = asyncio.ensure_future(_connected(url))
        await asyncio.sleep(1.5)
        far.power_on()
        drive = await connecting
        assert await drive.position() == 0
        await drive.close()


@pytest.mark.parametrize(
    "settings",
    [
        {"answer_timeout_s": 0}, {"answer_timeout_s": float("nan")}, {"stop_timeout_s": float("inf")},
        {"decimals": 4}, {"speed_limit_percent": 0}, {"speed_limit_percent": 601}, {"resync_attempts": 0},
    ],
)  # fmt: skip
def test_settings_that_cannot_be_meant_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(InvalidCommandError):
        DriveSettings(**settings)  # type: ignore[arg-type]
