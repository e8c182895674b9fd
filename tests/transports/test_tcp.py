"""TCP lines: the conformance suite, the socket's options, and every reason for which one cannot be opened."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import pytest
from tests.conformance.far_ends import FarEnd, listening_on_tcp
from tests.conformance.transport import TransportConformance, Witness

from compax_aio.errors import TransportError
from compax_aio.transports import open_transport


class TestTcp(TransportConformance):
    @asynccontextmanager
    async def line(self) -> AsyncIterator[tuple[str, FarEnd]]:
        async with listening_on_tcp() as (port, far):
            yield f"tcp://127.0.0.1:{port}", far


async def open_and_close(url: str) -> dict[str, Any]:
    witness = Witness()
    transport = await open_transport(url, lambda: witness)
    sock = transport.get_extra_info("socket")
    options = {
        name: sock.getsockopt(getattr(socket, level), getattr(socket, name))
        for level, name in (
            ("SOL_SOCKET", "SO_KEEPALIVE"),
            ("IPPROTO_TCP", "TCP_NODELAY"),
            ("IPPROTO_TCP", "TCP_KEEPIDLE"),
            ("IPPROTO_TCP", "TCP_USER_TIMEOUT"),
        )
        if hasattr(socket, name)
    }
    transport.abort()
    await witness.is_lost()
    return options


async def test_a_dead_far_end_is_noticed_and_no_byte_waits_for_company() -> None:
    async with listening_on_tcp() as (port, _):
        options = await open_and_close(f"tcp://127.0.0.1:{port}")
    assert options["SO_KEEPALIVE"]
    assert options["TCP_NODELAY"]
    assert options.get("TCP_KEEPIDLE", 10) == 10
    assert options.get("TCP_USER_TIMEOUT", 25_000) == 25_000


@pytest.mark.skipif(not socket.has_ipv6 or not Path("/proc/net/if_inet6").exists(), reason="no IPv6 here")
async def test_an_ipv6_address_is_written_in_brackets() -> None:
    async with listening_on_tcp("::1") as (port, _):
        assert await open_and_close(f"tcp://[::1]:{port}")


async def test_the_next_address_is_tried_when_the_first_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    async with listening_on_tcp() as (port, _):
        resolve(monkeypatch, ("127.0.0.1", free_port()), ("127.0.0.1", port))
        assert await open_and_close(f"tcp://somewhere:{port}")


async def test_the_next_address_is_tried_when_the_first_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    async with listening_on_tcp() as (port, _):
        silent = ("127.0.0.1", 9)
        resolve(monkeypatch, silent, ("127.0.0.1", port))
        never_answers(monkeypatch, silent)
        assert await open_and_close(f"tcp://somewhere:{port}")
    assert asyncio.get_running_loop().time() == pytest.approx(2.5, abs=0.1)


async def test_a_refused_connection_says_so() -> None:
    port = free_port()
    with pytest.raises(TransportError, match=f"127.0.0.1 port {port} refused.*port number right"):
        await open_transport(f"tcp://127.0.0.1:{port}", Witness)


@pytest.mark.parametrize("host", ["no-such-host.invalid", "a..b"])
async def test_an_unknown_host_says_so(host: str) -> None:
    with pytest.raises(TransportError, match=f"host name '{host}' is not known.*check its spelling"):
        await open_transport(f"tcp://{host}:1", Witness)


@pytest.mark.parametrize("number", [errno.ENETUNREACH, errno.EHOSTUNREACH])
async def test_an_unreachable_host_says_so(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    fails_to_connect(monkeypatch, OSError(number, os.strerror(number)))
    with pytest.raises(TransportError, match=r"10.9.8.7 port 4001 is unreachable.*check the cable"):
        await open_transport("tcp://10.9.8.7:4001", Witness)


async def test_a_silent_host_says_so_after_the_time_that_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    never_answers(monkeypatch, ("10.9.8.7", 4001))
    with pytest.raises(TransportError, match=r"10.9.8.7 port 4001 did not answer within 2.5 s.*connect_timeout_s"):
        await open_transport("tcp://10.9.8.7:4001?connect_timeout_s=2.5", Witness)
    assert asyncio.get_running_loop().time() == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize("scheme", ["tcp", "tls", "rfc2217"])
async def test_a_name_that_nobody_resolves_costs_no_more_time_than_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    async def getaddrinfo(*_: object, **__: object) -> list[Any]:
        await asyncio.sleep(3600)
        return []

    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", getaddrinfo)
    with pytest.raises(TransportError, match=r"moxa port 4001 did not answer within 1.5 s"):
        await open_transport(f"{scheme}://moxa:4001?connect_timeout_s=1.5", Witness)
    assert asyncio.get_running_loop().time() == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("scheme", ["tls", "rfc2217"])
async def test_greetings_have_only_the_time_that_connecting_has_left(
    monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    loop = asyncio.get_running_loop()
    really_connect = loop.sock_connect

    async def sock_connect(sock: socket.socket, address: Any) -> None:
        await asyncio.sleep(1)
        await really_connect(sock, address)

    async with listening_on_tcp() as (port, _):
        monkeypatch.setattr(loop, "sock_connect", sock_connect)
        with pytest.raises(TransportError, match=r"127.0.0.1 port .* took the connection, but .* within 1.5 s"):
            await open_transport(f"{scheme}://127.0.0.1:{port}?connect_timeout_s=1.5", Witness)
        assert loop.time() == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("scheme", ["tcp", "tls", "rfc2217"])
@pytest.mark.parametrize("timeout_s", ["0", "-1", "nan", "inf", "x", "1e9"])
async def test_a_time_out_that_is_none_is_refused(scheme: str, timeout_s: str) -> None:
    with pytest.raises(TransportError, match="connect_timeout_s is a number above 0 and up to 3600"):
        await open_transport(f"{scheme}://127.0.0.1:1?connect_timeout_s={timeout_s}", Witness)


@pytest.mark.parametrize("scheme", ["tcp", "tls", "rfc2217"])
async def test_a_password_in_a_url_is_refused_and_not_shown(scheme: str) -> None:
    with pytest.raises(TransportError, match="takes no user name or password") as caught:
        await open_transport(f"{scheme}://me:sesame@127.0.0.1:1", Witness)
    assert "sesame" not in str(caught.value)


async def test_any_other_trouble_is_told_as_the_system_tells_it(monkeypatch: pytest.MonkeyPatch) -> None:
    fails_to_connect(monkeypatch, OSError(errno.EADDRNOTAVAIL, "strange trouble"))
    with pytest.raises(TransportError, match=r"10.9.8.7 port 4001 could not be connected to.*strange trouble"):
        await open_transport("tcp://10.9.8.7:4001", Witness)


@pytest.mark.parametrize(("url", "missing"), [("tcp://moxa", "port number"), ("tcp://:4001", "host")])
async def test_a_url_without_host_or_port_says_what_is_missing(url: str, missing: str) -> None:
    with pytest.raises(TransportError, match=f"{url}' has no {missing}; write it as tcp://"):
        await open_transport(url, Witness)


async def test_a_protocol_that_cannot_be_made_leaves_no_socket_open() -> None:
    def fail() -> asyncio.Protocol:
        raise ZeroDivisionError

    async with listening_on_tcp() as (port, _):
        with pytest.raises(ZeroDivisionError):  # and no ResourceWarning, which would be an error
            await open_transport(f"tcp://127.0.0.1:{port}", fail)


def free_port() -> int:
    with closing(socket.socket()) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def resolve(monkeypatch: pytest.MonkeyPatch, *addresses: tuple[str, int]) -> None:
    async def getaddrinfo(*_: object, **__: object) -> list[Any]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", address) for address in addresses]

    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", getaddrinfo)


def never_answers(monkeypatch: pytest.MonkeyPatch, silent: tuple[str, int]) -> None:
    loop = asyncio.get_running_loop()
    really_connect = loop.sock_connect

    async def sock_connect(sock: socket.socket, address: Any) -> None:
        if address == silent:
            await loop.create_future()
        await really_connect(sock, address)

    monkeypatch.setattr(loop, "sock_connect", sock_connect)


def fails_to_connect(monkeypatch: pytest.MonkeyPatch, error: OSError) -> None:
    async def sock_connect(sock: socket.socket, address: Any) -> None:
        raise error

    monkeypatch.setattr(asyncio.get_running_loop(), "sock_connect", sock_connect)
