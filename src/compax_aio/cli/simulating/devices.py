"""The devices that `compax sim` serves, made from the words of the command."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from cyclopts import Parameter

from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.simulator.camm1 import Knobs as CutterKnobs
from compax_aio.simulator.camm1 import LogEntry as CutterLogEntry
from compax_aio.simulator.camm1 import SimulatedCutter
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.compax.log import LogEntry
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.haas import Knobs as ControlKnobs
from compax_aio.simulator.haas import LogEntry as ControlLogEntry
from compax_aio.simulator.haas import SimulatedControl
from compax_aio.simulator.outlet import Outlet, pty_outlet, tcp_outlet
from compax_aio.simulator.planned_faults import read_faults
from compax_aio.simulator.server import kept, state_files
from compax_aio.simulator.smc import Knobs as LineKnobs
from compax_aio.simulator.smc import SimulatedPartyLine
from compax_aio.simulator.smc.log import LogEntry as LineLogEntry

from ..number_words import WHOLE

__all__ = ["KINDS", "Device", "Entry", "Faults", "Kind", "Place", "made", "query_of"]

Device = SimulatedDrive | SimulatedPartyLine | SimulatedCutter | SimulatedControl
Entry = LogEntry | LineLogEntry | CutterLogEntry | ControlLogEntry

_LAST_PORT: Final = 65_535
_MOST_DEVICES: Final = 64


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Place:
    """Where devices are served, and under which names."""

    pty: Annotated[bool, Parameter(negative=())] = False
    """Serve each on a pseudo-terminal, as a serial port; so it is without --tcp."""
    tcp: Annotated[int | None, WHOLE] = None
    """Serve on this TCP port, several devices on those that follow; 0: free ones."""
    host: str = "127.0.0.1"
    """Address to listen on; 0.0.0.0 lets other computers in."""
    name: str | None = None
    """What the device is called; several are this and a number."""
    count: Annotated[int, WHOLE] = 1
    """So many devices, all alike."""
    link: Path | None = None
    """Make a link to the pseudo-terminal with this name, which stays the same; for several, with their numbers."""
    state: Path | None = None
    """File of what the device keeps without power: loaded first if it is there, saved at the end; several: a folder."""

    def names(self, usual: str) -> tuple[str, ...]:
        """
        Return the name of each device.

        Raises:
            InvalidCommandError: There cannot be so many, or the options contradict each other.
        """
        if not 1 <= self.count <= _MOST_DEVICES:
            raise InvalidCommandError(f"--count is 1 to {_MOST_DEVICES}, not {self.count}")
        if self.pty and self.tcp is not None:
            raise InvalidCommandError("a device has one line: say --pty or --tcp, not both")
        if self.link is not None and self.tcp is not None:
            raise InvalidCommandError("--link is to a pseudo-terminal, and --tcp makes none")
        if self.tcp is not None and not 0 <= self.tcp <= _LAST_PORT - (self.count - 1 if self.tcp else 0):
            raise InvalidCommandError(f"--tcp is 0 to {_LAST_PORT}, for the last device as well, not {self.tcp}")
        if self.tcp is None and os.name != "posix":
            raise InvalidCommandError("there are no pseudo-terminals on this system", hint="say --tcp 4001")
        name = self.name or usual
        if not name.isprintable() or any(each.isspace() for each in name):
            raise InvalidCommandError(f"{name!r} is no name: it has blanks or worse in it")
        return (name,) if self.count == 1 else tuple(f"{name}{number}" for number in range(1, self.count + 1))

    def outlet(self, device: Device, place: int) -> Outlet:
        """Return where the device is served that is number *place*, from 0 on."""
        if self.tcp is not None:
            return tcp_outlet(device, self.host, self.tcp + place if self.tcp else 0)
        link = self.link
        if link is not None and self.count > 1:
            link = link.with_name(f"{link.name}{place + 1}")
        return pty_outlet(device, link)

    @contextmanager
    def kept_state(self, devices: Mapping[str, Device]) -> Iterator[None]:
        """
        Let *devices* have kept what they kept the last time, and save it at the end of the block.

        Raises:
            TransportError: A file cannot be used.
        """
        if self.state is None:
            yield
        elif self.count == 1:
            (device,) = devices.values()
            with kept(device, self.state):
                yield
        else:
            files = state_files(self.state, devices)
            with _all(lambda name: kept(devices[name], files[name]), list(devices)):
                yield


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Faults:
    """What is to go wrong."""

    fault: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    """NAME[=CHANCE][:AMOUNT][@START[+SPAN]], again and again; `compax sim faults` lists the names."""
    seed: Annotated[int, WHOLE] = 0
    """Of all chance: the same seed, the same faults."""

    def on(self, device: Device, outlet: Outlet, say: Callable[[str], None]) -> FarEnd:
        """Return *device* with these faults, in the running event loop; raises InvalidCommandError."""
        return FarEnd(device, outlet, read_faults(self.fault), seed=self.seed, say=say)


class Kind(NamedTuple):
    """A kind of device that is served."""

    device: Callable[..., Device]
    knobs: type[Any]
    usual_name: str
    """Of one that was given none."""
    look: str
    """The command that looks at one."""


KINDS: Final[Mapping[str, Kind]] = {
    "compax": Kind(SimulatedDrive, Knobs, "drive", "status"),
    "smc": Kind(SimulatedPartyLine, LineKnobs, "line", "smc scan"),
    "camm1": Kind(SimulatedCutter, CutterKnobs, "cutter", "camm1 info"),
    "haas": Kind(SimulatedControl, ControlKnobs, "control", "haas query"),
}
"""By the word that names it."""


def made(kind: Kind, knobs: Sequence[str], place: Place, seed: int) -> dict[str, Device]:
    """
    Make devices, by name; *seed* is also theirs, if they have one and no knob says another.

    Raises:
        InvalidCommandError: A knob, a name or a number of devices cannot be.
    """
    own_seed = {"seed": str(seed)} if any(each.name == "seed" for each in fields(kind.knobs)) else {}
    query = own_seed | query_of(knobs)
    return {name: kind.device(_read(kind.knobs.from_query, query), name=name) for name in place.names(kind.usual_name)}


def query_of(knobs: Sequence[str]) -> dict[str, str]:
    """
    Read ``KNOB=VALUE`` words.

    Raises:
        InvalidCommandError: One is none, or is there twice.
    """
    query: dict[str, str] = {}
    for word in knobs:
        name, is_one, value = word.partition("=")
        if not is_one or not name:
            raise InvalidCommandError(f"{word!r} sets no knob", hint="write KNOB=VALUE, as in nominal_speed=150")
        if name in query:
            raise InvalidCommandError(f"the knob {name} is set twice")
        query[name] = value
    return query


def _read(read: Callable[[Mapping[str, str]], Any], query: Mapping[str, str]) -> Any:
    try:
        return read(query)
    except TransportError as error:  # as it is to who opens a URL with knobs
        raise InvalidCommandError(error.what, hint=error.hint) from error


@contextmanager
def _all(enter: Callable[[str], Any], names: Sequence[str]) -> Iterator[None]:
    """Hold several context managers open, and leave them in the opposite order."""
    if not names:
        yield
        return
    with enter(names[0]), _all(enter, names[1:]):
        yield
