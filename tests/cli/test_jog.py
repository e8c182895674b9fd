"""``compax jog``: one key, one step; at most one on its way, whatever is typed, and none when the person leaves."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator, Callable, Iterator

import pytest
from rich.console import Console
from rich.live import Live
from tests.fakes.commands import Commands

import compax_aio
from compax_aio.cli.jog import JogView
from compax_aio.cli.jogging import Jogging
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named


@pytest.fixture
async def far_end() -> SimulatedDrive:
    return drive_named("jogged", Knobs(homed=True))


@pytest.fixture
async def jogging(far_end: SimulatedDrive) -> AsyncIterator[Jogging]:
    async with compax_aio.connect("sim://compax?name=jogged", name="x") as drive:
        yield Jogging(drive, 10.0, 10.0)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(60):
        while not condition():  # noqa: ASYNC110 - the drive sets no event
            await asyncio.sleep(0.01)


async def test_one_key_is_one_step_at_the_speed_of_jogging(jogging: Jogging, far_end: SimulatedDrive) -> None:
    jogging.press("right")
    await until(lambda: not jogging.is_moving)
    assert far_end.position == 10.0
    assert jogging.message == "+10: reached"
    jogging.press("left")
    await until(lambda: not jogging.is_moving)
    assert far_end.position == 0.0
    assert far_end.log.texts(LogKind.LINE).count("SD10") == 2


async def test_a_key_that_repeats_itself_does_not_add_up(jogging: Jogging, far_end: SimulatedDrive) -> None:
    for _ in range(1000):
        jogging.press("right")
    await until(lambda: not jogging.is_moving)
    await asyncio.sleep(10)
    assert far_end.position == 10.0
    assert far_end.log.texts(LogKind.MOTION_STARTED) == ["POSR 10.00"]


async def test_the_opposite_key_stops_and_no_more(jogging: Jogging, far_end: SimulatedDrive) -> None:
    jogging.press("right")
    await until(lambda: far_end.moving)
    for _ in range(100):
        jogging.press("left")
    await until(lambda: not jogging.is_moving)
    assert 0 < far_end.position < 10.0
    assert jogging.message == "stopped; it stands"
    assert len(far_end.log.texts(LogKind.MOTION_STARTED)) == 1
    jogging.press("left")
    await until(lambda: far_end.moving)
    assert len(far_end.log.texts(LogKind.MOTION_STARTED)) == 2
    await jogging.end()


@pytest.mark.parametrize("key", ["space", "s"])
async def test_stop_stops_at_any_time(jogging: Jogging, far_end: SimulatedDrive, key: str) -> None:
    jogging.press("right")
    await until(lambda: far_end.moving)
    jogging.press(key)
    jogging.press(key)
    await until(lambda: not jogging.is_moving)
    assert not far_end.moving
    jogging.press(key)
    await until(lambda: not jogging.is_moving)
    assert jogging.message == "stopped; it stands"


async def test_a_stop_that_comes_before_the_step_is_sent_keeps_it_back(
    jogging: Jogging, far_end: SimulatedDrive
) -> None:
    jogging.press("right")
    jogging.press("space")
    await until(lambda: not jogging.is_moving)
    assert far_end.log.texts(LogKind.MOTION_STARTED) == []


async def test_steps_become_longer_and_shorter_within_bounds(jogging: Jogging) -> None:
    steps = []
    for key in ("up", "down", "down", "down"):
        jogging.press(key)
        steps.append(jogging.step)
    assert steps == [20.0, 10.0, 5.0, 2.0]
    assert jogging.message == "one step is 2 units"
    for _ in range(50):
        jogging.press("down")
    assert jogging.step == 0.01
    for _ in range(50):
        jogging.press("up")
    assert jogging.step == 100.0


async def test_a_step_of_its_own_is_left_for_its_neighbours(jogging: Jogging) -> None:
    jogging.step = 3.0
    jogging.press("up")
    assert jogging.step == 5.0


async def test_machine_zero_is_looked_for_after_a_yes_alone(jogging: Jogging, far_end: SimulatedDrive) -> None:
    jogging.press("h")
    jogging.press("x")
    assert jogging.message == "machine zero is not looked for"
    jogging.press("h")
    jogging.press("right")
    jogging.press("h")
    await until(lambda: not jogging.is_moving)
    assert far_end.log.texts(LogKind.MOTION_STARTED) == ["POSR 10.00"]
    jogging.press("h")
    jogging.press("y")
    await until(lambda: not jogging.is_moving)
    assert jogging.message == "machine zero: reached"
    assert far_end.position == 0.0


async def test_a_key_that_is_held_does_not_say_yes(jogging: Jogging, far_end: SimulatedDrive) -> None:
    for _ in range(50):
        jogging.press("h")
        await asyncio.sleep(0.03)
    assert "look for machine zero?" in jogging.message
    jogging.press("x")
    jogging.press("y")
    assert not jogging.is_moving
    assert far_end.log.texts(LogKind.MOTION_STARTED) == []


async def test_arrows_do_not_stop_a_search_in_the_direction_they_know_nothing_of(
    jogging: Jogging, far_end: SimulatedDrive
) -> None:
    jogging.press("right")
    await until(lambda: not jogging.is_moving)
    jogging.press("h")
    jogging.press("y")
    await until(lambda: far_end.moving)
    jogging.press("right")
    await until(lambda: not jogging.is_moving)
    assert not far_end.moving
    assert far_end.position != 0.0


@pytest.mark.parametrize(("key", "is_interrupted"), [("q", False), ("interrupt", True)])
async def test_who_leaves_leaves_a_standing_axis(
    jogging: Jogging, far_end: SimulatedDrive, key: str, is_interrupted: bool
) -> None:
    jogging.press("right")
    await until(lambda: far_end.moving)
    jogging.press(key)
    assert jogging.left.is_set()
    assert jogging.is_interrupted is is_interrupted
    assert await jogging.end()
    assert not far_end.moving
    assert not await jogging.end(), "there was nothing left to stop"


async def test_a_refusal_is_told_and_jogging_goes_on(jogging: Jogging, far_end: SimulatedDrive) -> None:
    far_end.raise_fault(55)
    jogging.press("right")
    await until(lambda: not jogging.is_moving)
    assert "the drive rejected it" in jogging.message
    assert not jogging.left.is_set()


async def test_a_step_that_cannot_be_said_is_told(jogging: Jogging) -> None:
    jogging.step = 1e9
    jogging.press("right")
    assert not jogging.is_moving
    assert "4,000,000" in jogging.message


async def test_doubt_ends_it_with_its_error(jogging: Jogging, far_end: SimulatedDrive) -> None:
    jogging.press("right")
    await until(lambda: far_end.moving)
    far_end.silent = True
    await asyncio.wait_for(jogging.left.wait(), 120)
    with pytest.raises(compax_aio.MoveInDoubtError):
        await jogging.end()
    far_end.silent = False


async def test_a_stop_that_fails_ends_it_with_its_error(jogging: Jogging, far_end: SimulatedDrive) -> None:
    jogging.press("right")
    await until(lambda: far_end.moving)
    far_end.silent = True
    jogging.press("space")
    await asyncio.wait_for(jogging.left.wait(), 120)
    with pytest.raises(compax_aio.AnswerTimeoutError, match="STOP was not acknowledged"):
        await jogging.end()
    far_end.silent = False


async def test_position_step_and_message_are_shown(far_end: SimulatedDrive) -> None:
    screen = io.StringIO()
    async with compax_aio.connect("sim://compax?name=jogged", name="x") as drive:
        jogging = Jogging(drive, 10.0, 10.0)
        with Live(console=Console(file=screen, width=100, force_terminal=True), auto_refresh=False) as live:
            view = JogView(drive, jogging, live)
            view.show()
            view.note_position(12.5)
            jogging.on_change = view.show
            jogging.press("up")
    told = screen.getvalue()
    for each in ("…", "12.50 units", "one step: 20 units", "one step is 20 units", "machine zero"):
        assert each in told


# The command


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.mark.parametrize(
    ("words", "says"),
    [((), "from a terminal only"), (("--step", "nan"), "no number"), (("--speed", "0"), "above 0")],
)
def test_without_keys_or_with_steps_that_mean_nothing_no_line_is_opened(
    compax: Commands, words: tuple[str, ...], says: str
) -> None:
    drive = compax.drive("x", Knobs())
    outcome = compax("jog", "sim://compax?name=x", *words)
    assert outcome.code == 2
    assert says in outcome.told
    assert len(drive.log) == 0
