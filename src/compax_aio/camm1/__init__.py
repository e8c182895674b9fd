"""Cut on Roland CAMM-1 cutters and their relatives, through a buffer that never overflows."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from ..certainty import Certainty
    from .previewing.drawing import Drawing
    from .previewing.preview import preview

__all__ = ["Certainty", "Drawing", "preview"]

_HOMES: Final[dict[str, tuple[str, ...]]] = {
    "..certainty": ("Certainty",),
    ".previewing.drawing": ("Drawing",),
    ".previewing.preview": ("preview",),
}
"""Where each name is; whoever adds a module adds its names here, in __all__, and above."""


def __getattr__(name: str) -> Any:
    # Whoever wants no more than the facts, as a simulator does, gets no client with them.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
