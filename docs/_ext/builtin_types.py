"""Types of Python itself in signatures: never linked to an attribute that happens to bear the same name."""

from __future__ import annotations

import builtins
from typing import Any, Final

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

__all__ = ["setup"]

_TYPES: Final = frozenset(name for name, value in vars(builtins).items() if isinstance(value, type))


def _say_whose_they_are(_app: Sphinx, doctree: nodes.document) -> None:
    for reference in doctree.findall(pending_xref):
        if reference["refdomain"] == "py" and reference["reftype"] == "class" and reference["reftarget"] in _TYPES:
            reference["reftarget"] = f"builtins.{reference['reftarget']}"


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("doctree-read", _say_whose_they_are)
    return {"parallel_read_safe": True}
