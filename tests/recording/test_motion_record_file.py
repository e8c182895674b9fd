"""A motion record is read back as it was written: cut at any byte it gives what is whole, changed it says where."""

from __future__ import annotations

import asyncio
import csv
import os
import sys
from datetime import UTC, datetime
from math import isnan
from pathlib import Path
from typing import Any

import pyarrow.parquet  # type: ignore[import-untyped]
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.promises.bench import bench

from compax_aio import Drive, InvalidCommandError
from compax_aio.recording import motion_file, read_record, record
from compax_aio.recording.motion_file import COLUMNS, Kind, RecordFile, Row

STARTED = datetime(2026, 3, 1, 12, 30, tzinfo=UTC)
HEAD = "time_s,axis,kind,name,value,text\n"
ROWS = (
    Row(0.0, "x", Kind.AXIS, "unit", None, "mm"),
    Row(0.0, "x", Kind.QUANTITY, "position", None, "mm"),
    Row(0.25, "x", Kind.SAMPLE, "position", -1.5),
    Row(0.3, "x", Kind.MARK, "accepted", 120.5, 'move_to(120.5), "at once"'),
    Row(0.5, "x", Kind.MISSING, "position", None, "AnswerTimeoutError: no answer"),
    Row(0.75, "x", Kind.SAMPLE, "position", 3.25),
    Row(0.8, "", Kind.MARK, "clamp", None, "µ-switch"),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.csv"


def written(path: Path, rows: tuple[Row, ...] = ROWS, *, ends: bool = True) -> bytes:
    """Write a record of *rows*, and return its bytes."""
    file = RecordFile(path, overwrite=True)
    file.open(STARTED)
    for row in rows:
        file.put(row)
    if ends:
        assert file.close(Row(1.0, "", Kind.RECORD, "ended", 2, "as asked"))
    else:
        file.write_waiting()
        assert file._file is not None
        file._file.close()
    return path.read_bytes()


def test_all_that_was_written_is_read(path: Path) -> None:
    written(path)
    read = read_record(path)
    assert read.started == STARTED
    assert (read.ended, read.cut, read.duration_s, read.samples) == ("as asked", None, 1.0, 2)
    trace = read.axes["x"].traces["position"]
    assert list(trace.samples()) == [(0.25, -1.5), (0.75, 3.25)]
    assert list(trace.times_s) == [0.25, 0.5, 0.75]
    assert isnan(trace.values[1])
    assert trace.missing == {0.5: "AnswerTimeoutError: no answer"}
    assert (trace.unit, len(trace)) == ("mm", 2)
    accepted, clamp = read.marks
    assert (accepted.axis, accepted.word, accepted.value) == ("x", "accepted", 120.5)
    assert accepted.text == 'move_to(120.5), "at once"'
    assert (clamp.axis, clamp.text) == ("", "µ-switch")


def test_a_record_cut_at_any_byte_gives_what_is_whole_and_says_what_is_not(path: Path) -> None:
    data = written(path)
    whole = read_record(path)
    seen = set()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        read = read_record(path)
        seen.add(read.samples)
        assert read.cut is not None
        for axis in read.axes.values():
            for name, trace in axis.traces.items():
                all_samples = list(whole.axes["x"].traces[name].samples())
                assert list(trace.samples()) == all_samples[: len(trace)]
        assert read.marks == whole.marks[: len(read.marks)]
        end = data.rfind(b"\n", 0, length) + 1
        if length > end:
            assert f"its last {length - end} bytes make no whole line" in read.cut
    assert seen == {0, 1, 2}


@pytest.mark.parametrize("zeros", [1, 4096, 20_000])
def test_zeros_that_a_dying_disk_leaves_behind_are_what_was_lost(path: Path, zeros: int) -> None:
    data = written(path, ends=False)
    path.write_bytes(data + bytes(zeros))
    read = read_record(path)
    assert read.samples == 2
    assert read.cut is not None
    assert f"its last {zeros} bytes" in read.cut


def test_line_ends_and_byte_order_mark_of_other_programs_are_taken(path: Path) -> None:
    data = written(path)
    path.write_bytes(b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"))
    assert read_record(path).samples == 2


def row(number: int, text: str) -> str:
    """Replace line *number* of a record by *text*."""
    lines = [HEAD, *(",".join(fields) + "\n" for fields in _fields())]
    lines[number - 1] = text + "\n"
    return "".join(lines)


def _fields() -> list[tuple[str, ...]]:
    return [
        Row(0.0, "", Kind.RECORD, "format", 1, "motion record").as_fields(),
        Row(0.0, "", Kind.RECORD, "started", None, STARTED.isoformat()).as_fields(),
        *(each.as_fields() for each in ROWS[:3]),
        Row(1.0, "", Kind.RECORD, "ended", 1, "as asked").as_fields(),
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,axis\n", "line 1: a motion record begins with 'time_s,axis,kind"),
        ("no record", "line 1: it is no line of a motion record"),
        (row(6, "0.25,x,sample,position,-1.5"), "line 6: it has 5 columns, a row of a record has 6"),
        (row(6, "soon,x,sample,position,-1.5,"), r"line 6, column 1 \(time_s\): 'soon' is not a number"),
        (row(6, "-1,x,sample,position,-1.5,"), r"line 6, column 1 \(time_s\): '-1' is not a number of seconds"),
        (row(6, "inf,x,sample,position,-1.5,"), r"line 6, column 1 \(time_s\)"),
        (row(6, "0.25,x,sampel,position,-1.5,"), r"line 6, column 3 \(kind\): 'sampel' is not one of record, axis"),
        (row(6, "0.25,x,sample,position,1.5mm,"), r"line 6, column 5 \(value\): '1.5mm' is not a number"),
        (row(6, "0.25,x,sample,position,nan,"), r"line 6, column 5 \(value\)"),
        (row(6, "0.25,y,sample,position,1,"), r"line 6, column 2 \(axis\): 'y' is no axis of this record"),
        (row(6, "0.25,x,sample,speed,1,"), r"line 6, column 4 \(name\): 'speed' is no quantity of the axis x"),
        (row(6, "0.25,x,sample,position,,"), r"line 6, column 5 \(value\): a sample has a value"),
        (row(6, "0.25,x,missing,position,1,"), r"line 6, column 5 \(value\): a missing has no value"),
        (row(6, '0.25,x,sample,position,1,"'), "line 6: it is no line of a table"),
        (row(2, "0,,record,format,2,"), "line 2: it is of format 2.0, and this version reads format 1"),
        (row(3, "0,,record,started,,yesterday"), r"line 3, column 6 \(text\): 'yesterday' is no date"),
        (row(3, "0,,record,started,,2026-03-01T12:30"), "no date and time with a zone"),
        (row(7, "0.24,x,sample,position,1,"), r"line 7, column 1 \(time_s\): 0.24 s is before 0.25 s"),
        (row(7, "1.0,,record,ended,1,") + "2.0,x,sample,position,1,\n", "line 8: the record had ended before"),
    ],
)
def test_what_was_changed_is_refused_with_line_and_column(path: Path, text: str, says: str) -> None:
    path.write_text(text)
    with pytest.raises(InvalidCommandError, match=says):
        read_record(path)


def test_what_is_no_text_is_refused_with_its_place(path: Path) -> None:
    path.write_bytes(HEAD.encode() + b"0.0,\xff,axis,unit,,\n")
    with pytest.raises(InvalidCommandError, match="line 2, column 5: it is no text"):
        read_record(path)


def test_a_line_without_an_end_is_not_read_without_end(path: Path) -> None:
    path.write_text(HEAD + "x" * 1_000_000)
    with pytest.raises(InvalidCommandError, match="line 2: it is no line of a motion record"):
        read_record(path)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    for name in ("folder.csv", "pipe.csv"):
        with pytest.raises((InvalidCommandError, OSError), match=r"no plain file|Is a directory"):
            read_record(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_record(tmp_path / "nothing.csv")


@given(
    axis=st.text(max_size=20),
    name=st.text(max_size=20) | st.sampled_from(["long " * 5000, '\U0001f600\0"' * 9000]),
    value=st.none() | st.floats(allow_nan=False, allow_infinity=False),
    text=st.text(max_size=700),
    time_s=st.floats(min_value=0, max_value=1e7),
)
def test_whatever_is_said_is_one_line_that_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, *, axis: str, name: str, value: float | None, text: str, time_s: float
) -> None:
    path = tmp_path_factory.mktemp("any") / "run.csv"
    data = written(path, (Row(time_s, axis, Kind.MARK, name, value, text),))
    assert data.count(b"\n") == 5
    (mark,) = read_record(path).marks
    assert mark.time_s == pytest.approx(time_s, abs=1e-6)
    assert mark.value == value
    assert mark.text.isprintable()
    assert len(mark.text) < 6000


def test_where_rows_were_lost_the_samples_are_not_joined(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_file, "_MAX_WAITING", 6)
    file = RecordFile(path, overwrite=True)
    file.open(STARTED)
    for each in (*ROWS[:2], *(Row(at / 10, "x", Kind.SAMPLE, "position", at) for at in range(10))):
        file.put(each)  # the disk takes nothing meanwhile
    file.write_waiting()
    file.put(Row(1.0, "x", Kind.SAMPLE, "position", 10.0))
    file.close(Row(1.1, "", Kind.RECORD, "ended", 5, "as asked"))
    read = read_record(path)
    assert read.rows_lost == 6
    trace = read.axes["x"].traces["position"]
    assert list(trace.samples()) == [(0.0, 0.0), (0.1, 1.0), (0.2, 2.0), (0.3, 3.0), (1.0, 10.0)]
    (gap,) = (number for number, value in enumerate(trace.values) if isnan(value))
    assert gap == 4
    assert "lost" in trace.missing[trace.times_s[gap]]


def test_rows_that_come_after_lost_ones_stand_behind_the_gap(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_file, "_MAX_WAITING", 4)
    file = RecordFile(path, overwrite=True)
    file.open(STARTED)
    for each in (*ROWS[:2], *(Row(at / 10, "x", Kind.SAMPLE, "position", at) for at in range(4))):
        file.put(each)
    file._waiting.popleft()  # the disk has just begun to take them
    file.put(Row(0.9, "x", Kind.SAMPLE, "position", 9.0))
    kinds = [(row.kind, row.name, row.time_s) for row in file._waiting][-2:]
    file.close(Row(1.0, "", Kind.RECORD, "ended", 4, "as asked"))
    assert kinds == [(Kind.RECORD, "lost", 0.9), (Kind.SAMPLE, "position", 0.9)]


async def test_any_reader_of_tables_takes_it(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path):
        await drive.move_to(10)
    rows = read_rows(path)
    assert tuple(rows[0]) == COLUMNS
    positions = [float(row["value"]) for row in rows if (row["kind"], row["name"]) == ("sample", "position")]
    assert positions == [value for _, value in read_record(path).axes["x"].traces["position"].samples()]


def read_rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# Parquet --------------------------------------------------------------------------------------------------------------


async def test_a_parquet_record_says_the_same_as_one_of_csv(tmp_path: Path) -> None:
    path, beside = tmp_path / "run.parquet", tmp_path / "run.parquet.csv"
    async with bench() as (drive, _):
        async with record(drive, path):
            await drive.move_to(10)
            await drive.stop()
            assert exists(beside)
            assert not exists(path)
        assert not exists(beside)
    table = pyarrow.parquet.read_table(path)
    assert tuple(table.column_names) == COLUMNS
    assert str(table.schema.field("value").type) == "double"
    read = read_record(path)
    assert (read.cut, read.ended) == (None, "as asked")
    assert "reached" in [mark.word for mark in read.marks]
    samples = [row["value"] for row in table.to_pylist() if (row["kind"], row["name"]) == ("sample", "speed")]
    assert samples == [value for _, value in read.axes["x"].traces["speed"].samples()]


def exists(path: Path) -> bool:
    return path.exists()


async def test_a_parquet_record_that_is_there_is_not_replaced_unless_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    written(tmp_path / "other.csv")
    (tmp_path / "other.csv").rename(path)
    async with bench() as (drive, _):
        with pytest.raises(FileExistsError):
            async with record(drive, path):
                raise AssertionError
        async with record(drive, path, overwrite=True):
            pass
    assert read_record(path).cut is None


def test_a_parquet_file_that_is_not_whole_says_where_the_rest_is(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    path.write_bytes(b"PAR1 and no more")
    with pytest.raises(InvalidCommandError, match="is no whole Parquet file") as caught:
        read_record(path)
    assert caught.value.hint is None
    written(tmp_path / "run.parquet.csv")
    with pytest.raises(InvalidCommandError, match=r"what was recorded of it is in .*run\.parquet\.csv"):
        read_record(path)


def test_another_table_is_no_motion_record(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    pyarrow.parquet.write_table(pyarrow.table({"a": [1]}), path)
    with pytest.raises(InvalidCommandError, match="is no motion record: its columns are not time_s"):
        read_record(path)


async def test_a_parquet_file_that_cannot_be_made_leaves_the_csv_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from compax_aio.recording import motion_parquet  # noqa: PLC0415

    def fails(source: Path, target: Path) -> None:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(motion_parquet, "_table", lambda *_: 1 / 0)
            real(source, target)

    real = motion_parquet.convert
    monkeypatch.setattr(motion_parquet, "convert", fails)
    path = tmp_path / "run.parquet"
    async with bench() as (drive, _):
        with pytest.raises(ZeroDivisionError):
            async with record(drive, path):
                pass
    assert sorted(names_in(tmp_path)) == ["run.parquet.csv"]
    assert read_record(tmp_path / "run.parquet.csv").cut is None


async def test_a_parquet_file_that_a_stuck_disk_does_not_take_is_given_up_and_the_csv_file_is_named(
    tmp_path: Path,
) -> None:
    stuck = asyncio.Event()
    path = tmp_path / "run.parquet"

    async def work(drive: Drive) -> None:
        async with record(drive, path) as recording:
            real = recording._in_thread

            def in_thread(job: Any, *arguments: Any) -> Any:
                is_making = job.__name__ == "_make_parquet"
                return asyncio.ensure_future(stuck.wait()) if is_making else real(job, *arguments)

            recording._in_thread = in_thread  # type: ignore[method-assign, assignment]

    async with bench() as (drive, _):
        with pytest.raises(OSError, match=r"not made within 10 s; all of it is in .*run\.parquet\.csv"):
            await work(drive)
    assert read_record(tmp_path / "run.parquet.csv").cut is None


def names_in(folder: Path) -> list[str]:
    return [each.name for each in folder.iterdir()]


async def test_without_its_library_parquet_is_refused_with_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "compax_aio.recording.motion_parquet", raising=False)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    async with bench() as (drive, _):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError, match=r"Parquet needs pyarrow.*pip install 'compax-aio\[parquet\]'"):
            async with record(drive, tmp_path / "run.parquet"):
                raise AssertionError
        assert drive.stats.bytes_sent == before
    assert not names_in(tmp_path)
