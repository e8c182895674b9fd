"""Parameters and variables: what was written is read back, what is saved can be restored, nothing half in silence."""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

import compax_aio
from compax_aio import (
    CommandRejectedError,
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


async def test_the_word_for_vp_is_part_of_the_dialect() -> None:
    settings = DriveSettings(dialect=Dialect(make_valid="VALID"))
    async with compax_aio.connect("sim://compax?name=d", settings=settings) as drive:
        with pytest.raises(CommandRejectedError):
            await drive.parameters.make_valid()
        assert lines(drive_named("d"))[-1] == "VALID"
