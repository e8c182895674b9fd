"""Reading a trace: typed entries, strictly, but for lines that were cut; whatever stands in the file."""

from __future__ import annotations

import json
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.hostile.wicked import refusal
from tests.recording.traces import BEGUN, facts, record_move, write

from compax_aio.errors import InvalidCommandError
from compax_aio.link.contract import Lane
from compax_aio.link.taps import (
    Asked,
    Closed,
    Ended,
    Fact,
    LetGo,
    Lost,
    Noticed,
    Opened,
    Opening,
    Ready,
    Received,
    Refused,
    Resumed,
    Sent,
    Way,
)
from compax_aio.recording import conversations, read_trace
from compax_aio.recording.trace_entries import (
    LONGEST_LINE,
    Cut,
    LineMade,
    Missing,
    SessionBegun,
    SessionEnded,
    decoded,
    encoded,
)
from compax_aio.recording.trace_file import older_file

HEAD = '{"at":0.0,"what":"session","begun":"now","by":"me","format":"compax-aio trace","version":1}\n'

texts = st.text(max_size=10)
details = st.none() | st.dictionaries(texts, st.integers(0, 9) | texts | st.booleans() | st.lists(texts, max_size=2))
some_facts: st.SearchStrategy[Fact] = st.one_of(
    st.builds(Opening, texts),
    st.builds(Refused, texts),
    st.builds(Opened),
    st.builds(Ready, st.integers(1, 9)),
    st.builds(Sent, st.binary(max_size=20), st.none() | st.integers(1, 9), st.sampled_from(Way)),
    st.builds(Received, st.binary(max_size=20)),
    st.builds(LetGo),
    st.builds(Lost, st.none() | texts),
    st.builds(Closed),
    st.builds(Resumed),
    st.builds(Asked, st.integers(1, 9), texts, st.sampled_from(Lane), texts),
    st.builds(Ended, st.integers(1, 9), texts, st.none() | texts),
    st.builds(Noticed, texts, st.booleans(), details),
    st.builds(LineMade, texts, st.booleans(), details),
    st.builds(Missing, st.integers(1, 9)),
    st.builds(SessionEnded),
    st.builds(SessionBegun, texts, texts, st.integers(1, 9)),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "trace.jsonl"


# Entries --------------------------------------------------------------------------------------------------------------


@given(at=st.floats(0, 1e6), line=texts, fact=some_facts)
@settings(max_examples=300)
def test_every_fact_is_read_as_it_was_written(at: float, line: str, fact: Fact) -> None:
    (text,) = encoded(at, line, fact)
    entry = decoded(text)
    assert (entry.at, entry.line, entry.fact) == (round(at, 6), line, fact)
    assert text.isascii()
    assert text.isprintable()


def test_numbers_that_json_has_not_are_written_as_text() -> None:
    (text,) = encoded(0, "x", Noticed("Odd", details={"value": float("inf"), "more": [1, "x" * 30_000]}))
    fact = decoded(text).fact
    assert isinstance(fact, Noticed)
    assert fact.details is not None
    assert fact.details["value"] == "inf"
    assert len(fact.details["more"][1]) == 20_001


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("", "no JSON"),
        ("nonsense", "no JSON"),
        ("[" * 100_000, "no JSON"),
        ('"text"', "no JSON object"),
        ('{"at":0,"what":"dance"}', "nothing is called 'dance'"),
        ('{"at":0,"what":["sent"]}', "nothing is called"),
        ('{"what":"opened"}', "its time cannot be None"),
        ('{"at":true,"what":"opened"}', "its time cannot be True"),
        ('{"at":NaN,"what":"opened"}', "NaN is no number"),
        ('{"at":1e400,"what":"opened"}', "its time cannot be inf"),
        ('{"at":1' + "0" * 400 + ',"what":"opened"}', "its time cannot be"),
        ('{"at":0,"line":7,"what":"opened"}', "the name of a line"),
        ('{"at":0,"what":"opened","more":1}', "no place for 'more'"),
        ('{"at":0,"what":"sent"}', "nothing of data"),
        ('{"at":0,"what":"sent","data":"\\u20ac"}', "data must be bytes"),
        ('{"at":0,"what":"sent","data":"µ"}', "not ASCII"),
        ('{"at":0,"what":"sent","data":"S1","way":"fast"}', "way must be one of turn"),
        ('{"at":0,"what":"sent","data":"S1","number":1.5}', "number must be a whole number"),
        ('{"at":0,"what":"asked","number":1,"text":"S1","lane":"fast"}', "lane must be one of stop"),
        ('{"at":0,"what":"noticed","event":"x","ends_turn":1}', "ends_turn must be true or false"),
        ('{"at":0,"what":"line","about":[]}', "about must be an object"),
        ('{"at":0,"what":"session","format":"other"}', "of the format 'other'"),
        ('{"at":0,"what":"session","format":"compax-aio trace","version":2}', "of version 2"),
    ],
)  # fmt: skip
def test_what_is_no_entry_is_refused_and_says_why(path: Path, entry: str, why: str) -> None:
    with pytest.raises(InvalidCommandError, match=why):
        decoded(entry)
    path.write_text(f'{HEAD}{entry}\n{{"at":0,"what":"end"}}\n')
    with pytest.raises(InvalidCommandError, match=r"is no trace, or is damaged, in line 2: .*" + why):
        list(read_trace(path))


# Files ----------------------------------------------------------------------------------------------------------------


async def test_a_trace_that_is_cut_at_any_byte_is_read_up_to_there(path: Path, tmp_path: Path) -> None:
    await record_move(path)
    whole = path.read_bytes()  # noqa: ASYNC240
    entries = [entry.fact for entry in read_trace(path)]
    cut = tmp_path / "cut"
    for length in [*range(300), *range(300, len(whole), 311)]:
        cut.write_bytes(whole[:length])
        read = list(read_trace(cut))
        broken = [entry for entry in read if isinstance(entry.fact, Cut)]
        told = [entry.fact for entry in read if not isinstance(entry.fact, Cut)]
        assert told == entries[: len(told)], "what is whole is read as it was"
        assert len(told) >= whole[:length].count(b"\n")
        rest = whole[:length].rpartition(b"\n")[2]
        assert len(broken) == bool(rest and not whole[: length + 1].endswith(b"}\n"))
        assert not broken or broken[0].place == whole[:length].count(b"\n") + 1, "it is told where"


def test_a_line_that_was_cut_stands_before_the_next_session(path: Path) -> None:
    path.write_text(f'{HEAD}{{"at":0.5,"wh\n{HEAD.replace("now", "later")}{{"at":0.1,"what":"end"}}\n')
    assert [type(fact) for fact in facts(path)] == [SessionBegun, Cut, SessionBegun, SessionEnded]
    assert [entry.session for entry in read_trace(path)] == [1, 1, 2, 2]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"at":0,"what":"opened"}\n', "does not begin with a session"),
        (f'{HEAD}{{"at":0.5,"wh\n{{"at":0.1,"what":"end"}}\n', "in line 2"),
        (f"{HEAD}half\nhalf", "in line 2"),
        ("a,b,c\n", "in line 1"),
        ("x" * 1000, "in line 1"),
        (f"{HEAD}{'x' * (LONGEST_LINE + 1)}", "line 2 is longer than"),
    ],
)
def test_a_file_that_is_damaged_elsewhere_is_refused_with_its_line(path: Path, text: str, why: str) -> None:
    path.write_text(text)
    with pytest.raises(InvalidCommandError, match=why):
        list(read_trace(path))


def test_an_empty_file_has_no_entries(path: Path) -> None:
    path.touch()
    assert not list(read_trace(path))


def test_the_older_half_is_read_first_if_it_is_of_the_same_session(path: Path) -> None:
    older_file(path).write_text(f'{HEAD}{{"at":1,"line":"x","what":"line"}}\n{{"at":2,"line":"x","what":"opened"}}\n')
    part_2 = HEAD.replace('"by":"me"', '"by":"me","part":2')
    path.write_text(f'{part_2}{{"at":3,"line":"x","what":"lost"}}\n')
    assert [(entry.session, entry.is_older, entry.at) for entry in read_trace(path)] == [
        (1, True, 0), (1, True, 1), (1, True, 2), (1, False, 0), (1, False, 3),
    ]  # fmt: skip
    (told,) = conversations(path)
    assert [type(entry.fact) for entry in told.entries] == [LineMade, Opened, Lost]
    older_file(path).write_text(HEAD.replace("now", "before"))
    assert [entry.session for entry in read_trace(path)] == [1, 2, 2]
    older_file(path).unlink()
    assert [entry.session for entry in read_trace(path)] == [1, 1]


def test_an_older_half_of_nothing_that_goes_on_is_left_alone(path: Path) -> None:
    older_file(path).write_text("something else")
    path.write_text(HEAD)
    assert len(list(read_trace(path))) == 1


def test_conversations_are_parted_by_session_and_line(path: Path) -> None:
    write(
        path,
        [
            (0.0, "x", LineMade("compax", about={"settings": {}})),
            (0.0, "y", LineMade("smc")),
            (0.1, "x", Opened()),
            (0.2, "", Missing(3)),
            (0.3, "y", Opened()),
            (0.4, "z", Opened()),
            (0.5, "", SessionEnded()),
        ],
    )
    with path.open("a") as file:
        file.write(HEAD + '{"at":0,"line":"x","what":"line"}\n{"at":1')
    x, y, again = conversations(path)
    assert (x.line, x.session, x.made.device, x.is_ended, x.begun) == ("x", 1, "compax", True, BEGUN)
    assert x.about == {"settings": {}}
    assert [type(entry.fact) for entry in x.entries] == [LineMade, Opened, Missing]
    assert [type(entry.fact) for entry in y.entries] == [LineMade, Missing, Opened]
    assert (again.session, again.is_ended, again.about) == (2, False, {})
    assert isinstance(again.entries[-1].fact, Cut)


def test_a_large_trace_is_read_in_little_memory(path: Path) -> None:
    entry = '{"at":1.5,"line":"x","what":"received","data":"S001: 12.50\\r\\n>"}\n'
    path.write_text(HEAD + entry * 10_000)
    tracemalloc.start()
    try:
        assert sum(1 for _ in read_trace(path)) == 10_001
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1_000_000


BOMBS: dict[str, Callable[[], str]] = {
    "deep lists": lambda: HEAD + '{"at":0,"what":' + "[" * 200_000,
    "deep tables": lambda: HEAD + '{"at":' * 40_000,
    "many digits": lambda: HEAD + '{"at":' + "9" * 200_000 + "}",
    "one endless line": lambda: HEAD + "x" * 5_000_000,
    "many keys": lambda: (
        HEAD + "{" + ",".join(f'"k{n}":1' for n in range(18_000)) + ',"at":0,"what":"end"}\n' + HEAD * 2
    ),
    "line ends": lambda: HEAD + "\n" * 500_000,
    "zeros": lambda: "\0" * 1_000_000,
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_file_that_means_much_is_refused_or_read_in_little_time(path: Path, name: str) -> None:
    path.write_text(BOMBS[name]())
    begun_at = time.process_time()
    said = refusal(lambda: list(read_trace(path)))
    assert time.process_time() - begun_at < 5
    assert len(said or "") < 1500 + len(str(path))


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "nothing", "no name"])
def test_what_is_no_file_is_refused_and_not_waited_for(path: Path, kind: str) -> None:
    import os  # noqa: PLC0415

    match kind:
        case "pipe":
            os.mkfifo(path)
        case "device":
            path.symlink_to("/dev/zero")
        case "folder":
            path.mkdir()
        case "no name":
            path = Path("a\0b")
    with pytest.raises((OSError, InvalidCommandError)):
        list(read_trace(path))


values: st.SearchStrategy[Any] = (
    st.none() | st.booleans() | st.integers() | st.floats() | texts | st.lists(texts, max_size=2)
)
keys = st.sampled_from(
    ["at", "line", "what", "data", "number", "text", "lane", "way", "how", "event", "about", "format"]
)
kinds = st.sampled_from(["session", "line", "sent", "received", "asked", "ended", "noticed", "missing", "opened"])


@given(entries=st.lists(st.dictionaries(keys, values | kinds, max_size=6), max_size=4), tail=st.binary(max_size=20))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_file_is_read_or_refused_on_one_line(path: Path, entries: list[dict[str, Any]], tail: bytes) -> None:
    path.write_bytes(HEAD.encode() + b"".join(json.dumps(entry).encode() + b"\n" for entry in entries) + tail)
    said = refusal(lambda: list(read_trace(path))) or ""
    assert said.isprintable()
    assert len(said) < 1000


# Not cut, but wrong ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ('{"at":0.0,"what":"session","begun":"a","by":"b","format":"compax-aio trace","version":2}', "of version 2"),
        ('{"at":0.0,"what":"dance"}', "nothing is called 'dance'"),
        ('{"at":0.0,"what":"opened","at":1.0}', "stands in it twice"),
        ('{"at":0.0,"what":"noticed","event":"x","details":{"a":1,"a":2}}', "stands in it twice"),
        ('{"at":-0.001,"what":"opened"}', "its time cannot be"),
        ('{"at":0.0,"what":"missing","entries":-1}', "entries must be a whole number up to"),
        ('{"at":0.0,"what":"missing","entries":' + "9" * 4000 + "}", "entries must be a whole number up to"),
    ],
)
@pytest.mark.parametrize("where", ["alone", "at the end", "before a session"])
def test_what_is_whole_and_no_entry_is_not_taken_for_a_line_that_was_cut(
    path: Path, line: str, why: str, where: str
) -> None:
    (session,) = encoded(0.0, "", SessionBegun("now", "test"))
    lines = {"alone": [line], "at the end": [session, line], "before a session": [session, line, session]}
    path.write_text("".join(f"{each}\n" for each in lines[where]))
    with pytest.raises(InvalidCommandError, match=why):
        list(read_trace(path))
