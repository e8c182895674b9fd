"""What a line counts and what it logs: each counter counts what it says, and a log tells without flooding."""

from __future__ import annotations

import asyncio
import itertools
import logging
import re
from pathlib import Path
from random import Random
from typing import Any

import pytest
from tests.fakes.answers import PROMPT, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.link.lines import Line, connected
from tests.promises.bench import ScriptedDrive
from tests.promises.cable import Cable

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings, InvalidCommandError
from compax_aio.compax.events import ConnectionRestored
from compax_aio.link import port
from compax_aio.link.contract import Lane
from compax_aio.link.stats import LinkStats
from compax_aio.link.wire import readable
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.transports.loopback import listen


@pytest.fixture(autouse=True)
def watchdog() -> None:
    """Let tests take a day, unlike their neighbours."""


PERCENTILES = (0.1, 1, 25, 33.3, 50, 90, 95, 99, 99.9, 100)


async def opened(far: ScriptedDrive, **settings: Any) -> tuple[Drive, ScriptedDrive]:
    with await listen("counted", lambda: far) as listener:
        return await compax_aio.connect(listener.url, name="x", settings=DriveSettings(**settings)), far


def counted(stats: LinkStats) -> dict[str, int]:
    names = "exchanges timeouts resynchronisations reconnects late_answers strays bytes_sent bytes_received"
    return {name: getattr(stats, name) for name in names.split()}


def since(before: dict[str, int], stats: LinkStats) -> dict[str, int]:
    """Return what has changed."""
    return {name: more for name, now in counted(stats).items() if (more := now - before[name])}


# Counters -------------------------------------------------------------------------------------------------------------


async def test_a_line_that_was_opened_has_counted_its_marker_as_bytes_and_as_one_resynchronisation() -> None:
    far = ScriptedFarEnd()
    line = Line(far)
    line.connect()
    await asyncio.sleep(0.1)
    (marker,) = far.writes
    sent, received = len(marker), len(as_drive(marker.decode().strip()))
    assert counted(line.link.stats) == {
        "exchanges": 0,
        "timeouts": 0,
        "resynchronisations": 1,
        "reconnects": 0,
        "late_answers": 0,
        "strays": 0,
        "bytes_sent": sent,
        "bytes_received": received,
    }


@pytest.mark.parametrize(
    ("text", "answer"),
    [("S1", b"S001: 1.00" + PROMPT), ("S1", b"E90" + PROMPT), ("PA1", PROMPT), ("PA1", b"E92" + PROMPT)],
)
async def test_an_answer_in_its_turn_is_one_exchange_also_when_it_refuses(text: str, answer: bytes) -> None:
    line = await connected()
    before = counted(line.link.stats)
    line.far.script = lambda _: answer
    await line.ask(text, Lane.MOTION)
    assert since(before, line.link.stats) == {
        "exchanges": 1,
        "bytes_sent": len(text) + 1,
        "bytes_received": len(answer),
    }


async def test_an_answer_that_nobody_understands_is_an_exchange_after_which_the_line_is_brought_back_in_step() -> None:
    line = await connected()
    before = counted(line.link.stats)
    line.far.script = lambda text: b"WHAT" + PROMPT if text == "SD5" else as_drive(text)
    await line.ask("SD5", Lane.CONTROL)
    await line.ask("S1")
    changed = since(before, line.link.stats)
    assert (changed["exchanges"], changed["resynchronisations"]) == (2, 1)


async def test_reads_that_share_an_exchange_are_one() -> None:
    line = await connected()
    line.far.delay_s = 0.1
    first = line.ask("S2")
    before = counted(line.link.stats)
    await asyncio.gather(first, *(line.ask("S1") for _ in range(10)))
    assert since(before, line.link.stats)["exchanges"] == 2


async def test_an_exchange_whose_caller_has_gone_is_counted_all_the_same() -> None:
    line = await connected()
    line.far.delay_s = 0.1
    before = counted(line.link.stats)
    line.ask("S1").cancel()
    line.ask("S2").cancel()
    await asyncio.sleep(1)
    assert since(before, line.link.stats) == {"exchanges": 1, "bytes_sent": 3, "bytes_received": 10}


async def test_a_time_out_and_its_answer_that_comes_late_are_one_of_each() -> None:
    far = ScriptedFarEnd()
    line = await connected(far)

    def slow_once(text: str) -> bytes:
        far.delay_s = 1.5 if text == "S1" else 0.0
        return as_drive(text)

    far.script = slow_once
    before = counted(line.link.stats)
    await asyncio.gather(line.ask("S1"), line.ask("S2"), return_exceptions=True)
    changed = since(before, line.link.stats)
    assert (changed["timeouts"], changed["late_answers"], changed["exchanges"]) == (1, 1, 1)
    assert changed["resynchronisations"] == 1
    assert "strays" not in changed


async def test_markers_without_an_answer_are_no_time_outs() -> None:
    line = await connected()
    line.far.script = lambda _: None
    before = counted(line.link.stats)
    await asyncio.gather(line.ask("S1"), line.ask("S2"), return_exceptions=True)
    changed = since(before, line.link.stats)
    assert changed.pop("bytes_sent") == sum(map(len, line.far.writes))
    assert changed == {"timeouts": 1}


async def test_what_nobody_has_asked_for_is_a_stray_and_a_message_of_the_drive_is_none() -> None:
    drive, far = await opened(ScriptedDrive())
    before = counted(drive.stats)
    for text in (b"$", b"3", b"WHAT", b"S099: 1.00", b""):
        far.transport.write(text + PROMPT)
        await asyncio.sleep(1)
    assert since(before, drive.stats)["strays"] == 3
    await drive.close()


async def test_counters_go_on_over_reconnects_and_each_of_those_is_counted_once() -> None:
    far, cable = SimulatedDrive(name="x"), Cable()
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x")
    assert drive.stats.reconnects == 0
    stats, before = drive.stats, counted(drive.stats)
    for number in (1, 2, 3):
        await cable.pull()
        await asyncio.sleep(20)  # with many attempts that fail
        await cable.plug(far)
        await drive.position()
        assert drive.stats.reconnects == number
    assert drive.stats is stats
    changed = since(before, drive.stats)
    assert changed["resynchronisations"] == 3
    assert changed["exchanges"] > 3
    assert not {"timeouts", "late_answers", "strays"} & set(changed)
    await drive.close()
    await cable.pull()


async def test_every_attempt_to_open_a_line_is_counted_while_it_is_lost() -> None:
    far, cable = SimulatedDrive(name="x"), Cable()
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x")
    events = drive.events()
    assert drive.stats.openings == 1
    await cable.pull()
    await asyncio.sleep(20)
    tried = drive.stats.openings - 1
    assert tried > 3
    await cable.plug(far)
    await drive.position()
    restored = [await anext(events), await anext(events)][1]
    assert isinstance(restored, ConnectionRestored)
    assert drive.stats.openings - 1 == restored.attempts > tried
    await drive.close()
    await cable.pull()


async def test_bytes_are_those_on_the_wire_both_ways_whatever_becomes_of_them() -> None:
    random = Random(7)
    far = ScriptedFarEnd()
    said = bytearray()

    def script(text: str) -> bytes | None:
        if random.random() < 0.1:
            return None
        answer = as_drive(text) if random.random() < 0.8 else random.randbytes(9)
        said.extend(answer)
        return answer

    line = Line(far)
    far.script = script
    line.connect()
    for number in range(200):
        await asyncio.gather(line.ask(f"S{number % 40 + 1}"), line.ask("SD50", Lane.CONTROL), return_exceptions=True)
    await asyncio.sleep(10)
    assert line.link.stats.bytes_sent == sum(map(len, far.writes))
    assert line.link.stats.bytes_received == len(said)


# Percentiles ----------------------------------------------------------------------------------------------------------


def test_before_the_first_answer_there_is_no_percentile() -> None:
    assert [LinkStats().answer_time_s(each) for each in PERCENTILES] == [None] * len(PERCENTILES)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 10, 99, 100, 101, 256])
def test_a_percentile_is_the_least_answer_time_within_which_that_share_came(count: int) -> None:
    stats = LinkStats()
    times = [Random(number).random() for number in range(count)]
    stats.answer_times_s.extend(times)
    for percentile in PERCENTILES:
        within = [each for each in times if sum(other <= each for other in times) * 100 >= percentile * count - 1e-9]
        assert stats.answer_time_s(percentile) == min(within)
    assert stats.answer_time_s(100) == max(times)


def test_the_median_of_four_is_the_second_and_no_mean_that_nobody_has_measured() -> None:
    stats = LinkStats()
    stats.answer_times_s.extend([0.4, 0.1, 0.3, 0.2])
    assert [stats.answer_time_s(each) for each in (25, 50, 51, 75, 76)] == [0.1, 0.2, 0.3, 0.3, 0.4]


@pytest.mark.parametrize("percentile", [0, -1, 100.1, float("nan"), float("inf")])
def test_what_is_no_percentile_is_refused(percentile: float) -> None:
    stats = LinkStats()
    stats.answer_times_s.append(1.0)
    with pytest.raises(InvalidCommandError):
        stats.answer_time_s(percentile)


async def test_an_answer_time_is_from_the_line_being_written_to_its_answer_being_read() -> None:
    line = await connected()
    before = len(line.link.stats.answer_times_s)
    for delay_s in (0.01, 0.5, 0.02):
        line.far.delay_s = delay_s
        waiters = [line.ask("S1"), line.ask("S2")]
        await asyncio.gather(*waiters)
    taken = list(line.link.stats.answer_times_s)[before:]
    # The time that the second of each two had to wait for its turn is none of its answer's.
    assert taken == pytest.approx([0.01, 0.01, 0.5, 0.5, 0.02, 0.02])


async def test_neither_a_marker_nor_a_late_answer_has_an_answer_time() -> None:
    far = ScriptedFarEnd()
    line = await connected(far)
    delays = itertools.chain([1.5], itertools.repeat(0.001))

    def script(text: str) -> bytes:
        far.delay_s = next(delays)
        return as_drive(text)

    far.script = script
    before = len(line.link.stats.answer_times_s)
    await asyncio.gather(line.ask("S1"), line.ask("S2"), return_exceptions=True)
    assert list(line.link.stats.answer_times_s)[before:] == pytest.approx([0.001])


async def test_only_the_last_answer_times_are_kept() -> None:
    line = await connected()
    for number in range(300):
        line.far.delay_s = number / 1000
        await line.ask("S1")
    kept = line.link.stats.answer_times_s
    assert len(kept) == 256
    assert kept[-1] == pytest.approx(0.299)
    assert min(kept) == pytest.approx(0.044)


# The wire, as a person reads it ---------------------------------------------------------------------------------------


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.DEBUG, "compax_aio")
    return caplog


def told(log: pytest.LogCaptureFixture, logger: str, least: int = logging.DEBUG) -> list[str]:
    return [each.getMessage() for each in log.records if each.name == logger and each.levelno >= least]


async def test_the_wire_is_logged_byte_for_byte_with_the_name_of_the_drive(log: pytest.LogCaptureFixture) -> None:
    line = await connected()
    log.clear()
    await line.ask("PA100", Lane.MOTION)
    assert told(log, "compax_aio.link.wire") == ["x → PA100␍", "x ← ␍␊>"]
    assert {each.levelname for each in log.records} == {"DEBUG"}


async def test_the_wire_is_written_for_a_log_only_if_somebody_wants_it(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[bytes] = []
    monkeypatch.setattr(port, "readable", written.append)
    caplog.set_level(logging.INFO, "compax_aio")
    line = await connected()
    await line.ask("S1")
    assert not caplog.records
    assert not written


async def test_whatever_bytes_come_no_record_of_the_wire_holds_a_control_character(
    log: pytest.LogCaptureFixture,
) -> None:
    line = await connected()
    log.clear()
    line.far.say(bytes(range(256)))
    line.far.say(b"\x1b[2J\nWARNING forged\r\x00")
    await asyncio.sleep(5)
    assert told(log, "compax_aio.link.wire")
    assert all(each.getMessage().isprintable() for each in log.records)


def test_each_layer_has_one_logger_and_the_wire_its_own() -> None:
    package = Path(compax_aio.__file__).parent
    for layer in ("transports", "link", "compax"):
        sources = [path.read_text(encoding="utf-8") for path in (package / layer).glob("**/*.py")]
        names = {name for source in sources for name in re.findall(r"getLogger\((.*?)\)", source)}
        assert names - {'"compax_aio.link.wire"'} == {f'"compax_aio.{layer}"'}


def test_every_byte_is_written_as_something_printable_that_no_other_byte_is_written_as() -> None:
    written = [readable(bytes([byte])) for byte in range(256)]
    assert all(each.isprintable() for each in written)
    assert len(set(written)) == 256


# Everything else that is logged ---------------------------------------------------------------------------------------


async def test_a_time_out_is_a_warning_and_a_late_answer_is_told_both_with_drive_and_line(
    log: pytest.LogCaptureFixture,
) -> None:
    far = ScriptedFarEnd()
    line = await connected(far)

    def slow_once(text: str) -> bytes:
        far.delay_s = 1.5 if text == "S1" else 0.0
        return as_drive(text)

    far.script = slow_once
    await asyncio.gather(line.ask("S1"), line.ask("S2"), return_exceptions=True)
    records = [(each.levelname, each.getMessage()) for each in log.records if each.name == "compax_aio.link"]
    assert records == [("WARNING", "x: no answer to 'S1' within 1 s"), ("INFO", "x: the answer to 'S1' came late")]


async def test_a_line_that_is_lost_for_a_day_is_told_in_a_few_records(log: pytest.LogCaptureFixture) -> None:
    far, cable = SimulatedDrive(name="x"), Cable()
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x", settings=DriveSettings(reconnect_slowest_s=600))
    log.set_level(logging.INFO, "compax_aio")
    log.clear()
    watching = asyncio.ensure_future(_watch(drive))
    await cable.pull()
    await asyncio.sleep(24 * 3600)
    await cable.plug(far)
    await asyncio.sleep(120)
    important = [each for each in log.records if each.levelno >= logging.INFO]
    assert len(important) <= 6, [each.getMessage() for each in important]
    assert all("x" in each.getMessage().split()[0] for each in important)
    assert [each.levelname for each in important][-1] == "INFO", "it is back"
    watching.cancel()
    await asyncio.wait([watching])
    await drive.close()
    await cable.pull()


async def test_a_drive_that_is_silent_for_a_day_is_told_in_a_few_records(log: pytest.LogCaptureFixture) -> None:
    far = ScriptedDrive()
    with await listen("silent", lambda: far) as listener:
        settings = DriveSettings(reconnect_slowest_s=600)
        drive = await compax_aio.connect(listener.url, name="x", settings=settings)
        log.set_level(logging.INFO, "compax_aio")
        log.clear()
        far.data_received = lambda data: None  # type: ignore[method-assign]
        watching = asyncio.ensure_future(_watch(drive))
        await asyncio.sleep(24 * 3600)
        important = [each for each in log.records if each.levelno >= logging.INFO]
        assert len(important) <= 6, [each.getMessage() for each in important]
        watching.cancel()
        await asyncio.wait([watching])
        await drive.close()


async def test_a_line_full_of_noise_is_counted_and_not_logged_piece_by_piece(log: pytest.LogCaptureFixture) -> None:
    drive, far = await opened(ScriptedDrive())
    log.clear()
    for _ in range(1000):
        far.transport.write(b"noise" + PROMPT)
        await asyncio.sleep(0.01)
    await asyncio.sleep(10)
    assert drive.stats.strays >= 1000
    assert len([each for each in log.records if each.levelno >= logging.INFO]) <= 10
    await drive.close()


async def _watch(drive: Drive) -> None:
    async for _ in drive.watch("position", "status", interval_s=300):
        pass


async def test_neither_a_password_nor_a_control_character_of_a_name_gets_into_a_log(
    log: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    cable = Cable("secret")
    await cable.plug(SimulatedDrive(name="x"))
    drive = await compax_aio.connect("loop://secret", name="x\nERROR forged\x1b[2J")
    await cable.pull()
    await asyncio.sleep(1)
    await drive.close()
    with pytest.raises(CompaxError):
        await compax_aio.connect("tcp://someone:secret-word@nowhere.invalid:4001", settings=DriveSettings())
    assert log.records
    for each in log.records:
        assert "secret-word" not in each.getMessage()
        assert each.getMessage().isprintable(), each.getMessage()
