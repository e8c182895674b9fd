"""From a URL to an open line: the opener of each scheme is found among the installed plugins."""

from __future__ import annotations

import asyncio
import difflib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final, Protocol

from compax_aio.errors import TransportError

from .url import TransportURL

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["ENTRY_POINT_GROUP", "Opener", "ProtocolFactory", "open_transport", "opened_by"]

ENTRY_POINT_GROUP: Final = "compax_aio.transports"

ProtocolFactory = Callable[[], asyncio.Protocol]


class Opener(Protocol):
    """
    Open the line that *url* names and connect a protocol of *protocol_factory* to it.

    A package adds a scheme by naming its opener in the entry-point group ``compax_aio.transports``; the entry's name
    is the scheme. ``tests/conformance`` holds what the transport must do.
    """

    async def __call__(self, url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        """
        Return with ``connection_made`` done.

        The event loop is never blocked, and a cancelled opener leaves nothing open. :meth:`asyncio.Transport.abort`
        ends in ``connection_lost`` within a second, even when the far end does not read.

        Raises:
            TransportError: The line could not be opened; the message says why and what to do.
        """


_openers: dict[str, Opener] = {}


async def open_transport(url: str | TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open the line that *url* names and connect a protocol of *protocol_factory* to it.

    Args:
        url: For instance ``serial:///dev/ttyUSB0?baudrate=9600``, ``tcp://moxa:4001`` or ``loop://name``.
        protocol_factory: Called without arguments, gives the :class:`asyncio.Protocol`.

    Returns:
        The transport; ``connection_made`` has run.

    Raises:
        TransportError: The URL is malformed, nothing is installed for its scheme, or the line could not be opened.
    """
    if isinstance(url, str):
        url = TransportURL.parse(url)
    opener = _openers.get(url.scheme)
    if opener is None:
        # Plugins are searched on disk and imported: in a thread, and once.
        opener = _openers[url.scheme] = await asyncio.to_thread(_find, url.scheme)
    try:
        return await opener(url, protocol_factory)
    except OSError as exc:
        raise TransportError(f"{url} could not be opened: {str(exc) or type(exc).__name__}") from exc


@contextmanager
def opened_by(opener: Opener, scheme: str) -> Iterator[None]:
    """
    Let *opener* open all URLs of *scheme* until the block is left, whatever is installed for it: for tests.

    Args:
        opener: What opens them.
        scheme: In lower case, without ``://``.
    """
    before = _openers.get(scheme)
    _openers[scheme] = opener
    try:
        yield
    finally:
        if before is None:
            del _openers[scheme]
        else:
            _openers[scheme] = before


def _find(scheme: str) -> Opener:
    # Here, because it takes longer to import than all the rest of this package.
    from importlib.metadata import entry_points  # noqa: PLC0415

    plugins = entry_points(group=ENTRY_POINT_GROUP)
    found = [plugin for plugin in plugins if plugin.name == scheme]
    if not found:
        known = sorted({plugin.name for plugin in plugins})
        close = difflib.get_close_matches(scheme, known, n=1)
        raise TransportError(
            f"there is no transport for {scheme}://",
            hint=(f"did you mean {close[0]}://? " if close else "") + f"known schemes: {', '.join(known)}",
        )
    if len(found) > 1:
        raise TransportError(
            f"{scheme}:// is claimed by {' and by '.join(sorted(map(_distribution, found)))}",
            hint="uninstall all but one of them",
        )
    try:
        opener: Opener = found[0].load()
    except Exception as exc:  # importing a plugin runs its code, which may raise anything
        raise TransportError(
            f"the transport for {scheme}:// of {_distribution(found[0])} cannot be imported: "
            f"{type(exc).__name__}: {exc}",
            hint=f"it is named as {found[0].value!r} by that package; reinstall or uninstall it",
        ) from exc
    return opener


def _distribution(plugin: EntryPoint) -> str:
    return plugin.dist.name if plugin.dist is not None else "an unknown distribution"
