"""Cut on Roland CAMM-1 cutters and their relatives, through a buffer that never overflows."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from ..certainty import Certainty
    from ..severity import Severity
    from .checking import Checker, Problem, Sheet, check, raise_for_errors
    from .connecting import connect
    from .cut import Cut, CutAccount, CutProgress, CutResult
    from .cutter import Cutter
    from .events import CutBegun, CutEnded, CutterError, CutterPaused, CutterReset, CutterResumed
    from .language.instruction import Instruction, Language
    from .language.job import Job, parse
    from .previewing.drawing import Drawing
    from .previewing.preview import preview
    from .profiles import (
        CX_24,
        DXY_1300,
        GS_24,
        HP_7470A,
        HP_7475A,
        PNC_900,
        PNC_1050,
        PNC_1200,
        PNC_1410,
        PNC_1600,
        PNC_1610,
        PROFILES,
        Profile,
        profile_named,
    )
    from .replies import CutterStatus
    from .settings import CutterSettings
    from .vocabulary import JobSettings

__all__ = [
    "CX_24",
    "DXY_1300",
    "GS_24",
    "HP_7470A",
    "HP_7475A",
    "PNC_900",
    "PNC_1050",
    "PNC_1200",
    "PNC_1410",
    "PNC_1600",
    "PNC_1610",
    "PROFILES",
    "Certainty",
    "Checker",
    "Cut",
    "CutAccount",
    "CutBegun",
    "CutEnded",
    "CutProgress",
    "CutResult",
    "Cutter",
    "CutterError",
    "CutterPaused",
    "CutterReset",
    "CutterResumed",
    "CutterSettings",
    "CutterStatus",
    "Drawing",
    "Instruction",
    "Job",
    "JobSettings",
    "Language",
    "Problem",
    "Profile",
    "Severity",
    "Sheet",
    "check",
    "connect",
    "parse",
    "preview",
    "profile_named",
    "raise_for_errors",
]

_HOMES: Final[dict[str, tuple[str, ...]]] = {
    "..certainty": ("Certainty",),
    "..severity": ("Severity",),
    ".checking": ("Checker", "Problem", "Sheet", "check", "raise_for_errors"),
    ".connecting": ("connect",),
    ".cut": ("Cut", "CutAccount", "CutProgress", "CutResult"),
    ".cutter": ("Cutter",),
    ".events": ("CutBegun", "CutEnded", "CutterError", "CutterPaused", "CutterReset", "CutterResumed"),
    ".language.instruction": ("Instruction", "Language"),
    ".language.job": ("Job", "parse"),
    ".previewing.drawing": ("Drawing",),
    ".previewing.preview": ("preview",),
    ".profiles": (
        "CX_24", "DXY_1300", "GS_24", "HP_7470A", "HP_7475A", "PNC_900", "PNC_1050", "PNC_1200", "PNC_1410", "PNC_1600",
        "PNC_1610", "PROFILES", "Profile", "profile_named",
    ),
    ".replies": ("CutterStatus",),
    ".settings": ("CutterSettings",),
    ".vocabulary": ("JobSettings",),
}  # fmt: skip
"""Where each name is, never in a module of that name; new names go here, in __all__, and above."""


def __getattr__(name: str) -> Any:
    # Whoever wants no more than the facts, as a simulator does, gets no client with them.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
