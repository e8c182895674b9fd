"""``compax smc program``: the program in the memory of an axis, checked, listed, written, edited and run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from compax_aio import AnswerTimeoutError, InvalidCommandError, MoveInDoubtError
from compax_aio.smc import Listed
from compax_aio.smc.program_text import instruction, parse_program, program_listing
from compax_aio.smc.vocabulary import list_program, plan_program
from compax_aio.text_file import read_text, replace_file

from ...motion.moves import check_manner
from ..files import Force, expect_free, reading
from ..interruption import moves_nothing
from ..moving import TimeoutS
from ..number_words import WHOLE
from ..printing import Printing
from ..progress import counting
from .line import AxisName, LineUrl, SmcLine
from .motions import carry_out

__all__ = ["app"]

app = App(
    name="program",
    help="""\
Check, list, write, edit and run the program in the memory of an axis.

A program is an instruction a line, R10000 or 1: R10000; what follows ; is a comment. `check` needs no axis.
""",
)

ProgramFile = Annotated[Path, Parameter(help="File with an instruction a line.")]
At = Annotated[int, WHOLE, Parameter(name="--at", help="Address of the first instruction.")]
Verify = Annotated[
    bool, Parameter(negative="--no-verify", help="List the program before and after, and compare; needs Q.")
]


def _text_of(file: Path) -> str:
    with reading(file):
        return read_text(file, "program")


def _show(listing: Iterable[Listed], printing: Printing) -> None:
    told = [each for each in listing if each.text]
    printing.show(told, program_listing(told).rstrip("\n") or "the program is empty")


@app.command(name="check")
@moves_nothing
def check_(
    file: ProgramFile,
    *,
    at: At = 0,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Check a program without an axis, and print it with the addresses that its instructions will have.

    ```sh
    compax smc program check cycle.txt --profile im483i
    ```
    """
    _show(parse_program(_text_of(file), line.settings.profile, start=at), printing)


@app.command(name="list")
@moves_nothing
async def list_(
    url: LineUrl,
    axis: AxisName,
    *,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"), help="File to write the listing to.")] = None,
    force: Force = False,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    List the program of an axis, with addresses; `write` takes it as it is printed.

    ```sh
    compax smc program list serial:///dev/ttyUSB0 X -o cycle.txt
    ```
    """
    list_program(line.settings.profile)
    if output is not None:
        expect_free(output, force=force)
    async with line.open_axis(url, axis) as programmed:
        listing = [each for each in await programmed.axis.program.list() if each.text]
    if output is None:
        _show(listing, printing)
        return
    replace_file(output, program_listing(listing))
    printing.show(
        {"file": output, "instructions": len(listing)},
        f"{len(listing)} instructions of {programmed.name} are in {output}",
    )


@app.command
async def write(
    url: LineUrl,
    axis: AxisName,
    file: ProgramFile,
    *,
    at: At = 0,
    verify: Verify = True,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Write a program into an axis, from the first instruction on that is not there already.

    All of it is checked before anything is sent. The memory wears out by writing. Ctrl-C ends program entry, and says
    what is written and what is not.

    ```sh
    compax smc program write serial:///dev/ttyUSB0 X cycle.txt
    ```
    """
    text, profile = _text_of(file), line.settings.profile
    parse_program(text, profile, start=at)
    if verify:
        _expect_listing(line)
    async with line.open_axis(url, axis) as programmed:
        with counting("writing", printing) as on_progress:
            shown = await programmed.axis.program.write(text, at=at, verify=verify, on_progress=on_progress)
    _show(shown, printing)
    printing.note(f"{programmed.name} {'lists it so' if verify else 'has acknowledged each; nothing was compared'}.")


@app.command
async def edit(
    url: LineUrl,
    axis: AxisName,
    address: Annotated[int, WHOLE, Parameter(help="Where the instruction begins, as `list` shows it.")],
    text: Annotated[str, Parameter(help="What shall stand there, as in R500; addresses are those of now.")],
    *,
    verify: Verify = True,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Exchange one instruction of a program; what follows is moved if its length is another one, and jumps follow.

    ```sh
    compax smc program edit serial:///dev/ttyUSB0 X 14 R500
    ```
    """
    instruction(text, line.settings.profile)
    _expect_listing(line)
    async with line.open_axis(url, axis) as programmed:
        shown = await programmed.axis.program.edit(address, text, verify=verify)
    _show(shown, printing)


@app.command
async def run(
    url: LineUrl,
    axis: AxisName,
    address: Annotated[int, WHOLE, Parameter(help="Where it begins.")] = 0,
    *,
    timeout_s: TimeoutS = None,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Run the program of an axis, and wait until the axis has settled.

    While it runs, an axis may hear nothing (DCB p. 27), a soft stop neither: `compax smc stop URL --abort` is heard.
    Ctrl-C stops the axis if it can, and says if it cannot.

    ```sh
    compax smc program run serial:///dev/ttyUSB0 X --timeout 120
    ```
    """
    plan_program(address, line.settings.profile)
    check_manner(timeout_s, "stop")
    async with line.open_axis(url, axis) as programmed:
        running = programmed.axis.program.run(address, timeout_s=timeout_s)
        try:
            await carry_out(programmed, running, printing, what=f"the program at {address} is over")
        except (AnswerTimeoutError, MoveInDoubtError) as error:
            error.add_note("If it moves: `compax smc stop URL --abort` is heard in a program, too, by every axis.")
            raise


def _expect_listing(line: SmcLine) -> None:
    """Refuse, before a line is opened, what an axis cannot list; `write --no-verify` writes without looking."""
    try:
        list_program(line.settings.profile)
    except InvalidCommandError as error:
        error.hint = f"write --no-verify writes without looking; {error.hint}"
        raise
