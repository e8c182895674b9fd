"""The command runs on the event loop of Python here, as most tests let that one's clock be virtual."""

from __future__ import annotations

import os

import pytest


@pytest.fixture(autouse=True)
def loop_of_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless it is asked otherwise: ``COMPAX_LOOP=uvloop`` tries what runs in real time on that, if it is installed."""
    if "COMPAX_LOOP" not in os.environ:
        monkeypatch.setenv("COMPAX_LOOP", "asyncio")
