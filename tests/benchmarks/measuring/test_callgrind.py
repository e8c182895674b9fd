"""What callgrind writes is read; and where it is installed, a fixed run counts the same twice."""

from __future__ import annotations

import pytest
from benchmarks.far_ends.canned import HOST
from benchmarks.measuring import far_end
from benchmarks.measuring.callgrind import Counted, count_runs, count_whole, is_installed, read_part

PART = """\
# callgrind format
events: Ir

fn=(1) main
10 5
cfn=(2) _PyObject_Malloc
calls=3 0
11 30
cfn=(3) strlen
calls=100 0
12 7

fn=(2)
1 30

fn=(4) list_append
cfn=(2)
calls=4 0
2 40
cfn=(5) _PyObject_Malloc'2
calls=1 0
2 40

totals: 1234
"""


def test_instructions_and_allocations_are_read() -> None:
    assert read_part(PART) == Counted(instructions=1234, allocations=8)


def test_where_functions_have_no_names_allocations_are_unknown() -> None:
    nameless = "\n".join(line for line in PART.splitlines() if "_PyObject" not in line)
    assert read_part(nameless) == Counted(instructions=1234, allocations=None)


@pytest.mark.real_time
@pytest.mark.skipif(not is_installed(), reason="valgrind is not installed")
def test_a_fixed_run_counts_the_same_twice() -> None:
    with far_end("benchmarks.far_ends.canned", "0") as far:
        runs = count_runs(
            "benchmarks.measuring.counted_run", ["floor", HOST, str(far.where["tcp"]), "20", "40", "20", "40"]
        )
    assert len(runs) == 4
    first, second = (runs[each + 1].instructions - runs[each].instructions for each in (0, 2))
    assert first == pytest.approx(second, rel=0.05)
    assert runs[1].instructions == pytest.approx(2 * runs[0].instructions, rel=0.2)


@pytest.mark.real_time
@pytest.mark.skipif(not is_installed(), reason="valgrind is not installed")
def test_a_run_that_fails_is_an_error_that_says_what_it_said() -> None:
    with pytest.raises(RuntimeError, match="a bad day"):
        count_whole(["-S", "-E", "-c", "raise SystemExit('a bad day')"])
