"""
Every asynchronous test runs on a virtual clock, unless it is marked ``real_time``.

Property tests draw the same examples every time; ``HYPOTHESIS_PROFILE=explore`` draws new ones. The command runs on the
event loop of Python, as most tests let that one's clock be virtual; ``COMPAX_LOOP=uvloop`` tries what runs in real time
on uvloop, if it is installed.
"""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable, Mapping

import pytest
from hypothesis import settings

from compax_aio.simulator.clock import VirtualClockLoop

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", max_examples=2000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

os.environ.setdefault("COMPAX_LOOP", "asyncio")  # for programs that tests start, too


def pytest_configure() -> None:
    """Heed Ctrl-C, here and in the programs that tests start: who runs us in the background may have it ignored."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Give each test the loop whose time it needs."""
    if item.get_closest_marker("real_time"):
        return {"real": asyncio.new_event_loop}
    return {"virtual": VirtualClockLoop}
