"""A person talks to a drive: lines, motion, stops, and what the drive does unasked, above what is being typed."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Any

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput
from tests.cli.shelling.person import CTRL_C, CTRL_D, CTRL_X, ENTER, Person, sitting, until
from tests.promises.cable import Cable

from compax_aio import CommandRejectedError, Drive, DriveSettings
from compax_aio.cli.app import app
from compax_aio.simulator.compax import LogKind

PASTE = "\x1b[200~{}\x1b[201~"
SLOW: dict[str, Any] = {"nominal_speed": 10.0}
"""An axis on which there is time to type something."""


# Lines


async def test_an_answer_stands_beside_what_it_means() -> None:
    async with sitting() as person:
        await person.say("s16", "S016: 11010000", "no_fault, no_warning, ready_for_start")
        await person.say("P14", "P014: 1.000", "positioning window in units")


async def test_what_no_table_has_is_not_sent() -> None:
    async with sitting() as person:
        before = person.lines()
        await person.say("parms 20", "no word of this shell", "raw parms 20")
        assert person.lines() == before


async def test_raw_sends_what_no_table_has() -> None:
    async with sitting() as person:
        await person.say("raw foo", "E90")
        assert person.lines()[-1] == "FOO"


async def test_what_waits_behind_a_line_that_fails_is_dropped() -> None:
    async with sitting(answer_time_s=0.5) as person:
        await person.say("S200")
        await person.say("SD50", "E90", "not sent: SD50; the line before it has failed")
        assert "SD50" not in person.lines()


async def test_help_waits_for_no_line() -> None:
    async with sitting(answer_time_s=0.8) as person:
        await person.say("S1")
        await person.say("help E55", "emergency stop")
        assert "S001" not in person.seen
        await person.sees("S001: 0.00")


async def test_an_empty_line_says_nothing() -> None:
    async with sitting() as person:
        before = person.lines()
        await person.say("   ")
        assert "Error" not in await person.quiet()
        assert person.lines() == before


async def test_lines_that_are_pasted_go_out_together_or_not_at_all() -> None:
    async with sitting() as person:
        before = person.lines()
        await person.say(PASTE.format("SD50\nfoo\nPA20\n"), "'foo'", "nothing of what was pasted was sent")
        assert person.lines() == before
        await person.say(PASTE.format("SD50\n\nPA20\nhelp S3"), "following error", "it may be moving now")
        assert person.lines()[len(before) :] == ["SD50", "PA20"]


# Permission to move


async def test_the_first_motion_is_asked_for_once() -> None:
    async with sitting(may_move=False) as person:
        await person.say("PA5", "PA5 can move the axis; nothing was sent", "move? yes/no>")
        assert not person.did(LogKind.MOTION_STARTED)
        await person.say("yes", "the drive has taken it")
        await until(lambda: bool(person.did(LogKind.MOTION_REACHED)), lambda: "the end of the motion")
        await person.say("move 7", "reached  7.00 units")
        assert person.did(LogKind.MOTION_STARTED) == ["POSA 5.00", "POSA 7.00"]


@pytest.mark.parametrize("answer", ["no", "", "S1"])
async def test_a_motion_without_a_yes_is_never_sent(answer: str) -> None:
    async with sitting(may_move=False) as person:
        await person.say("home", "home can move the axis")
        await person.say(answer, "not sent: home; you did not say yes")
        await person.say("S2", "S002")
        assert not person.did(LogKind.MOTION_STARTED)


async def test_a_yes_that_was_typed_before_it_was_asked_for_is_none() -> None:
    async with sitting(may_move=False) as person:
        person.press(f"PA5{ENTER}yes{ENTER}")
        await person.sees("PA5 can move the axis")
        assert "the drive has taken it" not in await person.quiet()
        assert not person.did(LogKind.MOTION_STARTED)
        await person.say("yes", "the drive has taken it")


async def test_ctrl_c_and_a_stop_are_no_yes() -> None:
    async with sitting(may_move=False) as person:
        await person.say("PA5", "move? yes/no>")
        person.press(CTRL_C)
        await person.sees("not sent: PA5; you did not say yes")
        await person.say("PA6", "move? yes/no>")
        person.press(CTRL_X)
        await person.sees("not sent: PA6; a stop came first", "stands at 0.00 units")
        assert not person.did(LogKind.MOTION_STARTED)


async def test_switching_power_is_asked_for_as_a_motion_is() -> None:
    """A hanging load falls when its brake opens without current."""
    async with sitting(may_move=False) as person:
        await person.say("OT O0=2", "OT O0=2 can move the axis; nothing was sent")
        assert not person.did(LogKind.OUTPUT)
        await person.say("no")


# Moves and stops


async def test_a_positioning_with_its_sign_is_awaited_and_told_above_the_prompt() -> None:
    async with sitting() as person:
        await person.say("POSA 20$", "on its way to 20.00 units")
        person.press("half a li")
        await person.sees("$  position reached", "reached  20.00 units, by the message $")
        assert person.typed == "half a li"
        person.press(CTRL_C)


async def test_other_lines_are_answered_while_a_move_runs() -> None:
    async with sitting(**SLOW) as person:
        await person.say("move 20 at 50", "on its way")
        await person.say("S1", "S001: ")
        await person.say("PA3", "MoveActiveError")
        await person.sees("reached  20.00 units")


async def test_ctrl_c_stops_a_move_at_once_even_with_text_typed() -> None:
    async with sitting(**SLOW) as person:
        await person.say("move by 500", "on its way")
        person.press("S1")
        await asyncio.sleep(0.5)
        person.press(CTRL_C)
        await person.sees("the drive has acknowledged STOP and stands at", "move_by(500) was stopped at")
        assert len(person.did(LogKind.MOTION_STOPPED)) == 1


async def test_ctrl_c_stops_what_a_raw_line_has_started() -> None:
    async with sitting(**SLOW) as person:
        await person.say("PA500", "nobody is told when it is there")
        person.press(CTRL_C)
        await person.sees("stands at")
        assert len(person.did(LogKind.MOTION_STOPPED)) == 1
        person.press(CTRL_C)
        await person.sees("nothing runs that was started here")


async def test_ctrl_c_clears_what_is_typed_when_nothing_moves() -> None:
    async with sitting() as person:
        person.press("PA100")
        await person.sees("PA100")
        person.press(CTRL_C + ENTER)
        await person.say("S1", "S001: 0.00")
        assert "STOP" not in person.lines()


async def test_ctrl_x_stops_also_what_others_have_started() -> None:
    async with sitting(**SLOW) as person:
        person.far.receive(b"PA500\r", asyncio.get_running_loop().time())
        person.press("S1" + CTRL_X)
        await person.sees("the drive has acknowledged STOP and stands at")
        assert "STOP" in person.lines()


@pytest.mark.parametrize("word", ["stop", "STOP", "raw stop"])
async def test_a_stop_goes_ahead_of_what_waits_and_takes_it_back(word: str) -> None:
    async with sitting(answer_time_s=0.5, **SLOW) as person:
        await person.say("S1")
        await person.say("PA500")
        await person.say(word, "not sent: PA500; a stop came first", "stands at 0.00 units")
        assert not person.did(LogKind.MOTION_STARTED)


async def test_a_stop_is_a_stop_while_nobody_says_yet_where_the_one_before_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with sitting(**SLOW) as person:
        await person.say("move 20", "on its way")
        answer: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        monkeypatch.setattr(person.drive, "position", lambda: answer)
        person.press(CTRL_X)
        await until(lambda: bool(person.did(LogKind.MOTION_STOPPED)), lambda: "the first stop")
        await until(lambda: "STOP is under way" not in person.bottom, lambda: person.bottom)
        await person.say("move 10", "on its way")
        person.press(CTRL_X)
        await until(lambda: len(person.did(LogKind.MOTION_STOPPED)) == 2, lambda: "the second stop")
        answer.set_result(7.0)
        await person.sees("stands at 7.00")


async def test_a_status_that_was_asked_before_a_motion_does_not_end_it() -> None:
    async with sitting(poll_s=1.0, answer_time_s=0.2, **SLOW) as person:
        seen = len(person.lines())
        await until(lambda: person.lines()[seen:][-1:] == ["S17"], lambda: "a look at the status")
        await person.say("PA50", "it may be moving now")
        for _ in range(20):
            await asyncio.sleep(0.1)
            assert "PA50 may still be moving it" in person.bottom
        person.press(CTRL_C)
        await person.sees("the drive has acknowledged STOP and stands")


async def test_a_stop_that_is_not_acknowledged_is_told_as_what_it_is() -> None:
    cable = Cable()
    async with sitting(cable=cable, settings=DriveSettings(stop_timeout_s=2), **SLOW) as person:
        await person.say("PA500", "it may be moving now")
        await cable.pull()
        person.press(CTRL_X + CTRL_X)
        await person.sees("THE AXIS MAY STILL BE MOVING: use the stop in hardware")
        person.press(CTRL_D)
        await person.sees("leaving: what was not stopped may still be moving it, so it is stopped")


async def test_a_move_in_doubt_may_still_be_moving() -> None:
    cable = Cable()
    settings = DriveSettings(in_doubt_after_s=1, stop_timeout_s=1)
    async with sitting(cable=cable, settings=settings, **SLOW) as person:
        await person.say("move 500", "on its way")
        await cable.pull()
        await person.sees("MoveInDoubtError")
        person.press(CTRL_C)
        await person.sees("THE AXIS MAY STILL BE MOVING")


async def test_a_move_whose_line_was_lost_for_good_may_still_be_moving() -> None:
    cable = Cable()
    async with sitting(cable=cable, settings=DriveSettings(reconnect=False), leaves=False, **SLOW) as person:
        await person.say("move 50", "on its way")
        await cable.pull()
        await person.sees("LINE LOST")
        await person.shows("may still be moving it")
        person.press(CTRL_D)
        await person.sees("THE AXIS MAY STILL BE MOVING: use the stop in hardware")


async def test_after_doubt_reconcile_lets_it_move_again() -> None:
    cable = Cable()
    async with sitting(cable=cable, settings=DriveSettings(in_doubt_after_s=1), **SLOW) as person:
        await person.say("move 30", "on its way")
        await cable.pull()
        await person.sees("MoveInDoubtError")
        await cable.plug(person.far)
        await person.sees("LINE BACK")
        await person.say("reconcile", "takes motion again from here")
        await asyncio.sleep(10)
        await person.say("reconcile", "it stands")
        await person.say("move 31", "reached  31.00 units")


async def test_a_refused_motion_is_not_said_to_be_moving() -> None:
    async with sitting() as person:
        person.far.raise_fault(55)
        await person.say("PA5", "CommandRejectedError")
        person.press(CTRL_C)
        await person.sees("nothing runs that was started here")


# Leaving


@pytest.mark.parametrize("how", [CTRL_D, "exit" + ENTER])
async def test_leaving_stops_what_was_started_here_and_says_so(how: str) -> None:
    async with sitting(leaves=False, **SLOW) as person:
        await person.say("move 500", "on its way")
        person.press(how)
        await person.sees("leaving: move_to(500) is running, so it is stopped", "stands at")
    assert len(person.did(LogKind.MOTION_STOPPED)) == 1


async def test_leaving_before_a_move_was_accepted_stops_it_as_well() -> None:
    async with sitting(leaves=False, answer_time_s=0.5, **SLOW) as person:
        await person.say("move 500")
        await person.shows("move_to(500) is running", "waiting for move 500")
        person.press(CTRL_D)
        await person.sees("leaving: move_to(500) is running, so it is stopped", "stands at")
    assert person.did(LogKind.MOTION_STARTED) == [] or person.did(LogKind.MOTION_STOPPED)


async def test_leaving_gives_up_what_waits() -> None:
    async with sitting(leaves=False, answer_time_s=0.5) as person:
        await person.say("S1")
        await person.say("SD10")
        person.press(CTRL_D)
        await person.sees("not sent: SD10; the shell was left")


# What happens unasked


async def test_comparators_and_unasked_text_are_told() -> None:
    async with sitting() as person:
        await person.say("PR5 OT O9=1", "the drive has taken it")
        await person.say("POSA 20$", "comparator 1 was passed", "reached")
        person.far.inject(b"hello\x1b[31m\r\n>")
        await person.sees("unasked  hello\\x1b[31m")


async def test_a_line_that_floods_is_told_now_and_then() -> None:
    async with sitting() as person:
        for _ in range(500):
            person.far.inject(b"garbage\r\n>")
        await person.sees("unasked  garbage")
        assert (await person.quiet(10.0)).count("unasked") < 3
        person.far.inject(b"more\r\n>")
        await person.sees("unasked  more (", "more before it)")


async def test_a_fault_is_told_with_what_to_do() -> None:
    async with sitting(poll_s=0.5) as person:
        person.far.raise_fault(53)
        await person.sees("FAULT  E53: overload of motor or unit; reduce load or duty")
        await person.shows("FAULT E53")
        await person.say("E53", "the effective load of motor or unit has reached 100 %")
        await person.say("error", "E53: overload")
        await person.say("history", "E53: overload", "not acknowledged")
        await person.say("quit", "the drive has taken it")
        await person.say("error", "no error")


async def test_a_fault_that_the_drive_does_not_name_is_told_as_such() -> None:
    async with sitting() as person:
        person.drive._on_fault(None)
        await person.sees("FAULT  the drive does not say which; S30 and S18 may")


async def test_a_lost_line_is_told_and_no_motion_waits_for_it() -> None:
    cable = Cable()
    async with sitting(cable=cable, poll_s=0.5) as person:
        await person.shows("0.00 units · stands")
        await cable.pull()
        await person.sees("LINE LOST")
        await person.shows("LINE LOST, it is tried again")
        assert "units" not in person.bottom
        await person.say("S1")
        await person.shows("waiting for S1")
        await person.say("PA5", "not sent: PA5; the line to the drive is lost")
        await cable.plug(person.far)
        await person.sees("LINE BACK  after", "S001: 0.00")
        await asyncio.sleep(5)
        assert not person.did(LogKind.MOTION_STARTED)


async def test_what_is_warned_of_is_told_once_above_the_prompt() -> None:
    cable = Cable()
    async with sitting(cable=cable) as person:
        await cable.pull()
        await person.sees("LINE LOST  x: the line was lost")
        await person.sees("warning  x: the line is still lost")
        assert "warning  x: the line was lost" not in person.seen
        await cable.plug(person.far)
        await person.sees("LINE BACK")


async def test_a_defect_ends_the_talk_and_stops_the_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    async def command(self: Drive, text: str) -> str:
        raise RuntimeError("a defect")

    async def talk() -> None:
        async with sitting(leaves=False, **SLOW) as person:
            people.append(person)
            await person.say("move 500", "on its way")
            monkeypatch.setattr(Drive, "command", command)
            person.press("S1" + ENTER)

    people: list[Person] = []
    with pytest.raises(ExceptionGroup) as ended:
        await talk()
    assert isinstance(ended.value.exceptions[0], RuntimeError)
    assert len(people[0].did(LogKind.MOTION_STOPPED)) == 1


async def test_a_drive_that_falls_silent_is_told_with_the_last_that_went_over_the_line() -> None:
    async with sitting(settings=DriveSettings(reconnect=False)) as person:
        person.far.power_off()
        await person.say("S1", "AnswerTimeoutError", "the last that went over the line:", "→ S1")
        person.far.power_on()


@pytest.mark.parametrize("words", [("--no-history", "--poll-s=0"), ("--name", "x")])
async def test_the_command_talks_where_somebody_sits_at_a_terminal(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    command, bound, _ = app.parse_args(["shell", "sim://compax", *words])
    with create_pipe_input() as keyboard, create_app_session(input=keyboard, output=DummyOutput()):
        keyboard.send_text("S1\rexit\r")
        await command(*bound.args, **bound.kwargs)
    assert "Ctrl-X stops the axis" in capsys.readouterr().out
    assert (tmp_path / "compax" / "shell_history").exists() is ("--name" in words)


async def test_motion_typed_before_a_line_is_lost_is_not_sent_after() -> None:
    cable = Cable()
    async with sitting(cable=cable, answer_time_s=0.5) as person:
        await person.say("home", "reached  machine zero, by the status")
        await person.say("S1")
        await person.say("PA5")
        await person.shows("1 more wait")
        await cable.pull()
        await person.sees("not sent: PA5; the line to the drive was lost")
        person.far.power_cycle()
        await cable.plug(person.far)
        await person.sees("LINE BACK", "switched off and on", "Machine zero, SPEED, ramps")
        assert "PA5" not in person.lines()


async def test_ctrl_c_waits_no_longer_for_an_answer() -> None:
    cable = Cable()
    async with sitting(cable=cable) as person:
        await cable.pull()
        await person.sees("LINE LOST")
        await person.say("S1")
        await person.say("SD10")
        await person.shows("1 more wait")
        person.press(CTRL_C)
        await person.sees("S1: no longer waited for", "not sent: SD10; the line before it was given up")


async def test_a_line_lost_for_good_ends_neither_poll_nor_prompt() -> None:
    cable = Cable()
    async with sitting(cable=cable, settings=DriveSettings(reconnect=False), poll_s=0.2) as person:
        await person.say("watch position", "position  0.00")
        await cable.pull()
        await person.sees("LINE LOST")
        await person.say("S1", "ConnectionLostError")
        await person.say("help S1", "actual position")


# Looking


async def test_status_says_how_the_drive_stands() -> None:
    async with sitting() as person:
        await person.say("status", "S16  11010000   no_fault", "S17  00000010   running", "S1   0.00 units   no error")


async def test_params_reads_several_and_says_which_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    async def command(self: Drive, text: str) -> str:
        if text == "P13":
            raise CommandRejectedError("the drive rejected it with E90", code=90)
        return f"{text}: 1"

    async with sitting() as person:
        with monkeypatch.context() as patch:
            patch.setattr(Drive, "command", command)
            await person.say("params 12-14", "P12: 1", "P13   refused with E90", "P14: 1")
        await person.say("params 14 p19-20", "P014: 1.000", "P019: ", "P020: 0")
        await person.say("params 1,5", "names no parameters")
        await person.say("params", "names no parameters")
        await person.say("params 251", "there is no P251")


async def test_watched_values_are_printed_when_they_change() -> None:
    async with sitting(**SLOW) as person:
        await person.say("watch position status S6 P14 error V300", "InvalidCommandError")
        await person.say("watch position status S6 P14 error S200", "position  0.00", "status  S16 1101", "S6  ",
                         "P14  1.00", "error  no error", "S200  no value: ")  # fmt: skip
        assert "position" not in (await person.quiet(5)).split("S200  no value")[1]
        await person.say("watch position", "position  0.00")
        await person.say("PA10", "position  10.00")
        assert person.fresh.count("position  ") > 2
        await person.say("watch off")
        await person.say("PA0", "may be moving")
        assert "position" not in (await person.quiet(3)).split("may be moving")[1].replace("nobody", "")
        await person.say("watch", "watch what?")


async def test_the_line_at_the_bottom_follows_the_drive() -> None:
    async with sitting(poll_s=0.2, **SLOW) as person:
        await person.shows("0.00 units · stands · Ctrl-X STOP")
        await person.say("PA20")
        await person.shows("PA20 may still be moving it · ", " units · moving · ")
        await person.shows("20.00 units · stands · Ctrl-X STOP")
        assert "moving" not in person.bottom
        person.press(CTRL_C)
        await person.sees("nothing runs that was started here")
