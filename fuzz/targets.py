"""Every parser as a function of bytes; what it may raise is caught, all else is a finding."""

from __future__ import annotations

import asyncio
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

import compax_aio
from compax_aio import DriveSettings
from compax_aio.compax import codecs
from compax_aio.compax.plain_line import check_line
from compax_aio.compax.program import check, normalise, parse, parse_record, wire_line
from compax_aio.compax.program.shown import read_shown
from compax_aio.compax.protocol import CompaxProtocol
from compax_aio.compax.settings_file import read_settings
from compax_aio.compax.value_file import read_file
from compax_aio.errors import CompaxError, InvalidCommandError, LinkProtocolError, TransportError, UnexpectedAnswerError
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.compax.state import read_state_file
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import listen
from compax_aio.transports.url import TransportURL

__all__ = ["TARGETS"]

_FILE: Final = Path(tempfile.gettempdir()) / "compax_aio_fuzz.tmp"
_QUICK: Final = DriveSettings(answer_timeout_s=0.2, in_doubt_after_s=1.0, stop_timeout_s=1.0, stall_timeout_s=1.0)

_DOORS: Final[tuple[Callable[[CompaxProtocol], object], ...]] = (
    lambda protocol: protocol.send("S1"),
    lambda protocol: protocol.send("PA5$"),
    lambda protocol: protocol.send("AL 100"),
    CompaxProtocol.send_marker,
    lambda protocol: protocol.send_ahead("STOP"),
    CompaxProtocol.time_ran_out,
    CompaxProtocol.line_opened,
    CompaxProtocol.resume,
)


def protocol(data: bytes) -> None:
    """Take bytes of 0x80 and above for what the link does, the others for what comes in between."""
    end = CompaxProtocol()
    end.line_opened()
    for piece in re.findall(rb"[\x80-\xff]|[\x00-\x7f]+", data):
        if piece[0] >= 0x80:
            with suppress(LinkProtocolError):
                _DOORS[piece[0] % len(_DOORS)](end)
        else:
            end.receive(piece)
        sent = end.bytes_to_send()
        assert re.fullmatch(rb"((S[0-9]+|PA5\$|AL 100|STOP)\r)*", sent), sent
        assert all(repr(event).isprintable() for event in end.events())


def answers(data: bytes) -> None:
    """Decode it, with every decoder."""
    answer = data[:256].decode("latin-1")
    for decode in (
        codecs.decode_number,
        codecs.decode_history,
        codecs.decode_error,
        codecs.decode_interface,
        lambda text: codecs.DriveStatus.decode(text, text),
        lambda text: codecs.decode_monitor_value(13, text, text, "mm"),
        lambda text: [codecs.decode_status_value(number, text, "mm") for number in (1, 9, 16, 18, 19, 30, 250)],
    ):
        with suppress(UnexpectedAnswerError):
            decode(answer)


def lines(data: bytes) -> None:
    """Check a line: what is taken as one is one, of printable ASCII."""
    with suppress(InvalidCommandError):
        line = check_line(data.decode("utf-8", "surrogateescape"))
        assert re.fullmatch(r"[ -~]{1,30}", line)
        assert not set(line) & set("$?!,>")


def listings(data: bytes) -> None:
    """Read a listing, and write its records as lines."""
    text = data.decode("utf-8", "replace")
    check(text)
    normalise(text)
    read_shown(text, decimals=2)
    with suppress(InvalidCommandError):
        parse_record(text)
    with suppress(InvalidCommandError):
        for number, record in parse(text).items():
            assert re.fullmatch(r"[ -~]{1,30}", wire_line(number, record))


def _file(read: Callable[[Path], object], data: bytes) -> None:
    _FILE.write_bytes(data)
    with suppress(ValueError):
        read(_FILE)


def urls(data: bytes) -> None:
    """Read a URL, and its query as the knobs of a simulated drive."""
    with suppress(TransportError):
        url = TransportURL.parse(data.decode("utf-8", "surrogateescape"))
        url.number("number", 1.0, above=0.0, maximum=9.0)
        url.integer("integer", 1, minimum=0, maximum=9)
        Knobs.from_query(url.query)


def simulator(data: bytes) -> None:
    """Let a simulated drive receive it; the first byte says whether it takes binary."""
    far, now = SimulatedDrive(Knobs(p20=16 if data[:1] > b"\x80" else 0, password="off")), 0.0
    far.connect(now)
    for piece in re.findall(rb"[^\r]*\r?", data[1:]):
        far.receive(piece, now)
        now += 0.1
        far.take_output(now)
    far.receive(b"\r" * 40 + b"S1\r", now)
    assert b"S001:" in far.take_output(now + 5)


class _Babble(Connection):
    """A line on which, for a while, something else comes than the drive says."""

    def __init__(self, line: DeviceLine, pieces: Iterator[bytes]) -> None:
        super().__init__(line, set())
        self.pieces: Iterator[bytes] | None = pieces

    def data_received(self, data: bytes) -> None:
        """Hand on sense, or answer with nonsense."""
        if self.pieces is None:
            super().data_received(data)
        elif self._transport is not None:
            self._transport.write(next(self.pieces, b""))


def client(data: bytes) -> None:
    """Let a client use a line that babbles until sense returns; then the drive is where it is."""
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(_through_babble(data))


async def _through_babble(data: bytes) -> None:
    complaints: list[str] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(str(context)))
    line, near = DeviceLine.of(SimulatedDrive(Knobs(position=12.5))), list[_Babble]()

    def connect() -> _Babble:
        near.append(_Babble(line, iter(data.split(b"\xff"))))
        near[0].pieces = None
        return near[0]

    with await listen("babble", connect) as listener:
        async with compax_aio.connect(listener.url, name="x", settings=_QUICK) as drive:
            near[0].pieces = iter(data.split(b"\xff"))
            for call in (
                drive.position,
                drive.status,
                partial(drive.command, "AL 100"),
                drive.error_history,
                drive.stop,
            ):
                with suppress(CompaxError):
                    await call()
            near[0].pieces = None
            for _ in range(2):
                with suppress(CompaxError):
                    await drive.position()
                await asyncio.sleep(1)
            assert await drive.position() == 12.5
    assert not complaints, complaints


TARGETS: Final[dict[str, Callable[[bytes], None]]] = {
    "protocol": protocol,
    "answers": answers,
    "lines": lines,
    "listings": listings,
    "settings": partial(_file, read_settings),
    "parameters": partial(_file, partial(read_file, kind="parameters", letter="P")),
    "state": partial(_file, read_state_file),
    "urls": urls,
    "simulator": simulator,
    "client": client,
}
