"""
What pytest finds of the test kit: its fixtures, and who gives a test the event loop that ``virtual_time`` promises.

pytest imports this module in every project in which compax_aio is installed. So it imports nothing else of it before
a test asks for one of its fixtures, and does nothing to tests that do not.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .faults import Faults
    from .simulated import SimulatedAxis, SimulatedGroup
    from .stage import Stage
    from .virtual_time import VirtualTime

__all__ = ["faults", "simulated_drive", "simulated_drive_knobs", "simulated_group", "virtual_time"]

_STAGE: pytest.StashKey[Stage] = pytest.StashKey()


@pytest.fixture
def _compax_stage(request: pytest.FixtureRequest) -> Iterator[Stage]:
    from .stage import Stage  # noqa: PLC0415  # not before a test needs it

    with Stage.set() as stage:
        request.node.stash[_STAGE] = stage
        yield stage


@pytest.fixture
def simulated_drive_knobs() -> Mapping[str, Any]:
    """
    Say what ``simulated_drive`` is like; to be overridden in a module, a class or a conftest.py.

    Names and values are those of compax_aio.simulator.compax.Knobs: ``{"machine_zero": -40.0, "travel_max": 300.0}``.
    """
    return {}


@pytest.fixture
def simulated_drive(_compax_stage: Stage, simulated_drive_knobs: Mapping[str, Any]) -> SimulatedAxis:
    """
    Give a simulated COMPAX drive: its ``url`` for the application, and what it has been told and has done.

    See compax_aio.testing.SimulatedAxis; ``simulated_drive_knobs`` says what it is like.
    """
    return _compax_stage.group.add("drive", **simulated_drive_knobs)


@pytest.fixture
def simulated_group(_compax_stage: Stage) -> SimulatedGroup:
    """
    Give a mapping of simulated drives, at first without any: ``simulated_group.add("x", "y", travel_max=300.0)``.

    See compax_aio.testing.SimulatedGroup; ``urls`` is what ``DriveGroup.connect`` takes.
    """
    return _compax_stage.group


@pytest.fixture
def faults(_compax_stage: Stage) -> Iterator[Faults]:
    """
    Make trouble: ``faults.at(2.5).cut_line(for_s=1)``; all of it is undone at the end of the test.

    See compax_aio.testing.Faults.
    """
    from .faults import Faults  # noqa: PLC0415

    yield Faults(_compax_stage)
    _compax_stage.undo()


@pytest.fixture
def virtual_time(request: pytest.FixtureRequest) -> Iterator[VirtualTime]:
    """
    Let the test run in virtual time: simulated hours take milliseconds.

    Coroutine tests of pytest-asyncio (1.4 or newer) and anyio run on a virtual clock; so does what calls
    ``asyncio.run`` in a test that is no coroutine. See compax_aio.testing.VirtualTime.
    """
    from . import event_loops  # noqa: PLC0415

    yield from event_loops.virtual_time_for(request)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> Generator[None, object, object]:
    """Before the plugins that run coroutines choose the loop of a test with ``virtual_time``, choose it for them."""
    if "virtual_time" not in metafunc.fixturenames:
        return (yield)
    from . import event_loops  # noqa: PLC0415

    with event_loops.chosen_for(metafunc):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Tell with a test that failed what its simulated drives have seen."""
    report = yield
    if report.failed and (stage := item.stash.get(_STAGE, None)) is not None:
        report.sections.extend(stage.sections())
    return report
