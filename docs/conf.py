"""How Sphinx builds the documents."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent / "src")]

project = "compax_aio"
author = "the compax_aio authors"
project_copyright = author

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "builtin_types",
    "state_diagrams",
    "tables_of_states",
    "tables_of_the_code",
]
exclude_patterns = ["_build", "_ext"]
html_theme = "furo"
html_title = "compax_aio"

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_use_ivar = True
napoleon_custom_sections = [("Raises (when awaited or entered)", "returns_style")]
