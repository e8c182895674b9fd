"""Several values written as one restore does it: compared first, each read back, and accounted for if one fails."""

from __future__ import annotations

import pytest

import compax_aio
from compax_aio.simulator.compax import LogKind
from compax_aio.simulator.server import drive_named

URL = "sim://compax?name=several"


async def test_only_what_differs_is_written_in_the_order_of_numbers() -> None:
    compared: list[tuple[int, int]] = []
    async with compax_aio.connect(URL) as drive:
        done = await drive.parameters.write_several(
            {41: 2, 40: 1.5, 42: 0}, on_compared=lambda done, total: compared.append((done, total))
        )
    assert done.changed == {40: (0.0, 1.5), 41: (0.0, 2.0)}
    assert done.unchanged == 1
    assert compared == [(1, 3), (2, 3), (3, 3)]
    lines = drive_named("several").log.texts(LogKind.LINE)
    assert [line for line in lines if "=" in line] == ["P40=1.500", "P41=2.000"]


async def test_a_dry_run_writes_nothing() -> None:
    async with compax_aio.connect(URL) as drive:
        would = await drive.variables.write_several({5: 3}, dry_run=True)
        assert would.was_dry_run
        assert would.changed == {5: (0.0, 3.0)}
        assert await drive.variables.read(5) == 0.0


@pytest.mark.parametrize("values", [{40: 1, 251: 1}, {40: 1, 41: float("nan")}, {40: 1, 10: 1.5}])
async def test_one_that_cannot_be_said_keeps_all_back(values: dict[int, float]) -> None:
    async with compax_aio.connect(URL) as drive:
        before = len(drive_named("several").log)
        with pytest.raises(compax_aio.InvalidCommandError):
            await drive.parameters.write_several(values)
        assert len(drive_named("several").log) == before


async def test_one_that_is_refused_ends_it_with_an_account() -> None:
    async with compax_aio.connect(URL) as drive:
        with pytest.raises(compax_aio.RestoreIncompleteError) as failure:
            await drive.parameters.write_several({40: 1, 60: 1})  # the password is on
        assert failure.value.applied == {40: (0.0, 1.0)}
        assert failure.value.not_applied == (60,)
        await drive.parameters.roll_back(failure.value)
        assert await drive.parameters.read(40) == 0.0


async def test_a_program_that_is_let_go_on_is_not_stopped_when_the_block_is_left() -> None:
    far_end = drive_named("several")
    far_end.load_program(["POSA 1000", "END"])
    async with compax_aio.connect(URL) as drive:
        await drive.program.start(1)
        drive.program.let_go_on()
    assert "STOP" not in far_end.log.texts(LogKind.LINE)
    async with compax_aio.connect(URL) as drive:
        assert await drive.program.running()
        await drive.stop()
