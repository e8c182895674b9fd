"""The peers of the torture: each library as its own documents use it, with nothing set but the time-out."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module, metadata
from platform import python_version
from typing import Any, Final, Protocol, Self

from .torture_far_end import HOST, CompaxLines, Dialect, Endpoint, ModbusRtu, ModbusTcp, Question

__all__ = ["PEERS", "Client", "Peer"]

PROMPT: Final = b">"
_DISCARD_S: Final = 0.01


class Client(Protocol):
    """One open client."""

    async def ask(self, question: Question) -> str:
        """Return what the client hands its caller as the answer; raise what it raises."""

    async def close(self) -> None:
        """Close the line."""


def _text(answer: bytes | str) -> str:
    return (answer.decode() if isinstance(answer, bytes) else answer).strip("\r\n>")


# asyncio ------------------------------------------------------------------------------------------------------------


class _CompaxAio:
    """The library that this project is."""

    def __init__(self, drive: Any) -> None:
        self._drive = drive
        self._rejected = import_module("compax_aio").CommandRejectedError

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        compax_aio = import_module("compax_aio")
        settings = import_module("compax_aio.compax.settings").DriveSettings(answer_timeout_s=timeout_s)
        return cls(await compax_aio.connect(f"tcp://{HOST}:{where.tcp_port}", name="drive", settings=settings))

    async def ask(self, question: Question) -> str:
        if question.writes:
            return str(await self._drive.move_to(question.value))
        try:
            return str(await self._drive.command(question.line))
        except self._rejected as error:
            return str(error.received)

    async def close(self) -> None:
        await self._drive.close()


class _Streams:
    """What people write by hand: a lock, a write, and ``readuntil`` under ``wait_for``."""

    def __init__(self, streams: tuple[Any, Any], timeout_s: float) -> None:
        self._reader, self._writer = streams
        self._timeout_s = timeout_s
        self._lock = asyncio.Lock()

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        return cls(await asyncio.open_connection(HOST, where.tcp_port), timeout_s)

    async def ask(self, question: Question) -> str:
        async with self._lock:
            return await self._exchange(question.line)

    async def _exchange(self, line: str) -> str:
        self._writer.write(line.encode() + b"\r")
        return _text(await asyncio.wait_for(self._reader.readuntil(PROMPT), self._timeout_s))

    async def close(self) -> None:
        self._writer.close()


class _DiscardingStreams(_Streams):
    """The same, and what has come meanwhile is thrown away before the next question."""

    async def _exchange(self, line: str) -> str:
        try:
            while True:
                await asyncio.wait_for(self._reader.read(4096), _DISCARD_S)
        except TimeoutError:
            return await super()._exchange(line)


class _ReopeningStreams(_Streams):
    """The same, and after a time-out or a cancellation the line is closed, to be opened anew by the next question."""

    def __init__(self, streams: tuple[Any, Any], timeout_s: float, port: int) -> None:
        super().__init__(streams, timeout_s)
        self._port = port

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        return cls(await asyncio.open_connection(HOST, where.tcp_port), timeout_s, where.tcp_port)

    async def _exchange(self, line: str) -> str:
        if self._writer.is_closing():
            self._reader, self._writer = await asyncio.open_connection(HOST, self._port)
        try:
            return await super()._exchange(line)
        except BaseException:
            self._writer.close()
            raise


class _SerialxStreams(_Streams):
    """serialx's asyncio streams, used likewise."""

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        serialx = import_module("serialx")
        return cls(await serialx.open_serial_connection(where.path, baudrate=9600), timeout_s)


class _Sockio:
    """sockio's asyncio client."""

    def __init__(self, tcp: Any) -> None:
        self._tcp = tcp

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        return cls(import_module("sockio.aio").TCP(HOST, where.tcp_port, eol=PROMPT, timeout=timeout_s))

    async def ask(self, question: Question) -> str:
        return _text(await self._tcp.write_readline(question.line.encode() + b"\r"))

    async def close(self) -> None:
        await self._tcp.close()


class _Aioserial:
    """aioserial: pyserial in a thread, awaited."""

    def __init__(self, port: Any) -> None:
        self._port = port

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float) -> Self:
        return cls(import_module("aioserial").AioSerial(where.path, 9600, timeout=timeout_s))

    async def ask(self, question: Question) -> str:
        await self._port.write_async(question.line.encode() + b"\r")
        return _whole(await self._port.read_until_async(PROMPT))

    async def close(self) -> None:
        await asyncio.to_thread(self._port.close)


def _whole(answer: bytes) -> str:
    """Tell a time-out as pyserial tells it: the end is missing."""
    if not answer.endswith(PROMPT):
        raise TimeoutError
    return _text(answer)


class _Pymodbus:
    """pymodbus's asyncio client."""

    def __init__(self, client: Any) -> None:
        self._client = client

    @classmethod
    async def open(cls, where: Endpoint, timeout_s: float, framer: str = "RTU", **options: Any) -> Self:
        framers = import_module("pymodbus").FramerType
        client = import_module("pymodbus.client").AsyncModbusTcpClient(
            HOST, port=where.tcp_port, framer=framers[framer], timeout=timeout_s, **options
        )
        await client.connect()
        return cls(client)

    async def ask(self, question: Question) -> str:
        if question.writes:
            return str(await self._client.write_register(question.register, question.value))
        answer = await self._client.read_holding_registers(question.register)
        return str(answer.registers[0])

    async def close(self) -> None:
        self._client.close()


# _Blocking -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Blocking:
    """A client that blocks, in a thread of its own, as asyncio programs use it."""

    exchange: Callable[[Question], str]
    hang_up: Callable[[], object]

    async def ask(self, question: Question) -> str:
        return await asyncio.to_thread(self.exchange, question)

    async def close(self) -> None:
        await asyncio.to_thread(self.hang_up)


def _in_thread(make: Callable[..., _Blocking], **options: Any) -> Callable[[Endpoint, float], Awaitable[Client]]:
    async def open_it(where: Endpoint, timeout_s: float) -> Client:
        return await asyncio.to_thread(make, where, timeout_s, **options)

    return open_it


def _pyserial(where: Endpoint, timeout_s: float, discards: bool = False) -> _Blocking:
    port = import_module("serial").Serial(where.path, 9600, timeout=timeout_s)

    def exchange(question: Question) -> str:
        if discards:
            port.reset_input_buffer()
        port.write(question.line.encode() + b"\r")
        return _whole(port.read_until(PROMPT))

    return _Blocking(exchange, port.close)


def _visa_name(where: Endpoint) -> str:
    return f"TCPIP::{HOST}::{where.tcp_port}::SOCKET"


def _visa_options(timeout_s: float) -> Mapping[str, Any]:
    return {"read_termination": PROMPT.decode(), "write_termination": "\r", "timeout": timeout_s * 1000}


def _pyvisa(where: Endpoint, timeout_s: float, clears: bool = False) -> _Blocking:
    manager = import_module("pyvisa").ResourceManager("@py")
    instrument = manager.open_resource(_visa_name(where), **_visa_options(timeout_s))

    def exchange(question: Question) -> str:
        if clears:
            instrument.clear()
        return _text(instrument.query(question.line))

    def hang_up() -> None:
        instrument.close()
        manager.close()

    return _Blocking(exchange, hang_up)


def _pymeasure(where: Endpoint, timeout_s: float) -> _Blocking:
    adapter = import_module("pymeasure.adapters").VISAAdapter(
        _visa_name(where), visa_library="@py", **_visa_options(timeout_s)
    )
    instrument = import_module("pymeasure.instruments").Instrument(adapter, "drive", includeSCPI=False)

    def hang_up() -> None:
        adapter.close()
        adapter.manager.close()

    return _Blocking(lambda question: _text(instrument.ask(question.line)), hang_up)


def _minimalmodbus(where: Endpoint, timeout_s: float) -> _Blocking:
    instrument = import_module("minimalmodbus").Instrument(where.path, 1)
    instrument.serial.timeout = timeout_s

    def exchange(question: Question) -> str:
        if question.writes:
            return str(instrument.write_register(question.register, question.value, functioncode=6))
        return str(instrument.read_register(question.register))

    return _Blocking(exchange, instrument.serial.close)


# The list -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """
    One row of the tables.

    Attributes:
        packages: Whose versions are shown; all must be installed.
        open: Connects within the time-out that it is given, in seconds.
        dialect: What the far end speaks.
        on_port: It needs a serial port, not TCP.
        blocks: Its calls block, so there is nobody who could be cancelled.
        forgets_closed: The far end drops answers whose connection is closed.
        is_remedy: Not the default, but something that helps, or is said to.
    """

    name: str
    packages: tuple[str, ...] = ()
    open: Callable[[Endpoint, float], Awaitable[Client]]
    dialect: Dialect = field(default_factory=CompaxLines)
    on_port: bool = False
    blocks: bool = False
    forgets_closed: bool = False
    is_remedy: bool = False

    @property
    def version(self) -> str | None:
        """What is installed; None if something is not."""
        try:
            return " + ".join(metadata.version(each) for each in self.packages) or f"CPython {python_version()}"
        except metadata.PackageNotFoundError:
            return None

    @property
    def is_on_lines(self) -> bool:
        """Whether it talks in lines, as a COMPAX does."""
        return isinstance(self.dialect, CompaxLines)


_VISA: Final = ("PyVISA", "PyVISA-py")

PEERS: Final = (
    Peer(name="compax_aio", packages=("compax-aio",), open=_CompaxAio.open),
    Peer(name="asyncio streams", open=_Streams.open),
    Peer(name="serialx streams", packages=("serialx",), open=_SerialxStreams.open, on_port=True),
    Peer(name="aioserial", packages=("aioserial",), open=_Aioserial.open, on_port=True),
    Peer(name="sockio", packages=("sockio",), open=_Sockio.open),
    Peer(name="pyserial", packages=("pyserial",), open=_in_thread(_pyserial), on_port=True, blocks=True),
    Peer(name="PyVISA, PyVISA-py", packages=_VISA, open=_in_thread(_pyvisa), blocks=True),
    Peer(name="PyMeasure", packages=("PyMeasure",), open=_in_thread(_pymeasure), blocks=True),
    Peer(name="pymodbus, RTU", packages=("pymodbus",), open=_Pymodbus.open, dialect=ModbusRtu()),
    Peer(
        name="minimalmodbus",
        packages=("minimalmodbus",),
        open=_in_thread(_minimalmodbus),
        dialect=ModbusRtu(),
        on_port=True,
        blocks=True,
    ),
    # What helps, or is said to
    Peer(name="asyncio streams, discarding before asking", open=_DiscardingStreams.open, is_remedy=True),
    Peer(name="asyncio streams, opened anew", open=_ReopeningStreams.open, is_remedy=True),
    Peer(
        name="asyncio streams, opened anew, far end forgets",
        open=_ReopeningStreams.open,
        forgets_closed=True,
        is_remedy=True,
    ),
    Peer(name="sockio, far end forgets", packages=("sockio",), open=_Sockio.open, forgets_closed=True, is_remedy=True),
    Peer(
        name="pyserial, reset_input_buffer() before asking",
        packages=("pyserial",),
        open=_in_thread(_pyserial, discards=True),
        on_port=True,
        blocks=True,
        is_remedy=True,
    ),
    Peer(
        name="PyVISA, PyVISA-py, clear() before asking",
        packages=_VISA,
        open=_in_thread(_pyvisa, clears=True),
        blocks=True,
        is_remedy=True,
    ),
    Peer(
        name="pymodbus, RTU, retries=0",
        packages=("pymodbus",),
        open=partial(_Pymodbus.open, retries=0),
        dialect=ModbusRtu(),
        is_remedy=True,
    ),
    Peer(
        name="pymodbus, Modbus TCP",
        packages=("pymodbus",),
        open=partial(_Pymodbus.open, framer="SOCKET"),
        dialect=ModbusTcp(),
        is_remedy=True,
    ),
)
