"""Where the tool goes is followed from the job alone; what the machine alone knows is told as uncertain."""

from __future__ import annotations

from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.camm1.little_plotter import segments

from compax_aio.camm1.language.job import parse
from compax_aio.camm1.language.tracking import Path, Tracker
from compax_aio.camm1.profiles import DXY_1300

words = st.sampled_from(["PU", "PD", "PA", "PR", "D", "M", "I", "R"])
pairs = st.lists(st.tuples(st.integers(-999, 999), st.integers(-999, 999)), min_size=1, max_size=5)


def followed(job: str) -> tuple[Tracker, list[Path]]:
    tracker = Tracker()
    paths: list[Path] = []
    for each in parse(job, DXY_1300):
        path = tracker.follow(each)
        if path is not None:
            paths.append(path)
    return tracker, paths


def end_of(job: str) -> tuple[float, float, bool, bool]:
    tracker, _ = followed(job)
    return round(tracker.x, 6), round(tracker.y, 6), tracker.tool_is_down, tracker.is_certain


@given(st.lists(st.tuples(words, pairs), min_size=1, max_size=10))
def test_straight_ways_are_those_of_a_plotter(rows: list[tuple[str, list[tuple[int, int]]]]) -> None:
    job = "".join(f"{word}{','.join(f'{x},{y}' for x, y in points)}\n;" for word, points in rows)
    tracker, paths = followed(job)
    drawn = segments(job.encode())
    assert [(x, y, path.is_cut) for path in paths for x, y in zip(path.xs, path.ys, strict=True)] == [
        (x, y, is_cut) for _, _, x, y, is_cut in drawn
    ]
    assert (*tracker.position_steps, tracker.tool_is_down) == drawn[-1][2:]


@pytest.mark.parametrize(
    ("job", "x", "y", "is_down"),
    [
        ("IN;PU10,20;", 10, 20, False),
        ("PD;", 0, 0, True),
        ("PD10,10;PU;", 10, 10, False),
        ("PD10,10;IN;", 10, 10, False),
        ("PR5,5;PD1,1;PA;PD20,20;", 20, 20, True),
        ("PR5,5;DF;PD7,7;", 7, 7, True),
        ("M10,10\nH\n", 0, 0, False),
        ("D10,10\nI5,5\n", 15, 15, True),
        ("PA100,0;AA0,0,90;", 0, 100, False),
        ("PA100,0;PD;AR-100,0,180;", -100, 0, True),
        ("PA50,50;CI10;", 50, 50, False),
        ("PA50,50;EA10,10;ER5,5;RA1,1;RR2,2;EW10,0,90;WG10,0,90;", 50, 50, False),
        ("C100,100,50,0,90\n", 100, 150, True),
        ("M10,0\nE10,0,180\n", -10, 0, True),
        ("A5,5\nG10,0,90\n", 5, 15, True),
        ("IP0,0,1000,1000;SC0,10,0,10;PA5,5;", 500, 500, False),
        ("IP0,0,1000,1000;SC0,10,0,10;PA5,5;PR1,-1;", 600, 400, False),
        ("IP0,0,1000,1000;IP100,100;SC0,10,0,10;PA0,10;", 100, 1100, False),
        ("IP0,0,1000,1000;SC0,10,0,10;SC;PA7,7;", 7, 7, False),
        ("IP0,0,1000,1000;SC0,10,0,10;M7,7\n", 7, 7, False),
        ("PD1,\x1b.B2,3,4;", 3, 4, True),
    ],
)
def test_where_the_tool_is_at_the_end(job: str, x: float, y: float, is_down: bool) -> None:
    assert end_of(job) == (x, y, is_down, True)


@pytest.mark.parametrize(
    "job",
    [
        "LBHello\x03",
        "M1,1\nPHello\n",
        "PE<=;",
        "CP1,1;",
        "UC1,2,3;",
        "T1,1,1,1,1\n",
        "X0,10,10\n",
        "SC0,10,0,10;PA5,5;",
        "IP0,0,10,10;SC0,0,0,10;PA5,5;",
        "RO90;",
        "RO90;PA5,5;",
        "PA" + "9" * 400 + ",1;",
        "SC0,10,0,10;AA5,5,90;",
        "SC0,10,0,10;EA5,5;",
    ],
)
def test_what_the_machine_alone_knows_is_uncertain(job: str) -> None:
    assert not followed(job)[0].is_certain


def test_an_absolute_move_ends_the_uncertainty() -> None:
    assert end_of("LBHello\x03PR5,5;")[3] is False
    assert end_of("LBHello\x03PA5,5;") == (5, 5, False, True)
    assert end_of("RO90;RO;PA5,5;") == (5, 5, False, True)


def test_points_of_arcs_lie_on_their_circle() -> None:
    _, paths = followed("PA100,0;PD;AA0,0,-270;")
    arc = paths[-1]
    assert arc.is_cut
    assert all(abs(hypot(x, y) - 100) < 1e-9 for x, y in zip(arc.xs, arc.ys, strict=True))
    assert arc.bounds == pytest.approx((-100, 100, -100, 100))


def test_a_circle_is_cut_whatever_the_tool_was() -> None:
    _, (move, circle) = followed("PA500,500;CI100;")
    assert circle.is_cut
    assert not move.is_cut
    assert circle.bounds == pytest.approx((400, 600, 400, 600))


def test_a_scaled_circle_is_scaled() -> None:
    _, paths = followed("IP0,0,1000,1000;SC0,10,0,10;PA5,5;CI1;")
    assert paths[-1].bounds == pytest.approx((400, 600, 400, 600))


@pytest.mark.parametrize(
    "job", ["PD1;", "PD1,x;", "AA1,1;", "CI;", "CI" + "9" * 400 + ";", "C1\n", "EW1,2," + "9" * 400]
)
def test_what_cannot_be_read_leads_nowhere(job: str) -> None:
    tracker, paths = followed("PA3,4;" + job)
    assert (tracker.x, tracker.y, len(paths)) == (3, 4, 1)
