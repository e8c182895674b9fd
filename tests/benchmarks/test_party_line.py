"""The benchmark of the party line measures what it says, and the page shows what it measures."""

from __future__ import annotations

import asyncio
import json
import logging
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.party_line import CLIENTS, HEAD, Rounds, main, ratios, rows
from benchmarks.party_line_far_end import KNOBS, floor_s

PAGE = Path(__file__).parents[2] / "docs" / "smc.md"
BARE, *OURS = CLIENTS


@pytest.mark.parametrize("client", CLIENTS)
async def test_in_simulated_time_nothing_is_lost_but_what_the_line_takes(
    client: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So the limit is computed right, and no client waits for anything but echoes."""
    loop = asyncio.get_running_loop()
    monkeypatch.setattr("benchmarks.party_line.time", SimpleNamespace(perf_counter=loop.time, process_time=loop.time))
    measured = Rounds()
    async with CLIENTS[client](f"sim://smc?axes={KNOBS.axes}&baudrate={KNOBS.baudrate}") as read:
        await measured.add(read, 10.0)
    assert measured.reads_per_s == pytest.approx([1 / floor_s()], rel=1e-3)


def test_ratios_are_of_medians() -> None:
    measured = {
        ("TCP", BARE): Rounds([40.0, 50.0, 90.0], [0.001, 0.002, 0.003]),
        ("TCP", OURS[0]): Rounds([1.0, 25.0, 26.0], [0.003, 0.003, 0.9]),
        ("TCP", OURS[1]): Rounds([50.0], [0.004]),
    }
    assert ratios(measured, "TCP", OURS[0]) == pytest.approx(
        {
            "reads_per_s": 25.0,
            "of_limit": 25.0 * floor_s(),
            "of_bare": 0.5,
            "cpu_ms_per_read": 3.0,
            "cpu_of_bare": 1.5,
        }
    )
    filled = rows(measured)
    assert {len(row) for row in filled} == {len(HEAD)}
    assert [row[1] for row in filled] == ["(limit)", *CLIENTS]


@pytest.fixture
def logging_as_before() -> Iterator[None]:
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.real_time
@pytest.mark.usefixtures("logging_as_before")
def test_the_program_prints_a_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--rounds", "1", "--round-s", "0.1"]) == 0
    *printed, last = capsys.readouterr().out.splitlines()
    assert sum(line.startswith(("| TCP", "| pty")) for line in printed) == 2 * (1 + len(CLIENTS))
    found = json.loads(last)
    assert [(each["line"], each["client"]) for each in found["measured"]] == [
        (line, client) for line in ("TCP", "pty") for client in CLIENTS
    ]
    assert all(0 < each["reads_per_s"] < found["limit_reads_per_s"] for each in found["measured"])


def test_the_table_of_the_page_fits_together() -> None:
    found = re.findall(
        r"^\| (TCP|pty) \| ([^|]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| [\d.]+ ms \|$", PAGE.read_text(), re.MULTILINE
    )
    assert [(line, client) for line, client, *_ in found] == [
        (line, client) for line in ("TCP", "pty") for client in ("bare `asyncio.Protocol`", *OURS)
    ]
    bare = {line: float(reads) for line, client, reads, *_ in found if client not in OURS}
    for line, _, reads, of_limit, of_bare in found:
        assert float(of_limit) == pytest.approx(float(reads) * floor_s(), abs=0.01)
        assert float(of_bare) == pytest.approx(float(reads) / bare[line], abs=0.01)
    assert f"or {1 / floor_s():.1f} readings a second" in PAGE.read_text()
