"""
What a position costs through what a user would pick instead, each as its own documents use it.

All write the same line to the same far end, read until the prompt and return a number. Those made on asyncio have a
lock and a time-out, as who shares a line needs. Those that block are measured in a thread, as an asyncio program has to
use them; and as they are, when nothing else can happen meanwhile. What each does when an answer comes late is measured
by ``make torture``.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Final

import compax_aio

from ..far_ends.canned import HOST
from ..measuring import LOOPS, Effort, FarEnd, Figure, Measured, Results, Row, above, far_end, interleaved_async
from ..measuring.exchanges import CPU_US, WALL_US, a_round, a_round_async
from ..measuring.floor import LINE, PROMPT
from ..measuring.machine import version

__all__ = ["OURS", "PEERS", "Peer", "Where", "measure", "number_in"]

OURS: Final = "compax_aio, drive.position()"

_TIMEOUT_S: Final = 1.0
_BAUD: Final = 9600
_LONGEST: Final = 64


@dataclass(frozen=True, slots=True)
class Where:
    """A line of the far end: its TCP port, and a pseudo-terminal that nobody else uses."""

    port: int
    path: str


Ask = Callable[[], Awaitable[float]]
AskAndBlock = Callable[[], float]
Opened = AbstractAsyncContextManager[Ask | AskAndBlock]


def number_in(answer: bytes | str) -> float:
    """Take the number from ``S001: 120.50``, with its prompt or without."""
    text = answer.decode() if isinstance(answer, bytes) else answer
    return float(text.rpartition(":")[2].rstrip("\r\n>"))


# compax_aio ---------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def _ours_on_tcp(where: Where) -> AsyncIterator[Ask]:
    async with compax_aio.connect(f"tcp://{HOST}:{where.port}") as drive:
        yield drive.position


@asynccontextmanager
async def _ours_on_pty(where: Where) -> AsyncIterator[Ask]:
    async with compax_aio.connect(f"serial://{where.path}?baudrate={_BAUD}") as drive:
        yield drive.position


# On asyncio ---------------------------------------------------------------------------------------------------------


def _with_lock(reader: Any, writer: Any) -> Ask:
    lock = asyncio.Lock()

    async def ask() -> float:
        async with lock, asyncio.timeout(_TIMEOUT_S):
            writer.write(LINE)
            return number_in(await reader.readuntil(PROMPT))

    return ask


@asynccontextmanager
async def _streams(where: Where) -> AsyncIterator[Ask]:
    reader, writer = await asyncio.open_connection(HOST, where.port)
    try:
        yield _with_lock(reader, writer)
    finally:
        writer.close()


@asynccontextmanager
async def _serial_streams(where: Where, module: str) -> AsyncIterator[Ask]:
    reader, writer = await import_module(module).open_serial_connection(url=where.path, baudrate=_BAUD)
    try:
        yield _with_lock(reader, writer)
    finally:
        writer.close()
        await asyncio.sleep(0)  # it lets go of the port when the loop comes round


@asynccontextmanager
async def _anyio(where: Where) -> AsyncIterator[Ask]:
    anyio = import_module("anyio")
    buffered = import_module("anyio.streams.buffered").BufferedByteReceiveStream
    async with await anyio.connect_tcp(HOST, where.port) as stream:
        receiving = buffered(stream)
        lock = anyio.Lock()

        async def ask() -> float:
            async with lock:
                with anyio.fail_after(_TIMEOUT_S):
                    await stream.send(LINE)
                    return number_in(await receiving.receive_until(PROMPT, _LONGEST))

        yield ask


@asynccontextmanager
async def _sockio(where: Where) -> AsyncIterator[Ask]:
    tcp = import_module("sockio.aio").TCP(HOST, where.port, eol=PROMPT, timeout=_TIMEOUT_S)
    await tcp.open()

    async def ask() -> float:
        return number_in(await tcp.write_readline(LINE))

    try:
        yield ask
    finally:
        await tcp.close()


@asynccontextmanager
async def _aioserial(where: Where) -> AsyncIterator[Ask]:
    port = import_module("aioserial").AioSerial(where.path, _BAUD, timeout=_TIMEOUT_S)
    lock = asyncio.Lock()

    async def ask() -> float:
        async with lock:
            await port.write_async(LINE)
            return number_in(await port.read_until_async(PROMPT))

    try:
        yield ask
    finally:
        port.close()


# What blocks --------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def _pyserial(where: Where) -> AsyncIterator[AskAndBlock]:
    with import_module("serial").Serial(where.path, _BAUD, timeout=_TIMEOUT_S) as port:

        def ask() -> float:
            port.write(LINE)
            return number_in(port.read_until(PROMPT))

        yield ask


@asynccontextmanager
async def _serialx(where: Where) -> AsyncIterator[AskAndBlock]:
    with import_module("serialx").Serial(where.path, _BAUD, read_timeout=_TIMEOUT_S) as port:

        def ask() -> float:
            port.write(LINE)
            return number_in(port.read_until(PROMPT))

        yield ask


@asynccontextmanager
async def _visa(where: Where, name: str) -> AsyncIterator[AskAndBlock]:
    manager = import_module("pyvisa").ResourceManager("@py")
    instrument = manager.open_resource(
        name.format(host=HOST, port=where.port, path=where.path),
        read_termination=PROMPT.decode(),
        write_termination="\r",
        timeout=_TIMEOUT_S * 1000,
    )
    question = LINE.decode().removesuffix("\r")

    def ask() -> float:
        return number_in(instrument.query(question))

    try:
        yield ask
    finally:
        instrument.close()
        manager.close()


@asynccontextmanager
async def _in_thread(
    where: Where, open_it: Callable[[Where], AbstractAsyncContextManager[AskAndBlock]]
) -> AsyncIterator[Ask]:
    async with open_it(where) as ask:
        lock = asyncio.Lock()

        async def ask_in_thread() -> float:
            async with lock:
                return await asyncio.to_thread(ask)

        yield ask_in_thread


# The list -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """
    One row.

    Attributes:
        medium: On what it is measured.
        open: Opens a line, and gives what asks over it.
        packages: Whose versions are shown; all must be installed.
        blocks: It is called, not awaited, so the event loop does not matter.
    """

    name: str
    medium: str
    open: Callable[[Where], Opened]
    packages: tuple[str, ...] = ()
    blocks: bool = False

    @property
    def is_installed(self) -> bool:
        """Whether it can be measured."""
        return all(version(each) for each in self.packages)

    @property
    def title(self) -> str:
        """Its name, and the versions of what it is made of."""
        made_of = ", ".join(f"{each} {version(each)}" for each in self.packages)
        return f"{self.name} [{made_of}]" if made_of else self.name


_VISA: Final = ("PyVISA", "PyVISA-py")
_ON_TCP: Final = "TCPIP::{host}::{port}::SOCKET"
_ON_PTY: Final = "ASRL{path}::INSTR"

_BLOCKING: Final[
    Mapping[str, tuple[str, Callable[[Where], AbstractAsyncContextManager[AskAndBlock]], tuple[str, ...]]]
] = {
    "PyVISA-py": ("TCP", partial(_visa, name=_ON_TCP), _VISA),
    "pyserial": ("pty", _pyserial, ("pyserial",)),
    "serialx": ("pty", _serialx, ("serialx",)),
    "PyVISA-py, serial": ("pty", partial(_visa, name=_ON_PTY), _VISA),
}

PEERS: Final = (
    Peer(name="asyncio streams, lock, time-out", medium="TCP", open=_streams),
    Peer(name="anyio streams, lock, time-out", medium="TCP", open=_anyio, packages=("anyio",)),
    Peer(name="sockio", medium="TCP", open=_sockio, packages=("sockio",)),
    Peer(
        name="pyserial-asyncio streams, lock, time-out",
        medium="pty",
        open=partial(_serial_streams, module="serial_asyncio"),
        packages=("pyserial-asyncio",),
    ),
    Peer(
        name="serialx streams, lock, time-out",
        medium="pty",
        open=partial(_serial_streams, module="serialx"),
        packages=("serialx",),
    ),
    Peer(name="aioserial, lock", medium="pty", open=_aioserial, packages=("aioserial",)),
    *(
        Peer(
            name=f"{name} in a thread, lock",
            medium=medium,
            open=partial(_in_thread, open_it=open_it),
            packages=packages,
        )
        for name, (medium, open_it, packages) in _BLOCKING.items()
    ),
    *(
        Peer(name=f"{name}, blocking", medium=medium, open=open_it, packages=packages, blocks=True)
        for name, (medium, open_it, packages) in _BLOCKING.items()
    ),
)
"""What a user would pick instead."""

_OURS: Final = {
    "TCP": Peer(name=OURS, medium="TCP", open=_ours_on_tcp),
    "pty": Peer(name=OURS, medium="pty", open=_ours_on_pty),
}


async def _a_round_blocking(ask: AskAndBlock, round_s: float) -> Measured:
    return a_round(ask, round_s)


def _round_of(peer: Peer, ask: Any, round_s: float) -> Callable[[], Awaitable[Measured]]:
    return partial(_a_round_blocking if peer.blocks else a_round_async, ask, round_s)


async def _measure(effort: Effort, far: FarEnd, peers: Sequence[Peer]) -> Results:
    async with AsyncExitStack() as stack:
        candidates = {}
        for peer, path in zip(peers, far.where["pty"], strict=False):
            ask = await stack.enter_async_context(peer.open(Where(far.where["tcp"], path)))
            candidates[peer.name] = _round_of(peer, ask, effort.round_s)
        return await interleaved_async(effort, candidates)


def _row(peer: Peer, results: Results) -> Row:
    wall, of_ours = results.median(peer.name, WALL_US), results.ratio(peer.name, OURS, WALL_US)
    return Row(
        name=peer.title,
        value=results.median(peer.name, CPU_US),
        unit=CPU_US,
        ratio=results.ratio(peer.name, OURS, CPU_US),
        spread=results.spread(peer.name, CPU_US),
        note=f"{wall:.0f} µs on the wall, {of_ours:.2f} times",
    )


def _figure(medium: str, loop: str, ours: Peer, peers: Sequence[Peer], results: Results, *, block: bool) -> Figure:
    peers = [each for each in peers if each.blocks is block]
    missing = [each for each in PEERS if each.medium == medium and each.blocks is block and not each.is_installed]
    ratios = {peer.name: results.ratio(peer.name, OURS, CPU_US) for peer in peers}
    closest = min(ratios, key=ratios.__getitem__) if ratios else None
    rows = [_row(each, results) for each in (ours, *peers)]
    rows += [Row(name=each.name, value=None, unit=CPU_US, note="not installed") for each in missing]
    what = "others that block the event loop" if block else "others that are awaited"
    return Figure(
        name=f"a position on {medium}, {loop}: the cheapest of {what}",
        value=ratios[closest] if closest else None,
        unit="times our CPU",
        target=above(1.0),
        spread=results.ratio_spread(closest, OURS, CPU_US) if closest else None,
        ratio_of="ours",
        rows=rows,
        notes=[] if closest else ["no other is installed; make bench installs them"],
    )


def measure(effort: Effort, loops: Mapping[str, Callable[[], asyncio.AbstractEventLoop]] = LOOPS) -> Sequence[Figure]:
    """Measure what is installed, on TCP and on a pseudo-terminal; what blocks only beside asyncio's own event loop."""
    figures = []
    with far_end("benchmarks.far_ends.canned", str(len(PEERS) + 1)) as far:
        for loop, loop_factory in loops.items():
            for medium, ours in _OURS.items():
                blocks = (False, True) if loop == "asyncio" else (False,)
                others = [
                    each for each in PEERS if each.medium == medium and each.is_installed and each.blocks in blocks
                ]
                with asyncio.Runner(loop_factory=loop_factory) as runner:
                    results = runner.run(_measure(effort, far, [ours, *others]))
                figures += [_figure(medium, loop, ours, others, results, block=each) for each in blocks]
    return figures
