"""TLS lines: the conformance suite, certificates that are refused, files that are of no use, and far ends that hang."""

from __future__ import annotations

import asyncio
import datetime as dt
import socket
import ssl
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import trustme
from cryptography.hazmat.primitives import serialization
from tests.conformance.far_ends import FarEnd, StreamFarEnd, listening_on_tcp
from tests.conformance.transport import TransportConformance, Witness, descriptors

from compax_aio.errors import ConnectionLostError, TransportError
from compax_aio.transports import TransportURL, open_transport
from compax_aio.transports.tls import open_tls


class Plant:
    """A certificate authority, its file, and contexts of servers that it vouches for."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.ca = trustme.CA()
        self.cafile = directory / "ca.pem"
        self.ca.cert_pem.write_to_path(str(self.cafile))

    def server(self, *names: str, needs_client: bool = False, **more: Any) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.ca.issue_cert(*names or ("127.0.0.1",), **more).configure_cert(context)
        if needs_client:
            context.verify_mode = ssl.CERT_REQUIRED
            self.ca.configure_trust(context)
        return context

    def client(self, name: str = "client") -> tuple[Path, Path]:
        issued = self.ca.issue_cert("line@plant.example")
        certfile, keyfile = self.directory / f"{name}.pem", self.directory / f"{name}.key"
        certfile.write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
        keyfile.write_bytes(issued.private_key_pem.bytes())
        return certfile, keyfile


@pytest.fixture(scope="session")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Plant:
    return Plant(tmp_path_factory.mktemp("plant"))


@asynccontextmanager
async def serving(context: ssl.SSLContext | None) -> AsyncIterator[tuple[int, StreamFarEnd]]:
    far = StreamFarEnd()
    server = await asyncio.start_server(far.accept, "127.0.0.1", 0, limit=far.LIMIT_BYTES, ssl=context)
    try:
        yield server.sockets[0].getsockname()[1], far
    finally:
        server.close()
        await far.close()


class TestTls(TransportConformance):
    plant: Plant

    @pytest.fixture(autouse=True)
    def _plant(self, plant: Plant) -> None:
        self.plant = plant

    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with serving(self.plant.server()) as (port, far):
            yield f"tls://127.0.0.1:{port}?cafile={self.plant.cafile}", far


# --- who is trusted


@asynccontextmanager
async def opened(port: int, plant: Plant, options: str = "", host: str = "127.0.0.1") -> AsyncIterator[Witness]:
    async with asyncio.timeout(10):
        witness = Witness()
        transport = await open_transport(f"tls://{host}:{port}?cafile={plant.cafile}{options}", lambda: witness)
        try:
            yield witness
        finally:
            transport.abort()
            await witness.is_lost()


async def refusal(url: str) -> str:
    with pytest.raises(TransportError) as caught:
        await open_transport(url, Witness)
    return str(caught.value)


async def test_a_server_is_not_trusted_when_no_authority_of_this_computer_vouches_for_it(plant: Plant) -> None:
    async with quiet(), serving(plant.server()) as (port, _):
        said = await refusal(f"tls://127.0.0.1:{port}")
    assert "does not know" in said or "does not trust" in said
    assert "cafile=/path/of/ca.pem" in said


async def test_a_server_of_another_authority_is_not_trusted(plant: Plant, tmp_path: Path) -> None:
    async with quiet(), serving(Plant(tmp_path).server()) as (port, _):
        said = await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}")
    assert "authority that this computer does not" in said


async def test_a_certificate_that_has_expired_says_so(plant: Plant) -> None:
    yesterday = dt.datetime.now(dt.UTC) - dt.timedelta(days=1)
    context = plant.server(not_before=yesterday - dt.timedelta(days=9), not_after=yesterday)
    async with quiet(), serving(context) as (port, _):
        said = await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}")
    assert "has expired" in said
    assert "check the clock" in said


async def test_a_certificate_that_is_not_valid_yet_says_so(plant: Plant) -> None:
    tomorrow = dt.datetime.now(dt.UTC) + dt.timedelta(days=1)
    context = plant.server(not_before=tomorrow, not_after=tomorrow + dt.timedelta(days=9))
    async with quiet(), serving(context) as (port, _):
        assert "is not valid yet" in await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}")


async def test_a_certificate_of_another_name_says_so_and_its_own_name_can_be_given(plant: Plant) -> None:
    async with quiet(), serving(plant.server("moxa.plant.example")) as (port, _):
        said = await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}")
        assert "made out to another address" in said
        assert "server_name=" in said
        said = await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}&server_name=other.example")
        assert "made out to another name" in said
    async with (
        serving(plant.server("moxa.plant.example")) as (port, far),
        opened(port, plant, "&server_name=moxa.plant.example") as witness,
    ):
        await far.write(b"hello")
        assert await witness.receives(5) == b"hello"


@pytest.mark.parametrize("name", [".", "a..b", ".example"])
async def test_a_server_name_that_cannot_be_one_says_so(name: str) -> None:
    said = await refusal(f"tls://127.0.0.1:1?server_name={name}")
    assert f"'{name}' cannot be the name of a TLS server" in said


async def test_nothing_switches_the_check_of_the_server_off(plant: Plant) -> None:
    async with serving(plant.server()) as (port, far), opened(port, plant) as witness:
        await far.write(b"x")
        assert witness.transport is not None
        layer = witness.transport.get_extra_info("layer")
        assert layer._tls.context.verify_mode is ssl.CERT_REQUIRED
        assert layer._tls.context.check_hostname
        assert layer._tls.context.minimum_version >= ssl.TLSVersion.TLSv1_2


# --- who we are


@pytest.mark.parametrize("newest", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
@pytest.mark.parametrize("files", [1, 2])
async def test_a_server_that_wants_our_certificate_gets_it(plant: Plant, files: int, newest: ssl.TLSVersion) -> None:
    certfile, keyfile = plant.client()
    options = f"&certfile={certfile}&keyfile={keyfile}"
    if files == 1:
        both = plant.directory / "both.pem"
        both.write_bytes(certfile.read_bytes() + keyfile.read_bytes())
        options = f"&certfile={both}"
    context = plant.server(needs_client=True)
    context.maximum_version = newest
    async with serving(context) as (port, far), opened(port, plant, options) as witness:
        await far.write(b"hello")
        assert await witness.receives(5) == b"hello"


@asynccontextmanager
async def a_server_that_raises_the_alarm(context: ssl.SSLContext) -> AsyncIterator[int]:
    """Serve one handshake as OpenSSL does by itself; asyncio hangs up without a word when one fails."""

    def serve() -> None:
        sock, _ = listening.accept()
        with sock, suppress(OSError), context.wrap_socket(sock, server_side=True):
            pass

    with socket.create_server(("127.0.0.1", 0)) as listening:
        serving = asyncio.get_running_loop().run_in_executor(None, serve)
        yield listening.getsockname()[1]
        await serving


async def test_a_server_that_gets_no_certificate_of_ours_says_what_it_wants(plant: Plant) -> None:
    context = plant.server(needs_client=True)
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    async with a_server_that_raises_the_alarm(context) as port:
        said = await refusal(f"tls://127.0.0.1:{port}?cafile={plant.cafile}")
    assert "certfile=…" in said


async def test_a_server_that_misses_our_certificate_after_the_handshake_ends_the_line_and_says_why(
    plant: Plant,
) -> None:
    """With TLS 1.3 the server looks at it when the client takes the handshake for done."""
    async with a_server_that_raises_the_alarm(plant.server(needs_client=True)) as port:
        witness = Witness()
        await open_transport(f"tls://127.0.0.1:{port}?cafile={plant.cafile}", lambda: witness)
        await witness.is_lost()
    [lost] = witness.losses
    assert isinstance(lost, ConnectionLostError)
    assert "certificate required" in str(lost)
    assert "certfile=…" in str(lost)


# --- files


async def test_files_that_cannot_be_used_say_which_and_why(plant: Plant, tmp_path: Path) -> None:
    certfile, keyfile = plant.client()
    _, other_key = plant.client("other")
    nonsense = tmp_path / "nonsense.pem"
    nonsense.write_text("no certificate")
    for options, expected in {
        "cafile=/no/such/ca.pem": "there is no cafile /no/such/ca.pem",
        "certfile=/no/such.pem": "there is no certfile /no/such.pem",
        f"certfile={certfile}&keyfile=/no/such.key": "there is no keyfile /no/such.key",
        f"cafile={tmp_path}": f"cafile {tmp_path} cannot be read",
        f"cafile={nonsense}": "holds no certificates",
        f"certfile={nonsense}": "cannot be used",
        f"certfile={certfile}&keyfile={nonsense}": "cannot be used",
        f"certfile={certfile}": "cannot be used",
        f"keyfile={keyfile}": "there is a keyfile, but no certfile",
        f"certfile={certfile}&keyfile={other_key}": "does not belong to the certificate",
    }.items():
        assert expected in await refusal(f"tls://127.0.0.1:1?{options}")


async def test_a_key_with_a_password_is_refused_and_nobody_is_asked_for_it(plant: Plant, tmp_path: Path) -> None:
    certfile, keyfile = plant.client()
    key = serialization.load_pem_private_key(keyfile.read_bytes(), None)
    protected = tmp_path / "protected.key"
    protected.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"sesame"),
        )
    )
    said = await refusal(f"tls://127.0.0.1:1?certfile={certfile}&keyfile={protected}")
    assert "is protected by a password" in said


async def test_files_are_read_in_a_thread(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    threads: set[threading.Thread] = set()
    really = ssl.create_default_context

    def watched(*arguments: Any, **options: Any) -> ssl.SSLContext:
        threads.add(threading.current_thread())
        return really(*arguments, **options)

    monkeypatch.setattr(ssl, "create_default_context", watched)
    async with serving(plant.server()) as (port, far), opened(port, plant):
        await far.write(b"x")
    assert threads
    assert threading.main_thread() not in threads


# --- far ends that are no TLS servers


@asynccontextmanager
async def a_server_that_says(answer: bytes, *, hangs_up: bool = False) -> AsyncIterator[int]:
    async with listening_on_tcp() as (port, far):

        async def answers() -> None:
            if answer:
                await far.write(answer)
            await far.read(1)
            if hangs_up:
                await far.hang_up()

        answering = asyncio.create_task(answers())
        try:
            yield port
        finally:
            answering.cancel()
            with suppress(asyncio.CancelledError, EOFError, OSError):
                await answering


async def test_a_far_end_that_speaks_no_tls_says_so() -> None:
    async with a_server_that_says(b"\r\n>POSR 0\r\n>\r\n") as port:
        said = await refusal(f"tls://127.0.0.1:{port}")
    assert "does not speak TLS" in said
    assert "tcp://" in said


async def test_a_far_end_that_hangs_up_during_the_handshake_says_so() -> None:
    async with a_server_that_says(b"", hangs_up=True) as port:
        assert "hung up during the TLS handshake" in await refusal(f"tls://127.0.0.1:{port}")


async def test_a_handshake_that_hangs_ends_in_the_time_that_was_asked_for() -> None:
    before = descriptors()
    async with a_server_that_says(b"") as port:
        said = await refusal(f"tls://127.0.0.1:{port}?connect_timeout_s=2.5")
    assert "handshake did not end within 2.5 s" in said
    assert asyncio.get_running_loop().time() == pytest.approx(2.5, abs=0.2)
    await asyncio.sleep(0.01)
    assert descriptors() <= before


async def test_a_handshake_that_is_cancelled_leaves_nothing_open() -> None:
    async with a_server_that_says(b"") as port:
        before = descriptors()
        opening = asyncio.create_task(open_transport(f"tls://127.0.0.1:{port}", Witness))
        await asyncio.sleep(1)
        assert descriptors() > before
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        await asyncio.sleep(0.01)
        assert descriptors() <= before + 1  # the server's end of it


async def test_files_that_cannot_be_read_in_time_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asyncio, "to_thread", lambda *_: asyncio.sleep(3600))
    url = TransportURL.parse("tls://127.0.0.1:1?connect_timeout_s=2")
    with pytest.raises(TransportError, match="could not be read within 2 s"):
        await open_tls(url, Witness)
    assert asyncio.get_running_loop().time() == pytest.approx(2, abs=0.1)


# --- the end


async def test_the_far_end_is_told_that_nothing_more_comes(plant: Plant) -> None:
    """So that it can tell the end of the line from a line that somebody has cut."""
    context = plant.server()
    ends: list[str] = []

    def serve() -> None:
        sock, _ = listening.accept()
        sock.settimeout(5)
        with sock, context.wrap_socket(sock, server_side=True, suppress_ragged_eofs=False) as line:
            line.sendall(b"x")
            try:
                ends.append(f"said after {line.recv(1)!r}{line.recv(1)!r}")
            except OSError as exc:
                ends.append(f"cut: {exc}")

    with socket.create_server(("127.0.0.1", 0)) as listening:
        serving = asyncio.get_running_loop().run_in_executor(None, serve)
        async with opened(listening.getsockname()[1], plant) as witness:
            await witness.receives(1)
            assert witness.transport is not None
            witness.transport.write(b"!")
            witness.transport.close()
            await witness.is_lost()
            await serving
    assert ends == ["said after b'!'b''"]


async def test_a_far_end_that_never_answers_our_farewell_holds_the_line_for_a_second_at_most(plant: Plant) -> None:
    async with serving(plant.server()) as (port, far), opened(port, plant) as witness:
        await far.write(b"x")
        reader, _ = await far._connected
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        assert witness.transport is not None
        began = asyncio.get_running_loop().time()
        witness.transport.close()
        await witness.is_lost()
        assert asyncio.get_running_loop().time() - began <= 1.05


@asynccontextmanager
async def quiet() -> AsyncIterator[None]:
    """Let servers in this process have their failed handshakes without a report of each."""
    asyncio.get_running_loop().set_exception_handler(lambda *_: None)
    yield
    await asyncio.sleep(0.01)
