"""Settings as a file: what was written is read again, and what cannot be meant says where it stands."""

from __future__ import annotations

import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from compax_aio import Dialect, DriveSettings, InvalidCommandError, MessageForm
from compax_aio.compax.settings import AxisUnit
from compax_aio.compax.settings_file import read_settings, settings_text, write_settings


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "axis-x.toml"


OF_ALL_KINDS = DriveSettings(
    unit="mm",
    travel=(-10.0, 500.5),
    units={1: AxisUnit("mm"), 2: AxisUnit("inch", 3)},
    message_form=MessageForm.FINAL_ONLY,
    verify_messages=True,
    resync_attempts=5,
    reconnect=False,
    reconnect_attempts=7,
    dialect=Dialect(stop="HALT", real_zero="SETZERO"),
)

# Both ways ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("each", [DriveSettings(), OF_ALL_KINDS], ids=["the defaults", "something of every kind"])
def test_what_was_written_is_read_again(path: Path, each: DriveSettings) -> None:
    write_settings(path, each)
    assert read_settings(path) == each
    assert read_settings(str(path)) == each


seconds = st.floats(0, 1e9, exclude_min=True)
texts = st.text(st.characters(exclude_categories=["Cs"]))
words = st.text("ABCXYZ0123456789 +-=", min_size=1).map(str.strip).filter(lambda word: 0 < len(word) <= 12)
ends = st.floats(allow_nan=False, allow_infinity=False)
axis_units = st.builds(AxisUnit, texts, st.sampled_from([2, 3]))


@st.composite
def any_settings(draw: st.DrawFn) -> DriveSettings:
    values: dict[str, Any] = {each.name: draw(seconds) for each in fields(DriveSettings) if each.name.endswith("_s")}
    travel = sorted(draw(st.lists(ends, min_size=2, max_size=2, unique=True)))
    binary = draw(st.booleans())
    return DriveSettings(
        **values,
        resync_attempts=draw(st.integers(1, 10**6)),
        reconnect=draw(st.booleans()),
        reconnect_attempts=draw(st.none() | st.integers(1, 10**6)),
        unit=draw(texts),
        decimals=draw(st.sampled_from([2, 3])),
        units=draw(st.dictionaries(st.integers(-9, 99), axis_units, max_size=3)),
        travel=draw(st.sampled_from([None, (travel[0], travel[1])])),
        speed_limit_percent=draw(st.floats(0, 600, exclude_min=True)),
        message_form=draw(st.sampled_from(MessageForm)),
        verify_messages=draw(st.booleans()),
        message_when_prepared=draw(st.booleans()),
        binary_settings=binary,
        binary_motion=binary and draw(st.booleans()),
        dialect=Dialect(
            stop=draw(words),
            single_record=draw(st.none() | words.map("{} {{n}}".format)),
            record=draw(st.sampled_from(["N{n:03d}: {text}", "N{n} {text}"])),
        ),
    )


@given(each=any_settings())
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_all_settings_whatever_survive_their_file(path: Path, each: DriveSettings) -> None:
    write_settings(path, each)
    assert read_settings(path) == each


# Reading --------------------------------------------------------------------------------------------------------------


def test_what_a_file_does_not_say_has_its_default(path: Path) -> None:
    path.write_text('unit = "mm"\nanswer_timeout_s = 2\n[dialect]\nstop = "HALT"\n')
    assert read_settings(path) == DriveSettings(unit="mm", answer_timeout_s=2.0, dialect=Dialect(stop="HALT"))
    path.write_text("")
    assert read_settings(path) == DriveSettings()
    path.write_text('[units.1]\nname = "mm"\n')
    assert read_settings(path).units == {1: AxisUnit("mm", 2)}


@pytest.mark.parametrize(
    ("text", "says", "hint"),
    [
        ('unti = "mm"', "there is no setting 'unti'", "did you mean unit? there are answer_timeout_s, "),
        ("xyzzy = 1", "there is no setting 'xyzzy'", "there are answer_timeout_s, "),
        ('[dialect]\nstopp = "X"', "there is no setting 'dialect.stopp'", "did you mean stop? there are stop, "),
        ('[units.1]\nnam = "X"', "there is no setting 'units.1.nam'", "did you mean name? there are name, decimals"),
        ("[units.1]\ndecimals = 2", "units.1 says nothing of name", None),
        ('[units.mm]\nname = "mm"', "units.mm: 'mm' is no value of P90", None),
        ('[units.01]\nname = "mm"', "units.01: '01' is no value of P90", None),
        ('[units.-]\nname = "mm"', "units.-: '-' is no value of P90", None),
        ("units = 1", "units must be tables", None),
        ("units.1 = 1", "units.1 must be a table, not 1", None),
        ("dialect = 1", "dialect must be a table, not 1", None),
        ("unit = 1", "unit must be a text in quotes, not 1", None),
        ('decimals = "2"', "decimals must be a whole number, not '2'", None),
        ("decimals = 2.0", "decimals must be a whole number, not 2.0", None),
        ("resync_attempts = true", "resync_attempts must be a whole number, not True", None),
        ('answer_timeout_s = "1"', "answer_timeout_s must be a number, not '1'", None),
        ("answer_timeout_s = true", "answer_timeout_s must be a number, not True", None),
        ("answer_timeout_s = 1" + "0" * 400, "answer_timeout_s is too large a number", None),
        ("answer_timeout_s = nan", "answer_timeout_s must be a finite number of seconds", None),
        ("verify_messages = 1", "verify_messages must be true or false, not 1", None),
        ('message_form = "prompt"', "message_form must be one of UNKNOWN, PROMPT_FIRST, FINAL_ONLY, not 'pr", None),
        ("message_form = 1", "message_form must be one of", None),
        ("travel = 5", "travel must be two numbers as [-10, 500], not 5", None),
        ("travel = [1]", "travel must be two numbers", None),
        ("travel = [1, 2, 3]", "travel must be two numbers", None),
        ('travel = [1, "2"]', "travel must be a number, not '2'", None),
        ("travel = [2, 1]", "travel is a lowest and a highest position", None),
        ("decimals = 4", "decimals must be 2, or 3 for inches", None),
        ("binary_motion = true", "binary_motion needs binary_settings", None),
        ("[dialect]\nstop = 1", "dialect.stop must be a text in quotes", None),
        ('[dialect]\nstop = "PA1$"', "the word for stop cannot be", "places it may have: none"),
        ("unit = ", "is no TOML", None),
    ],
)
def test_a_file_that_cannot_be_meant_says_what_and_where(path: Path, text: str, says: str, hint: str | None) -> None:
    path.write_text(text)
    with pytest.raises(InvalidCommandError) as caught:
        read_settings(path)
    assert caught.value.what.startswith(str(path))
    assert says in caught.value.what
    assert (caught.value.hint or "").startswith(hint or "")


def test_a_file_that_is_not_there_is_an_error_of_the_system(path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_settings(path)


# Writing --------------------------------------------------------------------------------------------------------------


def test_a_file_names_every_setting_and_what_it_means() -> None:
    text = settings_text(OF_ALL_KINDS)
    content = tomllib.loads(text)
    assert set(content) == {each.name for each in fields(DriveSettings)}
    assert set(content["dialect"]) == {each.name for each in fields(Dialect)} - {"single_record"}
    assert "# single_record is not set" in text
    assert 'stop = "HALT"  # default: "STOP"' in text
    assert 'message_form = "FINAL_ONLY"  # default: "UNKNOWN"' in text
    assert 'quit = "QUIT"\n' in text
    assert "# acknowledges an error (placeholder, CAN-S p. 28)" in text
    assert "# travel is not set" in settings_text(DriveSettings())
    assert max(map(len, text.splitlines())) <= 120


def test_whole_numbers_are_numbers_too(path: Path) -> None:
    write_settings(path, DriveSettings(answer_timeout_s=2, travel=(0, 5)))
    assert read_settings(path) == DriveSettings(answer_timeout_s=2.0, travel=(0.0, 5.0))


def test_a_name_that_is_no_text_is_refused_and_leaves_the_old_file(path: Path) -> None:
    path.write_text("old")
    with pytest.raises(InvalidCommandError, match="no text"):
        write_settings(path, DriveSettings(unit="\ud800"))
    assert path.read_text() == "old"


def test_a_file_that_cannot_be_written_leaves_the_old_one(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path.write_text("old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_settings(path, DriveSettings())
    assert path.read_text() == "old"
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_file_that_was_read_and_written_does_not_change(path: Path) -> None:
    write_settings(path, OF_ALL_KINDS)
    first = path.read_text()
    write_settings(path, replace(read_settings(path)))
    assert path.read_text() == first
