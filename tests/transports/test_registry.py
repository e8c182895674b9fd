"""Openers are found by the scheme of the URL among the installed plugins."""

from __future__ import annotations

import asyncio
import importlib.metadata
from collections.abc import Callable
from importlib.metadata import EntryPoint, EntryPoints
from types import SimpleNamespace

import pytest
from tests.conformance.transport import Witness

from compax_aio.errors import TransportError
from compax_aio.transports import ProtocolFactory, TransportURL, open_transport, registry

Install = Callable[..., list[str]]


async def open_nowhere(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    transport = asyncio.Transport({"url": url})
    protocol_factory().connection_made(transport)
    return transport


async def open_in_vain(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    raise ConnectionAbortedError("no luck")


async def open_too_late(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    raise TimeoutError


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Let these plugins, (scheme, object, distribution or None), be the only installed ones; return the searches."""
    searches: list[str] = []

    def install(*plugins: tuple[str, str, str | None]) -> list[str]:
        entries = []
        for scheme, value, distribution in plugins:
            entry = EntryPoint(scheme, value, registry.ENTRY_POINT_GROUP)
            vars(entry)["dist"] = SimpleNamespace(name=distribution) if distribution else None
            entries.append(entry)

        def entry_points(*, group: str) -> EntryPoints:
            searches.append(group)
            return EntryPoints(entries)

        monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
        monkeypatch.setattr(registry, "_openers", {})
        return searches

    return install


async def test_a_plugin_opens_its_scheme_from_text_and_from_a_url(install: Install) -> None:
    install(("nowhere", f"{__name__}:open_nowhere", "compax-nowhere"))
    url = TransportURL.parse("nowhere://there?a=1")
    for text_or_url in (url.text, url):
        transport = await open_transport(text_or_url, Witness)
        assert transport.get_extra_info("url") == url


async def test_plugins_are_searched_once_a_scheme(install: Install) -> None:
    searches = install(("nowhere", f"{__name__}:open_nowhere", "compax-nowhere"))
    for _ in range(3):
        await open_transport("nowhere://there", Witness)
    assert searches == ["compax_aio.transports"]


async def test_an_unknown_scheme_names_the_known_ones_and_the_closest(install: Install) -> None:
    install(("serial", "x", "a"), ("tcp", "x", "a"))
    with pytest.raises(TransportError, match=r"no transport for seriel://; did you mean serial://\? .*: serial, tcp"):
        await open_transport("seriel:///dev/ttyUSB0", Witness)
    with pytest.raises(TransportError, match="no transport for http://; known schemes: serial, tcp"):
        await open_transport("http://moxa", Witness)


async def test_a_plugin_that_cannot_be_imported_is_named_with_the_cause(install: Install) -> None:
    install(("bad", "no_such_module:opener", "compax-bad"), ("worse", f"{__name__}:no_such_opener", None))
    with pytest.raises(TransportError, match=r"bad:// of compax-bad cannot be imported: .*no_such_module") as caught:
        await open_transport("bad://x", Witness)
    assert isinstance(caught.value.__cause__, ImportError)
    with pytest.raises(TransportError, match=r"worse:// of an unknown distribution .*: AttributeError"):
        await open_transport("worse://x", Witness)


async def test_a_scheme_that_two_packages_claim_is_opened_by_neither(install: Install) -> None:
    install(("tcp", "x", "compax-b"), ("tcp", "x", "compax-a"))
    with pytest.raises(TransportError, match="tcp:// is claimed by compax-a and by compax-b; uninstall"):
        await open_transport("tcp://moxa:1", Witness)


async def test_an_error_of_the_system_that_an_opener_lets_escape_becomes_a_transport_error(install: Install) -> None:
    install(("vain", f"{__name__}:open_in_vain", "a"), ("late", f"{__name__}:open_too_late", "a"))
    with pytest.raises(TransportError, match="vain://u:\\*\\*\\*@x could not be opened: no luck") as caught:
        await open_transport("vain://u:secret@x", Witness)
    assert isinstance(caught.value.__cause__, ConnectionAbortedError)
    with pytest.raises(TransportError, match="late://x could not be opened: TimeoutError"):
        await open_transport("late://x", Witness)


async def test_our_own_schemes_are_installed() -> None:
    names = importlib.metadata.entry_points(group=registry.ENTRY_POINT_GROUP).names
    assert {"loop", "serial", "tcp", "unix"} <= names
