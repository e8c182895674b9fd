"""The size of the sheet that a job is checked against, as it is typed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Any, Final

from cyclopts import Parameter, Token

from compax_aio import camm1

__all__ = ["SheetSize"]

_SIZE: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*[xX*\u00d7]\s*([0-9]+(?:\.[0-9]+)?)")


def _sheet(_kind: Any, tokens: Sequence[Token]) -> camm1.Sheet:
    """Read ``400x280``."""
    text = tokens[0].value
    found = _SIZE.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is no size of a sheet; write mm along x and y, as in 400x280")
    return camm1.Sheet(float(found[1]), float(found[2]))


SheetSize = Annotated[
    camm1.Sheet | None,
    Parameter(
        name="--sheet",
        converter=_sheet,
        n_tokens=1,
        accepts_keys=False,
        help="What lies in the machine: mm along x and y, as in 400x280.",
    ),
]
