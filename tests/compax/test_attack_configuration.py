"""Program memory, parameters and files under attack: whatever happens half way, what the drive has is said exactly."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.compax.program.programs import MANUAL
from tests.compax.test_cancellation import Cancel, Stepper, together_with_the_answer, twice, while_waiting
from tests.fakes.answers import PROMPT, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.promises.bench import ScriptedDrive, bench, ending, lines, scripted

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    Drive,
    DriveSettings,
    InvalidCommandError,
    MoveInDoubtError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from compax_aio.compax.half_done import HalfDone
from compax_aio.compax.program import End, Goto, IfInputs, check, parse
from compax_aio.compax.settings import Dialect
from compax_aio.compax.settings_file import read_settings, write_settings
from compax_aio.link.contract import Lane
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp
from compax_aio.transports.loopback import listen

OLD = ["POSA 1", "POSA 2", "END"]
NEW = "N001: POSA 11\nN002: POSA 2\nN003: WAIT 30\nN004: POSA 44\nN005: END\n"
CHANGED = {1: ("POSA 1", "POSA 11"), 3: ("END", "WAIT 30"), 4: ("END", "POSA 44")}


def files_in(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


VALUES = 'kind = "parameters"\n[parameters]\nP10 = 333\nP40 = 5\nP41 = 6\n'


# Cancelled at every await ---------------------------------------------------------------------------------------------

Work = Callable[[Drive, Path], Coroutine[Any, Any, Any]]


class Run:
    """One piece of work on a fresh drive in a loop of its own, cancelled at one of its awaits; and what was said."""

    def __init__(self, work: Work, folder: Path, at: int | None = None, cancel: Cancel = while_waiting) -> None:
        self.stepper = Stepper(at, cancel)
        self.folder = folder
        self.error: asyncio.CancelledError | None = None
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            runner.run(self._run(work))

    @property
    def notes(self) -> str:
        return "\n".join(getattr(self.error, "__notes__", []))

    async def _run(self, work: Work) -> None:
        async with bench(position=5) as (drive, far):
            far.load_program(OLD)
            task = asyncio.ensure_future(self.stepper.run(work(drive, self.folder)))
            try:
                await task
            except asyncio.CancelledError as error:
                self.error = error
            self.program = dict(far.program)
            self.values = await self.read_values(drive)
            self.sent = lines(far)
            # The line is in step, and the drive protected again.
            assert await drive.position() == 5
            assert not (await drive.status()).password_active
            assert drive.stats.timeouts == 0
            await self.check_account(drive, far)

    async def read_values(self, drive: Drive) -> dict[int, float]:
        return {number: await drive.parameters.read(number) for number in (10, 40, 41)}

    async def check_account(self, drive: Drive, far: SimulatedDrive) -> None:
        """What is said to be applied is there, what is said not to be is not; and it can be taken back."""
        if (left := drive.program.incomplete) is not None:
            said = {**left.applied, **{number: CHANGED[number] for number in left.not_applied}, **left.uncertain}
            assert said == CHANGED
            for number, (old, new) in CHANGED.items():
                text = far.program.get(number, "END")
                assert text == new if number in left.applied else text in {old, new}
                assert text == old or number not in left.not_applied
            assert left.what in self.notes
            await drive.program.roll_back(left)
            assert drive.program.incomplete is None
            assert far.program == {1: "POSA 1", 2: "POSA 2"}
        if (left := drive.parameters.incomplete) is not None:
            for number, (old, new) in left.applied.items():
                assert self.values[number] == new != old
            assert all(self.values[number] == 0 for number in left.not_applied if number != 10)
            assert left.what in self.notes
            async with drive.parameters.unlocked() as parameters:
                await parameters.roll_back(left)
            assert (await self.read_values(drive))[40] == 0


async def download(drive: Drive, _: Path) -> None:
    assert (await drive.program.download(NEW)).changed == CHANGED


async def restore(drive: Drive, folder: Path) -> None:
    path = folder / "p.toml"
    path.write_text(VALUES)
    async with drive.parameters.unlocked() as parameters:
        await parameters.restore(path)
        await parameters.make_valid()


async def look_at_everything(drive: Drive, folder: Path) -> None:
    await drive.program.upload(last=5)
    await drive.program.read_record(3)
    await drive.variables.save(folder / "v.toml")
    await drive.variables.diff(folder / "v.toml")


async def write_and_roll_back(drive: Drive, _: Path) -> None:
    left = RestoreIncompleteError("x", device="x", kind="program", applied={1: ("POSA 1", "POSA 7")}, uncertain={})
    await drive.program.write(1, "POSA 7")
    await drive.program.roll_back(left)


async def run_a_program(drive: Drive, _: Path) -> None:
    await drive.program.start(3)
    await drive.program.wait_finished(1)
    await drive.program.break_off()


@pytest.mark.parametrize("cancel", [while_waiting, together_with_the_answer, twice])
@pytest.mark.parametrize("work", [download, restore, look_at_everything, write_and_roll_back, run_a_program])
def test_work_cancelled_at_any_await_says_what_it_left_and_leaves_the_line_usable(
    work: Work, cancel: Cancel, tmp_path: Path
) -> None:
    whole = Run(work, tmp_path)
    assert whole.error is None
    cancelled = 0
    step = max(1, whole.stepper.awaits // 40)
    for at in range(1, whole.stepper.awaits + 1, step):
        run = Run(work, tmp_path, at, cancel)
        cancelled += run.error is not None
        assert len(run.sent) <= len(whole.sent) + 3
        assert run.sent.count("START") <= 1
        assert not [name for name in files_in(tmp_path) if name.startswith(".")], "half a file is left"
    assert cancelled >= 0.9 * (whole.stepper.awaits // step)


async def test_a_cancelled_download_is_told_by_a_note_in_the_log_and_by_the_drive(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with bench() as (drive, far):
        far.load_program(OLD)
        seen = asyncio.Event()
        task = asyncio.ensure_future(drive.program.download(NEW, on_progress=lambda *_: seen.set()))
        await seen.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError) as caught, caplog.at_level(logging.WARNING):
            await task
        (note,) = caught.value.__notes__
        assert "applied: N001; not applied: N003, N004" in note
        assert note in caplog.text
        left = drive.program.incomplete
        assert left is not None
        assert left.applied == {1: ("POSA 1", "POSA 11")}
        await drive.program.roll_back(left)
        assert far.program == {1: "POSA 1", 2: "POSA 2"}
        assert drive.program.incomplete is None


async def test_a_callback_that_fails_leaves_nothing_half_done_unsaid(tmp_path: Path) -> None:
    def fail(done: int, _: int) -> None:
        if done == 1:
            raise ZeroDivisionError

    async with bench() as (drive, _):
        with pytest.raises(ZeroDivisionError) as caught:
            await drive.program.download(NEW, on_progress=fail)
        assert "applied: N001; not applied: N002, N003, N004" in caught.value.__notes__[0]
        path = tmp_path / "p.toml"
        path.write_text(VALUES.replace("P10 = 333\n", ""))
        with pytest.raises(ZeroDivisionError) as caught:
            await drive.parameters.restore(path, on_progress=fail)
        assert "applied: P40; not applied: P41" in caught.value.__notes__[0]
        assert drive.parameters.incomplete is not None
        await drive.parameters.restore(path)
        assert drive.parameters.incomplete is None


# Lines and answers that are lost, late and doubled --------------------------------------------------------------------


class Unlucky:
    """A drive that remembers what it is told, and has bad luck with one line: the *at*-th after :meth:`begin`."""

    def __init__(self, trouble: str = "", at: int = -1) -> None:
        self.values: dict[str, str] = {"S17": "00000010", "S16": "11010000", "S30": "0 0", "P20": "0"}
        self.written: list[str] = []
        self.far = ScriptedFarEnd(self.answer, delay_s=0.002)
        self.trouble, self.at = trouble, at
        self.lines: int | None = None
        self.starts = 0

    def begin(self) -> None:
        self.lines = 0

    def answer(self, line: str) -> bytes | None:
        if self.lines is not None:
            self.lines += 1
        is_unlucky = self.lines is not None and self.lines - 1 == self.at
        if is_unlucky and self.trouble == "line lost":
            return None
        answer = self.obey(line)
        if not is_unlucky or self.trouble == "":
            return answer
        if self.trouble == "late":
            asyncio.get_running_loop().call_later(1.3, self.far.say, answer)
        if self.trouble == "very late":
            asyncio.get_running_loop().call_later(5, self.far.say, answer)
        return {"doubled": answer * 2, "garbled": b"\xf8" + answer}.get(self.trouble)

    def obey(self, line: str) -> bytes:
        if found := re.fullmatch(r"(N\d+): (.*)|([PV]\d+)=(.*)", line):
            self.written.append(line)
            name, value = (found[1], found[2]) if found[1] else (found[3], found[4])
            self.values[f"{name[0]}{int(name[1:])}"] = value
        elif line == "START":
            self.starts += 1
            self.values["S17"] = "00010010"
        elif line[0] in "SPN" and line[1:].isdigit():
            default = "END" if line[0] == "N" else "0"
            return f"{line[0]}{int(line[1:]):03d}: {self.values.get(line, default)}".encode() + PROMPT
        return PROMPT

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[Drive]:
        with await listen("unlucky", lambda: self.far) as listener:
            async with compax_aio.connect(listener.url, name="x") as drive:
                self.begin()
                yield drive


TROUBLES = ["line lost", "answer lost", "late", "very late", "doubled", "garbled"]


async def outcome_of(work: Coroutine[Any, Any, Any]) -> CompaxError | None:
    try:
        await work
    except CompaxError as error:
        return error
    return None


def check_told(error: CompaxError | None, far: Unlucky, wanted: dict[str, str], kind: str) -> None:
    """Compare what is said with what the far end has."""
    assert len(far.written) == len(set(far.written)), "nothing is written twice"
    has = {name: far.values.get(name, "0" if name[0] == "P" else "END") for name in wanted}
    if error is None:
        assert has == wanted
    elif isinstance(error, RestoreIncompleteError):
        assert error.kind == kind
        for number in error.applied:
            assert has[f"{kind[0].upper() if kind[0] == 'p' and kind != 'program' else 'N'}{number}"] in wanted.values()
        for name, value in has.items():
            number = int(name[1:])
            if number in error.not_applied:
                assert value != wanted[name]
            elif number not in error.uncertain:
                assert value == wanted[name], "applied, or it was so before"
    else:
        assert not far.written, "nothing was written when something else is raised"


@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_download_over_a_line_in_trouble_is_told_truly_wherever_it_comes(trouble: str) -> None:
    listing = "N001: POSA 11\nN002: WAIT 30\nN003: END\n"
    wanted = {"N1": "POSA 11", "N2": "WAIT 30", "N3": "END"}
    completed = incomplete = 0
    for at in range(14):
        far = Unlucky(trouble, at)
        async with far.connect() as drive:
            error = await outcome_of(drive.program.download(listing))
            check_told(error, far, wanted, "program")
            far.at = -1
            completed += error is None
            incomplete += isinstance(error, RestoreIncompleteError)
            await asyncio.sleep(10)
            assert await drive.program.read(3) == "END", "and the line is in step"
            if isinstance(error, RestoreIncompleteError):
                await drive.program.roll_back(error)
                assert {far.values.get(name, "END") for name in ("N1", "N2")} == {"END"}
    assert completed + incomplete > 0
    if trouble == "doubled":
        assert completed == 14


@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_restore_over_a_line_in_trouble_is_told_truly_wherever_it_comes(trouble: str, tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text('kind = "parameters"\n[parameters]\nP40 = 5\nP41 = 6\n')
    wanted = {"P40": "5.000", "P41": "6.000"}
    for at in range(7):
        far = Unlucky(trouble, at)
        async with far.connect() as drive:
            check_told(await outcome_of(drive.parameters.restore(path)), far, wanted, "parameters")
            far.at = -1
            await asyncio.sleep(10)
            assert await drive.parameters.read(1) == 0, "and the line is in step"


@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_start_over_a_line_in_trouble_is_sent_once_and_told_truly_wherever_it_comes(trouble: str) -> None:
    for at in range(6):
        far = Unlucky(trouble, at)
        async with far.connect() as drive:
            error = await outcome_of(drive.program.start(5))
            far.at = -1
            assert far.far.lines.count("START") <= 1
            if error is None:
                assert far.starts == 1
            elif not isinstance(error, MoveInDoubtError):
                assert far.starts == 0, f"{trouble} at {at}: {error}"
            await asyncio.sleep(10)
            assert (await drive.status()).program_running == bool(far.starts), "and the line is in step"
            far.values["S17"] = "00000010"


# How drives show records ----------------------------------------------------------------------------------------------

FORMS: dict[str, Callable[[int, str], str]] = {
    "as inferred": lambda number, text: f"N{number:03d}: {text}",
    "blank for a colon": lambda number, text: f"N{number} {text}",
    "three digits, blank": lambda number, text: f"N{number:03d} {text}",
    "no blank": lambda number, text: f"N{number:03d}:{text}",
    "equals": lambda number, text: f"N{number:03d}={text}",
    "padded": lambda number, text: f"N{number:03d}:   {text}",
    "small letters": lambda number, text: f"N{number:03d}: {text.lower()}",
    "blanks around": lambda number, text: f" N{number:03d} :  {text}  ",
    "no blanks": lambda number, text: f"N{number:03d}:{text.replace(' ', '')}",
    "zeros": lambda number, text: f"N{number:03d}: {text}.00" if "POSA" in text else f"N{number:03d}: {text}",
}
RECORDS = {
    **{number: text.partition(": ")[2] for number, text in enumerate(MANUAL.splitlines(), start=1)},
    20: "IF I7=10101010 GOTO 125",
    21: "POSR 1234567.25 OUTPUT O10=1",
    22: "POSR 10 SPEED 50 ACCEL 250",
    23: "END",
    125: "END",
}


class Showing(Unlucky):
    """Shows records in a form of its own, cut at 30 characters."""

    def __init__(self, form: Callable[[int, str], str]) -> None:
        super().__init__()
        self.form = form

    def obey(self, line: str) -> bytes:
        answer = super().obey(line)
        if line[0] == "N" and line[1:].isdigit():
            return self.form(int(line[1:]), self.values.get(line, "END"))[:30].encode() + PROMPT
        return answer


def long_text(line: str) -> str:
    """Say in full what may have been written abbreviated."""
    return line.replace("PR", "POSR ").replace("OT", " OUTPUT ").replace("SD", " SPEED ").replace("AL", " ACCEL ")


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS.keys())
@pytest.mark.usefixtures("nothing_left_behind")
async def test_whatever_form_a_drive_shows_records_in_nothing_is_misread(form: Callable[[int, str], str]) -> None:
    far = Showing(form)
    listing = "".join(f"N{number:03d}: {text}\n" for number, text in RECORDS.items())
    async with far.connect() as drive:
        done = await drive.program.download(listing)
        assert set(done.verified) | set(done.not_verifiable) == set(done.changed)
        assert set(done.not_verifiable) <= {20, 21, 22}
        uploaded = await drive.program.upload(last=23)
        wanted = parse(listing)
        for number, record in uploaded.program.items():
            assert record == wanted.get(number, End())
        assert set(uploaded.unreadable) <= {20, 21, 22}


async def test_a_padded_record_that_fills_the_answer_is_not_believed() -> None:
    async with scripted({"N5": "N005:   IF I7=10101010 GOTO 125"[:30]}) as (drive, _):
        uploaded = await drive.program.upload(first=5, last=5)
        assert uploaded.unreadable == {5: "IF I7=10101010 GOTO 12"}
        error = await ending(drive.program.read_record(5))
        assert isinstance(error, UnexpectedAnswerError)
    async with scripted({"N5": "N005:   IF I7=1010101 GOTO 12"[:28]}) as (drive, _):
        assert await drive.program.read_record(5) == IfInputs(7, tuple(map(bool, (1, 0, 1, 0, 1, 0, 1))), Goto(1))


async def test_what_stands_behind_a_semicolon_in_an_answer_is_no_comment() -> None:
    async with scripted({"N1": "N001: POSA 5;x"}) as (drive, _):
        assert isinstance(await ending(drive.program.write(1, "POSA 5")), UnexpectedAnswerError)


# What is said to be a listing -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
async def test_listings_of_other_editors_are_read(end: str, mark: str, tmp_path: Path) -> None:
    text = mark + MANUAL.replace("\n", end)
    path = tmp_path / "x.txt"
    path.write_bytes(text.encode())
    async with bench() as (drive, _):
        for source in (path, str(path), text, iter(text.split(end))):
            assert len((await drive.program.download(source, dry_run=True)).changed) == 11


NO_LISTINGS: dict[str, Any] = {
    "utf-16": MANUAL.encode("utf-16"),
    "nul": b"N001: END\0\n",
    "control": b"N001: \x1bEND\n",
    "unicode": "N001: POSA ٣\n".encode(),
    "no-break": "N001:\u00a0END\n".encode(),
    "twice": b"N001: END\nN1: END\n",
    "thousands of digits": b"N" + b"1" * 9000 + b": END\nN002: POSA " + b"1" * 9000,
    "junk": bytes(range(256)) * 100,
    "large": b"N001: END\n" * 1_000_000,
    "long comment": b";" * 300_000 + b"\nN001: END\n",
}


@pytest.mark.parametrize("data", NO_LISTINGS.values(), ids=NO_LISTINGS.keys())
async def test_what_is_no_listing_is_refused_before_a_byte_is_sent(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_bytes(data)
    async with bench() as (drive, far):
        before = lines(far)
        for source in (path, data.decode("latin-1") + "\n", [data.decode("latin-1")]):
            assert isinstance(await ending(drive.program.download(source)), InvalidCommandError)
        assert lines(far) == before


async def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    async with bench() as (drive, far):
        before = lines(far)
        with pytest.raises(IsADirectoryError):
            await drive.program.download(tmp_path)
        with pytest.raises(FileNotFoundError):
            await drive.program.download(str(tmp_path / "missing"))
        assert isinstance(await ending(drive.program.download("POSA\0")), InvalidCommandError)
        assert lines(far) == before


@pytest.mark.parametrize("line", ["N1:", "N1E", "xyz", "N001: POSA 5", "N001: IF V39=-8388607.12 GOTO 25x"])
def test_a_listing_that_is_nothing_but_errors_is_read_no_further_than_that_is_useful(line: str) -> None:
    problems = check(f"{line}\n" * 20_000)
    assert len(problems) < 260
    assert "so many errors" in problems[-1].message


def test_notes_do_not_keep_a_long_listing_from_being_read() -> None:
    text = "".join(f"N{number:03d}: IF E1=1 GOTO 250\n" for number in range(1, 250)) + "N250: END\n\n\n"
    problems = check(text)
    assert len(problems) == 249
    assert "so many" not in str(problems)


@given(st.binary(max_size=300) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_file_is_a_listing_or_refused_as_none(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.txt"
    path.write_bytes(data)

    async def run() -> None:
        async with bench() as (drive, _):
            error = await outcome_of(drive.program.download(path, dry_run=True))
            assert error is None or isinstance(error, InvalidCommandError)

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(run())


# Files that are written -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("broken", ["os.fsync", "pathlib.Path.open", "pathlib.Path.replace"])
async def test_a_disk_that_takes_nothing_leaves_every_old_file_and_no_other(
    broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x"
    path.write_text("old")

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    async with bench() as (drive, _):
        for save in (drive.variables.save, drive.program.save):
            with monkeypatch.context() as patch:
                patch.setattr(broken, refuse)
                with pytest.raises(PermissionError):
                    await save(path)
        with monkeypatch.context() as patch:
            patch.setattr(broken, refuse)
            with pytest.raises(PermissionError):
                write_settings(path, DriveSettings())
        assert path.read_text() == "old"
        assert files_in(tmp_path) == ["x"]


@pytest.mark.skipif(sys.platform == "win32", reason="links and permissions are those of Unix")
async def test_a_link_stays_a_link_and_permissions_stay_as_they_are(tmp_path: Path) -> None:
    real, link, new = tmp_path / "real", tmp_path / "link", tmp_path / ("n" * 250)
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    async with bench() as (drive, _):
        await drive.variables.save(link)
        await drive.variables.save(new)
    assert link.is_symlink()
    assert real.read_text() != "old"
    assert real.stat().st_mode & 0o777 == 0o640
    plain = tmp_path / "plain"
    plain.write_text("")
    assert new.stat().st_mode == plain.stat().st_mode, "what others may do is up to the umask, as with any file"


async def test_a_file_cannot_take_the_place_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    async with bench() as (drive, _):
        with pytest.raises(OSError, match="directory"):
            await drive.variables.save(tmp_path / "folder")
    assert files_in(tmp_path) == ["folder"]


async def test_what_was_not_sent_is_not_saved(tmp_path: Path) -> None:
    """The resolution of variables is inferred: a drive may have more."""
    far = Unlucky()
    far.values |= {"P1": "1.23456", "P10": "100.5", "P2": "33.3", "P3": "123456789.125"}
    path = tmp_path / "p.toml"
    async with far.connect() as drive:
        saved = await drive.parameters.save(path)
    text = path.read_text()
    for line in ("P1 = 1.23456 ", "P2 = 33.300 ", "P3 = 123456789.125", "P10 = 100.5 ", "P50 = 0\n"):
        assert line in text
    assert saved[10] == 100.5


async def test_no_name_and_no_unit_breaks_a_file(tmp_path: Path) -> None:
    evil = 'x"\nP249 = 7\r\u2028\ud800\\'
    path = tmp_path / "p.toml"
    far = Unlucky()
    with await listen("evil", lambda: far.far) as listener:
        async with compax_aio.connect(listener.url, name=evil, settings=DriveSettings(unit=evil)) as drive:
            saved = await drive.parameters.save(path)
            assert await drive.parameters.diff(path) == ()
            await drive.program.save(tmp_path / "n.txt")
    assert saved[249] == 0
    assert "\nP249 = 7" not in path.read_text()
    assert [line[:1] for line in (tmp_path / "n.txt").read_text().split("\n")[:2]] == [";", "N"]


# Files that are read --------------------------------------------------------------------------------------------------

BAD_VALUES = [
    "1e400", "-1e400", "nan", "inf", "1" + "0" * 400, "1" * 5000, "0x" + "f" * 4000, "true", '"5"', "[5]", "{x=5}",
    "2024-01-01", "12:00:00", "5.00001", "1.1234567", "40000001", "-40000000.5",
]  # fmt: skip


@pytest.mark.parametrize("value", BAD_VALUES)
async def test_a_value_that_no_drive_has_is_refused_before_a_byte_is_sent(value: str, tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    async with bench() as (drive, far):
        before = lines(far)
        for values, kind, name in ((drive.parameters, "parameters", "P1"), (drive.variables, "variables", "V1")):
            path.write_text(f'kind = "{kind}"\n[{kind}]\n{name} = {value}\n')
            for work in (values.restore(path), values.diff(path)):
                assert isinstance(await ending(work), InvalidCommandError)
        assert lines(far) == before


@pytest.mark.parametrize("key", ['"P٣"', '"P1 "', '"p1"', "P0", "P0001", '""', "P-1", '"P1\\n"', "S1"])
async def test_a_key_that_names_no_parameter_is_refused(key: str, tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(f'kind = "parameters"\n[parameters]\n{key} = 1\n')
    async with bench() as (drive, _):
        assert isinstance(await ending(drive.parameters.restore(path)), InvalidCommandError)


async def test_files_of_other_editors_are_read(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_bytes(b"\xef\xbb\xbf" + VALUES.replace("\n", "\r\n").encode())
    async with bench() as (drive, _):
        assert len(await drive.parameters.diff(path)) == 3
    path.write_bytes(b'\xef\xbb\xbfunit = "mm"\r\n')
    assert read_settings(path).unit == "mm"


WRONG = [
    "0", "1", "-1", "2.5", "1e400", "nan", "1" * 5000, "1" + "0" * 400, "true", '""', '"x"', '"\\u0000"', "[]", "[1]",
    "[1, 2]", "[nan, 2]", "[true, 2]", "[[1], 2]", "{}", "{a = 1}", "{1 = 2}", "{1 = {name = 5}}", "2024-01-01",
    "12:00:00", "0x" + "f" * 4000,
    '"' + "x" * 5000 + '"', '{"' + "1" * 5000 + '" = {name = "mm"}}', '{"٣" = {name = "mm"}}',
    '"(E+)+$("', '"{n}{text}{x}"', '"{n:>99}{text}"', '"{n.__class__}{text}"',
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong[:24])
def test_a_setting_of_any_wrong_type_is_refused_or_means_something(wrong: str, tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    texts = [f"{each.name} = {wrong}\n" for each in fields(DriveSettings)]
    texts += [f"[dialect]\n{each.name} = {wrong}\n" for each in fields(Dialect)]
    texts += [f"[units.1]\nname = {wrong}\n", f'[units.1]\nname = "mm"\ndecimals = {wrong}\n']
    for text in texts:
        path.write_text(text)
        with contextlib.suppress(InvalidCommandError):
            read_settings(path)


@pytest.mark.parametrize("pattern", ["(FAULT)", r"E(\d)?X", "()"])
async def test_a_pattern_that_finds_no_code_finds_no_error(pattern: str) -> None:
    async with scripted({"QUIT": "FAULT EX"}, settings=DriveSettings(error_pattern=pattern)) as (drive, _):
        assert isinstance(await ending(drive.quit()), UnexpectedAnswerError)
        assert drive.is_open


# Password and VP ------------------------------------------------------------------------------------------------------


async def test_blocks_that_overlap_keep_the_password_off_until_the_last_is_left() -> None:
    async with bench() as (drive, far):

        async def write(number: int, after_s: float) -> None:
            async with drive.parameters.unlocked() as parameters:
                await asyncio.sleep(after_s)
                await parameters.write(number, 5)

        await asyncio.gather(*(write(10 + number, number) for number in range(3)), write(15, 2.001))
        assert not (await drive.status()).password_active
        assert lines(far).count("GOTO 270") == 1


async def test_a_block_that_begins_while_another_is_being_locked_is_unlocked() -> None:
    for after_s in (0.0001, 0.001, 0.003, 0.005, 0.007):
        async with bench() as (drive, _):
            leave = asyncio.Event()

            async def one(drive: Drive = drive, leave: asyncio.Event = leave) -> None:
                async with drive.parameters.unlocked():
                    await leave.wait()

            task = asyncio.ensure_future(one())
            await asyncio.sleep(1)
            leave.set()
            await asyncio.sleep(after_s)
            async with drive.parameters.unlocked() as parameters:
                await task
                await parameters.write(10, 5)
            assert not (await drive.status()).password_active


async def test_an_error_inside_is_raised_although_the_drive_cannot_be_locked_again() -> None:
    async with bench() as (drive, far):

        async def fail_with(error: BaseException | None) -> None:
            async with drive.parameters.unlocked():
                far.deaf = True
                if error is not None:
                    raise error

        for error, raised in (
            (ZeroDivisionError(), ZeroDivisionError),
            (asyncio.CancelledError(), asyncio.CancelledError),
            (None, AnswerTimeoutError),
        ):
            with pytest.raises(raised) as caught:
                await fail_with(error)
            assert "may be unprotected still" in "".join(caught.value.__notes__)
            far.deaf = False
        async with drive.parameters.unlocked():
            pass
        assert not (await drive.status()).password_active


async def test_a_line_that_is_gone_before_the_block_is_left_is_told() -> None:
    async with bench() as (drive, _):
        with pytest.raises(ConnectionLostError) as caught:
            async with drive.parameters.unlocked():
                await drive.close()
        assert "may be unprotected still" in "".join(caught.value.__notes__)


async def test_what_was_not_sent_does_not_wait_for_vp() -> None:
    async with bench() as (drive, _):
        await drive.close()
        assert isinstance(await ending(drive.parameters.write(10, 5)), ConnectionLostError)
        assert drive.parameters.pending == ()


async def test_a_write_that_follows_vp_waits_for_the_next() -> None:
    async with bench() as (drive, _), drive.parameters.unlocked() as parameters:
        await parameters.write(10, 5)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(parameters.make_valid())
            tasks.create_task(parameters.write(11, 6))
            tasks.create_task(parameters.write(10, 7))
        assert parameters.pending == (10, 11)
        await parameters.make_valid()
        assert not parameters.pending


async def test_what_never_went_out_is_not_uncertain(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text('kind = "parameters"\n[parameters]\nP40 = 5\nP41 = 6\n')
    far = Unlucky()
    async with far.connect() as drive:

        def fall_silent(*_: object) -> None:
            far.far.script = lambda _: None
            drive._line.link.exchange("S9", Lane.CONTROL).add_done_callback(lambda waiter: waiter.exception())

        error = await ending(drive.parameters.restore(path, on_progress=fall_silent))
        assert isinstance(error, RestoreIncompleteError)
        assert (list(error.applied), error.uncertain, error.not_applied) == ([40], {}, (41,))
        assert "P41=6.000 was not restored" in error.what
        assert "P41=6.000" not in far.far.lines


@pytest.mark.parametrize("kind", ["program", "parameters"])
async def test_what_is_refused_is_not_uncertain_and_what_is_taken_and_then_not_shown_is(
    kind: str, tmp_path: Path
) -> None:
    path = tmp_path / "x"
    path.write_text("N001: POSA 5\nN002: END\n" if kind == "program" else VALUES.replace("P10 = 333\nP40", "P1"))
    name, write, number = ("N1", "N001: POSA 5", 1) if kind == "program" else ("P1", "P1=5.000", 1)
    for is_refused in (True, False):
        answers: dict[str, str | None] = {"N1": "N001: END", "N2": "N002: END", "P1": "P1=0", "P41": "P41=0"}
        async with scripted({**answers, write: "E89" if is_refused else ""}) as (drive, far):

            def show_no_more(line: str, far: ScriptedDrive = far) -> None:
                if line == write:
                    far.answers[name] = "E88"

            far.on_line = show_no_more
            work = drive.program.download(path) if kind == "program" else drive.parameters.restore(path)
            error = await ending(work)
            assert isinstance(error, RestoreIncompleteError)
            assert error.applied == {}
            assert (number in error.not_applied, number in error.uncertain) == (is_refused, not is_refused)


# Taking back ----------------------------------------------------------------------------------------------------------


def left_of(kind: str, device: str | None = "x") -> RestoreIncompleteError:
    old: Any = "POSA 1" if kind == "program" else 1.0
    return RestoreIncompleteError("x", device=device, kind=kind, applied={1: (old, old), 40: (old, old)})


async def test_what_is_left_of_something_else_is_not_taken_back_here() -> None:
    async with bench() as (drive, far):
        before = lines(far)
        whose: dict[str, Any] = {"parameters": drive.parameters, "variables": drive.variables, "program": drive.program}
        for kind in (*whose, ""):
            for own, where in whose.items():
                for device in ("x", "y", None):
                    if (own, "x") != (kind, device):
                        error = await ending(where.roll_back(left_of(kind, device)))
                        assert isinstance(error, InvalidCommandError)
        assert lines(far) == before


async def test_a_roll_back_that_fails_says_how_far_it_got() -> None:
    async with bench() as (drive, _):
        error = await ending(drive.parameters.roll_back(left_of("parameters")))
        assert error.__notes__ == ["rolled back: P40; not rolled back, or not surely: P1"]
    far = Unlucky("line lost", 7)
    async with far.connect() as drive:
        error = await ending(drive.program.roll_back(left_of("program")))
        assert error.__notes__ == ["rolled back: N040; not rolled back, or not surely: N001"]


def test_an_account_tells_apart_what_was_sent_refused_and_applied() -> None:
    account = HalfDone({1: (0, 1), 2: (0, 2)}, str)
    assert not account.has_changed
    account.begin(1)
    assert account.not_applied == (1, 2)
    account.note_sent()
    assert account.lists == "applied: none; not applied: 2; uncertain: 1"
    account.note_applied()
    account.begin(2)
    assert account.lists == "applied: 1; not applied: 2"
    assert account.has_changed


# Over real lines ------------------------------------------------------------------------------------------------------


@pytest.mark.real_time
@pytest.mark.parametrize("serve", [serve_tcp, serve_pty])
async def test_a_program_goes_down_and_comes_up_over_a_real_line(
    serve: Callable[[SimulatedDrive], AbstractAsyncContextManager[str]],
) -> None:
    far = SimulatedDrive()
    async with asyncio.timeout(10), serve(far) as url, compax_aio.connect(url, name="x") as drive:
        done = await drive.program.download(NEW)
        assert done.verified == (1, 2, 3, 4)
        assert (await drive.program.upload(last=5)).listing() == NEW
        assert drive.stats.timeouts == 0


def test_the_far_end_of_these_tests_answers_as_others_do() -> None:
    assert Unlucky().obey("S16") == as_drive("S16").replace(b"16\r", b"11010000\r")
