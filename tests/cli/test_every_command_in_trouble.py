"""
Every command that opens a line, in a real terminal, in every kind of trouble that can befall it there.

The far end is `compax sim` on pseudo-terminals, in processes of its own, and each trouble is typed there. A cell of the
table says with which code the command ends, and what it says. All of them run before the first test looks at its own,
several at once, for most of their time is waiting.
"""

from __future__ import annotations

import asyncio
import os
import re
import sys
import termios
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import KW_ONLY, dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

import pexpect
import pytest
from tests.fakes.served import LIMIT_S, FarEnd, Served

from compax_aio import smc
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import line_named
from compax_aio.simulator.state_file import write_state_file

pytestmark = [pytest.mark.real_time, pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")]

DRIVES = 6
LINES = 6
CONTROLS = 3
"""So many are served, for cells at the same time."""

IN_DOUBT = 8

CTRL_C = "\x03"
AT_FAR_END = "far end: "
SILENT, UNPLUG = f"{AT_FAR_END}silent", f"{AT_FAR_END}unplug"
HEARD, ON_ITS_WAY = f"{AT_FAR_END}line", f"{AT_FAR_END}motion_started"
ASKED_MEANWHILE = f"{AT_FAR_END}line after motion_started"
"""Then who has set it in motion knows that the drive has taken it: one exchange at a time."""
FALLS_SILENT, IS_UNPLUGGED = ("", SILENT), ("", UNPLUG)
_CONTROL = re.compile(r"\x1b\[[0-9;?<>=]*[A-Za-z~]|\x1b\][^\x07]*\x07|\x1b[=>78M()][AB0]?")
_MODE = re.compile(r"\x1b\[\?([0-9;]+)([hl])")
NONE = "no device"
_USUAL = frozenset({"7", "25"})
"""Modes that terminals have at rest: lines are broken, and the cursor is seen."""


@dataclass(frozen=True)
class Cell:
    """
    One command in one trouble.

    Attributes:
        words: Of the command, before its URL, and behind it.
        trouble: A name of it.
        url: How the URL is changed: ``?baudrate=4800``; ``nowhere``.
        before: What is typed at the far end before the command begins.
        when: What happens before the trouble comes: a kind that the far end logs, or text on the screen.
        does: The trouble: what is typed at the far end, or keys at the terminal.
        then: What is typed when which text has been seen, to come to an end.
        code: With which the command ends.
        or_code: Or with that, where both are true, and which of them depends on how much has come.
        says: What stands on the screen at the end, as patterns.
        leaves: How the axis is at the end; nothing: as it was, at rest.
    """

    name: str
    words: tuple[str, str]
    options: str
    trouble: str
    _: KW_ONLY
    code: int
    says: tuple[str, ...]
    or_code: int | None = None
    device: str = "drive"
    url: str = ""
    before: str = ""
    when: str = ""
    does: str = ""
    then: tuple[tuple[str, str], ...] = ()
    leaves: str = "standing"

    def __str__(self) -> str:
        return f"{self.name}, {self.trouble}"


@dataclass(frozen=True)
class Outcome:
    """What a cell came to."""

    code: int
    screen: str
    raw: str
    local_modes: int
    where: str
    heard: list[str]


# The table is below; this carries it out -----------------------------------------------------------------------------


def carry_out(cell: Cell, far: FarEnd, folder: Path, number: int) -> Outcome:
    """Carry out one cell at a far end that is at rest."""
    far.begins()
    for words in filter(None, cell.before.split(";")):
        far.does(words, words.split()[0])
    url = far.url.partition("?")[0] + (cell.url if cell.url.startswith("?") else "-nowhere" if cell.url else "")
    line = f"{cell.words[0]} {'' if cell.device == NONE else '{url}'} {cell.words[1]} {cell.options}"
    known = {"dir": folder, "url": url, "n": number, "move": "move 9000", "rate": url.partition("=")[2] or "9600"}
    child = pexpect.spawn(
        sys.executable,
        ["-m", "compax_aio.cli", *(each.format_map(known) for each in line.split())],
        env=_environment(folder),
        encoding="utf-8",
        dimensions=(40, 200),
        timeout=LIMIT_S,
        maxread=65_536,
    )
    child.delaybeforesend = None
    shown: list[str] = []
    child.logfile_read = type("Log", (), {"write": lambda _, text: shown.append(text), "flush": lambda _: None})()
    try:
        expect(cell.when, child, far)
        act(cell.does, child, far)
        for text, keys in cell.then:
            expect(text, child, far)
            act(keys, child, far)
        child.expect(pexpect.EOF)
        local_modes = termios.tcgetattr(child.child_fd)[3]
    except BaseException as error:
        error.add_note(told("".join(shown)))
        raise
    finally:
        child.close(force=True)
    code = child.exitstatus if child.exitstatus is not None else 128 + (child.signalstatus or 0)
    raw = "".join(shown)
    outcome = Outcome(code, told(raw), raw, local_modes, far.where(), far.seen("line", "command"))
    if far.seen("befell")[-1:] == ["unplug"]:
        far.does("plug", "plugged in")
    far.heals()
    if cell.device == "control":
        far.does("reset", "reset")  # what it was at is over
    return outcome


def expect(what: str, child: pexpect.spawn[str], far: FarEnd) -> None:
    """Wait until a text stands on the screen, or something has happened at the far end."""
    kind = what.removeprefix(AT_FAR_END)
    if kind == what:
        child.expect(what)
    else:
        far.sees(*reversed(kind.split(" after ")))


def act(what: str, child: pexpect.spawn[str], far: FarEnd) -> None:
    """Press keys, or do what makes trouble at the far end."""
    words = what.removeprefix(AT_FAR_END)
    if words == what:
        child.send(what)
    else:
        far.does(words, "disconnected" if words == "unplug" else words)


def _environment(folder: Path) -> dict[str, str]:
    environment = {**os.environ, "TERM": "xterm", "NO_COLOR": "1", "XDG_STATE_HOME": str(folder)}
    environment.pop("COMPAX_SETTINGS", None)
    # Hundreds of processes compile what they import once.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    environment["PYTHONPYCACHEPREFIX"] = str(folder / "compiled")
    return environment


def told(raw: str) -> str:
    return " ".join(_CONTROL.sub(" ", raw).split())


# The table -----------------------------------------------------------------------------------------------------------

SOON = "--settings {dir}/soon.toml"
"""Silence is known soon."""
PATIENT = "--settings {dir}/patient.toml"
"""Answers have all the time they want, and a lost line is given up soon."""

INTERRUPTED = (r"Interrupted\.",)
STOPPED = (
    r"has acknowledged STOP and stands at -?[0-9.]+ units|Stopped: \S+; it stands"
    r"|Nothing goes on that this command had set in motion",
)
NO_PORT = (r"there is no serial port .*-nowhere", r"ports of this computer")
NO_ANSWER = (r"check power|is the drive powered", r"baud")
LOST = (
    r"ConnectionLostError",
    r"the serial port \S+ went away",
    r"was its adapter unplugged\?|emergency stop|tried again",
)
DOUBT = (r"is in doubt|does not say whether", r"look at the machine")

Words = tuple[str, str]
"""Of a command, before its URL and behind it."""

ONE_BY_ONE: Final[Mapping[str, Words]] = {
    "probe": ("probe", "--baud-rate {rate}"),
    "info": ("info", ""),
    "status": ("status", ""),
    "params get": ("params get", "P1-20"),
    "params save": ("params save", "{dir}/saved-{n}.toml"),
    "params diff": ("params diff", "{dir}/params.toml"),
    "params set": ("params set", "P40=1.5 P41=2 P42=3 --yes"),
    "params restore": ("params restore", "{dir}/params.toml --yes"),
    "program upload": ("program upload", "{dir}/uploaded-{n}.txt"),
    "program download": ("program download", "{dir}/program.txt --yes"),
    "shell -c": ("shell", "-c S1 -c S2 -c S3"),
}
"""Ask or write, and move nothing."""
MOVING: Final[Mapping[str, Words]] = {
    "move": ("move", "9000"),
    "move --by": ("move", "9000 --by"),
    "home": ("home", ""),
    "program run": ("program run", "--from 1 --wait"),
    "record --move": ("record", "-o {dir}/move-{n}.csv --move 9000"),
    "shell -c move": ("shell", "-c {move} --allow-motion"),
}
SITTING: Final[Mapping[str, Words]] = {
    "status --watch": ("status", "--watch"),
    "record": ("record", "-o {dir}/record-{n}.csv"),
    "shell": ("shell", ""),
    "jog": ("jog", ""),
}
"""Go on until somebody ends them."""
STOP: Final[Words] = ("stop", "")
AXES_LOOKING: Final[Mapping[str, Words]] = {
    "smc scan": ("smc scan", "--names X"),
    "smc status": ("smc status", "X"),
    "smc program list": ("smc program list", "X"),
    "smc program write": ("smc program write", "X {dir}/axis.txt"),
    "smc program edit": ("smc program edit", "X 0 R100"),
}
AXES_MOVING: Final[Mapping[str, Words]] = {
    "smc move": ("smc move", "X 900000"),
    "smc move --by": ("smc move", "X 900000 --by"),
    "smc home": ("smc home", "X --speed 400 --direction 1"),
    "smc run": ("smc run", "X 800"),
    "smc program run": ("smc program run", "X"),
}


def cells() -> Iterator[Cell]:
    """Make the table."""
    for name, words in {**ONE_BY_ONE, **MOVING, **SITTING, "stop": STOP}.items():
        cell = partial(Cell, name, words, SOON)
        yield cell("wrong port", url="nowhere", code=3, says=NO_PORT)
        yield cell("wrong baud rate", url="?baudrate=4800", code=4, says=NO_ANSWER)
        yield cell("silent drive", before="silent", code=4, says=NO_ANSWER)
    for name, words in {**ONE_BY_ONE, "stop": STOP}.items():
        cell = partial(Cell, name, words, PATIENT, before="late 200ms", when=HEARD)
        yield cell("unplugged", does=UNPLUG, code=3, says=LOST)
        yield cell("Ctrl-C", does=CTRL_C, code=130, says=INTERRUPTED)
    for name, words in MOVING.items():
        cell = partial(Cell, name, words, PATIENT, when=ON_ITS_WAY)
        yield cell("silent on its way", does=SILENT, code=IN_DOUBT, says=DOUBT)
        yield cell("unplugged on its way", does=UNPLUG, code=IN_DOUBT, says=DOUBT, leaves="moving")
        yield cell("Ctrl-C", does=CTRL_C, code=130, says=STOPPED)
    yield from sitting()
    yield from at_the_monitor()
    yield from on_a_party_line()
    yield from at_a_control()
    yield from without_a_line()


def on_a_party_line() -> Iterator[Cell]:
    """Make the rows of commands for steppers."""
    stop, name_it = ("smc stop", "X"), ("smc name", "X")
    for name, words in {**AXES_LOOKING, **AXES_MOVING, "smc stop": stop, "smc name": name_it}.items():
        cell = partial(Cell, name, words, "", device="axes")
        yield cell("wrong port", url="nowhere", code=3, says=NO_PORT)
        # Whose stop is echoed as garbage has answered something else; the others ask again first.
        garbage = 6 if words == stop else None
        yield cell("wrong baud rate", url="?baudrate=4800", code=4, or_code=garbage, says=(r"baud rate",))
        yield cell("silent axes", before="silent", code=4, says=(r"[Cc]heck power", r"baud rate"))
    for name, words in {**AXES_LOOKING, "smc stop": stop}.items():
        cell = partial(Cell, name, words, "", device="axes", before="late 100ms", when=f"{AT_FAR_END}command")
        yield cell("unplugged", does=UNPLUG, code=3, says=LOST)
        yield cell("Ctrl-C", does=CTRL_C, code=130, says=INTERRUPTED)
    for name, words in AXES_MOVING.items():
        cell = partial(Cell, name, words, "", device="axes", when=ON_ITS_WAY)
        yield cell("silent on its way", does=SILENT, code=IN_DOUBT, says=DOUBT)
        yield cell("unplugged on its way", does=UNPLUG, code=IN_DOUBT, says=DOUBT, leaves="moving")
        if name == "smc program run":  # in which an axis may hear nothing (DCB p. 27)
            yield cell(
                "Ctrl-C",
                does=CTRL_C,
                code=4,
                says=(r"may be moving: use the emergency stop", r"smc stop URL --abort"),
                leaves="moving",
            )
        else:
            yield cell("Ctrl-C", does=CTRL_C, code=130, says=(r"has acknowledged STOP and stands at -?[0-9.]+ steps",))
    watch = partial(Cell, "smc status --watch", ("smc status", "X --watch"), "", device="axes", when="stands")
    yield watch("silent", does=SILENT, then=(("no sensible answer", CTRL_C),), code=130, says=(r"[0-9]+ steps",))
    yield watch("unplugged", does=UNPLUG, then=(("the line was lost", CTRL_C),), code=130, says=(r"[0-9]+ steps",))
    yield watch("Ctrl-C", does=CTRL_C, code=130, says=(r"[0-9]+ steps",))


def at_a_control() -> Iterator[Cell]:
    """Make the rows of commands for Haas controls, at which somebody presses keys."""
    receive, send = ("haas receive", "program -o {dir}/received-{n}.nc"), ("haas send", "{dir}/long.nc")
    feed = ("haas send", "{dir}/long.nc --dnc --yes")
    query, watch = ("haas query", "Q100 Q104 Q500 3027"), ("haas watch", "Q500")
    soon, settings = "--operator-timeout 1", (r"Settings 11 \(baud rate\)",)
    by_codes = f"{soon} --profile classic-dc-codes"
    transfers: Mapping[str, tuple[Words, str]] = {
        "haas receive": (receive, soon),
        "haas send": (send, by_codes),
        "haas send --dnc": (feed, by_codes),
    }
    rate = "?baudrate=4800"
    asking = (query, "--answer-timeout 0.3")
    for name, (words, options) in {**transfers, "haas query": asking}.items():
        cell = partial(Cell, name, words, options, device="control", leaves="at rest")
        yield cell("wrong port", url="nowhere", code=3, says=NO_PORT)
        yield cell("wrong baud rate", url=rate, code=4, says=settings)
        yield cell("silent control", before="silent", code=4, says=settings)
    cell = partial(Cell, "haas query", query, "", device="control", before="late 200ms", when=f"{AT_FAR_END}request")
    yield cell("unplugged", does=UNPLUG, code=3, says=LOST[:2], leaves="at rest")
    yield cell("Ctrl-C", does=CTRL_C, code=130, says=INTERRUPTED, leaves="at rest")
    yield from in_the_middle_of_a_file(receive, send, feed)
    cell = partial(Cell, "haas watch", watch, "", device="control", when="IDLE", leaves="at rest")
    yield cell("silent", does=SILENT, then=(("no answer", CTRL_C),), code=130, says=(r"Watched no longer",))
    yield cell("unplugged", does=UNPLUG, then=(("was lost", CTRL_C),), code=130, says=(r"Watched no longer",))
    yield cell("Ctrl-C", does=CTRL_C, code=130, says=(r"Watched no longer",))


def in_the_middle_of_a_file(receive: Words, send: Words, feed: Words) -> Iterator[Cell]:
    """Make the rows in which a key is pressed first: RECV or SEND at the far end, Enter at the terminal."""
    presses = {"haas receive": (receive, "SEND", f"{AT_FAR_END}send O00010", ""),
               "haas send": (send, "Enter", f"{AT_FAR_END}recv", "\r"),
               "haas send --dnc": (feed, "Enter", f"{AT_FAR_END}dnc", "\r")}  # fmt: skip
    for name, (words, asked, key, enter) in presses.items():
        begin = ((asked, key), ("", enter), ("bytes/s", ""))
        cell = partial(Cell, name, words, "--silence-timeout 1", device="control", leaves="")
        far = r"bytes (came|have left)"
        yield cell("unplugged in the middle", then=(*begin, IS_UNPLUGGED), code=3, says=(LOST[0], far, "never resumed"))
        yield cell("Ctrl-C in the middle", then=(*begin, ("", CTRL_C)), code=130, says=(r"was given up", far))
        nobody = partial(cell, when=asked, does=CTRL_C, code=130)
        yield nobody("Ctrl-C before a key is pressed", says=("nothing of the file (was sent|came)",))
    cell = partial(Cell, "haas receive", receive, "--silence-timeout 1", device="control", leaves="")
    reset = (("SEND", f"{AT_FAR_END}send O00010"), ("bytes/s", f"{AT_FAR_END}reset"))
    yield cell("RESET in the middle", then=reset, code=4, says=("fallen silent", "was RESET pressed", r"\.incomplete"))


def without_a_line() -> Iterator[Cell]:
    """Make the rows of commands that work on files."""
    files = {
        "plot": (2, r"garbage\.csv", r"ends in \.csv"),
        "replay": (2, r"garbage\.csv", r"Is a directory"),
        "trace check": (2, r"garbage\.csv", r"Is a directory"),
        "trace info": (2, r"garbage\.csv", r"Is a directory"),
        "program check": (1, r"garbage\.csv:1:1: error: .* begin the line like N001:", r"Is a directory"),
        "program print": (2, r"line 1, column 1: error: .* begin the line like N001:", r"Is a directory"),
        "haas check": (1, r"garbage\.csv:1:1: error: it does not begin with %", r"Is a directory"),
        "smc program check": (2, r"line 1, column 1: 'a' is not known", r"Is a directory"),
    }
    for name, (code, garbage, folder) in files.items():
        cell = partial(Cell, device=NONE)
        yield cell(name, (f"{name} {{dir}}/nowhere.csv", ""), "", "no such file", code=2, says=(r"nowhere\.csv",))
        yield cell(name, (f"{name} {{dir}}/garbage.csv", ""), "", "another kind of file", code=code, says=(garbage,))
        yield cell(name, (f"{name} {{dir}}", ""), "", "a folder", code=2, says=(folder,))


def sitting() -> Iterator[Cell]:
    """Make the rows of commands that somebody ends."""
    watch = partial(Cell, "status --watch", SITTING["status --watch"], PATIENT, when="no fault|No error")
    yield watch(
        "silent",
        does=SILENT,
        then=((r"not said|no answer|does not answer", CTRL_C),),
        code=130,
        says=("Ctrl-C ends this",),
    )
    yield watch("unplugged", does=UNPLUG, then=(("is tried again", CTRL_C),), code=130, says=("was lost",))
    yield watch("Ctrl-C", does=CTRL_C, code=130, says=("Ctrl-C ends this",))
    record = partial(Cell, "record", SITTING["record"], PATIENT, when="values")
    yield record("silent", does=SILENT, then=((r"not answered", CTRL_C),), code=0, says=("not said",))
    yield record(
        "unplugged",
        does=UNPLUG,
        then=((r"the line is lost", CTRL_C),),
        code=0,
        says=(r"record-\d+\.csv: \d+ values in",),
    )
    yield record("Ctrl-C", does=CTRL_C, code=0, says=(r"record-\d+\.csv: \d+ values in",))
    shell = partial(Cell, "shell", SITTING["shell"], PATIENT + " --allow-motion --name x", when="exit leaves")
    yield shell("silent", does=SILENT, then=(("", "S1\r"), (NO_ANSWER[0], "exit\r")), code=0, says=NO_ANSWER)
    yield shell("unplugged", does=UNPLUG, then=(("lost", "exit\r"),), code=0, says=("the line",))
    moves = ("", "move 9000\r"), (ON_ITS_WAY, ""), (ASKED_MEANWHILE, "")
    # The code is that of the stop with which the shell is left.
    lost = partial(shell, code=3, or_code=4, says=(*DOUBT, "(?i)the axis may (still )?be moving", "emergency stop"))
    yield lost("silent on its way", then=(*moves, FALLS_SILENT, ("in doubt", "exit\r")))
    yield lost("unplugged on its way", then=(*moves, IS_UNPLUGGED, ("in doubt", "exit\r")), leaves="moving")
    yield shell("Ctrl-C on its way", then=(*moves, ("", CTRL_C), ("stands at", "exit\r")), code=0, says=("STOP",))
    yield shell("Ctrl-X on its way", then=(*moves, ("", "\x18"), ("stands at", "exit\r")), code=0, says=("STOP",))
    jog = partial(Cell, "jog", SITTING["jog"], PATIENT + " --step 900 --name x", when="q stop and leave")
    steps = ("", "\x1b[C"), (ON_ITS_WAY, "")
    yield jog("silent on its way", then=(*steps, FALLS_SILENT), code=IN_DOUBT, says=DOUBT)
    yield jog("unplugged on its way", then=(*steps, IS_UNPLUGGED), code=IN_DOUBT, says=DOUBT, leaves="moving")
    yield jog("Ctrl-C on its way", then=(*steps, ("", CTRL_C)), code=130, says=STOPPED)


def at_the_monitor() -> Iterator[Cell]:
    """Make the rows of the screen, which opens although something is wrong, and says so."""
    says = ("Nothing was in motion from here",)
    monitor = partial(Cell, "monitor", ("monitor", ""), "")
    yield monitor("wrong port", url="nowhere", then=(("no serial port", "q"),), code=0, says=says)
    yield monitor("wrong baud rate", url="?baudrate=4800", then=(("baud rate", "q"),), code=0, says=says)
    yield monitor("silent drive", before="silent", then=(("check power", "q"),), code=0, says=says)
    yield monitor("unplugged", then=(("[0-9]/s", ""), IS_UNPLUGGED, ("lost", "q")), code=0, says=says)
    yield monitor("Ctrl-C", then=(("[0-9]/s", CTRL_C),), code=130, says=says)


TABLE: Final = tuple(cells())

FILES: Final[Mapping[str, str]] = {
    "soon.toml": "answer_timeout_s = 0.3\nin_doubt_after_s = 2\nstop_timeout_s = 1\n",
    "patient.toml": "answer_timeout_s = 1\nin_doubt_after_s = 1.5\nstop_timeout_s = 2\n",
    "params.toml": 'kind = "parameters"\ndrive = "x"\nsaved_at = 2024-01-01T00:00:00+00:00\n\n[parameters]\n'
    + "".join(f"P{number} = {number}\n" for number in range(40, 50)),
    "program.txt": "N001: POSA 9000\nN002: POSA 0\nN003: END\n",
    "garbage.csv": "a,b\n1,\x00\n",
    "axis.txt": "R900000\nR0\n",
    "long.nc": "%\nO00077\n" + "G1 X1.5 Y2.5\n" * 3000 + "M30\n%\n",
}


@pytest.fixture(scope="module")
def outcomes(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[dict[Cell, Future[Outcome]]]:
    """Carry out the cells that are looked at, at several far ends at once."""
    functions = [each for each in request.session.items if isinstance(each, pytest.Function)]
    mine = [each.callspec.params["cell"] for each in functions if each.module is request.module]
    wanted = [each for each in mine if isinstance(each, Cell)]
    with carried_out(wanted, tmp_path_factory.mktemp("trouble")) as outcomes:
        yield outcomes


@contextmanager
def carried_out(wanted: Iterable[Cell], folder: Path) -> Iterator[dict[Cell, Future[Outcome]]]:
    for name, text in FILES.items():
        (folder / name).write_text(text)
    free: dict[str, SimpleQueue[FarEnd]] = {}
    drives = Served(
        "compax",
        *kept_drives(folder),
        "machine_zero=-5000",
        "nominal_speed=20",
        "baudrate=9600",
        environment=_environment(folder),
    )
    axes = Served(
        "smc", *kept_lines(folder), "axes=XY", "home=-900000", "baudrate=9600", environment=_environment(folder)
    )
    controls = Served(
        "haas",
        *("--count", str(CONTROLS), "--link", str(folder / "control")),
        "baudrate=9600",
        "program_blocks=5000",
        environment=_environment(folder),
    )
    for kind, served in (("drive", drives), ("axes", axes), ("control", controls)):
        free[kind] = SimpleQueue()
        for name in served.urls:
            free[kind].put(FarEnd(served, name))

    def at_a_free_one(number: int, cell: Cell) -> Outcome:
        far = free[far_end_of(cell)].get()
        try:
            return carry_out(cell, far, folder, number)
        finally:
            free[far_end_of(cell)].put(far)

    try:
        with ExitStack() as pools:
            pool = {
                "drive": pools.enter_context(ThreadPoolExecutor(DRIVES)),
                "axes": pools.enter_context(ThreadPoolExecutor(LINES)),
                "control": pools.enter_context(ThreadPoolExecutor(CONTROLS)),
            }
            longest_first = sorted(wanted, key=lambda cell: cell.code != IN_DOUBT)
            yield {
                cell: pool[far_end_of(cell)].submit(at_a_free_one, number, cell)
                for number, cell in enumerate(longest_first)
            }
    finally:
        ended = drives.close(), axes.close(), controls.close()
    assert ended == (0, 0, 0)


def far_end_of(cell: Cell) -> str:
    return "drive" if cell.device == NONE else cell.device


def kept_drives(folder: Path) -> tuple[str, ...]:
    """Make the states of drives that have a program; returns the words that let them be served."""
    drive = SimulatedDrive(Knobs(machine_zero=-5000))
    drive.load_program(["POSA 9000", "POSA 0", "END"])
    (folder / "drives").mkdir()
    for number in range(1, DRIVES + 1):
        write_state_file(folder / "drives" / f"drive{number}.json", drive.save_state())
    return "--count", str(DRIVES), "--link", str(folder / "drive"), "--state", str(folder / "drives")


def kept_lines(folder: Path) -> tuple[str, ...]:
    """Make the states of lines whose axis X has a program; returns the words that let them be served."""
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        state = runner.run(programmed_axis())
    (folder / "lines").mkdir()
    for number in range(1, LINES + 1):
        write_state_file(folder / "lines" / f"line{number}.json", state)
    return "--count", str(LINES), "--link", str(folder / "line"), "--state", str(folder / "lines")


async def programmed_axis() -> dict[str, Any]:
    async with smc.connect("sim://smc?name=programmed&axes=XY", axes="X") as party:
        await party.axis("X").program.write("R900000\nR0\n")
        return line_named("programmed").save_state()


@pytest.mark.parametrize("cell", TABLE, ids=str)
def test_it_is_told_what_is_wrong_and_what_to_do(cell: Cell, outcomes: dict[Cell, Future[Outcome]]) -> None:
    outcome = outcomes[cell].result()
    assert outcome.code in {cell.code, cell.or_code}, outcome.screen
    for pattern in cell.says:
        assert re.search(pattern, outcome.screen), outcome.screen
    assert "Traceback" not in outcome.screen
    assert cell.leaves in outcome.where
    assert outcome.local_modes & termios.ECHO
    assert outcome.local_modes & termios.ICANON
    last = {mode: action for modes, action in _MODE.findall(outcome.raw) for mode in modes.split(";")}
    assert [mode for mode, action in last.items() if action != ("h" if mode in _USUAL else "l")] == []
