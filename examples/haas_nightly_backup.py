"""
Back up Haas controls at night: programs and numbered data into dated folders, verified, compared with the last backup.

Somebody, or something, has to press SEND at each control for each file; which, is printed. Run by cron, it is best
begun by the last operator of the day. Exit status: 0 all is kept, and as it was; 1 something is missing; 3 all is kept,
and something has changed.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import compax_aio
from compax_aio import haas

KINDS: Final = ("programs", "parameters", "settings", "offsets", "macros")
MOST_TOLD: Final = 10
MISSING, CHANGED = 1, 3
PRESSES: Final = ",".join(f"send:{'ALL' if kind == 'programs' else kind}" for kind in KINDS for _ in range(2))
SIMULATED: Final = f"mill=sim://haas?profile=dc_codes&baudrate=9600&press={PRESSES}&press_after_s=3"
"""A control that presses its own keys: each file is sent twice, for it is verified."""


class Night(NamedTuple):
    """What is the same for all controls."""

    folder: Path
    today: Path
    profile: str
    timeout_s: float


class Report:
    """What became of one control's backup."""

    def __init__(self, control: str) -> None:
        self.control = control
        self.kept: list[str] = []
        self.changed: list[str] = []
        self.missing: list[str] = []


def last_backup(folder: Path, control: str, kind: str) -> Path | None:
    """Return the newest file of that kind in the dated folders, or None if this is the first backup."""
    found = folder.glob(f"????-??-??*/{control}/{kind}.txt")
    return max(found, key=lambda path: path.stat().st_mtime_ns, default=None)


def differences(kind: str, before: Path, after: haas.ProgramFile | haas.DataFile) -> list[str]:
    """Say in what a file differs from that of the last backup."""
    data = before.read_bytes()
    older = haas.parse_program_file(data) if kind == "programs" else haas.parse_data_file(data, kind)
    return [str(each) for each in haas.diff(older, after)]


async def back_up_one(control: haas.Control, kind: str, night: Night, report: Report) -> None:
    """Receive one kind of file twice, keep it, and compare it with the last one."""
    before = await asyncio.to_thread(last_backup, night.folder, control.name, kind)

    def tell(what: str) -> None:
        print(f"{control.name}: {what}", flush=True)

    try:
        received = await getattr(control, f"receive_{kind}")(
            archive=night.today / control.name / f"{kind}.txt", verify=True, on_operator=tell
        )
    except compax_aio.TransportError:
        raise  # without its line nothing else of this control can be had
    except compax_aio.CompaxError as error:
        report.missing.append(f"{kind}: {error.what}")
        return
    report.kept.append(f"{kind}: {len(received.data)} bytes, {received.verified.equal}")
    if before is not None:
        try:
            found = await asyncio.to_thread(differences, kind, before, received.file)
        except (compax_aio.CompaxError, OSError) as error:
            found = [f"cannot be compared with {before}: {error}"]
        report.changed += [f"{kind}: {each}" for each in found[:MOST_TOLD]]
        if len(found) > MOST_TOLD:
            report.changed.append(f"{kind}: and {len(found) - MOST_TOLD} more")


async def back_up(name: str, url: str, night: Night) -> Report:
    """Back up one control; a line that cannot be opened, or is lost, is in the report, and harms no other control."""
    report = Report(name)
    settings = haas.ControlSettings(operator_timeout_s=night.timeout_s)
    await asyncio.to_thread((night.today / name).mkdir, parents=True)
    try:
        async with haas.connect(url, profile=night.profile, name=name, settings=settings) as control:
            for kind in KINDS:
                await back_up_one(control, kind, night, report)
    except compax_aio.TransportError as error:
        done = {each.partition(":")[0] for each in (*report.kept, *report.missing)}
        report.missing += [f"{kind}: {error.what}" for kind in KINDS if kind not in done]
    return report


def new_folder(folder: Path) -> Path:
    """Return a folder of today's date that is not there yet."""
    name = f"{datetime.now().astimezone():%Y-%m-%d}"
    count = 1
    while (folder / (today := name if count == 1 else f"{name}.{count}")).exists():
        count += 1
    return folder / today


async def back_up_all(controls: dict[str, str], night: Night) -> list[Report]:
    """Back up all controls at the same time, each over its own line."""
    return await asyncio.gather(*(back_up(name, url, night) for name, url in controls.items()))


def tell(reports: Sequence[Report]) -> int:
    """Print what became of all; returns the exit status."""
    for each in reports:
        print(f"{each.control}: {len(each.kept)} of {len(KINDS)} files kept")
        for title, lines in (("kept", each.kept), ("changed", each.changed)):
            for line in lines:
                print(f"  {title:8} {line}")
        for line in each.missing:
            print(f"{each.control}: missing: {line}", file=sys.stderr)
    if any(each.missing for each in reports):
        return MISSING
    return CHANGED if any(each.changed for each in reports) else 0


def named_urls(words: Sequence[str]) -> dict[str, str]:
    """Read ``NAME=URL`` words, or one URL; raises ValueError."""
    controls: dict[str, str] = {}
    for word in words:
        name, _, url = word.partition("=")
        if not name.isidentifier() and len(words) == 1:
            name, url = "control", word
        if "://" not in url or not name.isidentifier() or name in controls:
            raise ValueError(f"{word!r} is no NAME=URL, or its name is there twice")
        controls[name] = url
    return controls


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Ctrl-C keeps what is whole. Real lines: mill=serial:///dev/ttyUSB0, lathe=tcp://192.168.1.50:4001.",
    )
    parser.add_argument(
        "controls", nargs="*", default=[SIMULATED], metavar="NAME=URL", help="(default: a simulated mill)"
    )
    parser.add_argument("--folder", type=Path, default=Path("backups"), help="of all backups (%(default)s)")
    parser.add_argument("--profile", default="classic dc codes", help="how the controls are set up (%(default)s)")
    parser.add_argument(
        "--operator-timeout", type=float, default=600.0, metavar="S", help="to press SEND (%(default)s)"
    )
    options = parser.parse_args(argv)
    try:
        controls = named_urls(options.controls)
        night = Night(options.folder, new_folder(options.folder), options.profile, options.operator_timeout)
        reports = asyncio.run(back_up_all(controls, night))
    except (compax_aio.CompaxError, OSError, ValueError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return MISSING
    except KeyboardInterrupt:
        print("interrupted; what is whole is kept, the rest is in *.incomplete", file=sys.stderr)
        return 130
    return tell(reports)


if __name__ == "__main__":
    sys.exit(main())
