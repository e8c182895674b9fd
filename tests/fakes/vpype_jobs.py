"""Jobs that an independent program has written: vpype's writer of HP-GL, in a process of its own."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from functools import cache
from typing import Final

import pytest

__all__ = ["needs_vpype", "vpype_job"]

needs_vpype: Final = pytest.mark.skipif(
    importlib.util.find_spec("vpype") is None, reason="vpype is not installed: it is not made for this Python"
)

_SHEET_MM: Final = (297, 210)

_PROGRAM: Final = """
import io, sys
import numpy as np
import vpype

size_bytes, is_absolute = int(sys.argv[1]), sys.argv[2] == "absolute"
random = np.random.default_rng(size_bytes)
mm = 96 / 25.4
lines = vpype.LineCollection()
written = 0
while written < size_bytes:
    count = int(random.integers(2, 400))
    angles = np.linspace(0, 2 * np.pi, count)
    centre = complex(random.uniform(40, 240), random.uniform(40, 160)) * mm
    radius, teeth = random.uniform(5, 20) * mm, random.integers(2, 9)
    lines.append(centre + radius * (np.exp(1j * angles) + np.exp(-1j * teeth * angles) / 3))
    written += int(count * (9.8 if is_absolute else 6))
document = vpype.Document(page_size=(297 * mm, 210 * mm))
document.add(lines, 1)
out = io.StringIO()
vpype.write_hpgl(out, document, "a4", True, False, "hp7475a", None, is_absolute, True)
sys.stdout.write(out.getvalue())
"""


@cache
def vpype_job(size_bytes: int, *, is_absolute: bool = False) -> bytes:
    """
    Return a job of closed curves on A4 for an HP 7475A, of *size_bytes* or a little more, always the same.

    Its lists of coordinates are of all lengths up to some 4 KB; they are relative, as vpype writes them, or absolute.
    """
    command = [sys.executable, "-c", _PROGRAM, str(size_bytes), "absolute" if is_absolute else "relative"]
    return subprocess.run(command, check=True, capture_output=True, timeout=300).stdout
