"""Every figure can be measured, with the least effort, and is what the table and the JSON need; no time is judged."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.__main__ import FIGURES, main, measure
from benchmarks.measuring import LEAST, Effort, Figure, Machine, Noise, Row
from benchmarks.measuring.reporting import as_json, as_table


@pytest.fixture(autouse=True)
def logging_as_before() -> Iterator[None]:
    yield
    logging.disable(logging.NOTSET)


@pytest.fixture
def effort() -> Effort:
    return replace(LEAST, noise=Noise())


@pytest.mark.real_time
@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_measured_with_the_least_effort(name: str, effort: Effort) -> None:
    measured = measure([name], effort, lambda _: None)
    figures = measured[name]
    assert figures
    assert len({figure.name for figure in figures}) == len(figures)
    for figure in figures:
        _check_whole(figure)
    table = as_table(figures, Machine.here(), effort)
    assert all(figure.name in table for figure in figures)
    assert json.loads(as_json(measured, Machine.here(), effort))["figures"][name][0]["name"] == figures[0].name


def _check_whole(figure: Figure) -> None:
    assert not any(note.startswith("failed") for note in figure.notes), figure
    if figure.value is None:
        assert figure.notes, f"{figure.name} does not say why it was not measured"
    else:
        assert math.isfinite(figure.value)
        assert figure.target is None or figure.is_reached is not None
    for row in figure.rows:
        assert row.name
        assert row.unit
        assert row.note if row.value is None else math.isfinite(row.value)
        assert row.ratio is None or figure.ratio_of, f"{figure.name} does not say what {row.name} is compared with"


def _fake(monkeypatch: pytest.MonkeyPatch, **modules: object) -> None:
    monkeypatch.setattr("benchmarks.__main__.import_module", lambda name: modules[name.rpartition(".")[2]])


def _found(_: Effort) -> Sequence[Figure]:
    return [Figure(name="length of a second", value=1.0, unit="s", rows=[Row(name="of another", value=1.1, unit="s")])]


def _interrupted(_: Effort) -> Sequence[Figure]:
    raise KeyboardInterrupt


def _broken(_: Effort) -> Sequence[Figure]:
    raise OSError("no far end")


def test_one_command_prints_a_table_and_writes_the_same_as_json(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _fake(monkeypatch, peers=SimpleNamespace(measure=_found))
    file = tmp_path / "figures.json"
    assert main(["--least", "--only", "peers", "--json", str(file)]) == 0
    printed = capsys.readouterr()
    assert "length of a second" in printed.out
    assert "of another" in printed.out
    assert "[1/1] peers" in printed.err
    written = json.loads(file.read_text())
    assert written["figures"]["peers"][0]["rows"][0]["value"] == 1.1
    assert written["effort"]["name"] == "least"
    assert written["machine"]["python"] in printed.out


def test_ctrl_c_leaves_off_and_keeps_what_was_measured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _fake(monkeypatch, peers=SimpleNamespace(measure=_found), counts=SimpleNamespace(measure=_interrupted))
    file = tmp_path / "figures.json"
    assert main(["--only", "peers", "counts", "latency", "--json", str(file)]) == 130
    printed = capsys.readouterr()
    assert "length of a second" in printed.out
    assert "left off in counts" in printed.err
    assert list(json.loads(file.read_text())["figures"]) == ["peers"]


def test_a_figure_that_fails_says_why_and_the_others_are_measured(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _fake(monkeypatch, counts=SimpleNamespace(measure=_broken), peers=SimpleNamespace(measure=_found))
    assert main(["--only", "counts", "peers"]) == 1
    printed = capsys.readouterr()
    assert "counts: failed: OSError: no far end" in printed.out
    assert "length of a second" in printed.out
    assert "Traceback" in printed.err


def test_a_file_that_cannot_be_written_is_refused_before_anything_is_measured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _fake(monkeypatch)
    with pytest.raises(SystemExit) as ended:
        main(["--json", str(tmp_path / "nowhere" / "figures.json")])
    assert ended.value.code == 2
    assert "there is no folder for" in capsys.readouterr().err


def test_the_help_names_every_figure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    printed = capsys.readouterr().out
    assert all(name in printed for name in FIGURES)
