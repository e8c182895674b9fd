"""`compax haas check` and `diff`: files looked at without a machine, and told apart by what is in them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from compax_aio.cli import app

Compax = Callable[..., tuple[int, str]]

FILES = {
    "good.nc": "%\nO01234 (FACE)\nG0 X1.\nM30\n%\n",
    "small.nc": "%\nO01234\ng0 X1;\nM30\n%\n",
    "probe.nc": "%\nO09810\nM99\n%\n",
    "high.nc": "%\nN200000 G0 X1.\n%\n",
    "settings monday.txt": "%\nN0 V111\nN11 V5\nN12 V0\n%\n",
    "settings tuesday.txt": "%\nN0 V222\nN11 V6\nN12 V0\n%\n",
    "a.txt": "%\nN1 V5\n%\n",
    "b.txt": "%\nN1 V5\n%\n",
    "macros.txt": "%\nN100 V1.5\nN9999 V0\n%\n",
    "broken settings.txt": "%\nN11 X5\nN12 V0\nN13 V0\n%\n",
    "settings broken.txt": "%\nN11 X5\nN12 V0\nN13 V0\n%\n",
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text)


@pytest.fixture
def compax(capsys: pytest.CaptureFixture[str]) -> Compax:
    def carry_out(*words: str) -> tuple[int, str]:
        code = app.run(["haas", *words])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return carry_out


# Check --------------------------------------------------------------------------------------------------------------


def test_what_is_good_is_said_to_be(compax: Compax) -> None:
    assert compax("check", "good.nc") == (0, "good.nc: nothing is wrong, programs O01234")


def test_errors_are_told_by_line_and_column_with_the_alarm_they_would_raise(compax: Compax) -> None:
    code, text = compax("check", "small.nc", "good.nc")
    assert code == 1
    assert "small.nc:3:1: error: 'g' is a small letter outside of a comment; write capital letters" in text
    assert "(the control would raise alarm 407 (RS-232 INVALID CODE))" in text
    assert "small.nc:3:6: error: a semicolon" in text
    assert "small.nc: 2 errors, programs O01234 good.nc: nothing is wrong" in text


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("probe.nc",), 1),
        (("probe.nc", "--protected"), 0),
        (("small.nc", "--semicolons"), 1),
        (("high.nc",), 1),
        (("high.nc", "--dnc"), 1),
        (("good.nc", "--dnc"), 0),
        (("macros.txt",), 0),
        (("a.txt", "--kind", "macros"), 1),
        (("a.txt", "--kind", "macros", "--without-n9999"), 0),
        (("a.txt", "--kind", "offsets"), 0),
        (("a.txt", "--kind", "parameters"), 1),
    ],
)
def test_what_is_meant_is_no_error(compax: Compax, words: tuple[str, ...], code: int) -> None:
    assert compax("check", *words)[0] == code


def test_programs_read_problems(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["haas", "check", "small.nc", "--json"]) == 1
    (told,) = map(json.loads, capsys.readouterr().out.splitlines())
    assert (told["kind"], told["programs"]) == ("program", [1234])
    first, second = told["problems"]
    assert (first["line"], first["column"], first["severity"]) == (3, 1, "error")
    assert first["alarm"] == "alarm 407 (RS-232 INVALID CODE)"
    assert second["alarm"] is None


def test_a_kind_is_known_by_what_is_in_a_file_or_by_its_name(compax: Compax) -> None:
    assert "read as macros" in compax("check", "macros.txt")[1]
    assert "read as settings" in compax("check", "settings monday.txt")[1]
    code, text = compax("check", "settings broken.txt")
    assert code == 1
    assert "2:5: error: " in text
    assert "read as settings" in text
    code, text = compax("check", "a.txt")
    assert code == 2
    assert "parameters, settings and offsets look alike; say --kind settings" in text


@pytest.mark.parametrize(("name", "says"), [("nowhere", "No such file"), (".", "directory")])
def test_what_cannot_be_read_is_told(compax: Compax, name: str, says: str) -> None:
    code, text = compax("check", name)
    assert code == 2
    assert says in text
    assert compax("check")[0] == 2


def test_what_is_no_file_of_a_control_is_told(compax: Compax) -> None:
    Path("garbage").write_bytes(bytes(range(256)) * 4)
    code, text = compax("check", "garbage")
    assert code == 1
    assert "no program with a name" in text or "programs" in text
    Path("empty").write_bytes(b"")
    assert compax("check", "empty")[0] == 1


# Diff ---------------------------------------------------------------------------------------------------------------


def test_numbers_that_differ_are_told_with_their_names(compax: Compax) -> None:
    assert compax("diff", "settings monday.txt", "settings tuesday.txt") == (
        1,
        "N11 (BAUD RATE SELECT): 5 became 6 1 difference, read as settings",
    )


def test_what_does_not_differ_is_said_not_to(compax: Compax) -> None:
    assert compax("diff", "a.txt", "b.txt") == (0, "no difference, as numbered data")
    assert compax("diff", "good.nc", "good.nc") == (0, "no difference, as programs")


def test_one_that_is_known_says_what_the_other_is(compax: Compax) -> None:
    code, text = compax("diff", "a.txt", "settings monday.txt")
    assert code == 1
    assert "N11 (BAUD RATE SELECT): is new, 5" in text


def test_programs_are_compared_by_their_numbers(compax: Compax) -> None:
    Path("later.nc").write_text("%\nO01234 (FACE)\nG0 X2.\nM30\n%\n")
    code, text = compax("diff", "good.nc", "later.nc")
    assert code == 1
    assert "O01234, line 3: 'G0 X1.' became 'G0 X2.' (line 3)" in text


def test_programs_read_differences(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["haas", "diff", "settings monday.txt", "settings tuesday.txt", "--json"]) == 1
    (told,) = map(json.loads, capsys.readouterr().out.splitlines())
    (difference,) = told["differences"]
    assert (difference["number"], difference["how"], difference["before"], difference["after"]) == (
        11,
        "changed",
        "5",
        "6",
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("good.nc", "a.txt"), "program and numbered data cannot be compared"),
        (("macros.txt", "settings monday.txt"), "cannot be compared"),
        (("a.txt", "settings broken.txt"), "settings broken.txt: line 2"),
        (("a.txt", "nowhere"), "No such file"),
    ],
)
def test_what_cannot_be_compared_is_refused(compax: Compax, words: tuple[str, ...], says: str) -> None:
    code, text = compax("diff", *words)
    assert code == 2
    assert says in text
