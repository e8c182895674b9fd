"""``compax camm1 info``: who a cutter is, how it stands, how much its buffer holds; it moves nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from compax_aio.camm1.cutter import Cutter
from compax_aio.camm1.facts.reports import IO_ERRORS
from compax_aio.camm1.replies import CutterStatus

from ..asking import Asking
from ..info import LineFigures
from ..interruption import moves_nothing
from ..printing import Printing
from .line import CutterLine, CutterUrl, Machine

__all__ = ["CutterInfo", "info"]

_HANDSHAKE = "none between jobs: opening the line has reset it (ESC.R); each job sets up its own"


@dataclass(frozen=True, kw_only=True)
class CutterInfo:
    """What a cutter says of itself; what is None was not said, and *refused* says why."""

    cutter: str
    url: str
    profile: str
    identity: str | None
    """What .A or OI answers."""
    status: CutterStatus | None
    free_bytes: int | None
    """Of its buffer (.B)."""
    capacity_bytes: int | None
    """The most that was free; None: it was not empty."""
    buffer_bytes: int | None
    """What it says that its buffer holds (.L)."""
    errors: tuple[int, ...]
    """Errors of the line, which asking has cleared (.E)."""
    handshake: str
    line: LineFigures
    refused: dict[str, str] = field(default_factory=dict)


@moves_nothing
async def info(
    url: CutterUrl,
    *,
    machine: Machine = Machine(),  # noqa: B008 - it is frozen
    line: CutterLine = CutterLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Say who a cutter is, how it stands, and how much its buffer holds. It moves nothing.

    Asks for model (.A or OI), status (.O), free space (.B), size of the buffer (.L), and errors of the line (.E), which
    clears them. The line is reset (.R) as it is opened, as for a job.

    ```sh
    compax camm1 info serial:///dev/ttyUSB0
    compax camm1 info serial:///dev/ttyUSB0?baudrate=4800 --profile pnc-900 --json
    ```
    """
    async with line.open(url, machine.known()) as cutter:
        told = await _read(cutter, url)
    printing.show(told, _for_people(told))


async def _read(cutter: Cutter, url: str) -> CutterInfo:
    asking = Asking()
    status = await asking.ask("status (.O)", cutter.status())
    free = await asking.ask("free space (.B)", cutter.free_space())
    size = None
    if "L" in cutter.profile.controls and status is not None and status.buffer_is_empty:
        size = await asking.ask("buffer size (.L)", cutter.buffer_size())
    error = await asking.ask("error (.E)", cutter.error())
    stats = cutter.stats
    return CutterInfo(
        cutter=cutter.name,
        url=url,
        profile=cutter.profile.name,
        identity=cutter.identity,
        status=status,
        free_bytes=free,
        capacity_bytes=cutter.capacity_bytes,
        buffer_bytes=size,
        errors=(*cutter.errors_found, *([error] if error else [])),
        handshake=_HANDSHAKE,
        line=LineFigures(
            exchanges=stats.exchanges,
            timeouts=stats.timeouts,
            strays=stats.strays,
            resynchronisations=stats.resynchronisations,
            median_answer_s=stats.answer_time_s(50),
            slowest_hundredth_s=stats.answer_time_s(99),
        ),
        refused=asking.refused,
    )


def _for_people(told: CutterInfo) -> RenderableType:
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for topic, line in (
        ("cutter", told.cutter),
        ("model", _model(told)),
        ("status", _status(told.status)),
        ("buffer", _buffer(told)),
        ("errors", _errors(told.errors)),
        ("handshake", told.handshake),
        ("line", _line(told.line)),
    ):
        table.add_row(topic, Text(line))
    return Group(table, *(Text(f"{name} was not said: {why}", style="yellow") for name, why in told.refused.items()))


def _model(told: CutterInfo) -> str:
    answer = "does not say who it is" if told.identity is None else f"says it is {told.identity!r}"
    return f"{answer}; talked to as {told.profile}"


def _status(status: CutterStatus | None) -> str:
    if status is None:
        return "not given"
    words = ["nothing to cut" if status.buffer_is_empty else "data in its buffer"]
    words += ["paused at the panel"] if status.is_paused else []
    words += ["suspended (VIEW, or the lever is up)"] if status.is_suspended else []
    return f"{', '.join(words)} (.O = {status.number})"


def _buffer(told: CutterInfo) -> str:
    words = ["free space not given" if told.free_bytes is None else f"{told.free_bytes:,} bytes free"]
    words += [] if told.buffer_bytes is None else [f"it says it holds {told.buffer_bytes:,}"]
    return ", ".join(words)


def _errors(codes: tuple[int, ...]) -> str:
    if not codes:
        return "none (.E)"
    told = (f"{code}: {IO_ERRORS[code].meaning}" if code in IO_ERRORS else f"{code}" for code in codes)
    return f"{'; '.join(told)} (.E; asking has cleared it)"


def _line(line: LineFigures) -> str:
    text = f"{line.exchanges} exchanges, {line.timeouts} time-outs"
    if line.median_answer_s is not None:
        text += f", answers within {line.median_answer_s * 1000:.1f} ms (median)"
    return text
