"""
Who chooses the event loop of a test that asks for ``virtual_time``: pytest-asyncio and anyio are each told their way.

pytest-asyncio asks the hook ``pytest_asyncio_loop_factories``. Whoever implements it answers for every test of a
project, so it is implemented here for no longer than one test is collected. anyio reads the loop's factory from the
options in its fixture ``anyio_backend``, so the test is parametrized with that.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import pytest

from compax_aio.simulator.clock import VirtualClockLoop

from .virtual_time import VirtualTime

__all__ = ["chosen_for", "virtual_time_for"]

_FACTORY: Final = "virtual"
_ANYIO: Final = "anyio_backend"
_CHOSEN: pytest.StashKey[set[str]] = pytest.StashKey()
"""The tests whose loop was chosen here, by their node ids without parameters."""


_newest: VirtualClockLoop | None = None
"""The last loop that was made here, kept when it is closed: a fixture that ends later still asks for the time."""


def _new_loop() -> VirtualClockLoop:
    """Make the loop of a coroutine test; whoever calls this knows nothing of the test."""
    global _newest  # noqa: PLW0603
    _newest = VirtualClockLoop()
    return _newest


class _LoopsOfPytestAsyncio:
    """Answers pytest-asyncio for one test."""

    @pytest.hookimpl(optionalhook=True, tryfirst=True)
    def pytest_asyncio_loop_factories(
        self, config: pytest.Config, item: pytest.Item
    ) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
        """Give the test its virtual clock."""
        config.stash.setdefault(_CHOSEN, set()).add(item.nodeid)
        return {_FACTORY: _new_loop}


@contextmanager
def chosen_for(metafunc: pytest.Metafunc) -> Iterator[None]:
    """Choose the loop of one test while it is collected; not where it says itself on which loops it runs."""
    definition = metafunc.definition
    if _ANYIO in metafunc.fixturenames:
        if not any(_ANYIO in _names_of(mark) for mark in definition.iter_markers("parametrize")):
            backend = ("asyncio", {"loop_factory": _new_loop})
            values = [pytest.param(backend, id=getattr(pytest, "HIDDEN_PARAM", _FACTORY))]  # there since 8.4
            definition.add_marker(pytest.mark.parametrize(_ANYIO, values, scope="module"))
            metafunc.config.stash.setdefault(_CHOSEN, set()).add(definition.nodeid)
        yield
        return
    mark = definition.get_closest_marker("asyncio")
    if mark is not None and _FACTORY not in (mark.kwargs.get("loop_factories") or [_FACTORY]):
        yield
        return
    answering = _LoopsOfPytestAsyncio()
    metafunc.config.pluginmanager.register(answering)
    try:
        yield
    finally:
        metafunc.config.pluginmanager.unregister(answering)


def virtual_time_for(request: pytest.FixtureRequest) -> Iterator[VirtualTime]:
    """Give a test its time; a coroutine test whose loop could not be chosen fails, and is told why."""
    if not inspect.iscoroutinefunction(_function_of(request.node)):
        time = VirtualTime()
        with time.everywhere():
            yield time
        return
    if _nodeid_without_parameters(request.node) not in request.config.stash.get(_CHOSEN, set()):
        pytest.fail(_why_not(request), pytrace=False)
    of_another_test = _newest if _newest is not None and _newest.is_closed() else None
    yield VirtualTime(lambda: None if _newest is of_another_test else _newest)


def _why_not(request: pytest.FixtureRequest) -> str:
    said = "virtual_time cannot choose the event loop of this test: "
    if _ANYIO in request.fixturenames:
        return f"{said}it is parametrized with {_ANYIO} itself; leave that out"
    if not request.config.pluginmanager.hasplugin("asyncio"):
        return f"{said}nothing here runs coroutines; install pytest-asyncio 1.4 or newer, or mark it with anyio"
    mark = request.node.get_closest_marker("asyncio")
    if mark is None:
        return f"{said}mark it with @pytest.mark.asyncio, or set asyncio_mode = 'auto'"
    if mark.kwargs.get("loop_factories"):
        return f"{said}its mark names loop_factories; leave that out, or name {_FACTORY!r}"
    return f"{said}this pytest-asyncio asks nobody; it has to be 1.4 or newer"


def _function_of(node: Any) -> Any:
    function = node.function
    return getattr(getattr(function, "hypothesis", None), "inner_test", function)


def _nodeid_without_parameters(node: Any) -> str:
    return f"{node.parent.nodeid}::{node.originalname}"


def _names_of(mark: pytest.Mark) -> list[str]:
    names = mark.args[0] if mark.args else mark.kwargs.get("argnames", ())
    return [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
