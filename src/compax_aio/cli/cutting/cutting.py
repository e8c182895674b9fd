"""``compax camm1 cut``: jobs checked, shown, asked about, and sent; watched until they are cut, aborted by Ctrl-C."""

from __future__ import annotations

import asyncio
from typing import Annotated, Final, Literal

from cyclopts import Parameter

from compax_aio import CompaxError, InvalidCommandError, MoveActiveError, MoveInDoubtError, camm1
from compax_aio.camm1.cut import Cut
from compax_aio.camm1.cutter import Cutter

from ..confirming import confirm, expect_somebody
from ..exit_codes import OK
from ..half_way import Yes
from ..interruption import in_motion, say_at_end
from ..number_words import NUMBER
from ..printing import Printing
from ..problems import as_data
from .jobs import STANDARD_INPUT, JobFile, expect_one_input
from .keys import pause_key
from .line import CutterLine, CutterUrl, Machine
from .outline import written_time
from .planning import Plan, PlannedJob, baud_rate_of
from .sheet_size import SheetSize
from .view import CutView

__all__ = ["cut"]

_NOT_WANTED: Final = 1

Handshake = Literal["auto", "software", "xonxoff", "enq1", "enq2", "hardwire"]


async def cut(
    url: CutterUrl,
    *files: JobFile,
    handshake: Annotated[
        Handshake,
        Parameter(
            help="How the buffer of the cutter is kept from overflowing: software asks for free space again and again; "
            "hardwire takes a cable that has the lines."
        ),
    ] = "auto",
    speed: Annotated[
        float | None, NUMBER, Parameter(help="cm/s, in place of every speed that the job sets (VS).")
    ] = None,
    force: Annotated[
        float | None,
        NUMBER,
        Parameter(help="In place of every force that the job sets; gf (!FS), or steps of the machine (FS)."),
    ] = None,
    sheet: SheetSize = None,
    check: Annotated[
        bool, Parameter(name="--check", negative="--no-check", help="Refuse a job with an error in it.")
    ] = True,
    yes: Yes = False,
    machine: Machine = Machine(),  # noqa: B008 - it is frozen
    line: CutterLine = CutterLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Cut jobs, one after the other, and wait until each is cut.

    Each is checked first, and what it will cut is shown; then it is asked whether to begin. While it is cut, `p` pauses
    and goes on. Ctrl-C aborts: the vector under way is cut to its end, what the buffer holds is dropped, the tool is
    lifted, and it is said how far it came. Nothing is ever sent twice, and a job whose line was lost is not gone on
    with.

    ```sh
    compax camm1 cut serial:///dev/ttyUSB0 sticker.plt
    compax camm1 cut serial:///dev/ttyUSB0 sticker.plt --profile pnc-900 --sheet 400x280 --speed 5
    compax camm1 cut tcp://192.168.1.50:4001 - --yes --json
    ```
    """
    expect_one_input(files)
    expect_somebody(yes=yes)
    if not yes and any(str(each) == STANDARD_INPUT for each in files):
        raise InvalidCommandError("the job comes where the answer to a question would", hint="say --yes")
    profile = machine.known()
    plan = Plan(
        profile=profile,
        settings=camm1.JobSettings(speed_cm_s=speed, force_gf=force),
        sheet=sheet,
        baud_rate=line.baud_rate or baud_rate_of(url) or profile.baud_rate,
        is_checked=check,
    )
    jobs = [await plan.read(each, printing) for each in files]
    if not yes and not await confirm(f"Cut {'it' if len(jobs) == 1 else 'them'}, on {url}?"):
        printing.note("Nothing was sent.")
        return _NOT_WANTED
    async with line.open(url, profile) as cutter:
        for number, job in enumerate(jobs):
            left = [each.named.name for each in jobs[number + 1 :]]
            begun = cutter.cut(job.named.job.data, handshake=handshake, check=check)
            await _carry_out(cutter, begun, job, printing, left=left, has_keys=STANDARD_INPUT not in map(str, files))
    return OK


async def _carry_out(
    cutter: Cutter, cut: Cut, job: PlannedJob, printing: Printing, *, left: list[str], has_keys: bool
) -> None:
    """Watch a job until it is cut; where the program is interrupted meanwhile, it is aborted, and that is said."""
    name, mm = job.named.name, 1 / cutter.profile.steps_per_mm
    try:
        with (
            in_motion(cutter.name),
            CutView(name, mm, printing) as view,
            pause_key(cut, printing, wanted=has_keys, before_interrupt=view.clear) as view.has_keys,
        ):
            async with view.ticking():
                async for progress in cut.progress():
                    view.show(progress)
                result = await cut
    except asyncio.CancelledError:
        await _abort(cutter, cut, name, printing, left)
        raise
    except CompaxError as error:
        _tell_people(error)
        if left:
            error.add_note(f"not begun: {', '.join(left)}")
        raise
    printing.show(
        {"job": name, "result": result, "outline": job.outline, "problems": [as_data(each) for each in job.problems]},
        f"{name}: cut in {written_time(result.duration_s)}, proved by {result.proved_by}; {result.bytes:,} bytes, "
        f"{result.instructions:,} instructions, {result.handshake} handshake: {result.handshake_because}",
    )
    for warning in result.warnings:
        printing.note(f"{name}: {warning}")


def _tell_people(error: CompaxError) -> None:
    """Say what to do at a terminal, where another thing is to be done than in a program, and nothing twice."""
    if isinstance(error, MoveActiveError):
        error.hint = "wait until it is cut; or `compax camm1 stop` drops it, and lifts the tool"
    elif isinstance(error, MoveInDoubtError):
        error.hint = "look at the sheet before you cut anew; `compax camm1 stop` drops what is left in its buffer"
    notes = getattr(error, "__notes__", [])
    notes[:] = [each for each in notes if each.removeprefix("job: ") not in error.what]


async def _abort(cutter: Cutter, cut: Cut, name: str, printing: Printing, left: list[str]) -> None:
    """Abort a job because the command is interrupted, and let what is true then be said at the end."""
    try:
        cut.cancel()  # .K is on its way when this returns
        await cut.abort()
    except CompaxError:
        printing.note(f"{cutter.name} may still be cutting: look at it, and use its switch if it is.")
        raise
    more = f" Not begun: {', '.join(left)}." if left else ""
    say_at_end(
        f"Interrupted. {name}: the job was aborted; the vector under way is cut to its end, then the tool is lifted. "
        f"What is known: {cut.account}.{more}"
    )
    if printing.json:
        printing.show({"job": name, "interrupted": True, "aborted": True, "account": cut.account, "not_begun": left})
