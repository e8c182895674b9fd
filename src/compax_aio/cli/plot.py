"""``compax plot``: motion records as a picture for a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from compax_aio import InvalidCommandError
from compax_aio.recording.motion_reading import MotionRecord, read_record

from .files import Force, expect_free
from .interruption import moves_nothing
from .number_words import NUMBER
from .printing import Printing

__all__ = ["plot"]


@moves_nothing
def plot(
    *files: Annotated[Path, Parameter(name="FILE", help="Motion records, as `compax record` writes them.")],
    output: Annotated[
        Path | None,
        Parameter(
            name=("--output", "-o"), help="Picture: .png, .svg or .pdf; if not given, the record's name as .png."
        ),
    ] = None,
    axis: Annotated[
        tuple[str, ...], Parameter(negative=(), help="Draw only this axis; may be given several times.")
    ] = (),
    from_: Annotated[
        float | None, NUMBER, Parameter(name="--from", help="Seconds from the start where the picture begins.")
    ] = None,
    until: Annotated[float | None, NUMBER, Parameter(help="Seconds from the start where it ends.")] = None,
    title: Annotated[str | None, Parameter(help="In place of the names of the axes.")] = None,
    overlay: Annotated[
        bool,
        Parameter(negative=(), help="Let each record begin at 0, to compare moves; else they are placed by the clock."),
    ] = False,
    force: Force = False,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Draw position with target, following error, speed and torque, with marks for what happened.

    Several axes, and several records, share one time base. Where nothing was read, lines are broken. The picture is 180
    mm wide; in an SVG, text stays text.

    ```sh
    compax plot run.csv
    compax plot run.csv -o run.svg --axis x --from 2 --until 5 --title "X axis, acceptance test"
    compax plot before.csv after.csv -o compared.png --overlay
    ```
    """
    from compax_aio.recording.plot import draw, save_plot  # noqa: PLC0415 - the library is an extra

    if not files:
        raise InvalidCommandError("no record was named", hint="for instance: compax plot run.csv")
    picture = output or files[0].with_suffix(".png")
    expect_free(picture, force=force)
    records = [_read(each) for each in files]
    figure = draw(records, axes=axis, from_s=from_, until_s=until, title=title, overlay=overlay)
    save_plot(figure, picture)
    for record in records:
        if record.cut is not None:
            printing.note(f"{record.path} is not whole: {record.cut}")
    printing.show(
        {
            "file": str(picture),
            "records": [
                {
                    "file": str(record.path),
                    "axes": list(record.axes),
                    "samples": record.samples,
                    "marks": len(record.marks),
                    "duration_s": record.duration_s,
                    "cut": record.cut,
                }
                for record in records
            ],
        },
        f"{picture}: {', '.join(axis or dict.fromkeys(name for record in records for name in record.axes))}",
    )


def _read(path: Path) -> MotionRecord:
    try:
        return read_record(path)
    except FileNotFoundError as error:
        raise InvalidCommandError(f"there is no file {path}", hint="`compax record` writes one") from error
