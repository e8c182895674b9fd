"""Bytes: a URL names a line, and opening it gives an ordinary asyncio transport."""

from .registry import Opener, ProtocolFactory, open_transport
from .url import TransportURL

__all__ = ["Opener", "ProtocolFactory", "TransportURL", "open_transport"]
