"""Pictures of jobs are whole documents that show cuts, travel, sheet, sizes and problems, however large the job is."""

from __future__ import annotations

import re
import struct
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio import InvalidCommandError, camm1
from compax_aio.camm1.previewing.drawing import Bounds
from compax_aio.camm1.previewing.layout import Flaw, scene_of
from compax_aio.camm1.previewing.png import png_of
from compax_aio.camm1.previewing.scene import Mark, Scene, Ways, Words
from compax_aio.camm1.previewing.svg import svg_of
from compax_aio.camm1.previewing.tool_path import drawing_of

SVG = "{http://www.w3.org/2000/svg}"
SQUARE = "IN;PU400,400;PD800,400,800,800,400,800,400,400;PU0,0;"


def page(
    job: str,
    *,
    sheet: Bounds | None = None,
    flaws: Sequence[Flaw] = (),
    title: str = "a job",
    subtitles: Sequence[str] = (),
) -> Scene:
    drawing = drawing_of(camm1.parse(job, camm1.DXY_1300).instructions)
    return scene_of(drawing, mm_per_step=0.025, title=title, subtitles=subtitles, sheet=sheet, flaws=flaws)


def words_of(scene: Scene) -> list[str]:
    return [shape.text for shape in scene.shapes if isinstance(shape, Words)]


def ways_of(scene: Scene, about: str) -> list[Ways]:
    return [shape for shape in scene.shapes if isinstance(shape, Ways) and shape.about.startswith(about)]


def document(scene: Scene) -> ET.Element:
    return ET.fromstring(svg_of(scene))


# The page -----------------------------------------------------------------------------------------------------------


def test_a_millimetre_of_the_sheet_is_one_of_the_picture() -> None:
    root = document(page(SQUARE))
    assert root.attrib["viewBox"].split()[2:] == [root.attrib["width"][:-2], root.attrib["height"][:-2]]
    assert root.attrib["width"].endswith("mm")
    group = next(each for each in root.iter(f"{SVG}g"))
    assert "scale(0.025 -0.025)" in group.attrib["transform"]


def test_the_dimensions_are_those_of_what_is_cut() -> None:
    assert {"10.00 mm"} <= set(words_of(page(SQUARE)))
    assert {"30.00 mm", "0.00 mm"} <= set(words_of(page("PU400,400;PD1600,400;PU;")))
    assert not [each for each in words_of(page("PU400,400;")) if each.endswith("mm")]


def test_what_is_cut_lies_on_the_page_whatever_its_size_and_place() -> None:
    for job in (SQUARE, "PU-9000,-9000;PD-8000,-9000;PU;", "PD1,0;PU;", "PU0,0;PD900000,11200;PU;", "IN;"):
        scene = page(job)
        for ways in ways_of(scene, ""):
            for path in ways.paths:
                for x, y in map(scene.on_page, path):
                    assert 0 <= x <= scene.width_mm
                    assert 0 <= y <= scene.height_mm


def test_travel_is_dashed_and_cuts_are_solid() -> None:
    scene = page(SQUARE)
    (travel,) = ways_of(scene, "travel")
    assert travel.dashes_mm
    assert travel.paths == [[(0, 0), (400, 400)], [(400, 400), (0, 0)]]
    assert all(not cut.dashes_mm for cut in ways_of(scene, "cut"))


def test_much_travel_is_faint_so_that_cuts_are_seen() -> None:
    much = "".join(f"PU{x},0;PD{x},100;" for x in range(0, 9000, 10))
    (travel,) = ways_of(page(much), "travel")
    assert not travel.dashes_mm


def test_colours_tell_what_is_cut_first() -> None:
    first, second = ways_of(page("PU0,0;PD1000,0;PU;PU0,500;PD1000,500;PU;"), "cut")
    assert first.paths == [[(0, 0), (1000, 0)]]
    assert second.paths == [[(0, 500), (1000, 500)]]
    assert _brightness(first.colour) < _brightness(second.colour)


def _brightness(colour: str) -> int:
    return sum(bytes.fromhex(colour[1:]))


def test_a_long_cut_has_all_colours_in_their_order() -> None:
    cuts = ways_of(page("PD" + ",".join(f"{x},0" for x in range(10, 1010, 10)) + ";PU;"), "cut")
    assert [round(path[0][0]) for each in cuts for path in each.paths] == list(range(0, 1000, 100))


def test_few_cuts_are_numbered_and_many_are_not() -> None:
    few = "".join(f"PU{x},0;PD{x},100;" for x in range(0, 5000, 500))
    assert {"1", "2", "10"} <= set(words_of(page(few)))
    many = "".join(f"PU{x},0;PD{x},100;" for x in range(0, 50_000, 500))
    assert "1" not in words_of(page(many))


def test_numbers_that_would_hide_each_other_are_left_out() -> None:
    close = "".join(f"PU{x},0;PD{x},100;" for x in range(10))
    assert [each for each in words_of(page(close)) if each.isdigit()] == ["1"]


def test_the_legend_names_what_is_there_and_nothing_else() -> None:
    assert "sheet" not in words_of(page(SQUARE))
    assert "label or filled area" not in words_of(page(SQUARE))
    assert "travel, tool up" not in words_of(page("PD100,0;"))
    full = words_of(
        page("IW0,0,50,50;LBx\x03PD9,9;PU;", sheet=Bounds(0, 0, 4000, 4000), flaws=[Flaw("what", 0, "1:1")])
    )
    assert {"cut, from first to last", "begin", "end", "sheet", "label or filled area", "window", "problem"} <= set(
        full
    )


def test_what_is_not_drawn_as_it_will_be_cut_is_told() -> None:
    assert any(each.startswith("line 1: ticks are not drawn") for each in words_of(page("XT;")))
    told = words_of(page(";".join(f"{a}{b}" for a in "JKWYZ" for b in "QXZ") + ";"))
    assert any("more of this kind" in each for each in told)


def test_problems_are_marked_where_they_are_and_told() -> None:
    scene = page(SQUARE, flaws=[Flaw("XX is nothing", 5, "1:6"), Flaw("it stays down", 5, "1:6", is_error=False)])
    crosses = [shape for shape in scene.shapes if isinstance(shape, Mark) and shape.about]
    at = scene.on_page((400, 400))
    assert [each.at_mm for each in crosses if each.kind == "cross"] == [at, at]
    assert {"1:6: XX is nothing", "1:6: it stays down"} <= set(words_of(scene))


def test_of_very_many_problems_the_first_are_told() -> None:
    flaws = [Flaw(f"problem {number}", 5, "1:6") for number in range(50)]
    assert "and 38 more" in words_of(page(SQUARE, flaws=flaws))


def test_long_titles_are_broken_into_lines() -> None:
    scene = page(SQUARE, title="a title " * 40, subtitles=["what there is to say " * 30])
    assert max(map(len, words_of(scene))) < 130


# SVG ----------------------------------------------------------------------------------------------------------------


def test_text_that_means_something_in_xml_is_text() -> None:
    root = document(page("LB<b>&\"'\x07\x03", title="<job> & more"))
    assert root.findtext(f"{SVG}title") == "<job> & more"
    texts = [each.text for each in root.iter(f"{SVG}text")]
    assert "<b>&\"'\N{REPLACEMENT CHARACTER}" in texts


@given(st.text(st.characters(codec="latin-1"), max_size=200))
def test_whatever_is_in_a_job_the_document_is_valid(job: str) -> None:
    document(page(job, title=job or "nothing"))


@given(
    st.lists(
        st.lists(st.tuples(st.integers(-3000, 3000), st.integers(-3000, 3000)), min_size=2, max_size=6), max_size=4
    )
)
def test_paths_lead_where_the_ways_lead(ways: list[list[tuple[int, int]]]) -> None:
    scene = Scene(10, 10, (0, 0), 0.025, "ways", [Ways(ways, "#000000", 0.1)])
    told = "".join(each.attrib["d"] for each in document(scene).iter(f"{SVG}path"))
    assert [_walk(each) for each in told.split("M")[1:]] == [_without_standing(each) for each in ways]


def _walk(path: str) -> list[tuple[int, int]]:
    begin, _, steps = path.partition("l")
    x, y = map(int, begin.split())
    points, numbers = [(x, y)], [int(each) for each in re.findall(r"-?\d+", steps)]
    for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
        x, y = x + dx, y + dy
        points.append((x, y))
    return points


def _without_standing(way: list[tuple[int, int]]) -> list[tuple[int, int]]:
    moving = [way[0], *(point for before, point in pairwise(way) if point != before)]
    return moving if len(moving) > 1 else [way[0], way[0]]


def test_a_hundred_thousand_vectors_are_few_paths_of_few_bytes() -> None:
    job = "".join(f"PU{x},0;PD" + ",".join(f"{x + y % 7},{y}" for y in range(1, 101)) + ";" for x in range(1000))
    text = svg_of(page(job))
    assert text.count("<path") < 100
    assert len(text) < len(job)


# PNG ----------------------------------------------------------------------------------------------------------------


def size_of(png: bytes) -> tuple[int, int]:
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", png[16:24])
    return width, height


def test_a_png_has_the_shape_of_the_page_and_is_not_empty() -> None:
    scene = page(SQUARE + "LBx\x03IW0,0,9,9;", sheet=Bounds(0, 0, 1000, 1000), flaws=[Flaw("what", 0, "1:1")])
    width, height = size_of(png_of(scene))
    assert width / height == pytest.approx(scene.width_mm / scene.height_mm, rel=0.01)
    assert len(png_of(scene)) > len(png_of(page("IN;")))


def test_a_png_of_the_longest_sheet_has_a_size_that_can_be_looked_at() -> None:
    assert max(size_of(png_of(page("PD999920,11200;PU;")))) <= 2400


def test_without_matplotlib_a_png_is_refused_and_an_svg_is_drawn(tmp_path: Path) -> None:
    script = f"""
import sys
sys.modules["matplotlib"] = None
from compax_aio import InvalidCommandError, camm1
job = camm1.parse({SQUARE!r}, camm1.DXY_1300)
camm1.preview(job, {str(tmp_path / "a.svg")!r})
try:
    camm1.preview(job, {str(tmp_path / "a.png")!r})
except InvalidCommandError as error:
    print(error)
"""
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert "a PNG needs matplotlib, which is not installed" in told
    assert "compax-aio[plot]" in told
    assert [each.name for each in tmp_path.iterdir()] == ["a.svg"]


# Files --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["job.svg", "JOB.SVG", "job.png"])
def test_a_picture_is_written_whole_in_the_form_that_its_name_says(tmp_path: Path, name: str) -> None:
    drawing = camm1.preview(camm1.parse(SQUARE, camm1.PNC_900), tmp_path / name, title="a square")
    assert drawing.cuts == 1
    begin = (tmp_path / name).read_bytes()[:5]
    assert begin == (b"<?xml" if name.lower().endswith("svg") else b"\x89PNG\r")
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_a_form_that_nobody_writes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidCommandError, match=r"ends in \.svg, \.png, not as job\.bmp"):
        camm1.preview(camm1.parse(SQUARE, camm1.PNC_900), tmp_path.joinpath("job.bmp").relative_to(tmp_path))


@pytest.mark.parametrize("name", ["job.svg", "job.png"])
def test_a_picture_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileNotFoundError):
        camm1.preview(camm1.parse(SQUARE, camm1.PNC_900), tmp_path / "nowhere" / name)
    (tmp_path / name).mkdir()
    with pytest.raises(IsADirectoryError):
        camm1.preview(camm1.parse(SQUARE, camm1.PNC_900), tmp_path / name)
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_problems_and_the_sheet_are_in_the_picture(tmp_path: Path) -> None:
    path, sheet = tmp_path / "job.svg", camm1.Sheet(15, 50)
    job = camm1.parse(SQUARE + "QQ5;", camm1.PNC_900)
    problems = camm1.check(job, camm1.PNC_900, sheet)
    camm1.preview(job, path, profile=camm1.PNC_900, sheet=sheet, problems=problems)
    root = ET.fromstring(path.read_text())
    texts = [each.text or "" for each in root.iter(f"{SVG}text")]
    assert any(each.endswith("'QQ5;' is no instruction") for each in texts)
    assert {"sheet", "problem"} <= set(texts)


def test_steps_are_those_of_the_machine(tmp_path: Path) -> None:
    path = tmp_path / "job.svg"
    camm1.preview(camm1.parse("PU0,0;PD1000,0;PU;", camm1.HP_7475A), path, profile=camm1.HP_7475A)
    assert "24.88 mm" in path.read_text()
