"""The program memory: what was written is read back, and a listing arrives whole or says how far it got."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from decimal import Decimal
from pathlib import Path

import pytest
from hypothesis import given, settings
from tests.compax.program.programs import MANUAL, programs
from tests.promises.bench import ScriptedDrive, bench, ending, lines, scripted, served_through

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    Dialect,
    Drive,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from compax_aio.compax.program import (
    End,
    Goto,
    MoveTo,
    Outputs,
    PreparedSpeed,
    Program,
    Record,
    listing,
    parse,
    record_text,
    wire_lines,
)
from compax_aio.compax.program.printing import shortest_line
from compax_aio.compax.program.problems import Severity
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import drive_named

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@pytest.fixture
async def drive() -> AsyncIterator[Drive]:
    async with bench() as (drive, _):
        yield drive


@pytest.fixture
async def far(drive: Drive) -> SimulatedDrive:
    return drive_named("x")


def writes(far: SimulatedDrive | ScriptedDrive) -> list[str]:
    """List the records that were sent."""
    sent = far.lines if isinstance(far, ScriptedDrive) else lines(far)
    return [line for line in sent if line.startswith("N") and ":" in line]


def files_in(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


# One ------------------------------------------------------------------------------------------------------------------


async def test_a_record_is_written_once_and_read_back(drive: Drive, far: SimulatedDrive) -> None:
    written = await drive.program.write(5, "posr 10  speed 50")
    assert (written.number, written.text, written.is_verified) == (5, "POSR 10 SPEED 50", True)
    assert lines(far)[-2:] == ["N005: POSR 10 SPEED 50", "N5"]
    assert far.program == {5: "POSR 10 SPEED 50"}
    assert await drive.program.read(5) == "POSR 10 SPEED 50"
    assert await drive.program.read_record(5) == PreparedSpeed(Decimal(10), Decimal(50))
    assert await drive.program.read(6) == "END"


async def test_a_record_of_the_program_package_is_written(drive: Drive) -> None:
    await drive.program.write(1, MoveTo(Decimal("12.25")))
    assert await drive.program.read(1) == "POSA 12.25"


@pytest.mark.parametrize(
    "text", ["IF V1<=V2 GOTO 3", "IF V1<>-5.5 GOSUB 3", "IF S1>=100 GOTO 9", r"V1=V2\3", "V1=V2%3"]
)
async def test_signs_of_comparison_and_arithmetic_are_no_signs_of_the_line(drive: Drive, text: str) -> None:
    assert (await drive.program.write(250, text)).is_verified
    assert await drive.program.read(250) == text


@pytest.mark.parametrize(
    "record",
    [
        *("", "POSA", "POSA 1.255", "GOTO 251", "POSA 5$", "POSA 5\rEND", "END,", "POSA 5\nPOSA 6", "N001: END"),
        *("POSR -1 SPEED 600", "IF V39=-8388607.123456 GOTO 250"),
        *(Goto(302), Goto(0), Outputs(0, (True,)), MoveTo(Decimal("1.255")), MoveTo(Decimal("NaN")), object()),
    ],
)
async def test_what_is_no_record_or_too_long_is_refused_before_a_byte_is_sent(
    drive: Drive, far: SimulatedDrive, record: str
) -> None:
    before = lines(far)
    assert isinstance(await ending(drive.program.write(1, record)), InvalidCommandError)
    assert lines(far) == before


@pytest.mark.parametrize("number", [0, 251, -1, True, 1.0, "1", None])
async def test_a_number_that_no_record_has_is_refused(drive: Drive, far: SimulatedDrive, number: int) -> None:
    before = lines(far)
    program = drive.program
    for work in (
        program.read(number),
        program.read_record(number),
        program.write(number, "END"),
        program.teach(number),
        program.upload(first=number),
    ):
        assert isinstance(await ending(work), InvalidCommandError)
    assert lines(far) == before


async def test_the_form_in_which_a_record_is_sent_is_part_of_the_dialect() -> None:
    async with bench(settings=DriveSettings(dialect=Dialect(record="N{n} {text}"))) as (drive, far):
        await drive.program.write(5, "POSA 250")
        assert "N5 POSA 250" in lines(far)
        assert await drive.program.read(5) == "POSA 250"


async def test_inches_have_three_decimals() -> None:
    async with bench(settings=DriveSettings(decimals=3), decimals=3) as (drive, _):
        assert (await drive.program.write(1, "POSA 1.125")).is_verified


async def test_a_record_that_the_drive_cannot_show_whole_is_written_and_not_called_verified(drive: Drive) -> None:
    written = await drive.program.write(5, "POSR 1234567.25 OUTPUT O10=1")
    assert written.text == "POSR 1234567.25 OUTPUT O"
    assert not written.is_verified
    assert isinstance(await ending(drive.program.read_record(5)), UnexpectedAnswerError)


async def test_a_record_that_may_be_cut_is_not_taken_for_another() -> None:
    async with scripted({"N5": "N005: POSR 10 SPEED 5 ACCEL 25"}) as (drive, _):
        error = await ending(drive.program.read_record(5))
        assert isinstance(error, UnexpectedAnswerError)
        assert error.received == "POSR 10 SPEED 5 ACCEL 25"
        assert not (await drive.program.write(5, "POSR 10 SPEED 5 ACCEL 25")).is_verified


@pytest.mark.parametrize("shown", ["POSA 25", "POSA 251", "END", ""])
async def test_a_record_that_reads_back_as_something_else_is_told(shown: str) -> None:
    async with scripted({"N5": f"N005: {shown}"}) as (drive, far):
        error = await ending(drive.program.write(5, "POSA 250"))
        assert isinstance(error, UnexpectedAnswerError)
        assert f"reads back as {shown!r}" in str(error)
        assert writes(far) == ["N005: POSA 250"]


@pytest.mark.parametrize("shown", ["N005: PA250", "N5: POSA 250.00", "N005 POSA250"])
async def test_a_drive_may_word_the_same_record_otherwise(shown: str) -> None:
    async with scripted({"N5": shown}) as (drive, _):
        assert (await drive.program.write(5, "POSA 250")).is_verified


async def test_a_record_whose_acknowledgement_is_lost_is_found_by_reading_and_not_sent_again() -> None:
    async with scripted({"N005: POSA 250": None, "N5": "N005: POSA 250"}) as (drive, far):
        assert (await drive.program.write(5, "POSA 250")).is_verified
        assert writes(far) == ["N005: POSA 250"]


async def test_a_record_that_was_lost_on_its_way_says_what_is_there() -> None:
    async with scripted({"N005: POSA 250": None, "N5": "N005: END"}) as (drive, far):
        error = await ending(drive.program.write(5, "POSA 250"))
        assert isinstance(error, AnswerTimeoutError)
        assert "shows 'END' now" in str(error)
        assert writes(far) == ["N005: POSA 250"]


async def test_a_record_is_refused_while_the_axis_moves_or_a_program_runs(drive: Drive, far: SimulatedDrive) -> None:
    move = drive.move_to(100)
    for work in (drive.program.write(1, "END"), drive.program.teach(1), drive.program.download(MANUAL)):
        assert "move_to(100) is running" in str(await ending(work))
    await move
    far.load_program(["WAIT 1000", "END"])
    await drive.program.start(1)
    for work in (drive.program.write(1, "END"), drive.program.teach(1), drive.program.download(MANUAL)):
        error = await ending(work)
        assert isinstance(error, MoveActiveError)
        assert "a program runs" in str(error)
    assert writes(far) == []


async def test_a_record_is_refused_while_somebody_else_moves_the_axis() -> None:
    async with scripted({"S17": "S017: 00100010"}) as (drive, far):
        assert "the axis moves" in str(await ending(drive.program.write(1, "END")))
        assert writes(far) == []


async def test_no_position_is_read_for_a_record_while_the_axis_moves() -> None:
    async with scripted({"S17": "S017: 00100010"}) as (drive, far):
        asked = far.lines.count("S1")
        assert isinstance(await ending(drive.program.teach(1)), MoveActiveError)
        assert far.lines.count("S1") == asked


async def test_a_position_is_taught(drive: Drive) -> None:
    await drive.move_to(12.34)
    assert await drive.program.teach(7) == 12.34
    assert await drive.program.read(7) == "POSA 12.34"


# Up -------------------------------------------------------------------------------------------------------------------


async def test_the_program_of_the_manual_goes_down_and_comes_up_the_same(drive: Drive, far: SimulatedDrive) -> None:
    done = await drive.program.download(MANUAL)
    assert done.verified == (1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12)
    assert done.changed[4] == ("END", "IF I7=1 GOTO 9")
    assert done.unchanged == 2, "N006 and N013 are END already"
    assert (done.not_verifiable, done.warnings, done.was_dry_run) == ((), (), False)
    assert writes(far) == [line for line in wire_lines(parse(MANUAL)) if not line.endswith("END")]
    seen: list[tuple[int, int]] = []
    uploaded = await drive.program.upload(on_progress=lambda *step: seen.append(step))
    assert uploaded.listing() == MANUAL
    assert uploaded.program == parse(MANUAL)
    assert uploaded.unreadable == {}
    assert seen[0] == (1, 250)
    assert seen[-1] == (250, 250)


async def test_a_part_is_uploaded(drive: Drive, far: SimulatedDrive) -> None:
    await drive.program.download(MANUAL)
    before = len(lines(far))
    assert (await drive.program.upload(first=4, last=6)).listing() == "".join(MANUAL.splitlines(keepends=True)[3:6])
    assert lines(far)[before:] == ["N4", "N5", "N6"]
    assert isinstance(await ending(drive.program.upload(first=6, last=4)), InvalidCommandError)


async def test_records_that_cannot_be_read_are_kept_as_text() -> None:
    answers = {"N1": "N001: POSA 5", "N2": "N002: CAM 5", "N3": "E88", "N4": "N004: POSR 10 SPEED 5 ACCEL 25"}
    async with scripted({**answers, **{f"N{n}": f"N{n:03d}: END" for n in range(5, 251)}}) as (drive, _):
        uploaded = await drive.program.upload()
        assert uploaded.unreadable == {2: "CAM 5", 3: "E88", 4: "POSR 10 SPEED 5 ACCEL 25"}
        assert uploaded.program == {1: MoveTo(Decimal(5)), 5: End()}
        rows = uploaded.listing().splitlines()
        assert rows[1].startswith("; N002: CAM 5  ; cannot be read")
        assert parse(uploaded.listing()) == uploaded.program


async def test_a_saved_program_is_a_listing_that_can_be_downloaded(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    await drive.program.download(MANUAL)
    uploaded = await drive.program.save(path)
    assert path.read_text().partition("\n")[0].startswith("; Program of x, a COMPAX drive")
    assert parse(path.read_text()) == uploaded.program == parse(MANUAL)
    await drive.program.write(9, "POSA 1000")
    for source in (path, str(path)):
        would = await drive.program.download(source, dry_run=True)
        assert would.changed == {9: ("POSA 1000", "POSA 1250")}
    assert files_in(tmp_path) == ["x.txt"]


async def test_a_listing_that_cannot_be_saved_leaves_the_old_one(
    drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.txt"
    path.write_text("old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        await drive.program.save(path)
    assert path.read_text() == "old"
    assert files_in(tmp_path) == ["x.txt"]


# Down -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "source",
    [
        "N001: POSA 5\nN002: END\n",
        ["N001: POSA 5", "N002: END"],
        {1: MoveTo(Decimal(5)), 2: End()},
        Program({1: MoveTo(5), 2: End()}),
        "n1:pa5\r\nN2 end",
    ],
)
async def test_a_program_comes_as_text_as_lines_or_as_records(
    drive: Drive, far: SimulatedDrive, source: str | dict[int, Record]
) -> None:
    assert (await drive.program.download(source)).verified == (1,)
    assert far.program == {1: "POSA 5"}


async def test_only_what_differs_is_written(drive: Drive, far: SimulatedDrive) -> None:
    await drive.program.download(MANUAL)
    before = len(writes(far))
    seen: list[tuple[int, int]] = []
    changed = MANUAL.replace("POSA 1250", "POSA 1000").replace("WAIT 500", "WAIT 50")
    done = await drive.program.download(changed, on_progress=lambda *step: seen.append(step))
    assert writes(far)[before:] == ["N009: POSA 1000", "N011: WAIT 50"]
    assert seen == [(1, 2), (2, 2)]
    assert done.unchanged == 11


async def test_what_cannot_be_compared_is_written_and_told(drive: Drive, far: SimulatedDrive) -> None:
    text = "N001: POSR 1234567.25 OUTPUT O10=1\nN002: POSA 5\nN003: END\n"
    for _ in range(2):
        done = await drive.program.download(text)
        assert done.not_verifiable == (1,)
    assert done.verified == ()
    assert writes(far).count("N001: PR 1234567.25 OT O10=1") == 2


async def test_a_dry_run_writes_nothing_and_is_possible_while_a_program_runs(drive: Drive, far: SimulatedDrive) -> None:
    far.load_program(["WAIT 1000", "END"])
    await drive.program.start(1)
    would = await drive.program.download("N001: POSA 5\nN002: END\n", dry_run=True)
    assert would.was_dry_run
    assert would.changed == {1: ("WAIT 1000", "POSA 5")}
    assert (would.verified, would.not_verifiable) == ((), ())
    assert writes(far) == []


async def test_records_that_are_not_named_stay_unless_they_are_to_be_cleared(drive: Drive, far: SimulatedDrive) -> None:
    far.load_program(["POSA 9", "END"], first=100)
    far.load_program(["POSA 8"], first=250)
    await drive.program.download(MANUAL)
    assert far.program[100] == "POSA 9"
    done = await drive.program.download(MANUAL, clear_rest=True)
    assert done.changed == {100: ("POSA 9", "END"), 250: ("POSA 8", "END")}
    assert done.unchanged == 248
    assert far.program == {n: record_text(each) for n, each in parse(MANUAL).items() if each != End()}
    await drive.program.download({}, clear_rest=True)
    assert far.program == {}


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("N001: GOTO 7\n", "no N007"),
        ("N001: POSA 5\nN002: RUN\n", "line 2"),
        ("N001: REPEAT 5\nN002: END\nN003: POSA 1.255\nN004: END", "line 3"),
        ("N001: IF V39=-8388607.123456 GOTO 2\nN002: END\n", "even if abbreviated"),
        ("", "no record"),
        ("; nothing\n", "no record"),
        ([], "no record"),
        ({}, "no record"),
        ({300: End()}, "N300"),
        ({1: Goto(302), 2: End()}, "means Password"),
        ({1: "END"}, "no record of a program"),
    ],
)
async def test_a_listing_with_errors_is_refused_before_a_byte_is_sent(
    drive: Drive, far: SimulatedDrive, source: str, says: str
) -> None:
    before = lines(far)
    error = await ending(drive.program.download(source))
    assert isinstance(error, InvalidCommandError)
    assert says in str(error)
    assert lines(far) == before


@pytest.mark.parametrize(("data", "says"), [(b"N001: \xff\n", "is no listing"), (b";" * 300_000, "larger than")])
async def test_a_file_that_is_no_listing_is_refused_before_a_byte_is_sent(
    drive: Drive, far: SimulatedDrive, tmp_path: Path, data: bytes, says: str
) -> None:
    path = tmp_path / "x.txt"
    path.write_bytes(data)
    before = lines(far)
    error = await ending(drive.program.download(path))
    assert isinstance(error, InvalidCommandError)
    assert says in str(error)
    with pytest.raises(FileNotFoundError):
        await drive.program.download("missing.txt")
    assert lines(far) == before


async def test_warnings_are_told_and_do_not_refuse(drive: Drive) -> None:
    done = await drive.program.download("N001: POSA .V5\nN002: END\nN010: END\n")
    assert [each.severity for each in done.warnings] == [Severity.WARNING] * 2
    assert "V5 is read, but no record writes it" in str(done.warnings[0])


async def test_a_refusal_in_the_middle_says_how_far_it_got_and_can_be_rolled_back() -> None:
    # The client believes in inches, the drive has two decimals: it refuses the third record.
    async with bench(settings=DriveSettings(decimals=3)) as (drive, far):
        far.load_program(["POSA 1", "POSA 2", "POSA 3", "POSA 4", "END"])
        before = dict(far.program)
        text = "N001: POSA 1.5\nN002: POSA 2\nN003: POSA 3.125\nN004: POSA 4.5\nN005: END\n"
        error = await ending(drive.program.download(text))
        assert isinstance(error, RestoreIncompleteError)
        assert error.applied == {1: ("POSA 1", "POSA 1.5")}
        assert error.not_applied == (3, 4)
        assert error.uncertain == {}
        assert error.sent == "N003: POSA 3.125"
        assert "N003: POSA 3.125 was not taken" in str(error)
        assert "applied: N001; not applied: N003, N004" in str(error)
        assert isinstance(error.__cause__, CommandRejectedError)
        assert far.program == {**before, 1: "POSA 1.5"}
        await drive.program.roll_back(error)
        assert far.program == before


async def test_a_record_of_uncertain_fate_is_told_apart_and_rolled_back_as_well() -> None:
    answers = {"N1": "N001: POSA 1", "N2": "N002: POSA 2", "N3": "N003: POSA 3", "N4": "N004: END"}
    async with scripted(answers) as (drive, far):

        def obey(line: str) -> None:
            if line == "N001: POSA 5":
                far.answers["N1"] = line
            if line == "N002: POSA 6":
                far.answers["N2"] = "N002: POSA 66"

        far.on_line = obey
        error = await ending(drive.program.download("N001: POSA 5\nN002: POSA 6\nN003: POSA 7\nN004: END\n"))
        assert isinstance(error, RestoreIncompleteError)
        assert error.applied == {1: ("POSA 1", "POSA 5")}
        assert error.uncertain == {2: ("POSA 2", "POSA 6")}
        assert error.not_applied == (3,)
        assert "uncertain: N002" in str(error)
        far.answers |= {"N1": "N001: POSA 1", "N2": "N002: POSA 2"}
        before = len(far.lines)
        await drive.program.roll_back(error)
        assert [line for line in far.lines[before:] if ":" in line] == ["N002: POSA 2", "N001: POSA 1"]


async def test_what_was_never_shown_whole_is_not_rolled_back_by_guessing() -> None:
    async with bench(settings=DriveSettings(decimals=3)) as (drive, far):
        far.load_program(["POSA 1", "POSR 1234567.25 OUTPUT O10=1"])
        text = "N001: POSA 5\nN002: WAIT 5\nN003: POSA 3.125\nN004: END\n"
        error = await ending(drive.program.download(text))
        assert isinstance(error, RestoreIncompleteError)
        assert "N002 ('POSR 1234567.25 OUTPUT O')" in str(await ending(drive.program.roll_back(error)))
        assert far.program == {1: "POSA 1", 2: "WAIT 5"}


async def test_a_program_that_begins_to_run_ends_a_download(drive: Drive, far: SimulatedDrive) -> None:
    far.load_program(["WAIT 1", "GOTO 1"], first=100)

    def begin(done: int, _: int) -> None:
        if done == 3:
            far.receive(b"GOTO100\rSTART\r", asyncio.get_running_loop().time())
            assert far.served_by is not None
            far.served_by.changed()

    error = await ending(drive.program.download(MANUAL, on_progress=begin))
    assert isinstance(error, RestoreIncompleteError)
    assert (tuple(error.applied), error.uncertain) == ((1, 2, 3), {})
    assert isinstance(error.__cause__, MoveActiveError)
    assert len(writes(far)) == 3
    await drive.stop()


async def test_a_lost_line_ends_a_download_with_what_is_known(drive: Drive, far: SimulatedDrive) -> None:
    def unplug(done: int, _: int) -> None:
        if done == 2:
            far.deaf = True

    error = await ending(drive.program.download(MANUAL, on_progress=unplug))
    assert isinstance(error, RestoreIncompleteError)
    assert isinstance(error.__cause__, AnswerTimeoutError)
    assert tuple(error.applied) == (1, 2)
    assert error.uncertain == {}, "the status before it went unanswered, so it was not sent"
    far.deaf = False


async def test_a_record_that_is_lost_on_the_line_is_uncertain() -> None:
    async with bench() as (_, far):
        pass
    cut: list[bytes] = []

    def lose(data: bytes) -> bytes:
        if data.startswith(b"N003:"):
            cut.append(data)
        return b"" if cut else data

    async with served_through(far, "bad", lose) as url, compax_aio.connect(url, name="x") as drive:
        error = await ending(drive.program.download(MANUAL))
        assert isinstance(error, RestoreIncompleteError)
        assert (tuple(error.applied), tuple(error.uncertain)) == ((1, 2), (3,))
        assert cut == [b"N003: REPEAT 10\r"]


async def test_a_download_that_is_cancelled_anywhere_leaves_its_line_usable_and_whole_records(
    drive: Drive, far: SimulatedDrive
) -> None:
    cancelled = 0
    for milliseconds in range(0, 150, 3):
        far.load_program(["END"] * 13)
        task = asyncio.ensure_future(drive.program.download(MANUAL))
        await asyncio.sleep(milliseconds / 1000 + 0.0001)
        task.cancel()
        await asyncio.wait([task])
        cancelled += task.cancelled()
        assert await drive.position() == 0
        wanted = parse(MANUAL)
        assert all(text == record_text(wanted[number]) for number, text in far.program.items())
    assert cancelled > 30
    assert drive.stats.timeouts == 0
    await drive.program.download(MANUAL)
    assert (await drive.program.upload()).listing() == MANUAL


def _can_be_sent(record: Record) -> bool:
    return len(shortest_line(1, record)) <= 30


@given(programs)
@settings(max_examples=40)
def test_whatever_records_go_down_what_comes_up_is_no_other(program: Program) -> None:
    program = Program(dict(enumerate((each for each in program.values() if _can_be_sent(each)), start=1)))

    async def run() -> None:
        async with bench(settings=DriveSettings(decimals=3), decimals=3) as (drive, _):
            sent: dict[int, Record] = {}
            for number, record in program.items():
                try:
                    await drive.program.write(number, record)
                except CommandRejectedError:
                    continue  # there are records that the simulated drive does not have
                sent[number] = parse(listing({number: record}), decimals=3)[number]
            uploaded = await drive.program.upload(last=30)
            for number, record in sent.items():
                if number not in uploaded.unreadable and record != End():
                    assert uploaded.program[number] == record
            assert set(uploaded.program) - set(sent) <= {n for n in uploaded.program if uploaded.program[n] == End()}

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(run())
