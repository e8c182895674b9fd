"""The diagrams of the states show what is in the tables, all of it and nothing else, and nothing lies on anything."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from enum import Enum
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from compax_aio.camm1 import protocol_states as camm1
from compax_aio.compax import protocol_states as compax
from compax_aio.haas import protocol_states as haas
from compax_aio.smc import protocol_states as smc

EXTENSIONS = Path(__file__).parents[2] / "docs" / "_ext"
SVG = "{http://www.w3.org/2000/svg}"


pytest.importorskip("sphinx")

sys.path.insert(0, str(EXTENSIONS))
try:
    diagrams: Any = importlib.import_module("state_diagrams")
    drawing: Any = importlib.import_module("state_drawing")
    tables: Any = importlib.import_module("tables_of_states")
finally:
    sys.path.remove(str(EXTENSIONS))

LINES = {"COMPAX": compax, "SMC": smc, "CAMM1": camm1, "HAAS": haas}
EACH = pytest.mark.parametrize("diagram", [getattr(diagrams, name) for name in LINES], ids=list(LINES))


class Light(Enum):
    RED = "stop"
    GREEN = "go"
    BLUE = "wait"
    WHITE = "off"


@EACH
def test_the_arrows_stand_for_the_rows_of_the_table_and_for_nothing_else(diagram: Any) -> None:
    rows = [row for arrow in diagram.arrows() for row in arrow.pairs()]
    assert dict(rows) == dict(diagram.table)
    assert len(rows) == len(diagram.table), "a row is drawn twice"


@pytest.mark.parametrize(("name", "line"), LINES.items(), ids=list(LINES))
def test_the_tables_are_those_of_the_protocols(name: str, line: Any) -> None:
    diagram = getattr(diagrams, name)
    assert diagram.table is line.TRANSITIONS
    assert diagram.doubtful is line.DOUBTFUL
    assert set(diagram.places) == set(line.State)


@EACH
def test_every_arrow_is_drawn_or_noted(diagram: Any) -> None:
    drawn = drawing.drawing(diagram)
    kept = [arrow for arrow in diagram.arrows() if arrow.target is None]
    assert [arrow for arrow, _ in drawn.lines] + kept == [
        *(arrow for arrow in diagram.arrows() if arrow.target is not None),
        *kept,
    ]
    for arrow in kept:
        assert any(all(diagram.word(event) in note for event in arrow.events) for note in drawn.notes)


@EACH
def test_every_arrow_begins_and_ends_at_its_states_and_bears_its_events(diagram: Any) -> None:
    drawn = drawing.drawing(diagram)
    for arrow, line in drawn.lines:
        assert line.label.lines == tuple(map(diagram.word, arrow.events))
        assert touches(drawn.states[arrow.target], line.points[-1])
        begins = [drawn.states[next(iter(arrow.sources))]] if len(arrow.sources) == 1 else drawn.anywhere
        assert any(touches(box, line.points[0]) for box in begins)


@EACH
def test_nothing_lies_on_anything_else(diagram: Any) -> None:
    drawn = drawing.drawing(diagram)
    boxes = [*drawn.states.values(), *drawn.anywhere]
    labels = [line.label for _, line in drawn.lines]
    for one, other in combinations([*boxes, *labels], 2):
        assert not overlap(one, other), f"{one.lines} lies on {other.lines}"
    for arrow, line in drawn.lines:
        ends = [box for box in boxes if touches(box, line.points[0]) or touches(box, line.points[-1])]
        for begin, end in pairwise(line.points):
            for box in [*labels, *(each for each in boxes if each not in ends)]:
                assert not crosses(box, begin, end), f"the arrow of {arrow.events} runs through {box.lines}"


@EACH
def test_all_of_it_lies_within_the_picture(diagram: Any) -> None:
    drawn = drawing.drawing(diagram)
    width, height = diagram.size
    for box in [*drawn.states.values(), *drawn.anywhere, *(line.label for _, line in drawn.lines)]:
        assert box.size[0] / 2 <= box.middle[0] <= width - box.size[0] / 2, box.lines
        assert box.size[1] / 2 <= box.middle[1] <= height - box.size[1] / 2, box.lines


@EACH
def test_the_picture_is_svg_that_names_every_state_and_event(diagram: Any) -> None:
    root = ET.fromstring(drawing.svg(diagram, "here"))
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert {state.name for state in diagram.states} <= set(texts)
    words = {diagram.word(event) for _, event in diagram.table}
    assert all(any(word in (text or "") for text in texts) for word in words)
    dashed = [element for element in root.iter(f"{SVG}rect") if "doubtful" in element.attrib["class"].split()]
    assert len(dashed) == len(diagram.doubtful)
    described = root.find(f"{SVG}desc")
    assert described is not None
    assert all(state.name in (described.text or "") for state in diagram.states)


def test_the_directives_put_the_pictures_and_the_tables_into_a_page(tmp_path: Path) -> None:
    (tmp_path / "conf.py").write_text('extensions = ["myst_parser", "state_diagrams", "tables_of_states"]')
    directives = [*diagrams.DIAGRAMS, *tables.TABLES]
    (tmp_path / "index.md").write_text("\n".join(["# States\n", *(f"```{{{name}}}\n```\n" for name in directives)]))
    words = ["-q", "-W", "-b", "html", str(tmp_path), str(tmp_path / "out")]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *words],
        env={**os.environ, "PYTHONPATH": str(EXTENSIONS)},
        capture_output=True,
        check=False,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "out" / "index.html").read_text()
    for name in LINES:
        assert getattr(diagrams, name).title in page.replace("&#x27;", "'")
    assert page.count("<table") == len(tables.TABLES)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (tables.TABLES["table-of-smc-transitions"], smc),
        (tables.TABLES["table-of-camm1-transitions"], camm1),
        (tables.TABLES["table-of-haas-transitions"], haas),
    ],
    ids=["SMC", "CAMM1", "HAAS"],
)
def test_the_tables_of_what_leads_where_hold_all_of_it(make: Any, line: Any) -> None:
    _, rows = make()
    told = {
        (state, event): then.astext()
        for event, source, then in rows
        for state in (_any(source, line.State) if isinstance(source, str) else [source.astext()])
    }
    assert told == {(state.name, step.value): then.name for (state, step), then in line.TRANSITIONS.items()}


def test_the_table_of_what_leads_where_on_a_compax_line_holds_all_of_it() -> None:
    (_, *states), rows = tables.TABLES["table-of-transitions"]()
    told = {
        (state.astext(), event): then.astext()
        for event, *cells in rows
        for state, then in zip(states, cells, strict=True)
        if then
    }
    events = {
        (state.name, event.__name__.lstrip("_")): then.name for (state, event), then in compax.TRANSITIONS.items()
    }
    assert told == events


@pytest.mark.parametrize(("name", "line"), LINES.items(), ids=list(LINES))
def test_every_state_has_its_meaning(name: str, line: Any) -> None:
    infix = "" if name == "COMPAX" else f"{name.lower()}-"
    _, rows = tables.TABLES[f"table-of-{infix}states"]()
    assert [state.astext() for state, _ in rows] == [state.name for state in line.State]
    assert all(len(meaning) > 5 for _, meaning in rows)


def test_what_happens_nearly_everywhere_is_drawn_once() -> None:
    table: dict[tuple[Light, str], Light] = {
        **{(light, "power lost"): Light.WHITE for light in Light},
        **{(light, "noise"): light for light in Light if light is not Light.RED},
        (Light.RED, "noise"): Light.GREEN,
    }
    places = {light: (100.0 * number, 100.0 * number) for number, light in enumerate(Light)}
    diagram = drawing.Diagram(
        title="", table=table, doubtful=(), word=str, size=(1, 1), places=places, anywhere={Light.WHITE: (0.0, 300.0)}
    )
    assert sorted(len(arrow.sources) for arrow in diagram.arrows()) == [1, 1, 1, 1, 4]
    drawn = drawing.drawing(diagram)
    assert [box.lines for box in drawn.anywhere] == [("any state",)]


def _any(source: str, states: type[Enum]) -> list[str]:
    """Read "any" and "any but"."""
    assert source.startswith("any")
    others = source.removeprefix("any").removeprefix(" but ").split(", ")
    return [state.name for state in states if state.name not in others]


def touches(box: Any, point: tuple[float, float]) -> bool:
    apart = [abs(point[axis] - box.middle[axis]) - box.size[axis] / 2 for axis in (0, 1)]
    return bool(abs(max(apart)) <= 0.01)


def overlap(one: Any, other: Any) -> bool:
    return all(abs(one.middle[i] - other.middle[i]) < (one.size[i] + other.size[i]) / 2 for i in (0, 1))


def crosses(box: Any, begin: tuple[float, float], end: tuple[float, float]) -> bool:
    """Whether a straight line runs through a box, by what is left of it between the sides of the box."""
    low, high = 0.0, 1.0
    for axis in (0, 1):
        delta = end[axis] - begin[axis]
        sides = [box.middle[axis] + sign * box.size[axis] / 2 - begin[axis] for sign in (-1, 1)]
        if abs(delta) < 1e-9:
            if not sides[0] < 0 < sides[1]:
                return False
            continue
        first, last = sorted(side / delta for side in sides)
        low, high = max(low, first), min(high, last)
    return low < high
