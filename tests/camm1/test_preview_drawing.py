"""What is drawn of a job is what a machine would cut of it: ways, tool states, arcs, areas, lengths."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import pytest
from tests.camm1.little_plotter import segments
from tests.fakes.vpype_jobs import needs_vpype, vpype_job

from compax_aio import camm1
from compax_aio.camm1.previewing.drawing import Bounds, Drawing, Place
from compax_aio.camm1.previewing.tool_path import drawing_of


def drawn(job: str) -> Drawing:
    return drawing_of(camm1.parse(job, camm1.DXY_1300).instructions)


def cuts(job: str) -> list[list[tuple[float, float]]]:
    return [stroke.points for stroke in drawn(job).strokes if stroke.is_cut]


def travels(job: str) -> list[list[tuple[float, float]]]:
    return [stroke.points for stroke in drawn(job).strokes if not stroke.is_cut]


def remarks(job: str) -> str:
    return "; ".join(each.what for each in drawn(job).remarks)


SQUARE = "PU100,100;PD200,100,200,200,100,200,100,100;PU;"


# Ways ---------------------------------------------------------------------------------------------------------------


def test_one_way_is_one_stroke_however_many_instructions_it_is_told_by() -> None:
    assert cuts(SQUARE) == [[(100, 100), (200, 100), (200, 200), (100, 200), (100, 100)]]
    assert cuts("PU100,100;PD200,100;PD200,200;PD100,200;PD100,100;PU;") == cuts(SQUARE)
    assert travels(SQUARE) == [[(0, 0), (100, 100)]]


def test_coordinates_follow_the_last_pa_or_pr() -> None:
    assert cuts("PD10,0;PR0,10,-10,0;PD0,-10;PU;") == [[(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)]]
    assert drawn("PR5,5;PA;PU5,5;").end == (5, 5)


def test_pa_and_pr_leave_the_tool_as_it_was() -> None:
    assert cuts("PA10,10;PD;PA20,10;PU;PA0,0;") == [[(10, 10), (20, 10)]]


def test_initialising_lifts_the_tool_and_ends_relative_ways() -> None:
    assert cuts("PD;PR10,0;IN;PU5,5;") == [[(0, 0), (10, 0)]]
    assert drawn("PD;PR10,0;IN;PU5,5;").end == (5, 5)


def test_a_tool_that_goes_down_and_up_again_pierces_the_sheet() -> None:
    assert cuts("PU10,10;PD;PU20,20;") == [[(10, 10), (10, 10)]]
    assert cuts("PU10,10;PD;") == [[(10, 10), (10, 10)]]


def test_where_it_ends_and_how_is_known() -> None:
    assert drawn("PD10,10;").ends_down
    assert not drawn("PD10,10;PU;").ends_down
    assert drawn("PD10,10;PU30,5;").end == (30, 5)


def test_mode_1_draws_the_same() -> None:
    assert cuts("M100,100\nD200,100,200,200,100,200,100,100\nH\n") == cuts(SQUARE)
    assert cuts("M100,100\nI100,0,0,100,-100,0,0,-100\nH\n") == cuts(SQUARE)
    assert drawn("M100,100\nR10,5\n").end == (110, 105)
    assert drawn("M100,100\nD5,5\nH\n").end == (0, 0)


def test_a_call_of_mode_2_in_mode_1_is_drawn() -> None:
    assert cuts("M10,10\n^PD20,10;\n^PU;\n") == [[(10, 10), (20, 10)]]


def test_speeds_and_tools_part_strokes() -> None:
    strokes = [each for each in drawn("VS5;SP1;PD10,0;VS10;PD20,0;SP2;PD30,0;VS;PU;").strokes if each.is_cut]
    assert [(each.speed_cm_s, each.tool) for each in strokes] == [(5, 1), (10, 1), (10, 2)]
    assert drawn("VS5;PD400,0;VS;PD400,400;PU;").cut_steps_by_speed() == {5: 400, None: 400}


def test_user_units_become_steps_where_their_size_is_said() -> None:
    assert cuts("IP100,100,300,500;SC0,10,0,10;PU0,0;PD10,5;PU;") == [[(100, 100), (300, 300)]]
    assert cuts("IP100,100,300,500;SC0,10,0,10;PR;PD1,1;PU;") == [[(0, 0), (20, 40)]]
    assert cuts("IP100,100,300,500;SC0,10,0,10;SC;PD10,5;PU;") == [[(0, 0), (10, 5)]]
    assert cuts("IP0,0,100,100;IP10,10;SC0,1,0,1;PA;PD1,1;PU;") == [[(0, 0), (110, 110)]]
    assert cuts("IP0,0,100,100;IP;SC0,1,0,1;PA;PD1,1;PU;") == [[(0, 0), (1, 1)]]
    assert cuts("PD\x1b.B10,0;\x1b.OPU;OA;") == [[(0, 0), (10, 0)]]


def test_user_units_of_a_size_that_nobody_said_are_remarked() -> None:
    assert "no IP says how large" in remarks("SC0,10,0,10;PD5,5;PU;")
    assert cuts("SC0,10,0,10;PD5,5;PU;") == [[(0, 0), (5, 5)]]


# Shapes -------------------------------------------------------------------------------------------------------------


def test_a_circle_is_cut_around_where_the_tool_stands_and_leaves_it_there_as_it_was() -> None:
    drawing = drawn("PU1000,1000;CI400;")
    assert drawing.end == pytest.approx((1000, 1000))
    assert drawing.cut_bounds is not None
    assert drawing.cut_bounds.left == pytest.approx(600)
    assert drawing.cut_bounds.top == pytest.approx(1400)
    assert drawing.cut_steps == pytest.approx(2 * pi * 400, rel=0.002)
    assert not drawing.ends_down


def test_a_shape_leaves_the_tool_down_if_it_was() -> None:
    assert drawn("PU1000,1000;PD;CI400;").ends_down
    assert cuts("PU10,10;PD;EA30,20;PD10,0;PU;")[-1][-2:] == [(10, 10), (10, 0)]


def test_the_chord_of_a_circle_is_its_second_number() -> None:
    assert len(cuts("CI400,90;")[0]) == 5
    assert len(cuts("CI400;")[0]) == 73


@pytest.mark.parametrize("job", ["PU400,0;PD;AA0,0,90;PU;", "PU400,0;PD;AR-400,0,90;PU;"])
def test_an_arc_is_drawn_as_the_tool_stands(job: str) -> None:
    (arc,) = cuts(job)
    assert arc[0] == pytest.approx((400, 0))
    assert arc[-1] == pytest.approx((0, 400))
    assert cuts(job.replace("PD;", "")) == []


@pytest.mark.parametrize("job", ["PU10,10;EA30,20;", "PU10,10;ER20,10;"])
def test_a_rectangle_is_cut_around_and_leaves_the_tool_where_it_was(job: str) -> None:
    assert cuts(job) == [[(10, 10), (30, 10), (30, 20), (10, 20), (10, 10)]]
    assert drawn(job).end == (10, 10)


def test_a_wedge_goes_out_around_and_back() -> None:
    (edge,) = cuts("EW100,0,90,45;")
    assert edge[0] == pytest.approx((0, 0))
    assert edge[-1] == pytest.approx((0, 0))
    assert edge[1] == pytest.approx((100, 0))
    assert edge[-2] == pytest.approx((0, 100))


@pytest.mark.parametrize("job", ["RA30,20;", "RR30,20;", "WG30,0,90;", "PM0;PD30,0,30,30;PM2;FP;"])
def test_filled_areas_are_boxes_and_say_so(job: str) -> None:
    drawing = drawn(job)
    assert [box.kind for box in drawing.boxes] == ["fill"]
    assert drawing.cut_bounds is not None
    assert drawing.cut_bounds.right == pytest.approx(30)


def test_a_polygon_is_cut_only_where_its_edges_are_asked_for() -> None:
    assert cuts("PU10,10;PM0;PD20,10,20,20;PM2;PU5,5;") == []
    assert cuts("PU10,10;PM0;PD20,10,20,20;PM1;PD12,12,13,12,13,13;PM2;EP;") == [
        [(10, 10), (20, 10), (20, 20), (10, 10)],
        [(12, 12), (13, 12), (13, 13), (12, 12)],
    ]


def test_arcs_of_mode_1_end_where_they_end() -> None:
    around_point = drawn("C100,100,50,0,90\n")
    assert around_point.end == pytest.approx((100, 150))
    around_centre = drawn("A100,100\nG50,0,90\n")
    assert around_centre.end == pytest.approx((100, 150))
    from_tool = drawn("M150,100\nE50,0,90\n")
    assert from_tool.end == pytest.approx((100, 150))
    assert [len([each for each in drawing.strokes if each.is_cut]) for drawing in (around_point, from_tool)] == [1, 1]


def test_axes_and_rectangles_of_mode_1_are_drawn_without_what_is_remarked() -> None:
    assert cuts("X1,100,3\n") == [[(0, 0), (300, 0)]]
    assert cuts("X0,100,3\n") == [[(0, 0), (0, 300)]]
    assert "ticks" in remarks("X1,100,3\n")
    assert cuts("T0,20,10,1,1\n") == [[(0, 0), (20, 0), (20, 10), (0, 10), (0, 0)]]
    assert "hatching" in remarks("T1,20,10,1,1\n")


# Lettering ----------------------------------------------------------------------------------------------------------


def test_a_label_takes_the_room_of_its_characters_and_leaves_the_tool_behind_it() -> None:
    drawing = drawn("PU100,100;SI0.5,1;LBABC\x03")
    (box,) = drawing.boxes
    assert box.text == "ABC"
    assert Bounds.of(box.corners) == Bounds(100, 100, 100 + 200 * 4, 100 + 400)
    assert drawing.end == pytest.approx((100 + 200 * 4.5, 100))
    assert "boxes of about their size" in remarks("LBABC\x03")


def test_labels_run_as_their_direction_says() -> None:
    (box,) = drawn("PU0,0;SI0.5,1;DI0,1;LBABC\x03").boxes
    bounds = Bounds.of(box.corners)
    assert bounds is not None
    assert bounds.height_steps == pytest.approx(800)
    assert bounds.left == pytest.approx(-400)
    (upside_down,) = drawn("S9\nQ2\nPABC\n").boxes
    assert min(x for x, _ in upside_down.corners) < -100


def test_lines_of_a_label_stand_below_each_other() -> None:
    (box,) = drawn("SI0.5,1;LBAB\nC\x03").boxes
    assert Bounds.of(box.corners) == Bounds(0, -800, 500, 400)


def test_cp_goes_by_characters() -> None:
    assert drawn("SI0.5,1;CP2,1;").end == pytest.approx((600, 800))
    assert drawn("SI0.5,1;CP;").end == pytest.approx((0, -800))
    assert drawn("SI;DI;LB\x03").end == (0, 0)


# What cannot be told ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("job", "words"),
    [
        ("LT2,3;", "without gaps"),
        ("XT;", "ticks"),
        ("SM+;", "symbols"),
        ("SR1,2;", "shares of P1 to P2"),
        ("IW0,0,100,100;PD200,200;PU;", "will not be cut"),
        ("!PG100;", "feeds the sheet"),
        ("QQ5;", "QQ is not drawn: what it does is not known"),
        ("CI;", "CI with too few numbers"),
        ("PD5;PU;", "a coordinate without its partner"),
        ("PU99999999999,0;", "farther than coordinates reach"),
        ("RA99999999999,5;", "farther away than coordinates reach"),
    ],
)
def test_what_is_not_drawn_as_it_will_be_cut_is_remarked(job: str, words: str) -> None:
    assert words in remarks(job)


def test_a_remark_is_made_once_and_says_where_for_the_first_time() -> None:
    (remark,) = drawn("IN;\nLT2;\nLT3;\n").remarks
    assert remark.place == Place(offset=4, line=2, column=1)


def test_what_changes_no_shape_and_what_asks_is_not_remarked() -> None:
    assert drawn("IN;DF;VS5;FT1;PT0.3;CA;SA;IM223;!ST1;!FS80;OA;").remarks == ()


def test_the_feed_is_summed_up() -> None:
    assert drawn("!PG100;!PG-30;").feed_mm == 70


# As a whole ---------------------------------------------------------------------------------------------------------


def test_lengths_and_bounds_are_those_of_the_ways() -> None:
    drawing = drawn("PU300,400;PD300,500;PU0,0;")
    assert drawing.cuts == 1
    assert drawing.cut_steps == 100
    assert drawing.travel_steps == 500 + (300**2 + 500**2) ** 0.5
    assert drawing.cut_bounds == Bounds(300, 400, 300, 500)
    assert drawing.bounds == Bounds(0, 0, 300, 500)
    assert drawing.vectors == 3


def test_nothing_has_no_bounds() -> None:
    assert drawn("IN;").bounds is None
    assert drawn("PU100,100;").cut_bounds is None
    assert drawn("PU100,100;").bounds == Bounds(0, 0, 100, 100)
    assert Bounds.of(()) is None


def test_where_the_tool_stands_at_a_byte_of_the_job_is_known() -> None:
    marks = drawn("IN;PU10,10;PD20,20;").waymarks
    assert marks.at(0) == (0, 0)
    assert marks.at(3) == marks.at(10) == (10, 10)
    assert marks.at(11) == marks.at(500) == (20, 20)
    assert drawn("").waymarks.at(0) is None


# Real jobs ----------------------------------------------------------------------------------------------------------


@needs_vpype
@pytest.mark.parametrize("is_absolute", [False, True])
def test_the_cuts_of_a_real_job_are_those_that_another_plotter_draws(is_absolute: bool) -> None:
    job = camm1.parse(vpype_job(30_000, is_absolute=is_absolute), camm1.HP_7475A)
    plain = b"".join(each.data for each in job if each.name not in {"DF", "PS", "SP"})
    expected = [((x0, y0), (x1, y1)) for x0, y0, x1, y1, is_down in segments(plain) if is_down]
    strokes = drawing_of(job.instructions).strokes
    assert [pair for stroke in strokes if stroke.is_cut for pair in pairwise(stroke.points)] == expected
    for before, after in pairwise(strokes):
        assert after.points[0] == before.points[-1]
