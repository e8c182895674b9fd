"""Bytes: one opener a URL scheme, each giving a plain asyncio.Transport."""
