"""What the tests of cutters share."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
from tests.promises.bench import watch_what_is_left_behind


@pytest.fixture
async def nothing_left_behind() -> AsyncIterator[None]:
    """After the test no task is left over, and asyncio has nothing to complain about."""
    async with watch_what_is_left_behind():
        yield
