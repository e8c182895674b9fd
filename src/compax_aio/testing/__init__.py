"""
The test kit for users' own projects: simulated drives, virtual time and faults for pytest.

The fixtures are found by themselves (see :mod:`compax_aio.testing.plugin`); this package offers the classes of what
they give, for annotations. Nothing is imported before it is used, for pytest imports this package in every project.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from .faults import Faults
    from .motions import Motion
    from .simulated import SimulatedAxis, SimulatedGroup
    from .virtual_time import VirtualTime

__all__ = ["Faults", "Motion", "SimulatedAxis", "SimulatedGroup", "VirtualTime"]

_HOMES: Final = {
    "Faults": ".faults",
    "Motion": ".motions",
    "SimulatedAxis": ".simulated",
    "SimulatedGroup": ".simulated",
    "VirtualTime": ".virtual_time",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)
