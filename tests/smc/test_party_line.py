"""A line with its axes: connected to, searched, stopped as a whole, reset, lost, closed."""

from __future__ import annotations

import asyncio

import pytest
from tests.smc.bench import bench, commands, ending, motions, now, outcome

from compax_aio.errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    MoveError,
    MoveStoppedError,
    UnexpectedAnswerError,
)
from compax_aio.simulator.smc import LogKind, SimulatedPartyLine
from compax_aio.smc.connecting import connect
from compax_aio.smc.events import AxesReset, ConnectionLost, ConnectionRestored, UnexpectedText
from compax_aio.smc.facts import POSSIBLE_NAMES, Mode
from compax_aio.smc.settings import SmcSettings

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def resets(far: SimulatedPartyLine) -> list[str]:
    far.advance()
    return far.log.texts(LogKind.RESET)


# Connecting ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 32])
async def test_every_axis_that_is_named_must_be_there(count: int) -> None:
    names = POSSIBLE_NAMES[:count]
    async with bench(axes=names) as (line, _, _):
        assert "".join(line.axes) == names
        assert line.is_open
        assert line.mode is Mode.PARTY
        assert repr(line) == f"<PartyLine bus {names!r} open>"
        await asyncio.gather(*(line.axis(name).position() for name in names))
        with pytest.raises(TypeError):
            line.axes["z"] = line.axis("A")  # type: ignore[index]
        if count == 32:
            with pytest.raises(InvalidCommandError, match="at most 32 axes"):
                line.axis("z")
    assert not line.is_open


async def test_an_axis_that_is_missing_fails_the_opening() -> None:
    with pytest.raises(AnswerTimeoutError) as caught:
        async with bench(axes="AC", connects="ABC"):
            pass
    assert "bus axis B: no echo of character 1 of 'B^', 'B'" in str(caught.value)
    assert "is there an axis of that name" in str(caught.value)


async def test_nobody_at_all_fails_the_opening_in_bounded_time() -> None:
    with pytest.raises(AnswerTimeoutError) as caught:
        async with bench(axes="A", connects="XYZ"):
            pass
    assert "check power, cable" in str(caught.value) or "is there an axis" in str(caught.value)
    assert now() < 15


async def test_without_axes_nothing_is_asked_and_a_scan_finds_all_whatever_gaps() -> None:
    async with bench(axes="AQz", connects="") as (line, far, cable):
        assert bytes(cable.typed) == b"\n"
        seen: list[tuple[str, bool]] = []
        assert await line.scan(on_each=lambda name, found: seen.append((name, found))) == ("A", "Q", "z")
        assert list(line.axes) == ["A", "Q", "z"]
        assert [name for name, _ in seen] == list(POSSIBLE_NAMES)
        assert [name for name, found in seen if found] == ["A", "Q", "z"]
        await line.axis("Q").move_to(100)
        assert commands(far) == ["R100"]
        assert await line.scan("BA") == ("A",)
        for names in ("A@", "AB\n", ["AB"]):
            with pytest.raises(InvalidCommandError):
                await line.scan(names)


async def test_a_scan_on_a_line_that_is_lost_says_so() -> None:
    async with bench(SmcSettings(reconnect=False), axes="AQ", connects="") as (line, _, cable):
        cable.at("C", cable.pull)
        assert isinstance(await ending(line.scan()), ConnectionLostError)


async def test_a_scan_takes_no_echo_without_an_answer_for_an_axis() -> None:
    """In a daisy chain everything comes back."""
    async with bench(axes="AB", mode="daisy") as (line, _, _):
        assert await line.scan("ABCD") == ("A", "B")


@pytest.mark.parametrize("name", ["", "AB", "@", "[", "_", " ", "\n", "é", 7, None])
async def test_what_can_be_no_name_is_refused_at_once(name: object) -> None:
    async with bench() as (line, _, cable):
        before = len(cable.typed)
        with pytest.raises(InvalidCommandError):
            line.axis(name)  # type: ignore[arg-type]
        assert len(cable.typed) == before


@pytest.mark.parametrize(
    ("mode", "axes"), [("single", "A"), ("party", "AA"), ("party", POSSIBLE_NAMES), ("daisy", "AC"), ("bus", "A")]
)
def test_a_line_that_cannot_be_is_refused_before_it_is_opened(mode: str, axes: str) -> None:
    with pytest.raises(InvalidCommandError):
        connect("loop://nowhere", mode=mode, axes=axes)  # type: ignore[arg-type]


@pytest.mark.parametrize("known", [True, False], ids=["named", "counted"])
@pytest.mark.parametrize("count", [1, 4, 26, 32])
async def test_a_daisy_chain_takes_its_names_when_it_is_connected_to(count: int, known: bool) -> None:
    """DCB p. 24; behind Z come other signs, which can be no names (DCB p. 23)."""
    names = POSSIBLE_NAMES[:count]
    async with bench(axes=names, mode="daisy", connects=None if known else "") as (line, far, _):
        assert "".join(line.axes) == names
        assert "".join(axis.name for axis in far.axes.values()) == names
        await line.axis(names[-1]).move_to(70)
        assert far.axes[names[-1]].position == 70


@pytest.mark.parametrize("axes", ["A", "ABC", "ABCDE", "BCD"])
async def test_a_daisy_chain_with_another_number_of_controllers_is_refused(axes: str) -> None:
    error: UnexpectedAnswerError | None = None
    try:
        async with bench(axes="ABCD", mode="daisy", connects=axes):
            pass
    except UnexpectedAnswerError as wrong:
        error = wrong
    assert error is not None
    assert "the chain has taken the names" in str(error)
    assert "reset() deals the names anew" in str(error)


@pytest.mark.parametrize("known", [True, False])
async def test_a_daisy_chain_that_has_its_names_is_counted_by_asking(known: bool) -> None:
    async with bench(axes="ABC", mode="daisy") as (line, far, cable):
        await line.axis("B").move_to(200)
        cable.pull()
        await asyncio.sleep(0.1)
        await cable.plug()
        await line.close()
        async with connect(cable.url, mode="daisy", axes="ABC" if known else "", name="again") as again:
            assert "".join(again.axes) == "ABC"
            assert again.axis("B").lost_reference is None
            assert await again.axis("B").position() == 200
        cable.pull()
        assert far.log.texts(LogKind.NAMED) == ["'A'", "'B'", "'C'"]
        await cable.plug()


@pytest.mark.parametrize("sign_on", ["max2000-1.15i", "ams-pre-1.14", "mcpherson-2.55"])
@pytest.mark.parametrize("prompt", ["framed", "bare"])
@pytest.mark.parametrize("backspace", ["back", "erase"])
async def test_a_single_axis_is_connected_to_however_it_talks(sign_on: str, prompt: str, backspace: str) -> None:
    async with bench(mode="single", sign_on=sign_on, prompt=prompt, backspace=backspace) as (line, far, _):
        axis = line.axis()
        assert axis.lost_reference is None, "where it was switched on is its origin until home() or set_origin()"
        assert (await axis.move_to(800)).last_position == 800
        assert far.axes["A"].name == "A", "no stray character has become its name"
        assert repr(axis) == "<SmcAxis bus>"
        assert line.stats.strays <= 1, "nothing but the sign-on is unexpected"
        with pytest.raises(InvalidCommandError):
            line.axis("A")
        with pytest.raises(InvalidCommandError):
            await line.scan("A")


async def test_a_single_axis_that_wakes_up_just_now_gets_no_name_by_accident() -> None:
    """DCB p. 23: the first character after a reset is the name, unless it is a blank."""
    for after_s in (0.0, 0.05, 0.1, 0.14, 0.149, 0.16, 0.3, 0.44):
        async with bench(mode="single") as (line, far, cable):
            cable.pull()
            far.power_cycle()
            await asyncio.sleep(after_s)
            await cable.plug()
            await asyncio.sleep(3)
            await line.axis().position()
            assert far.axes["A"].name == "A", after_s


# Stopping ------------------------------------------------------------------------------------------------------------


async def test_all_axes_are_stopped_softly() -> None:
    async with bench(axes="ABC") as (line, far, _):
        moves = [line.axis(name).run(1500) for name in "AB"] + [line.axis("C").move_to(100_000)]
        await asyncio.gather(*(move.accepted for move in moves))
        await asyncio.sleep(0.5)
        await line.stop()
        assert not any(axis.moving for axis in far.axes.values())
        for move in moves:
            assert isinstance(await ending(move), MoveStoppedError)
        assert far.log.texts(LogKind.MOTION_ENDED) == ["stop"] * 3


async def test_an_abort_stops_axes_that_nobody_here_knows() -> None:
    async with bench(axes="ABC", connects="A") as (line, far, _):
        far.axes["C"].jog(50_000)
        run = line.axis("A").run(1500)
        await run.accepted
        await asyncio.sleep(1)
        await line.abort_all()
        assert far.log.texts(LogKind.MOTION_ENDED) == ["abort", "abort"]
        error = await ending(run)
        assert isinstance(error, MoveStoppedError)
        assert "every axis was stopped without a ramp (ESC)" in str(error)
        assert "lost steps" in str(error)
        await line.axis("A").move_by(10)


@pytest.mark.parametrize("moment", [n / 1000 for n in range(1, 41, 3)])
async def test_an_abort_at_any_moment_is_written_at_once(moment: float) -> None:
    async with bench(axes="AB", baudrate=9600) as (line, far, cable):
        moves = [asyncio.ensure_future(outcome(line.axis(name).move_to(90_000))) for name in "AB"]
        await asyncio.sleep(moment)
        asked_at, before = now(), len(cable.typed)
        abort = asyncio.ensure_future(line.abort_all())
        await asyncio.sleep(0.0001)
        assert cable.typed[before : before + 1] == b"\x1b"
        assert now() - asked_at < 0.001
        await abort
        assert not any(axis.moving for axis in far.axes.values())
        for error in await asyncio.gather(*moves):
            assert isinstance(error, CompaxError)


async def test_an_abort_in_single_mode() -> None:
    async with bench(mode="single") as (line, far, _):
        run = line.axis().run(2000)
        await run.accepted
        await line.abort_all()
        assert far.log.texts(LogKind.MOTION_ENDED) == ["abort"]
        assert isinstance(await ending(run), MoveStoppedError)
        await line.axis().move_by(30)


async def test_an_abort_of_a_line_that_is_lost_is_told_and_what_moves_is_stopped_when_it_is_back() -> None:
    async with bench(axes="AB") as (line, far, cable):
        run = line.axis("A").run(1000)
        await run.accepted
        cable.pull_and_plug(1.0)
        await asyncio.sleep(0.1)
        assert isinstance(await ending(line.abort_all()), ConnectionLostError)
        assert not far.axes["A"].moving
        assert isinstance(await ending(run), MoveStoppedError)


async def test_a_stop_that_fails_on_one_axis_stops_the_others() -> None:
    settings = SmcSettings(stop_timeout_s=1, standstill_timeout_s=2)
    async with bench(settings, axes="AB", fails_to_close=True) as (line, far, _):
        moves = [line.axis(name).run(1000) for name in "AB"]
        await asyncio.gather(*(move.accepted for move in moves))
        far.axes["A"]._controller.switch_off()
        error = await ending(line.stop())
        assert "was not acknowledged" in str(error)
        assert error.hint is not None
        assert "emergency stop" in error.hint
        assert not far.axes["B"].moving
        await asyncio.gather(*moves, return_exceptions=True)


# Reset ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["party", "daisy", "single"])
async def test_a_reset_ends_motions_and_costs_references(mode: str) -> None:
    axes = "A" if mode == "single" else "AB"
    async with bench(axes=axes, mode=mode) as (line, far, _):
        events = line.events()
        axis = line.axis("" if mode == "single" else "A")
        await axis.move_to(500)
        run = axis.run(1000)
        await run.accepted
        await asyncio.sleep(1)
        await line.reset()
        assert resets(far) == ["^C"] * len(axes)
        assert isinstance(await ending(run), MoveStoppedError)
        assert axis.lost_reference
        with pytest.raises(MoveError, match="means nothing"):
            axis.move_to(3)
        await axis.move_by(20)
        await axis.set_origin()
        await axis.move_to(3)
        assert "".join(each.name for each in far.axes.values()) == axes
        told = await anext(events)
        while not isinstance(told, AxesReset):
            told = await anext(events)
        assert told.axes == ("" if mode == "single" else axes)


@pytest.mark.parametrize("gap_s", [0.0, 0.02, 0.06, 0.3, 1.04, 1.06, 1.2])
@pytest.mark.parametrize("mode", ["party", "daisy", "single"])
@pytest.mark.parametrize("second", ["reset", "abort_all"])
async def test_what_overtakes_a_reset_does_not_undo_it(mode: str, gap_s: float, second: str) -> None:
    async with bench(axes="A" if mode == "single" else "AB", mode=mode) as (line, far, _):
        first = asyncio.ensure_future(line.reset())
        await asyncio.sleep(gap_s)
        await asyncio.gather(first, getattr(line, second)())
        assert resets(far)[:1] == ["^C"], "who asked for a reset has had one"
        assert [axis.name for axis in far.axes.values()] == list(far.axes), "and no name was made of it"
        await line.axis("" if mode == "single" else "A").move_by(50)


async def test_an_axis_that_resets_itself_alone_is_noticed() -> None:
    async with bench(mode="single") as (line, far, _):
        await line.axis().move_to(300)
        events = line.events()
        far.axes["A"].reset()
        await asyncio.sleep(0.5)
        await outcome(line.axis().position())
        await asyncio.sleep(2)
        with pytest.raises(MoveError, match=r"MAX-2000 v1\.15i.*came, as after a reset"):
            await line.axis().move_to(400)
        assert commands(far) == ["R300"]
        assert far.axes["A"].name in {"A", "Z"}
        assert isinstance(await anext(events), UnexpectedText)


async def test_a_chain_that_lost_its_power_takes_its_names_again_and_that_is_told() -> None:
    async with bench(axes="ABCD", mode="daisy") as (line, far, _):
        await line.axis("C").move_to(300)
        far.power_cycle()
        await asyncio.sleep(1)
        result = await outcome(line.axis("C").move_to(400))
        assert isinstance(result, MoveError)
        assert line.axis("A").lost_reference == "the names of the chain were dealt anew, as after a reset"
        assert [axis.name for axis in far.axes.values()] == list("ABCD")
        assert motions(far) == ["R300"]


@pytest.mark.parametrize("reset", "ABCD")
@pytest.mark.parametrize("asked", "ABCD")
async def test_a_controller_of_a_chain_that_was_reset_alone_never_makes_another_move(reset: str, asked: str) -> None:
    """It takes the name of whoever is addressed, and would go where that one is sent."""
    async with bench(axes="ABCD", mode="daisy", fails_to_close=True) as (line, far, _):
        await line.axis("A").position()
        far.axes[reset].reset()
        await asyncio.sleep(1)
        for _ in range(3):
            await outcome(line.axis(asked).move_by(100))
        moved = {letter for letter, axis in far.axes.items() if axis.place}
        assert moved <= {asked}
        assert len(motions(far)) <= 3
        await line.reset()
        assert [axis.name for axis in far.axes.values()] == list("ABCD")
        await line.axis("D").move_by(70)
        assert far.axes["D"].position == 70


async def test_a_stop_deals_no_names_in_a_chain_that_was_reset() -> None:
    async with bench(axes="ABCD", mode="daisy") as (line, far, _):
        far.power_cycle()
        await asyncio.sleep(1)
        await line.axis("C").stop()
        assert [axis.name for axis in far.axes.values()] == list("ABCD")


# Naming --------------------------------------------------------------------------------------------------------------


async def test_a_single_axis_gets_a_name() -> None:
    async with bench(mode="single") as (line, far, _):
        axis = line.axis()
        await axis.move_to(100)
        await line.name_axis("k")
        assert far.axes["A"].stored_name == far.axes["A"].name == "k"
        assert resets(far) == ["^C", "^C"]
        assert axis.lost_reference
        await axis.move_by(10)


@pytest.mark.parametrize("name", ["", "AB", "@", " ", "\n"])
async def test_what_can_be_no_name_is_not_stored(name: str) -> None:
    async with bench(mode="single") as (line, far, _):
        with pytest.raises(InvalidCommandError):
            await line.name_axis(name)
        assert resets(far) == []


async def test_an_axis_is_named_in_single_mode_alone_and_while_it_stands() -> None:
    async with bench() as (line, far, _):
        with pytest.raises(InvalidCommandError, match="single mode"):
            await line.name_axis("B")
        assert resets(far) == []
    async with bench(mode="single") as (line, far, _):
        run = line.axis().run(1000)
        await run.accepted
        with pytest.raises(MoveError):
            await line.name_axis("B")
        assert resets(far) == []
        await run.stop()
        await outcome(run)


@pytest.mark.parametrize("after_s", [0.01, 0.06, 0.5, 1.07, 1.1, 1.2, 1.5, 1.8, 2.1])
async def test_an_abort_in_the_middle_of_naming_stores_no_other_name(after_s: float) -> None:
    async with bench(mode="single") as (line, far, _):
        naming = asyncio.ensure_future(outcome(line.name_axis("k")))
        await asyncio.sleep(after_s)
        await outcome(line.abort_all())
        result = await naming
        stored = far.axes["A"].stored_name
        if isinstance(result, CompaxError):
            assert result.hint is not None
            assert stored == "A" or result.hint.startswith("'k' may be stored or not")
        else:
            assert stored == "k"
        await line.reset()
        await line.axis().move_by(5)


async def test_a_name_that_did_not_arrive_is_not_stored() -> None:
    async with bench(mode="single") as (line, far, cable):
        inner = cable.carry
        typed: list[int] = []

        def carry(byte: int) -> None:
            typed.append(byte)
            if typed[-2:] == [0x03, ord("k")]:
                far.flip_next_character(0)
            inner(byte)

        cable.carry = carry  # type: ignore[method-assign]
        error = await ending(line.name_axis("k"))
        assert isinstance(error, UnexpectedAnswerError)
        assert "shows the name 'j', not 'k'" in str(error)
        assert error.hint == "nothing was stored; try again when the line is sound"
        await asyncio.sleep(3)
        assert far.axes["A"].stored_name == far.axes["A"].name == "A"


# Lines that are lost -------------------------------------------------------------------------------------------------


async def test_a_line_that_was_lost_comes_back_and_says_so() -> None:
    async with bench(axes="AB") as (line, far, cable):
        await line.axis("A").move_to(100)
        await asyncio.sleep(0.01)  # its end is told
        events = line.events()
        cable.pull_and_plug(0.5)
        assert await line.axis("A").position() == 100, "a question waits for the line"
        assert isinstance(await anext(events), ConnectionLost)
        restored = await anext(events)
        assert isinstance(restored, ConnectionRestored)
        assert restored.signs_of_restart == ()
        assert line.stats.reconnects == 1
        cable.pull()
        far.power_cycle()
        await asyncio.sleep(0.5)
        await cable.plug()
        await line.axis("A").position()
        assert isinstance(await anext(events), ConnectionLost)
        reset, restored = await anext(events), await anext(events)
        assert isinstance(reset, AxesReset)
        assert reset.axes == "A"
        assert isinstance(restored, ConnectionRestored)
        assert "A: it stood at 100.00 steps and counts 0 now" in restored.signs_of_restart[0]


async def test_an_axis_that_is_missing_does_not_keep_the_line_from_coming_back() -> None:
    async with bench(axes="ABCDEFGHI") as (line, far, cable):
        cable.pull()
        for letter in "ABCDEFGH":
            far.axes[letter]._controller.switch_off()
        await cable.plug()
        await asyncio.sleep(60)
        assert line.is_open
        await line.axis("I").move_to(90)
        assert isinstance(await ending(line.axis("A").position()), AnswerTimeoutError)


@pytest.mark.parametrize("call", ["position", "status", "set_origin", "stop"])
async def test_without_reconnecting_a_lost_line_is_over(call: str) -> None:
    async with bench(SmcSettings(reconnect=False), fails_to_close=True) as (line, _, cable):
        cable.pull()
        await asyncio.sleep(0.1)
        error = await ending(getattr(line.axis("A"), call)())
        assert isinstance(error, ConnectionLostError)
        assert not line.is_open


# Settings and the rest -----------------------------------------------------------------------------------------------


async def test_settings_are_written_to_the_axis_that_is_meant() -> None:
    async with bench(axes="AB") as (line, far, _):
        await line.axis("B").settings.write(slew_speed_steps_s=1234)
        assert far.axes["B"].parameters.slew_speed == 1234
        assert far.axes["A"].parameters.slew_speed == 3000
        assert line.axis("B").settings.known.slew_speed_steps_s == 1234
        assert line.axis("A").settings.known.slew_speed_steps_s is None
        await line.reset()
        assert line.axis("B").settings.known.slew_speed_steps_s is None


async def test_callers_of_several_axes_take_turns() -> None:
    async with bench(axes="ABC") as (line, far, _):
        far.log.clear()
        await asyncio.gather(
            *(line.axis("A").raw("V500") for _ in range(6)), line.axis("B").raw("V500"), line.axis("C").raw("V500")
        )
        order = "".join(entry.axis for entry in far.log if entry.kind is LogKind.COMMAND)
        assert order[:4] in {"ABCA", "AABC"}


async def test_closing_is_harmless_when_repeated_and_carried_through_when_cancelled() -> None:
    async with bench(axes="AB") as (line, far, _):
        run = line.axis("A").run(2000)
        await run.accepted
        await asyncio.sleep(1)
        closing = asyncio.ensure_future(line.close())
        await asyncio.sleep(0)
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        assert not far.axes["A"].moving
        assert not line.is_open
        await line.close()
        assert isinstance(await ending(run), CompaxError)


async def test_a_block_that_raises_stops_what_moves() -> None:
    async with bench() as (line, far, _):

        async def work() -> None:
            async with line:
                line.axis("A").run(500)
                await asyncio.sleep(1)
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            await work()
        assert motions(far) == ["M500"]
        assert not far.axes["A"].moving
