"""`compax camm1 check` and `preview` look at jobs without a machine, and say what is wrong by line and column."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import pytest

from compax_aio import InvalidCommandError, camm1
from compax_aio.cli import app
from compax_aio.cli.cutting import jobs
from compax_aio.cli.cutting.outline import written_time
from compax_aio.cli.cutting.tuning import tuned

SOUND = "IN;PA;VS10;\nPU400,400;PD800,400,800,800,400,800,400,400;\nPU0,0;\n"
UNSOUND = "IN;\nQQ5;\nPD-40,0;\n"

Compax = Callable[..., tuple[int, str]]


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sound.plt").write_text(SOUND)
    Path("unsound.plt").write_text(UNSOUND)


@pytest.fixture
def compax(capsys: pytest.CaptureFixture[str]) -> Compax:
    """Carry out a command; gives its exit code, and all that it says."""

    def carry_out(*words: str) -> tuple[int, str]:
        code = app.run(["camm1", *words])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return carry_out


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Let a command find something on its standard input."""
    files: list[IO[str]] = []

    def give(data: bytes) -> None:
        read_end, write_end = os.pipe()
        os.write(write_end, data)
        os.close(write_end)
        files.append(os.fdopen(read_end))
        monkeypatch.setattr(sys, "stdin", files[-1])

    yield give
    for file in files:
        file.close()


# Checked ------------------------------------------------------------------------------------------------------------


def test_a_sound_job_is_told_as_such(compax: Compax) -> None:
    assert compax("check", "sound.plt") == (0, "sound.plt: nothing is wrong, for PNC-1610")


def test_what_is_wrong_is_told_by_line_and_column_and_the_exit_code(compax: Compax) -> None:
    code, text = compax("check", "unsound.plt", "--profile", "pnc900")
    assert code == 1
    assert "unsound.plt:2:1: error: 'QQ5;' is no instruction; take it out" in text
    assert "unsound.plt:3:1: warning: PD cuts to x = -1.0 mm" in text
    assert text.endswith("1 error, 2 warnings, for PNC-900")


def test_warnings_alone_are_no_failure(compax: Compax) -> None:
    Path("left-down.plt").write_text("IN;PD40,40;")
    code, text = compax("check", "left-down.plt")
    assert code == 0
    assert "1 warning, for PNC-1610" in text


def test_the_sheet_is_what_a_job_is_checked_against(compax: Compax) -> None:
    assert compax("check", "sound.plt", "--sheet", "20.5x20.5")[0] == 0
    code, text = compax("check", "sound.plt", "--sheet", "15x100")
    assert code == 1
    assert "x = 20.0 mm, outside of the sheet" in text


def test_programs_read_problems(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["camm1", "check", "unsound.plt", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["profile"] == "PNC-1610"
    first = document["problems"][0]
    assert (first["line"], first["column"], first["offset"], first["severity"]) == (2, 1, 4, "error")


def test_a_job_comes_from_the_standard_input_as_well(compax: Compax, given: Callable[[bytes], None]) -> None:
    given(SOUND.encode())
    assert compax("check", "-") == (0, "standard input: nothing is wrong, for PNC-1610")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["check", "nothing.plt"], "nothing.plt cannot be read: No such file"),
        (["check", "."], "cannot be read: Is a directory"),
        (["check", "sound.plt", "--profile", "x"], "no profile 'x'; there are PNC-1610"),
        (["check", "sound.plt", "--sheet", "20"], "no size of a sheet"),
        (["check", "sound.plt", "--sheet", "0x20"], "two sides above 0 mm"),
        (["preview", "sound.plt", "-o", "x.bmp"], "ends in .svg, .png, not as x.bmp"),
        (["preview", "sound.plt", "-o", "none/x.svg"], "there is no folder none"),
        (["preview", "-"], "say -o PICTURE.svg"),
        (["preview", "nothing.plt"], "nothing.plt cannot be read"),
    ],
)
def test_what_cannot_be_meant_is_refused(compax: Compax, words: list[str], says: str) -> None:
    code, text = compax(*words)
    assert code == 2
    assert says in text


def test_a_job_larger_than_any_is_refused(compax: Compax, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "_MOST_BYTES", 100)
    Path("large.plt").write_text("PU;" * 40)
    code, text = compax("check", "large.plt")
    assert code == 2
    assert "large.plt is larger than any job: more than 100 bytes" in text


def test_a_file_that_can_be_no_job_is_named(compax: Compax) -> None:
    Path("no.plt").write_bytes(b"LB" + b"x" * (1 << 21))
    code, text = compax("check", "no.plt")
    assert code == 2
    assert "no.plt: line 1, column 1: an instruction of more than" in text


# Drawn --------------------------------------------------------------------------------------------------------------


def test_a_preview_takes_the_name_of_the_job_and_says_what_will_be_cut(compax: Compax) -> None:
    code, text = compax("preview", "sound.plt")
    assert code == 0
    assert Path("sound.svg").read_text().count("<path") > 0
    assert "1 cut of 40.0 mm in all, travel 28.3 mm (64 bytes, 6 instructions)" in text
    assert "10.00 by 10.00 mm, from (10.00, 10.00) to (20.00, 20.00) mm" in text
    assert "at least 0.4 s, at 10 cm/s and without acceleration; its bytes take 0.1 s on the line" in text


def test_a_picture_that_is_there_is_replaced_only_if_that_is_said(compax: Compax) -> None:
    Path("sound.svg").write_text("mine")
    assert compax("preview", "sound.plt")[0] == 2
    assert Path("sound.svg").read_text() == "mine"
    assert compax("preview", "sound.plt", "--force")[0] == 0
    assert Path("sound.svg").read_text() != "mine"


def test_problems_and_the_sheet_are_in_the_picture(compax: Compax) -> None:
    code, text = compax("preview", "unsound.plt", "-o", "out.svg", "--sheet", "100x50", "--title", "A <sign>")
    assert code == 0
    assert "3 problems, which `compax camm1 check` tells" in text
    picture = Path("out.svg").read_text()
    for each in ("A &lt;sign&gt;", "the sheet", "2:1: 'QQ5;' is no instruction"):
        assert each in picture


def test_a_png_is_drawn(compax: Compax) -> None:
    assert compax("preview", "sound.plt", "-o", "sound.png")[0] == 0
    assert Path("sound.png").read_bytes().startswith(b"\x89PNG")


def test_programs_read_what_will_be_cut(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["camm1", "preview", "sound.plt", "--json"]) == 0
    outline = json.loads(capsys.readouterr().out)["outline"]
    assert outline["bounds_mm"] == [10, 10, 20, 20]
    assert outline["cutting_at_least_s"] == pytest.approx(0.4)
    assert outline["sending_at_least_s"] == pytest.approx(640 / 9600)


def test_what_nobody_can_know_is_not_estimated(compax: Compax) -> None:
    Path("no-speed.plt").write_text("PU0,0;PD400,0;PU;")
    assert "how long it takes is not known, for it sets no speed" in compax("preview", "no-speed.plt")[1]
    Path("nothing.plt").write_text("IN;PU400,0;")
    assert "nothing.plt: nothing is cut (11 bytes, 2 instructions)" in compax("preview", "nothing.plt")[1]
    Path("slow.plt").write_text("".join(f"VS{speed};PD{speed * 4000},0;" for speed in (1, 2, 3, 4, 5)) + "PU;")
    assert "at least 22.8 s; its bytes take" in compax("preview", "slow.plt")[1]


@pytest.mark.parametrize(
    ("time_s", "written"),
    [(0.04, "0.0 s"), (59.94, "59.9 s"), (61, "1 min 1 s"), (3600, "1 h 0 min"), (9000, "2 h 30 min")],
)
def test_times_are_written_as_people_do(time_s: float, written: str) -> None:
    assert written_time(time_s) == written


# Speed and force ----------------------------------------------------------------------------------------------------


def tuning(job: str, profile: camm1.Profile = camm1.GS_24, **settings: Any) -> bytes:
    return tuned(camm1.parse(job, profile), camm1.JobSettings(**settings), profile).data


def test_a_speed_stands_in_place_of_those_of_the_job() -> None:
    assert tuning("VS3;IN;VS10;PD1,1;DF;PD2,2;VS;", speed_cm_s=5) == b"VS5;IN;VS5;PD1,1;DF;VS5;PD2,2;"


def test_a_force_stands_in_place_of_those_of_the_job() -> None:
    assert tuning("IN;!FS30;VS10;PD1,1;", force_gf=80) == b"!FS80;IN;!FS80;VS10;PD1,1;"


def test_without_any_the_job_is_as_it_was() -> None:
    job = camm1.parse("IN;VS10;PD1,1;", camm1.GS_24)
    assert tuned(job, camm1.JobSettings(), camm1.GS_24) is job


def test_what_the_machine_cannot_be_told_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="from 1 to 50, not 80"):
        tuning("IN;", speed_cm_s=80)
    with pytest.raises(InvalidCommandError, match="not known to have an instruction for the force"):
        tuning("IN;", camm1.PNC_900, force_gf=80)
