"""``compax probe``: find out how a drive talks, and write it to a settings file; nothing is ever moved."""

from __future__ import annotations

import logging
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter
from cyclopts.validators import Number
from rich.console import Group
from rich.table import Table
from rich.text import Text

from ..compax.facts.line import BAUD_RATES
from ..compax.findings import Founded, ProbeReport
from ..compax.probing import probe as probe_drive
from ..errors import UnexpectedAnswerError
from .files import Force, expect_free
from .interruption import moves_nothing
from .number_words import NUMBER, WHOLE
from .opening import DriveLine, Url
from .printing import Printing, notes_console

__all__ = ["probe"]

_STYLES: Final = {Founded.SEEN: "green", Founded.READ: "green", Founded.INFERRED: "yellow", Founded.UNKNOWN: "red"}


@moves_nothing
async def probe(
    url: Url,
    *,
    output: Annotated[
        Path | None,
        Parameter(name=("--output", "-o"), help="Write the settings there, for `--settings` of the other commands."),
    ] = None,
    force: Force = False,
    baud_rate: Annotated[
        tuple[int, ...],
        WHOLE,
        Parameter(
            negative=(),
            validator=Number(gt=0, lte=12_000_000),
            help="Baud rate to try where it is ours to choose (serial://, rfc2217://), once for each. A COMPAX has "
            "9600 or 4800. One that stands in the URL is tried first.",
        ),
    ] = BAUD_RATES,
    timeout_s: Annotated[
        float,
        NUMBER,
        Parameter(name="--timeout", validator=Number(gt=0, lte=3600), help="Seconds that all of it may take."),
    ] = 60.0,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Find out how a drive talks, and write it to a settings file.

    Asks for baud rate, handshake, echo, the form of error replies, P20, the unit and travel of the axis, and says of
    each how well it is founded. Only questions are sent: nothing moves, whatever is at the far end, and nothing is
    written to the drive. What only a move could show is said to be unknown.

    ```sh
    compax probe serial:///dev/ttyUSB0
    compax probe serial:///dev/ttyUSB0 -o drive.toml
    compax probe tcp://192.168.1.50:4001 --json
    ```
    """
    settings = line.drive_settings()
    if output is not None:
        expect_free(output, force=force)
    try:
        with _progress(printing) as on_progress:
            async with line.recorded():
                report = await probe_drive(
                    url,
                    name=line.name,
                    settings=settings,
                    baud_rates=baud_rate,
                    timeout_s=timeout_s,
                    on_progress=on_progress,
                )
    except UnexpectedAnswerError as error:
        if "sends back" in error.what:
            error.add_note(f"An AMS SMC stepper sends back what it gets, too: compax smc scan {shlex.quote(url)}")
        raise
    printing.show(report, _for_people(report))
    if output is not None:
        expect_free(output, force=force)  # still
        report.settings.save(output)
        printing.note(f"The settings were written to {output}.")
    printing.note(_next_step(report, output))


@contextmanager
def _progress(printing: Printing) -> Iterator[Callable[[str], None]]:
    """Give what tells a person what is done now; the library's warnings are all in the report."""
    logger = logging.getLogger("compax_aio")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        if printing.json or not sys.stderr.isatty():
            yield printing.note
            return
        with notes_console().status("") as status:
            yield lambda text: status.update(Text(f"{text} …"))
    finally:
        logger.setLevel(level)


def _for_people(report: ProbeReport) -> Group:
    table = Table(box=None, pad_edge=False, title_justify="left")
    for heading in ("what", "found", "founded", "evidence"):
        table.add_column(heading, overflow="fold", no_wrap=heading in {"what", "founded"})
    for each in report.findings:
        founded = Text(each.founded.name.lower(), style=_STYLES[each.founded])
        table.add_row(each.topic, Text(each.found), founded, Text(each.evidence, style="dim"))
    lines = [Text(f"at {each.baudrate} baud: {each.told}") for each in report.attempts if not each.answers]
    changed = [
        Text(f"  {name} = {getattr(report.settings, name)!r}, because: {why}") for name, why in report.changed.items()
    ]
    heading = (
        "Settings that differ by what was found:" if changed else "The settings need not differ from what they are."
    )
    return Group(*lines, table, Text(""), Text(heading), *changed)


def _next_step(report: ProbeReport, output: Path | None) -> str:
    words = ["compax", "info", report.url]
    if output is not None:
        words += ["--settings", str(output)]
    return f"Next: {shlex.join(words)}"
