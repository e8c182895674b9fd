"""The plugin gives users' tests what it promises, whoever runs their coroutines, and leaves all others alone."""

from __future__ import annotations

import subprocess
import sys

import pytest

# Imported here, for pytester forgets what is imported for the first time in a run of it.
from compax_aio.testing import event_loops, faults, stage  # noqa: F401

pytest_plugins = ["pytester"]

OURS = "import sys; print('imported', sorted(name for name in sys.modules if name.startswith('compax_aio')))"

APPLICATION = """
import asyncio
import compax_aio
import pytest

async def application(url):
    async with compax_aio.connect(url, name="x") as x:
        await x.move_to(100)
        await asyncio.sleep(3600)

def name_of_loop():
    return type(asyncio.get_running_loop()).__name__
"""


def run(pytester: pytest.Pytester, test: str, *arguments: str, mode: str = "strict") -> pytest.RunResult:
    """Run a test of a project of its own, in which warnings are errors."""
    pytester.makepyfile(application=APPLICATION)
    pytester.makeini(
        "[pytest]\nasyncio_default_fixture_loop_scope = function\nfilterwarnings = error\n"
        f"asyncio_mode = {mode}\npythonpath = .\n"
    )
    pytester.makepyfile("from application import *\n" + test)
    return pytester.runpytest_inprocess("-p", "no:cacheprovider", *arguments)


def test_the_time_is_told_outside_of_the_loop_as_well(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
@pytest.fixture
def looked_at(virtual_time):
    assert virtual_time.now == 0
    yield
    assert virtual_time.now == 3600

@pytest.mark.parametrize("again", [1, 2])
async def test_an_hour(looked_at, again):
    await asyncio.sleep(3600)
""",
        mode="auto",
    ).assert_outcomes(passed=2)


@pytest.mark.parametrize("mode", ["strict", "auto"])
def test_a_coroutine_test_runs_in_virtual_time(pytester: pytest.Pytester, mode: str) -> None:
    mark = "@pytest.mark.asyncio" if mode == "strict" else ""
    result = run(
        pytester,
        f"""
{mark}
async def test_an_hour(simulated_drive, virtual_time):
    assert virtual_time.now == 0
    await application(simulated_drive.url)
    assert 3600 < virtual_time.now < 3602
    simulated_drive.assert_standing()

{mark}
async def test_another_one():
    assert name_of_loop() == "_UnixSelectorEventLoop"
""",
        "-v",
        mode=mode,
    )
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*::test_an_hour PASSED*", "*::test_another_one PASSED*"])


def test_loops_may_be_wider_than_a_test(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
pytestmark = pytest.mark.asyncio(loop_scope="module")

async def test_an_hour(simulated_drive, virtual_time):
    await application(simulated_drive.url)

async def test_another_hour(simulated_drive, virtual_time):
    assert virtual_time.now > 3600
    assert not simulated_drive.motions
    await application(simulated_drive.url)
""",
    ).assert_outcomes(passed=2)


def test_asynchronous_fixtures_are_on_the_clock_of_their_test(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
@pytest.fixture
async def x(virtual_time, simulated_drive):
    async with compax_aio.connect(simulated_drive.url) as x:
        yield x
    assert virtual_time.now > 60

@pytest.fixture(params=[1, 2])
def target(request):
    return request.param

async def test_it(x, simulated_drive, target):
    await x.move_to(target)
    await asyncio.sleep(60)

@pytest.mark.usefixtures("virtual_time")
class TestMany:
    @pytest.mark.parametrize("hours", [1, 2])
    async def test_it(self, hours):
        await asyncio.sleep(3600 * hours)
""",
        mode="auto",
    ).assert_outcomes(passed=4)


def test_the_loops_of_the_project_stay_as_they_are(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
import asyncio
import pytest

class TheirLoop(asyncio.SelectorEventLoop):
    pass

@pytest.hookimpl(tryfirst=True)
def pytest_asyncio_loop_factories(config, item):
    return {"theirs": TheirLoop, "other": asyncio.SelectorEventLoop}
"""
    )
    result = run(
        pytester,
        """
async def test_theirs():
    assert name_of_loop() in {"TheirLoop", "_UnixSelectorEventLoop"}

async def test_ours(virtual_time):
    await asyncio.sleep(3600)

@pytest.mark.asyncio(loop_factories=["virtual"])
async def test_named(virtual_time):
    await asyncio.sleep(3600)

@pytest.mark.asyncio(loop_factories=["theirs"])
async def test_contradicting(virtual_time):
    pass
""",
        mode="auto",
    )
    result.assert_outcomes(passed=4, errors=1)
    result.stdout.fnmatch_lines(["virtual_time cannot choose *its mark names loop_factories; leave that out*"])


def test_anyio_runs_it_in_virtual_time(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
pytestmark = pytest.mark.anyio

@pytest.fixture
def anyio_backend():
    return "asyncio"

@pytest.fixture
async def x(simulated_drive):
    async with compax_aio.connect(simulated_drive.url) as x:
        yield x

async def test_an_hour(x, virtual_time):
    await x.move_to(10)
    await asyncio.sleep(3600)

async def test_another_one():
    assert name_of_loop() == "_UnixSelectorEventLoop"

@pytest.mark.parametrize("anyio_backend", ["asyncio"])
async def test_contradicting(virtual_time):
    pass
""",
        *("-v", "-p", "no:asyncio", "-o", "asyncio_mode=", "-W", "ignore::pytest.PytestConfigWarning"),
    )
    result.assert_outcomes(passed=2, errors=1)
    result.stdout.fnmatch_lines(["*::test_an_hour PASSED*", "*it is parametrized with anyio_backend itself*"])


def test_anyio_needs_no_fixture_of_the_project(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
@pytest.mark.anyio
async def test_an_hour(simulated_drive, virtual_time):
    await application(simulated_drive.url)
""",
    ).assert_outcomes(passed=1)


def test_a_test_that_is_no_coroutine_runs_what_calls_asyncio_run(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
def main(url):
    asyncio.run(application(url))
    return 0

def test_main(simulated_drive, virtual_time):
    assert main(simulated_drive.url) == 0
    assert 3600 < virtual_time.now < 3602
    with asyncio.Runner() as runner:
        assert runner.run(asyncio.sleep(3600, name_of_loop)) is name_of_loop
    assert virtual_time.now > 7200
    assert virtual_time.run(asyncio.sleep(3600, 5)) == 5
    assert repr(virtual_time).startswith("<VirtualTime 1080")
    simulated_drive.assert_standing()

def test_later():
    async def name():
        return name_of_loop()
    assert asyncio.run(name()) == "_UnixSelectorEventLoop"
""",
    ).assert_outcomes(passed=2)


def test_who_makes_a_loop_of_their_own_is_told(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
def test_it(virtual_time):
    async def look():
        return virtual_time.now
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        runner.run(look())
""",
    )
    result.stdout.fnmatch_lines(["*RuntimeError: this test asks for virtual_time, but runs on a *SelectorEventLoop*"])


def test_without_anybody_who_runs_coroutines_it_says_what_to_install(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        "async def test_it(virtual_time):\n    pass\n",
        *("-p", "no:asyncio", "-p", "no:anyio", "-W", "ignore::pytest.PytestConfigWarning"),
    )
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["*nothing here runs coroutines; install pytest-asyncio 1.4 or newer, or mark it with*"]
    )


def test_without_its_mark_it_says_which(pytester: pytest.Pytester) -> None:
    result = run(pytester, "async def test_it(virtual_time):\n    pass\n")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*mark it with @pytest.mark.asyncio, or set asyncio_mode = 'auto'*"])


def test_an_older_pytest_asyncio_is_told(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that asks no hook."""
    monkeypatch.setattr("pytest_asyncio.plugin._collect_hook_loop_factories", lambda *_: None)
    result = run(pytester, "@pytest.mark.asyncio\nasync def test_it(virtual_time):\n    pass\n")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*this pytest-asyncio asks nobody; it has to be 1.4 or newer*"])


def test_what_the_drives_have_seen_is_told_with_a_test_that_failed(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
async def test_it(simulated_drive, faults, virtual_time):
    faults.at(0.1).lose_position_reached()
    await application(simulated_drive.url)
    simulated_drive.assert_stopped()

async def test_well(simulated_drive, virtual_time):
    await application(simulated_drive.url)
""",
        "-rP",
        mode="auto",
    )
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(
        [
            "E * AssertionError: drive was not stopped: * POSA 100: reached at 100 after *",
            "*- simulated drive drive -*",
            "*motion reached   100.00",
            "*- faults -*",
            "*0.100 s  drive: 1 times position reached lost",
        ]
    )
    assert result.stdout.str().count("- simulated drive drive -") == 1


def test_knobs_come_from_a_fixture_of_the_project(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
@pytest.fixture
def simulated_drive_knobs():
    return {"position": 12.5}

def test_it(simulated_drive):
    assert simulated_drive.position == 12.5
""",
    ).assert_outcomes(passed=1)


def test_hypothesis_draws_in_virtual_time(pytester: pytest.Pytester) -> None:
    run(
        pytester,
        """
from hypothesis import HealthCheck, given, settings, strategies

@given(hours=strategies.integers(1, 5))
@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.asyncio
async def test_it(virtual_time, hours):
    await asyncio.sleep(3600 * hours)
""",
    ).assert_outcomes(passed=1)


# Who does not use it


def test_a_project_that_does_not_use_it_notices_nothing(pytester: pytest.Pytester) -> None:
    """No simulator is imported, nor anything of the client that importing the package does not import anyway."""
    bare = subprocess.run(
        [sys.executable, "-c", f"import compax_aio; {OURS}"], capture_output=True, text=True, timeout=60, check=True
    )
    pytester.makepyfile(f"def test_it():\n    {OURS}\n\nasync def test_coroutine():\n    pass\n")
    result = pytester.runpytest_subprocess("-s", "-p", "no:asyncio", "-k", "test_it", timeout=60)
    result.assert_outcomes(passed=1, deselected=1)
    told = next(line for line in result.outlines if "imported" in line)
    here = set(told.split("imported ")[1].strip("[].").replace("'", "").split(", "))
    there = set(bare.stdout.split("imported ")[1].strip("[]\n").replace("'", "").split(", "))
    assert here - there == {"compax_aio.testing", "compax_aio.testing.plugin"}


def test_it_adds_nothing_to_the_project_but_its_fixtures(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("")
    for question in ("--markers", "--help"):
        told = pytester.runpytest_subprocess(question, timeout=60).stdout.str()
        assert "compax" not in told.replace("compax_aio.testing.plugin", "").replace("compax-aio", "").lower()
    told = pytester.runpytest_subprocess("--fixtures", timeout=60).stdout.str()
    for fixture in ("faults", "simulated_drive", "simulated_drive_knobs", "simulated_group", "virtual_time"):
        assert f"\n{fixture} -- " in told
