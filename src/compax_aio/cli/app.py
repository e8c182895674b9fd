"""All commands of ``compax`` by name; each is imported when it is called."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Final

from cyclopts import App, Group

from .running import run_words

__all__ = ["app", "run"]

_LOOK: Final = Group("Look (moves nothing)", sort_key=1)
_MOVE: Final = Group("Move", sort_key=2)
_CONFIGURE: Final = Group("Configure", sort_key=3)
_SIT: Final = Group("Sit at the machine", sort_key=4)
_RECORD: Final = Group("Record and draw", sort_key=5)
_SIMULATE: Final = Group("Without a machine", sort_key=6)
_MORE: Final = Group("More", sort_key=7)

app = App(
    name="compax",
    help="""\
Move Parker Hauser COMPAX servo drives and AMS SMC steppers, cut on Roland CAMM-1 cutters, and exchange programs with
Haas CNC controls, from the terminal.

Every command takes the URL of a line: serial:///dev/ttyUSB0, tcp://192.168.1.50:4001, sim://compax. Begin with
`compax ports`, then `compax probe URL`, which moves nothing.

A stop from software is no emergency stop: have one in hardware, within reach.
""",
    version=lambda: version("compax-aio"),
    help_format="markdown",
)

_COMMANDS: Final = (
    (_LOOK, "ports", "ports:ports", "List the serial ports of this computer."),
    (_LOOK, "probe", "probe:probe", "Find out how a drive talks, and write it to a settings file."),
    (_LOOK, "info", "info:info", "Say who a drive is: firmware, axis, interface, error history."),
    (_LOOK, "status", "status:status", "Say how a drive stands, once or again and again."),
    (_MOVE, "move", "move:move", "Move to a position, or by a distance, and wait until it is reached."),
    (_MOVE, "home", "home:home", "Find machine zero."),
    (_MOVE, "jog", "jog:jog", "Move in small steps by the arrow keys."),
    (_MOVE, "stop", "stop:stop", "Stop one drive or several, all at once."),
    (_CONFIGURE, "params", "params:app", "Read, write, save, compare and restore parameters."),
    (_CONFIGURE, "program", "program:app", "Check, print, upload, download and run programs."),
    (_SIT, "shell", "shell:shell", "Talk to a drive line by line, with completion and help."),
    (_SIT, "monitor", "monitor:monitor", "Watch axes on a screen, and stop, jog and home them by keys."),
    (_RECORD, "record", "record:record", "Record position, following error, speed and torque to a file."),
    (_RECORD, "plot", "plot:plot", "Draw what was recorded."),
    (_RECORD, "replay", "replay:replay", "Show a recorded conversation as it went."),
    (_RECORD, "trace", "trace:app", "Check a recorded conversation against the promises."),
    (_SIMULATE, "sim", "sim:app", "Serve simulated devices on pseudo-terminals or TCP."),
    (_SIMULATE, "demo", "demo:demo", "Home and move three simulated drives at once."),
    (_MORE, "smc", "smc:app", "AMS SMC steppers: scan, status, move, stop, programs."),
    (_MORE, "camm1", "camm1:app", "Roland CAMM-1 cutters: cut, check, preview, info."),
    (_MORE, "haas", "haas:app", "Haas CNC controls: receive, send, check, diff, query, watch."),
)

_ROOM: Final = "compax_aio.cli"

for _group, _name, _place, _help in _COMMANDS:
    app.command(f"{_ROOM}.{_place}", name=_name, group=_group, help=_help)

app.register_install_completion_command(group=_MORE)


def run(words: Sequence[str]) -> int:
    """Carry out the command that *words* name; returns the exit code."""
    return run_words(app, words, prepare=_let_help_teach)


def _let_help_teach(words: Sequence[str]) -> None:
    """
    Give the command that is called its whole help: the line in the list of commands stands in its place until then.

    The list must not import what it lists, so it has lines of its own.
    """
    place = next((place for _, name, place, _ in _COMMANDS if [name] == list(words[:1])), None)
    if place is None:
        return
    module, _, attribute = place.partition(":")
    target = getattr(import_module(f"{_ROOM}.{module}"), attribute)
    told = target.help if isinstance(target, App) else inspect.getdoc(target)
    if told:  # asked for first, for the list's line takes its place as soon as the command is found
        app[words[0]].help = told
