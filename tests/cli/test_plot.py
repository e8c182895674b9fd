"""``compax plot``: records in, a picture out; what is not whole is told, what cannot be drawn is refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.fakes.commands import Commands

from compax_aio.simulator.compax import Knobs


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def run(compax: Commands, tmp_path: Path) -> Path:
    """A record of two axes."""
    for name in ("x", "y"):
        compax.drive(name, Knobs(homed=True))
    path = tmp_path / "run.csv"
    urls = ("x=sim://compax?name=x", "y=sim://compax?name=y")
    assert compax("record", *urls, "-o", str(path), "--seconds", "1", "--interval", "0.1").code == 0
    return path


def test_a_picture_has_the_name_of_the_record_if_no_other_is_given(compax: Commands, run: Path) -> None:
    outcome = compax("plot", str(run))
    assert outcome.code == 0
    picture = run.with_suffix(".png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert outcome.out == f"{picture}: x, y\n"
    assert outcome.err == ""


def test_axes_times_and_title_can_be_chosen(compax: Commands, run: Path, tmp_path: Path) -> None:
    picture = tmp_path / "a.svg"
    words = ("--axis", "y", "--from", "0.2", "--until", "0.8", "--title", "Acceptance $5")
    outcome = compax("plot", str(run), "-o", str(picture), *words)
    assert outcome.code == 0
    assert outcome.out == f"{picture}: y\n"
    drawn = picture.read_text()
    assert "Acceptance $5" in drawn
    assert ">y</text>" in drawn
    assert ">x</text>" not in drawn


def test_an_axis_before_the_file_is_the_axis_alone(compax: Commands, run: Path, tmp_path: Path) -> None:
    assert compax("plot", "--axis", "y", str(run), "-o", str(tmp_path / "a.png")).code == 0


def test_several_records_are_drawn_together(compax: Commands, run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_bytes(run.read_bytes())
    outcome = compax("plot", str(run), str(other), "-o", str(tmp_path / "a.svg"), "--overlay", "--json")
    assert outcome.code == 0
    assert [each["file"] for each in outcome.document["records"]] == [str(run), str(other)]
    assert "x (other)" in (tmp_path / "a.svg").read_text()


def test_a_record_that_was_cut_is_drawn_and_told(compax: Commands, run: Path) -> None:
    run.write_bytes(run.read_bytes()[:-10])
    outcome = compax("plot", str(run))
    assert outcome.code == 0
    assert f"{run} is not whole: it ends at" in outcome.err
    document = compax("plot", str(run), "--force", "--json").document
    assert "bytes make no whole line" in document["records"][0]["cut"]


def test_a_picture_that_is_there_is_kept_unless_force_is_said(compax: Commands, run: Path) -> None:
    assert compax("plot", str(run)).code == 0
    outcome = compax("plot", str(run))
    assert outcome.code == 2
    assert "is there already" in outcome.told
    assert compax("plot", str(run), "--force").code == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "no record was named"),
        (("nothing.csv",), "there is no file nothing.csv"),
        (("run.csv", "--axis", "q"), "the axis q is not in what was recorded; there are x, y"),
        (("run.csv", "-o", "a.bmp"), "ends in .png, .svg, .pdf"),
        (("run.csv", "--from", "3", "--until", "2"), "no time from 3 s until 2 s"),
        (("run.txt",), "ends in .csv or .parquet"),
        (("wrong.csv",), "line 1: a motion record begins with"),
    ],
)
def test_what_cannot_be_drawn_is_refused_and_nothing_is_written(
    compax: Commands, run: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], says: str
) -> None:
    monkeypatch.chdir(run.parent)
    Path("wrong.csv").write_text("a,b\n1,2\n")
    outcome = compax("plot", *words)
    assert outcome.code == 2
    assert says in outcome.told
    assert {path.suffix for path in Path().iterdir()} == {".csv"}


def test_without_its_library_it_says_what_to_install(
    compax: Commands, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "compax_aio.recording.plot", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    outcome = compax("plot", str(run))
    assert outcome.code == 2
    assert "plots need matplotlib, which is not installed; pip install 'compax-aio[plot]'" in outcome.told
