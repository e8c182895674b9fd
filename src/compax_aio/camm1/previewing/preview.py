"""A job drawn to a file, with what is wrong with it."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ...errors import InvalidCommandError
from ...severity import Severity
from ...text_file import name_of, replace_file
from ..profiles import PNC_1610, Profile
from .drawing import Bounds, Drawing
from .layout import Flaw, scene_of
from .scene import Scene
from .svg import svg_of
from .tool_path import drawing_of

if TYPE_CHECKING:
    from os import PathLike

    from ..checking import Problem, Sheet
    from ..language.job import Job

__all__ = ["FORMS", "preview", "written_length"]

FORMS: Final = (".svg", ".png")
_METRE_MM: Final = 1000.0


def preview(
    job: Job,
    path: str | PathLike[str],
    *,
    profile: Profile = PNC_1610,
    sheet: Sheet | None = None,
    problems: Iterable[Problem] = (),
    title: str = "",
) -> Drawing:
    """
    Draw what *job* will cut to a file, as SVG or PNG by its name: whole, or not at all.

    Cuts are coloured from the first to the last, and numbered where they are few; ways with the tool up are dashed.
    What is not drawn as it will be cut is said below. An SVG is made without any library, and has a millimetre for a
    millimetre; a PNG takes matplotlib.

    Args:
        job: As :func:`compax_aio.camm1.parse` gives it.
        path: Of the file; one that is there is replaced.
        profile: The machine, for the size of its steps.
        sheet: What lies in it; outlined.
        problems: What :func:`compax_aio.camm1.check` has found; marked where it is, and told below.
        title: In the first line; empty: none.

    Returns:
        What was drawn, with bounds and lengths.

    Raises:
        InvalidCommandError: The name ends in something else, or matplotlib is not there.
        OSError: The file cannot be written.
    """
    path = Path(path)
    form = path.suffix.lower()
    if form not in FORMS:
        raise InvalidCommandError(f"the name of a preview ends in {', '.join(FORMS)}, not as {name_of(path)}")
    drawing = drawing_of(job.instructions)
    per_mm = profile.steps_per_mm
    scene = scene_of(
        drawing,
        mm_per_step=1 / per_mm,
        title=title,
        subtitles=_subtitles(drawing, profile),
        sheet=None if sheet is None else Bounds(0, 0, sheet.x_mm * per_mm, sheet.y_mm * per_mm),
        flaws=[_flaw(each) for each in problems],
    )
    if form == ".svg":
        replace_file(path, svg_of(scene))
    else:
        _write_png(scene, path)
    return drawing


def _flaw(problem: Problem) -> Flaw:
    where = f"{problem.line}:{problem.column}"
    return Flaw(problem.what, problem.offset, where, is_error=problem.severity is Severity.ERROR)


def _subtitles(drawing: Drawing, profile: Profile) -> list[str]:
    """Say in words how much is cut, and where."""
    mm = 1 / profile.steps_per_mm
    bounds = drawing.cut_bounds
    if bounds is None:
        return [f"nothing is cut; travel {written_length(drawing.travel_steps * mm)}"]
    count = "1 cut" if drawing.cuts == 1 else f"{drawing.cuts:,} cuts"
    return [
        f"{count}, {written_length(drawing.cut_steps * mm)}; travel {written_length(drawing.travel_steps * mm)}",
        f"from {_point(bounds.left * mm, bounds.bottom * mm)} to {_point(bounds.right * mm, bounds.top * mm)} mm",
    ]


def _point(x_mm: float, y_mm: float) -> str:
    return f"({x_mm:.2f}, {y_mm:.2f})"


def written_length(length_mm: float) -> str:
    """Write a length as people do."""
    return f"{length_mm:.1f} mm" if length_mm < _METRE_MM else f"{length_mm / _METRE_MM:,.2f} m"


def _write_png(scene: Scene, path: Path) -> None:
    from .png import png_of  # noqa: PLC0415 - it needs what few have

    picture = png_of(scene)
    new = path.with_name(f".{path.name[:32]}.{secrets.token_hex(8)}")
    try:
        new.write_bytes(picture)
        new.replace(path)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise
