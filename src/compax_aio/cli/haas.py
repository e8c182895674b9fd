"""``compax haas``: files that go to Haas CNC controls and come from them, what controls say, and simulated ones."""

from __future__ import annotations

from cyclopts import App

from .exchanging.asking import query
from .exchanging.looking_at_files import check, compare
from .exchanging.receiving import receive
from .exchanging.sending import send
from .exchanging.watching import watch
from .sim import serve_haas

__all__ = ["app"]

app = App(
    name="haas",
    help="""\
Exchange programs and data with Haas CNC controls over RS-232, and ask what the machine does.

Begin with `compax haas check FILE`, which needs no machine, and `compax haas receive URL program`, which changes
nothing at the control. Both ends must agree on Settings 11 to 14, 25 and 37: `--profile` says them. Somebody has to
press SEND or RECV at the control; when, is said.

What was sent is not stored before the control's screen says so, or it was read back (`--verify`). Wrong parameters take
effect in spite of an alarm.
""",
)
app.command(receive)
app.command(send)
app.command(check)
app.command(compare, name="diff")
app.command(query)
app.command(watch)
app.command(serve_haas, name="sim")
