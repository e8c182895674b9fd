"""A job drawn to a file, with what is wrong with it."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ...errors import InvalidCommandError
from ...text_file import name_of, replace_file
from ..profiles import PNC_1610, Profile
from .drawing import Bounds, Drawing
from .layout import Flaw, scene_of
from .scene import Scene
from .svg import svg_of
from .tool_path import drawing_of

if TYPE_CHECKING:
    from os import PathLike

    from ..language.job import Job

__all__ = ["FORMS", "draw", "preview", "subtitles_of"]

FORMS: Final = (".svg", ".png")
_METRE_MM: Final = 1000.0


def preview(
    job: Job,
    path: str | PathLike[str],
    *,
    profile: Profile = PNC_1610,
    sheet_mm: tuple[float, float] | None = None,
    flaws: Iterable[Flaw] = (),
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
        sheet_mm: Width and height of the sheet that lies in it, with the origin at its left bottom; outlined.
        flaws: What is wrong with the job; marked.
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
    scene = draw(drawing, profile=profile, sheet_mm=sheet_mm, flaws=tuple(flaws), title=title)
    if form == ".svg":
        replace_file(path, svg_of(scene))
    else:
        _write_png(scene, path)
    return drawing


def draw(
    drawing: Drawing,
    *,
    profile: Profile = PNC_1610,
    sheet_mm: tuple[float, float] | None = None,
    flaws: Sequence[Flaw] = (),
    title: str = "",
) -> Scene:
    """Lay *drawing* out as :func:`preview` does."""
    sheet = None
    if sheet_mm is not None:
        width_mm, height_mm = sheet_mm
        sheet = Bounds(0, 0, width_mm * profile.steps_per_mm, height_mm * profile.steps_per_mm)
    subtitles = subtitles_of(drawing, profile)
    return scene_of(
        drawing, mm_per_step=1 / profile.steps_per_mm, title=title, subtitles=subtitles, sheet=sheet, flaws=flaws
    )


def subtitles_of(drawing: Drawing, profile: Profile) -> list[str]:
    """Say in words how much is cut, and where."""
    mm = 1 / profile.steps_per_mm
    bounds = drawing.cut_bounds
    if bounds is None:
        return [f"nothing is cut; travel {_length(drawing.travel_steps * mm)}"]
    count = "1 cut" if drawing.cuts == 1 else f"{drawing.cuts:,} cuts"
    return [
        f"{count}, {_length(drawing.cut_steps * mm)}; travel {_length(drawing.travel_steps * mm)}",
        f"from {_point(bounds.left * mm, bounds.bottom * mm)} to {_point(bounds.right * mm, bounds.top * mm)} mm",
    ]


def _point(x_mm: float, y_mm: float) -> str:
    return f"({x_mm:.2f}, {y_mm:.2f})"


def _length(length_mm: float) -> str:
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
