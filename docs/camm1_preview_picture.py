"""Draw docs/camm1-preview.svg: a badge with a star, a label and a mistake, as `compax camm1 preview` shows it."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

from compax_aio import camm1

_CENTRE = (1800, 1200)


def _star(points: int, outer: float, inner: float) -> str:
    """Return a star as one list of coordinates, closed."""
    corners = []
    for number in range(2 * points + 1):
        angle = pi / 2 + pi * number / points
        radius = inner if number % 2 else outer
        corners.append(f"{_CENTRE[0] + radius * cos(angle):.0f},{_CENTRE[1] + radius * sin(angle):.0f}")
    return f"PU{corners[0]};PD{','.join(corners[1:])};PU;"


def badge() -> str:
    """Return the job."""
    x, y = _CENTRE
    holes = "".join(f"PU{x + dx},{y + dy};CI80;" for dx in (-1400, 1400) for dy in (-900, 900))
    return "\n".join(
        [
            "IN;PA;VS10;",
            holes,
            _star(5, 850, 340),
            f"PU{x},{y};CI900;",
            f"PU{x - 1150},{y - 1150};SI0.4,0.55;LBCAMM-1\x03",
            f"PU{x - 1600},{y - 1300};PD{x + 1700},{y - 1300},{x + 1700},{y + 1100},{x - 1600},{y + 1100},"
            f"{x - 1600},{y - 1300};",
            "PU0,0;",
            "",
        ]
    )


def main() -> None:
    """Draw it."""
    job, sheet = camm1.parse(badge(), camm1.PNC_900), camm1.Sheet(85, 62)
    camm1.preview(
        job,
        Path(__file__).with_name("camm1-preview.svg"),
        profile=camm1.PNC_900,
        sheet=sheet,
        problems=camm1.check(job, camm1.PNC_900, sheet),
        title="badge.plt",
    )


if __name__ == "__main__":
    main()
