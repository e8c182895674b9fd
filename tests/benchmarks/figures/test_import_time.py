"""What an import costs is read from what Python tells; nothing heavy comes with compax_aio."""

from __future__ import annotations

from benchmarks.figures.import_time import heavy_in, own_times

TOLD = """\
import time: self [us] | cumulative | imported package
import time:       253 |        253 |   _io
import time:      1500 |       2000 |     compax_aio.link.taps
something else that a module says
"""


def test_the_own_time_of_each_module_is_read() -> None:
    assert own_times(TOLD) == {"_io": 0.253, "compax_aio.link.taps": 1.5}


def test_a_heavy_module_is_found_by_itself_and_by_its_parts() -> None:
    assert heavy_in(["asyncio", "matplotlib.pyplot", "rich"]) == ["matplotlib", "rich"]
    assert heavy_in(["compax_aio", "compax_aio.compax.drive", "richer", "compax_aio.clipping"]) == []
