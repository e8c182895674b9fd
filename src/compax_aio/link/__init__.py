"""Turns: the asyncio.Protocol that runs any device's line protocol, one exchange at a time."""
