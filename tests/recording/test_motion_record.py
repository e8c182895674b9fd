"""A motion record: what the drive said and when, on what nobody else needs of the line; what is missing is told."""

from __future__ import annotations

import asyncio
import errno
import logging
import signal
import sys
import threading
import time
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from tests.promises.bench import bench, ending, lines, now, scripted, until, watch_what_is_left_behind
from tests.promises.cable import connected, outage

from compax_aio import Drive, DriveGroup, DriveSettings, InvalidCommandError, MoveStoppedError
from compax_aio.motion.events import EventHub, EventStream
from compax_aio.recording import MotionRecord, MotionRecording, motion_file, read_record, record
from compax_aio.recording.motion_asking import QUANTITIES
from compax_aio.simulator.compax import LogKind

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@pytest.fixture
async def nothing_left_behind() -> AsyncIterator[None]:
    async with watch_what_is_left_behind():
        yield


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.csv"


def write(path: Path, text: str) -> None:
    path.write_text(text)


def read_text(path: Path) -> str:
    return path.read_text()


def link(path: Path, to: str) -> None:
    path.symlink_to(to)


def size_of(path: Path) -> int:
    """Give the size of what is written; 0 where there is nothing."""
    return path.stat().st_size if path.exists() else 0


def words(read: MotionRecord) -> list[str]:
    return [mark.word for mark in read.marks]


def values(read: MotionRecord, quantity: str, axis: str = "x") -> list[float]:
    return [value for _, value in read.axes[axis].traces[quantity].samples()]


# What is in it --------------------------------------------------------------------------------------------------------


async def test_a_move_is_recorded_with_its_values_and_marks(path: Path) -> None:
    async with bench(settings=DriveSettings(unit="mm")) as (drive, _):
        before = datetime.now().astimezone()
        async with record(drive, path) as recording:
            begun_at = now()
            await drive.move_to(100, comparators=[(50, 1)])
        read = read_record(path)
    assert read.axes["x"].unit == "mm"
    assert {name: trace.unit for name, trace in read.axes["x"].traces.items()} == {
        "position": "mm",
        "target": "mm",
        "following_error": "mm",
        "speed": "%",
        "torque": "%",
    }
    assert [word for word in words(read) if word != "$"] == ["accepted", "comparator", "reached"]
    position = values(read, "position")
    assert position[0] == 0
    assert position == sorted(position)
    assert position[-1] > 90
    assert set(values(read, "target")) == {0, 100}
    assert max(values(read, "speed")) == 100
    assert read.samples == recording.samples == recording.samples_of("x")
    assert read.started is not None
    assert timedelta(0) <= read.started - before < timedelta(seconds=10)
    assert (read.ended, read.cut, read.rows_lost) == ("as asked", None, 0)
    assert read.duration_s == pytest.approx(recording.ended_after_s, abs=1e-6)
    assert recording.ended_after_s <= now() - begun_at


async def test_every_value_is_one_that_the_drive_said_at_the_time_at_which_it_arrived(path: Path) -> None:
    async with bench(baudrate=9600) as (drive, far):
        async with record(drive, path, quantities=["position"], status_interval_s=None) as recording:
            begun_at = now() - recording.time_s
            await drive.move_to(50)
        said = [(entry.at, entry.text) for entry in far.log if entry.kind == LogKind.ANSWER and "S001" in entry.text]
    trace = read_record(path).axes["x"].traces["position"]
    answers = [float(text.split(":")[1]) for _, text in said]
    recorded = [value for _, value in trace.samples()]
    start = len(answers) - len(recorded)
    assert len(recorded) >= 20
    assert set(recorded) <= set(answers)
    # An answer of 13 characters takes 13.5 ms on the wire.
    for at, value in trace.samples():
        nearest = max(
            said_at for said_at, text in said if said_at <= at + begun_at and float(text.split(":")[1]) == value
        )
        assert at + begun_at - nearest < 0.03
    assert start >= 0


async def test_several_drives_share_one_time_base(path: Path) -> None:
    async with (
        DriveGroup.connect({"x": "sim://compax?name=gx", "y": "sim://compax?name=gy&position=7"}) as group,
        record(group, path, quantities=("position",), interval_s=0.1) as recording,
    ):
        await group.move_to(x=10, y=20)
        await asyncio.sleep(0.5)
        assert recording.axes == ("x", "y")
    read = read_record(path)
    assert values(read, "position", "x")[-1] == 10
    assert values(read, "position", "y")[0] == 7
    at = {axis: [at for at, _ in read.axes[axis].traces["position"].samples()] for axis in ("x", "y")}
    assert at["x"][1:5] == pytest.approx(at["y"][1:5], abs=0.01)
    assert {mark.axis for mark in read.marks} == {"x", "y"}


@pytest.mark.parametrize("kind", ["one", "list", "mapping"])
async def test_drives_are_given_one_or_several_with_their_names_or_others(path: Path, kind: str) -> None:
    async with bench() as (drive, _):
        devices: Any = {"one": drive, "list": [drive], "mapping": {"carriage": drive}}[kind]
        async with record(devices, path):
            await asyncio.sleep(0.1)
    assert list(read_record(path).axes) == ["carriage" if kind == "mapping" else "x"]


async def test_a_status_value_is_recorded_with_the_unit_of_the_drives_tables(path: Path) -> None:
    async with bench() as (drive, _):
        unit = (await drive.read_status(12)).unit
        async with record(drive, path, quantities=["S12"]):
            await asyncio.sleep(0.2)
    trace = read_record(path).axes["x"].traces["S12"]
    assert len(trace) > 3
    assert trace.unit == (unit or "")


async def test_a_person_can_mark_what_happens(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path) as recording:
        await asyncio.sleep(0.1)
        recording.mark("clamp closed", value=5, text="by hand\nsecond line")
        recording.mark("light", axis="x")
        with pytest.raises(InvalidCommandError, match="'q' is not recorded here; recorded: x"):
            recording.mark("light", axis="q")
        with pytest.raises(InvalidCommandError, match="value must be finite"):
            recording.mark("light", value=float("nan"))
    first, second = read_record(path).marks
    assert (first.word, first.axis, first.value, first.text) == ("clamp closed", "", 5.0, r"by hand\nsecond line")
    assert (second.word, second.axis) == ("light", "x")


async def test_what_happened_before_a_mark_stands_before_it(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path) as recording:
        await drive.move_to(10)
        recording.mark("clamp closed")
    assert words(read_record(path))[-2:] == ["reached", "clamp closed"]


async def test_a_stop_a_fault_and_a_lost_line_are_marked(path: Path) -> None:
    async with (
        connected(DriveSettings(reconnect_first_s=0.1)) as (drive, far, cable),
        record(drive, path, status_interval_s=0.2),
    ):
        move = drive.move_to(1000)
        await asyncio.sleep(0.5)
        await drive.stop()
        assert isinstance(await ending(move), MoveStoppedError)
        await outage(cable, far, 3.0)
        await until(lambda: drive.is_open)
        far.raise_fault(55)
        await asyncio.sleep(1)
        await drive.quit()
    read = read_record(path)
    assert words(read) == ["accepted", "standstill", "stopped", "connection lost", "connection restored", "fault"]
    restored, fault = read.marks[-2:]
    assert restored.value is not None
    assert 3 < restored.value < 6
    assert (fault.value, fault.text[:3]) == (55, "E55"), "nobody but the record has asked for the status"
    lost_at, restored_at = (mark.time_s for mark in read.marks[3:5])
    for trace in read.axes["x"].traces.values():
        assert not [at for at, _ in trace.samples() if lost_at < at < restored_at], "nothing is invented meanwhile"
        assert [at for at, _ in trace.samples() if at > restored_at], "and it goes on afterwards"


# What is missing ------------------------------------------------------------------------------------------------------


async def test_what_the_drive_refuses_is_empty_and_asked_seldom(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with scripted({"S5": "E90", "S3": "S003: 0.5", "S4": "S004: 1"}) as (drive, far):
        with caplog.at_level(logging.WARNING):
            async with record(drive, path) as recording:
                await asyncio.sleep(12)
                assert "torque" not in recording.newest("x")
                assert recording.newest("x")["following_error"] == 0.5
    read = read_record(path)
    torque = read.axes["x"].traces["torque"]
    assert len(torque) == 0
    assert 2 <= far.lines.count("S5") <= 4
    assert recording.missing == len(torque.missing) == far.lines.count("S5")
    assert all("E90" in why for why in torque.missing.values())
    assert len(values(read, "position")) > 1000
    assert caplog.text.count("torque cannot be recorded") == 1


async def test_what_is_no_number_is_empty(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path, quantities=["S16"]):
        await asyncio.sleep(1)
    trace = read_record(path).axes["x"].traces["S16"]
    assert len(trace) == 0
    (why,) = trace.missing.values()
    assert "it is no number: '" in why


async def test_a_drive_that_falls_silent_is_told_and_comes_back(path: Path) -> None:
    async with (
        bench(settings=DriveSettings(answer_timeout_s=0.2)) as (drive, far),
        record(drive, path, quantities=["position"], status_interval_s=None),
    ):
        await asyncio.sleep(0.5)
        far.silent = True
        await asyncio.sleep(3)
        far.silent = False
        await asyncio.sleep(2)
    trace = read_record(path).axes["x"].traces["position"]
    assert trace.missing
    assert all(why.startswith("AnswerTimeoutError: ") for why in trace.missing.values())
    first, last = min(trace.missing), max(trace.missing)
    assert not [at for at, _ in trace.samples() if first < at < last]
    assert [at for at, _ in trace.samples() if at > last]


async def test_a_drive_that_is_closed_ends_the_record(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path) as recording:
        await asyncio.sleep(0.2)
        await drive.close()
        async with asyncio.timeout(1):
            await recording.until_over()
        samples = recording.samples
        await asyncio.sleep(1)
        assert recording.samples == samples
    assert words(read_record(path)) == ["closed"]


# The line -------------------------------------------------------------------------------------------------------------


async def test_the_line_is_used_as_fully_as_by_reads_one_after_the_other(path: Path) -> None:
    async with bench(baudrate=9600, position=123.45) as (drive, _):
        begun_at = now()
        for _ in range(100):
            await drive.position()
        wire = 100 / (now() - begun_at)
        async with record(drive, path, quantities=["position"], status_interval_s=None) as recording:
            await asyncio.sleep(10)
            assert recording.rate("x") == pytest.approx(wire, rel=0.02)
    assert read_record(path).samples / 10 > 0.98 * wire


async def test_a_share_of_the_line_is_left_free(path: Path) -> None:
    async with bench(baudrate=9600) as (drive, _):
        rates = []
        for share in (1.0, 0.5):
            async with record(
                drive, path, quantities=["position"], status_interval_s=None, line_share=share, overwrite=True
            ) as recording:
                await asyncio.sleep(10)
                rates.append(recording.rate("x"))
    assert rates[1] == pytest.approx(rates[0] / 2, rel=0.05)


async def test_a_stop_waits_for_no_more_than_the_exchange_in_flight(path: Path) -> None:
    async with bench(baudrate=9600) as (drive, far), record(drive, path):
        for _ in range(5):
            move = drive.move_to(1000 if far.position < 500 else 0)
            await move.accepted
            await asyncio.sleep(0.317)
            begun_at = now()
            stopping = asyncio.ensure_future(drive.stop())
            await until(lambda: lines(far)[-1] == drive.settings.dialect.stop, to_the_tick=True)
            assert now() - begun_at < 0.045, "one exchange, and STOP itself"
            await stopping
            await ending(move)


async def test_others_that_read_get_their_turn_each_time(path: Path) -> None:
    async with bench(baudrate=9600) as (drive, _):
        begun_at = now()
        for _ in range(50):
            await drive.read_status(12)
        alone_s = now() - begun_at
        async with record(drive, path):
            begun_at = now()
            for _ in range(50):
                await drive.read_status(12)
            assert now() - begun_at < 2.6 * alone_s


async def test_an_interval_is_kept_on_whole_multiples(path: Path) -> None:
    async with bench() as (drive, far):
        async with record(drive, path, quantities=["position", "torque"], interval_s=0.25, status_interval_s=None):
            await asyncio.sleep(2.1)
        asked = lines(far).count("S1")
    read = read_record(path)
    for trace in read.axes["x"].traces.values():
        times = [at for at, _ in trace.samples()][1:]
        assert [late - early for early, late in pairwise(times)] == pytest.approx([0.25] * (len(times) - 1), abs=0.01)
    assert asked == len(values(read, "position"))
    assert 8 <= asked <= 10


async def test_prepared_moves_of_a_group_still_start_together(path: Path) -> None:
    urls = {axis: f"sim://compax?name=p{axis}&baudrate=9600" for axis in "xy"}
    async with DriveGroup.connect(urls) as group, record(group, path):
        move = group.move_to(x=10, y=10)
        await move
    accepted = [mark.time_s for mark in read_record(path).marks if mark.word == "accepted"]
    assert abs(accepted[0] - accepted[1]) < 0.01


# The file -------------------------------------------------------------------------------------------------------------


async def test_a_record_that_is_there_is_not_replaced_unless_that_is_said(path: Path) -> None:
    write(path, "mine")
    async with bench() as (drive, _):
        with pytest.raises(FileExistsError):
            async with record(drive, path):
                raise AssertionError
        assert read_text(path) == "mine"
        async with record(drive, path, overwrite=True):
            await asyncio.sleep(0.1)
    assert read_record(path).samples > 0


async def test_what_is_no_plain_file_is_not_written(path: Path, tmp_path: Path) -> None:
    link(path, "/dev/null")
    async with bench() as (drive, _):
        with pytest.raises(OSError, match="no plain file"):
            async with record(drive, path, overwrite=True):
                raise AssertionError


async def test_an_error_of_the_block_is_its_own_and_the_record_says_so(path: Path) -> None:
    async with bench() as (drive, _):
        with pytest.raises(ZeroDivisionError):
            async with record(drive, path):
                raise ZeroDivisionError
    assert read_record(path).ended == "ZeroDivisionError"


async def test_a_record_that_is_cancelled_is_whole(path: Path) -> None:
    async def work(drive: Drive) -> None:
        async with record(drive, path):
            await asyncio.sleep(100)

    async with bench() as (drive, _):
        task = asyncio.ensure_future(work(drive))
        await asyncio.sleep(0.7)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
    read = read_record(path)
    assert (read.ended, read.cut) == ("CancelledError", None)
    assert read.duration_s == pytest.approx(0.7, abs=0.01)


async def test_what_was_recorded_is_in_the_file_half_a_second_later(path: Path) -> None:
    async with bench() as (drive, _), record(drive, path) as recording:
        await asyncio.sleep(2)
        samples = recording.samples
        await asyncio.sleep(0.6)
        read = read_record(path)
    assert read.samples >= samples
    assert read.ended is None
    assert read.cut is not None
    assert "without saying so" in read.cut


class FullDisk:
    """Takes nothing."""

    closed = False

    def write(self, text: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        self.closed = True


def fill_disk(recording: MotionRecording) -> None:
    """Let nothing more be taken for *recording*."""
    file: Any = recording._file
    whole, file._file = file._file, FullDisk()
    whole.close()


async def test_a_full_disk_ends_the_record_and_moves_go_on(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async def work(drive: Drive) -> None:
        async with record(drive, path) as recording:
            await asyncio.sleep(0.6)
            fill_disk(recording)
            move = drive.move_to(100)
            async with asyncio.timeout(2):
                await recording.until_over()
            assert recording.error is not None
            await move

    async with bench() as (drive, far):
        with pytest.raises(OSError, match="No space left"):
            await work(drive)
        assert far.position == 100
    assert "does not go on" in caplog.text
    assert read_record(path).samples > 0


async def test_an_error_of_the_block_goes_before_that_of_the_disk(path: Path) -> None:
    async def work(drive: Drive) -> None:
        async with record(drive, path) as recording:
            fill_disk(recording)
            raise ZeroDivisionError

    async with bench() as (drive, _):
        with pytest.raises(ZeroDivisionError):
            await work(drive)


async def test_a_disk_that_is_too_slow_costs_rows_and_is_told(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_file, "_MAX_WAITING", 50)
    async with bench() as (drive, _), record(drive, path) as recording:
        await asyncio.sleep(3)
    read = read_record(path)
    assert read.rows_lost == recording.rows_lost > 100
    assert read.samples + read.rows_lost >= recording.samples


async def test_a_disk_that_is_stuck_at_the_end_is_waited_for_ten_seconds(path: Path) -> None:
    stuck = asyncio.Event()

    async def work(drive: Drive) -> None:
        async with record(drive, path) as recording:
            await asyncio.sleep(0.1)
            file: Any = recording._file
            file._file.close()
            recording._in_thread = lambda *_: asyncio.ensure_future(stuck.wait())  # type: ignore[method-assign]

    async with bench() as (drive, _):
        with pytest.raises(OSError, match="has not taken the end of it within 10 s"):
            await work(drive)
        assert now() == pytest.approx(10.1, abs=0.2)


@pytest.mark.real_time
async def test_a_process_that_is_killed_leaves_all_but_the_last_half_second(path: Path) -> None:
    program = (
        "import asyncio, compax_aio\n"
        "from compax_aio.recording import record\n"
        "async def main():\n"
        "    async with compax_aio.connect('sim://compax', name='x') as x:\n"
        f"        async with record(x, {str(path)!r}):\n"
        "            await asyncio.sleep(60)\n"
        "asyncio.run(main())\n"
    )
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", program)
    try:
        give_up_at = time.monotonic() + 30
        while size_of(path) < 2000:
            assert time.monotonic() < give_up_at
            await asyncio.sleep(0.05)
    finally:
        process.send_signal(signal.SIGKILL)
        await process.wait()
    read = read_record(path)
    assert read.samples > 10
    assert read.cut is not None


# What is refused ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"quantities": []}, "no quantity was named"),
        ({"quantities": ["postion"]}, "'postion' cannot be recorded; possible are position, .*S1-S250"),
        ({"quantities": ["S251"]}, "cannot be recorded"),
        ({"quantities": [None]}, "None cannot be recorded"),
        ({"interval_s": 0}, "interval_s must be above 0"),
        ({"interval_s": float("nan")}, "interval_s must be finite"),
        ({"status_interval_s": -1}, "status_interval_s must be above 0"),
        ({"line_share": 0}, "line_share is above 0 and at most 1"),
        ({"line_share": 1.1}, "line_share is above 0 and at most 1"),
    ],
)
async def test_what_means_nothing_is_refused_and_nothing_is_asked(
    path: Path, options: dict[str, Any], says: str
) -> None:
    async with bench() as (drive, _):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError, match=says):
            async with record(drive, path, **options):
                raise AssertionError
        assert drive.stats.bytes_sent == before
    assert size_of(path) == 0


@pytest.mark.parametrize("devices", [[], {}, "x", {"x": 5}])
async def test_what_is_no_drive_is_refused(path: Path, devices: Any) -> None:
    with pytest.raises(InvalidCommandError, match=r"nothing is recorded|no drive whose motion"):
        async with record(devices, path):
            raise AssertionError


async def test_two_drives_of_one_name_are_refused(path: Path) -> None:
    async with bench() as (drive, _):
        with pytest.raises(InvalidCommandError, match="a name of its own, not x, x"):
            async with record([drive, drive], path):
                raise AssertionError


async def test_a_name_that_is_that_of_no_record_is_refused(tmp_path: Path) -> None:
    async with bench() as (drive, _):
        with pytest.raises(InvalidCommandError, match=r"ends in \.csv or \.parquet, not as"):
            async with record(drive, tmp_path / "run.xlsx"):
                raise AssertionError


async def test_a_device_that_cannot_be_asked_for_it_says_what_it_can(path: Path) -> None:
    class Stepper:
        name, unit = "a", "steps"

        async def position(self) -> float:
            return 5.0

        def events(self) -> Any:
            raise AssertionError("it is refused before")

    with pytest.raises(InvalidCommandError, match=r"'torque' cannot be recorded of it; possible are position$"):
        async with record(Stepper(), path, quantities=["position", "torque"]):
            raise AssertionError


class _Saying:
    """A device that says one value for ever."""

    name, unit = "x", "mm"

    def __init__(self, value: object) -> None:
        self._value = value
        self.hub = EventHub()

    def events(self) -> EventStream:
        return self.hub.stream()

    async def position(self) -> Any:
        await asyncio.sleep(0.01)
        return self._value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, "5", None])
async def test_what_no_record_can_hold_is_missing_and_the_record_is_read_back(path: Path, value: object) -> None:
    async with record(_Saying(value), path, quantities=["position"]) as recording:
        await asyncio.sleep(0.1)
    assert (recording.samples, recording.missing) == (0, 1)
    (why,) = read_record(path).axes["x"].traces["position"].missing.values()
    assert "no number" in why


async def test_a_mark_after_the_end_is_refused_and_harms_nothing(path: Path) -> None:
    async with record(_Saying(1.0), path, quantities=["position"]) as recording:
        await asyncio.sleep(0.1)
    with pytest.raises(InvalidCommandError, match="has ended, and takes no mark 'late'"):
        recording.mark("late")
    assert read_record(path).marks == ()


async def test_a_mark_while_the_end_is_written_is_refused_and_the_record_can_be_read(path: Path) -> None:
    async with record(_Saying(1.0), path, quantities=["position"]) as recording:
        await asyncio.sleep(0.1)
        close = recording._file.close

        def slowly(ended: motion_file.Row) -> bool:
            with pytest.raises(InvalidCommandError, match="has ended"):
                recording.mark("in between")
            return close(ended)

        recording._file.close = slowly  # type: ignore[method-assign]
    assert read_record(path).ended == "as asked"


async def test_a_mark_of_any_length_is_read_back(path: Path) -> None:
    async with record(_Saying(1.0), path, quantities=["position"]) as recording:
        recording.mark("word " * 10_000)
    (mark,) = read_record(path).marks
    assert mark.word.startswith("word word")
    assert mark.word.endswith("…")


async def test_an_axis_whose_name_no_line_holds_is_refused(path: Path) -> None:
    with pytest.raises(InvalidCommandError, match="at most 200 letters"):
        async with record({"x" * 201: _Saying(1.0)}, path):
            raise AssertionError


async def test_a_record_that_cannot_begin_leaves_no_thread(path: Path) -> None:
    with pytest.raises(InvalidCommandError, match="torque"):
        async with record(_Saying(1.0), path, quantities=["torque"]):
            raise AssertionError
    assert not [thread for thread in threading.enumerate() if thread.name == f"record {path.name}"]


async def test_a_defect_ends_the_record_and_is_raised(path: Path) -> None:
    async with bench() as (drive, _):
        broken: Any = {"x": _Broken(drive)}
        with pytest.raises(ZeroDivisionError):
            async with record(broken, path, quantities=["position"]) as recording:
                await recording.until_over()
    assert read_record(path).axes["x"].traces["position"].values.tolist() == []


class _Broken:
    """A drive whose reading is defective."""

    def __init__(self, drive: Drive) -> None:
        self.name, self.unit, self.events = drive.name, drive.unit, drive.events

    async def position(self) -> float:
        raise ZeroDivisionError


def test_the_usual_quantities_are_those_of_a_drive() -> None:
    assert all(hasattr(Drive, name) for name in QUANTITIES)
