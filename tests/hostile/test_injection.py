"""Whatever a caller passes, either it is refused before a byte is sent, or exactly the lines it means are sent."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.hostile.wicked import STRANGE_NUMBERS, NamedNumber, SignedText, SmuggledInt, any_texts, strange_numbers
from tests.promises.bench import PROMPT, bench, ending, lines, scripted

import compax_aio
from compax_aio import Dialect, Drive, DriveGroup, DriveSettings
from compax_aio.compax.plain_line import as_index, check_line
from compax_aio.compax.program import Goto, MoveTo, Parameter, record_text
from compax_aio.compax.vocabulary import MovePlan, plan_move_by, plan_move_to
from compax_aio.errors import CompaxError, InvalidCommandError
from compax_aio.escaping import shown
from compax_aio.simulator.clock import VirtualClockLoop

NUMBER = r"-?[0-9]{1,10}(\.[0-9]{1,6})?"
"""As the drive takes it: signed, with a point, without an exponent (UG p. 158, IBS p. 23)."""


class Wire:
    """What a scripted drive has received, byte by byte, since it was last looked at."""

    def __init__(self, far: Any) -> None:
        self.raw = bytearray()
        self._answer = far.data_received
        far.data_received = self._received

    def _received(self, data: bytes) -> None:
        self.raw += data
        self._answer(data)

    def lines(self) -> list[str]:
        """Take what came; every byte of it belongs to a line of printable ASCII that the entry buffer takes."""
        assert not self.raw or self.raw.endswith(b"\r")
        assert all(byte == 13 or 32 <= byte <= 126 for byte in self.raw), bytes(self.raw)
        came = self.raw[:-1].decode("ascii").split("\r") if self.raw else []
        self.raw.clear()
        assert all(1 <= len(line) <= 30 for line in came), came
        return came


@pytest.fixture(scope="module")
def runner() -> Any:
    """Runs each example on a drive of its own, in virtual time."""

    def run(work: Callable[[Drive, Wire], Awaitable[None]], answers: dict[str, str | None] | None = None) -> None:
        async def with_a_drive() -> None:
            async with scripted(answers) as (drive, far):
                wire = Wire(far)
                await work(drive, wire)

        with asyncio.Runner(loop_factory=VirtualClockLoop) as loop:
            loop.run(with_a_drive())

    return run


# Raw lines ------------------------------------------------------------------------------------------------------------


@given(text=any_texts)
@example("S1\rPA 500")
@example("PA 5$")
@example("S1\x00")
@example("PA 5\ud800")
@settings(max_examples=300)
def test_a_raw_line_is_sent_as_it_stands_or_not_at_all(runner: Any, text: str) -> None:
    async def command(drive: Drive, wire: Wire) -> None:
        meant = text.strip(" ").upper()
        try:
            await drive.command(text)
        except InvalidCommandError:
            assert wire.lines() == []
            return
        except CompaxError:
            pass  # a scripted drive answers queries with a bare prompt
        assert wire.lines()[:1] == [meant]
        assert not set(meant) & set("\r\n$?!,>")

    runner(command)


@pytest.mark.parametrize("character", [chr(code) for code in (*range(0x20), *range(0x7F, 0x180))])
def test_no_character_but_printable_ascii_is_ever_part_of_a_line(character: str) -> None:
    for text in (f"S{character}1", f"PA 5{character}", f"{character}S1", f"S1{character}"):
        with pytest.raises(InvalidCommandError):
            check_line(text)


@pytest.mark.parametrize("sign", list("$?!,>"))
async def test_no_sign_of_the_line_can_be_part_of_a_command(sign: str) -> None:
    async with bench() as (drive, far):
        before = lines(far)
        for text in (f"PA 5{sign}", f"{sign}", f"{sign}PA 5", f"S1 {sign} S2"):
            for method in (drive.command, drive.query):
                assert isinstance(await ending(method(text)), InvalidCommandError)
        assert lines(far) == before


async def test_a_text_that_lies_about_itself_is_sent_as_what_it_is() -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        assert await drive.query(SignedText("S1")) == "S001: 0.00"
        assert await drive.command(SignedText("AL 100")) == ""
        assert lines(far)[before:] == ["S1", "AL 100"]


# Numbers --------------------------------------------------------------------------------------------------------------


def accepted(make: Callable[[], MovePlan]) -> MovePlan | None:
    try:
        return make()
    except InvalidCommandError:
        return None


@given(value=strange_numbers)
@example(value=1000001.995)
@settings(max_examples=400)
def test_a_target_is_a_number_on_the_wire_or_is_refused(value: Any) -> None:
    for plan_move, word in ((plan_move_to, "PA"), (plan_move_by, "PR")):
        plan = accepted(partial(plan_move, value, DriveSettings()))
        if plan is not None:
            assert re.fullmatch(rf"{word}{NUMBER}", plan.motion), plan
            # Exactly, for floats that lie half-way between two hundredths seem further from both than they are.
            assert abs(Fraction(plan.motion[2:]) - Fraction(float(value))) <= Fraction(1, 200)


@given(value=strange_numbers)
@settings(max_examples=400)
def test_speeds_and_ramps_are_numbers_on_the_wire_or_are_refused(value: Any) -> None:
    for key, form in (("speed_percent", "SD"), ("acceleration_ms", "AL"), ("deceleration_ms", "AL-")):
        plan = accepted(partial(plan_move_to, 1, DriveSettings(), **{key: value}))
        if plan is not None and value is not None:
            (line,) = plan.settings_lines
            assert re.fullmatch(rf"{form}[0-9]{{1,5}}(\.[0-9]{{1,3}})?", line), line


@given(distance=strange_numbers, other=strange_numbers, level=strange_numbers)
@settings(max_examples=400)
def test_points_on_the_way_are_numbers_on_the_wire_or_are_refused(distance: Any, other: Any, level: Any) -> None:
    for points, form in (
        ({"steps": [(distance, 50)]}, rf"PR{NUMBER} SD50"),
        ({"steps": [(10, other)]}, r"PR10 SD[0-9]{1,3}"),
        ({"comparators": [(distance, 7)]}, rf"PR{NUMBER} OT O7=1"),
        ({"comparators": [(10, other)]}, r"PR10 OT O([1-9]|1[0-6])=1"),
        ({"comparators": [(10, 7, level)]}, r"PR10 OT O7=[01]"),
    ):
        plan = accepted(partial(plan_move_to, 1, DriveSettings(), **points))
        if plan is not None:
            assert re.fullmatch(form, plan.point_lines[0]), plan


@given(value=strange_numbers, number=st.sampled_from([1, 40, 250]))
@settings(max_examples=200)
def test_a_parameter_is_written_as_a_number_or_not_at_all(runner: Any, value: Any, number: int) -> None:
    async def write(drive: Drive, wire: Wire) -> None:
        try:
            await drive.parameters.write(number, value)
        except InvalidCommandError:
            assert wire.lines() == []
        except CompaxError:  # it reads back nothing
            written, *read_back = wire.lines()
            assert re.fullmatch(rf"P{number}={NUMBER}", written), written
            assert set(read_back) <= {f"P{number}"}

    runner(write)


NUMBERED: dict[str, Callable[[Drive, Any], Awaitable[Any]]] = {
    "parameter": lambda drive, number: drive.parameters.read(number),
    "parameter written": lambda drive, number: drive.parameters.write(number, 1),
    "variable": lambda drive, number: drive.variables.read(number),
    "variable written": lambda drive, number: drive.variables.write(number, 1),
    "status": lambda drive, number: drive.read_status(number),
    "monitor": lambda drive, number: drive.read_monitor(number),
    "record": lambda drive, number: drive.program.read(number),
    "record taken apart": lambda drive, number: drive.program.read_record(number),
    "record written": lambda drive, number: drive.program.write(number, "END"),
    "record taught": lambda drive, number: drive.program.teach(number),
    "program from a record": lambda drive, number: drive.program.start(number),
    "records": lambda drive, number: drive.program.download(Pairs(number, Goto(1))),
    "output": lambda drive, number: drive.output(number, 1),
    "level": lambda drive, number: drive.output(7, number),
}


class Pairs(Mapping[Any, Any]):
    """Records by numbers that no dictionary would take."""

    def __init__(self, *pair: Any) -> None:
        self._pair = pair

    def __getitem__(self, _: Any) -> Any:
        return self._pair[1]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._pair[:1])

    def __len__(self) -> int:
        return 1


LINE = re.compile(
    r"[SPVN][0-9]{1,3}|[PV][0-9]{1,3}=1(\.0+)?|N[0-9]{3}: (END|POSA 0|GOTO 1)|GOTO [0-9]{1,3}|START|BREAK|STOP"
    r"|OT O[0-9]{1,2}=[01]"
)


@pytest.mark.parametrize("what", NUMBERED)
@pytest.mark.parametrize("number", STRANGE_NUMBERS, ids=lambda each: f"{type(each).__name__} {shown(each)}"[:40])
async def test_a_number_of_anything_is_one_on_the_wire_or_is_refused(what: str, number: Any) -> None:
    async with scripted() as (drive, far):
        wire = Wire(far)
        try:
            await NUMBERED[what](drive, number)
        except InvalidCommandError:
            assert wire.lines() == []
        except CompaxError:
            pass
        sent = wire.lines()
        assert all(LINE.fullmatch(line) for line in sent), sent


async def test_a_member_of_an_enumeration_is_its_number() -> None:
    async with bench() as (drive, far):
        await drive.read_status(NamedNumber.THIRD)
        await drive.variables.write(NamedNumber.THIRD, 1)
        await drive.program.write(NamedNumber.THIRD, "END")
        assert [line for line in lines(far) if "3" in line][-5:] == ["S3", "V3=1.000", "V3", "N003: END", "N3"]


def test_only_whole_numbers_are_numbers_of_something() -> None:
    assert [as_index(each) for each in (3, NamedNumber.THIRD, SmuggledInt(3))] == [3, 3, 3]
    assert {type(as_index(each)) for each in (3, NamedNumber.THIRD, SmuggledInt(3))} == {int}
    assert [as_index(each) for each in (True, 3.0, "3", Decimal(3), None)] == [None] * 5


# Records --------------------------------------------------------------------------------------------------------------


@given(text=any_texts)
@settings(max_examples=200)
def test_a_record_is_one_record_on_the_wire_or_is_refused(runner: Any, text: str) -> None:
    async def write(drive: Drive, wire: Wire) -> None:
        try:
            await drive.program.write(5, text)
        except InvalidCommandError:
            assert wire.lines() == []
        except CompaxError:
            pass
        assert all(re.fullmatch(r"N005: [A-Z0-9 .=<>+*/\\%-]+|N5|S1[67]", line) for line in wire.lines())

    runner(write)


@pytest.mark.parametrize(
    "record",
    [
        MoveTo(SmuggledInt(3)),
        MoveTo(Parameter(SmuggledInt(40))),
        Goto(SmuggledInt(3)),
        Goto("3\rPA 500"),  # type: ignore[arg-type]
        Parameter(1),
        SignedText("END"),
    ],
    ids=repr,
)
async def test_a_record_that_writes_itself_as_it_likes_is_what_it_means_or_is_refused(record: Any) -> None:
    async with scripted() as (drive, far):
        wire = Wire(far)
        try:
            await drive.program.write(5, record)
        except InvalidCommandError:
            assert wire.lines() == []
        except CompaxError:
            pass
        assert all(re.fullmatch(r"N005: (END|GOTO 3|POSA (3|\.P40))|N5|S1[67]", line) for line in wire.lines())


def test_a_number_in_a_record_is_written_from_its_value() -> None:
    assert record_text(Goto(SmuggledInt(3))) == "GOTO 3"
    assert record_text(MoveTo(Parameter(SmuggledInt(40)))) == "POSA .P40"
    for record in (MoveTo(10**5000), Goto(10**5000), MoveTo(Parameter(10**5000)), MoveTo(Decimal("1E+5000"))):
        with pytest.raises(InvalidCommandError):
            record_text(record)


async def test_a_comment_of_a_listing_never_leaves_the_computer() -> None:
    async with bench() as (drive, far):
        await drive.program.download("N001: END ; $!,?\x11\x13\x1b[2J > PA 500\nN002: END")
        assert [line for line in lines(far) if "PA" in line] == []
        assert await drive.program.read(2) == "END"


@pytest.mark.parametrize("text", ["N001: END\x00", "N001: E\u200bND", "N٣: END", "N001: PA 5$", "N001: PA 5, N2: END"])
async def test_a_listing_that_says_more_than_records_is_refused(text: str) -> None:
    async with bench() as (drive, far):
        before = lines(far)
        assert isinstance(await ending(drive.program.download(f"{text}\n")), InvalidCommandError)
        assert lines(far) == before


# Plans, words, names --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "lines_of_plan",
    [
        {"motion": "PA5\rPA6"},
        {"motion": "PA5$"},
        {"motion": "PA" + "5" * 28},
        {"motion": "PA5", "settings_lines": ("SD5\rPA 500",)},
        {"motion": "PA5", "point_lines": ("PR5 SD5\x11",)},
        {"motion": ""},
    ],
    ids=repr,
)
def test_a_plan_that_somebody_makes_by_hand_holds_lines_that_can_be_sent(lines_of_plan: Any) -> None:
    with pytest.raises(InvalidCommandError):
        MovePlan(description="by hand", **lines_of_plan)


@given(word=any_texts, name=st.sampled_from(["stop", "home", "quit", "break_off", "make_valid", "power_on"]))
@settings(max_examples=300)
def test_a_word_of_the_dialect_is_one_line_or_is_refused(word: str, name: str) -> None:
    try:
        dialect = Dialect(**{name: word})
    except InvalidCommandError:
        return
    assert check_line(getattr(dialect, name).format())


@pytest.mark.parametrize("axis", ["x\rSTOP", "x\n2020-01-01 all is well", "\x1b[2J", "ａ", "x" * 5000])  # noqa: RUF001
async def test_a_name_is_never_part_of_a_line(axis: str) -> None:
    async with bench("far") as (drive, far):
        group = DriveGroup(**{axis: drive})
        await group.move_to(**{axis: 5})
        await group.stop()
        assert all(re.fullmatch(r"[ -~]{1,30}", line) for line in lines(far))


@given(quantity=any_texts)
@settings(max_examples=200)
def test_only_what_can_be_watched_is_asked(runner: Any, quantity: str) -> None:
    async def watch(drive: Drive, wire: Wire) -> None:
        try:
            watch = drive.watch(quantity)
        except InvalidCommandError:
            assert wire.lines() == []
            return
        watch.close()

    runner(watch)


# What is told ---------------------------------------------------------------------------------------------------------

HOSTILE = "ok\n2031-01-01 INFO all is well\x1b[2J\u202e"


@pytest.mark.parametrize("place", ["device", "what", "sent", "received", "hint"])
def test_an_error_shows_what_others_have_worded_without_doing_what_it_says(place: str) -> None:
    error = CompaxError("it went wrong")
    setattr(error, place, HOSTILE)
    told = str(error)
    assert "\x1b" not in told
    assert "\u202e" not in told
    assert "\n" not in told or place == "what", "only a listing has several errors"


async def test_what_a_drive_says_is_told_escaped() -> None:
    async with scripted({"S1": "S001: \x1b[2J\x9b\x07"}) as (drive, far):
        error = await ending(drive.position())
        assert "\\x1b" in str(error)
        assert str(error).isprintable()
        assert all(line.isprintable() for line in error.exchanges)
        far.answers["AL 1"] = "\x1b]0;title\x07"
        assert str(await ending(drive.command("AL 1"))).isprintable()


async def test_the_log_shows_what_a_drive_says_escaped(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG")
    async with scripted() as (drive, far):
        far.transport.write(b"all is well\n\x1b[2J\x9b" + PROMPT)
        await asyncio.sleep(0.1)
        await drive.position()
    assert any("all is well" in record.getMessage() for record in caplog.records)
    assert all(record.getMessage().isprintable() for record in caplog.records)


async def test_a_drives_name_forges_no_line_of_a_log(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG")
    evil = "x\n2031-01-01 INFO all is well\x1b[2J"
    async with compax_aio.connect("sim://compax", name=evil) as drive:
        await drive.position()
    assert caplog.records
    assert all(record.getMessage().isprintable() for record in caplog.records)


async def test_a_listing_that_is_saved_holds_no_terminal_commands(tmp_path: Any) -> None:
    answers: dict[str, str | None] = {f"N{n}": f"N{n:03d}: END" for n in range(1, 251)}
    async with scripted({**answers, "N7": "N007: \x1b[2J\x9b;\x07?"}) as (drive, _):
        saved = await drive.program.save(tmp_path / "x.txt")
    assert list(saved.unreadable) == [7]
    assert all(line.isprintable() for line in (tmp_path / "x.txt").read_text().splitlines())
