"""Jobs of an independent program are taken apart byte for byte, and are found clean."""

from __future__ import annotations

import time

import pytest
from tests.camm1.little_plotter import segments
from tests.fakes.vpype_jobs import needs_vpype, vpype_job

from compax_aio.camm1.checking import Sheet, check
from compax_aio.camm1.language.instruction import Language
from compax_aio.camm1.language.job import instructions_of, parse
from compax_aio.camm1.language.splitting import split_long
from compax_aio.camm1.language.tracking import Tracker
from compax_aio.camm1.profiles import HP_7475A

pytestmark = needs_vpype

SIZES = [1_000, 30_000, 300_000]
LARGE = 5_000_000
A4_AND_MORE = Sheet(300, 300)


@pytest.mark.parametrize("is_absolute", [False, True])
@pytest.mark.parametrize("size_bytes", SIZES)
def test_a_real_job_is_its_instructions_and_clean(size_bytes: int, is_absolute: bool) -> None:
    data = vpype_job(size_bytes, is_absolute=is_absolute)
    job = parse(data, HP_7475A)
    assert job.data == data
    assert {each.language for each in job} == {Language.TWO, Language.BLANK}
    assert check(job, HP_7475A, A4_AND_MORE) == ()


def test_parts_of_a_real_job_draw_the_same_line() -> None:
    data = vpype_job(SIZES[1])
    plain = [each for each in parse(data, HP_7475A) if each.name not in ("DF", "PS", "SP")]
    parts = [part for each in plain for part in split_long(each)]
    assert len(parts) > len(plain)
    assert max(len(part.data) for part in parts) <= 240
    assert segments(b"".join(part.data for part in parts)) == segments(b"".join(each.data for each in plain))


def test_the_tool_is_followed_through_a_real_job() -> None:
    plain = [each for each in parse(vpype_job(SIZES[1]), HP_7475A) if each.name not in ("DF", "PS", "SP")]
    tracker = Tracker()
    for each in plain:
        tracker.follow(each)
    *_, (_, _, x, y, is_down) = segments(b"".join(each.data for each in plain))
    assert (tracker.x, tracker.y, tracker.tool_is_down) == (x, y, is_down)


@pytest.mark.parametrize("is_absolute", [False, True])
def test_a_job_of_5_mb_is_checked_as_it_comes_in_a_few_seconds(is_absolute: bool) -> None:
    data = vpype_job(LARGE, is_absolute=is_absolute)
    assert len(data) >= LARGE
    begun = time.process_time()
    assert check((data[at : at + 4096] for at in range(0, len(data), 4096)), HP_7475A, A4_AND_MORE) == ()
    assert time.process_time() - begun < 15  # 1 s on the machine it was written on
    at = 0
    for each in instructions_of([data], HP_7475A):
        assert data.startswith(each.data, at)
        at += len(each.data)
    assert at == len(data)
