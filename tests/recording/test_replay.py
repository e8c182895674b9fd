"""``replay://``: a recorded conversation plays the drive's side; so a field problem is a test case."""

# ruff: noqa: ASYNC240 - files of tests are small, and nothing else runs meanwhile
from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.conformance.transport import Witness
from tests.fakes.answers import as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.recording.traces import facts, lines_of, record_move, rewritten, write

import compax_aio
from compax_aio import DriveSettings, smc
from compax_aio.errors import (
    CompaxError,
    ConnectionLostError,
    TransportError,
    UnexpectedAnswerError,
)
from compax_aio.link.contract import Lane
from compax_aio.link.taps import (
    Asked,
    Ended,
    LetGo,
    Lost,
    Noticed,
    Opened,
    Opening,
    Received,
    Refused,
    Sent,
    Way,
)
from compax_aio.recording import record_trace, replay_script
from compax_aio.recording.trace_entries import LineMade, Missing
from compax_aio.simulator.server import drive_named
from compax_aio.transports import open_transport
from compax_aio.transports.loopback import listen

Program = Callable[[str], Awaitable[Any]]

ONCE = DriveSettings(answer_timeout_s=0.5, reconnect=False)
"""A trace is played to a client that talks in the same way as the one that was recorded."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "trace.jsonl"


def replayed(path: Path, **options: object) -> str:
    query = "&".join(f"{name}={value}" for name, value in options.items())
    return f"replay://{path}{'?' if query else ''}{query}"


async def home_and_move(url: str) -> tuple[Any, ...]:
    """Tell what a program is told, without the times."""
    events = []
    async with compax_aio.connect(url, name="x") as drive:
        await drive.home()
        move = drive.move_to(12.5, speed_percent=50)
        positions = [position async for position in move.positions()]
        result = await move
        await drive.stop()
        events = [result.target, result.confirmed_by, result.last_position, positions]
        return (*events, await drive.position(), await drive.status())


async def move_steppers(url: str) -> tuple[Any, ...]:
    async with smc.connect(url, axes="AB", name="x") as line:
        a, b = line.axis("A"), line.axis("B")
        results = await asyncio.gather(a.move_to(500), b.move_to(-200))
        await line.abort_all()
        return (*((each.target, each.confirmed_by, each.last_position) for each in results), await a.position())


both_devices = pytest.mark.parametrize(
    ("program", "url"), [(home_and_move, "sim://compax"), (move_steppers, "sim://smc?axes=AB")], ids=["compax", "smc"]
)


# There and back -------------------------------------------------------------------------------------------------------


@both_devices
async def test_a_program_is_told_the_same_by_the_strict_replay_of_its_trace(
    path: Path, program: Program, url: str
) -> None:
    async with record_trace(path):
        told = await program(url)
    begun_at = asyncio.get_running_loop().time()
    assert await program(replayed(path, mode="strict")) == told
    lasted_s = asyncio.get_running_loop().time() - begun_at
    assert lasted_s == pytest.approx(lines_of(path)[-1]["at"], abs=0.001), "in its own time"


async def move_only(url: str) -> tuple[Any, ...]:
    """Ask one thing after the other: what is said next does not depend on timers of the program."""
    async with compax_aio.connect(url, name="x") as drive:
        result = await drive.move_to(12.5)
        return result.target, result.confirmed_by, await drive.position()


async def move_one_stepper(url: str) -> tuple[Any, ...]:
    async with smc.connect(url, axes="A", name="x") as line:
        result = await line.axis("A").move_to(500)
        return result.target, result.confirmed_by, await line.axis("A").position()


@pytest.mark.parametrize("speed", ["0", "inf", "20"])
@pytest.mark.parametrize(
    ("program", "url"), [(move_only, "sim://compax"), (move_one_stepper, "sim://smc?axes=A")], ids=["compax", "smc"]
)
async def test_a_strict_replay_may_be_faster(path: Path, program: Program, url: str, speed: str) -> None:
    async with record_trace(path):
        told = await program(url)
    begun_at = asyncio.get_running_loop().time()
    assert await program(replayed(path, speed=speed)) == told
    assert asyncio.get_running_loop().time() - begun_at < lines_of(path)[-1]["at"]


@both_devices
async def test_a_lenient_replay_tells_the_same_as_well(path: Path, program: Program, url: str) -> None:
    async with record_trace(path):
        told = await program(url)
    assert await program(replayed(path, mode="lenient")) == told


async def test_a_replay_can_be_recorded_and_is_the_same_conversation(path: Path, tmp_path: Path) -> None:
    await record_move(path)
    again = tmp_path / "again.jsonl"
    await record_move(again, replayed(path))
    before, after = ([fact for fact in facts(each) if isinstance(fact, Sent | Received)] for each in (path, again))
    assert before == after


# Strict: deviations ---------------------------------------------------------------------------------------------------


async def deviation(
    path: Path, program: Callable[[compax_aio.Drive], Awaitable[Any]], **options: object
) -> CompaxError:
    with pytest.raises(CompaxError) as caught:
        async with compax_aio.connect(replayed(path, **options), name="x", settings=ONCE) as drive:
            await program(drive)
    return caught.value


async def test_something_else_ends_the_line_and_the_error_names_the_place(
    path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    await record_move(path, settings=ONCE)
    place = next(at for at, entry in enumerate(lines_of(path), 1) if entry.get("data") == "PA12.5$\r")
    error = await deviation(path, lambda drive: drive.query("S44"))
    assert isinstance(error, ConnectionLostError)
    assert f"trace.jsonl, line {place}: 'PA12.5$␍' was sent then, and now 'S44␍'" in str(error)
    error = await deviation(path, lambda drive: drive.move_to(13))
    assert f"line {place}: 'PA12.5$␍' was sent then, and now 'PA13$␍'" in caplog.text
    assert [record.levelno for record in caplog.records if "replay" in record.name] == [logging.ERROR] * 2


async def test_more_than_was_said_is_a_deviation_too(path: Path) -> None:
    async def no_more(drive: compax_aio.Drive) -> None:
        await drive.query("S4")

    await record_move(path, program=no_more, settings=ONCE)

    async def once_more(drive: compax_aio.Drive) -> None:
        await drive.query("S4")
        await drive.query("S4")

    error = await deviation(path, once_more)
    assert "nothing more was sent then, and now 'S4␍'" in str(error)


async def test_a_line_that_has_deviated_is_not_opened_again(path: Path) -> None:
    await record_move(path)
    async with compax_aio.connect(replayed(path), name="x") as drive:
        with pytest.raises(UnexpectedAnswerError, match=r"deviates from .* line"):
            await drive.query("S44")
        with pytest.raises(CompaxError, match=r"deviates|lost"):
            await drive.query("S1")


async def test_what_is_written_in_other_pieces_is_no_deviation(path: Path) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade()),
            (0.0, "x", Opening("any")),
            (0.0, "x", Opened()),
            (0.1, "x", Sent(b"AB")),
            (0.2, "x", Sent(b"CD")),
            (0.5, "x", Received(b"yes")),
        ],
    )
    witness = Witness()
    transport = await open_transport(replayed(path), lambda: witness)
    for piece in (b"A", b"BC", b"D"):
        transport.write(piece)
        await asyncio.sleep(0.01)
    begun_at = asyncio.get_running_loop().time()
    assert await witness.receives(3) == b"yes"
    assert asyncio.get_running_loop().time() - begun_at == pytest.approx(0.29, abs=0.011)
    transport.abort()
    await witness.is_lost()


async def test_what_is_written_too_early_waits_for_what_came_before(path: Path) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade()),
            (0.0, "x", Opening("any")),
            (0.0, "x", Opened()),
            (1.0, "x", Received(b"$")),
            (1.5, "x", Sent(b"S1\r")),
            (1.6, "x", Received(b"5")),
        ],
    )
    witness = Witness()
    transport = await open_transport(replayed(path), lambda: witness)
    transport.write(b"S1\r")
    assert await witness.receives(2) == b"$5"
    assert asyncio.get_running_loop().time() == pytest.approx(1.0, abs=0.11)
    transport.abort()
    await witness.is_lost()


# Lost and opened again ------------------------------------------------------------------------------------------------


async def lose_line(url: str, *, plug: Callable[[], None] | None = None) -> Any:
    settings = DriveSettings(reconnect_first_s=0.1)
    async with compax_aio.connect(url, name="x", settings=settings) as drive:
        events = drive.events()
        await drive.position()
        if plug is not None:
            asyncio.get_running_loop().call_later(0.5, plug)
        told = [type(await anext(events)).__name__ for _ in range(2)]
        return told, await drive.position()


async def test_a_line_that_was_lost_is_lost_again_and_comes_back(path: Path) -> None:
    async with record_trace(path):
        told = await lose_with_listener()
    assert told[0] == ["ConnectionLost", "ConnectionRestored"]
    for mode in ("strict", "lenient"):
        assert await lose_line(replayed(path, mode=mode)) == told


async def lose_with_listener() -> Any:
    far_ends: list[ScriptedFarEnd] = []

    def accept() -> ScriptedFarEnd:
        far_ends.append(ScriptedFarEnd())
        return far_ends[-1]

    listener = await listen("losing", accept)

    def plug() -> None:
        listener.close()
        far_ends[0].transport.abort()
        asyncio.get_running_loop().call_later(1.0, lambda: asyncio.ensure_future(listen("losing", accept)))

    return await lose_line("loop://losing", plug=plug)


async def test_attempts_that_failed_fail_again_with_their_reason(path: Path) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade()),
            (0.0, "x", Opening("tcp://moxa:4001")),
            (5.0, "x", Refused("tcp://moxa:4001 did not answer within 5 s")),
            (6.0, "x", Opening("tcp://moxa:4001")),
        ],
    )
    owner = Owner()
    with pytest.raises(TransportError, match=r"as in .*line 4: tcp://moxa:4001 did not answer"):
        await open_transport(replayed(path), owner.make)
    assert asyncio.get_running_loop().time() == 5
    with pytest.raises(TransportError, match="does not tell how the opening ended"):
        await open_transport(replayed(path), owner.make)
    with pytest.raises(TransportError, match="no more of this line: it was opened 2 times"):
        await open_transport(replayed(path), owner.make)


class Owner:
    """Opens the same line again and again, as a link does."""

    def make(self) -> Witness:
        return Witness()


class SlottedOwner:
    __slots__ = ()

    def make(self) -> Witness:
        return Witness()


async def test_whoever_opens_it_anew_begins_at_the_beginning(path: Path) -> None:
    await record_move(path)
    assert await record_move_again(path) == await record_move_again(path)
    slotted = SlottedOwner()
    for _ in range(2):
        transport = await open_transport(replayed(path), slotted.make)
        transport.abort()
        await asyncio.sleep(0)


async def record_move_again(path: Path) -> Any:
    async with compax_aio.connect(replayed(path), name="x") as drive:
        return (await drive.move_to(12.5)).target


# Field problems -------------------------------------------------------------------------------------------------------


async def ask(url: str) -> str:
    """Ask two things, and tell how it went."""
    async with compax_aio.connect(url, name="x", settings=ONCE) as drive:
        try:
            told = repr(await drive.speed())
        except CompaxError as error:
            told = f"{type(error).__name__}: {error.what}; {error.received}"
        return f"{told}; then {await drive.position()}, late answers: {drive.stats.late_answers}"


def change_answer(entries: list[dict[str, Any]], answer: str) -> None:
    """Let the answer to S4 be another one."""
    at = next(at for at, entry in enumerate(entries) if entry.get("data") == "S4\r")
    next(entry for entry in entries[at:] if entry["what"] == "received")["data"] = answer


@pytest.mark.parametrize("mode", ["strict", "lenient"])
async def test_a_garbled_answer_becomes_a_test_case(path: Path, mode: str) -> None:
    async with record_trace(path):
        assert await ask("sim://compax") == "0.0; then 0.0, late answers: 0"
    assert await ask(replayed(path, mode=mode)) == "0.0; then 0.0, late answers: 0"
    rewritten(path, lambda entries: change_answer(entries, "S004: 1#.5\r\n>"))
    told = await ask(replayed(path, mode=mode))
    assert told.startswith("UnexpectedAnswerError: the answer holds no number")
    assert "1#.5; then 0.0" in told


async def test_a_late_answer_becomes_a_test_case(path: Path) -> None:
    far = ScriptedFarEnd()

    def script(line: str) -> bytes:
        far.delay_s = 0.7 if line == "S4" else 0.0
        return as_drive(line)

    far.script = script
    with await listen("late", lambda: far):
        async with record_trace(path):
            told = await ask("loop://late")
    assert told.startswith("AnswerTimeoutError: no answer within 0.5 s")
    assert told.endswith("late answers: 1")
    assert await ask(replayed(path)) == told
    assert any(isinstance(fact, Noticed) and fact.event == "LateEnding" for fact in facts(path))


async def test_a_power_cycle_in_a_move_becomes_a_test_case_with_the_same_error(path: Path) -> None:
    async def move(url: str, power: Callable[[], None] | None = None) -> str:
        settings = DriveSettings(answer_timeout_s=0.5, in_doubt_after_s=3)
        async with compax_aio.connect(url, name="x", settings=settings) as drive:
            moving = drive.move_to(100, speed_percent=10)
            await moving.accepted
            if power is not None:
                asyncio.get_running_loop().call_later(0.3, power)
            with pytest.raises(CompaxError) as caught:
                await moving
            return f"{type(caught.value).__name__}: {caught.value.what}; {caught.value.hint}"

    far = drive_named("powered")
    async with record_trace(path):
        told = await move("sim://compax?name=powered", far.power_cycle)
    for options in ({"mode": "strict"}, {"mode": "lenient"}, {"mode": "strict", "speed": 0}):
        assert await move(replayed(path, **options)) == told, options


# Lenient --------------------------------------------------------------------------------------------------------------

CONVERSATION = [
    (0.0, "x", LineMade()),
    (0.0, "x", Opening("any")),
    (0.0, "x", Opened()),
    (0.1, "x", Received(b"hello")),
    (0.2, "x", Asked(1, "S1", Lane.READ)),
    (0.2, "x", Sent(b"S1\r", 1)),
    (0.3, "x", Received(b"one")),
    (0.3, "x", Noticed("Answered", ends_turn=True)),
    (0.4, "x", Asked(2, "PA5", Lane.MOTION)),
    (0.4, "x", Sent(b"PA5\r", 2)),
    (0.5, "x", Received(b">")),
    (0.5, "x", Noticed("Acknowledged", ends_turn=True)),
    (0.6, "x", Asked(3, "S1", Lane.CONTROL)),
    (0.6, "x", Sent(b"S1\r", 3)),
    (0.7, "x", Received(b"two")),
    (0.7, "x", Noticed("Answered", ends_turn=True)),
    (0.7, "x", Ended(3, "Answered", "two")),
    (0.8, "x", Asked(4, "S9", Lane.CONTROL)),
    (0.8, "x", Sent(b"S9\r", 4)),
    (0.9, "x", Received(b"nine")),
    (0.9, "x", Noticed("Answered", ends_turn=True)),
    (0.9, "x", Ended(4, "Answered", "nine")),
    (1.0, "x", Sent(b"\x1b", None, Way.PREEMPT)),
    (1.1, "x", Received(b"#")),
    (1.1, "x", Noticed("InStep", ends_turn=True)),
    (1.2, "x", Sent(b"\x84LAB", 5)),
    (1.3, "x", Received(b"f")),
    (1.3, "x", Noticed("Acknowledged", ends_turn=True)),
    (1.4, "x", Received(b"$")),
]


async def lenient(path: Path, **options: object) -> tuple[asyncio.Transport, Witness]:
    witness = Witness()
    return await open_transport(replayed(path, mode="lenient", **options), lambda: witness), witness


async def heard(witness: Witness, for_s: float = 5.0) -> bytes:
    await asyncio.sleep(for_s)
    data = bytes(witness.data)
    witness.data.clear()
    return data


async def test_lines_are_answered_in_any_order_by_what_came_next_to_the_same(path: Path) -> None:
    write(path, CONVERSATION)
    transport, witness = await lenient(path)
    assert await heard(witness) == b"hello"
    for line, answer in (
        (b"S9\r", b"nine"),
        (b"S1\r", b"one"),
        (b"S1\r", b"two"),
        (b"S1\r", b"two"),
        (b"S9\r", b"nine"),
        (b"PA6\r", b""),
        (b"PA5\r", b">"),
        (b"PA5\r", b""),
        (b"\x1b", b"#"),
        (b"\x84LAB", b"f$"),
        (b"\x84LAB", b""),
        (b"S1", b""),
    ):
        transport.write(line)
        assert await heard(witness) == answer, line
    transport.write(b"\r")
    assert await heard(witness) == b"two", "whatever the pieces"
    transport.abort()
    await witness.is_lost()


async def test_what_came_unasked_comes_as_long_behind_what_was_told_before(path: Path) -> None:
    write(path, [*CONVERSATION[:16], (2.4, "x", Received(b"$"))])
    transport, witness = await lenient(path, speed=10)
    assert await heard(witness) == b"hello"
    transport.write(b"PA5\r")
    assert await heard(witness, 0.15) == b">"
    assert await heard(witness, 0.049) == b""
    assert await heard(witness, 0.002) == b"$"
    transport.abort()
    await witness.is_lost()


async def test_a_line_that_is_opened_more_often_than_then_is_answered_from_what_is_left(path: Path) -> None:
    write(path, [*CONVERSATION, (1.5, "x", Lost("unplugged")), (1.6, "x", Opening("any")), (1.7, "x", Opened())])
    owner = Owner()
    for count in range(3):
        transport = await open_transport(replayed(path, mode="lenient", speed=0), owner.make)
        witness = transport.get_protocol()
        assert isinstance(witness, Witness)
        transport.write(b"S1\r")
        assert (await heard(witness)).removeprefix(b"hello") == (b"one", b"two", b"two")[count]
        transport.abort()
        await witness.is_lost()


async def test_a_piece_of_a_line_is_known_by_what_the_line_has_become(path: Path) -> None:
    steps = [(0.1 * at, "x", fact) for at, fact in enumerate([
        Sent(b"A"), Received(b"A"), Sent(b"Z", None, Way.GOES_ON), Received(b"Z"), Sent(b"\n", None, Way.GOES_ON),
        Received(b"12\n"), Noticed("Answered", ends_turn=True), Sent(b"B"), Received(b"B"),
    ], 4)]  # fmt: skip
    write(path, [*CONVERSATION[:3], *steps])
    transport, witness = await lenient(path)
    for piece, answer in ((b"B", b"B"), (b"\n", b""), (b"A", b"A"), (b"Z", b"Z"), (b"\n", b"12\n"), (b"A", b"A")):
        transport.write(piece)
        assert await heard(witness) == answer
    transport.abort()
    await witness.is_lost()


@pytest.mark.parametrize("mode", ["strict", "lenient"])
@pytest.mark.parametrize("why", [None, "unplugged"])
async def test_the_end_of_the_line_is_played_with_its_reason(path: Path, mode: str, why: str | None) -> None:
    write(path, [*CONVERSATION[:4], (0.2, "x", Lost(why))])
    witness = Witness()
    await open_transport(replayed(path, mode=mode), lambda: witness)
    await witness.is_lost()
    assert bytes(witness.data) == b"hello"
    (loss,) = witness.losses
    assert (loss is None) == (why is None)
    assert why is None or why in str(loss)


async def test_what_was_let_go_of_from_here_is_not_played(path: Path) -> None:
    write(path, [*CONVERSATION[:4], (0.2, "x", LetGo()), (0.2, "x", Lost(None))])
    witness = Witness()
    transport = await open_transport(replayed(path), lambda: witness)
    await asyncio.sleep(10)
    assert not witness.losses
    transport.close()
    await witness.is_lost()


# Which conversation ---------------------------------------------------------------------------------------------------


async def test_the_line_and_the_session_can_be_chosen(path: Path) -> None:
    for position in (1, 2):
        async with record_trace(path):
            for name in ("x", "y"):
                knobs = f"position={position + 10 * (name == 'y')}"
                async with compax_aio.connect(f"sim://compax?{knobs}", name=name) as drive:
                    await drive.position()
    for line, session, position in (("x", 1, 1), ("y", 1, 11), ("x", None, 2), ("y", 2, 12)):
        options = {"line": line} | ({} if session is None else {"session": session})
        async with compax_aio.connect(replayed(path, **options), name="z") as drive:
            assert await drive.position() == position


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ("", r"has 2 lines; say line=…, which is one of 'x', 'y'"),
        ("line=z", r"no line 'z' in .*; lines in the trace: 'x', 'y'"),
        ("line=x&session=2", r"no line 'x' in session 2"),
        ("session=2", r"no line in session 2"),
        ("session=0", "session is a whole number from 1"),
        ("mode=loose", "mode is one of strict, lenient"),
        ("speed=-1", "speed is a number above 0"),
        ("line=x&loop=1", "no option 'loop'"),
    ],
)
async def test_a_url_that_names_no_conversation_is_refused(path: Path, options: str, why: str) -> None:
    write(path, [*CONVERSATION[:3], (0.0, "y", LineMade()), (0.0, "y", Opening("any")), (0.0, "y", Opened())])
    with pytest.raises(TransportError, match=why):
        await open_transport(f"replay://{path}?{options}" if options else f"replay://{path}", Witness)


async def test_a_file_that_is_no_trace_or_not_there_is_refused(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(TransportError, match=r"could not be opened: .*No such file"):
        await open_transport(replayed(path), Witness)
    path.write_text("a,b\n")
    with pytest.raises(TransportError, match=r"cannot be replayed: .* is no trace"):
        await open_transport(replayed(path), Witness)
    with pytest.raises(TransportError, match="names no trace"):
        await open_transport("replay://", Witness)
    write(path, [(0.0, "x", LineMade(is_open=True)), (0.1, "x", Received(b">"))])
    with pytest.raises(TransportError, match="has no beginning of line 'x'"):
        await open_transport(replayed(path), Witness)
    write(path, [*CONVERSATION[:5], (0.3, "", Missing(7)), *CONVERSATION[5:]])
    with pytest.raises(TransportError, match="has a gap in line 7"):
        await open_transport(replayed(path), Witness)
    monkeypatch.setattr(replay_script, "_MOST_STEPS", 10)
    write(path, CONVERSATION)
    with pytest.raises(TransportError, match="too long to be played"):
        await open_transport(replayed(path), Witness)


async def test_a_path_may_be_relative(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    write(path, CONVERSATION)
    transport = await open_transport("replay://trace.jsonl", Witness)
    transport.abort()
    await asyncio.sleep(0)


# What is not invented -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [0, 1, 1e6])
async def test_what_came_in_one_moment_comes_in_the_same_order(path: Path, speed: float) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade()),
            (0.0, "x", Opening("u")),
            (0.0, "x", Opened()),
            (0.1, "x", Sent(b"S1\r", 1)),
            *((0.2, "x", Received(bytes([each]))) for each in b"S001:       0.00\r\n>"),
        ],
    )
    witness = Witness()
    transport = await open_transport(replayed(path, mode="lenient", speed=speed), lambda: witness)
    transport.write(b"S1\r")
    await asyncio.sleep(1)
    assert bytes(witness.data) == b"S001:       0.00\r\n>"
    transport.close()


async def test_a_message_that_came_before_an_answer_does_not_come_with_it_again(path: Path) -> None:
    clean = [Sent(b"S1\r", 1), Received(b"S001: 1\r\n>"), Noticed("Answered", ends_turn=True)]
    mixed = [
        Sent(b"S1\r", 2), Received(b"$\r\n>"), Noticed("PositionReached"),
        Received(b"S001: 2\r\n>"), Noticed("Answered", ends_turn=True),
    ]  # fmt: skip
    asked = [Asked(1, "S1", Lane.READ), Asked(2, "S1", Lane.READ)]
    steps = [LineMade(), Opening("u"), Opened(), *asked, *clean, *mixed]
    write(path, [(0.0, "x", step) for step in steps])
    witness = Witness()
    transport = await open_transport(replayed(path, mode="lenient", speed=0), lambda: witness)
    for _ in range(4):
        transport.write(b"S1\r")
        await asyncio.sleep(1)
    assert bytes(witness.data) == b"S001: 1\r\n>$\r\n>S001: 2\r\n>S001: 1\r\n>S001: 1\r\n>"
    transport.close()


async def test_a_program_that_was_killed_leaves_a_trace_that_is_played_as_far_as_it_goes(path: Path) -> None:
    await record_move(path)
    data = path.read_bytes()
    end = data.index(b'"what":"closed"')
    for cut in (end + 5, end - 40, end - 200):
        path.write_bytes(data[:cut])
        async with compax_aio.connect(replayed(path, speed=0), name="x") as drive:
            assert (await drive.move_to(12.5)).target == 12.5
    path.write_bytes(data[:-5] + b"\n" + data)
    async with compax_aio.connect(replayed(path, speed=0, session=1), name="x") as drive:
        assert (await drive.move_to(12.5)).target == 12.5


async def test_what_is_behind_a_gap_is_not_played(path: Path) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade()),
            (0.0, "x", Opening("u")),
            (0.0, "x", Opened()),
            (0.1, "x", Missing(3)),
            (0.2, "x", Noticed("Stray")),
        ],
    )
    (await open_transport(replayed(path), Witness)).close()
    with path.open("a") as file:
        file.write('{"at":0.3,"line":"x","what":"received","data":"1"}\n')
    with pytest.raises(TransportError, match="has a gap in line 5"):
        await open_transport(replayed(path), Witness)
