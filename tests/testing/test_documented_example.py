"""The tests on the page about testing are tests: put into one file, they run and hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

# Imported here, for pytester forgets what is imported for the first time in a run of it.
from compax_aio.testing import event_loops, faults, stage  # noqa: F401

pytest_plugins = ["pytester"]

PAGE = (Path(__file__).parents[2] / "docs" / "testing-your-application.md").read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def written(pytester: pytest.Pytester, code: str, *arguments: str) -> pytest.RunResult:
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function\nfilterwarnings = error\n")
    pytester.makepyfile(test_carry=code)
    return pytester.runpytest_inprocess("-p", "no:cacheprovider", *arguments)


def test_they_hold(pytester: pytest.Pytester) -> None:
    result = written(pytester, "\n\n".join(BLOCKS))
    result.assert_outcomes(passed=3 + 5 + 30 + 3)


@pytest.mark.parametrize(
    ("right", "wrong", "found_by"),
    [
        ("PLACE = 20.0, 320.0", "PLACE = 20.0, 390.0", "test_parts_are_carried"),
        ("GRIPPER, 0)\n    return", "GRIPPER, 1)\n    return", "test_parts_are_carried"),
        ("return part  #", "await gantry.output(GRIPPER, 0)\n                return part  #", "test_no_part_falls_*"),
        ("speed_percent=80)", "speed_percent=80, on_cancel='detach')", "test_cancelling_*"),
        (
            "async with compax_aio.connect(url) as",
            "if gantry := await compax_aio.connect(url):  #",
            "test_cancelling_*",
        ),
    ],
)
def test_they_find_what_is_wrong_in_the_application(
    pytester: pytest.Pytester, right: str, wrong: str, found_by: str
) -> None:
    application, *tests = BLOCKS
    application = application.replace(', name="gantry"', "")
    assert right in application
    result = written(pytester, "\n\n".join([application.replace(right, wrong), *tests]), "-k", "not whatever")
    result.stdout.fnmatch_lines([f"FAILED test_carry.py::{found_by}*"])
