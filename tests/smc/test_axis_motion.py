"""What is told about a motion is true, whatever becomes of each single character of its command."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from tests.smc.bench import Cable, bench, commands, ending, motions, now, outcome, received, until

from compax_aio.errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.motion.moves import MoveResult
from compax_aio.simulator.smc import LogKind
from compax_aio.smc.axis import SmcAxis
from compax_aio.smc.moves import AxisMove
from compax_aio.smc.party_line import PartyLine
from compax_aio.smc.profile import IM483I
from compax_aio.smc.settings import SmcSettings

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

MOTIONS: dict[str, Callable[[SmcAxis], AxisMove]] = {
    "R500": lambda axis: axis.move_to(500),
    "+600": lambda axis: axis.move_by(600),
    "-300": lambda axis: axis.move_by(-300),
    "M900": lambda axis: axis.run(900),
    "F800 0": lambda axis: axis.home(800, direction=0),
}
PLACES = [(text, place) for text in MOTIONS for place in range(len(text) + 2)]
every_place = pytest.mark.parametrize(("text", "place"), PLACES)
FAULTS = {
    "echo lost": lambda far, cable: far.lose_next_echo("A"),
    "echo wrong": lambda far, cable: far.garble_next_echo("A"),
    "character lost": lambda far, cable: far.lose_next_character(),
    "character wrong": lambda far, cable: far.flip_next_character(1),
    "line lost": lambda far, cable: cable.pull_and_plug(),
}


def whole(text: str, place: int) -> str:
    """Return what has been typed of a motion of axis A when its character at *place* is."""
    return f"A{text}\n"[: place + 1]


async def moved(
    line: PartyLine, cable: Cable, text: str, place: int, action: Callable[[], object]
) -> MoveResult | CompaxError:
    """Command a motion, do something when its character at *place* is sent, and return how it ended."""
    axis = line.axis("A")
    begun = axis.move_to(2000)
    await begun
    await axis.set_origin()  # so that no name and no number says of itself where the axis is
    cable.on_entry = lambda _: None
    # The name alone is also that of the questions before it.
    typed = whole(text, place)
    if place:
        cable.at(typed, action)
    else:
        questions = ["A^\n", "AZ\n"]
        cable.at(questions[-1], lambda: cable.at("A", action))
    move = MOTIONS[text](axis)
    if text[0] == "M":
        move.add_done_callback(lambda _: timer.cancel())
        timer = asyncio.get_running_loop().call_later(20, axis._motion.begin_stop)
    result: MoveResult | CompaxError = await outcome(move)
    return result


def _cancel_first(moves: list[AxisMove]) -> Callable[[], None]:
    """Return what cancels the first of *moves*, which is made later."""

    def cancel() -> None:
        moves[0].cancel()

    return cancel


@pytest.mark.parametrize("half_entered", ["execute", "clear"])
@pytest.mark.parametrize("fault", FAULTS)
@every_place
async def test_whatever_happens_to_a_character_of_a_motion_is_told_as_it_is(
    text: str, place: int, fault: str, half_entered: str
) -> None:
    async with bench(axes="AB", half_entered=half_entered, home=2500, fails_to_close=True) as (line, far, cable):
        trouble: list[float] = []

        def make() -> None:
            trouble.append(now())
            FAULTS[fault](far, cable)

        result = await moved(line, cable, text, place, make)
        assert trouble, "the test has done what it is for"
        await asyncio.sleep(1)
        told, axis = str(result), far.axes["A"]
        assert not axis.moving, "whatever is told, nothing runs unwatched"
        begun = commands(far, "A")[2:]
        assert begun.count(text) <= 1, "at most once"
        if isinstance(result, MoveResult):
            assert begun[:1] == [text]
            assert result.last_position == pytest.approx(axis.position)
            assert result.target is None or result.target == pytest.approx(axis.position)
        elif text[0] == "M" and "was stopped at" in told:
            assert begun == [text]
        else:
            assert isinstance(result, (MoveStoppedError, MoveInDoubtError, ConnectionLostError, AnswerTimeoutError))
            assert begun != [text] or isinstance(result, (MoveStoppedError, MoveInDoubtError)), told
            assert result.hint
            assert "'A" in told or result.sent or "was not sent" in told
            if "P" in told or "received ''" in told:
                assert (fault, place) == ("character wrong", 1), (
                    "an R that has become a P: the axis is in program entry"
                )
                with pytest.raises(MoveInDoubtError, match=r"may have begun program entry.*abort_all\(\) ends it"):
                    line.axis("A").move_by(1)
                await line.abort_all()
            elif begun and begun != [text]:
                assert "damaged" in told, "what the axis has done instead is told"
                assert f"'{begun[0]}'" in told or f"'{begun[0][:-1]}" in told
        # In one way or the other the axis is good for the next motion.
        if isinstance(result, MoveInDoubtError):
            await line.axis("A").reconcile()
        await line.axis("A").move_by(100)


@every_place
async def test_a_stop_in_the_middle_of_a_motions_command_comes_right_behind_it(text: str, place: int) -> None:
    async with bench(axes="AB", home=-5000) as (line, far, cable):
        stops: list[asyncio.Task[None]] = []
        result = await moved(
            line, cable, text, place, lambda: stops.append(asyncio.ensure_future(line.axis("A").stop()))
        )
        await stops[0]
        assert isinstance(result, MoveStoppedError)
        assert not far.axes["A"].moving
        assert abs(far.axes["A"].position) < 100
        assert commands(far, "A")[2:] in ([], [text])
        assert (commands(far, "A")[2:] == []) is ("before it was sent" in str(result))


@every_place
@pytest.mark.parametrize("kind", ["abort_all", "reset"])
async def test_an_abort_in_the_middle_of_a_motions_command_is_heard_at_once(text: str, place: int, kind: str) -> None:
    async with bench(axes="AB", home=-5000) as (line, far, cable):
        other = line.axis("B").run(1000)
        await other.accepted
        calls: list[asyncio.Task[None]] = []
        result = await moved(
            line, cable, text, place, lambda: calls.append(asyncio.ensure_future(getattr(line, kind)()))
        )
        await calls[0]
        for axis in far.axes.values():
            assert not axis.moving
        assert isinstance(result, MoveStoppedError)
        assert ("ESC" if kind == "abort_all" else "^C") in str(result)
        assert isinstance(await ending(other), MoveStoppedError)
        assert commands(far, "A")[2:] in ([], [text])
        assert commands(far, "A")[2:] == [] or place == len(text) + 1, "what was not ended is not executed"
        kinds = [entry.kind for entry in far.log if entry.axis == "A" and entry.kind in {LogKind.ABORT, LogKind.RESET}]
        assert kinds == ([LogKind.ABORT] * 2 if kind == "abort_all" else [LogKind.RESET])


@every_place
async def test_a_motion_that_is_cancelled_in_the_middle_of_its_command_is_stopped(text: str, place: int) -> None:
    async with bench(axes="AB", home=-5000) as (line, far, cable):
        moves: list[AxisMove] = []
        motion = MOTIONS[text]

        def begin(axis: SmcAxis) -> AxisMove:
            moves.append(motion(axis))
            return moves[0]

        MOTIONS[text] = begin
        try:
            with pytest.raises(asyncio.CancelledError):
                await moved(line, cable, text, place, _cancel_first(moves))
        finally:
            MOTIONS[text] = motion
        await asyncio.sleep(1)
        assert not far.axes["A"].moving
        assert commands(far, "A")[2:] in ([], [text])
        assert abs(far.axes["A"].position) < 100
        await line.axis("A").move_by(100)


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("fault", ["echo lost", "echo wrong", "line lost"])
async def test_where_escape_clears_nothing_is_executed_that_was_not_ended(place: int, fault: str) -> None:
    async with bench(SmcSettings(cancel_with="escape"), axes="AB") as (line, far, cable):
        result = await moved(line, cable, "R500", min(place, 5), lambda: FAULTS[fault](far, cable))
        begun = commands(far, "A")[2:]
        assert begun in ([], ["R500"])
        assert isinstance(result, MoveResult) or begun == [], "what is refused was not executed"
        if isinstance(result, CompaxError):
            assert "command it again" in str(result)


@pytest.mark.parametrize("fault", ["echo lost", "echo wrong", "character lost"])
@pytest.mark.parametrize("place", range(5))
async def test_what_is_typed_to_a_single_axis_is_taken_back(place: int, fault: str) -> None:
    async with bench(mode="single") as (line, far, cable):
        axis = line.axis()
        cable.at("R500"[: place + 1] if place < 4 else "R500\r", lambda: FAULTS[fault](far, cable))
        cable.on_entry = _by_cr(cable)
        result = await outcome(axis.move_to(500))
        assert commands(far) in ([], ["R500"])
        assert isinstance(result, MoveResult) is (commands(far) == ["R500"])
        await axis.move_by(30)


def _by_cr(cable: Cable) -> Callable[[bytes], None]:
    """Begin entries anew behind CR, too."""
    inner = cable.on_entry

    def watch(typed: bytes) -> None:
        inner(typed.rstrip(b"\r").rpartition(b"\r")[2] + typed[len(typed.rstrip(b"\r")) :])

    return watch


# The stop, the questions ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("fault", FAULTS)
async def test_a_stop_is_repeated_until_it_is_acknowledged(place: int, fault: str) -> None:
    async with bench(axes="AB") as (line, far, cable):
        axis = line.axis("A")
        move = axis.run(1000)
        await move.accepted
        await asyncio.sleep(1)
        if place:
            cable.at("A@\n"[: place + 1], lambda: FAULTS[fault](far, cable))
        else:
            FAULTS[fault](far, cable)
        await axis.stop()
        assert not far.axes["A"].moving
        assert isinstance(await ending(move), MoveStoppedError)


@pytest.mark.parametrize("question", ["A^\n", "AZ\n"])
@pytest.mark.parametrize("place", [1, 2])
@pytest.mark.parametrize("fault", FAULTS)
async def test_trouble_with_a_question_on_the_way_is_survived_or_told(question: str, place: int, fault: str) -> None:
    """A question that was damaged may have become a motion; then the axis is stopped, and that is told."""
    async with bench(axes="AB") as (line, far, cable):
        axis = line.axis("A")
        move = axis.move_to(6000)
        await move.accepted
        await asyncio.sleep(0.5)
        cable.at(question[: place + 1], lambda: FAULTS[fault](far, cable))
        result = await outcome(move)
        assert commands(far, "A").count("R6000") == 1
        assert not far.axes["A"].moving
        if isinstance(result, MoveResult):
            assert far.axes["A"].position == 6000
        else:
            assert isinstance(result, MoveStoppedError)
            assert "damaged" in str(result)


# Motions as they should be -------------------------------------------------------------------------------------------


async def test_a_move_is_said_once_and_awaited_until_the_axis_stands() -> None:
    async with bench(axes="AB", decimals=2) as (line, far, _):
        axis = line.axis("A")
        move = axis.move_to(5000)
        await move.accepted
        assert far.axes["A"].moving
        result = await move
        assert result == MoveResult(
            drive="bus axis A",
            target=5000,
            confirmed_by="status",
            started_at=result.started_at,
            finished_at=result.finished_at,
            last_position=5000,
        )
        assert far.axes["A"].position == 5000
        assert move.sent == "AR5000"
        ended = next(entry.at for entry in far.log if entry.kind is LogKind.MOTION_ENDED)
        assert result.finished_at - ended < 0.5
        back = await axis.move_by(-1000.4)
        assert back.target == 3999.6


async def test_axes_move_at_the_same_time() -> None:
    async with bench(axes="ABC") as (line, far, _):
        begun_at = now()
        results = await asyncio.gather(*(line.axis(name).move_to(3000) for name in "ABC"))
        took = now() - begun_at
        assert [result.last_position for result in results] == [3000] * 3
        assert took < 1.7 * results[0].duration_s
        assert len(far.log.texts(LogKind.COMMAND, axis="C")) < 40, "looked at ever more rarely"


async def test_a_move_to_where_the_axis_is_ends_there() -> None:
    async with bench() as (line, far, _):
        await line.axis("A").move_to(100)
        far.log.clear()
        assert (await line.axis("A").move_to(100)).last_position == 100
        said = far.log.texts(LogKind.COMMAND)
        assert said == ["^", "Z", "R100", "^", "Z", "^", "Z"], "that it stands is believed when it says so twice"


async def test_positions_are_seen_on_the_way() -> None:
    async with bench() as (line, _, _):
        move = line.axis("A").move_to(3000)
        seen = [position async for position in move.positions(interval_s=0.1)]
        await move
        assert seen == sorted(seen)
        assert len(seen) > 5
        assert seen[-1] == 3000


async def test_a_run_goes_on_until_it_is_stopped_and_can_change_its_speed() -> None:
    async with bench() as (line, far, _):
        run = line.axis("A").run(500)
        await run.accepted
        await run.change_speed(-2000)
        await asyncio.sleep(2)
        assert far.axes["A"].speed == -2000
        await run.change_speed(300)
        await asyncio.sleep(5)
        assert far.axes["A"].speed == 300
        await run.stop()
        assert isinstance(await ending(run), MoveStoppedError)
        assert motions(far) == ["M500", "M-2000", "M300"]


async def test_a_speed_is_changed_only_when_the_ramp_is_over() -> None:
    """An action waits in the axis for the end of the ramp, and the whole line with it (DCB p. 27)."""
    async with bench(ramp_slope=200) as (line, far, _):
        run = line.axis("A").run(5000)
        await run.accepted
        await run.change_speed(2000)
        assert far.log.texts(LogKind.QUEUED) == []
        run.cancel()


@pytest.mark.parametrize("kind", ["not accepted", "over", "no run"])
async def test_only_a_run_that_is_under_way_has_another_speed(kind: str) -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        move = axis.move_to(5000) if kind == "no run" else axis.run(500)
        if kind != "not accepted":
            await move.accepted
        if kind == "over":
            await axis.stop()
        with pytest.raises(MoveError, match="is no run that is under way"):
            await move.change_speed(700)
        with pytest.raises(InvalidCommandError):
            await move.change_speed(0)
        assert "M700" not in commands(far)
        if kind == "not accepted":
            await move.accepted
        move.cancel()
    assert isinstance(move.exception() if not move.cancelled() else MoveStoppedError(""), MoveStoppedError)


@pytest.mark.parametrize("place", range(1, 6))
@pytest.mark.parametrize("fault", ["echo lost", "echo wrong", "line lost"])
async def test_a_run_whose_new_speed_was_damaged_is_stopped(place: int, fault: str) -> None:
    async with bench() as (line, far, cable):
        run = line.axis("A").run(500)
        await run.accepted
        await asyncio.sleep(1)
        cable.at("AM900\n"[: place + 1], lambda: FAULTS[fault](far, cable))
        changed, ended = await asyncio.gather(outcome(run.change_speed(900)), ending(run))
        if changed is None:
            assert place == 5
        assert isinstance(ended, MoveStoppedError)
        assert not far.axes["A"].moving


@pytest.mark.parametrize("where", [-300.0, 300.0])
async def test_home_is_searched_and_becomes_the_origin(where: float) -> None:
    async with bench(home=where, position=0) as (line, far, _):
        axis = line.axis("A")
        result = await axis.home(800, direction=1 if where < 0 else 0)
        assert result.last_position == 0
        assert far.axes["A"].position == pytest.approx(0, abs=1)
        assert far.axes["A"].place == pytest.approx(where, abs=10)
        assert commands(far)[-1] == "O0"
        await axis.move_to(50)


async def test_home_can_leave_the_origin_where_it_is() -> None:
    async with bench(home=-300) as (line, far, _):
        result = await line.axis("A").home(800, direction=1, sets_origin=False)
        assert result.last_position == pytest.approx(-300, abs=10)
        assert "O0" not in commands(far)


async def test_that_home_was_not_found_is_told_where_the_input_is_known() -> None:
    async with bench(SmcSettings(profile=IM483I), home=-300, limit_min=-200) as (line, far, _):
        error = await ending(line.axis("A").home(800, toward_plus=False))
        assert isinstance(error, MoveStoppedError)
        assert "the home input is not active" in str(error)
        assert "O0" not in commands(far)
    async with bench(SmcSettings(profile=IM483I), home=-300) as (line, far, _):
        await line.axis("A").home(800, toward_plus=False)
        assert commands(far)[-1] == "O0"


# Ends that are none --------------------------------------------------------------------------------------------------


async def test_a_limit_ends_a_move_elsewhere() -> None:
    async with bench(limit_max=700) as (line, far, _):
        error = await ending(line.axis("A").move_to(5000))
        assert isinstance(error, MoveStoppedError)
        assert f"ended at {far.axes['A'].position:.2f} steps, and nobody here has stopped it" in str(error)
        assert error.sent == "AR5000"


async def test_a_run_that_a_limit_ends_is_told() -> None:
    async with bench(limit_max=700) as (line, _, _):
        assert "nobody here has stopped it" in str(await ending(line.axis("A").run(800)))


async def test_a_command_that_the_axis_ignores_is_no_success() -> None:
    async with bench(out_of_range="ignore", max_speed=100) as (line, far, _):
        error = await ending(line.axis("A").run(5000))
        assert isinstance(error, MoveStoppedError)
        assert not far.axes["A"].moving


@pytest.mark.parametrize("at", [0.3, 1.0])
async def test_a_reset_on_the_way_costs_the_reference(at: float) -> None:
    async with bench(position=4000) as (line, far, _):
        axis = line.axis("A")
        move = axis.move_to(10_000)
        await asyncio.sleep(at)
        far.axes["A"].reset()
        error = await ending(move)
        assert isinstance(error, MoveStoppedError)
        assert "its position means nothing: it counts 0 after" in str(error)
        assert "counts 0" in str(axis.lost_reference)
        with pytest.raises(MoveError, match="its position means nothing"):
            axis.move_to(10)
        assert len(motions(far)) == 1
        await axis.move_by(10)
        await axis.set_origin()
        assert axis.lost_reference is None
        await axis.move_to(30)


async def test_a_reset_between_moves_is_seen_before_the_next_is_sent() -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        await axis.move_to(800)
        far.axes["A"].reset()
        await asyncio.sleep(1)
        error = await ending(axis.move_to(1000))
        assert isinstance(error, MoveError)
        assert "it stood at 800.00 steps and counts 0 now, as after a reset" in str(error)
        assert commands(far) == ["R800"]
        assert (await axis.reconcile()).raw == 0
        await axis.move_to(1000)
        assert far.axes["A"].place == 1800


async def test_an_axis_that_somebody_else_moves_is_sent_no_motion() -> None:
    """It would hold it back, and the whole line with it (DCB p. 27)."""
    async with bench() as (line, far, _):
        far.axes["A"].jog(3000)
        error = await ending(line.axis("A").move_to(10))
        assert isinstance(error, MoveActiveError)
        assert "somebody else moves this axis" in str(error)
        with pytest.raises(MoveActiveError, match="the axis moves, so 'R10' was not sent"):
            await line.axis("A").raw("R10")
        assert commands(far) == []


async def test_a_second_motion_is_refused_while_one_runs() -> None:
    async with bench(axes="AB") as (line, far, _):
        axis = line.axis("A")
        first = axis.move_to(1000)
        for second in (axis.move_to, axis.move_by):
            with pytest.raises(MoveActiveError, match="move to 1000 steps is running"):
                second(50)
        with pytest.raises(MoveActiveError):
            await axis.raw("R50")
        with pytest.raises(MoveActiveError):
            await axis.set_origin()
        await line.axis("B").move_to(20)
        await first
        assert commands(far, "A") == ["R1000"]


async def test_a_jog_in_the_gap_blocks_the_second_action_and_what_became_of_it_is_found_out() -> None:
    """DCB p. 27: the terminator comes when the first motion is over."""
    async with bench(initial_speed=100, slew_speed=200, axes="AB") as (line, far, cable):
        cable.at("AR100", lambda: far.axes["A"].jog(1500))
        result = await line.axis("A").move_to(100)
        assert far.log.texts(LogKind.QUEUED) == ["R100"]
        assert result.last_position == far.axes["A"].position == 100
        assert commands(far, "A") == ["R100"]


async def test_an_axis_that_answers_nothing_any_more_leaves_its_move_in_doubt() -> None:
    async with bench(SmcSettings(in_doubt_after_s=3), fails_to_close=True, axes="AB") as (line, far, _):
        axis = line.axis("A")
        move = axis.move_to(9000)
        await move.accepted
        far.stick(60)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert error.sent == "AR9000"
        for call in (axis.move_to, axis.move_by):
            with pytest.raises(MoveInDoubtError, match="reconcile"):
                call(10)
        await asyncio.sleep(60)
        await axis.reconcile()
        await axis.move_to(50)
        assert commands(far, "A") == ["R9000", "R50"]


@pytest.mark.parametrize("lost_s", [0.3, 2.0, 12.0])
async def test_a_move_outlives_a_line_that_is_lost_on_the_way(lost_s: float) -> None:
    async with bench(axes="AB") as (line, far, cable):
        move = line.axis("A").move_to(5000)
        await move.accepted
        await asyncio.sleep(0.3)
        cable.pull_and_plug(lost_s)
        result = await move
        assert result.last_position == 5000
        assert commands(far, "A") == ["R5000"]


async def test_a_line_that_does_not_come_back_leaves_a_move_in_doubt() -> None:
    async with bench(SmcSettings(in_doubt_after_s=4), fails_to_close=True) as (line, _, cable):
        move = line.axis("A").move_to(9000)
        await move.accepted
        lost_at = now()
        cable.pull()
        assert isinstance(await ending(move), MoveInDoubtError)
        assert now() - lost_at < 10


async def test_a_move_that_takes_too_long_is_stopped() -> None:
    async with bench() as (line, far, _):
        error = await ending(line.axis("A").move_to(50_000, timeout_s=1.5))
        assert isinstance(error, MoveTimeoutError)
        assert "within 1.5 s" in str(error)
        assert not far.axes["A"].moving
        error = await ending(line.axis("A").move_to(0, timeout_s=0.001))
        assert isinstance(error, MoveTimeoutError)
        assert "was not sent" in str(error)


async def test_a_hunt_without_end_is_stopped() -> None:
    async with bench(SmcSettings(standstill_timeout_s=5), fails_to_close=True, hunt_time_s=1000) as (line, _, _):
        error = await ending(line.axis("A").move_to(500))
        assert isinstance(error, MoveInDoubtError)
        assert "has not settled" in str(error.__cause__)


async def test_an_axis_that_says_it_moves_and_does_not_is_stopped() -> None:
    settings = SmcSettings(stall_timeout_s=0.5)
    async with bench(settings, min_speed=1, initial_speed=1, slew_speed=1) as (line, far, _):
        begun_at = now()
        error = await ending(line.axis("A").move_to(50))
        assert isinstance(error, MoveTimeoutError)
        assert "for 0.5 s the axis has said that it moves, and that it is at 1.00 steps" in str(error)
        assert now() - begun_at < 2
        assert not far.axes["A"].moving


async def test_an_axis_that_stands_and_does_not_settle_has_longer() -> None:
    settings = SmcSettings(stall_timeout_s=0.5, standstill_timeout_s=3)
    async with bench(settings, fails_to_close=True, hunt_time_s=1000) as (line, _, _):
        begun_at = now()
        error = await ending(line.axis("A").move_to(100))
        assert isinstance(error, MoveInDoubtError)
        assert now() - begun_at > 6, "once until it is stopped, and once until the stop is given up"


@pytest.mark.parametrize(("text", "least_s"), [("R500", 0.05), ("F800 0", 1.0)])
async def test_a_motion_is_looked_at_no_sooner_than_it_has_surely_begun(text: str, least_s: float) -> None:
    """789A-4: a search for home that is looked at at once counts as ended."""
    async with bench(home=300) as (line, far, _):
        await MOTIONS[text](line.axis("A"))
        entries = [(entry.text, entry.at) for entry in far.log if entry.kind is LogKind.COMMAND]
        begun = next(place for place, (command, _) in enumerate(entries) if command == text)
        assert least_s <= entries[begun + 1][1] - entries[begun][1] < least_s + 0.1


async def test_a_hunt_is_waited_for() -> None:
    async with bench(hunt_time_s=2) as (line, _, _):
        result = await line.axis("A").move_to(500)
        assert result.duration_s > 2


async def test_noise_between_exchanges_harms_no_move() -> None:
    async with bench() as (line, far, cable):
        cable.at("AZ\n", lambda: asyncio.get_running_loop().call_later(0.02, far.inject, b"\xffzap"), times=3)
        assert (await line.axis("A").move_to(3000)).last_position == 3000
        assert line.stats.strays == 3


async def test_a_line_that_babbles_stops_nobody_but_is_told() -> None:
    async with bench(SmcSettings(in_doubt_after_s=3), fails_to_close=True, axes="AB") as (line, far, _):
        move = line.axis("A").move_to(8000)
        await move.accepted
        loop = asyncio.get_running_loop()
        for number in range(4000):
            loop.call_later(0.002 * number, far.inject, b"R5\n^0"[number % 5 : number % 5 + 1])
        result = await outcome(move)
        assert isinstance(result, (MoveInDoubtError, MoveStoppedError, MoveResult))
        assert len(commands(far, "A")) == commands(far, "A").count("R8000") == 1 or "damaged" in str(result)
        await asyncio.sleep(10)
        if line.axis("A")._motion._memory.doubt:
            await line.axis("A").reconcile()
        await line.axis("A").move_by(10)


# Raw -----------------------------------------------------------------------------------------------------------------


async def test_a_raw_motion_is_not_watched_but_stopped_when_the_block_is_left() -> None:
    async with bench() as (line, far, _):
        assert await line.axis("A").raw("M700") == ""
        await asyncio.sleep(1)
        assert far.axes["A"].moving
    assert not far.axes["A"].moving


async def test_a_raw_motion_that_was_damaged_is_stopped_and_leaves_doubt() -> None:
    async with bench() as (line, far, cable):
        axis = line.axis("A")
        cable.at("AM70", lambda: far.lose_next_echo("A"))
        error = await ending(axis.raw("M700"))
        assert isinstance(error, (AnswerTimeoutError, MoveStoppedError))
        await asyncio.sleep(1)
        assert commands(far) == ["M70"]
        assert not far.axes["A"].moving
        if axis._motion._memory.doubt:
            with pytest.raises(MoveInDoubtError):
                axis.move_by(1)
            await axis.reconcile()
        await axis.move_by(100)


async def test_a_raw_motion_whose_name_was_not_heard_is_sent_again_once() -> None:
    async with bench() as (line, far, cable):
        cable.at("AZ\n", lambda: cable.at("A", lambda: far.lose_next_echo("A")))
        await line.axis("A").raw("R300")
        assert commands(far) == ["R300"]
        await asyncio.sleep(2)
        losing = [1]
        cable.at("AZ\n", lambda: cable.at("A", lambda: far.lose_next_echo("A", losing[0]), times=100))
        error = await ending(line.axis("A").raw("R400"))
        losing[0] = 0
        assert isinstance(error, AnswerTimeoutError)
        assert commands(far) == ["R300"]


@pytest.mark.parametrize("is_over", [True, False])
async def test_who_has_looked_at_a_raw_motion_that_is_over_is_not_stopped_for_it(is_over: bool) -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        await axis.raw("R500" if is_over else "M500")
        await asyncio.sleep(3)
        await axis.reconcile()
    assert ("@" in far.log.texts(LogKind.COMMAND)) is not is_over
    assert not far.axes["A"].moving


async def test_a_raw_motion_to_the_origin_is_no_reset() -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        await axis.move_to(300)
        await axis.raw("R0")
        await until(lambda: not far.axes["A"].moving)
        await axis.move_to(10)
        assert axis.lost_reference is None


async def test_raw_questions_and_settings() -> None:
    async with bench(width=0) as (line, far, _):
        axis = line.axis("A")
        assert await axis.raw("Z") == "0"
        assert await axis.raw(" V800 ") == ""
        assert far.axes["A"].parameters.slew_speed == 800
        for text in ("", "R" * 13, "R5\n", "Z1", "P0", "\x1b", "@\x03"):
            with pytest.raises(InvalidCommandError):
                await axis.raw(text)


async def test_a_stop_takes_back_a_raw_motion_that_waits() -> None:
    async with bench(axes="AB") as (line, far, _):
        axis = line.axis("A")
        reads = [asyncio.ensure_future(line.axis("B").raw("V500")) for _ in range(20)]
        raw = asyncio.ensure_future(axis.raw("R500"))
        await asyncio.sleep(0)
        await axis.stop()
        assert isinstance(await ending(raw), (MoveStoppedError, CompaxError))
        await asyncio.gather(*reads)
        assert commands(far, "A") == []


# Two callers, two axes -----------------------------------------------------------------------------------------------


async def test_two_callers_of_one_axis_get_their_own_answers() -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        move = axis.move_to(2000)
        others = await asyncio.gather(*(axis.position() for _ in range(20)), *(axis.status() for _ in range(20)))
        assert all(isinstance(each, float) for each in others[:20])
        assert all(hasattr(each, "raw") for each in others[20:])
        await move
        assert commands(far) == ["R2000"]


async def test_a_dead_axis_does_not_keep_the_other_from_moving() -> None:
    async with bench(axes="A", connects="A") as (line, _, _):
        line.axis("B")
        dead = asyncio.ensure_future(line.axis("B").move_to(100))
        result = await line.axis("A").move_to(1000)
        assert result.last_position == 1000
        error = await ending(dead)
        assert isinstance(error, AnswerTimeoutError)
        assert "is there an axis of that name" in str(error)
        assert "Upper and lower case" in str(error)


@pytest.mark.parametrize("steps", range(0, 60, 3))
async def test_a_task_that_is_cancelled_at_any_moment_leaves_a_line_that_works(steps: int) -> None:
    async with bench(axes="AB", home=-50) as (line, far, _):

        async def work() -> None:
            axis = line.axis("A")
            await axis.move_to(40)
            await axis.settings.write(slew_speed_steps_s=2000)
            await axis.home(500, direction=1)
            await axis.raw("R30")

        task = asyncio.ensure_future(work())
        for _ in range(steps * 20):
            await asyncio.sleep(0)
        await asyncio.sleep(0.0013 * steps)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await asyncio.sleep(1)
        assert not far.axes["A"].moving
        await line.axis("B").move_to(50)
        assert isinstance(await line.axis("A").position(), float)
        for text in {*commands(far, "A")} - {"V2000"}:
            assert commands(far, "A").count(text) == 1


async def test_a_detached_move_goes_on_alone() -> None:
    async with bench() as (line, far, _):
        move = line.axis("A").move_to(3000, on_cancel="detach")
        await move.accepted
        move.cancel()
        await asyncio.sleep(5)
        assert far.axes["A"].position == 3000


async def test_leaving_the_block_stops_what_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    async with bench(axes="AB") as (line, far, _):
        moves: list[Any] = [line.axis(name).move_to(90_000) for name in "AB"]
        await asyncio.gather(*(move.accepted for move in moves))
    assert not any(axis.moving for axis in far.axes.values())
    for move in moves:
        assert isinstance(move.exception(), MoveStoppedError)


async def test_a_stop_of_an_axis_that_stands_is_harmless() -> None:
    async with bench() as (line, far, _):
        await line.axis("A").stop()
        await line.stop()
        assert commands(far) == []


async def test_what_is_asked_for_during_a_stop_waits_for_its_end() -> None:
    async with bench() as (line, far, _):
        axis = line.axis("A")
        run = axis.run(3000)
        await run.accepted
        await asyncio.sleep(1)
        stop = asyncio.ensure_future(axis.stop())
        await asyncio.sleep(0)
        move = axis.move_to(0)
        raw = asyncio.ensure_future(axis.raw("V900"))
        await asyncio.gather(stop, move, raw)
        assert isinstance(await ending(run), MoveStoppedError)
        await until(lambda: not far.axes["A"].moving)
        assert commands(far)[0] == "M3000"
        await received(far, "R0")
