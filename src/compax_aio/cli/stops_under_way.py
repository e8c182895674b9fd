"""Stops that are under way when a command is interrupted: they are let come to their end, if they do so soon."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import TypeVar

__all__ = ["let_end"]

_Outcome = TypeVar("_Outcome")


async def let_end(
    stops: Mapping[str, asyncio.Task[_Outcome]], patience_s: float, has_stopped: Callable[[_Outcome], bool]
) -> list[str]:
    """
    Wait for stops, and end those that take longer than *patience_s*.

    Args:
        stops: By what they stop.
        patience_s: For all of them.
        has_stopped: Whether an outcome says that it stands.

    Returns:
        Of which it is not known whether they stand.
    """
    if stops:
        _, unfinished = await asyncio.wait(stops.values(), timeout=patience_s)
        for task in unfinished:
            task.cancel()
        if unfinished:
            await asyncio.wait(unfinished)
    return [
        name
        for name, task in stops.items()
        if task.cancelled() or task.exception() is not None or not has_stopped(task.result())
    ]
