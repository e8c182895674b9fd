"""Commission a new axis step by step: look first, ask before anything moves, measure, and write a report."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import threading
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime
from pathlib import Path

import compax_aio
from compax_aio import Comparator, Drive
from compax_aio.compax.vocabulary import plan_move_to
from compax_aio.text_file import replace_file
from compax_aio.transports.url import TransportURL

SIMULATED = "sim://compax?machine_zero=-10&travel_min=-500&travel_max=500"
SIMULATED_OUTPUT = 9

IDENTIFICATION = range(31, 40)
"""S31 to S39; no page at hand says what they mean, but together they tell one drive from another."""

LOOK_EVERY_S = 0.02

Finding = tuple[str, list[str]]
"""Outcome of a step, ``ok``, ``look`` or ``not done``, and what was found."""


class Stopped(Exception):  # noqa: N818
    """Somebody said that it goes no further."""


class Report:
    """What was found, step by step; the file is replaced whole after each step, and so is never half a one."""

    def __init__(self, path: Path, url: str) -> None:
        self.path = path
        self.url = url
        self.steps: list[tuple[str, Finding]] = []
        self.doing: str | None = None
        """The step that is under way."""

    def add(self, title: str, finding: Finding) -> None:
        """Note a step, print it, and write the report."""
        self.doing = None
        self.steps.append((title, finding))
        outcome, lines = finding
        print(f"{outcome:9} {title}", *(f"          {line}" for line in lines), sep="\n", flush=True)
        text = [f"# Commissioning of {self.url}", "", f"{datetime.now().astimezone():%Y-%m-%d %H:%M %Z}", ""]
        text += ["| step | outcome |", "|---|---|", *(f"| {step} | {found[0]} |" for step, found in self.steps)]
        for step, (found, said) in self.steps:
            text += ["", f"## {step}: {found}", "", *(f"- {line}" for line in said)]
        replace_file(self.path, "\n".join(text) + "\n")

    def end(self, outcome: str, why: str) -> None:
        """Note how the step ended that was under way, if one was."""
        if self.doing is not None:
            self.add(self.doing, (outcome, [why]))


# Steps that move nothing


async def identity(drive: Drive) -> Finding:
    """Read what the drive says of itself."""
    values = [f"S{number}: {(await drive.read_status(number)).raw}" for number in IDENTIFICATION]
    return "ok", values


async def interface(drive: Drive) -> Finding:
    """Look at P20, which says how the serial interface behaves (UG p. 166)."""
    found = drive.interface
    if found is None:
        return "look", ["P20 could not be read: whether the drive tells errors is not known"]
    lines = [f"P20 = {found.raw}", f"Xon/Xoff {'on' if found.xonxoff else 'off'}"]
    if found.errors_suppressed:
        return "look", [*lines, "errors are suppressed: a refused command looks like an accepted one; change P20"]
    return "ok", [*lines, "the drive tells errors"]


async def state(drive: Drive) -> Finding:
    """Look whether there is a fault, and what has been in the past."""
    status, error = await drive.status(), await drive.error()
    lines = [
        f"error history: {entry.error}, {entry.ended_by or 'not acknowledged'}" for entry in await drive.error_history()
    ]
    if error is not None or not status.no_fault:
        return "look", [f"present: {error}", *lines]
    return "ok", ["no fault is present", *(lines or ["the error history is empty"])]


async def limits(drive: Drive, options: argparse.Namespace) -> Finding:
    """Read unit and travel; from now on targets outside are refused here, and those of this run before any moves."""
    axis = await drive.read_axis()
    check_moves(options, drive.settings)
    lines = [f"P90 = {axis.unit_code:g}, taken for {axis.unit} with {axis.decimals} decimals"]
    if axis.travel is None:
        return "look", [*lines, "P11 and P12 are the same: the drive knows no limits of the travel"]
    return "ok", [*lines, f"travel {axis.travel[0]:,.2f} to {axis.travel[1]:,.2f} {axis.unit}"]


async def parameters(drive: Drive, path: Path) -> Finding:
    """Save all parameters, before anybody changes one."""
    values = await drive.parameters.save(path)
    return "ok", [f"{len(values)} parameters are in {path}"]


def check_moves(options: argparse.Namespace, settings: compax_aio.DriveSettings) -> None:
    """
    Look whether a drive can be told what is to be moved, as long as nothing moves.

    Raises:
        InvalidCommandError: It cannot.
    """
    comparators = [] if options.output is None else [Comparator(round(abs(options.distance) / 2, 2), options.output, 1)]
    plan_move_to(options.distance, settings, speed_percent=options.speed, comparators=comparators)


# Steps that move the axis


async def homing(drive: Drive) -> Finding:
    """Find machine zero."""
    result = await drive.home()
    return "ok", [f"found after {result.duration_s:.2f} s; the axis is at {await drive.position():g} {drive.unit}"]


async def small_moves(drive: Drive, distance: float, speed_percent: float) -> Finding:
    """Move there and back, slowly, and look at the following error on the way."""
    outcome, lines = "ok", []
    for target in (distance, 0.0):
        move = drive.move_to(target, speed_percent=speed_percent)
        largest, readings = 0.0, 0
        while not move.done():
            largest, readings = max(largest, abs(await drive.following_error())), readings + 1
            await asyncio.sleep(LOOK_EVERY_S)
        result = await move
        off = await drive.position() - target
        lines.append(
            f"to {target:g} {drive.unit}: {result.duration_s:.2f} s, told by {result.confirmed_by}, "
            f"then {off:+.3f} off; following error up to {largest:.3f} in {readings} readings"
        )
        if result.confirmed_by == "status":
            outcome = "look"
            lines.append("the message of position reached did not come; the status has told it")
    return outcome, lines


async def stop_test(drive: Drive, distance: float, speed_percent: float) -> Finding:
    """Stop a move half way; how long and how far it takes counts from the last reading before STOP."""
    loop = asyncio.get_running_loop()
    move = drive.move_to(distance, speed_percent=speed_percent)
    async for position in move.positions(interval_s=LOOK_EVERY_S):
        if abs(position) >= abs(distance) / 2:
            break
    before, stopped_at = await drive.position(), loop.time()
    await drive.stop()
    took_s = loop.time() - stopped_at
    try:
        await move
    except compax_aio.MoveStoppedError:
        pass
    else:
        return "look", ["the move was over before STOP came; take a longer --distance or a lower --speed"]
    further = abs(await drive.position() - before)
    await drive.move_to(0, speed_percent=speed_percent)
    return "ok", [
        f"STOP at {speed_percent:g} %: standstill was seen {took_s:.3f} s later, {further:.2f} {drive.unit} further on",
        "the line's time is in it; try the emergency stop as well, by hand",
    ]


async def comparator_test(drive: Drive, distance: float, speed_percent: float, output: int) -> Finding:
    """Let a comparator set an output half way, and look where the axis was when the drive told so."""
    move = drive.move_to(
        distance, speed_percent=speed_percent, comparators=[Comparator(round(abs(distance) / 2, 2), output, 1)]
    )
    seen_at = None
    async for _ in move.comparators():
        seen_at = await drive.position()
    await move
    await drive.output(output, 0)
    await drive.move_to(0, speed_percent=speed_percent)
    if seen_at is None:
        return "look", [f"O{output}: the drive told of no comparator on the way"]
    return "ok", [f"O{output} = 1 at {abs(distance) / 2:g} {drive.unit}; it was told when the axis was at {seen_at:g}"]


# All of them


def typed_line() -> Awaitable[str]:
    """Wait for a line of the terminal, in a thread that nobody has to wait for when Ctrl-C comes."""
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[str] = loop.create_future()

    def done(text: str) -> None:
        if not answer.done():
            answer.set_result(text)

    def read() -> None:
        text = os.read(sys.stdin.fileno(), 1000).decode(errors="replace")
        loop.call_soon_threadsafe(done, text)

    threading.Thread(target=read, daemon=True).start()
    return answer


async def ask(question: str) -> None:
    """
    Ask whether to go on.

    Raises:
        Stopped: The answer is not yes, or there is nobody to answer.
    """
    if not sys.stdin.isatty():
        raise Stopped("nobody is at the terminal to be asked; --yes goes on without asking")
    print(f"{question} [yes/N] ", end="", flush=True)
    if (await typed_line()).strip().lower() not in {"y", "yes"}:
        raise Stopped("it was not wanted")


async def commission(options: argparse.Namespace, report: Report) -> None:
    """Go through all steps; one that fails ends it. The axis stops before that is noted: a disk may take its time."""
    try:
        await go_through(options, report)
    except asyncio.CancelledError:
        report.end("not done", "interrupted; what moved was stopped")
        raise
    except compax_aio.CompaxError as error:
        report.end("failed", str(error))
        raise


async def go_through(options: argparse.Namespace, report: Report) -> None:
    """Carry out step by step on an open line; leaving it stops the axis."""
    distance, speed, output = options.distance, options.speed, options.output
    async with compax_aio.connect(options.url, name="axis") as drive:
        looking: dict[str, Callable[[], Awaitable[Finding]]] = {
            "identity": lambda: identity(drive),
            "serial interface": lambda: interface(drive),
            "state": lambda: state(drive),
            "unit and travel": lambda: limits(drive, options),
            "parameters saved": lambda: parameters(drive, options.report.with_suffix(".parameters.toml")),
        }
        moving: dict[str, Callable[[], Awaitable[Finding]]] = {
            "machine zero": lambda: homing(drive),
            "small moves": lambda: small_moves(drive, distance, speed),
            "stop": lambda: stop_test(drive, distance, speed),
        }
        if output is not None:
            moving["comparator"] = lambda: comparator_test(drive, distance, speed, output)
        for title, step in looking.items():
            await carry_out(title, step, report)
        doubtful = [title for title, (outcome, _) in report.steps if outcome != "ok"]
        told = f"Look first at: {', '.join(doubtful)}.\n" if doubtful else ""
        told += f"The axis will search for machine zero, then move up to {distance:g} {drive.unit} at {speed:g} %"
        told += "" if output is None else f", and switch O{output}"
        try:
            if not options.yes:
                await ask(f"{told}.\nIs the way free, and a hand on the emergency stop?")
        except Stopped as reason:
            for title in moving:
                report.add(title, ("not done", [str(reason)]))
            return
        for title, step in moving.items():
            await carry_out(title, step, report)


async def carry_out(title: str, step: Callable[[], Awaitable[Finding]], report: Report) -> None:
    """Do one step, and note what it has found."""
    report.doing = title
    report.add(title, await step())


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, commission, and return the exit status: 0 if all is well, 1 if not."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real axis really moves, after you said yes. Ctrl-C stops it; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", help="line of the drive (default: a simulated one)")
    parser.add_argument("--distance", type=float, default=10, metavar="UNITS", help="of small moves (%(default)s)")
    parser.add_argument("--speed", type=float, default=5, metavar="PERCENT", help="of nominal speed (%(default)s)")
    parser.add_argument("--output", type=int, metavar="N", help="output to be switched by a comparator; without: none")
    parser.add_argument("--report", type=Path, help="file to write (default: one with date and time)")
    parser.add_argument("--yes", action="store_true", help="ask nothing: the way is free")
    options = parser.parse_args(argv)
    if options.url is None:
        options.url = SIMULATED
        options.output = SIMULATED_OUTPUT if options.output is None else options.output
    if options.distance == 0:
        parser.error("--distance is not 0: a move of no length shows nothing")
    try:
        check_moves(options, compax_aio.DriveSettings())
    except compax_aio.InvalidCommandError as error:
        parser.error(str(error))
    if options.report is None:
        options.report = Path(f"commissioning-{datetime.now().astimezone():%Y%m%d-%H%M%S}.md")
    report = Report(options.report, options.url)
    try:
        report.url = str(TransportURL.parse(options.url))  # without its password
        asyncio.run(commission(options, report))
    except (compax_aio.CompaxError, OSError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"\ninterrupted; the axis was stopped, if it moved; {report.path} says how far it came", file=sys.stderr)
        return 130
    print(f"the report is in {report.path}")
    return 0 if all(outcome == "ok" for _, (outcome, _) in report.steps) else 1


if __name__ == "__main__":
    sys.exit(main())
