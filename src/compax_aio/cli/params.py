"""``compax params``: parameters and variables read, written, saved, compared and restored."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager, nullcontext
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from compax_aio import Drive

from .confirming import confirm, expect_somebody
from .files import Force, expect_free
from .half_way import HalfWay, RollBackFlag, Yes
from .interruption import moves_nothing, say_at_end
from .opening import DriveLine, Url
from .printing import Printing, notes_console
from .progress import counting
from .values import (
    Kind,
    Row,
    assignments_in,
    changes_table,
    differences_table,
    kind_of,
    names_in,
    rows_table,
    values_in_file,
)

__all__ = ["app"]

app = App(
    name="params",
    help="""\
Read, write, save, compare and restore parameters.

Parameters are P1 to P250; with --variables, or by their letter, V1 to V39 and V50 to V70. Before you change anything,
save what is there: `compax params save URL FILE`.
""",
)

Variables = Annotated[bool, Parameter(negative=(), help="Variables V1-V39 and V50-V70, in place of parameters.")]
Vp = Annotated[bool, Parameter(negative="--no-vp", help="Put what was written in force at once (VP).")]


@app.command
@moves_nothing
async def get(
    url: Url,
    *names: Annotated[str, Parameter(help="P40, 40, V5, P40-49 …; all that the drive gives, if there are none.")],
    variables: Variables = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Read parameters, with what is known of their meaning.

    ```sh
    compax params get serial:///dev/ttyUSB0
    compax params get serial:///dev/ttyUSB0 P10-12 P40 --json
    ```
    """
    default = kind_of(variables=variables)
    wanted = names_in(names, default)
    async with line.open(url) as drive:
        read = await _read(drive, wanted, printing) if wanted else await _read_all(drive, default, printing)
    rows = [(kind, number, Row.of(kind, number, value, drive.unit)) for kind, number, value in read]
    printing.show([row for _, _, row in rows], rows_table(rows))


async def _read(drive: Drive, wanted: list[tuple[Kind, int]], printing: Printing) -> list[tuple[Kind, int, float]]:
    values = []
    with counting("reading", printing) as on_progress:
        for kind, number in wanted:
            values.append((kind, number, await kind.of(drive).read(number)))
            on_progress(len(values), len(wanted))
    return values


async def _read_all(drive: Drive, kind: Kind, printing: Printing) -> list[tuple[Kind, int, float]]:
    with counting("reading", printing) as on_progress:
        values = await kind.of(drive).read_all(on_progress=on_progress)
    if missing := len(kind.table.decimals) - len(values):
        printing.note(f"{drive.name} does not give {missing} of its {kind.table.kind}")
    return [(kind, number, value) for number, value in values.items()]


@app.command(name="set")
@moves_nothing
async def set_(
    url: Url,
    *assignments: Annotated[str, Parameter(help="P40=1.5 …, as many as you like.")],
    variables: Variables = False,
    yes: Yes = False,
    vp: Vp = True,
    roll_back: RollBackFlag = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Write parameters, each read back; shows old and new values, and asks before it writes.

    The password is removed and restored (GOTO 302, GOTO 270), and what was written is put in force (VP), as far as the
    parameters want it: P40 to P49 and variables do not.

    ```sh
    compax params set serial:///dev/ttyUSB0 P40=1.5 P10=200
    compax params set serial:///dev/ttyUSB0 V5=3 --yes
    ```
    """
    kind, values = assignments_in(assignments, kind_of(variables=variables), line.drive_settings())
    expect_somebody(yes=yes)
    async with line.open(url) as drive:
        await _write(drive, kind, values, yes=yes, vp=vp, roll_back=roll_back, printing=printing)


@app.command
@moves_nothing
async def save(
    url: Url,
    file: Path,
    *,
    variables: Variables = False,
    force: Force = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Save all that the drive gives to a TOML file, with what is known of its meaning as comments.

    The file is written whole, or not at all.

    ```sh
    compax params save serial:///dev/ttyUSB0 axis-x.toml
    ```
    """
    kind = kind_of(variables=variables)
    expect_free(file, force=force)
    async with line.open(url) as drive:
        with counting("reading", printing) as on_progress:
            values = await kind.of(drive).save(file, on_progress=on_progress)
    printing.show(
        {"drive": drive.name, "file": file, "kind": kind.table.kind, "count": len(values)},
        f"{kind.counted(len(values))} of {drive.name} saved to {file}",
    )


@app.command
@moves_nothing
async def diff(
    url: Url,
    file: Path,
    *,
    variables: Variables = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Compare a saved file with the drive.

    As diff does, it exits with 0 where they are the same, and with 1 where they are not; anything above is trouble.

    ```sh
    compax params diff serial:///dev/ttyUSB0 axis-x.toml
    ```
    """
    kind = kind_of(variables=variables)
    count = len(values_in_file(file, kind, line.drive_settings()))
    async with line.open(url) as drive:
        with counting("comparing", printing) as on_progress:
            differences = await kind.of(drive).diff(file, on_progress=on_progress)
    if differences:
        printing.show(differences, differences_table(kind, differences, drive.unit))
        return 1
    printing.show([], f"{drive.name} has all {count} {kind.table.kind} as in {file}")
    return 0


@app.command
@moves_nothing
async def restore(
    url: Url,
    file: Path,
    *,
    variables: Variables = False,
    yes: Yes = False,
    vp: Vp = True,
    roll_back: RollBackFlag = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Write what differs from a saved file; shows it, and asks before it writes.

    The whole file is checked first, each value is read back, and the first that fails ends it: then it says which were
    applied, which not, and of which it is not known. Password and VP are seen to, as by `compax params set`.

    ```sh
    compax params restore serial:///dev/ttyUSB0 axis-x.toml
    ```
    """
    kind = kind_of(variables=variables)
    values = values_in_file(file, kind, line.drive_settings())
    expect_somebody(yes=yes)
    async with line.open(url) as drive:
        await _write(drive, kind, values, yes=yes, vp=vp, roll_back=roll_back, printing=printing)


# Writing ------------------------------------------------------------------------------------------------------------


async def _write(
    drive: Drive,
    kind: Kind,
    values: Mapping[int, float],
    *,
    yes: bool,
    vp: bool,
    roll_back: bool,
    printing: Printing,
) -> None:
    """Show what would be changed, ask, and write it."""
    there = kind.of(drive)
    with counting("comparing", printing) as on_compared:
        would = await there.write_several(values, dry_run=True, on_compared=on_compared)
    if not would.changed:
        printing.show(
            {"drive": drive.name, "changed": {}, "unchanged": would.unchanged, "pending": ()},
            f"{drive.name} has all that already; nothing was written",
        )
        return
    if not await _is_wanted(drive, kind, would.changed, yes=yes, printing=printing):
        printing.show({"drive": drive.name, "changed": {}, "refused": True}, "Nothing was written.")
        return
    changes = {number: new for number, (_, new) in would.changed.items()}
    async with _unlocked(drive, kind, would.pending):
        async with HalfWay(drive.name, there, kind.table.name, printing, roll_back=roll_back, may_ask=not yes):
            with counting("writing", printing) as on_progress:
                done = await there.write_several(changes, on_progress=on_progress)
        written = f"{kind.counted(len(done.changed))} written and read back"
        say_at_end(f"Interrupted. {drive.name}: {written}{_in_force(done.pending, vp=vp)}.")
        if done.pending and vp:
            await drive.parameters.make_valid()
    pending = () if vp else done.pending
    waiting = f"; not in force before VP: {', '.join(map(kind.table.name, pending))}" if pending else ""
    printing.show(
        {
            "drive": drive.name,
            "changed": {kind.table.name(n): {"old": old, "new": new} for n, (old, new) in done.changed.items()},
            "unchanged": would.unchanged,
            "pending": [kind.table.name(number) for number in pending],
        },
        f"{drive.name}: {written}{waiting}",
    )


def _in_force(pending: tuple[int, ...], *, vp: bool) -> str:
    """Say of what was just written, before VP, whether it counts."""
    if not pending:
        return ""
    return "; whether VP has put it in force is not known" if vp else "; not in force before VP"


async def _is_wanted(
    drive: Drive, kind: Kind, changes: Mapping[int, tuple[float, float]], *, yes: bool, printing: Printing
) -> bool:
    if not printing.json:
        notes_console().print(changes_table(kind, changes, drive.unit), markup=False)
    if (note := kind.note_on(changes)) is not None:
        printing.note(note)
    return yes or await confirm(f"Write {kind.counted(len(changes))} of {drive.name}?")


def _unlocked(drive: Drive, kind: Kind, pending: tuple[int, ...]) -> AbstractAsyncContextManager[Any]:
    """Remove the password for a block, where something is written that it protects."""
    return drive.parameters.unlocked() if kind.is_protected and pending else nullcontext()
