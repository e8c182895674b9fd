"""An axis's program memory, on the simulator: what is written, and what is left when the writing does not end well."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from typing import Any

import anyio
import pytest

from compax_aio.errors import (
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.simulator.server import line_named
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine
from compax_aio.smc.axis import SmcAxis
from compax_aio.smc.codecs import Listed
from compax_aio.smc.connecting import connect
from compax_aio.smc.party_line import PartyLine
from compax_aio.smc.profile import DCB_274
from compax_aio.smc.settings import SmcSettings
from compax_aio.transports.loopback import listen

MANUAL = "O0\nR10000\nW0\nR-10000\nW0\nJ1 3\nR500\n"
"""The program on DCB p. 24."""
PLACES = (0, 1, 6, 9, 14, 17, 21)
SHORT = ("O0", "R300", "W0")
SHORT_AT = {0: "O0", 1: "R300", 6: "W0"}
OLD = ("R1000", "R2000", "R3000")
QUICK = SmcSettings(reconnect_first_s=0.05, listing_quiet_s=0.05)

Lines = tuple[PartyLine, SmcAxis, SimulatedPartyLine]


@asynccontextmanager
async def bench(settings: SmcSettings = QUICK, **knobs: Any) -> AsyncIterator[Lines]:
    """Connect to two axes, or to one in single mode; the first is programmed."""
    mode = knobs.setdefault("mode", "party")
    knobs.setdefault("axes", "A" if mode == "single" else "AB")
    far = line_named("x", Knobs(**knobs))
    axes = knobs["axes"] if mode == "party" else ()
    async with connect("sim://smc?name=x", name="x", mode=mode, axes=axes, settings=settings) as line:
        yield line, line.axis("" if mode == "single" else "A"), far


def now() -> float:
    return asyncio.get_running_loop().time()


def is_inside(far: SimulatedPartyLine, letter: str = "A") -> bool:
    """Say whether the axis is in program entry."""
    far.advance()
    return far._controllers[letter].machine.inserting is not None


def program(far: SimulatedPartyLine) -> dict[int, str]:
    """Read the program off the far end's memory."""
    listing = {}
    for line in far.axes["A"].listing:
        address, _, text = line.partition(" ")
        letter, *numbers = text.split(" ")
        listing[int(address)] = letter + " ".join(f"{float(each):g}" for each in numbers)
    return listing


def written(far: SimulatedPartyLine) -> list[str]:
    return far.log.texts(LogKind.WRITTEN)


def motions(far: SimulatedPartyLine) -> list[str]:
    return far.log.texts(LogKind.MOTION_STARTED)


async def until_inside(far: SimulatedPartyLine, instructions: int = 1) -> None:
    """Wait until the axis is in program entry, and has stored so many instructions."""
    async with asyncio.timeout(20):
        while not is_inside(far) or len(written(far)) < instructions:  # noqa: ASYNC110  # a log has no event
            await asyncio.sleep(0.001)


def characters(far: SimulatedPartyLine) -> int:
    return len(far.log.texts(LogKind.RECEIVED))


def at_character(far: SimulatedPartyLine, number: int, act: Callable[[], None]) -> None:
    """Do something when the host's character of that number, from now on, is about to arrive."""
    receive, count = far.receive, 0

    def counted(data: bytes, now: float) -> None:
        nonlocal count
        for byte in data:
            if count == number:
                act()
            count += 1
            receive(bytes((byte,)), now)

    far.receive = counted  # type: ignore[method-assign]


async def ending(work: Any) -> BaseException | None:
    """Return how it ends."""
    try:
        await work
    except (CompaxError, asyncio.CancelledError) as error:
        return error
    return None


# Writing -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["party", "single", "daisy"])
async def test_a_program_lies_where_the_manual_has_it(mode: str) -> None:
    seen: list[tuple[int, int]] = []
    async with bench(mode=mode) as (_, axis, far):
        listed = await axis.program.write(MANUAL, on_progress=lambda *done: seen.append(done))
        assert listed == tuple(map(Listed, PLACES, MANUAL.split("\n")))
        assert tuple(program(far)) == PLACES
        assert seen == [(done, 7) for done in range(1, 8)]
        assert far.axes["A"].memory_writes == 7
        assert not is_inside(far)
        assert await axis.program.list() == listed
        assert motions(far) == []


async def test_a_program_is_laid_out_before_a_byte_is_sent() -> None:
    async with bench() as (_, axis, far):
        before = characters(far)
        for bad in ("R10000\nX\n", "R1\nJ7 3\n", "", "; nothing\n", ["R1", "R99999999"]):
            with pytest.raises(InvalidCommandError):
                await axis.program.write(bad)
        with pytest.raises(InvalidCommandError):
            await axis.program.write("R1", at=-1)
        with pytest.raises(InvalidCommandError):
            await axis.program.edit(0, "Q")
        assert characters(far) == before


async def test_nothing_is_written_behind_the_end_of_the_memory() -> None:
    profile = replace(DCB_274, last_program_address=7)
    async with bench(replace(QUICK, profile=profile)) as (_, axis, far):
        with pytest.raises(InvalidCommandError, match="R-10000 would begin at 9"):
            await axis.program.write(MANUAL)
        assert written(far) == []


async def test_nothing_is_written_that_is_there_already() -> None:
    async with bench() as (_, axis, far):
        first = await axis.program.write(MANUAL)
        begun = far.log.texts(LogKind.COMMAND).count("P0")
        assert await axis.program.write(MANUAL) == first
        assert await axis.program.edit(9, "R -10000.00") == first
        assert far.axes["A"].memory_writes == 7
        assert far.log.texts(LogKind.COMMAND).count("P0") == begun


async def test_writing_begins_where_the_program_differs() -> None:
    async with bench() as (_, axis, far):
        await axis.program.write(MANUAL)
        await axis.program.write(MANUAL.replace("J1 3", "J1 4"))
        assert written(far)[7:] == ["17: J1 4", "21: R500"]


async def test_a_shorter_program_is_ended_where_it_ends_and_what_is_left_is_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with bench() as (_, axis, far):
        await axis.program.write(MANUAL)
        listed = await axis.program.write(MANUAL.partition("W0")[0])
        assert written(far)[7:] == ["1: R10000"]
        assert len(listed) == 7
    assert "'W0' at 6 is left of another one" in caplog.text


async def test_a_program_further_on_is_none_that_is_left_of_this_one(caplog: pytest.LogCaptureFixture) -> None:
    async with bench() as (_, axis, _):
        await axis.program.write(["R1", "R2"], at=0)
        await axis.program.edit(0, "R3")
    assert caplog.text == ""


async def test_without_verification_nothing_is_listed() -> None:
    async with bench() as (_, axis, far):
        assert await axis.program.write(SHORT, verify=False) == tuple(Listed(*each) for each in SHORT_AT.items())
        assert await axis.program.write(SHORT, verify=False)
        assert "Q" not in far.log.texts(LogKind.COMMAND)
        assert far.axes["A"].memory_writes == 6
        assert not is_inside(far)


async def test_an_axis_that_is_not_known_to_list_is_written_on_request_only() -> None:
    profile = replace(DCB_274, commands=DCB_274.commands - {"Q"})
    async with bench(replace(QUICK, profile=profile)) as (_, axis, far):
        before = characters(far)
        with pytest.raises(InvalidCommandError, match="verify=False"):
            await axis.program.write(SHORT)
        assert characters(far) == before
        await axis.program.write(SHORT, verify=False)
        assert program(far) == SHORT_AT


async def test_an_axis_that_lists_something_else_is_told_with_both() -> None:
    async with bench(instruction_bytes="R4") as (_, axis, far):
        error = await ending(axis.program.write(SHORT))
        assert isinstance(error, RestoreIncompleteError)
        assert "'W0' at 5 where W0 at 6 was written" in str(error)
        assert error.kind == "program"
        assert error.applied == {0: (None, "O0"), 1: (None, "R300")}
        assert error.uncertain == {6: (None, "W0")}
        assert error.received == "0 O0 / 1 R300 / 5 W0"
        assert not is_inside(far)


async def test_lengths_that_no_page_has_do_not_keep_a_program_from_being_written() -> None:
    profile = replace(DCB_274, commands=DCB_274.commands | {"V"})
    async with bench(replace(QUICK, profile=profile)) as (_, axis, _):
        listed = await axis.program.write("V500\nR100\nJ0 2\n")
        assert [each.address for each in listed] == [0, 5, 10]
        assert await axis.program.write("V500\nR100\nJ0 3\n") != listed


async def test_no_program_is_written_where_trouble_with_another_axis_would_end_the_entry() -> None:
    async with bench(replace(QUICK, cancel_with="escape")) as (_, axis, far):
        for work in (axis.program.write(SHORT), axis.program.edit(0, "R1")):
            with pytest.raises(InvalidCommandError, match="cancel_with"):
                await work
        assert "P0" not in far.log.texts(LogKind.COMMAND)


# Editing -------------------------------------------------------------------------------------------------------------


async def test_alone_an_instruction_of_the_same_length_is_exchanged_by_itself() -> None:
    async with bench(mode="single") as (_, axis, far):
        await axis.program.write(MANUAL)
        listed = await axis.program.edit(9, "R-500")
        assert Listed(9, "R-500") in listed
        assert written(far)[7:] == ["9: R-500"]
        assert far.log.texts(LogKind.COMMAND).count("P0") == 1  # ended by ESC, which is no end of a program
        assert LogKind.ABORT in {entry.kind for entry in far.log}
        assert not is_inside(far)


@pytest.mark.parametrize("mode", ["party", "daisy"])
async def test_on_a_shared_line_no_axis_is_aborted_for_an_edit(mode: str) -> None:
    async with bench(mode=mode, instruction_time_s=0.001) as (line, axis, far):
        await axis.program.write(MANUAL)
        other = line.axis("B").move_to(3000)
        listed = await axis.program.edit(9, "R-500")
        assert Listed(9, "R-500") in listed
        assert written(far)[7:] == ["9: R-500", "14: W0", "17: J1 3", "21: R500"]
        assert (await other).last_position == 3000


async def test_an_instruction_of_another_length_moves_what_follows_and_jumps_with_it() -> None:
    async with bench() as (_, axis, _):
        await axis.program.write("R1\nR2\nJ5 2\n")
        listed = await axis.program.edit(0, "O")
        assert listed[:3] == (Listed(0, "O0"), Listed(1, "R2"), Listed(6, "J1 2"))


async def test_an_edit_where_nothing_begins_writes_nothing() -> None:
    async with bench() as (_, axis, far):
        await axis.program.write(SHORT)
        with pytest.raises(InvalidCommandError, match="no instruction begins at 2"):
            await axis.program.edit(2, "R1")
        assert far.axes["A"].memory_writes == 3
        await axis.move_by(1)


# Beside motion -------------------------------------------------------------------------------------------------------


async def test_nothing_is_written_into_an_axis_that_moves() -> None:
    async with bench() as (_, axis, far):
        move = axis.run(500)
        await move.accepted
        for work in (axis.program.write(SHORT), axis.program.edit(0, "R1"), axis.program.list()):
            with pytest.raises(MoveActiveError):
                await work
        move.cancel()
        far.axes["A"].jog(5000)
        await axis.stop()
        far.axes["A"].jog(5000)
        with pytest.raises(MoveActiveError, match="moves"):
            await axis.program.write(SHORT)
        assert written(far) == []


async def test_meanwhile_no_motion_begins_and_questions_wait() -> None:
    async with bench(baudrate=9600) as (line, axis, far):
        writing = asyncio.ensure_future(axis.program.write(MANUAL))
        await until_inside(far)
        with pytest.raises(MoveActiveError, match="being written"):
            axis.move_to(100)
        with pytest.raises(MoveActiveError, match="being written"):
            await axis.program.write(SHORT)
        with pytest.raises(MoveActiveError, match="being written"):
            await axis.set_origin()
        position = asyncio.ensure_future(axis.position())
        assert await line.axis("B").position() == 0.0
        assert is_inside(far)
        assert not position.done()
        assert len(await writing) == 7
        assert await position == 0.0
        assert not far.log.texts(LogKind.REFUSED)
        await axis.move_to(10)


async def test_a_program_runs_and_what_it_sets_is_not_known_any_more() -> None:
    async with bench() as (_, axis, far):
        await axis.settings.write(slew_speed_steps_s=2000)
        await axis.program.write("R100\nW0\nR250\nW0\n")
        result = await axis.program.run(timeout_s=60)
        assert result.last_position == 250
        assert axis.settings.known.slew_speed_steps_s is None
        assert motions(far) == ["R 100.00", "R 250.00"]


async def test_what_is_set_while_a_program_runs_is_not_known_either() -> None:
    async with bench() as (_, axis, _):
        await axis.program.write("R100\nW0\n")
        run = axis.program.run()
        await run.accepted
        axis._copy.note_written("slew_speed_steps_s", 2000)
        await run
        assert axis.settings.known.slew_speed_steps_s is None


# Trouble -------------------------------------------------------------------------------------------------------------

TROUBLE: dict[str, Callable[[SimulatedPartyLine], None]] = {
    "lost echo": lambda far: far.lose_next_echo("A"),
    "wrong echo": lambda far: far.garble_next_echo("A"),
    "lost character": lambda far: far.lose_next_character(),
    "wrong character": lambda far: far.flip_next_character(1),
    "high bit": lambda far: far.flip_next_character(6),
}


async def check_outcome(line: PartyLine, axis: SmcAxis, far: SimulatedPartyLine, error: BaseException | None) -> None:
    """Check that what was claimed is true, and that the axis is where it is said to be."""
    await asyncio.sleep(2)  # until the line was cleared
    assert len(set(written(far)[len(OLD) :])) == len(written(far)[len(OLD) :]), "an instruction was stored twice"
    listing = program(far)
    if error is None:
        assert {address: listing.get(address) for address in SHORT_AT} == SHORT_AT
    elif isinstance(error, RestoreIncompleteError):
        assert error.kind == "program"
        assert error.device == f"x axis {axis.name}".removesuffix(" axis ")
        for address, (_, new) in error.applied.items():
            if is_inside(far) or address not in listing:
                continue
            assert listing[address] == new
        assert set(error.applied) | set(error.not_applied) | set(error.uncertain) == set(SHORT_AT)
    else:
        assert isinstance(error, CompaxError)
        assert listing == {0: "R1000", 5: "R2000", 10: "R3000"}
    if is_inside(far):
        assert error is not None
        with pytest.raises(MoveInDoubtError, match="abort_all"):
            axis.move_by(5)
        await line.abort_all()
    elif axis._motion.may_be_in_entry:
        await axis.reconcile()
    assert not is_inside(far)
    far.receive = type(far).receive.__get__(far)  # type: ignore[method-assign]
    assert await axis.program.write(SHORT)
    assert program(far).items() >= SHORT_AT.items()
    await axis.move_by(-10)


@pytest.mark.parametrize("number", range(36))
@pytest.mark.parametrize("kind", TROUBLE)
@pytest.mark.parametrize("mode", ["party", "single"])
async def test_whatever_happens_to_a_character_what_is_claimed_is_true(mode: str, kind: str, number: int) -> None:
    async with bench(mode=mode) as (line, axis, far):
        await axis.program.write(OLD)
        at_character(far, number, lambda: TROUBLE[kind](far))
        error = await ending(axis.program.write(SHORT))
        assert motions(far) in ([], ["R"])  # of the damaged beginning, R or P
        await check_outcome(line, axis, far, error)


@pytest.mark.parametrize("bit", range(7))
@pytest.mark.parametrize("at", ["P", "0"])
async def test_a_beginning_that_is_damaged_is_not_followed_by_instructions(at: str, bit: int) -> None:
    async with bench() as (line, axis, far):
        await axis.move_to(500)
        receive, armed = far.receive, True

        def damaged(data: bytes, now: float) -> None:
            nonlocal armed
            if armed and data == at.encode():
                far.flip_next_character(bit)
                armed = False
            receive(data, now)

        far.receive = damaged  # type: ignore[method-assign]
        error = await ending(axis.program.write(SHORT, verify=False))
        assert isinstance(error, RestoreIncompleteError)
        assert error.applied == {}
        assert error.not_applied == tuple(SHORT_AT)
        assert "abort_all" in str(error)
        assert written(far) == []
        await asyncio.sleep(1)
        far.advance()
        assert not far.axes["A"].moving  # what it took for a motion was stopped
        with pytest.raises(MoveInDoubtError):
            await axis.program.list()
        await line.abort_all()
        await axis.program.write(SHORT)


async def test_a_beginning_whose_name_was_lost_is_said_again() -> None:
    async with bench() as (_, axis, far):
        at_character(far, 6, lambda: far.lose_next_echo("A"))
        await axis.program.write(SHORT, verify=False)
        assert program(far) == SHORT_AT
        assert far.log.texts(LogKind.TROUBLE) == ["echo 41 lost"]


async def test_a_beginning_that_is_refused_is_followed_by_nothing() -> None:
    async with bench(unknown="?") as (_, axis, far):
        machine = far._controllers["A"].machine
        understood = machine.understood

        def without_programs(text: str) -> Any:
            return understood("U1" if text.startswith("P") else text)

        machine.understood = without_programs  # type: ignore[method-assign]
        with pytest.raises(CommandRejectedError):
            await axis.program.write(SHORT, verify=False)
        assert motions(far) == []
        await axis.move_to(3)


async def test_an_axis_that_executes_what_it_should_store_is_found_out() -> None:
    """P that means nothing to it, and P0 at the end likewise: all in between is executed."""
    async with bench() as (_, axis, far):
        machine = far._controllers["A"].machine
        machine._effects = {**machine._effects, "P": lambda numbers, text: None}
        error = await ending(axis.program.write(["R20000"], verify=False))
        assert isinstance(error, RestoreIncompleteError)
        assert "executed" in str(error)
        await axis.stop()
        assert far.log.texts(LogKind.COMMAND, axis="A").count("@") == 1
        assert 0 < far.axes["A"].position < 20000
        await axis.move_to(0)


async def test_an_axis_that_resets_itself_in_the_middle_is_in_doubt() -> None:
    async with bench(reset_time_s=0.0001) as (line, axis, far):

        def progress(done: int, _: int) -> None:
            if done == 2:
                far.axes["A"].reset()

        error = await ending(axis.program.write(SHORT, on_progress=progress))
        assert isinstance(error, RestoreIncompleteError)
        assert is_inside(far)  # P0 has begun an entry
        assert "abort_all" in str(error)
        with pytest.raises(MoveInDoubtError):
            axis.move_by(5)
        await line.abort_all()
        assert not is_inside(far)
        await axis.program.write(SHORT)


async def test_a_refused_instruction_ends_the_entry() -> None:
    async with bench(program_size=16, unknown="?") as (_, axis, far):
        error = await ending(axis.program.write(MANUAL))
        assert isinstance(error, RestoreIncompleteError)
        assert isinstance(error.__cause__, CommandRejectedError)
        assert error.applied == {0: (None, "O0"), 1: (None, "R10000"), 6: (None, "W0"), 9: (None, "R-10000")}
        assert error.not_applied == (14, 17, 21)
        assert error.uncertain == {}
        assert not is_inside(far)
        await axis.move_to(3)


async def test_an_end_that_changes_nothing_leaves_the_axis_in_doubt() -> None:
    async with bench() as (line, axis, far):
        machine = far._controllers["A"].machine
        insert = machine.insert
        machine.insert = lambda what, text: None if what.letter == "P" else insert(what, text)  # type: ignore[method-assign]
        error = await ending(axis.program.write(SHORT))
        assert isinstance(error, RestoreIncompleteError)
        assert "end was not confirmed" in str(error)
        assert set(error.applied) == set(SHORT_AT)
        assert is_inside(far)
        with pytest.raises(MoveInDoubtError):
            await axis.program.list()
        with pytest.raises(UnexpectedAnswerError):
            await axis.reconcile()
        with pytest.raises(MoveInDoubtError):
            axis.move_to(1)
        await line.reset()
        assert not is_inside(far)
        await axis.home(500, direction=0)


async def test_an_axis_in_doubt_is_told_nothing_when_the_line_is_closed() -> None:
    far = line_named("y", Knobs())
    line = await connect("sim://smc?name=y", axes="A", settings=QUICK)
    machine = far._controllers["A"].machine
    machine.insert = lambda what, text: None  # type: ignore[method-assign]
    with suppress(RestoreIncompleteError):
        await line.axis("A").program.write(SHORT)
    before = characters(far)
    with pytest.raises(MoveInDoubtError, match="without a stop"):
        await line.close()
    assert characters(far) == before


async def test_an_error_of_the_callers_own_ends_the_entry() -> None:
    def progress(*_: int) -> None:
        raise ZeroDivisionError

    async with bench() as (_, axis, far):
        with pytest.raises(ZeroDivisionError) as caught:
            await axis.program.write(SHORT, on_progress=progress)
        assert "acknowledged: O0 at 0; not stored: R300 at 1" in caught.value.__notes__[0]
        assert not is_inside(far)
        assert written(far) == ["0: O0"]
        await axis.move_to(3)


async def test_a_listing_that_is_lost_leaves_what_was_acknowledged() -> None:
    async with bench() as (_, axis, far):

        def progress(done: int, of: int) -> None:
            if done == of:
                at_character(far, 8, lambda: far.stick(60))

        error = await ending(axis.program.write(SHORT, on_progress=progress))
        assert isinstance(error, RestoreIncompleteError)
        assert "not listed afterwards" in str(error)
        assert set(error.applied) == set(SHORT_AT)
        assert not is_inside(far)


# Stops ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["party", "single", "daisy"])
@pytest.mark.parametrize("tick", range(0, 420, 12))
async def test_a_stop_ends_the_entry_and_is_obeyed(mode: str, tick: int) -> None:
    async with bench(mode=mode) as (_, axis, far):
        writing = asyncio.ensure_future(ending(axis.program.write(MANUAL)))
        await asyncio.sleep(tick / 1000)
        asked_at = now()
        await axis.stop()
        assert now() - asked_at < 0.6
        assert far.log.texts(LogKind.COMMAND).count("@") == 1
        assert not any("@" in each for each in written(far))
        assert not is_inside(far)
        error = await writing
        if isinstance(error, RestoreIncompleteError):
            listing = program(far)
            assert all(listing[address] == new for address, (_, new) in error.applied.items())
            assert error.uncertain == {}
            assert len(written(far)) == len(error.applied)
        elif error is not None:
            assert isinstance(error, MoveStoppedError)
            assert written(far) == []
        assert motions(far) == []
        await axis.move_by(5)


async def test_a_stop_does_not_wait_for_the_rest_of_the_program() -> None:
    async with bench() as (_, axis, far):
        writing = asyncio.ensure_future(ending(axis.program.write(["R1000"] * 200)))
        await until_inside(far)
        asked_at = now()
        await axis.stop()
        assert now() - asked_at < 0.3
        error = await writing
        assert isinstance(error, RestoreIncompleteError)
        assert "its writing was stopped" in str(error)
        assert len(error.applied) == len(written(far)) < 4


@pytest.mark.parametrize("mode", ["party", "single", "daisy"])
@pytest.mark.parametrize("tick", range(0, 420, 14))
@pytest.mark.parametrize("way", ["abort_all", "reset"])
async def test_an_abort_ends_the_entry_for_certain_and_nothing_follows(mode: str, tick: int, way: str) -> None:
    async with bench(mode=mode, abort_echo="none") as (line, axis, far):
        writing = asyncio.ensure_future(ending(axis.program.write(MANUAL)))
        await asyncio.sleep(tick / 1000)
        if writing.done():
            return
        before = len(written(far))
        await (line.abort_all() if way == "abort_all" else line.reset())
        assert not is_inside(far)
        error = await writing
        assert isinstance(error, CompaxError) or not is_inside(far)
        assert len(written(far)) in {before, before + 1}
        assert motions(far) == []
        if isinstance(error, RestoreIncompleteError):
            assert "abort_all" not in str(error)
            assert all(program(far)[address] == new for address, (_, new) in error.applied.items())
        await axis.reconcile()
        await axis.program.write(SHORT)
        await axis.move_by(5)


async def test_an_abort_takes_back_what_waits_for_its_turn_on_the_line() -> None:
    """Behind ESC, it would be executed."""
    async with bench(baudrate=9600) as (line, axis, far):
        polling = [asyncio.ensure_future(endless(line.axis("B").position)) for _ in range(3)]
        writing = asyncio.ensure_future(ending(axis.program.write(MANUAL, verify=False)))
        await until_inside(far)
        for _ in range(12):
            await asyncio.sleep(0.011)
            await line.abort_all()
        error = await writing
        assert isinstance(error, RestoreIncompleteError)
        assert motions(far) == []
        assert not is_inside(far)
        for each in polling:
            each.cancel()
        await asyncio.wait(polling)


async def endless(work: Callable[..., Any]) -> None:
    while True:
        with suppress(CompaxError):
            await work()
        await asyncio.sleep(0.001)


# Cancellation --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tick", range(0, 900, 11))
async def test_a_cancelled_writer_leaves_the_axis_outside_of_program_entry(tick: int) -> None:
    async with bench(baudrate=19200) as (_, axis, far):
        writing = asyncio.ensure_future(axis.program.write(SHORT))
        await asyncio.sleep(tick / 1000)
        if writing.done():
            return
        was_inside, before = is_inside(far), len(written(far))
        writing.cancel()
        error = await ending(writing)
        assert isinstance(error, asyncio.CancelledError)
        assert not is_inside(far)
        assert len(written(far)) in {before, before + 1}
        if was_inside:
            assert "the program is not complete, its writing was ended" in error.__notes__[0]
        await axis.move_by(5)
        await axis.program.write(SHORT)
        assert program(far) == SHORT_AT


async def test_a_scope_that_is_cancelled_leaves_the_axis_outside_too() -> None:
    async with bench() as (_, axis, far):
        with anyio.CancelScope() as scope:
            asyncio.get_running_loop().create_task(until_inside(far)).add_done_callback(lambda _: scope.cancel())
            await axis.program.write(MANUAL)
        assert scope.cancelled_caught
        assert not is_inside(far)
        assert 0 < len(written(far)) < 7
        await axis.move_by(5)


async def test_who_is_cancelled_again_and_again_still_ends_the_entry() -> None:
    async with bench() as (_, axis, far):
        writing = asyncio.ensure_future(axis.program.write(MANUAL))
        await until_inside(far)
        while not writing.done():
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                if task is writing or "carry_out" in repr(task):
                    task.cancel()
            await asyncio.sleep(0.001)
        error = await ending(writing)
        assert isinstance(error, asyncio.CancelledError)
        assert "acknowledged: O0 at 0" in error.__notes__[0]
        assert not is_inside(far)
        await axis.move_by(5)


# Lost lines ----------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def cable(far: SimulatedPartyLine) -> AsyncIterator[tuple[str, Callable[[], None]]]:
    """Serve the line; gives its URL, and what cuts whoever is connected."""
    connections: set[Connection] = set()
    line = DeviceLine.of(far)

    def cut() -> None:
        for connection in tuple(connections):
            connection.abort()

    with await listen("cable", lambda: Connection(line, connections)) as listener:
        yield listener.url, cut
        cut()


@pytest.mark.parametrize("tick", range(0, 260, 10))
async def test_a_line_that_is_lost_in_the_middle_leaves_the_axis_in_doubt(tick: int) -> None:
    far = SimulatedPartyLine(Knobs(axes="AB"))
    async with cable(far) as (url, cut), connect(url, name="x", axes="AB", settings=QUICK) as line:
        axis = line.axis("A")
        writing = asyncio.ensure_future(ending(axis.program.write(MANUAL)))
        await asyncio.sleep(tick / 1000)
        was_inside, before = is_inside(far), len(written(far))
        cut()
        error = await writing
        await asyncio.sleep(5)
        if error is None:  # asking waits for the line
            assert not was_inside
            return
        assert len(written(far)) - before <= 1
        if is_inside(far):
            assert isinstance(error, RestoreIncompleteError)
            assert isinstance(error.__cause__, ConnectionLostError)
            assert all(program(far)[address] == new for address, (_, new) in error.applied.items())
            assert not far.log.texts(LogKind.REFUSED)  # nobody looked at it when the line was back
            with pytest.raises(MoveInDoubtError, match="abort_all"):
                axis.move_by(5)
            await line.abort_all()
        elif axis._motion.may_be_in_entry:
            await axis.reconcile()
        assert not is_inside(far)
        assert motions(far) == []
        await axis.program.write(MANUAL)
        await axis.move_by(5)


# Decided on purpose --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [17, 23])
async def test_an_instruction_whose_name_was_lost_is_not_repeated(number: int) -> None:
    """The axis may have been reset: outside of program entry it would execute what comes now."""
    async with bench() as (_, axis, far):
        at_character(far, number, lambda: far.lose_next_echo("A"))
        error = await ending(axis.program.write(SHORT))
        assert isinstance(error, RestoreIncompleteError)
        assert error.uncertain == {}
        assert "echo 41 lost" in far.log.texts(LogKind.TROUBLE)
        assert len(written(far)) == len(error.applied) < 3
        assert not is_inside(far)
        assert await axis.program.write(SHORT)  # goes on from there
        assert [each.partition(":")[0] for each in written(far)] == ["0", "1", "6"]


async def test_whoever_sends_the_escape_nothing_follows_it() -> None:
    async with bench() as (line, axis, far):
        writing = asyncio.ensure_future(ending(axis.program.write(MANUAL)))
        await until_inside(far)
        await asyncio.sleep(0.003)
        line._line.link.preempt("\x1b")
        error = await writing
        assert isinstance(error, RestoreIncompleteError)
        assert "aborted" in str(error)
        await asyncio.sleep(1)  # until it was heard
        assert not is_inside(far)
        assert far.log.texts(LogKind.COMMAND).count("P0") == 1  # the beginning; outside, an end would begin another
        await axis.move_by(5)
