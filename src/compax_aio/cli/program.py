"""``compax program``: listings checked and printed; programs uploaded, downloaded and run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.table import Table

from compax_aio import Drive, DriveSettings
from compax_aio.compax.program import (
    Problem,
    Severity,
    check,
    listing,
    parse,
    raise_for_errors,
    record_text,
    wire_lines,
)
from compax_aio.compax.program_memory import Uploaded
from compax_aio.text_file import read_text

from .confirming import confirm, expect_somebody
from .exit_codes import OK
from .files import Force, expect_free, reading
from .half_way import HalfWay, RollBackFlag, Yes
from .interruption import moves_nothing
from .opening import DriveLine, Url
from .printing import Printing, notes_console
from .program_at_work import run
from .progress import counting

__all__ = ["app"]

app = App(
    name="program",
    help="""\
Check, print, upload, download and run programs.

A program is a listing: a record a line, N001 to N250. `check` and `print` need no drive.
""",
)
app.command(run)

Listing = Annotated[Path, Parameter(help="File of a listing: a record a line, N001: POSA 100; behind ; a comment.")]
Settings = Annotated[
    Path | None, Parameter(env_var="COMPAX_SETTINGS", help="TOML file with the settings of the drive: its decimals.")
]


def _text_of(file: Path) -> str:
    with reading(file):
        return read_text(file, "listing")


def _name(number: int) -> str:
    return f"N{number:03d}"


# Without a drive ----------------------------------------------------------------------------------------------------


@app.command(name="check")
@moves_nothing
def check_(file: Listing, *, settings: Settings = None, printing: Printing = Printing()) -> int:  # noqa: B008 - frozen
    """
    Say what is wrong with a listing, each with its line and column; exits with 1 if anything is an error.

    Found are jumps to records that are not there, a way that runs out without END, REPEAT without END, lines that do
    not fit the drive, and more.

    ```sh
    compax program check press.txt
    ```
    """
    text = _text_of(file)
    problems = _problems(text, DriveLine(settings=settings).drive_settings())
    errors = sum(each.severity is Severity.ERROR for each in problems)
    for each in problems:
        if not printing.json:
            printing.show(None, f"{file}:{each.line}:{each.column}: {_told(each)}")
    if printing.json:
        printing.show(problems)
    elif not problems:
        printing.show(None, f"{file}: nothing wrong was found")
    return 1 if errors else OK


def _problems(text: str, settings: DriveSettings) -> list[Problem]:
    return check(text, decimals=settings.decimals, template=settings.dialect.record)


def _told(problem: Problem) -> str:
    return f"{problem.severity.value}: {problem.message}; {problem.hint}"


@app.command(name="print")
@moves_nothing
def print_(
    file: Listing,
    *,
    wire: Annotated[bool, Parameter(negative=(), help="As lines for the drive, abbreviated where they must.")] = False,
    settings: Settings = None,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Print a listing as the manual writes it: in order, long forms, one record a line, no comments.

    ```sh
    compax program print press.txt > press-clean.txt
    ```
    """
    known = DriveLine(settings=settings).drive_settings()
    program = parse(_text_of(file), decimals=known.decimals)
    lines = wire_lines(program, template=known.dialect.record) if wire else listing(program).splitlines()
    printing.show(list(lines), "\n".join(lines))


# With a drive -------------------------------------------------------------------------------------------------------


@app.command
@moves_nothing
async def upload(
    url: Url,
    file: Annotated[Path | None, Parameter(help="Where it is written; on the screen if not given.")] = None,
    *,
    force: Force = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Read the program that is in the drive, and print it, or write it to a file that `download` takes.

    A record that cannot be read, or may have been cut at 30 characters, stands there as a comment.

    ```sh
    compax program upload serial:///dev/ttyUSB0
    compax program upload serial:///dev/ttyUSB0 press.txt
    ```
    """
    if file is not None:
        expect_free(file, force=force)
    async with line.open(url) as drive:
        with counting("reading records", printing) as on_progress:
            if file is None:
                uploaded = await drive.program.upload(on_progress=on_progress)
            else:
                uploaded = await drive.program.save(file, on_progress=on_progress)
    _show_uploaded(drive, uploaded, file, printing)


def _show_uploaded(drive: Drive, uploaded: Uploaded, file: Path | None, printing: Printing) -> None:
    count = len(uploaded.program)
    text = uploaded.listing().rstrip("\n") if file is None else f"{_counted(count)} of {drive.name} written to {file}"
    printing.show(
        {
            "drive": drive.name,
            "file": file,
            "records": {_name(number): record_text(record) for number, record in uploaded.program.items()},
            "unreadable": {_name(number): each for number, each in uploaded.unreadable.items()},
        },
        text,
    )
    if uploaded.unreadable:
        names = ", ".join(map(_name, uploaded.unreadable))
        printing.note(f"{names} cannot be read, or may be cut at 30 characters: look at the comments")


@app.command
@moves_nothing
async def download(
    url: Url,
    file: Listing,
    *,
    clear_rest: Annotated[
        bool, Parameter(negative=(), help="Write END into all records that the listing does not name.")
    ] = False,
    yes: Yes = False,
    roll_back: RollBackFlag = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Write a listing into the drive; shows what would change, and asks before it writes.

    The listing is checked first, only what differs is written, and each record is read back. The first that fails ends
    it: then it says which were written, which not, and of which it is not known.

    ```sh
    compax program download serial:///dev/ttyUSB0 press.txt
    ```
    """
    text = _text_of(file)
    problems = _problems(text, line.drive_settings())
    raise_for_errors(problems)
    for each in problems:
        printing.note(f"{file}:{each.line}:{each.column}: {_told(each)}")
    expect_somebody(yes=yes)
    lines = text.splitlines()
    async with line.open(url) as drive:
        with counting("comparing", printing) as on_compared:
            would = await drive.program.download(lines, clear_rest=clear_rest, dry_run=True, on_compared=on_compared)
        if not would.changed:
            _show_nothing(f"{drive.name} has all of {file} already; nothing was written", drive, printing)
            return
        if not await _is_wanted(drive, would.changed, yes=yes, printing=printing):
            _show_nothing("Nothing was written.", drive, printing)
            return
        async with HalfWay(drive.name, drive.program, _name, printing, roll_back=roll_back, may_ask=not yes):
            with counting("writing", printing) as on_progress:
                done = await drive.program.download(lines, clear_rest=clear_rest, on_progress=on_progress)
    cut = f"; may be cut, so not verified: {_names(done.not_verifiable)}" if done.not_verifiable else ""
    printing.show(
        {
            "drive": drive.name,
            "changed": {_name(number): {"old": old, "new": new} for number, (old, new) in done.changed.items()},
            "unchanged": done.unchanged,
            "not_verifiable": [_name(number) for number in done.not_verifiable],
        },
        f"{drive.name}: {_counted(len(done.changed))} written and read back, {done.unchanged} were there{cut}",
    )


def _counted(count: int) -> str:
    return "1 record" if count == 1 else f"{count} records"


def _names(numbers: Iterable[int]) -> str:
    return ", ".join(map(_name, numbers))


def _show_nothing(text: str, drive: Drive, printing: Printing) -> None:
    printing.show({"drive": drive.name, "changed": {}}, text)


async def _is_wanted(drive: Drive, changed: Mapping[int, tuple[str, str]], *, yes: bool, printing: Printing) -> bool:
    if not printing.json:
        table = Table(box=None, pad_edge=False)
        for heading in ("record", "now", "", "new"):
            table.add_column(heading)
        for number, (old, new) in changed.items():
            table.add_row(_name(number), old.strip(), "→", new)
        notes_console().print(table, markup=False)
    return yes or await confirm(f"Write {_counted(len(changed))} of {drive.name}?")
