"""A simulated control on a test bench: a client at one end, the far end's keys and testimony at the other."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from random import Random
from typing import Any, Final

from compax_aio.errors import CompaxError
from compax_aio.haas.connecting import connect
from compax_aio.haas.control import Control
from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM, Profile
from compax_aio.haas.settings import ControlSettings
from compax_aio.simulator.cable import Cable
from compax_aio.simulator.haas import Knobs, SimulatedControl
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import LoopbackListener, listen

__all__ = ["IN_BYTES", "MODES", "Bench", "bench", "ending", "now", "outcome", "program_of", "text_of", "until"]

IN_BYTES: Final = replace(CLASSIC, name="classic, parity in bytes", parity_in="bytes")
MODES: Final = {
    "rts/cts": CLASSIC_RTS_CTS,
    "xon/xoff": CLASSIC,
    "dc codes": CLASSIC_DC_CODES,
    "xmodem": CLASSIC_XMODEM,
}

_SOON_S: Final = 20_000.0
_TICK_S: Final = 0.001
_numbers = itertools.count()


@dataclass(slots=True)
class Bench:
    """What a test has at hand."""

    control: Control
    far: SimulatedControl
    line: DeviceLine
    listener: LoopbackListener
    connections: set[Connection]

    def lose_line(self) -> None:
        """Lose the line; it can be opened again."""
        for each in tuple(self.connections):
            each.abort()

    async def press(self, key: str, what: str = "", *, after_s: float = 0.0) -> None:
        """Press SEND, RECV or MDI DNC twice."""
        await asyncio.sleep(after_s)
        if key == "send":
            self.far.press_send(what or "ALL")
        elif key == "recv":
            self.far.press_recv(what or "programs")
        else:
            self.far.press_dnc()

    def hand(self, *presses: tuple[str, str]) -> Callable[[str], None]:
        """Return an operator who presses one key each time that something is to be done, a second later."""
        rest = iter(presses)
        loop = asyncio.get_running_loop()

        def act(_: str) -> None:
            key, what = next(rest)
            loop.call_later(1.0, lambda: self.far.press_send(what) if key == "send" else self.far.press_recv(what))

        return act


@asynccontextmanager
async def bench(
    profile: Profile = CLASSIC,
    *,
    settings: ControlSettings | None = None,
    cable: Cable | None = None,
    baudrate: int | None = None,
    **knobs: Any,
) -> AsyncIterator[Bench]:
    """Connect to a simulated control that is set up as *profile* says."""
    as_profile: dict[str, Any] = {
        "baudrate": profile.baudrate if baudrate is None else baudrate,
        "parity": profile.parity,
        "stop_bits": profile.stop_bits,
        "data_bits": profile.data_bits,
        "synchronization": profile.synchronization,
        "eob": profile.eob,
        "parity_in_bytes": profile.parity_in == "bytes",
        "data_collection": "off",
        "add_spaces": "off",
    }
    as_profile = {key: value for key, value in as_profile.items() if value is not None}
    far = SimulatedControl(Knobs(**(as_profile | knobs)))
    line = DeviceLine.of(far)
    if cable is not None:
        line.lay(cable)
    connections: set[Connection] = set()
    listener = await listen(f"control-{next(_numbers)}", lambda: Connection(line, connections))
    settings = settings or ControlSettings(baud_rate=far.baudrate or None)
    control = await connect(listener.url, profile=profile, name="c", settings=settings)
    try:
        yield Bench(control, far, line, listener, connections)
    finally:
        await control.close()
        listener.close()
        await asyncio.sleep(_TICK_S)


def program_of(size_bytes: int, seed: int = 1, *, number: int = 1234) -> str:
    """Make up a program of at least so many bytes, in the form in which a control stores it: blocks between LF."""
    random = Random(seed)
    lines = [f"O{number:05d}(PART {seed})", "G90G54G0X0Y0"]
    size = 40
    while size < size_bytes:
        block = (
            f"G1X{random.randrange(-9999, 9999) / 1000:.3f}Y{random.randrange(-9999, 9999) / 1000:.3f}F{seed % 90 + 1}"
        )
        lines.append(block)
        size += len(block) + 1
    return "\n".join([*lines, "M30"])


def text_of(program: bytes) -> str:
    """Return the blocks of what was received, as a control stores them."""
    lines = [line.strip() for line in program.decode("ascii").splitlines()]
    return "\n".join(line for line in lines if line not in {"", "%"})


def now() -> float:
    """Return the time of the event loop."""
    return asyncio.get_running_loop().time()


async def until(condition: Callable[[], bool], at_most_s: float = 3000.0) -> None:
    """Wait until *condition* holds."""
    async with asyncio.timeout(at_most_s):
        while not condition():  # noqa: ASYNC110  # a simulated control has no event to wait for
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
