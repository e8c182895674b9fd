"""Unix socket lines: the conformance suite, and every reason for which one cannot be opened."""

from __future__ import annotations

import asyncio
import socket
import tempfile
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from tests.conformance.far_ends import FarEnd, StreamFarEnd
from tests.conformance.transport import TransportConformance, Witness, descriptors

from compax_aio.errors import TransportError
from compax_aio.transports import open_transport

pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="no Unix sockets here")


class TestUnix(TransportConformance):
    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        far = StreamFarEnd()
        with tempfile.TemporaryDirectory() as directory:
            path = f"{directory}/drive 1.sock"
            server = await asyncio.start_unix_server(far.accept, path, limit=far.LIMIT_BYTES)
            try:
                yield f"unix://{path.replace(' ', '%20')}", far
            finally:
                server.close()
                await far.close()
                await server.wait_closed()


async def test_a_missing_socket_says_so(tmp_path: Path) -> None:
    with pytest.raises(TransportError, match=f"there is no socket {tmp_path}/none.sock.*program"):
        await open_transport(f"unix://{tmp_path}/none.sock", Witness)


async def test_a_file_that_is_no_socket_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TransportError, match=f"{tmp_path}/file is not a socket"):
        await open_transport(f"unix://{tmp_path}/file", Witness)


async def test_a_socket_on_which_nothing_listens_says_so(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as left_behind:
        left_behind.bind(f"{tmp_path}/left.sock")
    with pytest.raises(TransportError, match=r"nothing listens on the socket .*left.sock.*start it again"):
        await open_transport(f"unix://{tmp_path}/left.sock", Witness)


async def test_a_socket_that_is_not_ours_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    fails_to_connect(monkeypatch, PermissionError(13, "Permission denied"))
    with pytest.raises(TransportError, match=r"no permission to connect to the socket /run/drive.sock.*owner"):
        await open_transport("unix:///run/drive.sock", Witness)


async def test_a_program_that_takes_no_more_connections_says_so(tmp_path: Path) -> None:
    """asyncio by itself takes such a socket for connected, and loses it at the first byte."""
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(f"{tmp_path}/busy.sock")
        listening.listen(0)
        before = descriptors()
        async with asyncio.timeout(10), AsyncExitStack() as lines:

            async def fill_the_queue() -> None:
                for _ in range(20):
                    witness = Witness()
                    transport = await open_transport(f"unix://{tmp_path}/busy.sock", lambda: witness)  # noqa: B023
                    lines.push_async_callback(witness.is_lost)
                    lines.callback(transport.abort)

            with pytest.raises(TransportError, match=r"busy.sock takes no more connections; does it hang"):
                await fill_the_queue()
        assert descriptors() == before


async def test_any_other_trouble_is_told_as_the_system_tells_it() -> None:
    with pytest.raises(TransportError, match=r"could not be connected to: .*too long"):
        await open_transport(f"unix:///{'x' * 500}", Witness)


async def test_a_platform_without_unix_sockets_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    await open_nothing()  # find the opener before the platform changes
    monkeypatch.delattr(socket, "AF_UNIX")
    with pytest.raises(TransportError, match="no Unix sockets; use tcp://"):
        await open_transport("unix:///run/drive.sock", Witness)


@pytest.mark.parametrize("url", ["unix://run/drive.sock", "unix://"])
async def test_a_path_takes_three_slashes(url: str) -> None:
    with pytest.raises(TransportError, match=r"unix:///run/drive.sock"):
        await open_transport(url, Witness)


async def open_nothing() -> None:
    with pytest.raises(TransportError):
        await open_transport("unix:///no/such/socket", Witness)


def fails_to_connect(monkeypatch: pytest.MonkeyPatch, error: OSError) -> None:
    class Failing(socket.socket):
        def connect(self, address: object) -> None:
            raise error

    monkeypatch.setattr(socket, "socket", Failing)
