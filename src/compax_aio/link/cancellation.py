"""Work that is carried through although its caller is cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

import anyio

__all__ = ["despite_cancellation"]


async def despite_cancellation(work: Coroutine[Any, Any, None]) -> None:
    """Await *work* to its end; a cancellation that comes meanwhile, of asyncio or anyio, takes effect afterwards."""
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    with anyio.CancelScope(shield=True):
        while not task.done():
            try:
                await asyncio.wait([task])
            except asyncio.CancelledError as error:
                cancelled = error
    if cancelled is None or (not task.cancelled() and task.exception() is not None):
        task.result()
    if cancelled is not None:
        raise cancelled
