"""What a job will cut, in figures: how much, where, and how long it takes at least."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from compax_aio import camm1
from compax_aio.camm1.previewing.preview import written_length

from ..printing import Printing
from .jobs import NamedJob

__all__ = ["Outline", "outline_of", "outline_told", "show_outline", "written_time"]

_BITS_A_BYTE: Final = 10
_MM_PER_CM: Final = 10.0
_MINUTE_S: Final = 60.0
_HOUR_S: Final = 3600.0


@dataclass(frozen=True, kw_only=True)
class Outline:
    """What a job will cut; lengths are those of the ways, without what labels and fills take."""

    job: str
    bytes: int
    instructions: int
    cuts: int
    cut_mm: float
    travel_mm: float
    bounds_mm: tuple[float, float, float, float] | None
    """Left, bottom, right and top of all that is cut; None: nothing is."""
    speeds_cm_s: tuple[float, ...]
    """That the job asks for."""
    cutting_at_least_s: float | None
    """At these speeds, without travel and acceleration; None: some is cut at a speed that is not known."""
    sending_at_least_s: float
    """What its bytes take on the line."""
    remarks: tuple[str, ...]
    """What could not be foreseen."""

    @property
    def at_least_s(self) -> float:
        """How long it takes at least, as far as that is known."""
        return max(self.cutting_at_least_s or 0.0, self.sending_at_least_s)


def outline_of(named: NamedJob, drawing: camm1.Drawing, profile: camm1.Profile, baud_rate: int) -> Outline:
    """Sum up a job for a machine."""
    mm = 1 / profile.steps_per_mm
    bounds = drawing.cut_bounds
    by_speed = drawing.cut_steps_by_speed()
    speeds = tuple(sorted(speed for speed in by_speed if speed is not None))
    cutting_s = sum(by_speed[speed] * mm / (speed * _MM_PER_CM) for speed in speeds)
    return Outline(
        job=named.name,
        bytes=len(named.data),
        instructions=sum(bool(each.name) for each in named.job.instructions),
        cuts=drawing.cuts,
        cut_mm=sum(by_speed.values()) * mm,
        travel_mm=drawing.travel_steps * mm,
        bounds_mm=None
        if bounds is None
        else (bounds.left * mm, bounds.bottom * mm, bounds.right * mm, bounds.top * mm),
        speeds_cm_s=speeds,
        cutting_at_least_s=None if by_speed.get(None) else cutting_s,
        sending_at_least_s=len(named.data) * _BITS_A_BYTE / baud_rate,
        remarks=tuple(f"line {each.place.line}: {each.what}" for each in drawing.remarks),
    )


def show_outline(outline: Outline, printing: Printing) -> None:
    """Tell a person what a job will cut."""
    for line in outline_told(outline):
        printing.note(line)


def outline_told(outline: Outline) -> list[str]:
    """Write an outline for people."""
    size = f"{outline.bytes:,} bytes, {outline.instructions:,} instructions"
    if outline.bounds_mm is None:
        return [f"{outline.job}: nothing is cut ({size})"]
    left, bottom, right, top = outline.bounds_mm
    corners = f"from ({left:.2f}, {bottom:.2f}) to ({right:.2f}, {top:.2f}) mm"
    count = "1 cut" if outline.cuts == 1 else f"{outline.cuts:,} cuts"
    return [
        f"{outline.job}: {count} of {written_length(outline.cut_mm)} in all, travel "
        f"{written_length(outline.travel_mm)} ({size})",
        f"  {right - left:.2f} by {top - bottom:.2f} mm, {corners}",
        f"  {_time(outline)}",
        *(f"  {each}" for each in outline.remarks),
    ]


def _time(outline: Outline) -> str:
    sending = f"its bytes take {written_time(outline.sending_at_least_s)} on the line"
    if outline.cutting_at_least_s is None:
        return f"how long it takes is not known, for it sets no speed; {sending}"
    speeds = " and ".join(f"{each:g}" for each in outline.speeds_cm_s)
    at = (
        f", at {speeds} cm/s and without acceleration"
        if outline.cutting_at_least_s and len(outline.speeds_cm_s) < 4
        else ""
    )
    return f"at least {written_time(outline.at_least_s)}{at}; {sending}"


def written_time(time_s: float) -> str:
    """Write a time as people do."""
    if time_s < _MINUTE_S:
        return f"{time_s:.1f} s"
    if time_s < _HOUR_S:
        return f"{time_s // _MINUTE_S:.0f} min {time_s % _MINUTE_S:.0f} s"
    return f"{time_s // _HOUR_S:.0f} h {time_s % _HOUR_S // _MINUTE_S:.0f} min"
