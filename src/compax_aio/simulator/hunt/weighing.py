"""How much memory an object of the client keeps, all told: what it leads to, but not what it shares with everybody."""

from __future__ import annotations

import gc
import sys
from collections import deque
from types import FrameType, FunctionType, MethodType, ModuleType
from typing import Any, Final

__all__ = ["weigh"]

_SHARED: Final = (type, ModuleType, FunctionType, FrameType)
_CONTAINERS: Final = (dict, list, tuple, set, frozenset, deque, MethodType)
_TEXTS: Final = (bytes, bytearray, str)


def weigh(what: Any) -> int:
    """Count the bytes of *what*, of our objects that it leads to, and of the containers and texts in these."""
    seen: set[int] = {id(what)}
    waiting = [what]
    weight = 0
    while waiting:
        each = waiting.pop()
        weight += sys.getsizeof(each)
        for other in gc.get_referents(each):
            if id(other) not in seen and _is_its_own(other):
                seen.add(id(other))
                waiting.append(other)
    return weight


def _is_its_own(what: Any) -> bool:
    if isinstance(what, _SHARED):
        return False
    if isinstance(what, _CONTAINERS + _TEXTS):
        return True
    module = type(what).__module__
    # Those of the simulator are at the far end.
    return module.startswith("compax_aio.") and not module.startswith(("compax_aio.simulator", "compax_aio.transports"))
