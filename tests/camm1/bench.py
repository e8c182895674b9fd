"""A simulated cutter on a test bench: a client at one end, the far end's testimony at the other."""

from __future__ import annotations

import asyncio
import itertools
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from random import Random
from typing import Any, Final

from compax_aio.camm1.connecting import connect
from compax_aio.camm1.cutter import Cutter
from compax_aio.camm1.pacing import HANDSHAKES, Handshake
from compax_aio.camm1.profiles import Profile
from compax_aio.camm1.settings import CutterSettings
from compax_aio.errors import CompaxError
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = [
    "FAST",
    "HANDSHAKES",
    "SIZES",
    "Bench",
    "Handshake",
    "bench",
    "codes",
    "ending",
    "expected_vectors",
    "job_of",
    "now",
    "outcome",
    "until",
    "vectors",
]

SIZES: Final = (60, 256, 1024, 15360)
FAST: Final = 0.05
"""A cutter that is so much faster than its knobs say is never the bottleneck at 9600 baud."""
_SOON_S: Final = 3000.0
_TICK_S: Final = 0.001

_numbers = itertools.count()
_Vectors = list[tuple[int, int, int, int, bool]]


@dataclass(slots=True)
class Bench:
    """What a test has at hand."""

    cutter: Cutter
    far: SimulatedCutter
    url: str
    listener: LoopbackListener
    connections: set[Connection]

    def lose_line(self) -> None:
        """Lose the line; it can be opened again."""
        for each in tuple(self.connections):
            each.abort()

    def fail(self, code: int) -> None:
        """Have the machine note an error of the line, as for a reason that shows nowhere else."""
        self.far._inside.note_io_error(code, now())


@asynccontextmanager
async def bench(
    settings: CutterSettings | None = None,
    *,
    profile: Profile | str = "PNC-1610",
    far: SimulatedCutter | None = None,
    fails_to_close: bool = False,
    baudrate: int = 9600,
    **knobs: Any,
) -> AsyncIterator[Bench]:
    """Connect to a simulated cutter with byte timing."""
    if far is None:
        far = SimulatedCutter(Knobs(baudrate=baudrate, **knobs))  # type: ignore[arg-type]  # a test's own knobs
    line = DeviceLine.of(far)
    connections: set[Connection] = set()
    listener = await listen(f"cutter-{next(_numbers)}", lambda: Connection(line, connections))
    settings = settings or CutterSettings(baud_rate=baudrate)
    cutter = await connect(listener.url, profile=profile, name="c", settings=settings)
    try:
        yield Bench(cutter, far, listener.url, listener, connections)
    finally:
        try:
            await cutter.close()
        except CompaxError:
            if not fails_to_close:
                raise
        listener.close()
        await asyncio.sleep(_TICK_S)


def job_of(size_bytes: int, seed: int = 1, *, longest_list: int = 1) -> str:
    """Make up a job: closed and open paths of short vectors, at least so many bytes, ending with the tool up."""
    random = Random(seed)
    parts, size = ["IN;PA;"], 6
    while size < size_bytes:
        x, y = random.randrange(20, 11_000), random.randrange(20, 9_000)
        texts = [f"PU{x},{y};"]
        for _ in range(random.randrange(3, 14)):
            pairs = []
            for _ in range(random.randrange(1, longest_list + 1)):
                x, y = max(0, x + random.randrange(-40, 41)), max(0, y + random.randrange(-40, 41))
                pairs.append(f"{x},{y}")
            texts.append(f"PD{','.join(pairs)};")
        parts += texts
        size += sum(map(len, texts))
    return "".join([*parts, "PU;"])


def expected_vectors(job: str) -> _Vectors:
    """Follow the tool through a job of IN, PA, PU and PD, as a reader of the manual would."""
    found: _Vectors = []
    x = y = 0
    for name, arguments in re.findall(r"(PU|PD)([0-9,]*);", job):
        numbers = [int(each) for each in arguments.split(",") if each]
        for to_x, to_y in zip(numbers[::2], numbers[1::2], strict=True):
            found.append((x, y, to_x, to_y, name == "PD"))
            x, y = to_x, to_y
    return found


def vectors(far: SimulatedCutter) -> _Vectors:
    """List what the far end has made, in its order."""
    far.advance()
    return [each[:5] for each in far.cuttings.vectors]


def codes(far: SimulatedCutter) -> list[str]:
    """List the errors of the line that the far end has noted."""
    return [each.text for each in far.log if each.kind is LogKind.IO_ERROR]


def now() -> float:
    """Return the time of the event loop."""
    return asyncio.get_running_loop().time()


async def until(condition: Callable[[], bool], at_most_s: float = 300.0) -> None:
    """Wait until *condition* holds."""
    async with asyncio.timeout(at_most_s):
        while not condition():  # noqa: ASYNC110  # a simulated cutter has no event to wait for
            await asyncio.sleep(_TICK_S)


async def outcome(awaitable: Awaitable[Any]) -> Any:
    """Return the result, or the error that it ends with."""
    try:
        async with asyncio.timeout(_SOON_S):
            return await awaitable
    except CompaxError as error:
        return error


async def ending(awaitable: Awaitable[Any]) -> CompaxError:
    """Return the error that *awaitable* must end with."""
    result = await outcome(awaitable)
    assert isinstance(result, CompaxError), f"it ended well: {result!r}"
    return result
