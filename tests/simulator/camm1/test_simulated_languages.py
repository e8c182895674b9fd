"""Both cutting languages: what is cut, what is answered in turn, and what is wrong with a job."""

from __future__ import annotations

from math import hypot
from typing import Any

import pytest
from tests.simulator.camm1.host import Host

from compax_aio.simulator.camm1 import LogKind, Mark, Vector
from compax_aio.simulator.camm1.cuttings import Cuttings, Vectors


def _made(job: str, **knobs: Any) -> list[tuple[int, int, bool]]:
    host = Host(time_factor=0, **knobs)
    host.send(job.encode("latin-1"))
    host.until_idle()
    assert host.cutter.data_error == 0, host.texts(LogKind.DATA_ERROR)
    return [(each.x1, each.y1, each.is_down) for each in host.cutter.cuttings.vectors]


def _marks(job: str, **knobs: Any) -> list[tuple[str, str]]:
    host = Host(time_factor=0, **knobs)
    host.send(job.encode("latin-1"))
    host.until_idle()
    return [(each.name, each.text) for each in host.cutter.cuttings.marks]


# Lines


@pytest.mark.parametrize(
    "job",
    [
        "IN;PA;PU10,20;PD30,40,50,60;PU;",
        "IN;PU10,20;PD;PA30,40,50,60;PU;",
        "IN;PU10 20;PD30.0,+40 50,60;PU;",
        "IN;PR;PU10,20;PD20,20,20,20;PU;",
        "in;pu10,20;pd30,40,50,60;pu;",
        "INPU10,20PD30,40,50,60PU;",
        "IN;\r\nPU10,20;\nPD30,40,\n50,60;\r\nPU;\r\n",
        "M10,20;D30,40,50,60;",
        "M10,20\rD30,40\r\nD50,60\n",
        "M10,20;I20,20,20,20;",
        "^PU10,20;^PD30,40,50,60;",
        "R10,20;D30,40D50,60;",
        "IP0,0,1000,2000;SC0,100,0,100;PU1,1;PD3,2,5,3;",
    ],
)
def test_one_line_in_many_words(job: str) -> None:
    assert _made(job) == [(10, 20, False), (30, 40, True), (50, 60, True)]


def test_a_vector_knows_its_tool_and_where_it_began() -> None:
    host = Host(time_factor=0)
    host.send(b"PU10,10;!ST1;PD20,10;!ST0;PD20,20;")
    host.until_idle()
    assert list(host.cutter.cuttings.vectors) == [
        Vector(0, 0, 10, 10, is_down=False),
        Vector(10, 10, 20, 10, is_down=True, tool=1),
        Vector(20, 10, 20, 20, is_down=True),
    ]
    assert host.cutter.cuttings.vectors[-1].y1 == 20
    assert len(host.cutter.cuttings.vectors[1:]) == 2


def test_home_is_the_origin() -> None:
    assert _made("M10,20;H;") == [(10, 20, False), (0, 0, False)]


@pytest.mark.parametrize("language", ["both", "mode1", "mode2"])
def test_one_language_may_be_the_only_one(language: str) -> None:
    host = Host(language=language, time_factor=0)
    host.send(b"D10,20;")
    host.until_idle()
    assert (host.cutter.data_error == 0) == (language != "mode2")
    host = Host(language=language, time_factor=0)
    host.send(b"PD10,20;\r")
    host.until_idle()
    assert bool(host.cutter.cuttings.cut) == (language != "mode1")
    host.send(b"^PD10,20;")
    host.until_idle()
    assert host.cutter.cuttings.cut


# Shapes


def _radii(job: str) -> set[int]:
    return {round(hypot(x - 1000, y - 1000)) for x, y, is_down in _made(job) if is_down}


def test_circles_and_arcs_are_chords() -> None:
    assert _radii("PU1000,1000;CI400;") == {400}
    assert len([each for each in _made("PU1000,1000;CI400;") if each[2]]) == 72
    assert len([each for each in _made("PU1000,1000;CI400,45;") if each[2]]) == 8
    assert _radii("PU1400,1000;PD;AA1000,1000,90;") == {400}
    assert _made("PU1400,1000;PD;AA1000,1000,90;")[-1] == (1000, 1400, True)
    assert _made("PU1400,1000;PD;AR-400,0,-90,10;")[-1] == (1000, 600, True)
    assert _radii("C1000,1000,400,0,90;") == {400}
    assert _made("A1000,1000;G400,90,180;")[-1] == (600, 1000, True)
    assert _made("M1400,1000;E400,0,90;")[-1] == (1000, 1400, True)
    assert _made("A1000,1000;K90,100,300;") == [(1000, 1100, False), (1000, 1300, True)]


def test_after_a_circle_the_tool_is_where_it_was() -> None:
    made = _made("PU1000,1000;CI400;")
    assert made[1] == (1400, 1000, False)
    assert made[-1] == (1000, 1000, False)


@pytest.mark.parametrize("job", ["PU10,20;EA30,50;", "PU10,20;ER20,30;", "M10,20;T0,20,30,1,0;"])
def test_a_rectangle_is_four_vectors(job: str) -> None:
    assert _made(job)[1:] == [(30, 20, True), (30, 50, True), (10, 50, True), (10, 20, True)]


def test_a_wedge_begins_and_ends_at_its_centre() -> None:
    made = _made("PU1000,1000;EW400,0,90,45;")
    assert [each[:2] for each in made[1:]] == [(1400, 1000), (1283, 1283), (1000, 1400), (1000, 1000)]


def test_axes_are_lines_and_marks() -> None:
    assert _made("M10,20;X1,10,3;X0,10,2;")[1:] == [(40, 20, True), (40, 40, True)]
    assert _marks("X1,10,3;N4;RA10,10;RR5,5;WG5,0,90;T1,5,5,1,0;UC1,2;XT;") == [
        ("X", "1,10,3"),
        ("N", "4"),
        ("RA", "10,10"),
        ("RR", "5,5"),
        ("WG", "5,0,90"),
        ("T", "1,5,5,1,0"),
        ("UC", "1,2"),
        ("XT", ""),
    ]


def test_nothing_is_cut_outside_the_window_and_the_sheet() -> None:
    assert _made("IW10,10,30,30;PU0,20;PD40,20;") == [
        (0, 20, False),
        (10, 20, False),
        (30, 20, True),
        (40, 20, False),
    ]
    assert _made("PU10,10;PD-10,10,-20,20;PD0,30,10,30;IW;")[1:] == [
        (0, 10, True),
        (-10, 10, False),
        (-20, 20, False),
        (0, 30, False),
        (10, 30, True),
    ]
    assert _made("PD100,0;", area_x=50, area_y=50) == [(50, 0, True), (100, 0, False)]
    assert _made("PU0,0;IW5,5,10,10;PD3,20;")[-1] == (3, 20, False)


# Text


def test_labels_are_marks_and_whatever_is_in_them_is_no_instruction() -> None:
    job = "PU10,10;LBPD1,1;\x1a!\x03DT#;LBa;b#IN;LBc\x03PD20,20;"
    assert [each for each in _marks(job) if each[0] == "LB"] == [("LB", "PD1,1;\x1a!"), ("LB", "a;b"), ("LB", "c")]
    assert _marks("DT$;DT;LBx\x03DT;LBy\x03;P text;;\rWDhello\x03", model="DXY-1300")[:3] == [
        ("LB", "x"),
        ("LB", "y"),
        ("P", " text;;"),
    ]


def test_the_tool_goes_on_by_the_length_of_a_text() -> None:
    width = 0.285 * 1.5 * 400
    assert _made("LBab\x03")[-1] == (round(2 * width), 0, False)
    assert _made("DI0,1;LBab\x03")[-1] == (0, round(2 * width), False)
    assert _made("SI1,1;LBa\x03DI;SI;")[-1] == (600, 0, False)
    assert _made("PU0,1000;CP;CP0,1;CP1,0;")[-1] == (round(width), 1000, False)


def test_packed_forms_are_one_instruction() -> None:
    host = Host(time_factor=0)
    host.send(b'PE<=aPD9,9bC;CO"PD1,1;";SMx;PU;')
    host.until_idle()
    assert host.texts(LogKind.INSTRUCTION) == ["PE<=aPD9,9bC", 'CO"PD1,1;"', "SMx", "PU"]
    assert host.cutter.cuttings.vectors.total == 0


# Settings


def test_settings_are_kept_in_their_place() -> None:
    host = Host(model="GS-24", time_factor=0)
    host.send(b"VS5;!FS80;PD10,10;!PG100;LT2;")
    host.until_idle()
    assert host.cutter.cuttings.marks == [
        Mark(0, "VS", "5", 0, 0),
        Mark(0, "!FS", "80", 0, 0),
        Mark(1, "!PG", "100", 10, 10),
        Mark(1, "LT", "2", 10, 10),
    ]
    assert (host.cutter.speed_cm_s, host.cutter.force) == (5, 80)
    host.send(b"VS;IN;")
    host.until_idle()
    assert (host.cutter.speed_cm_s, host.cutter.force) == (10, None)


def test_speed_and_overhead_are_what_a_vector_takes() -> None:
    host = Host(travel_cm_s=20, vector_time_s=0.5, instruction_time_s=0.0)
    host.send(b"VS5;PU4000,0;PD0,0;")
    host.wait(0.99)
    assert host.cutter.position()[2] is False
    host.wait(0.02)
    assert host.cutter.position()[2] is True
    assert not host.is_idle()
    host.wait(2.48)
    assert not host.is_idle()
    host.wait(0.02)
    assert host.is_idle()


def test_a_pen_is_put_back_with_the_carriage_up() -> None:
    assert _made("PD10,0;SP2;PA20,0;PD30,0;", model="HP 7475A") == [(10, 0, True), (20, 0, False), (30, 0, True)]


# Answers in turn


@pytest.mark.parametrize(
    ("job", "answer"),
    [
        ("OA;", "0,0,0"),
        ("PD10,20;OC;", "10,20,1"),
        ("IP0,0,1000,1000;SC0,10,0,10;PD5,2.5;OC;", "5.0000,2.5000,1"),
        ("OE;", "0"),
        ("OS;", "24"),
        ("OP;", "0,0,10000,10000"),
        ("IP1,2,3,4;OP;", "1,2,3,4"),
        ("IP5,6;OP;", "5,6,10005,10006"),
        ("IP1,2,3,4;IP;OP;", "0,0,10000,10000"),
        ("OW;", "0,0,11200,999920"),
        ("IW3,4,1,2;OW;", "1,2,3,4"),
        ("OH;", "0,0,11200,999920"),
        ("OF;", "40,40"),
        ("OI;", "900"),
        ("OO;", "0,0,0,0,1,0,0,0"),
    ],
)
def test_output_instructions(job: str, answer: str) -> None:
    host = Host(model="PNC-900", time_factor=0, area_x=11200, area_y=999920)
    assert host.send(job.encode(), 1.0) == f"{answer}\r".encode()


def test_an_hp_has_other_options() -> None:
    assert Host(model="HP 7475A").send(b"OO;", 1.0) == b"0,1,0,0,1,0,0,0\r"
    assert Host(model="PNC-1200").send(b"OI;", 1.0) == b"1200\r"
    assert Host(answer_oi="X").send(b"OI;", 1.0) == b"X\r"


def test_the_status_byte_tells_and_forgets() -> None:
    host = Host(time_factor=0)
    assert host.send(b"IP0,0,1,1;PD;ZZ;OS;") == b"59\r"
    assert host.send(b"OS;") == b"51\r"
    assert host.send(b"OP;OE;PU;OS;") == b"0,0,1,1\r1\r16\r"


def test_the_last_answer_comes_while_the_vector_is_made_or_after_it() -> None:
    host = Host(vector_time_s=0.0)
    first = host.send(b"PD4000,0;OA;", 0.5)
    assert first.endswith(b",0,1\r")
    assert int(first.split(b",")[0]) < 100
    after = Host(o_answers="motion")
    after.send(b"PD4000,0;OA;")
    assert after.wait(0.5) == b""
    assert after.wait(1.0) == b"4000,0,1\r"


def test_an_answer_in_turn_and_one_at_once_do_not_go_together() -> None:
    host = Host(time_factor=0)
    host.control("M100:")
    host.control("B")
    host.send(b"OA;", 1.0)
    assert host.ask("E", 1.0) == 10


# Errors of the language


@pytest.mark.parametrize(
    ("job", "error"),
    [
        ("ZZ;", 1),
        ("PE1;", 1),
        ("SP1;", 1),
        ("FS1;", 1),
        ("10,10;", 1),
        ("\x80;", 1),
        ("PD1:2;", 1),
        ("!XX;", 1),
        ("PD1;", 2),
        ("PD1,2,3;", 2),
        ("CI;", 2),
        ("IP1;", 2),
        ("PD99999999,0;", 3),
        ("CI99999999;", 3),
        ("VS99;", 3),
        ("SC1,1,0,1;", 3),
        ("!ST64;", 3),
        ("CS99;", 5),
        ("PR;PD60000000,0,60000000,0;", 6),
    ],
)
def test_what_is_wrong_with_a_job_is_told(job: str, error: int) -> None:
    host = Host(model="PNC-1610", time_factor=0)
    host.send(job.encode("latin-1") + b" ;PU;")
    host.until_idle()
    assert host.cutter.data_error == error
    assert host.is_blinking()
    assert host.send(b"OE;OE;", 1.0) == f"{error}\r0\r".encode()
    assert host.texts(LogKind.DATA_ERROR)[0].startswith(f"{error} ")


def test_whole_pairs_are_cut_before_the_error() -> None:
    host = Host(time_factor=0)
    assert [(each.x1, each.y1) for each in host.cut(b"PD1,2,3;")] == [(1, 2)]


@pytest.mark.parametrize(("knobs", "cuts"), [({}, 1), ({"on_data_error": "stop"}, 0), ({"model": "PNC-900"}, 0)])
def test_after_an_error_it_goes_on_or_stands_until_power_on(knobs: dict[str, Any], cuts: int) -> None:
    host = Host(time_factor=0, **knobs)
    host.send(b"ZZ;PD10,10;", 1.0)
    assert len(host.cutter.cuttings.cut) == cuts
    assert host.is_blinking()
    host.cutter.power_cycle(host.now)
    assert not host.is_blinking()
    host.send(b"PD20,20;", 1.0)
    assert len(host.cutter.cuttings.cut) == cuts + 1


# What is kept


def test_what_is_kept_is_bounded() -> None:
    vectors = Vectors(most=10)
    for n in range(1000):
        vectors.move(n, n, 1)
    assert 10 <= len(vectors) <= 15
    assert vectors.total == 1000
    assert vectors[-1] == Vector(998, 998, 999, 999, is_down=True)
    cuttings = Cuttings()
    for n in range(60_000):
        cuttings.mark("VS", str(n), 0, 0)
    assert len(cuttings.marks) <= 50_000
    assert cuttings.marks[-1].text == "59999"
