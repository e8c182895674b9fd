"""The promises held against traces: what was truly recorded keeps them, and each check notices a doctored trace."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.answers import as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.recording.traces import conversation, lines_of, record_move, rewritten

import compax_aio
from compax_aio import DriveSettings, smc
from compax_aio.errors import InvalidCommandError
from compax_aio.link.taps import TAPS, Fact, LineTap
from compax_aio.recording import Conversation, TraceEntry, record_trace
from compax_aio.recording.trace_entries import LineMade, SessionBegun
from compax_aio.simulator.hunt.drawing import draw_scenario
from compax_aio.simulator.hunt.recorded import Outcome, Verdict
from compax_aio.simulator.hunt.simulation import simulate
from compax_aio.simulator.hunt.traces import check_drive
from compax_aio.simulator.server import drive_named
from compax_aio.simulator.smc_hunt.drawing import draw_party
from compax_aio.simulator.smc_hunt.simulation import simulate_party
from compax_aio.simulator.smc_hunt.traces import check_party_line
from compax_aio.transports.loopback import listen

Entry = dict[str, Any]
Entries = list[Entry]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "trace.jsonl"


def broken(verdicts: list[Verdict]) -> dict[str, str]:
    """Return the first finding of each promise that was broken."""
    return {each.promise: each.findings[0].how for each in verdicts if each.outcome is Outcome.BROKEN}


def outcomes(verdicts: list[Verdict]) -> dict[str, str]:
    return {each.promise: each.outcome.value for each in verdicts}


# What was truly recorded ----------------------------------------------------------------------------------------------


class Recorder:
    """Notes conversations in memory, of any event loop."""

    def __init__(self) -> None:
        self.conversations: list[Conversation] = []
        self._place = 0

    def line(self, name: str, about: Mapping[str, Any]) -> LineTap:
        made = LineMade(str(about["device"]), about=about)
        noted = Conversation(1, SessionBegun("now", "test"), name, made)
        self.conversations.append(noted)

        def tell(fact: Fact) -> None:
            self._place += 1
            at = round(asyncio.get_running_loop().time(), 6)
            noted.entries.append(TraceEntry(at, name, fact, 1, self._place))

        return tell


def recorded(work: Callable[[], object]) -> list[Conversation]:
    recorder = Recorder()
    token = TAPS.set((recorder.line,))
    try:
        work()
    finally:
        TAPS.reset(token)
    return recorder.conversations


@pytest.mark.parametrize("seed", range(5000, 5040))
def test_whatever_befell_a_drive_its_trace_shows_that_promises_were_kept(seed: int) -> None:
    scenario = draw_scenario(seed)
    stood_still = any(trouble.kind == "stall" for trouble in scenario.troubles)
    for each in recorded(lambda: simulate(scenario)):
        found = broken(check_drive(each))
        if stood_still:
            found.pop("P3", None)  # a trace cannot tell an idle line from a program that stood still
        assert not found


@pytest.mark.parametrize("seed", range(5000, 5030))
def test_whatever_befell_a_party_line_its_trace_shows_that_promises_were_kept(seed: int) -> None:
    scenario = draw_party(seed)
    stood_still = any(trouble.kind == "stall" for trouble in scenario.troubles)
    for each in recorded(lambda: simulate_party(scenario)):
        found = broken(check_party_line(each))
        if stood_still:
            found.pop("P3", None)
        assert not found


# A drive, doctored ----------------------------------------------------------------------------------------------------


async def day(drive: compax_aio.Drive) -> None:
    await drive.move_to(12.5)
    await drive.query("S4")
    move = drive.move_to(90)
    await move.accepted
    reading = asyncio.ensure_future(drive.query("S5"))
    await asyncio.sleep(0)
    await drive.stop()
    await reading
    with pytest.raises(compax_aio.MoveStoppedError):
        await move
    await asyncio.sleep(0.5)


def place(entries: Entries, nth: int = 0, /, **wanted: Any) -> int:
    """Find an entry by what stands in it."""
    found = [at for at, entry in enumerate(entries) if wanted.items() <= entry.items()]
    return found[nth]


def entry(before: Entry, what: str, **more: Any) -> Entry:
    """Make an entry of the same time and line."""
    return {"at": before["at"], "line": before["line"], "what": what, **more}


def spoke_too_early(entries: Entries) -> None:
    at = place(entries, data="PA12.5$\r")
    entries.insert(at + 1, entry(entries[at], "sent", data="S2\r"))


def spoke_in_doubt(entries: Entries) -> None:
    del entries[place(entries, what="received")]


def written_twice(entries: Entries) -> None:
    at = place(entries, data="S4\r")
    entries[at:at] = [
        entry(entries[at], "sent", data="PA12.5$\r"),
        entry(entries[at], "received", data="\r\n>"),
    ]


def written_twice_for_one(entries: Entries) -> None:
    at = place(entries, data="S4\r")
    number = entries[place(entries, data="PA12.5$\r")]["number"]
    asked = entry(entries[at], "asked", number=999, text="PA12.5$", lane="motion")
    again = entry(entries[at], "sent", data="PA12.5$\r", number=number)
    entries[at:at] = [asked, again, entry(entries[at], "received", data="\r\n>")]


def moved_for_nobody(entries: Entries) -> None:
    entries[place(entries, text="PA90$", what="asked")]["text"] = "PA91$"


def waited_on_an_idle_line(entries: Entries) -> None:
    at = place(entries, data="S4\r")
    for each in entries[at + 1 :]:
        each["at"] += 2.5


def answered_by_another(entries: Entries) -> None:
    number = entries[place(entries, data="S4\r")]["number"]
    entries[place(entries, number=number, what="ended")]["text"] = "S001: 12.50"


def answered_by_nobody(entries: Entries) -> None:
    at = place(entries, data="S4\r")
    entries[place(entries[at:], what="received") + at]["data"] = ">"


def acknowledged_by_nobody(entries: Entries) -> None:
    at = place(entries, data="PA12.5$\r")
    del entries[place(entries[at:], what="received") + at]


def no_stop(entries: Entries) -> None:
    at = place(entries, data="STOP\r")
    del entries[at : at + 2]


def stop_behind_a_reading(entries: Entries) -> None:
    at = place(entries, data="STOP\r")
    entries[at:at] = [
        entry(entries[at], "sent", data="S3\r"),
        entry(entries[at], "received", data="S003: 0\r\n>"),
    ]


def stop_later_on_a_free_line(entries: Entries) -> None:
    """The reading in flight was answered when the stop was asked, and nothing was written for a while."""
    at = place(entries, data="STOP\r")
    stop = entries.pop(place(entries, text="STOP", what="asked"))
    reading = place(entries, data="S4\r")
    entries.insert(reading, {**stop, "at": entries[reading - 1]["at"]})
    assert at


@pytest.mark.parametrize(
    "data",
    ["PA12.5$", "S4\n\r", "S4?\r", "S4\x07\r", f"PA{'9' * 40}\r", "\r", "S4\r\r", "\x84LA", "\x84XA\r", "$\r", "a,b\r"],
)
async def test_what_a_drive_cannot_be_told_is_noticed(path: Path, data: str) -> None:
    await record_move(path, program=day)

    def doctor(entries: Entries) -> None:
        entries[place(entries, data="S4\r")]["data"] = data

    assert "P9" in broken(check_drive(conversation(rewritten(path, doctor))))


def not_looked(entries: Entries) -> None:
    """The status was not asked for before the first motion."""
    for data in ("S16\r", "S17\r"):
        while True:
            at = next((at for at, each in enumerate(entries) if each.get("data") == data and not each.get("way")), None)
            if at is None or at > place(entries, data="PA12.5$\r"):
                break
            entries[at]["data"] = "S30\r"
            answer = at + place(entries[at:], what="received")
            entries[answer]["data"] = "S030: 0\r\n>"


@pytest.mark.parametrize(
    ("doctor", "promise"),
    [
        (spoke_too_early, "P1"),
        (spoke_in_doubt, "P1"),
        (written_twice, "P2"),
        (written_twice_for_one, "P2"),
        (moved_for_nobody, "P2"),
        (waited_on_an_idle_line, "P3"),
        (answered_by_another, "P4"),
        (answered_by_nobody, "P4"),
        (acknowledged_by_nobody, "P4"),
        (no_stop, "P6"),
        (stop_behind_a_reading, "P6"),
        (stop_later_on_a_free_line, "P6"),
        (not_looked, "P10"),
    ],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
async def test_a_doctored_trace_of_a_drive_is_noticed_with_its_place(
    path: Path, doctor: Callable[[Entries], None], promise: str
) -> None:
    await record_move(path, program=day)
    verdicts = check_drive(conversation(path))
    assert outcomes(verdicts) == {
        "P1": "held", "P2": "held", "P3": "held", "P4": "held", "P5": "cannot be told", "P6": "held",
        "P7": "cannot be told", "P8": "cannot be told", "P9": "held", "P10": "held",
    }  # fmt: skip
    found = check_drive(conversation(rewritten(path, doctor)))
    assert promise in broken(found), broken(found)
    finding = next(each for each in found if each.promise == promise).findings[0]
    assert 1 < finding.place <= len(path.read_text().splitlines())  # noqa: ASYNC240
    assert finding.how


@pytest.mark.parametrize(("looks", "is_broken"), [(False, True), (True, False)])
async def test_a_motion_behind_one_of_which_nobody_knew_what_became_is_noticed(
    path: Path, looks: bool, is_broken: bool
) -> None:
    await record_move(path, program=lambda drive: drive.position())

    def doctor(entries: Entries) -> None:
        at = place(entries, what="let go")
        begun = entries[at]["at"]

        def said(later_s: float, what: str, **more: Any) -> Entry:
            return {"at": begun + later_s, "line": "x", "what": what, **more}

        def asked(later_s: float, number: int, text: str, answer: str, how: str) -> Entries:
            return [
                said(later_s, "asked", number=number, text=text, lane="motion"),
                said(later_s, "sent", number=number, data=f"{text}\r"),
                said(later_s + 0.01, "received", data=answer),
                said(later_s + 0.01, "ended", number=number, how=how),
            ]

        entries[at:] = [
            said(0, "asked", number=97, text="PA5", lane="motion"),
            said(0, "sent", number=97, data="PA5\r"),
            said(1, "ended", number=97, how="AnswerTimeoutError"),
            said(1, "sent", data="S30\r", way="marker"),
            said(1.01, "received", data="S030: 0\r\n>"),
            *(asked(1.1, 98, "S17", "S017: 00000010\r\n>", "cancelled") if looks else ()),
            *asked(1.2, 99, "PA6", "\r\n>", "Acknowledged"),
        ]

    found = broken(check_drive(conversation(rewritten(path, doctor))))
    assert found.keys() == ({"P2"} if is_broken else set())
    assert not is_broken or "nobody had looked what had become of 'PA5'" in found["P2"]


async def test_a_late_answer_that_was_not_told_as_late_is_noticed(path: Path) -> None:
    far = ScriptedFarEnd()

    def script(line: str) -> bytes:
        far.delay_s = 0.7 if line == "S4" else 0.0
        return as_drive(line)

    far.script = script
    with await listen("late", lambda: far):
        settings = DriveSettings(answer_timeout_s=0.5, reconnect=False)
        async with record_trace(path), compax_aio.connect("loop://late", name="x", settings=settings) as drive:
            with pytest.raises(compax_aio.AnswerTimeoutError):
                await drive.query("S4")
            await drive.position()
    assert not broken(check_drive(conversation(path)))

    def doctor(entries: Entries) -> None:
        del entries[place(entries, event="LateEnding")]

    assert "came late, and was not told as late" in broken(check_drive(conversation(rewritten(path, doctor))))["P4"]


async def test_a_call_that_waits_too_long_for_a_lost_line_is_noticed(path: Path) -> None:
    await record_move(path, program=day)

    def doctor(entries: Entries) -> None:
        at = place(entries, data="S4\r")
        number = entries[at]["number"]
        ended = entries.pop(place(entries, number=number, what="ended"))
        lost = entry(entries[at], "lost", why="unplugged")
        entries[at + 1 :] = [lost, {**ended, "at": 500.0, "how": "ConnectionLostError"}]

    found = broken(check_drive(conversation(rewritten(path, doctor))))
    assert "waited" in found["P3"]
    assert "for a line that was lost" in found["P3"]


async def test_a_frame_that_may_be_cut_lets_nothing_but_stop_go_until_somebody_says_so(path: Path) -> None:
    settings = DriveSettings(
        answer_timeout_s=0.3, binary_settings=True, binary_motion=True, reconnect=False, in_doubt_after_s=1
    )
    far = drive_named("binary", compax_aio.simulator.compax.Knobs(p20=16))
    async with (
        record_trace(path),
        compax_aio.connect("sim://compax?name=binary", name="x", settings=settings) as drive,
    ):
        await drive.move_to(5)
        far.lose_answers = 1
        move = drive.move_to(50)
        with pytest.raises(compax_aio.CompaxError):
            await move
        await drive.reconcile()
        await drive.position()
    assert not broken(check_drive(conversation(path)))

    def doctor(entries: Entries) -> None:
        del entries[place(entries, what="resumed")]

    assert "behind a frame that may be cut" in broken(check_drive(conversation(rewritten(path, doctor))))["P1"]


async def test_what_is_missing_ends_what_can_be_told(path: Path) -> None:
    await record_move(path, program=day)

    def doctor(entries: Entries) -> None:
        written_twice(entries)
        entries.insert(place(entries, data="PA12.5$\r") + 1, {"at": 1.0, "what": "missing", "entries": 3})

    verdicts = check_drive(conversation(rewritten(path, doctor)))
    assert not broken(verdicts)
    assert {each.why for each in verdicts if each.outcome is Outcome.HELD} == {
        f"entries are missing from line {place(lines_of(path), what='missing') + 1} on"
    }


async def test_of_a_line_on_which_nothing_was_sent_nothing_can_be_told(path: Path) -> None:
    await record_move(path)

    def doctor(entries: Entries) -> None:
        del entries[2:]

    assert set(outcomes(check_drive(conversation(rewritten(path, doctor)))).values()) == {"cannot be told"}


async def test_a_trace_that_begins_in_the_middle_is_judged_from_the_next_opening_on(path: Path) -> None:
    await record_move(path, program=day)

    def doctor(entries: Entries) -> None:
        entries[1]["is_open"] = True
        entries[0]["part"] = 2
        spoke_too_early(entries)
        del entries[2 : place(entries, data="S31\r")]

    assert set(outcomes(check_drive(conversation(rewritten(path, doctor)))).values()) == {"cannot be told"}


@pytest.mark.parametrize(
    ("about", "why"),
    [
        ({"settings": []}, "no table"),
        ({"settings": {"no": 1}}, "no setting"),
        ({"settings": {"decimals": 9}}, "decimals"),
    ],
)
async def test_settings_that_cannot_be_meant_are_refused(path: Path, about: Any, why: str) -> None:
    await record_move(path)
    rewritten(path, lambda entries: entries[1].update(about=about))
    with pytest.raises(InvalidCommandError, match=why):
        check_drive(conversation(path))


# A party line, doctored -----------------------------------------------------------------------------------------------


async def record_party(path: Path, mode: str = "party") -> None:
    axes = "A" if mode != "single" else ""
    url = f"sim://smc?axes=A&mode={mode}" if mode != "party" else "sim://smc?axes=A"
    async with record_trace(path), smc.connect(url, mode=mode, axes=axes, name="x") as line:  # type: ignore[arg-type]
        axis = line.axis("A") if mode != "single" else line.axis()
        await axis.move_to(200)
        move = axis.move_to(5000)
        await move.accepted
        reading = asyncio.ensure_future(axis.position())
        await asyncio.sleep(0)
        await axis.stop()
        await reading
        with pytest.raises(compax_aio.MoveStoppedError):
            await move
        await asyncio.sleep(0.5)


def typed(entries: Entries, text: str) -> int:
    """Find where *text* was begun to be typed for somebody."""
    asked = entries[place(entries, what="asked", text=text)]["number"]
    return place(entries, what="sent", number=asked)


def typed_without_echo(entries: Entries) -> None:
    at = typed(entries, "AR200")
    del entries[at + 1]


def typed_twice(entries: Entries) -> None:
    begin = typed(entries, "AR200")
    end = begin + place(entries[begin:], what="noticed")
    again = [{**each, "at": entries[end]["at"]} for each in entries[begin:end]]
    again[0] = {**again[0], "number": entries[begin]["number"]}
    entries[end + 2 : end + 2] = again


def typed_in_vain(entries: Entries) -> None:
    number = entries[place(entries, what="asked", text="AZ")]["number"]
    entries[place(entries, what="ended", number=number)]["text"] = "777"


def typed_too_much(entries: Entries) -> None:
    at = typed(entries, "AR200")
    asked = entries[at]
    entries[at + 2 : at + 2] = [
        each for _ in range(12) for each in (entry(asked, "sent", data="1"), entry(asked, "received", data="1"))
    ]


def idle(entries: Entries) -> None:
    at = typed(entries, "AR200")
    for each in entries[at + 2 :]:
        each["at"] += 5


def stop_behind_another(entries: Entries) -> None:
    stop = place(entries, what="asked", lane="stop")
    late = entries.pop(stop)
    at = place(entries, what="asked", text="AR200")
    entries.insert(at, {**late, "at": entries[at]["at"]})


@pytest.mark.parametrize(
    ("doctor", "promise"),
    [
        (typed_without_echo, "P1"),
        (typed_twice, "P2"),
        (idle, "P3"),
        (typed_in_vain, "P4"),
        (stop_behind_another, "P6"),
        (typed_too_much, "P9"),
    ],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
async def test_a_doctored_trace_of_a_party_line_is_noticed(
    path: Path, doctor: Callable[[Entries], None], promise: str
) -> None:
    await record_party(path)
    verdicts = check_party_line(conversation(path))
    assert outcomes(verdicts) == {
        "P1": "held", "P2": "held", "P3": "held", "P4": "held", "P5": "cannot be told", "P6": "held",
        "P7": "cannot be told", "P8": "cannot be told", "P9": "held", "P10": "cannot be told",
    }  # fmt: skip
    found = check_party_line(conversation(rewritten(path, doctor)))
    assert promise in broken(found), broken(found)


@pytest.mark.parametrize(
    ("about", "why"),
    [
        ({"mode": "none"}, "mode"),
        ({"mode": "party", "settings": []}, "no table"),
        ({"mode": "party", "settings": {"quiet_s": -1}}, "quiet_s"),
    ],
)
async def test_settings_of_a_party_line_that_cannot_be_meant_are_refused(path: Path, about: Any, why: str) -> None:
    await record_party(path)
    rewritten(path, lambda entries: entries[1].update(about=about))
    with pytest.raises(InvalidCommandError, match=why):
        check_party_line(conversation(path))


async def test_of_a_party_line_on_which_nothing_was_sent_nothing_can_be_told(path: Path) -> None:
    await record_party(path)

    def doctor(entries: Entries) -> None:
        entries[1]["about"].pop("settings")
        del entries[2:]

    assert set(outcomes(check_party_line(conversation(rewritten(path, doctor)))).values()) == {"cannot be told"}
