"""``compax camm1 check`` and ``preview``: what is wrong with a job, and what it will cut, without a machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from compax_aio import InvalidCommandError, camm1
from compax_aio.camm1.previewing.preview import FORMS

from ..exit_codes import OK
from ..files import Force, expect_free
from ..interruption import moves_nothing
from ..printing import Printing
from ..problems import as_data, has_errors, told
from .jobs import STANDARD_INPUT, JobFile, read_job
from .line import Machine
from .outline import outline_of, outline_told
from .sheet_size import SheetSize

__all__ = ["check", "preview"]

_HAS_ERRORS = 1


@moves_nothing
def check(
    file: JobFile,
    *,
    sheet: SheetSize = None,
    machine: Machine = Machine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Say what is wrong with a job, by line and column; without a machine.

    Unknown instructions and such that the model does not have, wrong arguments, ways outside of the sheet, a label
    without its end, a tool that is left down. Exits with 1 if there is an error, which `cut` would refuse; warnings
    alone exit with 0.

    ```sh
    compax camm1 check sticker.plt
    compax camm1 check sticker.plt --profile pnc-900 --sheet 400x280 --json
    ```
    """
    profile = machine.known()
    named = read_job(file, profile)
    problems = camm1.check(named.job, profile, sheet)
    counts = {severity: sum(each.severity is severity for each in problems) for severity in camm1.Severity}
    summary = ", ".join(_count(number, severity) for severity, number in counts.items() if number) or "nothing is wrong"
    printing.show(
        {"job": named.name, "profile": profile.name, "problems": [as_data(each) for each in problems]},
        told(named.name, problems).append(f"{named.name}: {summary}, for {profile.name}"),
    )
    return _HAS_ERRORS if has_errors(problems) else OK


def _count(number: int, severity: camm1.Severity) -> str:
    return f"{number} {severity.value}{'s' if number > 1 else ''}"


@moves_nothing
def preview(
    file: JobFile,
    *,
    output: Annotated[
        Path | None,
        Parameter(name=("--output", "-o"), help="Picture: .svg or .png; if not given, the name of the job as .svg."),
    ] = None,
    sheet: SheetSize = None,
    title: Annotated[str | None, Parameter(help="In place of the name of the job.")] = None,
    force: Force = False,
    machine: Machine = Machine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Draw what a job will cut, and what is wrong with it; without a machine.

    Cuts are coloured from the first to the last, and numbered where they are few; ways with the tool up are dashed. A
    millimetre of an SVG is one of the sheet. What cannot be drawn as it will be cut is said below the drawing.

    ```sh
    compax camm1 preview sticker.plt
    compax camm1 preview sticker.plt -o sticker.png --profile pnc-900 --sheet 400x280
    ```
    """
    profile = machine.known()
    if output is None and str(file) == STANDARD_INPUT:
        raise InvalidCommandError("a job from the standard input has no name", hint="say -o PICTURE.svg")
    picture = output or file.with_suffix(FORMS[0])
    if picture.suffix.lower() not in FORMS:
        raise InvalidCommandError(f"the name of a preview ends in {', '.join(FORMS)}, not as {picture}")
    expect_free(picture, force=force)
    named = read_job(file, profile)
    problems = camm1.check(named.job, profile, sheet)
    drawing = camm1.preview(
        named.job,
        picture,
        profile=profile,
        sheet=sheet,
        problems=problems,
        title=named.name if title is None else title,
    )
    outline = outline_of(named, drawing, profile, profile.baud_rate)
    lines = [f"{picture} shows:", *outline_told(outline)]
    if problems:
        lines.append(f"  {len(problems)} problems, which `compax camm1 check` tells")
    printing.show(
        {"file": str(picture), "outline": outline, "problems": [as_data(each) for each in problems]}, "\n".join(lines)
    )
