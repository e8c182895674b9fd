"""Move AMS SMC stepper axes on a party line, a daisy chain or alone, and await the position reached."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from .axis import SmcAxis
    from .codecs import AxisStatus, LimitInputs, Listed, Port
    from .connecting import connect
    from .events import AxesReset, CommandDamaged
    from .facts import Mode
    from .moves import AxisMove
    from .own_copy import AxisSettings
    from .party_line import PartyLine
    from .profile import DCB_274, IM483I, MCPHERSON_789A4, PANTHER, PROFILES, Profile
    from .settings import SmcSettings

__all__ = [
    "DCB_274",
    "IM483I",
    "MCPHERSON_789A4",
    "PANTHER",
    "PROFILES",
    "AxesReset",
    "AxisMove",
    "AxisSettings",
    "AxisStatus",
    "CommandDamaged",
    "LimitInputs",
    "Listed",
    "Mode",
    "PartyLine",
    "Port",
    "Profile",
    "SmcAxis",
    "SmcSettings",
    "connect",
]

_HOMES: Final = {
    "axis": ("SmcAxis",),
    "codecs": ("AxisStatus", "LimitInputs", "Listed", "Port"),
    "connecting": ("connect",),
    "events": ("AxesReset", "CommandDamaged"),
    "facts": ("Mode",),
    "moves": ("AxisMove",),
    "own_copy": ("AxisSettings",),
    "party_line": ("PartyLine",),
    "profile": ("DCB_274", "IM483I", "MCPHERSON_789A4", "PANTHER", "PROFILES", "Profile"),
    "settings": ("SmcSettings",),
}


def __getattr__(name: str) -> Any:
    # Whoever wants no more than the facts, as a simulator does, gets no client with them.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f".{module}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
