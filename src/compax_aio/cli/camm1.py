"""``compax camm1``: jobs for Roland CAMM-1 cutters checked, drawn and cut; cutters looked at, and simulated."""

from __future__ import annotations

from cyclopts import App

from .cutting.cutting import cut
from .cutting.looking import info
from .cutting.looking_at_jobs import check, preview
from .cutting.stopping import stop
from .sim import serve_camm1

__all__ = ["app"]

app = App(
    name="camm1",
    help="""\
Cut on Roland CAMM-1 cutters and their relatives, or plot on HP plotters.

Begin with `compax camm1 check FILE` and `compax camm1 preview FILE`, which need no machine, and `compax camm1 info
URL`, which moves nothing. An abort from software is no emergency stop: have one within reach.
""",
)
app.command(cut)
app.command(check)
app.command(preview)
app.command(info)
app.command(stop)
app.command(serve_camm1, name="sim")
