"""Parameters and variables: what was written is read back, what is saved can be restored, nothing half in silence."""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from tests.promises.bench import ScriptedDrive, scripted

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    Dialect,
    Drive,
    DriveSettings,
    InvalidCommandError,
    RestoreIncompleteError,
    UnexpectedAnswerError,
)
from compax_aio.compax.facts.parameters import CONTROL_PARAMETERS, MAX_PARAMETER, PARAMETERS, parameter_decimals
from compax_aio.compax.parameters import Difference
from compax_aio.simulator.compax import LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named


@pytest.fixture
async def drive() -> AsyncIterator[Drive]:
    async with compax_aio.connect("sim://compax?name=x", name="x", settings=DriveSettings(unit="mm")) as drive:
        yield drive


@pytest.fixture
async def far(drive: Drive) -> SimulatedDrive:
    return drive_named("x")


def lines(far: SimulatedDrive) -> list[str]:
    return far.log.texts(LogKind.LINE)


def files_in(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


# One ------------------------------------------------------------------------------------------------------------------


async def test_a_control_parameter_is_written_without_password_and_read_back(drive: Drive, far: SimulatedDrive) -> None:
    assert await drive.parameters.write(40, 1.5) == 1.5
    assert lines(far)[-2:] == ["P40=1.500", "P40"]
    assert await drive.parameters.read(40) == 1.5
    assert drive.parameters.pending == ()


async def test_a_variable_is_written_and_read_back(drive: Drive) -> None:
    assert await drive.variables.write(5, -12.25) == -12.25
    assert await drive.variables.read(5) == -12.25


async def test_a_parameter_is_refused_while_the_password_protects_it(drive: Drive) -> None:
    before = await drive.parameters.read(10)
    with pytest.raises(CommandRejectedError):
        await drive.parameters.write(10, 200)
    assert await drive.parameters.read(10) == before
    assert drive.parameters.pending == ()


async def test_a_parameter_is_pending_until_it_is_made_valid(drive: Drive, far: SimulatedDrive) -> None:
    async with drive.parameters.unlocked() as parameters:
        await parameters.write(10, 200)
        pending = [parameters.pending]
        await parameters.make_valid()
        pending.append(parameters.pending)
    assert pending == [(10,), ()]
    assert "VP" in lines(far)


async def test_a_refused_write_does_not_hide_that_an_earlier_one_is_pending(drive: Drive) -> None:
    async with drive.parameters.unlocked() as parameters:
        await parameters.write(10, 200)
    with pytest.raises(CommandRejectedError):
        await drive.parameters.write(10, 300)
    assert drive.parameters.pending == (10,)


async def test_unlocked_parameters_are_locked_again_however_the_block_ends(drive: Drive) -> None:
    async def fail_inside() -> None:
        async with drive.parameters.unlocked():
            assert (await drive.status()).password_active
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail_inside()
    assert not (await drive.status()).password_active


async def test_unlocked_parameters_are_locked_again_when_the_block_is_cancelled(drive: Drive) -> None:
    async def unlock_for_long() -> None:
        async with drive.parameters.unlocked():
            await asyncio.sleep(60)

    task = asyncio.ensure_future(unlock_for_long())
    await asyncio.sleep(1)
    assert (await drive.status()).password_active
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert not (await drive.status()).password_active


async def test_a_drive_that_keeps_its_password_is_told() -> None:
    # Words that the drive knows, and that change nothing.
    async with compax_aio.connect("sim://compax", name="x") as drive:
        parameters = drive.parameters
        await parameters.unlock()
        with pytest.raises(UnexpectedAnswerError, match="still unprotected"):
            await parameters._expect_password(active=False)
        await parameters.lock()
        with pytest.raises(UnexpectedAnswerError, match="still protected"):
            await parameters._expect_password(active=True)


@pytest.mark.parametrize("number", [0, 251, -1, True, 1.0, "1"])
async def test_a_number_that_no_parameter_has_is_refused(drive: Drive, far: SimulatedDrive, number: int) -> None:
    before = lines(far)
    for work in (drive.parameters.read(number), drive.parameters.write(number, 1)):
        with pytest.raises(InvalidCommandError):
            await work
    assert lines(far) == before


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "1", True, 1.5, 1e9])
async def test_a_value_that_cannot_be_said_is_refused(drive: Drive, far: SimulatedDrive, value: float) -> None:
    before = lines(far)
    with pytest.raises(InvalidCommandError):
        await drive.parameters.write(10, value)
    assert lines(far) == before


@pytest.mark.parametrize("number", [40, 49])
async def test_a_variable_that_there_is_not_is_refused(drive: Drive, number: int) -> None:
    with pytest.raises(InvalidCommandError, match=f"no V{number}"):
        await drive.variables.read(number)


def test_every_parameter_has_a_resolution() -> None:
    assert {parameter_decimals(number) for number in range(1, MAX_PARAMETER + 1)} == {0, 3, 6}
    assert parameter_decimals(10) == 0
    assert parameter_decimals(21) == 6
    assert all(parameter_decimals(number) == 3 for number in CONTROL_PARAMETERS)
    numbers = [fact.number for fact in PARAMETERS]
    assert numbers == sorted(set(numbers))


# All ------------------------------------------------------------------------------------------------------------------


async def test_a_set_is_saved_changed_compared_and_restored(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    await drive.parameters.write(40, 1.5)
    saved = await drive.parameters.save(path)
    assert saved[40] == 1.5
    assert await drive.parameters.diff(path) == ()
    await drive.parameters.write(40, 7)
    await drive.parameters.write(41, -3)
    assert await drive.parameters.diff(path) == (
        Difference("P40", 40, 1.5, 7.0),
        Difference("P41", 41, saved[41], -3.0),
    )
    would = await drive.parameters.restore(path, dry_run=True)
    assert would.was_dry_run
    assert would.changed == {40: (7.0, 1.5), 41: (-3.0, saved[41])}
    assert await drive.parameters.read(40) == 7
    steps: list[tuple[int, int]] = []
    done = await drive.parameters.restore(path, on_progress=lambda *step: steps.append(step))
    assert done.changed == would.changed
    assert done.unchanged == len(saved) - 2
    assert steps == [(1, 2), (2, 2)]
    assert await drive.parameters.diff(path) == ()


async def test_a_saved_file_is_toml_that_people_read(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    seen: list[tuple[int, int]] = []
    saved = await drive.parameters.save(path, on_progress=lambda *step: seen.append(step))
    content = tomllib.loads(path.read_text())
    assert (content["kind"], content["drive"]) == ("parameters", "x")
    assert content["parameters"] == {f"P{number}": value for number, value in saved.items()}
    assert "ramp time of STOP [ms]" in path.read_text()
    assert "[mm]" in path.read_text()
    assert seen[-1] == (MAX_PARAMETER, MAX_PARAMETER)
    assert files_in(tmp_path) == ["x.toml"]


async def test_a_restore_that_is_refused_says_what_was_applied_and_can_be_rolled_back(
    drive: Drive, tmp_path: Path
) -> None:
    path = tmp_path / "x.toml"
    await drive.variables.save(path)
    path.write_text(path.read_text().replace("V5 = 0.000", "V5 = 5.000"))
    async with drive.parameters.unlocked() as parameters:
        await parameters.write(10, 333)
    saved = tmp_path / "p.toml"
    await drive.parameters.save(saved)
    async with drive.parameters.unlocked() as parameters:
        await parameters.write(10, 100)
        await parameters.write(2, 50)
    text = saved.read_text().replace("P40 = 0.000", "P40 = 4.000").replace("P50 = 0", "P50 = 7")
    # P2 and P10 are protected now: P2 comes first and is refused.
    saved.write_text(text)
    with pytest.raises(RestoreIncompleteError) as caught:
        await drive.parameters.restore(saved)
    assert caught.value.applied == {}
    assert caught.value.not_applied == (2, 10, 40, 50)
    # With the unprotected one alone in front, one is applied.
    saved.write_text("\n".join(line for line in text.splitlines() if not line.startswith(("P2 ", "P10 "))))
    with pytest.raises(RestoreIncompleteError, match="applied: P40; not applied: P50") as caught:
        await drive.parameters.restore(saved)
    assert caught.value.applied == {40: (0.0, 4.0)}
    assert await drive.parameters.read(40) == 4
    await drive.parameters.roll_back(caught.value)
    assert await drive.parameters.read(40) == 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("not toml [", "no TOML"),
        ("\xff", "no TOML"),
        ('kind = "variables"\n[variables]\nV1 = 1.0\n', "no file of parameters"),
        ('kind = "parameters"\nmore = 1\n[parameters]\n', "no file of parameters"),
        ('kind = "parameters"\n', "no table"),
        ('kind = "parameters"\n[parameters]\nV1 = 1\n', "'V1' is not one of"),
        ('kind = "parameters"\n[parameters]\nP1 = 1\nP01 = 1\n', "'P01' is not one of"),
        ('kind = "parameters"\n[parameters]\nP1 = "1"\n', "is no number"),
        ('kind = "parameters"\n[parameters]\nP1 = nan\n', "is no number"),
        ('kind = "parameters"\n[parameters]\nP999 = 1\n', "no P999"),
        ('kind = "parameters"\n[parameters]\nP10 = 1.5\n', "decimals"),
        ("#" * 300_000, "larger than"),
    ],
)
async def test_a_file_that_cannot_be_meant_is_refused_before_a_byte_is_sent(
    drive: Drive, far: SimulatedDrive, tmp_path: Path, text: str, says: str
) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(text.encode("latin-1"))
    before = lines(far)
    for work in (drive.parameters.restore(path), drive.parameters.diff(path)):
        with pytest.raises(InvalidCommandError, match=says):
            await work
    assert lines(far) == before


async def test_a_file_that_cannot_be_written_leaves_the_old_one(
    drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.toml"
    path.write_text("old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        await drive.variables.save(path)
    assert path.read_text() == "old"
    assert files_in(tmp_path) == ["x.toml"]


# Half way -------------------------------------------------------------------------------------------------------------


class Memory:
    """Makes a scripted drive keep what is written; *trouble* says what becomes of a line instead."""

    def __init__(self, far: ScriptedDrive, values: dict[str, float]) -> None:
        self.far = far
        self.trouble: dict[str, Callable[[], None]] = {}
        far.on_line = self._on_line
        for name, value in values.items():
            self.keep(name, value)

    def keep(self, name: str, value: float) -> None:
        self.far.answers[name] = f"P{int(name[1:]):03d}: {value:.3f}"

    def _on_line(self, line: str) -> None:
        name, _, value = line.partition("=")
        if line in self.trouble:
            self.trouble[line]()
        elif value:
            self.keep(name, float(value))


@asynccontextmanager
async def drive_with(**values: float) -> AsyncIterator[tuple[Drive, Memory]]:
    async with scripted(settings=DriveSettings(answer_timeout_s=0.1)) as (drive, far):
        yield drive, Memory(far, values)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A file in which P10 and P40 to P42 are 4, 5, 6 and 7."""
    path = tmp_path / "p.toml"
    path.write_text('kind = "parameters"\n[parameters]\nP10 = 4\nP40 = 5\nP41 = 6\nP42 = 7\n')
    return path


async def incomplete(drive: Drive, path: Path) -> RestoreIncompleteError:
    with pytest.raises(RestoreIncompleteError) as caught:
        await drive.parameters.restore(path)
    return caught.value


async def test_a_value_that_reads_back_as_another_is_uncertain(saved: Path) -> None:
    async with drive_with(P10=0, P40=0, P41=0, P42=0) as (drive, memory):
        memory.trouble["P41=6.000"] = lambda: memory.keep("P41", 5.5)
        error = await incomplete(drive, saved)
    assert error.applied == {10: (0, 4), 40: (0, 5)}
    assert error.uncertain == {41: (0, 6)}
    assert error.not_applied == (42,)
    assert isinstance(error.__cause__, UnexpectedAnswerError)
    assert "it is uncertain whether P41=6.000 was restored: P41 was written as 6 and reads back as 5.5" in error.what
    assert error.what.endswith("applied: P10, P40; not applied: P42; uncertain: P41")
    assert "not in force before VP: P10" in str(error)
    assert error.exchanges


async def test_the_uncertain_value_is_rolled_back_first_and_the_others_in_reverse(saved: Path) -> None:
    async with drive_with(P10=1, P40=2, P41=3, P42=0) as (drive, memory):
        memory.trouble["P41=6.000"] = lambda: memory.keep("P41", 5.5)
        error = await incomplete(drive, saved)
        before = len(memory.far.lines)
        await drive.parameters.roll_back(error)
        written = [line for line in memory.far.lines[before:] if "=" in line]
        assert written == ["P41=3.000", "P40=2.000", "P10=1"]
        assert [await drive.parameters.read(number) for number in (10, 40, 41, 42)] == [1, 2, 3, 0]
        await drive.parameters.roll_back(error)  # once more does no harm


async def test_a_value_whose_acknowledgement_does_not_come_is_uncertain(saved: Path) -> None:
    async with drive_with(P10=4, P40=0, P41=0, P42=0) as (drive, memory):
        memory.far.answers["P40=5.000"] = None
        error = await incomplete(drive, saved)
        assert isinstance(error.__cause__, AnswerTimeoutError)
        assert (error.applied, error.uncertain, error.not_applied) == ({}, {40: (0, 5)}, (41, 42))
        assert memory.far.lines.count("P40=5.000") == 1
        await drive.parameters.roll_back(error)
        assert memory.far.lines[-2:] == ["P40=0.000", "P40"]


async def test_a_value_on_a_line_that_is_lost_is_uncertain(saved: Path) -> None:
    async with drive_with(P10=4, P40=0, P41=0, P42=0) as (drive, memory):
        memory.trouble["P41=6.000"] = memory.far.transport.abort
        error = await incomplete(drive, saved)
    assert isinstance(error.__cause__, ConnectionLostError)
    assert (error.applied, error.uncertain, error.not_applied) == ({40: (0, 5)}, {41: (0, 6)}, (42,))


async def test_a_value_that_is_answered_with_something_else_is_uncertain(saved: Path) -> None:
    async with drive_with(P10=4, P40=0, P41=0, P42=0) as (drive, memory):
        memory.far.answers["P40=5.000"] = "WHAT"
        error = await incomplete(drive, saved)
    assert (error.uncertain, error.not_applied) == ({40: (0, 5)}, (41, 42))


async def test_a_value_that_is_taken_and_then_not_given_is_uncertain_and_waits_for_vp(saved: Path) -> None:
    async with drive_with(P10=0, P40=5, P41=6, P42=7) as (drive, memory):
        memory.trouble["P10=4"] = lambda: memory.far.answers.update({"P10": "E90"})
        error = await incomplete(drive, saved)
        assert isinstance(error.__cause__, CommandRejectedError)
        assert (error.applied, error.uncertain, error.not_applied) == ({}, {10: (0, 4)}, ())
        assert drive.parameters.pending == (10,)


async def test_a_value_that_is_refused_is_not_uncertain(saved: Path) -> None:
    async with drive_with(P10=0, P40=5, P41=6, P42=0) as (drive, memory):
        memory.far.answers["P10=4"] = "E89"
        error = await incomplete(drive, saved)
        assert (error.applied, error.uncertain, error.not_applied) == ({}, {}, (10, 42))
        assert error.what.startswith("P10=4 was not restored: the drive rejected it with E89")
        assert "uncertain" not in error.what
        assert "VP" not in (error.hint or "")
        assert drive.parameters.pending == ()


async def test_nothing_is_written_if_the_drive_does_not_give_a_value_of_the_file(saved: Path) -> None:
    async with drive_with(P10=0, P40=0, P42=0) as (drive, memory):
        memory.far.answers["P41"] = "E90"
        for dry_run in (True, False):
            with pytest.raises(
                RestoreIncompleteError, match="nothing was written: the drive does not give P41"
            ) as caught:
                await drive.parameters.restore(saved, dry_run=dry_run)
            assert (caught.value.applied, caught.value.uncertain) == ({}, {})
            assert caught.value.not_applied == (10, 40, 41, 42)
        assert not [line for line in memory.far.lines if "=" in line]


async def test_what_a_restore_leaves_for_vp_is_said(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text('kind = "parameters"\n[parameters]\nP10 = 333\nP40 = 5\n')
    async with drive.parameters.unlocked() as parameters:
        would = await parameters.restore(path, dry_run=True)
        assert (would.pending, parameters.pending) == ((10,), ())
        done = await parameters.restore(path)
        assert (done.pending, parameters.pending) == ((10,), (10,))
        await parameters.make_valid()
        assert (await parameters.restore(path)).pending == ()
    await drive.variables.save(path)
    await drive.variables.write(5, 5)
    done = await drive.variables.restore(path)
    assert (list(done.changed), done.pending) == ([5], ())


# What is chosen by a parameter ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("status", "parameter"), [(13, 233), (14, 234), (15, 182)])
async def test_a_status_whose_quantity_is_chosen_says_which_it_is(status: int, parameter: int) -> None:
    """UG p. 211."""
    async with scripted({f"P{parameter}": f"P{parameter}: 27", f"S{status}": f"S{status:03d}: 12.50"}) as (drive, far):
        value = await drive.read_monitor(status)
        assert far.lines[-2:] == [f"P{parameter}", f"S{status}"]
    assert (value.number, value.chosen, value.value, value.unit) == (status, 27, 12.5, "units")
    assert value.meaning == "position of the external encoder"


@pytest.mark.parametrize("number", [12, 16, 233, 13.0, True, "13", [13]])
async def test_no_other_status_has_a_quantity_to_choose(number: int) -> None:
    async with scripted() as (drive, far):
        before = list(far.lines)
        with pytest.raises(InvalidCommandError, match="S13, S14 and S15"):
            await drive.read_monitor(number)
        assert far.lines == before


async def test_a_chosen_quantity_that_cannot_be_read_is_told_with_its_drive() -> None:
    async with scripted({"P233": "P233: 1.5", "S13": "S013: 12.50"}) as (drive, _):
        with pytest.raises(UnexpectedAnswerError) as caught:
            await drive.read_monitor(13)
    assert (caught.value.device, caught.value.received) == ("x", "P233: 1.5")


async def test_the_word_for_vp_is_part_of_the_dialect() -> None:
    settings = DriveSettings(dialect=Dialect(make_valid="VALID"))
    async with compax_aio.connect("sim://compax?name=d", settings=settings) as drive:
        with pytest.raises(CommandRejectedError):
            await drive.parameters.make_valid()
        assert lines(drive_named("d"))[-1] == "VALID"
