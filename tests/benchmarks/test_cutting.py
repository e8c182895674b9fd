"""The benchmark of cutting measures what it says: whole jobs through small buffers; the page shows what it measures."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.cutting import HEAD, SIZES, Outcome, job_of, main, measure, naive, rows

from compax_aio.camm1.pacing import HANDSHAKES, Handshake

PAGE = Path(__file__).parents[2] / "docs" / "camm1.md"
SMALL, LARGE = 200_000, 5_000_000


@pytest.fixture(autouse=True)
def logging_as_before() -> Iterator[None]:
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("handshake", HANDSHAKES)
def test_a_job_of_200_kb_is_cut_whole_and_the_wire_is_never_idle_for_long(handshake: Handshake, size: int) -> None:
    job = job_of(SMALL)
    outcome = measure(handshake, size, job)
    assert outcome.is_whole
    assert outcome.vectors == len(re.findall(r"\d;", job))
    assert outcome.wire_share >= 0.97


def test_a_job_of_5_mb_is_cut_whole() -> None:
    outcome = measure("xonxoff", 15_360, job_of(LARGE))
    assert outcome.is_whole
    assert outcome.wire_share >= 0.99


@pytest.mark.parametrize("size", SIZES[:3])
def test_a_sender_without_a_handshake_overflows_the_same_cutter(size: int) -> None:
    lost, is_whole = naive(size, job_of(20_000))
    assert lost > 10_000
    assert not is_whole


def test_the_table_is_printed_and_a_bad_outcome_is_an_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["--megabytes", "0.02", "--handshake", "enq1", "--buffer", "256"]
    assert main(arguments) in {0, 1}
    told = capsys.readouterr().out
    assert "| enq1" in told
    assert "bytes lost, cut whole: no" in told
    spoilt = Outcome("enq1", 256, 1, is_whole=False, wire_share=1.0, job_share=1.0, cpu_s=0.0)
    monkeypatch.setattr("benchmarks.cutting.measure", lambda *_: spoilt)
    assert main(arguments) == 1
    assert "YES" in capsys.readouterr().out


def test_the_page_shows_every_handshake_and_size() -> None:
    text = PAGE.read_text()
    assert all(f"| {each} " in text or f" {each} |" in text for each in HEAD[:5])
    for row in rows([Outcome(each, size, 0, True, 1.0, 1.0, 0.0) for each in HANDSHAKES for size in SIZES]):
        assert re.search(rf"\| {row[0]} +\| {row[1]} +\| 421,304 +\| none ", text), row
